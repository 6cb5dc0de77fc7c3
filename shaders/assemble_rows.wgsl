// Sorts the terms of each row, sums those of one entry, and adds up what the noise is computed from. A workgroup takes a
// row. The entries of each class follow one another, by ascending columns.
#import assembly
#import scan
#import sort

const LANES = 64u;
// The most terms of a row that are sorted in workgroup memory. Longer rows are sorted in place (LONG).
const SORTED = 1024u;
const PLACE_BITS = 10u;

override CHANNELS: u32 = 3u;
override LONG: bool = false;

// For each term of a row: its key, and the bits of its values.
@group(0) @binding(1) var<storage, read_write> row_terms: array<u32>;
@group(0) @binding(2) var<storage, read> starts: array<u32>;
@group(0) @binding(3) var<storage, read> estimates: array<f64>;
@group(0) @binding(4) var<storage, read_write> entry_columns: array<u32>;
@group(0) @binding(5) var<storage, read_write> entry_values: array<f32>;
// The number of entries of each class in each row.
@group(0) @binding(6) var<storage, read_write> classes: array<u32>;
// For each row: the sums over its entries of mean and error in each channel, and of the squares of both, with and
// without light of one bounce.
@group(0) @binding(7) var<storage, read_write> sums: array<f64>;

// Numbers that are added over the lanes at a time: those of one channel.
const TOGETHER = 6u;

var<workgroup> added: array<f64, LANES * TOGETHER>;
var<workgroup> has_diagonal: atomic<u32>;

struct Sum {
    mean: array<f64, 3>,
    error: array<f64, 3>,
}

fn key_at(row_start: u32, at: u32) -> u32 {
    if (LONG) {
        return row_terms[(row_start + at) * (1u + CHANNELS)];
    }
    return sorted_key(at);
}

fn place_at(at: u32) -> u32 {
    if (LONG) {
        return at;
    }
    return sorted_place(at);
}

// Column and class of a term.
fn position_at(row_start: u32, at: u32) -> u32 {
    return key_at(row_start, at) >> (assembly.part_bits + 1u);
}

fn weight(high: vec4f, low: vec4f, which: u32) -> f64 {
    return f64(high[which]) + f64(low[which]);
}

// The sum of the terms from `first` on that have the same position. Light is added as it is, for each half of the samples of
// each endpoint, and weighted at the end: no driver can then round an entry and its mirror image differently.
fn sum_from(row_start: u32, first: u32, count: u32) -> Sum {
    var plain = array<array<f64, 3>, 4>();
    let position = position_at(row_start, first);
    for (var at = first; at < count && position_at(row_start, at) == position; at += 1u) {
        let key = key_at(row_start, at);
        let number = key & ((1u << assembly.part_bits) - 1u);
        let projector = select((key >> assembly.part_bits) & 1u, 0u, is_set(SYMMETRIC));
        let half = u32(number >= assembly.first_halves[projector]);
        let place = (row_start + place_at(at)) * (1u + CHANNELS);
        for (var channel = 0u; channel < CHANNELS; channel += 1u) {
            plain[2u * projector + half][channel] += f64(bitcast<f32>(row_terms[place + 1u + channel]));
        }
    }
    var sum = Sum();
    let mean = f64(assembly.mean.x) + f64(assembly.mean.y);
    for (var channel = 0u; channel < CHANNELS; channel += 1u) {
        let all = (plain[0][channel] + plain[1][channel]) + (plain[2][channel] + plain[3][channel]);
        sum.mean[channel] = all * mean;
        for (var which = 0u; which < 4u; which += 1u) {
            sum.error[channel] += plain[which][channel] * weight(assembly.error_high, assembly.error_low, which);
        }
    }
    return sum;
}

fn exchange_global(a: u32, b: u32) {
    for (var word = 0u; word <= CHANNELS; word += 1u) {
        let value = row_terms[a * (1u + CHANNELS) + word];
        row_terms[a * (1u + CHANNELS) + word] = row_terms[b * (1u + CHANNELS) + word];
        row_terms[b * (1u + CHANNELS) + word] = value;
    }
}

// Sorts a row in place, by the network of `sort`.
fn sort_global(row_start: u32, lane: u32, count: u32) {
    for (var run = 2u; run < 2u * count; run *= 2u) {
        for (var apart = run / 2u; apart > 0u; apart /= 2u) {
            let pairs = pairs_of_step(apart, count);
            for (var number = lane; number < pairs; number += LANES) {
                let pair = pair_of_step(number, apart, run);
                if (pair.y < count && key_at(row_start, pair.x) > key_at(row_start, pair.y)) {
                    exchange_global(row_start + pair.x, row_start + pair.y);
                }
            }
            storageBarrier();
            workgroupBarrier();
        }
    }
}

