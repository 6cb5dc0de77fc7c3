// Where each row begins: exclusive prefix sums of the rows' counts, and their sum at the end. Blocks are summed first, then
// the sums of blocks, and then both are added.
#import assembly
#import scan

const LANES = 256u;
// Counts that a workgroup sums.
const BLOCK = 4096u;

@group(0) @binding(1) var<storage, read_write> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> starts: array<u32>;
@group(0) @binding(3) var<storage, read_write> blocks: array<u32>;
// At the place `assembly.total`: the sum of all counts, and then the largest one.
@group(0) @binding(4) var<storage, read_write> totals: array<atomic<u32>>;

@compute @workgroup_size(256)
fn scan_blocks(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let first = group.x * BLOCK + lane * (BLOCK / LANES);
    let end = min(first + BLOCK / LANES, assembly.rows);
    var own = 0u;
    var most = 0u;
    for (var row = first; row < end; row += 1u) {
        let count = counts[assembly.own_base + row];
        own += count;
        most = max(most, count);
    }
    var before = scan_lanes(lane, own);
    for (var row = first; row < end; row += 1u) {
        starts[row] = before;
        before += counts[assembly.own_base + row];
    }
    if (lane == LANES - 1u) {
        blocks[group.x] = before;
    }
    atomicMax(&totals[assembly.total + 1u], most);
}

// One workgroup: each lane has some of the blocks.
@compute @workgroup_size(256)
fn scan_sums(@builtin(local_invocation_index) lane: u32) {
    let all = (assembly.rows + BLOCK - 1u) / BLOCK;
    let share = (all + LANES - 1u) / LANES;
    let first = min(lane * share, all);
    let end = min(first + share, all);
    var own = 0u;
    for (var block = first; block < end; block += 1u) {
        own += blocks[block];
    }
    var before = scan_lanes(lane, own);
    for (var block = first; block < end; block += 1u) {
        let sum = blocks[block];
        blocks[block] = before;
        before += sum;
    }
    if (lane == 0u) {
        starts[assembly.rows] = partial[LANES - 1u];
        atomicStore(&totals[assembly.total], partial[LANES - 1u]);
    }
}

@compute @workgroup_size(256)
fn scan_add(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let first = group.x * BLOCK;
    for (var row = first + lane; row < min(first + BLOCK, assembly.rows); row += LANES) {
        starts[row] += blocks[group.x];
    }
}
