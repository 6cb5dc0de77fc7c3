//! What a compensation is worth: what is said of it.

use std::path::Path;

use anyhow::Result;
use serde_json::{Value, json};

use crate::analysis::{Clamping, Compensation, CompensationRow, MethodRun, Similarity};
use crate::cli::console::Console;
use crate::cli::run_folder::RunFolder;

pub(super) fn say(
    found: &Compensation,
    method: &str,
    methods: &[MethodRun],
    console: &Console,
) -> Result<()> {
    console.say(format_args!(
        "photos    {} by {method}, {} before: {}",
        found.photos, found.preparation, found.status
    ))?;
    console.say(format_args!(
        "residual  {:.4} of the wish; {:.4} uncompensated",
        found.residual, found.uncompensated_residual
    ))?;
    if let Some(row) = found.baseline.last() {
        console.say(format_args!(
            "baseline  {:.4} by projected Jacobi with as many photos (not counted)",
            row.residual
        ))?;
    }
    if found.unclipped.is_some() {
        console.say(format_args!(
            "clipped   the answer leaves what can be projected; before clipping its residual was {:.4}",
            found.unclipped_residual
        ))?;
    }
    let ssim = |of: &Similarity| of.ssim.map_or("–".into(), |ssim| format!("{ssim:.4}"));
    console.say(format_args!(
        "likeness  PSNR {:.2} dB and SSIM {}; uncompensated {:.2} dB and {}",
        found.similarity.psnr,
        ssim(&found.similarity),
        found.uncompensated_similarity.psnr,
        ssim(&found.uncompensated_similarity)
    ))?;
    for run in methods {
        let own = run.history.last().map_or(f64::NAN, |row| row.residual);
        console.say(format_args!(
            "method    {:<14} {:>3} photos: seen {:.4}, before clipping {own:.4}",
            run.name, run.photos, run.residual
        ))?;
    }
    if let Some(warning) = found.clamping.as_ref().and_then(Clamping::warning) {
        console.note(format_args!("warning: {warning}"));
    } else if found.residual >= found.uncompensated_residual {
        console.note("this is no better than projecting the target itself; use --method krylov-box");
    }
    Ok(())
}

/// The residual after each photo.
fn residuals(rows: &[CompensationRow]) -> Vec<f64> {
    rows.iter().map(|row| row.residual).collect()
}

/// The same for machines.
pub(super) fn summary(
    folder: &RunFolder,
    report: &Path,
    method: &str,
    found: &Compensation,
    methods: &[MethodRun],
) -> Value {
    json!({
        "verb": "compensate",
        "folder": folder.path,
        "report": report,
        "method": method,
        "photos": found.photos,
        "photos_before": found.preparation,
        "status": found.status.to_string(),
        "peak": found.peak,
        "relative_residual": found.residual,
        "relative_residual_unclipped": found.unclipped_residual,
        "relative_residual_uncompensated": found.uncompensated_residual,
        "relative_residual_jacobi": found.baseline.last().map(|row| row.residual),
        "clipped": found.unclipped.is_some(),
        "likeness": found.similarity,
        "likeness_uncompensated": found.uncompensated_similarity,
        "clamping": found.clamping.as_ref().map(|clamping| json!({
            "relative_residual_displayed": residuals(&clamping.displayed),
            "relative_residual_krylov_box": residuals(&clamping.boxed),
            "warning": clamping.warning(),
        })),
        "residuals": residuals(&found.history),
        "methods": methods.iter().map(|run| json!({
            "method": run.name,
            "photos": run.photos,
            "relative_residual": run.residual,
            "ssim": run.ssim,
            "residuals": residuals(&run.history),
            "residuals_displayed": residuals(&run.displayed),
        })).collect::<Vec<_>>(),
        "rig": folder.manifest.rig,
        "seconds": folder.seconds(),
    })
}
