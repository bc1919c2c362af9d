// The same sums by tiles of 64 nearby segments. A workgroup traverses the BVH together, sixteen nodes and their
// children at a time, and keeps those that any of its segments may hit. Each segment then looks at the remaining
// pieces: first which are near, then at those. Goes after `gather.wgsl`.

// Bounds over a tile's segments: origins, inverse directions by sign, greatest length. No direction has a sign if its
// low is above its high.
struct Bundle {
    origin_low: vec3f,
    length: f32,
    origin_high: vec3f,
    up_low: vec3f,
    up_high: vec3f,
    down_low: vec3f,
    down_high: vec3f,
}

var<workgroup> bundles: array<Bundle, 64>;
// Nodes to enter, by level.
var<workgroup> queue: array<u32, 512>;
var<workgroup> kept: array<atomic<u32>, 2>;
var<workgroup> list: array<Piece, 64>;

fn lower3(a: vec3f, b: vec3f) -> vec3f { return select(a, b, b < a); }

fn upper3(a: vec3f, b: vec3f) -> vec3f { return select(a, b, b > a); }

fn both(a: Bundle, b: Bundle) -> Bundle {
    return Bundle(
        lower3(a.origin_low, b.origin_low),
        larger(a.length, b.length),
        upper3(a.origin_high, b.origin_high),
        lower3(a.up_low, b.up_low),
        upper3(a.up_high, b.up_high),
        lower3(a.down_low, b.down_low),
        upper3(a.down_high, b.down_high),
    );
}

// Whether any ray of a bundle may hit a box.
fn may_meet(bundle: Bundle, box: Bounds) -> bool {
    let low = box.low - bundle.origin_high;
    let high = box.high - bundle.origin_low;
    let up_near = low * select(bundle.up_high, bundle.up_low, low >= vec3f(0.0));
    let up_far = high * select(bundle.up_low, bundle.up_high, high >= vec3f(0.0));
    let down_near = high * select(bundle.down_high, bundle.down_low, high >= vec3f(0.0));
    let down_far = low * select(bundle.down_low, bundle.down_high, low >= vec3f(0.0));
    let up = (bundle.up_low <= bundle.up_high) & (up_far >= vec3f(0.0));
    let down = (bundle.down_low <= bundle.down_high) & (down_far >= vec3f(0.0));
    let near = lower3(select(vec3f(FAR_AWAY), up_near, up), select(vec3f(FAR_AWAY), down_near, down));
    let far = upper3(select(vec3f(-1.0), up_far, up), select(vec3f(-1.0), down_far, down));
    return larger(larger(near.x, near.y), larger(near.z, 0.0))
        <= smaller(smaller(far.x, far.y), smaller(far.z, bundle.length));
}

// Adds what the listed pieces bring to a segment, in their order. First finds those that are near, and those of them
// that need a ray to a wall, so that invocations that need a step take it together.
fn gather_listed(sum: ptr<function, Brought>, segment: Segment, inv: vec3f, medium: Scattering, found: u32) {
    for (var first = 0u; first < found; first += MOST_WAITING) {
        // Bit mask of near pieces.
        var near = 0u;
        let end = min(first + MOST_WAITING, found);
        for (var k = first; k < end; k++) {
            if (is_near(segment, inv, list[k])) { near |= 1u << (k - first); }
        }
        // Two bits per piece: points that walls may hide; later, those that they do.
        var asked = 0u;
        var left = near;
        while (left != 0u) {
            let k = countTrailingZeros(left);
            left &= left - 1u;
            asked |= asked_of(segment, list[first + k], medium, key[0]) << (2u * k);
        }
        var hidden = asked;
        while (asked != 0u) {
            let bit = countTrailingZeros(asked);
            asked &= asked - 1u;
            if (!is_hidden(segment, list[first + bit / 2u], medium, key[0], bit & 1u)) { hidden ^= 1u << bit; }
        }
        while (near != 0u) {
            let k = countTrailingZeros(near);
            near &= near - 1u;
            add(sum, segment, list[first + k], medium, hidden >> (2u * k) & 3u);
        }
    }
}

@compute @workgroup_size(64)
fn by_tile(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    let number = group_number(group, groups) * 64u + thread;
    let inside = number < sizes.count;
    var segment: Segment;
    var medium: Scattering;
    var inv = vec3f(1.0);
    let most = vec3f(FAR_AWAY);
    var own = Bundle(most, -1.0, -most, most, -most, most, -most);
    if (inside) {
        segment = segments[number];
        medium = media[segment.medium];
        inv = inverse(segment.dir);
        let falls = inv < vec3f(0.0);
        own = Bundle(
            segment.origin, segment.length, segment.origin,
            select(inv, most, falls), select(inv, -most, falls),
            select(most, inv, falls), select(-most, inv, falls),
        );
    }
    bundles[thread] = own;
    if (thread < 2u) { atomicStore(&kept[thread], 0u); }
    workgroupBarrier();
    for (var apart = 32u; apart > 0u; apart = apart >> 1u) {
        if (thread < apart) { bundles[thread] = both(bundles[thread], bundles[thread + apart]); }
        workgroupBarrier();
    }
    let bundle = bundles[0];

    var sum = Brought(vec3f(0.0), 0u);
    if (inside) { sum = sum_before(number); }
    let top = part_level();
    let end_part = end_of_parts();
    // By level: nodes entered from the queue, and its length.
    var head: array<u32, 8>;
    var length: array<u32, 8>;
    for (var part = range.first; part < end_part; part++) {
        var level = top;
        head[top] = 0u;
        length[top] = 1u;
        if (thread == 0u) { queue[top * 64u] = part; }
        workgroupBarrier();
        while (level <= top) {
            if (head[level] == length[level]) {
                level += 1u;
                continue;
            }
            let entered = min(16u, length[level] - head[level]);
            var child = 0u;
            var keep = false;
            var piece: Piece;
            if (thread / 4u < entered) {
                child = queue[level * 64u + head[level] + thread / 4u] * 4u + thread % 4u;
                if (level > 0u) {
                    if (child < nodes_of(level - 1u)) {
                        keep = may_meet(bundle, piece_nodes[levels.all[level].below + child]);
                    }
                } else if (child < piece_count[0]) {
                    piece = pieces[child];
                    keep = may_meet(bundle, bounds_of(piece));
                }
            }
            if (keep) { atomicOr(&kept[thread / 32u], 1u << (thread % 32u)); }
            workgroupBarrier();
            let low = atomicLoad(&kept[0]);
            let high = atomicLoad(&kept[1]);
            let before = (1u << (thread % 32u)) - 1u;
            var place = countOneBits(low & before);
            if (thread >= 32u) { place = countOneBits(low) + countOneBits(high & before); }
            let found = countOneBits(low) + countOneBits(high);
            head[level] += entered;
            if (keep) {
                if (level > 0u) {
                    queue[(level - 1u) * 64u + place] = child;
                } else {
                    list[place] = piece;
                }
            }
            workgroupBarrier();
            if (thread < 2u) { atomicStore(&kept[thread], 0u); }
            if (level > 0u) {
                if (found > 0u) {
                    level -= 1u;
                    head[level] = 0u;
                    length[level] = found;
                }
            } else if (inside) {
                gather_listed(&sum, segment, inv, medium, found);
            }
            workgroupBarrier();
        }
    }
    if (inside) { gathered[number] = sum; }
}
