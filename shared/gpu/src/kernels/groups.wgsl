// Workgroups in rows: their numbers, and how many are needed for a count that is known on the device alone.

const GROUPS_PER_DIMENSION: u32 = 65535u;

// What a kernel runs over, once that is known: workgroups, and the count that they are for.
struct Sizes {
    groups: vec3u,
    count: u32,
}

fn group_number(group: vec3u, groups: vec3u) -> u32 { return group.x + group.y * groups.x; }

// The shortest rows for so many workgroups of each pass.
fn group_rows(count: u32, passes: u32) -> vec3u {
    let rows = max((count + GROUPS_PER_DIMENSION - 1u) / GROUPS_PER_DIMENSION, 1u);
    return vec3u((count + rows - 1u) / rows, rows, passes);
}
