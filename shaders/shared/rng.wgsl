// Random numbers by hashing. No state is kept, so that any path can be traced again on its own.

// Four hashes of four words: PCG4D, Jarzynski and Olano, "Hash Functions for GPU Rendering", JCGT 9(3), 2020.
fn pcg4d(key: vec4u) -> vec4u {
    var v = key * 1664525u + 1013904223u;
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    v ^= v >> vec4u(16u);
    v.x += v.y * v.w;
    v.y += v.z * v.x;
    v.z += v.x * v.y;
    v.w += v.y * v.z;
    return v;
}

// Four independent numbers in [0, 1), multiples of 2⁻²⁴, for one vertex of one path.
fn random4(pixel: u32, sample: u32, vertex: u32, seed: u32) -> vec4f {
    return vec4f(pcg4d(vec4u(pixel, sample, vertex, seed)) >> vec4u(8u)) * 0x1p-24f;
}
