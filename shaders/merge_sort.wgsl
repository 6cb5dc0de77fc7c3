// One pass of a radix sort, least significant digit first: entries move to the place of their digit, and entries of equal digits stay in order.
#import merging

var<workgroup> digits: array<u32, LANES>;
var<workgroup> next: array<u32, DIGITS>;
var<workgroup> found: array<atomic<u32>, DIGITS>;

fn digit(entry: vec4u) -> u32 {
    return (entry[merging.word] >> merging.shift) & (DIGITS - 1u);
}

// How often each digit is in each block: all blocks of digit 0, then all blocks of digit 1, and so on.
@compute @workgroup_size(256)
fn count_digits(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    atomicStore(&found[lane], 0u);
    workgroupBarrier();
    for (var part = 0u; part < BLOCK / LANES; part += 1u) {
        let index = group.x * BLOCK + part * LANES + lane;
        if (index < totals[0]) {
            atomicAdd(&found[digit(entries[index])], 1u);
        }
    }
    workgroupBarrier();
    counters[lane * merging.blocks + group.x] = atomicLoad(&found[lane]);
}

// Moves the entries of a block, a part after the other.
@compute @workgroup_size(256)
fn move_entries(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    next[lane] = scanned(lane * merging.blocks + group.x);
    for (var part = 0u; part < BLOCK / LANES; part += 1u) {
        let index = group.x * BLOCK + part * LANES + lane;
        let exists = index < totals[0];
        var entry = vec4u(0u);
        var own = NOTHING;
        if (exists) {
            entry = entries[index];
            own = digit(entry);
        }
        digits[lane] = own;
        workgroupBarrier();
        // The rank among equal digits of this part, and for the digit `lane` how many there are.
        var rank = 0u;
        var count = 0u;
        for (var other = 0u; other < LANES; other += 1u) {
            rank += select(0u, 1u, other < lane && digits[other] == own);
            count += select(0u, 1u, digits[other] == lane);
        }
        if (exists) {
            moved[next[own] + rank] = entry;
        }
        workgroupBarrier();
        next[lane] += count;
        workgroupBarrier();
    }
}
