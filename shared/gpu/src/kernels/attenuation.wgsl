// How much of a beam's light reaches a point of a segment, and from there the segment's start, times the density and
// albedo at the point. Goes before `estimate.wgsl`; `even_attenuation.wgsl` replaces it if no medium's density varies.
//
// Where the density varies, transmittance is a step function of distance. A step is six words: distance, value (RGB),
// depth, density. The last two describe the part in closed form: its density times length up to the step, and its
// density from there on.

// By beam the first word and the number of its steps, followed by the steps.
@group(1) @binding(56) var<storage, read> beam_steps: array<u32>;
@group(1) @binding(57) var<storage, read> segment_steps: array<u32>;

const WORDS_OF_STEP: u32 = 6u;

fn step_word(of_beam: bool, at: u32) -> f32 {
    if (of_beam) { return of_bits(beam_steps[at]); }
    return of_bits(segment_steps[at]);
}

fn attenuation(segment: Segment, piece: Piece, medium: Scattering, t: f32, s: f32) -> vec3f {
    let id = piece.medium & MEDIUM_BITS;
    if (!is_varying(id)) { return transmitted_over(medium.sigma_t, t + s); }
    let record = volumes[id];
    let map = record + TO_SAMPLES;
    let p = moved_by(map, segment.origin) + turned_by(map, segment.dir) * t;
    let density = density_at(record, p);
    if (!(density > 0.0)) { return vec3f(0.0); }
    var value = albedo_at(record, p) * density;
    var depth = 0.0;
    for (var k = 0u; k < 2u; k++) {
        let of_beam = k == 1u;
        var first = segment.steps;
        var count = segment.step_count;
        if (of_beam) {
            first = beam_steps[2u * piece.beam];
            count = beam_steps[2u * piece.beam + 1u];
        }
        let distance = select(t, s, of_beam);
        // Binary search for the number of steps up to `distance`.
        var low = 0u;
        while (low < count) {
            let middle = (low + count) / 2u;
            if (step_word(of_beam, first + WORDS_OF_STEP * middle) <= distance) {
                low = middle + 1u;
            } else {
                count = middle;
            }
        }
        if (low > 0u) {
            let at = first + WORDS_OF_STEP * (low - 1u);
            value *= vec3f(step_word(of_beam, at + 1u), step_word(of_beam, at + 2u), step_word(of_beam, at + 3u));
            let decay = step_word(of_beam, at + 5u);
            depth += (step_word(of_beam, at + 4u) - decay * step_word(of_beam, at)) + decay * distance;
        }
    }
    return value * transmitted_over(medium.sigma_t, depth);
}
