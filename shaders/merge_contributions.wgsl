// The contributions in the records of a dispatch's paths as entries in path order. First each path counts its own; the scan of these numbers says
// where its entries begin.
#import merging

const PIXEL_BITS = 28u;

// Connections in the record of a path from the surfaces that it met, and gathered ones.
fn ends(path: u32) -> vec2u {
    let surfaces = records[path].x & 0xffu;
    let connected = max(surfaces, merging.direct) - merging.direct;
    return vec2u(connected, select(0u, max(surfaces, 1u) - 1u, merging.gathers == 1u));
}

// The surface from which connection `index` goes, and its slot in the record.
fn place(index: u32, connected: u32) -> vec2u {
    if (index < connected) {
        return vec2u(index + 1u + merging.direct, index + 1u);
    }
    let gathered = index - connected;
    return vec2u(gathered + 2u, merging.max_bounces + 1u - merging.direct + gathered);
}

// The light of a slot in the channels of the matrix.
fn light(slot: vec4u) -> vec3f {
    let rgb = bitcast<vec3f>(slot.yzw);
    if (merging.channels == 1u) {
        let shares = rgb * merging.luminance;
        return vec3f(shares.x + shares.y + shares.z, 0.0, 0.0);
    }
    return rgb;
}

fn counts(slot: vec4u) -> bool {
    return slot.x != NOTHING && any(light(slot) != vec3f(0.0));
}

@compute @workgroup_size(256)
fn count_contributions(@builtin(global_invocation_id) id: vec3u) {
    let path = id.x;
    if (path >= merging.paths) {
        return;
    }
    let all = ends(path);
    var count = 0u;
    for (var index = 0u; index < all.x + all.y; index += 1u) {
        let slot = records[place(index, all.x).y * merging.paths + path];
        count += select(0u, 1u, counts(slot));
    }
    counters[path] = count;
}

@compute @workgroup_size(256)
fn write_contributions(@builtin(global_invocation_id) id: vec3u) {
    let path = id.x;
    if (path >= merging.paths) {
        return;
    }
    let all = ends(path);
    let half = select(0u, 1u, path % merging.samples >= merging.first_half);
    var next = scanned(path);
    for (var index = 0u; index < all.x + all.y; index += 1u) {
        let at = place(index, all.x);
        let slot = records[at.y * merging.paths + path];
        if (counts(slot)) {
            let bounces = at.x + (slot.x >> PIXEL_BITS);
            var class_of_bounces = select(1u, 0u, bounces == 1u);
            if (merging.split == 1u && bounces > 2u) {
                class_of_bounces = 2u;
            }
            let pixel = slot.x & ((1u << PIXEL_BITS) - 1u);
            entries[next] = vec4u(pixel << 2u | class_of_bounces, path / merging.samples, next, half);
            let value = light(slot);
            for (var channel = 0u; channel < merging.channels; channel += 1u) {
                values[next * merging.channels + channel] = value[channel];
            }
            next += 1u;
        }
    }
}
