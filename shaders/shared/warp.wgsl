// Local frames, with the surface normal along +z, and maps from the unit square to directions.

const PI = 3.14159265358979;
const INV_PI = 0.318309886183791;

struct Frame {
    tangent: vec3f,
    bitangent: vec3f,
    normal: vec3f,
}

// An orthonormal frame around a unit normal: Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017.
fn frame_around(normal: vec3f) -> Frame {
    let sign = select(-1.0, 1.0, normal.z >= 0.0);
    let a = -1.0 / (sign + normal.z);
    let b = normal.x * normal.y * a;
    return Frame(
        vec3f(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
        vec3f(b, sign + normal.y * normal.y * a, -normal.y),
        normal,
    );
}

// A vector in the coordinates of the frame.
fn to_local(frame: Frame, v: vec3f) -> vec3f {
    return vec3f(dot(v, frame.tangent), dot(v, frame.bitangent), dot(v, frame.normal));
}

// The vector that has these coordinates in the frame.
fn to_world(frame: Frame, v: vec3f) -> vec3f {
    return v.x * frame.tangent + v.y * frame.bitangent + v.z * frame.normal;
}

// A direction of the hemisphere around +z, with density cosθ/π per solid angle. cosθ ≥ 2⁻¹², since u.x < 1.
fn square_to_cosine_hemisphere(u: vec2f) -> vec3f {
    let radius = sqrt(u.x);
    let angle = 2.0 * PI * u.y;
    return vec3f(radius * cos(angle), radius * sin(angle), sqrt(1.0 - u.x));
}
