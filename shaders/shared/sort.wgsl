// Sorts keys in workgroup memory by a bitonic network (Batcher 1968), together with their places before sorting. Equal
// keys stay in order. The file that imports this one states LANES, the most elements SORTED, and their PLACE_BITS.

// Key and place fit into one word.
override PACKED: bool = false;

var<workgroup> keys: array<u32, SORTED>;
var<workgroup> places: array<u32, SORTED>;

fn put(at: u32, key: u32, place: u32) {
    if (PACKED) {
        keys[at] = (key << PLACE_BITS) | place;
    } else {
        keys[at] = key;
        places[at] = place;
    }
}

fn sorted_key(at: u32) -> u32 {
    if (PACKED) {
        return keys[at] >> PLACE_BITS;
    }
    return keys[at];
}

fn sorted_place(at: u32) -> u32 {
    if (PACKED) {
        return keys[at] & ((1u << PLACE_BITS) - 1u);
    }
    return places[at];
}

// Sorts the first `count` elements. All lanes call it, after a barrier.
fn sort(lane: u32, count: u32) {
    var size = 1u;
    while (size < count) {
        size *= 2u;
    }
    for (var at = count + lane; at < size; at += LANES) {
        keys[at] = 0xffffffffu;
        if (!PACKED) {
            places[at] = 0xffffffffu;
        }
    }
    workgroupBarrier();
    for (var run = 2u; run <= size; run *= 2u) {
        for (var apart = run / 2u; apart > 0u; apart /= 2u) {
            for (var pair = lane; pair < size / 2u; pair += LANES) {
                let a = ((pair & ~(apart - 1u)) << 1u) | (pair & (apart - 1u));
                order(a, a + apart, (a & run) == 0u);
            }
            workgroupBarrier();
        }
    }
}

fn order(a: u32, b: u32, ascends: bool) {
    let x = keys[a];
    let y = keys[b];
    if (PACKED) {
        if ((x > y) == ascends) {
            keys[a] = y;
            keys[b] = x;
        }
    } else {
        let of_x = places[a];
        let of_y = places[b];
        if ((x > y || (x == y && of_x > of_y)) == ascends) {
            keys[a] = y;
            keys[b] = x;
            places[a] = of_y;
            places[b] = of_x;
        }
    }
}
