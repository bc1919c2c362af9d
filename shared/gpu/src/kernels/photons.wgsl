// Sums up, for every request, the photons whose kernels cover its point, in their order. Box tests are mere
// comparisons, so the choice of boxes to look at changes no bit.

struct Bounds {
    low: vec3f,
    spare_low: u32,
    high: vec3f,
    spare_high: u32,
}

struct Level {
    here: u32,
    below: u32,
}

struct Levels {
    // Number of the last level, which has one node.
    top: u32,
    spare: u32,
    all: array<Level>,
}

@group(1) @binding(0) var<storage, read> sizes: Sizes;
@group(1) @binding(1) var<storage, read> requests: array<PhotonRequest>;
// Parts of the BVH: first, and one past the last.
@group(0) @binding(2) var<storage, read> range: vec2u;
@group(1) @binding(3) var<storage, read_write> radiance: array<vec3f>;
// By request, for BY_BSDF: its material.
@group(1) @binding(4) var<storage, read> asked_surfaces: array<Material>;
// For `waves.wgsl`.
@group(1) @binding(5) var<storage, read> key: array<vec2u>;
// Light group that counts, 1-based; 0: all light.
@group(0) @binding(6) var<storage, read> of_light_group: u32;
@group(1) @binding(40) var<storage, read> photon_sizes: Sizes;
@group(1) @binding(41) var<storage, read> photons: array<SurfacePhoton>;
@group(1) @binding(42) var<storage, read> photon_nodes: array<Bounds>;
@group(0) @binding(43) var<storage, read> photon_levels: Levels;

// A part is a node of this level, with about 4^7 photons, or of the last level if that is lower. This keeps the turns
// of all loops below 2^16, even with a few hundred rays.
const PART_LEVEL: u32 = 6u;

// A photon whose normal has a smaller cosine than this with the point's belongs to another surface.
const MIN_NORMAL_COSINE: f32 = 0.7;
// So does one further off the tangent plane than this share of its radius.
const MAX_PLANE_DISTANCE: f32 = 0.25;
// Bound on shading over geometric cosine, so that no photon at a grazing angle outshines the rest.
const MAX_COSINE_RATIO: f32 = 10.0;
// Expected photons of a pass in a kernel, for photons reflected or scattered more than once.
const DEEPER: f32 = 1.0;

const PI: f32 = 3.14159274;
const INV_PI: f32 = 0.31830987;

// A request, and what all of its photons share.
struct Asked {
    point: vec3f,
    kind: u32,
    ng: vec3f,
    // MIS weight, if all photons have the same.
    share: f32,
    ns: vec3f,
    // Cosine between the shading normal and wo.
    cos_wo: f32,
    value: vec3f,
    // Both normals are equal.
    is_even: bool,
    // The request's index and bits.
    number: u32,
    bits: u32,
    // Class bits of lights whose photons do not count.
    hides: u32,
    photon_scale: f32,
    density: f32,
    // In the shading frame.
    wo: vec3f,
    // Photons can go from here to where the path came from.
    goes_back: bool,
    cos_out: f32,
    frame: Frame,
    shadowing: Shadowing,
}

fn part_level() -> u32 { return min(photon_levels.top, PART_LEVEL); }

// Number of nodes of a level; there must be photons.
fn nodes_of(level: u32) -> u32 { return ((photon_sizes.count - 1u) >> (2u * level + 2u)) + 1u; }

fn end_of_parts() -> u32 {
    if (photon_sizes.count == 0u) { return 0u; }
    return min(range.y, nodes_of(part_level()));
}

// Cosine-weighted pdf.
fn pdf_of(cosine: f32) -> f32 { return not_below_zero(abs(cosine)) * INV_PI; }

fn asked_by(number: u32, request: PhotonRequest) -> Asked {
    let cos_wo = dot3(request.wo, request.ns);
    let cos_out = dot3(request.ng, request.wo);
    var share = 1.0;
    // Photons go back only if nothing here depends on the viewing side.
    let kind = kind_of(request.kind);
    let goes_back = kind == LAST_COUNTED && cos_wo * cos_out > 0.0 && !has_map(request.shadowing);
    if (goes_back) {
        share = path_weight(quotient(DEEPER * pdf_of(cos_wo), abs(cos_out)), request.density);
    }
    let is_even = all(request.ns == request.ng);
    let frame = frame_around(request.ns);
    return Asked(
        request.point, kind, request.ng, share, request.ns, cos_wo, request.value, is_even,
        number, request.bits, lights_of(request.kind), request.photon_scale, request.density,
        to_local(frame, request.wo), goes_back, cos_out, frame, request.shadowing,
    );
}

