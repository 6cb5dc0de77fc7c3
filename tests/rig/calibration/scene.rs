//! A scene in closed form: each pixel has its own albedo, and all pixels exchange smooth light. It is
//! symmetric and fast.

use krylux::image::{Image, Resolution};
use krylux::rig::{VirtualRig, VirtualScene};
use krylux::transport::{Channels, Transport};

/// `A = diag(direct) + Σ u uᵀ`, with a few smooth `u`.
#[derive(Clone, Debug)]
pub struct Folded {
    resolution: Resolution,
    direct: Vec<f64>,
    exchange: Vec<Vec<f64>>,
    channels: Channels,
}

impl Folded {
    /// Two walls at an angle, with albedos from 0.3 to 1. The share `global` of a white photo is exchanged
    /// light.
    pub fn new(resolution: Resolution, global: f64) -> Self {
        let place = |pixel: usize| {
            let [x, y] = [pixel % resolution.width, pixel / resolution.width];
            [(x as f64 + 0.5) / resolution.width as f64, (y as f64 + 0.5) / resolution.height as f64]
        };
        let albedo = |pixel: usize| {
            let [x, y] = place(pixel);
            0.65 + 0.2 * (17.0 * x + 3.0 * y).sin() + 0.15 * (5.0 * x - 23.0 * y).cos()
        };
        let pixels = resolution.pixels();
        let near = |pixel: usize, at: [f64; 2]| {
            let [x, y] = place(pixel);
            albedo(pixel) * (-((x - at[0]).powi(2) + (y - at[1]).powi(2)) / 0.08).exp()
        };
        let centres = [[0.3, 0.3], [0.7, 0.35], [0.5, 0.75]];
        let mut exchange: Vec<Vec<f64>> =
            centres.iter().map(|&at| (0..pixels).map(|pixel| near(pixel, at)).collect()).collect();
        let direct: Vec<f64> = (0..pixels).map(albedo).collect();
        let sums: f64 = exchange.iter().map(|u| u.iter().sum::<f64>().powi(2)).sum();
        let scale = (global / (1.0 - global) * direct.iter().sum::<f64>() / sums).sqrt();
        exchange.iter_mut().flatten().for_each(|value| *value *= scale);
        Self { resolution, direct, exchange, channels: Channels::Luma }
    }

    /// The same for each of three colours.
    pub fn coloured(self) -> Self {
        Self { channels: Channels::Rgb, ..self }
    }

    /// `A x`.
    pub fn apply(&self, x: &[f64]) -> Vec<f64> {
        let mut y: Vec<f64> = self.direct.iter().zip(x).map(|(direct, x)| direct * x).collect();
        for u in &self.exchange {
            let share: f64 = u.iter().zip(x).map(|(u, x)| u * x).sum();
            y.iter_mut().zip(u).for_each(|(y, u)| *y += u * share);
        }
        y
    }

    /// A rig in front of a scene of this size. The scene itself is passed when the rig is opened.
    pub fn rig(&self) -> VirtualRig {
        VirtualRig::ideal(VirtualScene::Matrix { path: "closed form".into(), size: self.resolution })
    }
}

impl Transport for Folded {
    fn pattern_resolution(&self) -> Resolution {
        self.resolution
    }

    fn photo_resolution(&self) -> Resolution {
        self.resolution
    }

    fn channels(&self) -> Channels {
        self.channels
    }

    fn photograph(&mut self, pattern: &Image) -> krylux::Result<Image> {
        let channels = self.channels.count();
        // A gray pattern lights all colours.
        let plane = |channel: usize| pattern.plane(channel.min(pattern.channels() - 1));
        let photos: Vec<Vec<f64>> = (0..channels).map(|channel| self.apply(&plane(channel))).collect();
        let pixels = 0..self.resolution.pixels();
        let samples = pixels.flat_map(|pixel| photos.iter().map(move |photo| photo[pixel] as f32));
        Image::new(self.resolution, channels, samples.collect())
    }
}
