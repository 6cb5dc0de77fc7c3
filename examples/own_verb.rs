//! A verb of one's own: where the light of one projector pixel goes. It is asked and saved as the verbs of krylux are.
//!
//! `cargo run --release --example own_verb`

use krylux::image::{Image, Resolution};
use krylux::io::raster::exposure;
use krylux::lab::{Answer, Lab, Verb};
use krylux::report::content::Content;
use krylux::report::html::Block;
use krylux::report::run::AnswerPage;

/// The request. Its fields are recorded in `run.json`.
#[derive(serde::Serialize)]
struct Spread {
    column: usize,
    row: usize,
}

/// The answer.
struct Spot {
    photo: Image,
    /// The share of the light that comes back at the pixel itself.
    own: f64,
    /// The root mean square distance, in pixels, at which light comes back.
    distance: f64,
}

impl Verb for Spread {
    const NAME: &'static str = "spread";
    const IS_CHECKED: bool = false;
    type Answer = Spot;

    fn answer(&self, lab: &mut Lab) -> krylux::Result<Spot> {
        let size = lab.projector_resolution();
        let mut pattern = vec![0.0; size.pixels()];
        pattern[self.row * size.width + self.column] = 1.0;
        let photo = lab.photo(&Image::new(size, 1, pattern)?)?;
        let Resolution { width, .. } = photo.resolution();
        let light: Vec<f64> = photo.samples().iter().map(|&light| f64::from(light)).collect();
        let off = |(pixel, light): (usize, &f64)| {
            let [x, y] = [(pixel % width).abs_diff(self.column), pixel / width].map(|at| at as f64);
            light * (x.powi(2) + (y - self.row as f64).powi(2))
        };
        let total: f64 = light.iter().sum();
        let own = light[self.row * width + self.column] / total;
        let distance = (light.iter().enumerate().map(off).sum::<f64>() / total).sqrt();
        Ok(Spot { photo, own, distance })
    }
}

impl Answer for Spot {
    fn names(&self) -> [&'static str; 2] {
        [Spread::NAME, "the light of one pixel"]
    }

    fn photos(&self) -> usize {
        1
    }

    fn headline(&self) -> String {
        format!("{:.1} % of the light comes back at the pixel itself", 100.0 * self.own)
    }

    /// Files, the summary of `--json` and the attributes in Python come from these names.
    fn content(&self) -> Content<'_> {
        let mut content = Content::default();
        content.picture("spot", &self.photo);
        content.fact("own_share", self.own);
        content.fact("distance", self.distance);
        content
    }

    fn show(&self, _: &mut Lab, page: &mut AnswerPage<'_>) -> krylux::Result<()> {
        let figure = page.light("spot", &self.photo, exposure(&self.photo), "The photo of one lit pixel");
        page.section("Where the light goes", "", [Block::Figures(vec![figure])]);
        page.fact("Distance", format_args!("{:.1} px", self.distance));
        Ok(())
    }
}

fn main() -> krylux::Result<()> {
    let mut lab = Lab::builder("assets/scenes/zigzag/scene.glb").size(64, 64).samples(64).open()?;
    let spot = lab.ask(&Spread { column: 20, row: 32 })?;
    println!("{}. Its distance is {:.1} pixels on average.", spot.headline(), spot.distance);
    println!("{}", lab.save("out/spread", &spot)?.report.display());
    Ok(())
}