// BSDF value for a photon's direction, times the photon's MIS weight.
fn by_bsdf(asked: Asked, k: u32, cos_g: f32) -> vec3f {
    let m = asked_surfaces[asked.number];
    let wi = to_local(asked.frame, photons[k].wi);
    let is_last = asked.kind == LAST_COUNTED;
    let scattered = bsdf_scatter(m, asked.wo, wi, RADIANCE, is_last, asked.shadowing);
    let pdf = scattered.pdf;
    let f = scattered.value;
    if (all(f == vec3f(0.0))) { return f; }
    if (asked.kind == ALL_COUNTED || (is_last && !asked.goes_back)) { return f; }
    // The path itself finds light from surfaces.
    if (asked.kind == LATER_COUNTED && arrival_of(photons[k].arrival) == ARRIVED_SURFACE) { return vec3f(0.0); }
    let found_by = technique_of(photons[k].found_by);
    if (!is_last && found_by == BY_PHOTONS) { return f; }
    if (!is_last && !(found_by == BY_BOTH)) { return vec3f(0.0); }
    if (is_last) { return f * path_weight(quotient(DEEPER * pdf, abs(asked.cos_out)), asked.density); }
    let of_paths = quotient(pdf, abs(cos_g));
    return f * (1.0 - path_weight(photons[k].expected * asked.photon_scale, of_paths));
}

// MIS weight of a photon, by its cosines with the shading and the geometric normal.
fn weight_of(asked: Asked, k: u32, cos_s: f32, cos_g: f32) -> f32 {
    if (asked.kind == ALL_COUNTED || asked.kind == LAST_COUNTED) { return asked.share; }
    // The path itself finds light from surfaces.
    if (asked.kind == LATER_COUNTED && arrival_of(photons[k].arrival) == ARRIVED_SURFACE) { return 0.0; }
    switch technique_of(photons[k].found_by) {
        case BY_PHOTONS: { return 1.0; }
        case BY_PATHS, BY_PATHS_BY_RULE: { return 0.0; }
        default: { return 1.0 - path_weight(photons[k].expected, quotient(pdf_of(cos_s), abs(cos_g))); }
    }
}

// Whether a wall may stand between a photon and a point in its kernel.
fn may_hide(k: u32, point: vec3f) -> bool {
    // False for NaN.
    let is_before = dot3(photons[k].beyond, point - photons[k].point) < 1.0;
    return photons[k].height > 0.0 && !is_before;
}

// Whether one does: traces a ray.
fn is_hidden_from(k: u32, point: vec3f) -> bool {
    let ng = photons[k].ng;
    let n = ng * with_sign(1.0, dot3(ng, photons[k].wi));
    let way = point - photons[k].point;
    return walls_stand_between(photons[k].point + n * photons[k].height, way - n * dot3(way, n));
}

// Whether rules leave a photon's light to paths, or keep it off where these come from.
fn is_kept_off(asked: Asked, k: u32) -> bool {
    let word = photons[k].found_by;
    let by_gloss = (asked.bits & OFF_SURFACES) != 0u && arrival_of(photons[k].arrival) == ARRIVED_SURFACE;
    let by_rule = (asked.bits & NOT_BY_RULE) != 0u && technique_of(word) == BY_PATHS_BY_RULE;
    return (word & asked.hides) != 0u || by_gloss || by_rule;
}

