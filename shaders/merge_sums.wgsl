// The sums of sorted entries of equal start and key. A term is the start, the key, and in each channel the mean and then its error.
#import merging

// Contributions that are summed before their sum is added to that of the others, so that rounding grows with their number more slowly.
const TOGETHER = 64u;

fn begins(index: u32) -> bool {
    return index == 0u || any(entries[index].xy != entries[index - 1u].xy);
}

@compute @workgroup_size(256)
fn mark_terms(@builtin(global_invocation_id) id: vec3u) {
    if (id.x < merging.elements) {
        counters[id.x] = select(0u, 1u, id.x < totals[0] && begins(id.x));
    }
}

@compute @workgroup_size(256)
fn sum_terms(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= totals[0] || !begins(id.x)) {
        return;
    }
    let first = entries[id.x];
    let to = scanned(id.x) * (2u + 2u * merging.channels);
    terms[to] = first.y;
    terms[to + 1u] = first.x;
    // Sums for each half of the samples: of all contributions, and of the last few.
    var whole = array<vec3f, 2>();
    var recent = array<vec3f, 2>();
    var index = id.x;
    loop {
        let entry = entries[index];
        var value = vec3f(0.0);
        for (var channel = 0u; channel < merging.channels; channel += 1u) {
            value[channel] = values[entry.z * merging.channels + channel];
        }
        recent[entry.w] += value;
        index += 1u;
        let ends = index >= totals[0] || begins(index);
        if (ends || (index - id.x) % TOGETHER == 0u) {
            whole[0] += recent[0];
            whole[1] += recent[1];
            recent = array<vec3f, 2>();
        }
        if (ends) {
            break;
        }
    }
    let mean = (whole[0] + whole[1]) * merging.mean;
    let error = whole[0] * merging.error_first + whole[1] * merging.error_second;
    for (var channel = 0u; channel < merging.channels; channel += 1u) {
        terms[to + 2u + channel] = bitcast<u32>(mean[channel]);
        terms[to + 2u + merging.channels + channel] = bitcast<u32>(error[channel]);
    }
}
