// The photon map of an endpoint's specular chains: which of its pixels see a surface point through mirrors
// and glass. `trace_photons` traces the chains, `render::photons` sorts the photons into a hash grid, and
// paths gather them here.
#import parameters
#import surface
#import footprint

// The photons as an array of texels. At first one texel for each photon, in the order of the buckets: pixel
// (lower 28 bits) and surfaces of the chain (upper 4 bits), then the position. That is all that the search for
// near photons reads. Then three texels for each photon, in the same order:
// * The generalized image-plane density D of the point through the chain, times the chain's probability; then
//   (RGB) the throughput of the chain over its probability, times the image-plane area that the photon
//   represents.
// * The first coordinate on the image plane; unit direction back to the chain's last surface.
// * The second coordinate on the image plane; the surface's normal on the photon's side.
@group(1) @binding(1) var photons: texture_storage_2d<rgba32uint, read>;
// Index of the first photon of each bucket, and finally the number of photons. The first bucket comes once more
// behind the last one.
@group(1) @binding(2) var<storage, read> photon_buckets: array<u32>;

// A texel of the photons; a row has 4096.
fn photon_texel(texel: u32) -> vec4u {
    return textureLoad(photons, vec2u(texel & 4095u, texel >> 12u));
}

// The result of gathering at one surface point.
struct Gathered {
    // Pixel and surfaces of the chain, packed as in Photon; NONE where nothing was found.
    origin: u32,
    // Radiance that the surface sends along wo, for a pattern of 1.
    value: vec3f,
    // Local direction and density of the photon that represents all photons found.
    wi: vec3f,
    density: f32,
}

// The hash of a grid cell (Teschner et al. 2003, for y and z): that of the next cell along x is larger by 1.
fn photon_hash(cell: vec3i) -> u32 {
    let key = vec2u(cell.yz) * vec2u(19349663u, 83492791u);
    let mixed = (key.x ^ key.y) * 0x9e3779b1u;
    return (mixed ^ (mixed >> 15u)) + u32(cell.x);
}

// The specular chain by which the gathering path itself came to the surface point.
struct OwnChain {
    // Light along this chain is known exactly, and photons that came along it are left out.
    is_skipped: bool,
    footprint: Footprint,
    // The path's start on the image plane at distance 1.
    image: vec2f,
}

// The eight cells that a sphere may touch, as four rows of two along x: where the photons of each row begin and
// end, and a bit for each row that has any.
struct PhotonRows {
    begin: vec4u,
    end: vec4u,
    filled: u32,
}

// The cell at the beginning of a row; `first` is that of row 0.
fn photon_row(first: vec3i, row: u32) -> vec3i {
    return first + vec3i(vec3u(0u, row & 1u, row >> 1u));
}

// Whether a cell can hold photons within the sphere around the surface point and close to its plane. The limits
// are 5 % more than that, far more than rounding: the photons themselves are tested exactly.
fn photon_cell_reached(surface: Surface, cell: vec3i) -> bool {
    let radius = parameters.gather_radius;
    // From the surface point to the cell's centre; from there to the cell's faces it is one radius.
    let offset = (vec3f(cell) * 2.0 + 1.0) * radius - surface.position;
    let away = max(abs(offset) - radius, vec3f(0.0));
    let reach = radius * (0.1 + dot(abs(surface.normal), vec3f(1.0)));
    return dot(away, away) < 1.05 * radius * radius && abs(dot(offset, surface.normal)) < 1.05 * reach;
}

// The photons that may lie within the sphere around the surface point; `first` is the first of its cells.
fn photon_rows(surface: Surface, first: vec3i) -> PhotonRows {
    var rows = PhotonRows(vec4u(0u), vec4u(0u), 0u);
    for (var row = 0u; row < 4u; row += 1u) {
        let cell = photon_row(first, row);
        let bucket = photon_hash(cell) & parameters.bucket_mask;
        let begin = photon_buckets[bucket + select(1u, 0u, photon_cell_reached(surface, cell))];
        let end = photon_buckets[bucket + select(1u, 2u, photon_cell_reached(surface, cell + vec3i(1, 0, 0)))];
        rows.begin[row] = begin;
        rows.end[row] = end;
        rows.filled |= select(0u, 1u << row, begin < end);
    }
    return rows;
}

