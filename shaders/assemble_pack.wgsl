// Moves the entries of one class, in one channel, to the arrays of a layer. 32 lanes take a row.
#import assembly

const LANES = 32u;
const ROWS_OF_GROUP = 8u;

override CHANNELS: u32 = 3u;

@group(0) @binding(1) var<storage, read> entry_columns: array<u32>;
@group(0) @binding(2) var<storage, read> entry_values: array<f32>;
@group(0) @binding(3) var<storage, read> starts: array<u32>;
@group(0) @binding(4) var<storage, read> classes: array<u32>;
// Where each row of the layer begins.
@group(0) @binding(5) var<storage, read> layer_starts: array<u32>;
@group(0) @binding(6) var<storage, read_write> columns: array<u32>;
@group(0) @binding(7) var<storage, read_write> weights: array<f32>;

@compute @workgroup_size(256)
fn pack(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let local = (group.y * groups.x + group.x) * ROWS_OF_GROUP + index / LANES;
    if (local >= assembly.rows) {
        return;
    }
    var source = starts[assembly.first_row + local] - starts[assembly.first_row];
    for (var number = 0u; number < assembly.class_number; number += 1u) {
        source += classes[number * assembly.rows + local];
    }
    let to = layer_starts[local];
    let count = layer_starts[local + 1u] - to;
    for (var at = index % LANES; at < count; at += LANES) {
        columns[to + at] = entry_columns[source + at];
        weights[to + at] = entry_values[(source + at) * CHANNELS + assembly.channel];
    }
}
