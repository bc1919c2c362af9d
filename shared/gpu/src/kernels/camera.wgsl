// Rays of a pinhole or a thin lens, or parallel ones. `world/camera.rs` has the same struct.

struct Camera {
    // Centre of the lens, or of the plane that parallel rays start on.
    position: vec3f,
    width: u32,
    // To the right of the image.
    s: vec3f,
    height: u32,
    // Up.
    t: vec3f,
    // Radius of the lens.
    aperture: f32,
    // Forward.
    n: vec3f,
    focus_distance: f32,
    // The middle of the image, and the side of a pixel, on the plane at distance 1; of parallel rays in scene units.
    shift: vec2f,
    pixel: f32,
    // Number of the medium that rays start in.
    medium: u32,
    // Rays are parallel, in focus or not.
    is_parallel: u32,
}

struct CameraRay {
    origin: vec3f,
    dir: vec3f,
}

// Through a point of the image, in pixels, (0, 0) the top left corner, y down. `lens`: in [0, 1)^2.
fn camera_ray(camera: Camera, image: vec2f, lens: vec2f) -> CameraRay {
    let frame = Frame(camera.s, camera.t, camera.n);
    let film = vec3f(
        (image.x - 0.5 * f32(camera.width)) * camera.pixel + camera.shift.x,
        (0.5 * f32(camera.height) - image.y) * camera.pixel + camera.shift.y,
        1.0,
    );
    let parallel = camera.is_parallel == 1u;
    // Each point of an image by parallel rays has a lens of its own.
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
