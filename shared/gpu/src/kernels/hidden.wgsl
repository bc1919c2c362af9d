// Whether a wall stands between a point of a segment and what it sees of a beam. Goes after `planes.wgsl`, `hull.wgsl`
// and `shade.wgsl`, and before `estimate.wgsl`; `open.wgsl` replaces it in scenes without walls.

@group(1) @binding(53) var<storage, read> walled_beams: array<Beam>;

// Whether a segment leaves the box of a closed scene: outer planes count then.
fn escapes(segment: Segment) -> bool {
    if (hull.is_closed == 0u) { return false; }
    let end = segment.origin + segment.dir * segment.length;
    let far = vec3f(1e-5f * hull_size());
    return any(end < hull.low - far) || any(end > hull.high + far);
}

// Whether walls may hide the beam, at distance `s` along it, from the point at distance `t` along the segment.
fn may_hide(segment: Segment, piece: Piece, t: f32, s: f32) -> bool {
    if ((piece.medium & HAS_PLANES) == 0u) { return false; }
    let beyond = escapes(segment);
    if (!beyond && (piece.medium & IS_WALLED) == 0u) { return false; }
    let walls = walls_of(walled_beams[piece.beam].walls);
    let point = segment.origin + segment.dir * t;
    let across = cross3(piece.dir, point - piece.origin);
    let distance2 = dot3(across, across);
    // Finds the range of the piece that no plane is near, and whether the point is behind a plane that is. One loop
    // does both: software drivers limit the number of iterations.
    var clear = all_clear();
    var is_behind = false;
    for (var i = walls.x; i < walls.y; i++) {
        let plane = planes[i];
        clear = without_plane(clear, plane, piece.start, piece.end);
        is_behind = is_behind || (s > plane.range.x && s < plane.range.y && distance2 > plane.clear2
            && point.x * plane.n.x + point.y * plane.n.y + point.z * plane.n.z < plane.at);
    }
    return is_behind && (beyond || !(s > clear.x && s < clear.y));
}

// Whether a wall does hide it; traces a ray, so ask `may_hide` first.
fn hides(segment: Segment, piece: Piece, t: f32, s: f32) -> bool {
    let walls = walls_of(walled_beams[piece.beam].walls);
    let length = walled_beams[piece.beam].length;
    var at = select(s, 0.0, s < 0.0);
    at = select(at, length, at > length);
    var seen = piece.origin + piece.dir * at;
    // Lifted off the surfaces that it starts or ends on, so that curved ones do not hide it.
    let height = 0.25 * (piece.radius + piece.radius_slope * at);
    for (var i = walls.x; i < walls.y; i++) {
        let n = planes[i].n;
        if (!all(n == vec3f(0.0))) {
            var rise = height - (dot3(n, seen) - planes[i].at);
            rise = select(rise, 0.0, rise < 0.0);
            rise = select(rise, 2.0 * height, rise > 2.0 * height);
            seen += n * rise;
        }
    }
    return walls_stand_between(seen, segment.origin + segment.dir * t - seen);
}
