// The terms of each part: its contributions sorted by key, and summed in the order of the paths. A workgroup takes a part.
#import assembly
#import scan
#import sort

const LANES = 32u;
// The most contributions of a part.
const SORTED = 512u;
const PLACE_BITS = 9u;
const PIXEL_BITS = 28u;

// 1 for luminance, 3 for colours.
override CHANNELS: u32 = 3u;

@group(0) @binding(1) var<storage, read> records: array<vec4u>;
// The number of terms so far.
@group(0) @binding(2) var<storage, read_write> top: array<atomic<u32>>;
@group(0) @binding(3) var<storage, read_write> term_keys: array<u32>;
@group(0) @binding(4) var<storage, read_write> term_values: array<f32>;
// For each part: its first term, the number of its terms, the rays of its paths, and its unfinished paths.
@group(0) @binding(5) var<storage, read_write> parts: array<vec4u>;
// The number of terms in each row.
@group(0) @binding(6) var<storage, read_write> counts: array<atomic<u32>>;
// For each part and channel: the sums of direct and of ambient light.
@group(0) @binding(7) var<storage, read_write> heads: array<f64>;

var<workgroup> values: array<f32, SORTED * CHANNELS>;
var<workgroup> sums: array<f64, LANES * 2u * CHANNELS>;
var<workgroup> costs: array<u32, LANES>;
var<workgroup> first_term: u32;

// Connections in the record of a path from the surfaces that it met, and gathered ones.
fn ends(surfaces: u32) -> vec2u {
    let connected = max(surfaces, assembly.direct) - assembly.direct;
    return vec2u(connected, select(0u, max(surfaces, 1u) - 1u, assembly.gathers == 1u));
}

// The surface from which connection `index` goes, and its slot in the record.
fn place(index: u32, connected: u32) -> vec2u {
    if (index < connected) {
        return vec2u(index + 1u + assembly.direct, index + 1u);
    }
    let gathered = index - connected;
    return vec2u(gathered + 2u, assembly.max_bounces + 1u - assembly.direct + gathered);
}

// The light of a slot in the channels of the matrix.
fn light(slot: vec4u) -> vec3f {
    let rgb = bitcast<vec3f>(slot.yzw);
    if (CHANNELS == 1u) {
        let shares = rgb * assembly.luminance;
        return vec3f(shares.x + shares.y + shares.z, 0.0, 0.0);
    }
    return rgb;
}

fn is_light(slot: vec4u) -> bool {
    return slot.x != NOTHING && any(light(slot) != vec3f(0.0));
}

fn class_of(bounces: u32) -> u32 {
    if (bounces == 1u) {
        return 0u;
    }
    return select(1u, 2u, assembly.split == 1u && bounces > 2u);
}

// The number of surfaces in a finished path's record; an unfinished one has no contributions.
fn surfaces_of(head: vec4u) -> u32 {
    let surfaces = min(head.x & 0xffu, assembly.max_bounces);
    return select(0u, surfaces, (head.x >> 16u) == (assembly.mark >> 16u));
}

