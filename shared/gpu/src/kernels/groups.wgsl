// Workgroups in rows: their numbering, and how many to dispatch for a count that only the device knows.

const GROUPS_PER_DIMENSION: u32 = 65535u;

// The size of an indirect dispatch: workgroups, and the number of elements they cover.
struct Sizes {
    groups: vec3u,
    count: u32,
}

fn group_number(group: vec3u, groups: vec3u) -> u32 { return group.x + group.y * groups.x; }

// The shortest rows for this many workgroups in each pass.
fn group_rows(count: u32, passes: u32) -> vec3u {
    let rows = max((count + GROUPS_PER_DIMENSION - 1u) / GROUPS_PER_DIMENSION, 1u);
    return vec3u((count + rows - 1u) / rows, rows, passes);
}
