// Moves terms to the rows of the pixels at which their paths start, and at which they end. Their order within a row is
// arbitrary; keys make them unique. 32 lanes take a part.
#import assembly

const LANES = 32u;
const PARTS_OF_GROUP = 8u;

override CHANNELS: u32 = 3u;

@group(0) @binding(1) var<storage, read> term_keys: array<u32>;
@group(0) @binding(2) var<storage, read> term_values: array<f32>;
@group(0) @binding(3) var<storage, read> parts: array<vec4u>;
@group(0) @binding(4) var<storage, read> starts: array<u32>;
// The number of terms that each row has received.
@group(0) @binding(5) var<storage, read_write> cursors: array<atomic<u32>>;
// For each term of a row: its key, and the bits of its values.
@group(0) @binding(6) var<storage, read_write> row_terms: array<u32>;

var<workgroup> own_place: array<u32, PARTS_OF_GROUP>;

fn is_here(row: u32) -> bool {
    return row >= assembly.first_row && row - assembly.first_row < assembly.rows;
}

fn write(to: u32, source: u32, column: u32, class_number: u32, tie: u32) {
    let place = to * (1u + CHANNELS);
    row_terms[place] = (((column << assembly.class_bits) | class_number) << (assembly.part_bits + 1u)) | tie;
    for (var channel = 0u; channel < CHANNELS; channel += 1u) {
        row_terms[place + 1u + channel] = bitcast<u32>(term_values[source * CHANNELS + channel]);
    }
}

@compute @workgroup_size(256)
fn scatter(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) index: u32,
) {
    let local = (group.y * groups.x + group.x) * PARTS_OF_GROUP + index / LANES;
    let lane = index % LANES;
    let part = assembly.first_part + local;
    let pixel = part / assembly.parts_of_pixel;
    let number = part % assembly.parts_of_pixel;
    let origin = starts[assembly.first_row];
    var terms = vec2u(0u);
    if (local < assembly.parts) {
        terms = parts[part].xy;
    }
    let is_own = is_set(HAS_OWN) && is_here(pixel) && terms.y > 0u;
    if (lane == 0u && is_own) {
        let taken = atomicAdd(&cursors[pixel - assembly.first_row], terms.y);
        own_place[index / LANES] = starts[pixel] - origin + taken;
    }
    workgroupBarrier();
    for (var at = lane; at < terms.y; at += LANES) {
        let source = terms.x + at;
        let key = term_keys[source];
        let other = key >> assembly.class_bits;
        let class_number = key & ((1u << assembly.class_bits) - 1u);
        // Where an entry and its mirror image have the same terms, both order them by this bit.
        let is_second = select(is_set(FROM_PROJECTOR), pixel > other, is_set(SYMMETRIC));
        let tie = (u32(is_second) << assembly.part_bits) | number;
        if (is_own) {
            write(own_place[index / LANES] + at, source, other, class_number, tie);
        }
        if (is_set(HAS_MIRRORED) && is_here(other)) {
            let taken = atomicAdd(&cursors[other - assembly.first_row], 1u);
            write(starts[other] - origin + taken, source, pixel, class_number, tie);
        }
    }
}
