// Kernels at edges, corners and creases: the renderer's `beam/edges.rs`, one trial at a time. Displacements are drawn
// from a kernel until one lands on the surface: on average, 1 / (share of the kernel on it) trials.

// If this many displacements all miss, the kernel is narrowed.
const TRIALS_OF_RADIUS: u32 = 64u;
// Trials in a count, counts averaged, halvings of the radius.
const MOST_TRIALS: u32 = 4096u;
const COUNTS: u32 = 4u;
const MOST_HALVINGS: u32 = 8u;
// Beams more grazing than this are displaced along the surface as if they were not.
const LEAST_COSINE: f32 = 0.25f;
// Surfaces turned away further, or further off the tangent plane (in radii), are different ones.
const MIN_NORMAL_COSINE: f32 = 0.7f;
const MAX_PLANE_DISTANCE: f32 = 0.25f;

const FIRST_TRIAL: u32 = 0u;
// Halve the radius until one of TRIALS_OF_RADIUS displacements lands.
const HALVING: u32 = 1u;
// Repeat the first trial, at the full radius.
const AGAIN: u32 = 2u;
const COUNTING: u32 = 3u;

struct Trials {
    // Of the last trial, along the surface.
    offset: vec3f,
    phase: u32,
    // Since the last success or change of radius.
    tries: u32,
    // Sum and number of counts so far.
    sum: u32,
    counts: u32,
    halvings: u32,
    // Original kernel radius, and the narrowed one.
    radius: f32,
    narrower: f32,
    // Factor on the mean number of trials; zero: add 1 to the mean instead.
    first: f32,
    // The result: a factor on the photon's power.
    factor: f32,
}

fn trials_of(radius: f32) -> Trials {
    return Trials(vec3f(0.0), FIRST_TRIAL, 0u, 0u, 0u, 0u, radius, radius, 0.0, 1.0);
}

fn trial_radius(t: Trials) -> f32 {
    return select(t.radius, t.narrower, t.phase == HALVING || t.phase == COUNTING);
}

// Takes a trial's outcome; returns whether the result is final. `halves`: the radius may shrink.
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

// A place on a line, in [-1, 1]: the median of three uniform numbers has the kernel's density.
fn sample_line(u: vec2f, v: f32) -> f32 {
    let high = select(u.y, u.x, u.x > u.y);
    let low = select(u.y, u.x, u.x < u.y);
    let middle = select(v, low, low > v);
    return 2.0 * select(high, middle, middle < high) - 1.0;
}

// Distance from a disc's centre, in [0, 1], by a uniform number.
fn sample_disc(u: f32) -> f32 { return root(1.0 - root(1.0 - u)); }

// A ray query; the photon's visibility rules are added by the caller.
struct Query { ray: Ray, t_max: f32, passed: Passed, first_only: bool }

fn query_past(ray: Ray, t_max: f32, classes: u32, first_only: bool) -> Query {
    return Query(ray, t_max, Passed(Ignored(NOTHING, classes), vec2u(NOTHING)), first_only);
}

// Whether anything stands between a point and another at an offset.
fn query_between(start: vec3f, offset: vec3f, classes: u32) -> Query {
    let length = length3(offset);
    // A zero offset meets nothing.
    let t_max = select(-1.0, length, length > 0.0);
    return query_past(Ray(start, quotients(offset, length)), t_max, classes, true);
}

// Whether anything but glass within its medium stands between a beam's start and a displaced one. `start`: unit normal
// of the surface it starts on, if `starts_on`.
fn query_of_beam(ray: Ray, start: vec3f, starts_on: bool, radius: f32, s: ptr<function, Sampler>) -> Query {
    let frame = frame_around(ray.dir);
    let u = next_2d(s);
    let v = next_2d(s);
    let r = radius * sample_line(u, v.x);
    let turn = sin_cos(3.1415927f * v.y);
    let across = frame.s * (r * turn.y) + frame.t * (r * turn.x);
    if (!starts_on) { return query_between(ray.origin, across, CLEAR); }
    // Above where the displaced beam would start.
    let n = start * with_sign(1.0, dot3(start, ray.dir));
    let cosine = dot3(n, ray.dir);
    let along = quotient(dot3(across, n), select(LEAST_COSINE, cosine, cosine > LEAST_COSINE));
    let offset = across - ray.dir * along;
    let height = MAX_PLANE_DISTANCE * radius;
    return query_between(ray.origin + n * height, offset - n * dot3(offset, n), CLEAR);
}

// The normal on the side that the ray came from.
fn towards_origin(at: SurfacePoint, dir: vec3f) -> vec3f { return at.ng * with_sign(1.0, dot3(at.ng, -dir)); }

// Height above the surface at which a kernel looks for obstacles.
fn kernel_height(at: SurfacePoint, radius: f32) -> f32 { return MAX_PLANE_DISTANCE * radius + at.clearance; }

// Looks down at the surface from above a displaced point, through glass: no look-ups are made on it.
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

// Whether what lies under the displaced point is a similar surface.
fn is_like(at: SurfacePoint, n: vec3f, t: Trials, under: SurfacePoint) -> bool {
    if (under.object == NOTHING) { return false; }
    let radius = trial_radius(t);
    let off = not_below_zero(abs(under.t - kernel_height(at, radius)) - under.clearance);
    return abs(dot3(under.ng, n)) >= MIN_NORMAL_COSINE && dot3(t.offset, t.offset) + off * off < radius * radius;
}

// Looks for walls between the two points.
fn query_walls(at: SurfacePoint, n: vec3f, t: Trials) -> Query {
    return query_between(at.point + n * kernel_height(at, trial_radius(t)), t.offset, NO_WALL);
}
