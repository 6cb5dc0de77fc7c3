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

// Sorts the first `count` elements. All lanes call it, after a barrier. All merges ascend: the first step of a merge compares
// an element with its mirror image in the other half, so that elements beyond the end would never move.
fn sort(lane: u32, count: u32) {
    for (var run = 2u; run < 2u * count; run *= 2u) {
        for (var apart = run / 2u; apart > 0u; apart /= 2u) {
            let rest = count % (2u * apart);
            let pairs = (count - rest) / 2u + min(rest, apart);
            for (var pair = lane; pair < pairs; pair += LANES) {
                let low = pair & (apart - 1u);
                let a = (pair - low) * 2u + low;
                let b = select(a + apart, a + 2u * (apart - low) - 1u, 2u * apart == run);
                if (b < count) {
                    order(a, b);
                }
            }
            workgroupBarrier();
        }
    }
}

fn order(a: u32, b: u32) {
    let x = keys[a];
    let y = keys[b];
    if (PACKED) {
        if (x > y) {
            keys[a] = y;
            keys[b] = x;
        }
    } else {
        let of_x = places[a];
        let of_y = places[b];
        if (x > y || (x == y && of_x > of_y)) {
            keys[a] = y;
            keys[b] = x;
            places[a] = of_y;
            places[b] = of_x;
        }
    }
}