// Contribution of a photon, regardless of walls and without its wavelength's weight.
fn brought(asked: Asked, k: u32) -> vec3f {
    let nothing = vec3f(0.0);
    // Most candidates are near, but do not cover the point.
    let offset = photons[k].point - asked.point;
    let radius = photons[k].radius;
    let radius2 = radius * radius;
    let distance2 = dot3(offset, offset);
    if (!(distance2 < radius2)) { return nothing; }
    let ng = photons[k].ng;
    let cos = dot3(ng, asked.ng);
    let height = dot3(offset, ng);
    if (!(cos >= MIN_NORMAL_COSINE && abs(height) <= MAX_PLANE_DISTANCE * radius)) { return nothing; }

    let seen_by = select(SEEN_BY_WIDE_LOBES, SEEN_BY_FOLLOWED_LOBES, (asked.bits & SEEN_BY_FOLLOWED) != 0u);
    if ((photons[k].arrival & seen_by) == 0u) { return nothing; }
    if (is_kept_off(asked, k)) { return nothing; }
    if (!may_see(asked.bits >> WAVE_OF_REQUEST, wave_of_photon(photons[k].arrival))) { return nothing; }
    if (HAS_LIGHT_GROUPS) {
        let is_other = of_light_group > 0u && of_light_group != photons[k].arrival >> LIGHT_GROUP_OF_PHOTON;
        if (is_other) { return nothing; }
    }
    let wi = photons[k].wi;
    let cos_g = dot3(asked.ng, wi);
    let cos_s = select(dot3(wi, asked.ns), cos_g, asked.is_even);
    // The photon arrived on another side than the path, or the two normals disagree about its side.
    let is_by_bsdf = (asked.bits & BY_BSDF) != 0u;
    if (!is_by_bsdf && cos_s * asked.cos_wo <= 0.0) { return nothing; }
    if (!asked.is_even && cos_s * cos_g <= 0.0) { return nothing; }
    let x = quotient(distance2 - height * height, radius2);
    let kernel = quotient(2.0, PI * radius2) * (1.0 - x) * cos;
    var cosines = 1.0;
    if (!asked.is_even) {
        // Flux is counted on the geometric surface; the BSDF's cosine is with the shading normal.
        cosines = quotient(cos_s, cos_g);
        cosines = select(MAX_COSINE_RATIO, cosines, cosines < MAX_COSINE_RATIO);
    }
    if (is_by_bsdf) { return asked.value * by_bsdf(asked, k, cos_g) * photons[k].power * (kernel * cosines); }
    return asked.value * photons[k].power * (kernel * cosines * weight_of(asked, k, cos_s, cos_g));
}

// State of a stackless BVH traversal: a node that contains the point is entered; the next one is beside it or above.
struct Walk {
    // Next node.
    level: u32,
    i: u32,
    // Photons left of the leaf entered last.
    k: u32,
    end: u32,
    sum: vec3f,
    // Contribution of the last photon, if no wall hides it.
    brought: vec3f,
}

fn contains(box: Bounds, point: vec3f) -> bool { return all(box.low <= point) && all(point <= box.high); }

// Goes on to the next photon that a wall may hide, and returns its number, or NOTHING at the end; the caller adds it.
// Rays stay out of this loop, which invocations run in lockstep.
fn walk_on(walk: ptr<function, Walk>, asked: Asked, top: u32, end_part: u32) -> u32 {
    var s = *walk;
    var found = NOTHING;
    loop {
        while (s.k < s.end && found == NOTHING) {
            let more = brought(asked, s.k);
            if (any(more > vec3f(0.0))) {
                let as_it_is = as_found(more, asked.bits >> WAVE_OF_REQUEST, wave_of_photon(photons[s.k].arrival));
                if (may_hide(s.k, asked.point)) {
                    found = s.k;
                    s.brought = as_it_is;
                } else {
                    s.sum += as_it_is;
                }
            }
            s.k += 1u;
        }
        if (found != NOTHING || (s.level == top && s.i >= end_part)) { break; }
        if (contains(photon_nodes[photon_levels.all[s.level].here + s.i], asked.point)) {
            if (s.level > 0u) {
                s.level -= 1u;
                s.i *= 4u;
                continue;
            }
            s.k = s.i * 4u;
            s.end = min(s.k + 4u, photon_sizes.count);
        }
        s.i += 1u;
        while (s.level < top && ((s.i & 3u) == 0u || s.i >= nodes_of(s.level))) {
            s.i = (s.i - 1u) / 4u + 1u;
            s.level += 1u;
        }
    }
    *walk = s;
    return found;
}

@compute @workgroup_size(64)
fn estimate(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = group_number(group, groups) * 64u + thread;
    if (number >= sizes.count) { return; }
    let request = requests[number];
    if (request.kind == NOTHING_ASKED || all(request.value == vec3f(0.0))) { return; }
    let asked = asked_by(number, request);
    let top = part_level();
    var walk = Walk(top, range.x, 0u, 0u, radiance[request.slot], vec3f(0.0));
    loop {
        let k = walk_on(&walk, asked, top, end_of_parts());
        if (k == NOTHING) { break; }
        if (!is_hidden_from(k, asked.point)) { walk.sum += walk.brought; }
    }
    radiance[request.slot] = walk.sum;
}
