// Prefix sums over the lanes of a workgroup. The file that imports this one states the number of LANES.

var<workgroup> partial: array<u32, LANES>;

// The sum of `own` over the lanes before this one; `partial[LANES - 1]` is the sum over all. All lanes call it, and have
// to pass a barrier before the next call.
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
