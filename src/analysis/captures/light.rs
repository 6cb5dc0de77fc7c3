//! The light transport of a folder of captures, fitted in every channel.

use super::{FoundHomes, LeftOut, Pairs, Places, coaxial_homes, find_homes, fit};
use crate::analysis::low_rank::SavedModel;
use crate::error::{Error, Result};
use crate::image::Image;
use crate::measure::{CaptureMap, Captures};

/// The light transport that captures tell.
#[derive(Clone, Debug)]
pub struct CapturedLight {
    /// The captures.
    pub captures: Captures,
    /// The model of all channels, with the errors of its products.
    pub model: SavedModel,
    /// The photos as planes of each channel (`N × m`).
    pub photos: Vec<Vec<Vec<f64>>>,
    /// The prediction of photos that were left out, in each channel.
    pub left_out: Vec<LeftOut>,
    /// The map, if it was found among the captures.
    pub found: Option<FoundHomes>,
}

/// Fits the light transport of captures in one channel weighted by luminance (`luma`), or in their own channels.
///
/// # Errors
/// [`Error::Data`] naming the folder's file: fewer than 3 photos, dark patterns, colours that do not go together.
pub fn fit_captures(captures: Captures, luma: bool) -> Result<CapturedLight> {
    let refused = |fault: String, help: &str| Err(Error::data(&captures.path, fault).help(help));
    let [patterns, photos] = [&captures.patterns, &captures.photos];
    let coloured = [patterns, photos].map(|images| images.iter().any(|image| image.channels() == 3));
    if coloured[0] && (luma || !coloured[1]) {
        return refused("its patterns have colours".into(), "ask with --channels rgb, of coloured photos");
    }
    let channels = if luma { 1 } else { photos.first().map_or(1, Image::channels) };
    let plane = |image: &Image, channel: usize| match luma {
        true => image.luminance(),
        false => image.plane(channel.min(image.channels() - 1)),
    };
    let planes = |images: &[Image], channel: usize| -> Vec<Vec<f64>> {
        images.iter().map(|image| plane(image, channel)).collect()
    };
    let pairs = |channel: usize, homes: Places| Pairs {
        patterns: planes(patterns, channel),
        photos: planes(photos, channel),
        projector: patterns[0].resolution(),
        homes,
        noise: captures.noise.as_ref().map(|noise| plane(noise, channel)),
    };
    let (camera, projector) = (photos[0].resolution(), patterns[0].resolution());
    // The middle channel is green, which cameras see best.
    let found = (captures.map == CaptureMap::Found).then(|| find_homes(&pairs(channels / 2, Vec::new())));
    let homes = match (&captures.map, &found) {
        (CaptureMap::Coaxial, _) => coaxial_homes(camera, projector),
        (CaptureMap::Given(homes), _) => homes.clone(),
        (_, Some(found)) if found.homes.iter().any(Option::is_some) => found.homes.clone(),
        _ => Vec::new(),
    };
    let (mut models, mut left_out, mut of_channels) = (Vec::new(), Vec::new(), Vec::new());
    for channel in 0..channels {
        let pairs = pairs(channel, homes.clone());
        let of = fit(&pairs).map_err(|fault| {
            Error::data(&captures.path, fault.to_string())
                .help("capture at least 3 patterns with light in them, and photos with finite values")
        })?;
        models.push(of.model);
        left_out.push(of.left_out);
        of_channels.push(pairs.photos);
    }
    let ambient: Vec<Vec<f64>> = (0..channels).map(|channel| plane(&captures.ambient, channel)).collect();
    let model = SavedModel {
        channels: models,
        ambient: Image::from_planes(camera, &ambient)?,
        resolution: camera,
        projector,
        unit: captures.unit.to_owned(),
        source: captures.name.clone(),
    };
    Ok(CapturedLight { model, photos: of_channels, left_out, found, captures })
}
