// The parameters of the kernels that assemble the matrix on the device that traced the paths (`transport::device`).
//
// The paths from a pixel are divided into parts of consecutive samples, each within one half of the samples. A term
// is the sum of a part's contributions of one class of bounces to one pixel. Its key is that pixel and the class.

struct Assembly {
    luminance: vec3f,
    // Paths in the dispatch.
    paths: u32,
    // Weights of a sample: in the mean, and in the error. A weight is the sum of two numbers of single precision.
    // The errors are those of the halves of the camera's samples, and then of the projector's.
    mean: vec2f,
    first_pixel: u32,
    first_sample: u32,
    error_high: vec4f,
    error_low: vec4f,
    // Samples of a pixel, of the first half, and of a part.
    samples: u32,
    first_half: u32,
    samples_of_part: u32,
    parts_of_pixel: u32,
    parts_of_first_half: u32,
    // The parts that the dispatch takes.
    first_part: u32,
    parts: u32,
    // Layout of the paths' records (`path.wgsl`), and the mark of the finished ones.
    max_bounces: u32,
    direct: u32,
    gathers: u32,
    ambient: u32,
    stride: u32,
    mark: u32,
    // Light of two bounces is a class of its own.
    split: u32,
    // The least class that occurs; it has the number 0 in keys.
    lowest_class: u32,
    class_bits: u32,
    part_bits: u32,
    // Where the counts of rows begin, for the pixels at which paths start (or the rows of a step) and at which they end.
    own_base: u32,
    other_base: u32,
    // The rows that the dispatch takes.
    first_row: u32,
    rows: u32,
    // Combination of HAS_OWN, HAS_MIRRORED, FROM_PROJECTOR and SYMMETRIC.
    flags: u32,
    // The class and the channel that a step packs.
    class_number: u32,
    channel: u32,
    // Parts in the first half of the samples, for paths from the camera and from the projector.
    first_halves: vec2u,
    // The place of a step's totals.
    total: u32,
    padding: u32,
}

// The paths start at the pixels of the rows.
const HAS_OWN = 1u;
// The paths end at the pixels of the rows.
const HAS_MIRRORED = 2u;
// The paths start at the projector.
const FROM_PROJECTOR = 4u;
// Rows and columns are the same pixels.
const SYMMETRIC = 8u;

const NOTHING = 0xffffffffu;

@group(0) @binding(0) var<uniform> assembly: Assembly;

fn is_set(flag: u32) -> bool {
    return (assembly.flags & flag) != 0u;
}
