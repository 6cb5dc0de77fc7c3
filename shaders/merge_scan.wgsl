// Exclusive prefix sums of `counters`: each block by itself, then the sums of the blocks. `scanned` adds both.
#import merging

var<workgroup> partial: array<u32, LANES>;

// The sum of `partial` before each lane, and of all lanes for the last one after it. All lanes of the workgroup call it.
fn scan_lanes(lane: u32, own: u32) -> u32 {
    partial[lane] = own;
    workgroupBarrier();
    for (var step = 1u; step < LANES; step *= 2u) {
        var before = 0u;
        if (lane >= step) {
            before = partial[lane - step];
        }
        workgroupBarrier();
        partial[lane] += before;
        workgroupBarrier();
    }
    return partial[lane] - own;
}

@compute @workgroup_size(256)
fn scan_blocks(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let first = group.x * BLOCK + lane * (BLOCK / LANES);
    let end = min(first + BLOCK / LANES, merging.elements);
    var own = 0u;
    for (var index = first; index < end; index += 1u) {
        own += counters[index];
    }
    var before = scan_lanes(lane, own);
    for (var index = first; index < end; index += 1u) {
        let counter = counters[index];
        counters[index] = before;
        before += counter;
    }
    if (lane == LANES - 1u) {
        sums[group.x] = before;
    }
}

// One workgroup: each lane has some of the blocks.
@compute @workgroup_size(256)
fn scan_sums(@builtin(local_invocation_index) lane: u32) {
    let blocks = (merging.elements + BLOCK - 1u) / BLOCK;
    let share = (blocks + LANES - 1u) / LANES;
    let first = lane * share;
    let end = min(first + share, blocks);
    var own = 0u;
    for (var index = first; index < end; index += 1u) {
        own += sums[index];
    }
    var before = scan_lanes(lane, own);
    for (var index = first; index < end; index += 1u) {
        let sum = sums[index];
        sums[index] = before;
        before += sum;
    }
    if (lane == LANES - 1u && merging.total != NOTHING) {
        totals[merging.total] = partial[lane];
    }
}
