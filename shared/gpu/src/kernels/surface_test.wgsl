// Kernels for tests of `surface.wgsl`.

struct Asked {
    origin: vec3f,
    // Medium that the ray is in.
    around: u32,
    dir: vec3f,
    // Object to pass through.
    ignored: u32,
    // Direction of a ray from the first one's end.
    wi: vec3f,
    distance: f32,
}

struct Answer {
    at: SurfacePoint,
    spawned: vec3f,
    beyond: u32,
    origin: vec3f,
    distance: f32,
    dir: vec3f,
    kind: u32,
    local_wo: vec3f,
    two_sided: u32,
    tangent: vec3f,
    reflectance: vec3f,
}

@group(0) @binding(0) var<storage, read> asked: array<Asked>;
@group(0) @binding(1) var<storage, read_write> answers: array<Answer>;

fn each(i: u32) {
    if (i >= arrayLength(&asked)) { return; }
    let ray = Ray(asked[i].origin, asked[i].dir);
    var answer: Answer;
    answer.at = first_hit(ray, Ignored(asked[i].ignored, 0u));
    if (answer.at.object != NOTHING) {
        answer.spawned = spawn_ray(answer.at, asked[i].wi).origin;
        let aimed = ray_to(answer.at, asked[i].wi, asked[i].distance);
        answer.origin = aimed.ray.origin;
        answer.dir = aimed.ray.dir;
        answer.distance = aimed.distance;
        answer.beyond = medium_beyond(answer.at, asked[i].wi, asked[i].around);
        let interaction = bsdf_at(surfaces[answer.at.object].material, answer.at, ray.dir);
        answer.kind = interaction.material.kind;
        answer.two_sided = interaction.material.bits & TWO_SIDED;
        answer.reflectance = interaction.material.reflectance;
        answer.local_wo = interaction.local_wo;
        answer.tangent = interaction.frame.s;
    }
    answers[i] = answer;
}
