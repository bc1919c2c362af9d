// What paths find of the light of groups of lights that have a layer: behind what they find of all, three groups to one
// `Found`, by its parts. In programs of `path.wgsl`, which have `found` and `constants`.

// Of the group of this number, from 1 on; 0: of none.
fn found_of_group(slot: u32, number: u32, radiance: vec3f) {
    if (!HAS_LIGHT_GROUPS || number == 0u) { return; }
    let place = (1u + (number - 1u) / 3u) * constants.slots + slot;
    found[place] = found_more(found[place], (number - 1u) % 3u, radiance);
}
