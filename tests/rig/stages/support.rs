//! A rig that is a dense matrix, with device imperfections that can be switched on one by one.
use krylux::Result;
use krylux::image::Resolution;
use krylux::measure::{
    Calibration, CameraResponse, CaptureRequest, DirectBy, Effort, FrameSource, MeasureOptions, Measurement,
    Registration,
};
use krylux::operator::Operator;
use krylux::rig::{CameraInfo, ProjectorInfo, RawFrame};
use krylux::transport::Part;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

/// A dense symmetric light transport matrix, `rows[j][i]`, in linear DN per second.
#[derive(Clone)]
pub struct Dense {
    pub resolution: Resolution,
    pub direct: Vec<f64>,
    pub global: Vec<Vec<f64>>,
}

impl Dense {
    /// Direct and global light of similar strength. The global light decreases with distance and differs from
    /// pixel to pixel.
    pub fn new(resolution: Resolution, brightness: f64, seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let n = resolution.pixels();
        let albedo: Vec<f64> = (0..n).map(|_| random.random_range(0.4..1.0)).collect();
        let direct = albedo.iter().map(|albedo| brightness * albedo).collect();
        let at = |i: usize| ((i % resolution.width) as f64, (i / resolution.width) as f64);
        let reach = resolution.width as f64 / 2.0;
        let global = (0..n)
            .map(|j| {
                let one = |i: usize| {
                    let ((x, y), (u, v)) = (at(i), at(j));
                    let square = ((x - u).powi(2) + (y - v).powi(2)) / (reach * reach);
                    2.0 * brightness * albedo[i] * albedo[j] / n as f64 / (1.0 + square)
                };
                (0..n).map(one).collect()
            })
            .collect();
        Self { resolution, direct, global }
    }

    /// Global light of rank one, which is as smooth as possible.
    pub fn smooth(resolution: Resolution, brightness: f64) -> Self {
        let mut dense = Self::new(resolution, brightness, 5);
        let n = resolution.pixels();
        let sees = |i: usize| 0.5 + (i % resolution.width) as f64 / resolution.width as f64;
        dense.global =
            (0..n).map(|j| (0..n).map(|i| brightness * sees(i) * sees(j) / n as f64).collect()).collect();
        dense
    }

    pub fn apply(&self, part: Part, x: &[f64]) -> Vec<f64> {
        let global = |j: usize| self.global[j].iter().zip(x).map(|(a, x)| a * x).sum::<f64>();
        (0..x.len())
            .map(|j| match part {
                Part::Full => self.direct[j] * x[j] + global(j),
                Part::Direct => self.direct[j] * x[j],
                Part::Global => global(j),
            })
            .collect()
    }
}

/// The devices around the matrix. Public fields can be changed before use.
#[derive(Clone)]
pub struct Rig {
    pub matrix: Dense,
    pub projector: ProjectorInfo,
    pub camera: CameraInfo,
    /// The projector's gamma.
    pub gamma: f64,
    /// The light of level 0, relative to white.
    pub black_level: f64,
    /// The light of the room, in linear DN per second.
    pub ambient: f64,
    /// Electrons per DN. Infinity stands for no shot noise.
    pub gain: f64,
    /// The read noise, in DN.
    pub read_noise: f64,
    /// The count without light.
    pub offset: f64,
    /// Counts are `offset + range · (linear / range)^(1/response)`.
    pub response: f64,
    /// The pixels of the photo that each camera pixel sees, with weights. `None`: each camera pixel sees the
    /// projector pixel of the same index.
    pub optics: Option<Vec<Vec<(usize, f64)>>>,
    /// The pixel map in the calibration. `None`: that of equal rasters.
    pub registration: Option<Registration>,
    /// The relative brightness of the lamp as a function of time in seconds.
    pub lamp: fn(f64) -> f64,
    pub seed: u64,
    pub effort: Effort,
}

impl Rig {
    /// A rig without imperfections: many bits, and no noise.
    pub fn new(matrix: Dense) -> Self {
        let projector = ProjectorInfo {
            name: "dense".into(),
            resolution: matrix.resolution,
            channels: 1,
            bits: 16,
            frame_time: 0.0,
        };
        let camera = CameraInfo {
            name: "dense".into(),
            resolution: matrix.resolution,
            channels: 1,
            bits: 16,
            exposures: [1e-4, 1e4],
        };
        Self {
            matrix,
            projector,
            camera,
            gamma: 1.0,
            black_level: 0.0,
            ambient: 0.0,
            gain: f64::INFINITY,
            read_noise: 0.0,
            offset: 0.0,
            response: 1.0,
            optics: None,
            registration: None,
            lamp: |_| 1.0,
            seed: 1,
            effort: Effort::default(),
        }
    }

    /// A camera of 14 bits and 60 000 electrons with a read noise of 5, at a black level of 256 DN.
    pub fn noisy(mut self) -> Self {
        self.camera.bits = 14;
        self.gain = 60_000.0 / 16_384.0;
        self.read_noise = 5.0 / self.gain;
        self.offset = 256.0;
        self
    }

