// Where a path begins: which pixel and sample an invocation has, and the ray that they stand for.
#import parameters
#import sampler
#import eye

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
fn path_start(index: u32) -> Start {
    let path = parameters.first_sample + index;
    return path_start_at(parameters.first_pixel + path / parameters.samples, path % parameters.samples);
}

// Of the path so many behind that one, without the division for its pixel: that is slow.
fn path_start_after(start: Start, paths: u32) -> Start {
    var pixel = start.pixel;
    var sample = start.sample + paths;
    while (sample >= parameters.samples) {
        sample -= parameters.samples;
        pixel += 1u;
    }
    return path_start_at(pixel, sample);
}

fn path_start_at(pixel: u32, sample: u32) -> Start {
    let corner = vec2u(pixel % parameters.start.resolution.x, pixel / parameters.start.resolution.x);
    let u = sample4(pixel, sample, 0u);
    let lens = eye_lens_point(parameters.start, u.zw);
    let image = eye_image_point(parameters.start, vec2f(corner) + u.xy);
    let towards = eye_direction(parameters.start, image, lens);
    let direction = normalize(eye_to_world(parameters.start, towards));
    return Start(pixel, sample, image, towards, eye_origin(parameters.start, lens), direction);
}
