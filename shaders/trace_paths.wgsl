// One light path per invocation: from the camera's pixel j through the scene, and from each surface point on it back to the
// pinhole, through projector pixel i. Each such connection is one contribution to A_ji and, mirrored, to A_ij; the weight
// makes the sum of both unbiased (see `render`'s documentation). Nothing is added up here: a path writes to its own slots.
#import parameters
#import sampler
#import warp
#import pinhole
#import surface

// `max_bounces` slots a path, one more where the scene emits. Slot 0: mark (16 bits), rays traced (8), surfaces met (8),
// and direct light.
// Slot k − 1, k ≥ 2: pixel (or NONE) and weight of the connection from the k-th surface. Last: ambient radiance.
@group(1) @binding(0) var<storage, read_write> records: array<vec4u>;

@compute @workgroup_size(64)
fn trace_paths(@builtin(global_invocation_id) id: vec3u) {
    if (id.x >= parameters.paths) {
        return;
    }
    let path = parameters.first_sample + id.x;
    let pixel = parameters.first_pixel + path / parameters.samples;
    let sample = path % parameters.samples;
    let first_slot = id.x * (parameters.max_bounces + parameters.ambient);

    let corner = vec2u(pixel % parameters.resolution.x, pixel / parameters.resolution.x);
    let jitter = sample4(pixel, sample, 0u).xy;
    var origin = vec3f(0.0);
    var direction = normalize(pinhole_direction(vec2f(corner) + jitter));
    var throughput = vec3f(1.0);
    var direct = vec3f(0.0);
    var ambient = vec3f(0.0);
    var surfaces = 0u;
    var rays = 0u;
    // p_r / p_f of the path so far, but for the density D and the pdf at its end: 1/D(x₁) · Π pr′ₘ / Π pf′ₘ, with
    // primed pdfs per projected solid angle.
    var reverse_ratio = 0.0;

    for (var k = 1u; k <= parameters.max_bounces; k += 1u) {
        let hit = bvh_trace(origin, direction, 3.0e38, false);
        rays += 1u;
        if (hit.triangle == NONE) {
            break;
        }
        let surface = surface_at(hit, direction);
        surfaces = k;
        ambient += throughput * surface.emission;
        let frame = frame_around(surface.normal);
        let wo = to_local(frame, -direction);
        let away = surface_leave(surface.position, surface.normal);
        let density = pinhole_density(surface.position, surface.normal);

        if (k == 1u) {
            direct = select(bsdf_eval(surface.bsdf, wo, wo) * density, vec3f(0.0), surface.black);
        } else {
            var connection = vec4u(NONE, 0u, 0u, 0u);
            let lit = pinhole_pixel(surface.position);
            let wi = to_local(frame, normalize(-surface.position));
            if (lit != NONE && wi.z > 0.0 && !surface.black) {
                let distance = length(away);
                rays += 1u;
                if (bvh_trace(away, -away / distance, distance, true).triangle == NONE) {
                    let reverse = bsdf_pdf(surface.bsdf, wi, wo) / wo.z;
                    let weight = density / (1.0 + density * reverse * reverse_ratio);
                    let value = throughput * bsdf_eval(surface.bsdf, wo, wi) * weight;
                    connection = vec4u(lit, bitcast<vec3u>(value));
                }
            }
            records[first_slot + k - 1u] = connection;
        }
        if (k == parameters.max_bounces || surface.black) {
            break;
        }

        let next = bsdf_sample(surface.bsdf, wo, sample4(pixel, sample, k));
        if (!(next.pdf > 0.0) || all(next.weight == vec3f(0.0))) {
            break;
        }
        let forward = next.pdf / next.direction.z;
        if (k == 1u) {
            reverse_ratio = 1.0 / (density * forward);
        } else {
            reverse_ratio *= bsdf_pdf(surface.bsdf, next.direction, wo) / wo.z / forward;
        }
        throughput *= next.weight;
        origin = away;
        direction = to_world(frame, next.direction);
    }

    records[first_slot] = vec4u(parameters.mark | (rays << 8u) | surfaces, bitcast<vec3u>(direct));
    if (parameters.ambient == 1u) {
        records[first_slot + parameters.max_bounces] = vec4u(parameters.mark, bitcast<vec3u>(ambient));
    }
}