@compute @workgroup_size(64)
fn merge_rows(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let local = group.y * groups.x + group.x;
    if (local >= assembly.rows) {
        return;
    }
    let row = assembly.first_row + local;
    let row_start = starts[row] - starts[assembly.first_row];
    let count = starts[row + 1u] - starts[row];
    if ((count > SORTED) != LONG) {
        return;
    }
    if (LONG) {
        sort_global(row_start, lane, count);
    } else {
        for (var at = lane; at < count; at += LANES) {
            put(at, row_terms[(row_start + at) * (1u + CHANNELS)], at);
        }
        workgroupBarrier();
        sort(lane, count);
    }
    if (lane == 0u) {
        atomicStore(&has_diagonal, 0u);
    }
    let each = (count + LANES - 1u) / LANES;
    let lane_first = min(lane * each, count);
    let lane_end = min(lane_first + each, count);
    let class_mask = (1u << assembly.class_bits) - 1u;
    var begins = array<u32, 3>();
    for (var at = lane_first; at < lane_end; at += 1u) {
        let position = position_at(row_start, at);
        if (at == 0u || position_at(row_start, max(at, 1u) - 1u) != position) {
            begins[position & class_mask] += 1u;
        }
    }
    // Places of this lane's first entry of each class.
    var next = array<u32, 3>();
    var before = row_start;
    for (var number = 0u; number <= class_mask && number < 3u; number += 1u) {
        next[number] = before + scan_lanes(lane, begins[number]);
        let all = partial[LANES - 1u];
        workgroupBarrier();
        before += all;
        if (lane == 0u) {
            classes[number * assembly.rows + local] = all;
        }
    }
    var row_mean = array<f64, 3>();
    var row_error = array<f64, 3>();
    var squares = array<f64, 4>();
    for (var at = lane_first; at < lane_end; at += 1u) {
        let position = position_at(row_start, at);
        if (at > 0u && position_at(row_start, max(at, 1u) - 1u) == position) {
            continue;
        }
        let column = position >> assembly.class_bits;
        let number = position & class_mask;
        let entry = next[number];
        next[number] += 1u;
        let sum = sum_from(row_start, at, count);
        entry_columns[entry] = column;
        for (var channel = 0u; channel < CHANNELS; channel += 1u) {
            entry_values[entry * CHANNELS + channel] = f32(sum.mean[channel]);
            row_mean[channel] += sum.mean[channel];
            row_error[channel] += sum.error[channel];
        }
        if (at == 0u || (position_at(row_start, max(at, 1u) - 1u) >> assembly.class_bits) != column) {
            if (column == row) {
                atomicStore(&has_diagonal, 1u);
            }
            // Where there is one class, the column has this entry alone.
            var whole = sum;
            var others = sum;
            if (assembly.class_bits > 0u) {
                others = others_of_column(row_start, at, count, &whole);
            }
            square_column(row, column, whole, others, &squares);
        }
    }
    workgroupBarrier();
    if (lane == 0u && assembly.direct == 1u) {
        for (var channel = 0u; channel < CHANNELS; channel += 1u) {
            let at = 2u * (row * CHANNELS + channel);
            row_mean[channel] += estimates[at];
            row_error[channel] += estimates[at + 1u];
            if (atomicLoad(&has_diagonal) == 0u) {
                squares[0] += estimates[at] * estimates[at];
                squares[1] += estimates[at + 1u] * estimates[at + 1u];
            }
        }
    }
    // In the order of `sums`.
    var all = array<f64, 10>();
    for (var channel = 0u; channel < CHANNELS; channel += 1u) {
        all[2u * channel] = row_mean[channel];
        all[2u * channel + 1u] = row_error[channel];
    }
    for (var which = 0u; which < 4u; which += 1u) {
        all[2u * CHANNELS + which] = squares[which];
    }
    add_lanes(lane, &all, row * (2u * CHANNELS + 4u));
}

// The sum of a column's light of two and more bounces, from its first term on; `whole` becomes the sum of all its light.
fn others_of_column(row_start: u32, first: u32, count: u32, whole: ptr<function, Sum>) -> Sum {
    let column = position_at(row_start, first) >> assembly.class_bits;
    var others = Sum();
    *whole = Sum();
    var last = NOTHING;
    for (var at = first; at < count; at += 1u) {
        let position = position_at(row_start, at);
        if ((position >> assembly.class_bits) != column) {
            break;
        }
        if (position == last) {
            continue;
        }
        last = position;
        let sum = sum_from(row_start, at, count);
        let is_direct = (position & ((1u << assembly.class_bits) - 1u)) + assembly.lowest_class == 0u;
        for (var channel = 0u; channel < CHANNELS; channel += 1u) {
            (*whole).mean[channel] += sum.mean[channel];
            (*whole).error[channel] += sum.error[channel];
            if (!is_direct) {
                others.mean[channel] += sum.mean[channel];
                others.error[channel] += sum.error[channel];
            }
        }
    }
    return others;
}

// Adds the squares of mean and error of a column: for all its light, with the diagonal, and for that of two and more bounces.
fn square_column(row: u32, column: u32, whole: Sum, others: Sum, squares: ptr<function, array<f64, 4>>) {
    for (var channel = 0u; channel < CHANNELS; channel += 1u) {
        var mean = whole.mean[channel];
        var error = whole.error[channel];
        if (column == row && assembly.direct == 1u) {
            mean += estimates[2u * (row * CHANNELS + channel)];
            error += estimates[2u * (row * CHANNELS + channel) + 1u];
        }
        (*squares)[0] += mean * mean;
        (*squares)[1] += error * error;
        (*squares)[2] += others.mean[channel] * others.mean[channel];
        (*squares)[3] += others.error[channel] * others.error[channel];
    }
}

// Writes the sums over all lanes of the first `4 + 2 CHANNELS` numbers, some of them at a time.
fn add_lanes(lane: u32, own: ptr<function, array<f64, 10>>, to: u32) {
    let all = 4u + 2u * CHANNELS;
    for (var first = 0u; first < all; first += TOGETHER) {
        let count = min(TOGETHER, all - first);
        for (var which = 0u; which < count; which += 1u) {
            added[which * LANES + lane] = (*own)[first + which];
        }
        for (var others = LANES / 2u; others > 0u; others /= 2u) {
            workgroupBarrier();
            if (lane < others) {
                for (var which = 0u; which < count; which += 1u) {
                    added[which * LANES + lane] += added[which * LANES + lane + others];
                }
            }
        }
        workgroupBarrier();
        if (lane < count) {
            sums[to + first + lane] = added[lane * LANES];
        }
        workgroupBarrier();
    }
}
