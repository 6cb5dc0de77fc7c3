// Sums and updates of long vectors in f64. A buffer holds some columns of a basis, one after the other.

// Which columns of the buffer take part.
struct Part {
    // The entries of a vector.
    rows: u32,
    // The first column, and the number of columns.
    first: u32,
    columns: u32,
    // The place of the first column's coefficient or sum.
    place: u32,
    // The number of blocks of ROWS entries.
    blocks: u32,
    // 1 if the square of w follows the sums of the columns, else 0.
    square: u32,
    // The second and the third vector of a combination, whose first one is the first column.
    second: u32,
    third: u32,
}

const LANES = 32u;
const ROWS = 1024u;
const INVOCATIONS = 256u;
// Stands for w in place of a column.
const W = 0xffffffffu;

@group(0) @binding(0) var<uniform> part: Part;
@group(0) @binding(1) var<storage, read> columns: array<f64>;
@group(0) @binding(2) var<storage, read> coefficients: array<f64>;
@group(0) @binding(3) var<storage, read_write> w: array<f64>;
@group(0) @binding(4) var<storage, read_write> other: array<f64>;
// The indices of selected entries, whose factors are the coefficients. A kernel has either w or these, in one layout.
@group(0) @binding(3) var<storage, read_write> selected: array<u32>;

var<workgroup> held: array<f64, 1024>;
var<workgroup> sums: array<f64, 256>;

// The entry that an invocation takes.
fn row_of(group: vec3u, groups: vec3u, index: u32) -> u32 {
    return INVOCATIONS * (group.y * groups.x + group.x) + index;
}

// w ← w − V h, one column after the other.
@compute @workgroup_size(256)
fn remove(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let row = row_of(group, groups, index);
    if (row < part.rows) {
        var value = w[row];
        for (var column = 0u; column < part.columns; column += 1u) {
            value -= coefficients[part.place + column] * columns[(part.first + column) * part.rows + row];
        }
        w[row] = value;
    }
}

// The entry of a column of the buffer, or of w.
fn entry(column: u32, row: u32) -> f64 {
    if (column == W) {
        return w[row];
    }
    return columns[column * part.rows + row];
}

// other ← (Σ c v) / d, for up to three vectors v. The coefficients are followed by d.
@compute @workgroup_size(256)
fn combine(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let row = row_of(group, groups, index);
    if (row < part.rows) {
        var sum = coefficients[0] * entry(part.first, row);
        if (part.columns > 1u) {
            sum += coefficients[1] * entry(part.second, row);
        }
        if (part.columns > 2u) {
            sum += coefficients[2] * entry(part.third, row);
        }
        // Vulkan does not promise that a quotient by 1 is exact.
        if (coefficients[3] != f64(1.0)) {
            sum /= coefficients[3];
        }
        other[row] = sum;
    }
}

// w ← v w, entry by entry, for the first column v.
@compute @workgroup_size(256)
fn scale_by(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let row = row_of(group, groups, index);
    if (row < part.rows) {
        w[row] *= entry(part.first, row);
    }
}

// Moves each entry of w between two multiples of the first column's entry, whose factors are the coefficients.
@compute @workgroup_size(256)
fn clip_by(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let row = row_of(group, groups, index);
    if (row < part.rows) {
        let lower = coefficients[0] * entry(part.first, row);
        let upper = coefficients[1] * entry(part.first, row);
        let value = w[row];
        w[row] = select(select(value, lower, value < lower), upper, value > upper);
    }
}

// The inner products of w with the columns over a block of rows, which a workgroup keeps. 32 lanes share a column.
@compute @workgroup_size(256)
fn dots(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let block = group.y * groups.x + group.x;
    let start = block * ROWS;
    let count = select(0u, min(ROWS, part.rows - start), block < part.blocks);
    for (var row = index; row < count; row += INVOCATIONS) {
        held[row] = w[start + row];
    }
    workgroupBarrier();
    let lane = index % LANES;
    let all = part.columns + part.square;
    for (var first = 0u; first < all; first += INVOCATIONS / LANES) {
        let column = first + index / LANES;
        var sum = f64(0.0);
        if (column < part.columns) {
            let at = (part.first + column) * part.rows + start;
            for (var row = lane; row < count; row += LANES) {
                sum += held[row] * columns[at + row];
            }
        } else if (column < all) {
            for (var row = lane; row < count; row += LANES) {
                sum += held[row] * held[row];
            }
        }
        sums[index] = sum;
        for (var others = LANES / 2u; others > 0u; others /= 2u) {
            workgroupBarrier();
            if (lane < others) {
                sums[index] += sums[index + others];
            }
        }
        if (lane == 0u && column < all && block < part.blocks) {
            other[(part.place + column) * part.blocks + block] = sums[index];
        }
        workgroupBarrier();
    }
}

// Adds the sums of all blocks, in a fixed order, for one column in each workgroup.
@compute @workgroup_size(256)
fn gather(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let column = group.y * groups.x + group.x;
    let count = select(0u, part.blocks, column < part.columns);
    var sum = f64(0.0);
    for (var block = index; block < count; block += INVOCATIONS) {
        sum += other[column * part.blocks + block];
    }
    sums[index] = sum;
    for (var others = INVOCATIONS / 2u; others > 0u; others /= 2u) {
        workgroupBarrier();
        if (index < others) {
            sums[index] += sums[index + others];
        }
    }
    if (index == 0u && column < part.columns) {
        w[column] = sums[0];
    }
}

// The selected entries of the longer vector ← their factors times the first column.
@compute @workgroup_size(256)
fn write_selected(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let row = row_of(group, groups, index);
    if (row < part.rows) {
        other[selected[row]] = coefficients[row] * columns[row];
    }
}

// other ← the factors times the selected entries of the longer vector.
@compute @workgroup_size(256)
fn read_selected(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let row = row_of(group, groups, index);
    if (row < part.rows) {
        other[row] = coefficients[row] * columns[selected[row]];
    }
}