@compute @workgroup_size(32)
fn sum_parts(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let local = group.y * groups.x + group.x;
    if (local >= assembly.parts) {
        return;
    }
    let part = assembly.first_part + local;
    let pixel = part / assembly.parts_of_pixel;
    let number = part % assembly.parts_of_pixel;
    var first = number * assembly.samples_of_part;
    var end = assembly.first_half;
    if (number >= assembly.parts_of_first_half) {
        first = assembly.first_half + (number - assembly.parts_of_first_half) * assembly.samples_of_part;
        end = assembly.samples;
    }
    end = min(end, first + assembly.samples_of_part);
    // The number, in the dispatch, of the pixel's first path; it may lie before the dispatch.
    let origin = (pixel - assembly.first_pixel) * assembly.samples - assembly.first_sample;

    var total = 0u;
    var rays = 0u;
    var unfinished = 0u;
    var direct = array<f64, 3>();
    var ambient = array<f64, 3>();
    for (var begin = first; begin < end; begin += LANES) {
        let path = origin + begin + lane;
        let exists = begin + lane < end;
        var surfaces = 0u;
        var own = 0u;
        if (exists) {
            let head = records[path];
            surfaces = surfaces_of(head);
            unfinished += u32((head.x >> 16u) != (assembly.mark >> 16u));
            rays += (head.x >> 8u) & 0xffu;
            let returned = light(head);
            var emitted = vec3f(0.0);
            if (assembly.ambient == 1u) {
                emitted = light(records[(assembly.stride - 1u) * assembly.paths + path]);
            }
            for (var channel = 0u; channel < CHANNELS; channel += 1u) {
                direct[channel] += f64(returned[channel]);
                ambient[channel] += f64(emitted[channel]);
            }
            let all = ends(surfaces);
            for (var index = 0u; index < all.x + all.y; index += 1u) {
                own += u32(is_light(records[place(index, all.x).y * assembly.paths + path]));
            }
        }
        var next = total + scan_lanes(lane, own);
        let all = ends(surfaces);
        for (var index = 0u; index < all.x + all.y; index += 1u) {
            let at = place(index, all.x);
            let slot = records[at.y * assembly.paths + path];
            if (is_light(slot)) {
                let other = slot.x & ((1u << PIXEL_BITS) - 1u);
                let class_number = class_of(at.x + (slot.x >> PIXEL_BITS)) - assembly.lowest_class;
                put(next, (other << assembly.class_bits) | class_number, next);
                let value = light(slot);
                for (var channel = 0u; channel < CHANNELS; channel += 1u) {
                    values[channel * SORTED + next] = value[channel];
                }
                next += 1u;
            }
        }
        total += partial[LANES - 1u];
        workgroupBarrier();
    }
    sort(lane, total);

    // Each lane has consecutive contributions, and sums the runs that begin there.
    let each = (total + LANES - 1u) / LANES;
    let lane_first = min(lane * each, total);
    let lane_end = min(lane_first + each, total);
    var begins = 0u;
    for (var at = lane_first; at < lane_end; at += 1u) {
        begins += u32(at == 0u || sorted_key(at) != sorted_key(max(at, 1u) - 1u));
    }
    let before = scan_lanes(lane, begins);
    let terms = partial[LANES - 1u];
    if (lane == 0u) {
        first_term = atomicAdd(&top[0], terms);
        atomicAdd(&counts[assembly.own_base + pixel], terms);
    }
    workgroupBarrier();
    var term = first_term + before;
    for (var at = lane_first; at < lane_end; at += 1u) {
        let key = sorted_key(at);
        if (at > 0u && sorted_key(max(at, 1u) - 1u) == key) {
            continue;
        }
        var sum = array<f64, 3>();
        for (var same = at; same < total && sorted_key(same) == key; same += 1u) {
            for (var channel = 0u; channel < CHANNELS; channel += 1u) {
                sum[channel] += f64(values[channel * SORTED + sorted_place(same)]);
            }
        }
        term_keys[term] = key;
        for (var channel = 0u; channel < CHANNELS; channel += 1u) {
            term_values[term * CHANNELS + channel] = f32(sum[channel]);
        }
        atomicAdd(&counts[assembly.other_base + (key >> assembly.class_bits)], 1u);
        term += 1u;
    }
    // Rays and unfinished paths of a part share a word: a path counts up to 255 rays, and a part has up to 512 paths.
    costs[lane] = (unfinished << 20u) | rays;
    for (var channel = 0u; channel < CHANNELS; channel += 1u) {
        sums[2u * channel * LANES + lane] = direct[channel];
        sums[(2u * channel + 1u) * LANES + lane] = ambient[channel];
    }
    for (var others = LANES / 2u; others > 0u; others /= 2u) {
        workgroupBarrier();
        if (lane < others) {
            costs[lane] += costs[lane + others];
            if (assembly.direct == 1u || assembly.ambient == 1u) {
                for (var which = 0u; which < 2u * CHANNELS; which += 1u) {
                    sums[which * LANES + lane] += sums[which * LANES + lane + others];
                }
            }
        }
    }
    workgroupBarrier();
    if (lane == 0u) {
        parts[part] = vec4u(first_term, terms, costs[0] & 0xfffffu, costs[0] >> 20u);
    }
    if ((assembly.direct == 1u || assembly.ambient == 1u) && lane < 2u * CHANNELS) {
        heads[2u * part * CHANNELS + lane] = sums[lane * LANES];
    }
}
