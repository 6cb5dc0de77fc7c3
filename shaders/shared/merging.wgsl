// Bindings of the kernels that sort and sum the contributions of a dispatch's paths (`render::device_merge`).
//
// An entry is one contribution: its key, the pixel that its path starts from, where its light is in `values`, and the half of
// the samples that its path belongs to. The key is the pixel at the other end of the path and, in its lowest bits, the class of bounces.

// Threads of a workgroup.
const LANES = 256u;
// Elements that a workgroup scans, and entries that it sorts.
const BLOCK = 1024u;
// Values of a digit by which entries are sorted: eight bits.
const DIGITS = 256u;
const NOTHING = 0xffffffffu;

struct Merging {
    luminance: vec3f,
    // 1 for luminance, 3 for colours.
    channels: u32,
    paths: u32,
    // Numbers of paths that start from each pixel: all, and the first half of the samples. A dispatch has all paths of its pixels.
    samples: u32,
    first_half: u32,
    max_bounces: u32,
    // 1 where the connection from the first surface is in the head of the record.
    direct: u32,
    // 1 where records have gathered connections.
    gathers: u32,
    // 1 where the second bounce is a class of its own.
    split: u32,
    // Elements of `counters` that are scanned.
    elements: u32,
    // Blocks of entries, also of those that there might have been.
    blocks: u32,
    // The digit of a pass: the word of the entry, 0 or 1, and its lowest bit.
    word: u32,
    shift: u32,
    // The place in `totals` where a scan leaves its sum, or `NOTHING`.
    total: u32,
    // Weights of a sample in the mean, and of a sample of each half in the error.
    mean: f32,
    error_first: f32,
    error_second: f32,
    padding: u32,
}

@group(0) @binding(0) var<uniform> merging: Merging;
@group(0) @binding(1) var<storage, read> records: array<vec4u>;
@group(0) @binding(2) var<storage, read_write> entries: array<vec4u>;
@group(0) @binding(3) var<storage, read_write> moved: array<vec4u>;
@group(0) @binding(4) var<storage, read_write> values: array<f32>;
@group(0) @binding(5) var<storage, read_write> counters: array<u32>;
@group(0) @binding(6) var<storage, read_write> sums: array<u32>;
// The number of entries, and that of terms.
@group(0) @binding(7) var<storage, read_write> totals: array<u32>;
@group(0) @binding(8) var<storage, read_write> terms: array<u32>;

// The sum of the counters before this one, after they were scanned.
fn scanned(index: u32) -> u32 {
    return counters[index] + sums[index / BLOCK];
}
