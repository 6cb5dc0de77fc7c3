// From the sums of rows: the errors of the white photo, and what the noise of the matrix is computed from.
#import assembly

const LANES = 256u;
// Rows that a workgroup adds.
const BLOCK = 4096u;
// Sums of a workgroup: squares of mean and error of all entries, of those without light of one bounce, and of the rows' sums.
const SUMS = 6u;

override CHANNELS: u32 = 3u;

@group(0) @binding(1) var<storage, read> sums: array<f64>;
// Planes of the errors of the rows' sums.
@group(0) @binding(2) var<storage, read_write> white: array<f32>;
@group(0) @binding(3) var<storage, read_write> all: array<f64>;

var<workgroup> added: array<f64, LANES>;

@compute @workgroup_size(256)
fn sum_rows(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    var own = array<f64, 6>();
    let end = min((group.x + 1u) * BLOCK, assembly.rows);
    for (var row = group.x * BLOCK + lane; row < end; row += LANES) {
        let of_row = row * (2u * CHANNELS + 4u);
        for (var which = 0u; which < 4u; which += 1u) {
            own[which] += sums[of_row + 2u * CHANNELS + which];
        }
        for (var channel = 0u; channel < CHANNELS; channel += 1u) {
            let mean = sums[of_row + 2u * channel];
            let error = sums[of_row + 2u * channel + 1u];
            own[4] += mean * mean;
            own[5] += error * error;
            white[channel * assembly.rows + row] = abs(f32(error));
        }
    }
    for (var which = 0u; which < SUMS; which += 1u) {
        added[lane] = own[which];
        for (var others = LANES / 2u; others > 0u; others /= 2u) {
            workgroupBarrier();
            if (lane < others) {
                added[lane] += added[lane + others];
            }
        }
        if (lane == 0u) {
            all[group.x * SUMS + which] = added[0];
        }
        workgroupBarrier();
    }
}