// Gathers all photons within the radius r around a surface point: Σ K(wo, wi) T Φ / (π r²), where Φ is the
// image-plane area that a photon represents and T its chain's throughput (guide/src/right/operator.md, "Specular
// chains"). One photon, drawn with probability proportional to its contribution, represents all of them.
// `most_surfaces` bounds the surfaces of their chains; `u` is a uniform number in [0, 1).
//
// On software Vulkan all lanes execute every branch, taken or not. Therefore the search only tests the positions
// of up to 32 photons, and notes which of them lie within the sphere; then all lanes evaluate theirs together.
fn photons_gather(surface: Surface, frame: Frame, wo: vec3f, most_surfaces: u32, own: OwnChain, u: f32) -> Gathered {
    var found = Gathered(NONE, vec3f(0.0), vec3f(0.0), 0.0);
    var total = 0.0;
    var chosen = 1.0;
    var draw = u;
    let radius = parameters.gather_radius;
    // Cells are two radii wide, so that the sphere touches at most two of them along each axis.
    let first = vec3i(floor((surface.position - radius) * parameters.inverse_cell));
    let rows = photon_rows(surface, first);
    var filled = rows.filled;
    var cell = first;
    var index = 0u;
    var end = 0u;
    while (index < end || filled != 0u) {
        if (index == end) {
            let row = firstTrailingBit(filled);
            filled &= filled - 1u;
            cell = photon_row(first, row);
            index = rows.begin[row];
            end = rows.end[row];
        }
        // A bit for each of the photons from `base` on that lies within the sphere.
        var near = 0u;
        let base = index;
        let stop = min(end, base + 32u);
        var bit = 1u;
        while (index < stop) {
            let place = photon_texel(index);
            let position = bitcast<vec3f>(place.yzw);
            let offset = position - surface.position;
            let inside = vec3i(floor(position * parameters.inverse_cell)) - cell;
            index += 1u;
            if (dot(offset, offset) < radius * radius && abs(dot(offset, surface.normal)) <= 0.1 * radius
                && (place.x >> 28u) <= most_surfaces
                && all(inside.yz == vec2i(0)) && u32(inside.x) < 2u) {
                near |= bit;
            }
            bit = bit << 1u;
        }
        while (near != 0u) {
            let photon = base + firstTrailingBit(near);
            near &= near - 1u;
            let details = parameters.photons + 3u * photon;
            // In vectors of four: arrival and ground begin with the coordinates on the image plane.
            let light = bitcast<vec4f>(photon_texel(details));
            let arrival = bitcast<vec4f>(photon_texel(details + 1u));
            let ground = bitcast<vec4f>(photon_texel(details + 2u));
            if (dot(ground.yzw, surface.normal) < 0.9) {
                continue;
            }
            if (own.is_skipped) {
                let moved = vec2f(arrival.x, ground.x) - own.image;
                let predicted = own.footprint.foot_u * moved.x + own.footprint.foot_v * moved.y;
                if (dot(predicted, predicted) < 4.0 * radius * radius) {
                    continue;
                }
            }
            let wi = to_local(frame, arrival.yzw);
            let value = bsdf_eval(surface.bsdf, wo, wi) * light.yzw;
            let weight = value.x + value.y + value.z;
            if (!(weight > 0.0)) {
                continue;
            }
            total += weight;
            let share = weight / total;
            // One random number serves all draws: after each draw it is rescaled, and uniform again.
            if (draw < share) {
                draw = draw / share;
                found = Gathered(photon, value, wi, light.x);
                chosen = weight;
            } else {
                draw = (draw - share) / (1.0 - share);
            }
        }
    }
    if (found.origin != NONE) {
        found.origin = photon_texel(found.origin).x;
    }
    // The density estimate over the disc.
    found.value *= total / chosen * INV_PI / (radius * radius);
    return found;
}
