//! The pixels of each process, so that all take about equally long.

use std::ops::Range;

use crate::error::Result;
use crate::image::Resolution;
use crate::render::{StartPixels, TraceSettings, Tracer};
use crate::transport::pilot;

/// The pixels of each of `processes` processes. One light path from each of at most 64×64 pixels counts the rays that a part of the picture takes;
/// counts are the same each time, where measured seconds are not.
///
/// # Errors
/// As [`Tracer::trace`].
pub(super) fn balanced(
    tracer: &mut Tracer,
    settings: &TraceSettings,
    processes: usize,
) -> Result<Vec<StartPixels>> {
    let projector = tracer.projector_resolution(settings);
    let pilot = pilot::of(settings);
    let sizes = [pilot.resolution, tracer.projector_resolution(&pilot)];
    let mut rays = sizes.map(|size| vec![0_u64; size.height]);
    tracer.trace(&pilot, &mut |batch| {
        let end = usize::from(!batch.from_camera());
        for path in 0..batch.len() {
            rays[end][batch.pixel(path) as usize / sizes[end].width] += batch.rays(path);
        }
        Ok(())
    })?;
    let all = tracer.start_pixels(settings);
    let camera = divide(&all.camera, settings.resolution, &rays[0], processes);
    let projector = divide(&all.projector, projector, &rays[1], processes);
    Ok(camera
        .into_iter()
        .zip(projector)
        .map(|(camera, projector)| StartPixels { camera, projector })
        .collect())
}

/// `pixels` of a picture of this size, cut into ranges of about equal work. `rays` has the work of rows of pixels of a smaller picture.
fn divide(pixels: &Range<usize>, size: Resolution, rays: &[u64], processes: usize) -> Vec<Range<usize>> {
    // One more for each row of pixels: a picture of nothing is cut into equal parts.
    let work: Vec<f64> = rays.iter().map(|&rays| 1.0 + rays as f64).collect();
    let total: f64 = work.iter().sum();
    let of_row = size.height as f64 / rays.len() as f64 * size.width as f64;
    let (mut cuts, mut done) = (vec![pixels.start], 0.0);
    for (row, &work) in work.iter().enumerate() {
        // Within a row of pixels the work is taken to be even.
        while cuts.len() < processes && done + work >= total * cuts.len() as f64 / processes as f64 {
            let share = (total * cuts.len() as f64 / processes as f64 - done) / work;
            cuts.push((((row as f64 + share) * of_row) as usize).min(pixels.end));
        }
        done += work;
    }
    cuts.resize(processes, pixels.end);
    cuts.push(pixels.end);
    cuts.windows(2).map(|ends| ends[0]..ends[1]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_have_equal_work_and_cover_each_pixel_once() {
        let size = Resolution::new(10, 8);
        // The lower half takes three times as long.
        let found = divide(&(0..80), size, &[100, 100, 300, 300], 2);
        assert_eq!(found.len(), 2);
        assert!((52..=54).contains(&found[0].end), "{found:?}");
        for processes in 1..12 {
            let found = divide(&(0..80), size, &[0, 7, 0, 1], processes);
            assert_eq!(found.len(), processes);
            assert_eq!(found.iter().flat_map(Clone::clone).collect::<Vec<_>>(), (0..80).collect::<Vec<_>>());
        }
        // Of 800 in all each of four gets 200: rows of pixels with 100, 100, 300 and 300, of 20 pixels each.
        let found = divide(&(0..80), size, &[99, 99, 299, 299], 4);
        assert_eq!(found, [0..40, 40..53, 53..66, 66..80], "cut after 2, 2⅔ and 3⅓ rows");
        assert_eq!(divide(&(0..0), size, &[1, 1], 3), [0..0, 0..0, 0..0]);
    }

    /// The work of each process, by the rays that its pixels take, is a fair share but for that of one row of pixels at either end.
    #[test]
    fn the_rays_of_a_scene_are_shared_out_evenly() {
        let scene = crate::scene::builtin::corner().to_scene();
        let mut projector = scene.camera.clone();
        projector.position += 0.2 * projector.right;
        // The upper part of the picture looks past the scene, so that its pixels take fewer rays.
        let mut scene = crate::scene::Scene { projector: Some(projector), ..scene };
        scene.camera.position += 0.6 * scene.camera.up;
        let mut tracer =
            Tracer::new(&scene, None).expect("the README's test command installs a Vulkan driver");
        let settings = TraceSettings {
            projector: Some(Resolution::new(20, 60)),
            ..TraceSettings::new(Resolution::new(30, 40), 1)
        };
        let sizes = [Resolution::new(30, 40), Resolution::new(20, 60)];
        let mut rays = sizes.map(|size| vec![0; size.pixels()]);
        tracer
            .trace(&settings, &mut |batch| {
                (0..batch.len()).for_each(|path| {
                    rays[usize::from(!batch.from_camera())][batch.pixel(path) as usize] += batch.rays(path);
                });
                Ok(())
            })
            .expect("the scene can be traced");
        let parts = balanced(&mut tracer, &settings, 3).expect("the scene can be traced");
        for (end, (size, rays)) in sizes.iter().zip(&rays).enumerate() {
            let of_part =
                |part: &StartPixels| if end == 0 { part.camera.clone() } else { part.projector.clone() };
            let of_rows: Vec<u64> = rays.chunks(size.width).map(|row| row.iter().sum()).collect();
            let most = *of_rows.iter().max().expect("there are rows") as f64;
            let fair = rays.iter().sum::<u64>() as f64 / 3.0;
            let evenly = size.pixels() / 3;
            let of_equal: u64 = rays[..evenly].iter().sum();
            assert!(
                (of_equal as f64 - fair).abs() > 2.0 * most,
                "equal parts are not fair: {of_equal} of {fair}"
            );
            let mut next = 0;
            for part in &parts {
                let pixels = of_part(part);
                assert_eq!(pixels.start, next);
                next = pixels.end;
                let work: u64 = rays[pixels].iter().sum();
                assert!(
                    (work as f64 - fair).abs() <= 2.0 * most,
                    "end {end}: {work} of {fair}, {most} in a row"
                );
            }
            assert_eq!(next, size.pixels());
        }
    }
}
