//! Whether a camera has enough pixels for the patterns of a projector.

use crate::finding::{Finding, Grade};
use crate::image::Resolution;

/// Camera pixels for each of the projector's, along an axis, below which neighbouring projector pixels are mixed in the photo.
const ENOUGH: f64 = 1.0;

/// As [`ENOUGH`], below which no pixel map can be fitted, and stripes of single pixels cannot be told.
pub(crate) const LEAST: f64 = 0.75;

/// The finding about a camera with too few pixels; `None` if it has enough. A camera that sees more than the projector lights has fewer pixels for the
/// patterns than this counts.
pub(crate) fn too_few(camera: Resolution, projector: Resolution) -> Option<Finding> {
    let ratios = [(camera.width, projector.width), (camera.height, projector.height)]
        .map(|(camera, projector)| camera as f64 / projector as f64);
    let least = ratios[0].min(ratios[1]);
    if least >= ENOUGH {
        return None;
    }
    let most = Resolution::new(camera.width.min(projector.width), camera.height.min(projector.height));
    Some(Finding::graded(
        "pixels",
        if least < LEAST { Grade::Fails } else { Grade::Warning },
        format!(
            "the camera has {:.2} x {:.2} pixels for each pixel of the patterns ({camera} for {projector}), too few to tell them apart",
            ratios[0], ratios[1]
        ),
        "at least one; two and more give sharper photos",
        format!(
            "give patterns of at most {most} pixels: a smaller size in the rig file, on a monitor with a larger magnify; or a camera mode with more pixels. \
             Focusing does not help"
        ),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_with_fewer_pixels_decides() {
        let grade = |camera: [usize; 2], projector: [usize; 2]| {
            let [camera, projector] =
                [camera, projector].map(|[width, height]| Resolution::new(width, height));
            too_few(camera, projector).map(|found| found.grade)
        };
        for (camera, expected) in [
            ([48, 48], None),
            ([480, 48], None),
            ([480, 47], Some(Grade::Warning)),
            ([36, 99], Some(Grade::Warning)),
            ([35, 99], Some(Grade::Fails)),
            ([99, 35], Some(Grade::Fails)),
        ] {
            assert_eq!(grade(camera, [48, 48]), expected, "{camera:?}");
        }
        let found = too_few(Resolution::new(24, 99), Resolution::new(48, 64)).expect("they are too few");
        for part in ["0.50 x 1.55 pixels", "24x99 for 48x64", "at most 24x64", "Focusing does not help"] {
            assert!(found.to_string().contains(part), "{found}");
        }
    }
}
