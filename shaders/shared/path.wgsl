// A light path: it starts at a pixel of one endpoint of the rig (camera or projector) and runs through the
// scene. From each surface point that scatters light it is connected to the other endpoint; each connection
// is one contribution to the transport matrix.
//
// The same path could have been sampled from the other endpoint. With the contribution F of the path, its
// density p_f as sampled here and its density p_r as sampled in reverse, the balance heuristic (Veach and
// Guibas 1995) gives the weighted estimate F / (p_f + p_r), called v in guide/src/right/operator.md. The shader computes
// it as (F / p_f) / (1 + p_r / p_f). Densities of directions are per projected solid angle times the squared
// refractive index, n² cosθ dω (étendue); densities of start points are per area on the image plane at
// distance 1.
//
// Nothing is summed here: each path writes to its own slots, so that results repeat to the bit.
#import features
#import parameters
#import sampler
#import start
#import warp
#import endpoint
#import connect
#import surface
#import reverse
#import medium

// The record of a path has `stride` slots. A slot index addresses the same slot of all paths, side by side:
// neighbouring paths write to one cache line, and slots that few paths reach stay untouched. The slots are,
// in this order:
// * The head: mark (16 bits), rays traced (8 bits), surfaces met (8 bits), and the direct light that came
//   back along the path.
// * The connection from each surface. Where the connection from the first surface is the direct light, it has
//   no slot.
// * With photons, the gathered connection (through a specular chain of the other endpoint) from surface 2 on.
// * In a scene that emits light, the ambient radiance.
//
// A connection is a pixel (28 bits; NONE without a connection), the surfaces of the other endpoint's chain
// (the upper 4 bits), and the weight in RGB.
@group(1) @binding(0) var<storage, read_write> records: array<vec4u>;

// The state of a path between two surfaces.
struct Path {
    // Number of the path within the dispatch.
    index: u32,
    start: Start,
    // The next ray.
    origin: vec3f,
    direction: vec3f,
    // Product of BSDF values and cosines over sampling densities so far, for radiance divided by n².
    throughput: vec3f,
    // Direct light that came back along the path: its sample of the matrix's diagonal.
    direct: vec3f,
    // Light emitted by the scene, W/(m² sr).
    ambient: vec3f,
    // The medium in which the next ray runs.
    medium: Medium,
    // Surfaces met; those that the path passed straight through do not count.
    surfaces: u32,
    rays: u32,
    // Vertices so far, those passed straight through included: the number that selects the random numbers.
    vertex: u32,
    // Surfaces that the path passed straight through one after the other.
    passes: u32,
    // So far the path has only been reflected or refracted into single directions, or passed straight through.
    // The following five members describe this specular chain, and do not change afterwards.
    is_specular: bool,
    // Mirroring and refracting surfaces of the specular chain.
    chain: u32,
    footprint: Footprint,
    // Throughput of light that returns along the chain, and the probability with which the path followed the
    // chain.
    return_throughput: vec3f,
    chain_probability: f32,
    // After the first scattering: p_r / p_f of the path so far, without the factors that the connection
    // decides.
    pdf_ratio: f32,
}

// One surface point of a path, with everything that connecting, gathering and scattering need.
struct Vertex {
    surface: Surface,
    // Index of the pair of triangles in leaf order.
    pair: u32,
    // The frame around the geometric normal, and the direction back along the ray, local to it.
    frame: Frame,
    wo: vec3f,
    // Origins for rays that leave on the side of arrival, and on the other side.
    before: vec3f,
    behind: vec3f,
    // The sampled continuation.
    next: BsdfSample,
    // Probability with which the surface interacts with light along wo, instead of letting it pass straight
    // through.
    interaction: f32,
    // If the path is specular so far: density, per surface area, with which paths arrive here by the same
    // chain. It is the image-plane density D of the point times the chain's probability.
    first_density: f32,
    // The surface scatters into more than single directions, so that it can be connected.
    scatters: bool,
    // Light can return from here to the pinhole along the path's own chain.
    is_direct: bool,
}

// The path at its start, with its first ray.
fn path_begin(index: u32, start: Start) -> Path {
    var path: Path;
    path.index = index;
    // A first ray that uses the light buffer is counted here; any other one is counted when it is traced.
    path.rays = select(0u, 1u, LIGHT_BUFFER_SIDE > 0u);
    path.start = start;
    path.origin = start.origin;
    path.direction = start.direction;
    path.throughput = vec3f(1.0);
    path.medium = AIR;
    path.is_specular = true;
    if (CHAINS) {
        path.footprint = footprint_at_endpoint(parameters.start, start.towards);
    }
    path.return_throughput = vec3f(1.0);
    path.chain_probability = 1.0;
    return path;
}

// Writes the head of the record, and the ambient radiance. The mark tells the host that the path came to its
// end.
fn path_end(path: Path) {
    let head = parameters.mark | (min(path.rays, 255u) << 8u) | path.surfaces;
    records[path.index] = vec4u(head, bitcast<vec3u>(path.direct));
    if (AMBIENT) {
        records[(parameters.stride - 1u) * parameters.paths + path.index] = vec4u(parameters.mark, bitcast<vec3u>(path.ambient));
    }
}

