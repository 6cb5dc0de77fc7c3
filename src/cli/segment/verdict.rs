//! What a segmentation is worth: scores against true labels, and what is said of it.

use anyhow::Result;

use super::photos::Taken;
use crate::analysis::{Segmentation, adjusted_rand_index};
use crate::cli::Outcome;
use crate::cli::console::Console;
use crate::report::segmentation::Truth;

/// The adjusted Rand index of each number of groups.
pub(super) fn score(segmentation: &Segmentation, truth: Option<&Truth>) -> Result<Vec<(usize, f64)>> {
    let Some(truth) = truth else { return Ok(Vec::new()) };
    let score =
        |(groups, labels): &(usize, Vec<u8>)| Ok((*groups, adjusted_rand_index(labels, &truth.labels)?));
    segmentation.labels.iter().map(score).collect()
}

pub(super) fn say(taken: &Taken, scores: &[(usize, f64)], console: &Console) -> Result<()> {
    let segmentation = &taken.segmentation;
    if let Some(direct) = &taken.direct {
        let share = direct.direct.iter().sum::<f64>()
            / direct.direct.iter().zip(&direct.global).map(|(d, g)| d + g).sum::<f64>();
        console.say(format_args!(
            "direct    {:.1} % of the light, from {} photos",
            100.0 * share,
            direct.photos
        ))?;
    }
    console.say(format_args!("photos    {}", segmentation.status))?;
    let masked = segmentation.mask.iter().filter(|&&masked| masked).count();
    if masked > 0 {
        let share = 100.0 * masked as f64 / segmentation.mask.len() as f64;
        console.say(format_args!("masked    {masked} pixels without global light ({share:.1} %)"))?;
    }
    console.say("          eigenvalue   residual")?;
    for (index, (value, residual)) in segmentation.eigenvalues.iter().zip(&segmentation.residuals).enumerate()
    {
        let note = if segmentation.embedding.is_local(index) { "   of a few pixels alone" } else { "" };
        console.say(format_args!("  {:>6}  {value:>10.6}   {residual:.1e}{note}", index + 1))?;
    }
    console.say(format_args!("regions   {}", segmentation.regions.sentence()))?;
    for &(groups, score) in scores {
        console.say(format_args!(
            "groups    {groups:>3}: adjusted Rand index {score:.4} against the true labels"
        ))?;
    }
    for evidence in &taken.evidence {
        let least = evidence.kept().into_iter().fold(1.0, f64::min);
        console.say(format_args!(
            "evidence  {:>3} groups, each lit alone: the cut is {:.4}, and each keeps {:.2} % of its light or more",
            evidence.groups,
            evidence.cut(),
            100.0 * least
        ))?;
    }
    Ok(())
}

/// Whether the groups are as good as the user demanded.
pub(super) fn judge(
    wanted: Option<f64>,
    scores: &[(usize, f64)],
    truth: Option<&Truth>,
    console: &Console,
) -> Result<Outcome> {
    let Some(wanted) = wanted else { return Ok(Outcome::Done) };
    let Some(truth) = truth else {
        return Err(crate::Error::Option {
            option: "--min-rand-index".into(),
            fault: "the scene has no true labels to compare with".into(),
            help: "give regions by `region` in the extras of its nodes, meshes or primitives".into(),
        }
        .into());
    };
    let regions = truth.seen();
    let Some(&(_, score)) = scores.iter().find(|(groups, _)| *groups == regions) else {
        return Err(crate::Error::Option {
            option: "--min-rand-index".into(),
            fault: format!(
                "the scene shows {regions} labelled regions, but --groups does not ask for {regions}"
            ),
            help: format!("add --groups {regions}"),
        }
        .into());
    };
    if score < wanted {
        console.note(format_args!("the adjusted Rand index {score:.4} is below {wanted}"));
        return Ok(Outcome::NotGoodEnough);
    }
    Ok(Outcome::Done)
}
