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

fn path_start(invocation: u32) -> Start {
    let path = parameters.first_sample + invocation;
    let pixel = parameters.first_pixel + path / parameters.samples;
    let sample = path % parameters.samples;
    let corner = vec2u(pixel % parameters.start.resolution.x, pixel / parameters.start.resolution.x);
    let u = sample4(pixel, sample, 0u);
    let lens = eye_lens_point(parameters.start, u.zw);
    let image = eye_image_point(parameters.start, vec2f(corner) + u.xy);
    let towards = eye_direction(parameters.start, image, lens);
    let direction = normalize(eye_to_world(parameters.start, towards));
    return Start(pixel, sample, image, towards, eye_origin(parameters.start, lens), direction);
}