// Handles the surface that the path's ray met: records direct light, the connection to the other endpoint and
// the gathered connection, then chooses the next ray. Returns whether the path goes on.
fn path_meets(path: ptr<function, Path>, hit: Hit) -> bool {
    var vertex: Vertex;
    vertex.pair = hit.triangle >> 1u;
    var surface = surface_at(hit, path.direction);
    medium_meets(path.medium, &surface);
    vertex.surface = surface;
    vertex.frame = frame_around(surface.normal);
    vertex.wo = to_local(vertex.frame, -path.direction);
    vertex.before = offset_origin(surface.position, surface.normal);
    vertex.behind = offset_origin(surface.position, -surface.normal);
    path_travel(path, hit.distance, surface.normal);
    path.vertex += 1u;
    vertex.next = bsdf_sample(surface.bsdf, vertex.wo, sample4(path.start.pixel, path.start.sample, path.vertex));
    if (PASSABLE && vertex.next.kind == PASSED && vertex.next.pdf > 0.0 && !surface.black) {
        return path_pass(path, vertex);
    }
    path.passes = 0u;
    path.surfaces += 1u;
    vertex.interaction = bsdf_interaction(surface.bsdf, vertex.wo);
    path.throughput /= vertex.interaction;
    vertex.scatters = bsdf_regular(surface.bsdf) && !surface.black;
    vertex.is_direct = COAXIAL_PINHOLE && path.is_specular;
    path_collect(path, &vertex);
    path_connect(path, vertex);
    if (CHAINS && parameters.bucket_mask != 0u && path.surfaces > 1u) {
        path_gather(path, vertex);
    }
    return path_scatter(path, vertex);
}

// Carries the path over `distance` in its medium, to a surface with this normal.
fn path_travel(path: ptr<function, Path>, distance: f32, normal: vec3f) {
    if (MEDIA) {
        let clear = medium_transmittance(path.medium, distance);
        path.throughput *= clear;
        path.return_throughput *= clear;
    }
    if (CHAINS && path.is_specular) {
        path.footprint = footprint_travel(path.footprint, distance, path.direction, normal);
    }
}

// Lets the path pass straight through the surface. Returns whether the path goes on: after MAX_PASSES
// surfaces in a row it ends.
fn path_pass(path: ptr<function, Path>, vertex: Vertex) -> bool {
    path.passes += 1u;
    if (path.passes == MAX_PASSES) {
        return false;
    }
    if (path.is_specular) {
        path.return_throughput *= vertex.next.weight * vertex.next.pdf;
        path.chain_probability *= vertex.next.pdf;
    }
    path.throughput *= vertex.next.weight;
    path.origin = vertex.behind;
    return true;
}

// Adds the surface's emission to the ambient light. Adds the light that returns to a coaxial pinhole along
// the path's own chain, T² f(wo, wo) D(x) with the chain's throughput T, to the direct light. Completes the
// vertex's density.
fn path_collect(path: ptr<function, Path>, vertex: ptr<function, Vertex>) {
    if (AMBIENT) {
        path.ambient += path.throughput * vertex.surface.bsdf.opacity * vertex.surface.emission;
    }
    var density = endpoint_density(parameters.start, vertex.surface.position - path.start.origin, vertex.surface.normal);
    if (CHAINS && path.chain > 0u) {
        density = footprint_density(path.footprint);
    }
    if (vertex.is_direct && vertex.scatters && path.surfaces + path.chain <= parameters.max_bounces) {
        path.direct += path.throughput * path.return_throughput * bsdf_eval(vertex.surface.bsdf, vertex.wo, vertex.wo)
            * (density * parameters.scale);
    }
    vertex.first_density = density * path.chain_probability;
}

// Chooses the next ray from the sampled direction, and updates throughput, pdf ratio and footprint. Returns
// whether the path goes on.
fn path_scatter(path: ptr<function, Path>, vertex: Vertex) -> bool {
    let next = vertex.next;
    if (path.surfaces == parameters.max_bounces || vertex.surface.black || !(next.pdf > 0.0) || all(next.weight == vec3f(0.0))) {
        return false;
    }
    if (ROULETTE && path.surfaces > 2u) {
        let left = path.throughput * next.weight;
        // This probability stays out of the balance heuristic: paths from both endpoints end by the same
        // rule.
        let survival = clamp(max(max(left.x, left.y), left.z), 0.05, 1.0);
        if (connection_sample(path.start.pixel, path.start.sample, path.vertex).w >= survival) {
            return false;
        }
        path.throughput /= survival;
    }
    let leaving = to_world(vertex.frame, next.direction);
    if (next.kind == REGULAR) {
        // Density of the sampled direction per étendue n² cosθ dω.
        let index = bsdf_index_along(vertex.surface.bsdf, next.direction);
        let forward = next.pdf / (index * index * abs(next.direction.z));
        if (path.is_specular) {
            path.pdf_ratio = bsdf_interaction(vertex.surface.bsdf, next.direction) / (vertex.first_density * forward);
            path.is_specular = false;
        } else {
            path.pdf_ratio *= bsdf_reverse_density(vertex.surface.bsdf, vertex.wo, next.direction) / forward;
        }
    } else if (CHAINS && path.is_specular) {
        path.return_throughput *= next.weight * next.pdf;
        path.chain_probability *= next.pdf;
        path.footprint = footprint_turn(path.footprint, vertex.surface, path.direction, leaving, next.kind);
        path.chain += 1u;
    }
    path.throughput *= next.weight * vertex.interaction;
    path.medium = medium_behind(path.medium, vertex.surface, next.direction);
    path.origin = select(vertex.before, vertex.behind, next.direction.z < 0.0);
    path.direction = leaving;
    return true;
}
