// Where a path begins: which pixel and sample it has, and the ray that they stand for.
#import parameters
#import sampler
#import eye

// Whose turn it is.
struct Place {
    pixel: u32,
    sample: u32,
    // Column and row of the pixel.
    corner: vec2u,
}

struct Start {
    pixel: u32,
    sample: u32,
    // On the image plane at distance 1, and the direction towards it in the eye's frame.
    image: vec2f,
    towards: vec3f,
    // The ray, in the frame of all geometry.
    origin: vec3f,
    direction: vec3f,
}

// Of the dispatch's path `index`.
fn path_place(index: u32) -> Place {
    let path = parameters.first_sample + index;
    let pixel = parameters.first_pixel + path / parameters.samples;
    let width = parameters.start.resolution.x;
    return Place(pixel, path % parameters.samples, vec2u(pixel % width, pixel / width));
}

// Of the path so many behind the one there. Without divisions, which are slow.
fn path_place_after(place: Place, paths: u32) -> Place {
    var after = place;
    after.sample += paths;
    while (after.sample >= parameters.samples) {
        after.sample -= parameters.samples;
        after.pixel += 1u;
        after.corner.x += 1u;
        if (after.corner.x == parameters.start.resolution.x) {
            after.corner = vec2u(0u, after.corner.y + 1u);
        }
    }
    return after;
}

fn path_start(place: Place) -> Start {
    let u = sample4(place.pixel, place.sample, 0u);
    let lens = eye_lens_point(parameters.start, u.zw);
    let image = eye_image_point(parameters.start, vec2f(place.corner) + u.xy);
    let towards = eye_direction(parameters.start, image, lens);
    let direction = normalize(eye_to_world(parameters.start, towards));
    return Start(place.pixel, place.sample, image, towards, eye_origin(parameters.start, lens), direction);
}