    /// The exact calibration.
    pub fn calibration(&self) -> Calibration {
        let mut calibration = Calibration::ideal(&self.projector, &self.camera);
        for curve in &mut calibration.projector {
            curve.iter_mut().for_each(|light| *light = light.powf(self.gamma));
        }
        let counts = 1_usize << self.camera.bits;
        let range = self.range();
        let curve = (self.response != 1.0).then(|| {
            let linear = |count: usize| {
                let share = (count as f64 - self.offset) / range;
                range * share.abs().powf(self.response) * share.signum()
            };
            (0..counts).map(linear).collect()
        });
        calibration.camera = CameraResponse {
            black: self.offset,
            saturation: (counts - 1) as f64,
            gain: self.gain,
            read_noise: self.read_noise,
            curve,
        };
        if let Some(registration) = &self.registration {
            calibration.registration = registration.clone();
        }
        calibration
    }

    pub fn measure(&self, options: &MeasureOptions) -> Measurement {
        Measurement::new(Box::new(self.clone()), self.calibration(), options.clone())
            .expect("options of a test fit")
    }

    /// The same rig with different noise.
    pub fn reseeded(&self, seed: u64) -> Self {
        Self { seed, ..self.clone() }
    }

    fn range(&self) -> f64 {
        ((1_u32 << self.camera.bits) - 1) as f64 - self.offset
    }
}

impl FrameSource for Rig {
    fn projector(&self) -> &ProjectorInfo {
        &self.projector
    }

    fn camera(&self) -> &CameraInfo {
        &self.camera
    }

    fn capture(&mut self, request: &CaptureRequest) -> Result<RawFrame> {
        self.effort.shown += 1;
        self.effort.taken += 1;
        self.effort.seconds += request.exposure;
        let id = self.effort.taken;
        let top = ((1_u32 << self.projector.bits) - 1) as f64;
        let light = |level: &u16| (f64::from(*level) / top).powf(self.gamma) + self.black_level;
        let pattern: Vec<f64> = request.frame.levels().iter().map(light).collect();
        let lamp = (self.lamp)(self.effort.seconds);
        let photo: Vec<f64> =
            self.matrix.apply(Part::Full, &pattern).iter().map(|light| lamp * light + self.ambient).collect();
        let photo = match &self.optics {
            None => photo,
            Some(optics) => optics.iter().map(|row| row.iter().map(|&(i, w)| w * photo[i]).sum()).collect(),
        };
        let mut random = Pcg64::seed_from_u64(self.seed.wrapping_mul(0x9e37_79b9_7f4a_7c15).wrapping_add(id));
        let range = self.range();
        let most = f64::from((1_u32 << self.camera.bits) - 1);
        let mut count = |light: &f64| {
            let linear = light * request.exposure;
            let normal: f64 = random.sample(StandardNormal);
            let noise = (linear / self.gain + self.read_noise.powi(2)).sqrt() * normal;
            let share = (linear + noise) / range;
            let count = self.offset + range * share.abs().powf(1.0 / self.response) * share.signum();
            count.round().clamp(0.0, most) as u16
        };
        let counts = photo.iter().map(&mut count).collect();
        let started = self.effort.seconds;
        Ok(RawFrame {
            resolution: self.camera.resolution,
            channels: 1,
            counts,
            exposure: request.exposure,
            id,
            started,
        })
    }

    fn set_settle(&mut self, _: f64) {}

    fn effort(&self) -> Effort {
        self.effort
    }
}

/// `A x` as measured.
pub fn product(measurement: &mut Measurement, part: Part, x: &[f64]) -> Vec<f64> {
    let mut y = vec![0.0; x.len()];
    measurement.operator(part, 0).apply(x, &mut y).expect("a dense rig never fails");
    y
}

/// `‖found − expected‖ / ‖expected‖`
pub fn error(found: &[f64], expected: &[f64]) -> f64 {
    let square: f64 = found.iter().zip(expected).map(|(f, e)| (f - e).powi(2)).sum();
    (square / expected.iter().map(|e| e * e).sum::<f64>()).sqrt()
}

/// A random vector with entries in [−1, 1].
pub fn vector(n: usize, seed: u64) -> Vec<f64> {
    let mut random = Pcg64::seed_from_u64(seed);
    (0..n).map(|_| random.random_range(-1.0..1.0)).collect()
}

pub fn dot(x: &[f64], y: &[f64]) -> f64 {
    x.iter().zip(y).map(|(x, y)| x * y).sum()
}

/// Options without sentinels and without a measurement of the direct light.
pub fn plain() -> MeasureOptions {
    MeasureOptions { sentinel_every: 0, direct: DirectBy::None, ..MeasureOptions::default() }
}

/// `‖Found − Expected‖ / ‖Expected‖` of two matrices, column by column, in the Frobenius norm.
pub fn columns(
    n: usize,
    mut found: impl FnMut(&[f64]) -> Vec<f64>,
    expected: impl Fn(&[f64]) -> Vec<f64>,
) -> f64 {
    let (mut difference, mut square) = (0.0, 0.0);
    for column in 0..n {
        let unit: Vec<f64> = (0..n).map(|i| f64::from(u8::from(i == column))).collect();
        for (found, expected) in found(&unit).iter().zip(expected(&unit)) {
            difference += (found - expected).powi(2);
            square += expected * expected;
        }
    }
    (difference / square).sqrt()
}
