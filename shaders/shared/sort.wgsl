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

// A step of the network compares elements that are `apart`, in runs of `run` elements that are being merged. All merges ascend:
// the first step of a merge compares an element with its mirror image in the other half, so that elements beyond the end
// would never move. Of a step among `count` elements, this is the number of pairs that may lie before the end.
fn pairs_of_step(apart: u32, count: u32) -> u32 {
    let rest = count % (2u * apart);
    return (count - rest) / 2u + min(rest, apart);
}

// The elements of a pair, the lower one first.
fn pair_of_step(pair: u32, apart: u32, run: u32) -> vec2u {
    let low = pair & (apart - 1u);
    let a = (pair - low) * 2u + low;
    return vec2u(a, select(a + apart, a + 2u * (apart - low) - 1u, 2u * apart == run));
}

// Sorts the first `count` elements. All lanes call it, after a barrier.
fn sort(lane: u32, count: u32) {
    for (var run = 2u; run < 2u * count; run *= 2u) {
        for (var apart = run / 2u; apart > 0u; apart /= 2u) {
            let pairs = pairs_of_step(apart, count);
            for (var number = lane; number < pairs; number += LANES) {
                let pair = pair_of_step(number, apart, run);
                if (pair.y < count) {
                    order(pair.x, pair.y);
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
