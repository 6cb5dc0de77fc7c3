//! A model from the photos that some run took, whatever it asked: nothing is attached, and none is taken.

use anyhow::Result;

use super::about::Kind;
use super::console::Console;
use super::replay::{Replay, Taken};
use crate::analysis::low_rank::SavedModel;
use crate::analysis::low_rank::{estimated_direct, from_products};
use crate::error::Error;
use crate::operator::Product;

/// The model of each channel from all that the run's journal holds.
pub(super) fn model_of_run(run: &Replay, console: &Console) -> Result<SavedModel> {
    let about = &run.about;
    let Taken { global, full, direct, ambient } = run.taken(console)?;
    let mut channels = Vec::new();
    for (channel, (global, full)) in global.into_iter().zip(full).enumerate() {
        let known = direct.as_ref().and_then(|direct| direct.get(channel)).cloned();
        let direct = match known {
            Some(direct) => direct,
            None if global.is_empty() => estimated(&full, console)?,
            None => {
                return Err(Error::Journal {
                    path: about.path.clone(),
                    fault: "the run kept photos without direct light, but not the direct light itself".into(),
                    help: "run it anew with this version of krylux, or give the scene".into(),
                }
                .into());
            }
        };
        let less_direct = full.into_iter().map(|mut product: Product| {
            product.to.iter_mut().zip(&direct).zip(&product.from).for_each(|((y, d), x)| *y -= d * x);
            product
        });
        let products = global.into_iter().chain(less_direct).collect();
        channels.push(from_products(products, direct.clone(), about.symmetric)?);
    }
    Ok(SavedModel {
        channels,
        ambient,
        resolution: about.photos,
        projector: about.patterns,
        unit: match about.kind {
            Kind::Scene => "W/(m² sr)".into(),
            Kind::Rig => "DN/s".into(),
        },
        source: about.name.clone(),
    })
}

/// The direct light where nobody measured it, from a run that had the white photo among its own.
fn estimated(full: &[Product], console: &Console) -> Result<Vec<f64>> {
    let level = |product: &Product| product.from.iter().copied().fold(0.0, f64::max);
    // A rig never lights the pixels that its camera does not see.
    let pixels = full.first().map_or(0, |product| product.from.len());
    let lit: Vec<bool> =
        (0..pixels).map(|pixel| full.iter().any(|product| product.from[pixel] != 0.0)).collect();
    let is_white = |product: &&Product| {
        let level = level(product);
        level > 0.0 && product.from.iter().zip(&lit).all(|(value, lit)| !lit || *value == level)
    };
    let Some(white) = full.iter().find(is_white) else {
        console.note(
            "note: the run has no white photo to tell direct light by, which stays in the model: fine detail of patterns is lost",
        );
        return Ok(Vec::new());
    };
    console.note("note: the run kept no direct light: it is taken for a share of the white photo");
    let level = level(white);
    let white: Vec<f64> = white.to.iter().map(|value| value / level).collect();
    Ok(estimated_direct(full, &white)?)
}
