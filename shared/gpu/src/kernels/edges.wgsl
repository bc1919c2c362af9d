// Kernels at edges, corners and creases: the renderer's `beam/edges.rs`, a trial at a time. Displacements are drawn
// from a kernel until one lies on what is there; their number has a mean of one over the share of the kernel that does.

// A kernel of which so many displacements lie beside what is there is made narrower.
const TRIALS_OF_RADIUS: u32 = 64u;
// Trials in a count, counts that are averaged, halvings of a radius.
const MOST_TRIALS: u32 = 4096u;
const COUNTS: u32 = 4u;
const MOST_HALVINGS: u32 = 8u;
// Beams that graze a surface are displaced along it as if they did not.
const LEAST_COSINE: f32 = 0.25f;
// Surfaces that are turned away further, or further off the tangent plane in radii, are others.
const MIN_NORMAL_COSINE: f32 = 0.7f;
const MAX_PLANE_DISTANCE: f32 = 0.25f;

const FIRST_TRIAL: u32 = 0u;
// Until one in so many succeeds.
const HALVING: u32 = 1u;
// Whether the first trial would have succeeded, once more.
const AGAIN: u32 = 2u;
const COUNTING: u32 = 3u;

struct Trials {
    // Of the last trial, along the surface.
    offset: vec3f,
    phase: u32,
    // Since the last success, or with this radius.
    tries: u32,
    // Of all counts so far, and how many those are.
    sum: u32,
    counts: u32,
    halvings: u32,
    // Kernel radius before, and as it is now.
    radius: f32,
    narrower: f32,
    // Factor on the mean number of trials; zero: 1 is added to that instead.
    first: f32,
    // The result: on the photon's power.
    factor: f32,
}

fn trials_of(radius: f32) -> Trials {
    return Trials(vec3f(0.0), FIRST_TRIAL, 0u, 0u, 0u, 0u, radius, radius, 0.0, 1.0);
}

fn trial_radius(t: Trials) -> f32 {
    return select(t.radius, t.narrower, t.phase == HALVING || t.phase == COUNTING);
}

// Whether what a trial says is the last that there is to know. `halves`: the radius may be made smaller.
fn is_last_trial(t: ptr<function, Trials>, is_there: bool, halves: bool) -> bool {
    switch (*t).phase {
        case FIRST_TRIAL: {
            (*t).phase = select(COUNTING, HALVING, halves);
            return is_there;
        }
        case HALVING: {
            (*t).tries += 1u;
            if (!is_there) {
                if ((*t).tries < TRIALS_OF_RADIUS) { return false; }
                (*t).tries = 0u;
                (*t).narrower *= 0.5;
                (*t).halvings += 1u;
                if ((*t).halvings < MOST_HALVINGS) { return false; }
            }
            (*t).tries = 0u;
            (*t).phase = select(AGAIN, COUNTING, (*t).narrower == (*t).radius);
            return false;
        }
        case AGAIN: {
            (*t).first = select(1.0, 2.0, is_there);
            (*t).phase = COUNTING;
            return false;
        }
        default: {
            (*t).tries += 1u;
            if (!is_there) {
                if ((*t).tries < MOST_TRIALS) { return false; }
                (*t).factor = select((*t).first, 1.0, (*t).first == 0.0);
                return true;
            }
            (*t).sum += (*t).tries;
            (*t).tries = 0u;
            (*t).counts += 1u;
            if ((*t).counts < COUNTS) { return false; }
            let mean = f32((*t).sum) * 0.25;
            (*t).factor = select((*t).first * mean, 1.0 + mean, (*t).first == 0.0);
            return true;
        }
    }
}

// A place on a line by three uniform numbers, -1 to 1: their median has the kernel's density.
fn sample_line(u: vec2f, v: f32) -> f32 {
    let high = select(u.y, u.x, u.x > u.y);
    let low = select(u.y, u.x, u.x < u.y);
    let middle = select(v, low, low > v);
    return 2.0 * select(high, middle, middle < high) - 1.0;
}

