//! The parameters of a camera or a projector.

use glam::{DVec3, Vec3};

use super::parameters::{Fault, Value, numbers, shape_fault};
use crate::scene::Camera;
use crate::scene::camera::{axes, tan_half};

pub(super) const PARAMETERS: [&str; 6] =
    ["position", "forward", "up", "vertical_fov", "aperture_radius", "focus_distance"];

pub(super) fn of_camera(camera: &Camera, property: &str) -> Option<Value> {
    Some(match property {
        "position" => camera.position.into(),
        "forward" => camera.forward.into(),
        "up" => camera.up.into(),
        "vertical_fov" => {
            let exact = (2.0 * f64::from(camera.tan_half_fov).atan()).to_degrees();
            // The rounding of the tangent does not show where a shorter number has the same tangent.
            let short = f64::from(exact as f32);
            let is_same = tan_half(short.to_radians()) == Some(camera.tan_half_fov);
            (if is_same { short } else { exact }).into()
        }
        "aperture_radius" => camera.lens.radius.into(),
        // A pinhole has no plane in focus.
        _ if camera.lens.radius == 0.0 => return None,
        _ => camera.lens.focus.into(),
    })
}

pub(super) fn set_camera(camera: &mut Camera, property: &str, value: Value) -> Result<(), Fault> {
    if of_camera(camera, property).as_ref() == Some(&value) {
        return Ok(());
    }
    let degrees = if let Value::Number(number) = value { number } else { 0.0 };
    let is_vector = ["position", "forward", "up"].contains(&property);
    let expected = if is_vector { "three numbers" } else { "a number" };
    let values = numbers(value, expected)?;
    if let Some(wrong) = values.iter().find(|value| !value.is_finite()) {
        return Err((format!("it is {wrong}"), format!("give {expected}, finite")));
    }
    let (vector, number) = match values[..] {
        [x, y, z] if is_vector => (Vec3::new(x, y, z), 0.0),
        [number] if !is_vector => (Vec3::ZERO, number),
        _ => return Err(shape_fault(&[values.len()], expected)),
    };
    let out_of = |range: &str| Err((format!("it is {number}"), format!("give a number {range}")));
    match property {
        "position" => camera.position = vector,
        "vertical_fov" => match tan_half(degrees.to_radians()) {
            Some(tangent) => camera.tan_half_fov = tangent,
            None => return out_of("between 0 and 180 degrees"),
        },
        "aperture_radius" if number < 0.0 => return out_of("that is not negative"),
        "aperture_radius" => camera.lens.radius = number,
        "focus_distance" if number <= 0.0 => return out_of("above 0"),
        "focus_distance" => camera.lens.focus = number,
        _ => {
            let old = camera.forward.as_dvec3();
            let (forward, up) = match property {
                "forward" => (vector.as_dvec3(), camera.up.as_dvec3()),
                _ => (old, vector.as_dvec3()),
            };
            // A camera that is turned to its own up keeps a frame, with the old direction as its up.
            let turned = || axes(forward, old).filter(|_| property == "forward");
            let Some(axes) = axes(forward, up).or_else(turned) else {
                let fault = "it is zero, or the directions forward and up are parallel";
                return Err((fault.into(), "give another direction".into()));
            };
            [camera.right, camera.up, camera.forward] = axes.map(|axis: DVec3| axis.as_vec3() + Vec3::ZERO);
        }
    }
    Ok(())
}
