// Rays of a pinhole, thin-lens or orthographic camera. Same struct as in `world/camera.rs`.

struct Camera {
    // Centre of the lens, or of the plane that parallel rays start on.
    position: vec3f,
    width: u32,
    // Right in the image.
    s: vec3f,
    height: u32,
    // Up.
    t: vec3f,
    // Lens radius; 0: pinhole.
    aperture: f32,
    // Forward.
    n: vec3f,
    focus_distance: f32,
    // Image centre and pixel size, on the plane at distance 1; with parallel rays, in scene units.
    shift: vec2f,
    pixel: f32,
    // Medium that rays start in.
    medium: u32,
    // 1: orthographic, with depth of field if there is an aperture.
    is_parallel: u32,
}

struct CameraRay {
    origin: vec3f,
    dir: vec3f,
}

// `image`: position in pixels, (0, 0) the top left corner, y down. `lens`: in [0, 1)^2.
fn camera_ray(camera: Camera, image: vec2f, lens: vec2f) -> CameraRay {
    let frame = Frame(camera.s, camera.t, camera.n);
    let film = vec3f(
        (image.x - 0.5 * f32(camera.width)) * camera.pixel + camera.shift.x,
        (0.5 * f32(camera.height) - image.y) * camera.pixel + camera.shift.y,
        1.0,
    );
    let parallel = camera.is_parallel == 1u;
    // With parallel rays, each image point has its own lens.
    let middle = select(vec3f(0.0), vec3f(film.xy, 0.0), parallel);
    if (camera.aperture == 0.0) {
        if (parallel) { return CameraRay(camera.position + to_world(frame, middle), camera.n); }
        return CameraRay(camera.position, unit_vector(to_world(frame, film)));
    }
    let on_lens = vec3f(concentric_disk(lens) * camera.aperture, 0.0);
    var start = on_lens;
    if (parallel) { start = middle + on_lens; }
    let in_focus = select(film, vec3f(0.0, 0.0, 1.0), parallel) * camera.focus_distance;
    return CameraRay(
        camera.position + to_world(frame, start),
        unit_vector(to_world(frame, in_focus - on_lens)),
    );
}
