//! `krylux compare`: the similarity of two images.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::Outcome;
use super::console::Console;
use super::options::number;
use crate::analysis::similarity::{Similarity, data_range, similarity};
use crate::error::{Error, Result};
use crate::finding::decimal;
use crate::image::{Image, Resolution};
use crate::io::name::Name;
use crate::io::{npy, picture};
use crate::lab::text::percent;
use crate::report::colormap::{paint_signed, robust_range};
use crate::report::figure::mean;

/// Compare two images: RMSE, relative RMSE, PSNR and SSIM; exit status 1 past a threshold
#[derive(clap::Args)]
#[command(after_help = "Example:\n  krylux compare photo.exr reference.exr --max-relative-rmse 0.01")]
pub(super) struct Args {
    /// An image: .npy, .exr, .png, .jpg, .tif, .hdr, .pfm, .pgm or .ppm, compared in linear values
    #[arg(value_name = "A")]
    image: PathBuf,
    /// The reference, of the same size and channels
    #[arg(value_name = "B")]
    reference: PathBuf,
    /// The data range of PSNR and SSIM [default: from the least to the greatest value of B]
    #[arg(long, value_name = "L", value_parser = number::<f64>)]
    range: Option<f64>,
    /// Exit status 1 if the RMSE is above this
    #[arg(long, value_name = "X", value_parser = number::<f64>)]
    max_rmse: Option<f64>,
    /// Exit status 1 if the RMSE is above this share of B's root mean square
    #[arg(long, value_name = "X", value_parser = number::<f64>)]
    max_relative_rmse: Option<f64>,
    /// Exit status 1 if the PSNR is below this, in dB
    #[arg(long, value_name = "DB", value_parser = number::<f64>)]
    min_psnr: Option<f64>,
    /// Exit status 1 if SSIM is below this
    #[arg(long, value_name = "X", value_parser = number::<f64>)]
    min_ssim: Option<f64>,
    /// Where A − B goes: .npy and .exr keep the values, .png shows them in blue (below) and red (above); may be given
    /// several times
    #[arg(short = 'o', long = "output", value_name = "FILE")]
    files: Vec<PathBuf>,
}

pub(super) fn run(args: &Args, console: &Console) -> Result<Outcome> {
    args.files.iter().try_for_each(|file| picture::check_writable(file))?;
    require_common_size(args)?;
    let image = picture::read(&args.image)?;
    let reference = picture::read(&args.reference)?;
    let found = compared(args, &image, &reference)?;
    let misses = misses(args, &found)?;
    for file in &args.files {
        write_difference(file, &image, &reference)?;
    }
    say(&found, console)?;
    misses.iter().for_each(|miss| console.note(miss));
    console.summary(&json!({
        "verb": "compare",
        "rmse": found.rmse,
        "relative_rmse": found.relative_rmse,
        "largest": found.largest,
        // Equal images have an infinite PSNR, which JSON cannot represent, so it becomes null.
        "psnr": Some(found.psnr).filter(|psnr| psnr.is_finite()),
        "ssim": found.ssim,
        "range": found.range,
        "files": args.files.iter().map(Name::from).collect::<Vec<_>>(),
        "alike": misses.is_empty(),
    }))?;
    Ok(if misses.is_empty() { Outcome::Done } else { Outcome::NotGoodEnough })
}

fn compared(args: &Args, image: &Image, reference: &Image) -> Result<Similarity> {
    let shape = |image: &Image| (image.resolution(), image.channels());
    if shape(image) != shape(reference) {
        let in_words = |image: &Image| format!("{} pixels of {}", image.resolution(), channels(image));
        return Err(different(args, &in_words(image), &in_words(reference)));
    }
    similarity(image, reference, args.range.unwrap_or_else(|| data_range(reference)))
}

/// Checks, before a pixel is decoded, that both images have the same size. A file that does not state its size is not checked here.
fn require_common_size(args: &Args) -> Result<()> {
    let [image, reference] = [&args.image, &args.reference].map(|path| picture::stated_sizes(path));
    let (image, reference) = (image?, reference?);
    match (image.first(), reference.first()) {
        (Some(of_image), Some(of_reference)) if !image.iter().any(|size| reference.contains(size)) => {
            let in_words = |size: &Resolution| format!("{size} pixels");
            Err(different(args, &in_words(of_image), &in_words(of_reference)))
        }
        _ => Ok(()),
    }
}

/// The error for images that cannot be compared.
fn different(args: &Args, image: &str, reference: &str) -> Error {
    Error::data(&args.image, format!("it has {image}, but {} has {reference}", args.reference.display()))
        .help("give two images of one size, both gray or both coloured")
}

fn channels(image: &Image) -> &'static str {
    if image.channels() == 1 { "one channel" } else { "three channels" }
}

/// A sentence for each bound that the images miss.
fn misses(args: &Args, found: &Similarity) -> Result<Vec<String>> {
    if args.min_ssim.is_some() && found.ssim.is_none() {
        return Err(Error::option("--min-ssim", "the images are smaller than SSIM's window, 11x11 pixels")
            .help("use --max-relative-rmse or --min-psnr"));
    }
    let bounds = [
        ("the RMSE", found.rmse, args.max_rmse, "above"),
        ("the relative RMSE", found.relative_rmse, args.max_relative_rmse, "above"),
        ("the PSNR", found.psnr, args.min_psnr, "below"),
        ("SSIM", found.ssim.unwrap_or(1.0), args.min_ssim, "below"),
    ];
    let miss = |(name, value, bound, side): (&str, f64, Option<f64>, &str)| {
        let bound = bound?;
        let is_beyond = if side == "above" { value > bound } else { value < bound };
        // A threshold of NaN counts as missed.
        let is_missed = is_beyond || bound.is_nan();
        is_missed.then(|| format!("{name}, {}, is {side} {bound}", decimal(value, 5)))
    };
    Ok(bounds.into_iter().filter_map(miss).collect())
}

fn say(found: &Similarity, console: &Console) -> Result<()> {
    console.say(format_args!(
        "rmse      {:.5e}, {} % of B's root mean square; {:.5e} at most",
        found.rmse,
        percent(found.relative_rmse),
        found.largest
    ))?;
    console.say(format_args!(
        "psnr      {:.2} dB, for a data range of {}",
        found.psnr,
        decimal(found.range, 5)
    ))?;
    match found.ssim {
        Some(ssim) => console.say(format_args!("ssim      {ssim:.5}")),
        None => console.say("ssim      none: the images are smaller than its window, 11x11 pixels"),
    }
}

/// Writes `A − B`. A picture shows the mean over the channels.
fn write_difference(file: &Path, image: &Image, reference: &Image) -> Result<()> {
    let samples = image.samples().iter().zip(reference.samples());
    let difference = Image::new(image.resolution(), image.channels(), samples.map(|(a, b)| a - b).collect())?;
    match file.extension().and_then(|extension| extension.to_str()) {
        Some("npy") => npy::write_image(file, &difference)?,
        Some("png") => {
            let mean = mean(&difference.planes());
            paint_signed(difference.resolution(), &mean, None, robust_range(&mean, None))?.write_png(file)?;
        }
        _ => picture::write(file, &difference)?,
    }
    Ok(())
}
