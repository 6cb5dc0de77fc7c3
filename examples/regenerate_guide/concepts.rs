//! The pictures of the concept pages.

use std::path::Path;

use krylux::error::{Error, Result};
use krylux::image::{Image, Resolution};
use krylux::io::raster::Raster;
use krylux::krylov::{EigsMethod, EigsOptions, Method, SolveOptions, eigs, solve};
use krylux::lab::{Lab, LabBuilder};
use krylux::operator::{Closure, Operator, Symmetry};
use krylux::report::colormap::sequential_color;
use krylux::report::plot::{LinePlot, Series};
use krylux::transport::Part;

use crate::panels;

fn scene(name: &str, side: usize) -> LabBuilder {
    Lab::builder(format!("assets/scenes/{name}/scene.glb")).size(side, side)
}

/// The product with a vector.
fn product(operator: &mut dyn Operator, x: &[f64]) -> Result<Vec<f64>> {
    let mut y = vec![0.0; operator.rows()];
    operator.apply(x, &mut y)?;
    Ok(y)
}

/// The whole light transport matrix of a corner of 16×16 pixels: brighter is more light, four decades from black to white.
pub fn matrix(path: &Path) -> Result<()> {
    const SIDE: usize = 16;
    let pixels = SIDE * SIDE;
    let mut lab = scene("corner", SIDE).samples(16384).open()?;
    let mut full = lab.operator(Part::Full)?;
    let mut columns = Vec::with_capacity(pixels);
    for pixel in 0..pixels {
        let mut x = vec![0.0; pixels];
        x[pixel] = 1.0;
        columns.push(product(&mut full, &x)?);
    }
    let largest = columns.iter().flatten().copied().fold(0.0, f64::max);
    let value = |row: usize, column: usize| 1.0 + (columns[column][row] / largest).max(1e-9).log10() / 4.0;
    let colors =
        (0..pixels * pixels).map(|at| sequential_color(value(at / pixels, at % pixels).clamp(0.0, 1.0)));
    Raster::from_pixels(Resolution::new(pixels, pixels), colors).enlarged(2).write_png(path)
}

/// The white photo of a coloured box in gray, projected back again and again, each as bright as it can be shown.
pub fn photos_of_photos(path: &Path) -> Result<()> {
    const SIDE: usize = 96;
    let mut lab = scene("cornell", SIDE).samples(256).open()?;
    let mut full = lab.operator(Part::Full)?;
    let mut pictures = Vec::new();
    let mut x = vec![1.0; SIDE * SIDE];
    for _ in 0..6 {
        let y = product(&mut full, &x)?;
        let brightest = y.iter().copied().fold(0.0, f64::max);
        x = y.iter().map(|value| value / brightest).collect();
        let samples = x.iter().map(|&value| value as f32).collect();
        pictures.push(panels::photo(&Image::new(Resolution::new(SIDE, SIDE), 1, samples)?));
    }
    panels::grid(&[pictures.as_slice()], 2).write_png(path)
}

/// How fast the largest eigenvalue is found: each photo projected back, or all photos used together.
pub fn convergence(path: &Path) -> Result<()> {
    let mut lab = scene("corner", 48).samples(256).open()?;
    let mut global = lab.operator(Part::Global)?;
    let mut series = Vec::new();
    for (name, method) in [("power iteration", EigsMethod::Power), ("Lanczos", EigsMethod::Lanczos)] {
        let mut points = Vec::new();
        for photos in 2..=24 {
            let options =
                EigsOptions { count: 1, products: photos, tolerance: 0.0, method, ..EigsOptions::default() };
            let found = eigs(&mut global, &options)?;
            points.push((photos as f64, found.residuals[0] / found.values[0]));
        }
        series.push(Series { name: name.into(), points });
    }
    let plot = LinePlot {
        x_label: "photos".into(),
        y_label: "relative residual of the first eigenvector".into(),
        logarithmic: true,
        series,
        marks: Vec::new(),
    };
    write(path, &plot)
}

/// The residual of GMRES where all photos are of one matrix, and where each has noise of its own: what one more photo shows.
pub fn frozen_and_fresh(path: &Path) -> Result<()> {
    const SIDE: usize = 32;
    let mut lab = scene("corner", SIDE).samples(64).open()?;
    let mut frozen = lab.operator(Part::Full)?;
    let mut seed = 0;
    let mut fresh = Closure::new(SIDE * SIDE, SIDE * SIDE, Symmetry::General, |x: &[f64], y: &mut [f64]| {
        seed += 1;
        let mut lab = scene("corner", SIDE).samples(64).seed(seed).open()?;
        lab.operator(Part::Full)?.apply(x, y)
    });
    let operators: [(&str, &mut dyn Operator); 2] =
        [("one matrix for all photos", &mut frozen), ("new light paths for each photo", &mut fresh)];
    let mut series = Vec::new();
    for (name, operator) in operators {
        let points = (2..=24).step_by(2).map(|photos| Ok((photos as f64, residual(operator, photos)?)));
        series.push(Series { name: name.into(), points: points.collect::<Result<_>>()? });
    }
    let plot = LinePlot {
        x_label: "photos".into(),
        y_label: "relative residual".into(),
        logarithmic: true,
        series,
        marks: Vec::new(),
    };
    write(path, &plot)
}

/// The relative residual of an evenly lit target by the number of photos, from one more photo.
fn residual(operator: &mut dyn Operator, photos: usize) -> Result<f64> {
    let target = vec![0.05; operator.rows()];
    // The solver may not stop because of the noise that the matrix states.
    let options = SolveOptions { products: photos, rtol: 0.0, ..SolveOptions::default() };
    let found = solve(Method::Gmres, operator, &target, &options)?;
    let photo = product(operator, &found.x)?;
    let norm = |of: &mut dyn Iterator<Item = f64>| of.map(|value| value * value).sum::<f64>().sqrt();
    let missing = norm(&mut photo.iter().zip(&target).map(|(seen, wanted)| wanted - seen));
    Ok(missing / norm(&mut target.iter().copied()))
}

fn write(path: &Path, plot: &LinePlot) -> Result<()> {
    std::fs::write(path, plot.render()).map_err(Error::writing(path))
}