// Distance from the middle of a disc by a uniform number, 0 to 1.
fn sample_disc(u: f32) -> f32 { return root(1.0 - root(1.0 - u)); }

// What is asked of the scene, but for what rules hide from the photon.
struct Query { ray: Ray, t_max: f32, passed: Passed, first_only: bool }

fn query_past(ray: Ray, t_max: f32, classes: u32, first_only: bool) -> Query {
    return Query(ray, t_max, Passed(Ignored(NOTHING, classes), vec2u(NOTHING)), first_only);
}

// From a point to another at an offset: whether anything is between.
fn query_between(start: vec3f, offset: vec3f, classes: u32) -> Query {
    let length = length3(offset);
    // Nothing is before no way at all.
    let t_max = select(-1.0, length, length > 0.0);
    return query_past(Ray(start, quotients(offset, length)), t_max, classes, true);
}

// Whether a beam that is displaced starts where there is nothing between but glass in its medium. `start`: unit normal
// of the surface that it starts on, if it does.
fn query_of_beam(ray: Ray, start: vec3f, starts_on: bool, radius: f32, s: ptr<function, Sampler>) -> Query {
    let frame = frame_around(ray.dir);
    let u = next_2d(s);
    let v = next_2d(s);
    let r = radius * sample_line(u, v.x);
    let turn = sin_cos(3.1415927f * v.y);
    let across = frame.s * (r * turn.y) + frame.t * (r * turn.x);
    if (!starts_on) { return query_between(ray.origin, across, CLEAR); }
    // Over where the displaced beam would start.
    let n = start * with_sign(1.0, dot3(start, ray.dir));
    let cosine = dot3(n, ray.dir);
    let along = quotient(dot3(across, n), select(LEAST_COSINE, cosine, cosine > LEAST_COSINE));
    let offset = across - ray.dir * along;
    let height = MAX_PLANE_DISTANCE * radius;
    return query_between(ray.origin + n * height, offset - n * dot3(offset, n), CLEAR);
}

// The normal on the side of a surface that a ray came from.
fn towards_origin(at: SurfacePoint, dir: vec3f) -> vec3f { return at.ng * with_sign(1.0, dot3(at.ng, -dir)); }

// How high above the surface a kernel asks what is in the way.
fn kernel_height(at: SurfacePoint, radius: f32) -> f32 { return MAX_PLANE_DISTANCE * radius + at.clearance; }

// What is under a displaced point over a surface, but for glass, on which nobody looks for photons.
fn query_down(at: SurfacePoint, n: vec3f, t: ptr<function, Trials>, s: ptr<function, Sampler>) -> Query {
    let frame = frame_around(n);
    let radius = trial_radius(*t);
    let u = next_2d(s);
    let r = radius * sample_disc(u.x);
    let turn = sin_cos(6.2831855f * u.y);
    (*t).offset = frame.s * (r * turn.y) + frame.t * (r * turn.x);
    let height = kernel_height(at, radius);
    return query_past(Ray(at.point + n * height + (*t).offset, -n), 2.0 * height, TRANSMITTING, false);
}

// Whether it is a surface like that one.
fn is_like(at: SurfacePoint, n: vec3f, t: Trials, under: SurfacePoint) -> bool {
    if (under.object == NOTHING) { return false; }
    let radius = trial_radius(t);
    let off = not_below_zero(abs(under.t - kernel_height(at, radius)) - under.clearance);
    return abs(dot3(under.ng, n)) >= MIN_NORMAL_COSINE && dot3(t.offset, t.offset) + off * off < radius * radius;
}

// Walls between the two.
fn query_walls(at: SurfacePoint, n: vec3f, t: Trials) -> Query {
    return query_between(at.point + n * kernel_height(at, trial_radius(t)), t.offset, NO_WALL);
}
