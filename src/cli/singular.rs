//! `krylux eigs --singular`: singular values, with the patterns and their photos.

use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::eigs::say_completeness;
use super::opening::{Ending, finish};
use super::options::RunArgs;
use crate::error::Result;
use crate::krylov::SingularOptions;
use crate::lab::text::{percent, rounded, with_error};
use crate::lab::{Lab, SingularTriplets};
use crate::paint::page::Kept;
use crate::transport::Part;

/// What is asked.
pub(super) struct Asked {
    pub(super) part: Part,
    /// Whether the user gave a tolerance, so that missing it is exit status 1.
    pub(super) is_strict: bool,
    pub(super) options: SingularOptions,
}

pub(super) fn answer(asked: &Asked, run: &RunArgs, lab: &mut Lab, console: &Console) -> Result<Outcome> {
    let mut options = asked.options.clone();
    if !asked.is_strict {
        options.noise = lab.product_noise(asked.part)?.unwrap_or(0.0);
    }
    let found = lab.singular(asked.part, &options)?;
    console.go_on()?;
    let triplets = SingularTriplets { found: &found, wanted: options.count };
    say(&triplets, console)?;
    let summary = json!({
        "photos": found.stats.products,
        "status": found.stats.status.to_string(),
        "singular_values": found.values.iter().zip(&found.standard_errors)
            .map(|(&value, &error)| rounded(value, error)).collect::<Vec<f64>>(),
        "residuals": found.residuals,
        "standard_errors": found.standard_errors,
        "statuses": triplets.statuses(),
        "disagreement": found.disagreement,
        "completeness": found.completeness,
        "confirming": found.confirming,
    });
    let demands = asked.is_strict.then(|| triplets.finding(true)).into_iter().collect();
    let kept = Kept { groups: None, eigenvectors: None };
    Ok(finish(lab, console, &triplets, Ending { run, demands, summary, kept })?.1)
}

fn say(triplets: &SingularTriplets<'_>, console: &Console) -> Result<()> {
    let found = triplets.found;
    console.say(format_args!("photos    {}: {}", found.stats.products, found.stats.status))?;
    say_completeness(found.completeness, (found.values.len(), triplets.wanted), found.confirming, console)?;
    if found.disagreement > 1e-12 {
        console.say(format_args!(
            "transpose the photos of the transpose differ from the other photos transposed by {} %",
            percent(found.disagreement)
        ))?;
    }
    console.say("           singular value        residual")?;
    for (index, status) in triplets.statuses().iter().enumerate() {
        let value = with_error(found.values[index], found.standard_errors[index]);
        console.say(format_args!(
            "  {:>6}   {value:<20}  {:.1e}   {status}",
            index + 1,
            found.residuals[index]
        ))?;
    }
    Ok(())
}
