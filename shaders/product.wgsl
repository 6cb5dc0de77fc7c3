// y = A x for one channel: weights in f32, vectors and sums in f64.
//
// 32 invocations share a row, so that neighbouring invocations read neighbouring entries, and a few thousand rows keep a GPU busy.
// Their sums are added in a fixed order, so that each run gives the same bits.

// A band of `rows` rows from `first_row` on, whose entries are in buffers of their own.
struct Band {
    first_row: u32,
    rows: u32,
    // A combination of HAS_ENTRIES, HAS_DIAGONAL and ADDS.
    terms: u32,
    padding: u32,
}

// The sum includes the band's entries.
const HAS_ENTRIES = 1u;
// The sum includes the diagonal.
const HAS_DIAGONAL = 2u;
// The sum includes the present value of y.
const ADDS = 4u;

const LANES = 32u;
const ROWS_OF_GROUP = 2u;

@group(0) @binding(0) var<uniform> band: Band;
// The place where each row's entries begin, and the number of all entries at the end.
@group(0) @binding(1) var<storage, read> starts: array<u32>;
@group(0) @binding(2) var<storage, read> columns: array<u32>;
@group(0) @binding(3) var<storage, read> weights: array<f32>;
// The diagonal of all rows.
@group(0) @binding(4) var<storage, read> diagonal: array<f32>;
@group(0) @binding(5) var<storage, read> x: array<f64>;
@group(0) @binding(6) var<storage, read_write> y: array<f64>;

var<workgroup> sums: array<f64, 64>;

@compute @workgroup_size(64)
fn product(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let lane = index % LANES;
    let row = ROWS_OF_GROUP * (group.y * groups.x + group.x) + index / LANES;
    var sum = f64(0.0);
    if ((band.terms & HAS_ENTRIES) != 0u && row < band.rows) {
        let end = starts[row + 1u];
        for (var entry = starts[row] + lane; entry < end; entry += LANES) {
            sum += f64(weights[entry]) * x[columns[entry]];
        }
    }
    sums[index] = sum;
    for (var others = LANES / 2u; others > 0u; others /= 2u) {
        workgroupBarrier();
        if (lane < others) {
            sums[index] += sums[index + others];
        }
    }
    if (lane == 0u && row < band.rows) {
        let at = band.first_row + row;
        var value = f64(0.0);
        if ((band.terms & HAS_DIAGONAL) != 0u) {
            value = f64(diagonal[at]) * x[at];
        }
        if ((band.terms & ADDS) != 0u) {
            value = y[at];
        }
        y[at] = value + sums[index];
    }
}
