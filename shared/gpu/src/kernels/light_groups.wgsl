// Radiance per light group that has a layer, stored after the totals in `found`: three groups per `Found`. For programs
// of `path.wgsl`, which define `found` and `constants`.

// `number`: the group, from 1 on; 0: none.
fn found_of_group(slot: u32, number: u32, radiance: vec3f) {
    if (!HAS_LIGHT_GROUPS || number == 0u) { return; }
    let place = (1u + (number - 1u) / 3u) * constants.slots + slot;
    found[place] = found_more(found[place], (number - 1u) % 3u, radiance);
}
