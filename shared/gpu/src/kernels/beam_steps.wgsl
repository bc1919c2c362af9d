// Stores the transmittance along photon beams where the density varies: by beam the first word and the number of its
// steps, followed by the steps. Part of `trace.wgsl`; `no_beam_steps.wgsl` replaces it if no density varies.

// By path: the number of its beams' steps; after a prefix sum, the number in earlier paths.
@group(1) @binding(16) var<storage, read_write> step_places: array<u32>;
@group(1) @binding(17) var<storage, read> all_steps: array<u32>;
@group(1) @binding(56) var<storage, read_write> beam_steps: array<u32>;

const WORDS_OF_STEP: u32 = 6u;

fn first_step(path: u32) -> u32 { return step_places[path]; }

fn leave_steps(path: u32, count: u32) { step_places[path] = count; }

fn told_steps() -> u32 { return all_steps[0]; }

fn word_of_step(place: u32) -> u32 { return 2u * trace_round.beams + WORDS_OF_STEP * place; }

fn keep_step(place: u32, walk: Walk) {
    if (trace_round.writes == 0u || place >= trace_round.steps) { return; }
    let at = word_of_step(place);
    beam_steps[at] = bitcast<u32>(walk.distance);
    beam_steps[at + 1u] = bitcast<u32>(walk.value.x);
    beam_steps[at + 2u] = bitcast<u32>(walk.value.y);
    beam_steps[at + 3u] = bitcast<u32>(walk.value.z);
    beam_steps[at + 4u] = bitcast<u32>(walk.depth);
    beam_steps[at + 5u] = bitcast<u32>(walk.decay);
}

fn keep_function(beam: u32, first: u32, count: u32) {
    let are_kept = first + count <= trace_round.steps;
    beam_steps[2u * beam] = word_of_step(first);
    beam_steps[2u * beam + 1u] = select(0u, count, are_kept);
}
