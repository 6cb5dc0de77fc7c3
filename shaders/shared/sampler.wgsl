// The random numbers of a path: four for each of its vertices.
//
// They are Owen-scrambled Sobol points, computed by hashing: Burley, "Practical Hash-based Owen Scrambling", JCGT 9(4), 2020. The four
// numbers of a vertex are two pairs, (x, y) and (z, w). Over the samples of a pixel each pair is a (0,2)-sequence: of the first 2ᵐ samples,
// and of each later block of 2ᵐ samples, exactly one lies in each elementary interval of area 2⁻ᵐ. Different vertices, and the two pairs
// of a vertex, are shuffled independently. The two halves of a pixel's samples are independent randomizations, so that their difference
// measures the noise.
#import parameters
#import rng

// Four numbers in [0, 1) for one vertex of the path (`pixel`, `sample`). Vertex 0 is the start: pixel area and lens.
fn sample4(pixel: u32, sample: u32, vertex: u32) -> vec4f {
    if (parameters.sampling == INDEPENDENT) {
        return random4(pixel, sample, vertex, parameters.seed);
    }
    return stratified4(pixel, sample, parameters.samples, vertex, parameters.seed);
}

// The same with Sobol points for `samples` samples per pixel, independent of the parameters.
fn stratified4(pixel: u32, sample: u32, samples: u32, vertex: u32, seed: u32) -> vec4f {
    let first = (samples + 1u) / 2u;
    let half = u32(sample >= first);
    return sobol_pairs(sample - half * first, pcg4d(vec4u(pixel, half, vertex, seed)));
}

// Point `index` of two shuffled and scrambled (0,2)-sequences; coordinates are multiples of 2⁻²⁴. `key` holds four independent hashes.
fn sobol_pairs(index: u32, key: vec4u) -> vec4f {
    // The scrambling of one pair and the shuffle of the other one share words of the key. Within a pair all three are independent.
    let order = reverseBits(scramble(vec4u(reverseBits(index)), key.zxzx ^ key.wywy)).xy;
    let points = scramble(vec4u(order.x, sierpinski(order.x), order.y, sierpinski(order.y)), key);
    return vec4f(reverseBits(points) >> vec4u(8u)) * 0x1p-24f;
}

// The second Sobol dimension, with the most significant digit in bit 0. (The first dimension is the index itself.) Its generating matrix is
// Pascal's triangle modulo 2, a Kronecker power, so that five steps replace thirty-two columns.
fn sierpinski(index: u32) -> u32 {
    var v = index;
    v ^= (v >> 1u) & 0x55555555u;
    v ^= (v >> 2u) & 0x33333333u;
    v ^= (v >> 4u) & 0x0f0f0f0fu;
    v ^= (v >> 8u) & 0x00ff00ffu;
    v ^= v >> 16u;
    return v;
}

// Owen's nested uniform scrambling of numbers whose most significant digit is bit 0: the lower bits decide whether a bit is flipped. This
// is the hash of Laine and Karras with Vegdahl's constants.
fn scramble(number: vec4u, seed: vec4u) -> vec4u {
    var v = number;
    v ^= v * 0x3d20adeau;
    v += seed;
    v *= (seed >> vec4u(16u)) | vec4u(1u);
    v ^= v * 0x05526c56u;
    v ^= v * 0x53a22864u;
    return v;
}
