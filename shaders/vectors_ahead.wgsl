// Coefficients of a step of a block Lanczos process, from the inner products of its vectors: what krylux::krylov::Factorization computes
// between two sweeps.

struct Ahead {
    // The number of columns of the basis. The product may have large parts along the columns from `first` on. The first `known` columns are
    // known vectors. No late parts lie along them.
    columns: u32,
    first: u32,
    known: u32,
    // 1 if the product is that of the last column, else 0.
    is_last: u32,
    // The room of a row of the memory.
    room: u32,
    // The place of the record of the step.
    place: u32,
}

@group(0) @binding(0) var<uniform> ahead: Ahead;
@group(0) @binding(1) var<storage, read> sums: array<f64>;
// Rows for the parts along the basis that the last sweep has left, and for the entries of the tridiagonal matrix above, on and below its
// diagonal; a combination of vectors, whose divisor is the length of the remainder; and records.
@group(0) @binding(2) var<storage, read_write> memory: array<f64>;

const INVOCATIONS = 256u;
const ABOVE = 1u;
const DIAGONAL = 2u;
const BELOW = 3u;
const TERMS = 4u;
// The rows of a record after the first one. The late parts end with the length of the remainder.
const KNOWN_PARTS = 1u;
const LATE_PARTS = 2u;
const REST = 3u;

fn row(name: u32, index: u32) -> u32 {
    return name * ahead.room + index;
}

// The part of the last column along another one.
fn late(index: u32) -> f64 {
    if (index + 1u >= ahead.columns) {
        return f64(0.0);
    }
    return memory[index] / memory[row(TERMS, 3u)];
}

// The entry of the product of the tridiagonal matrix with the late parts.
fn product_of_late(index: u32) -> f64 {
    var sum = memory[row(DIAGONAL, index)] * late(index);
    if (index > 0u) {
        sum += memory[row(BELOW, index - 1u)] * late(index - 1u);
    }
    if (index + 2u < ahead.columns) {
        sum += memory[row(ABOVE, index + 1u)] * late(index + 1u);
    }
    return sum;
}

// From the inner products of a product with the columns from `first`: what is removed from it, and from the last column.
@compute @workgroup_size(256)
fn settle(@builtin(local_invocation_index) invocation: u32) {
    let along = ahead.columns - ahead.first;
    let of_last = sums[along - 1u];
    for (var index = invocation; index <= along; index += INVOCATIONS) {
        memory[ahead.place + index] = sums[index];
    }
    for (var index = invocation; index < ahead.columns; index += INVOCATIONS) {
        var part = f64(0.0);
        if (index >= ahead.first) {
            part = sums[index - ahead.first];
        } else {
            if (ahead.is_last == 1u) {
                part = product_of_late(index);
            }
            part -= of_last * late(index);
        }
        memory[ahead.place + row(KNOWN_PARTS, index)] = part;
        memory[ahead.place + row(LATE_PARTS, index)] = late(index);
    }
    if (invocation == 0u) {
        memory[row(DIAGONAL, ahead.columns - 1u)] = of_last;
        if (along > 1u) {
            memory[row(ABOVE, ahead.columns - 1u)] = sums[along - 2u];
        }
    }
}

// From the inner products of the remainder with all columns, and the square of its length: what the next step removes from the next column.
@compute @workgroup_size(256)
fn rest(@builtin(local_invocation_index) invocation: u32) {
    for (var index = invocation; index <= ahead.columns; index += INVOCATIONS) {
        memory[ahead.place + row(REST, index)] = sums[index];
        memory[index] = select(sums[index], f64(0.0), index < ahead.known);
    }
    if (invocation == 0u) {
        let length = sqrt(sums[ahead.columns]);
        memory[row(BELOW, ahead.columns - 1u)] = length;
        memory[ahead.place + row(LATE_PARTS, ahead.room - 1u)] = length;
        memory[row(TERMS, 0u)] = f64(1.0);
        memory[row(TERMS, 3u)] = length;
    }
}
