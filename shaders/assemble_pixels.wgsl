// Direct and ambient light of each pixel, with the error of the direct light, from the sums of the pixel's parts; and the
// rays and the unfinished paths of each workgroup's pixels.
#import assembly
#import scan

const LANES = 256u;

override CHANNELS: u32 = 3u;

@group(0) @binding(1) var<storage, read> parts: array<vec4u>;
@group(0) @binding(2) var<storage, read> heads: array<f64>;
// For each pixel and channel: direct light and its error.
@group(0) @binding(3) var<storage, read_write> estimates: array<f64>;
// Planes of direct light and of ambient light.
@group(0) @binding(4) var<storage, read_write> direct: array<f32>;
@group(0) @binding(5) var<storage, read_write> ambient: array<f32>;
// For each workgroup: the sums of the lower and of the upper halves of its pixels' rays, and the unfinished paths.
@group(0) @binding(6) var<storage, read_write> costs: array<vec4u>;

@compute @workgroup_size(256)
fn sum_pixels(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) lane: u32,
) {
    let block = group.y * groups.x + group.x;
    let pixel = block * LANES + lane;
    var rays = 0u;
    var unfinished = 0u;
    if (pixel < assembly.rows) {
        let first = pixel * assembly.parts_of_pixel;
        for (var number = 0u; number < assembly.parts_of_pixel; number += 1u) {
            rays += parts[first + number].z;
            unfinished += parts[first + number].w;
        }
        if (assembly.direct == 1u || assembly.ambient == 1u) {
            for (var channel = 0u; channel < CHANNELS; channel += 1u) {
                sum_pixel(pixel, channel);
            }
        }
    }
    let cost = vec4u(sum_lanes(lane, rays & 0xffffu), sum_lanes(lane, rays >> 16u), sum_lanes(lane, unfinished), 0u);
    if (lane == 0u && block * LANES < assembly.rows) {
        costs[block] = cost;
    }
}

fn sum_lanes(lane: u32, own: u32) -> u32 {
    scan_lanes(lane, own);
    let all = partial[LANES - 1u];
    workgroupBarrier();
    return all;
}

fn sum_pixel(pixel: u32, channel: u32) {
    var halves = array<f64, 2>();
    var emitted = f64(0.0);
    for (var number = 0u; number < assembly.parts_of_pixel; number += 1u) {
        let at = 2u * ((pixel * assembly.parts_of_pixel + number) * CHANNELS + channel);
        halves[u32(number >= assembly.parts_of_first_half)] += heads[at];
        emitted += heads[at + 1u];
    }
    let mean = f64(assembly.mean.x) + f64(assembly.mean.y);
    let first = f64(assembly.error_high.x) + f64(assembly.error_low.x);
    let second = f64(assembly.error_high.y) + f64(assembly.error_low.y);
    let value = (halves[0] + halves[1]) * mean;
    let at = 2u * (pixel * CHANNELS + channel);
    estimates[at] = value;
    estimates[at + 1u] = halves[0] * first + halves[1] * second;
    direct[channel * assembly.rows + pixel] = f32(value);
    ambient[channel * assembly.rows + pixel] = f32(emitted * mean);
}
