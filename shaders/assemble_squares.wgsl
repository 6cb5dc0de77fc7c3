// The squares of all weights of a layer in one channel. A workgroup adds those of a block.
#import assembly

const LANES = 256u;
// Weights that a workgroup adds.
const WEIGHTS = 65536u;

@group(0) @binding(1) var<storage, read> weights: array<f32>;
@group(0) @binding(2) var<storage, read_write> squares: array<f64>;

var<workgroup> added: array<f64, LANES>;

@compute @workgroup_size(256)
fn sum_squares(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_index) lane: u32) {
    let end = min((group.x + 1u) * WEIGHTS, assembly.rows);
    var own = f64(0.0);
    for (var at = group.x * WEIGHTS + lane; at < end; at += LANES) {
        own += f64(weights[at]) * f64(weights[at]);
    }
    added[lane] = own;
    for (var others = LANES / 2u; others > 0u; others /= 2u) {
        workgroupBarrier();
        if (lane < others) {
            added[lane] += added[lane + others];
        }
    }
    if (lane == 0u) {
        squares[group.x] = added[0];
    }
}
