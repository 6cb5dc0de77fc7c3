//! The true regions of a scene's pixels, as its author labelled them.

use anyhow::Result;

use super::simulation::Simulation;
use crate::image::Resolution;
use crate::render::Tracer;
use crate::report::segmentation::Truth;
use crate::scene::Scene;

/// The label of a pixel that sees no region, as in all label images.
const NO_REGION: u8 = 255;

/// The region that each pixel's centre sees.
pub(super) fn true_labels(
    tracer: &mut Tracer,
    scene: &Scene,
    resolution: Resolution,
) -> crate::Result<Vec<u8>> {
    if scene.regions.len() > usize::from(NO_REGION) {
        return Err(crate::Error::Scene {
            path: scene.path.clone(),
            fault: format!("its {} regions do not fit a label image", scene.regions.len()),
            help: format!("give at most {NO_REGION} regions by `region` in the extras of nodes or meshes"),
        });
    }
    let regions = tracer.regions(resolution)?;
    Ok(regions.into_iter().map(|region| region.map_or(NO_REGION, |region| region as u8)).collect())
}

/// The labels of the scene's author, where there are any.
pub(super) fn truth(simulation: &mut Simulation, resolution: Resolution) -> Result<Option<Truth>> {
    let Simulation { scene, tracer, .. } = simulation;
    if !scene.regions_are_labels {
        return Ok(None);
    }
    let labels = true_labels(tracer, scene, resolution)?;
    Ok(Some(Truth { labels, regions: scene.regions.clone() }))
}
