//! A virtual rig: a simulated scene behind a simulated projector and camera. These devices have the imperfections of real devices, and are
//! driven through the same traits.
//!
//! | step | what it does | file |
//! |---|---|---|
//! | levels → light | limited range, response, black level, overscan, blur, vignetting | `light` |
//! | light → photo | the scene's light transport | [`crate::transport`] |
//! | photo → sensor | misregistration, the camera's pixels, its blur, the splitter's ghost and stray light | `optics` |
//! | time | latency, iris, pulses, drift, ambient light, rolling shutter, faults | `world` |
//! | light → counts | vignetting, shot noise, read noise, response, quantization | `light` |
//!
//! Time is simulated, so nothing sleeps. Every count is a function of the rig's description, the frame's number and the time. Therefore
//! runs repeat to the last bit, and an interrupted run continues at the point of interruption.

mod light;
mod optics;
pub(crate) mod spec;
pub(crate) mod world;

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::{Camera, CameraInfo, Clock, Devices, Frame, Projector, ProjectorInfo, RawFrame, Shown, Stamp};
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::transport::{Channels, Transport};
use light::{VirtualScreen, VirtualSensor};
use optics::View;
use spec::VirtualRig;
use world::VirtualWorld;

impl VirtualRig {
    /// The projector's properties.
    pub fn projector_info(&self) -> ProjectorInfo {
        let (resolution, spec) = (self.scene.size(), &self.projector);
        ProjectorInfo {
            name: "virtual projector".into(),
            resolution,
            channels: spec.channels,
            bits: spec.bits,
            frame_time: spec.frame_time,
        }
    }

    /// The camera's properties.
    pub fn camera_info(&self) -> CameraInfo {
        let spec = &self.camera;
        let size = spec.size.map(|[width, height]| Resolution::new(width, height));
        CameraInfo {
            name: "virtual camera".into(),
            resolution: size.unwrap_or(self.scene.size()),
            channels: spec.channels,
            bits: spec.bits,
            exposures: spec.exposures,
        }
    }

    /// Opens the rig on `light`, the light transport of its [`scene`](Self::scene) with at least [`channels`](Self::channels) channels. The
    /// units of `light` do not matter, because the camera's sensitivity is relative to the white photo. The screen shows level 0. With
    /// `after`, the last frame of an earlier session, the rig continues as if that session had never ended (see [`Projector::restore`]).
    ///
    /// # Errors
    /// [`Error::Rig`] when `light` has another size or too few channels, or the white photo is dark. The error of `light` when `light`
    /// cannot take a photo.
    pub fn open(&self, light: Box<dyn Transport + Send>, after: Option<Stamp>) -> Result<Devices> {
        self.check_light(light.as_ref())?;
        let (projector, camera) = (self.projector_info(), self.camera_info());
        let mut view = View::new(light, camera.resolution, &self.camera, &self.splitter)?;
        let screen = VirtualScreen::new(&self.projector, projector.resolution);
        let frame = |level| Frame::filled(projector.resolution, projector.channels, level);
        let brightest = screen.emit(&frame(projector.highest()));
        let white = view.lit_by(&brightest)?;
        view.set_stray(self.splitter.stray, &brightest, &white);
        let white = white.concat();
        let sensor =
            VirtualSensor::new(&self.camera, camera.resolution, self.seed, &white).ok_or_else(|| {
                Error::rig(&camera.name, "it sees nothing even when the projector shows white").help(
                    "correct the poses of camera and projector, or the camera's shift, scale or homography",
                )
            })?;
        let own_light = view.unlit()?;
        let mut world = VirtualWorld {
            rig: self.clone(),
            camera: camera.resolution,
            view,
            screen,
            sensor,
            own_light,
            ambient_unit: white.iter().sum::<f64>() / white.len() as f64,
            exposure: camera.exposures[0],
            now: after.map_or(0.0, |stamp| stamp.time + self.camera.readout),
            id: after.map_or(0, |stamp| stamp.id),
            changes: VecDeque::new(),
            handed_out: None,
            restarted_at: None,
        };
        world.restore(&frame(0))?;
        let devices = VirtualDevices { projector, camera, world: Arc::new(Mutex::new(world)) };
        Ok(Devices::new(devices.clone(), devices.clone(), devices))
    }

    fn check_light(&self, light: &dyn Transport) -> Result<()> {
        let size = self.scene.size();
        let sizes = [light.pattern_resolution(), light.photo_resolution()];
        let channels = self.channels().count();
        let fault = if sizes != [size; 2] {
            let [pattern, photo] = sizes;
            format!("it is {size}, but its scene takes patterns of {pattern} and makes photos of {photo}")
        } else if light.channels().count() < channels {
            format!("it has {channels} channels, but its scene is gray")
        } else {
            return Ok(());
        };
        Err(Error::rig("virtual rig", fault)
            .help("give a coaxial scene of the size and channels that the rig file says"))
    }
}

/// The devices of a virtual rig, and their simulated world. Copies share one world, and each copy may be on another thread.
#[derive(Clone)]
struct VirtualDevices {
    projector: ProjectorInfo,
    camera: CameraInfo,
    world: Arc<Mutex<VirtualWorld>>,
}

impl VirtualDevices {
    /// Locks the world. A thread that panicked with the lock leaves a frame unfinished, but no inconsistent state.
    fn world(&self) -> MutexGuard<'_, VirtualWorld> {
        self.world.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Projector for VirtualDevices {
    fn info(&self) -> &ProjectorInfo {
        &self.projector
    }

    fn show(&mut self, frame: &Frame) -> Result<Shown> {
        self.projector.check(frame)?;
        Ok(Shown { at: self.world().show(frame)? })
    }

    fn restore(&mut self, frame: &Frame) -> Result<Shown> {
        self.projector.check(frame)?;
        Ok(Shown { at: self.world().restore(frame)? })
    }
}

impl Camera for VirtualDevices {
    fn info(&self) -> &CameraInfo {
        &self.camera
    }

    fn configure(&mut self, exposure: f64) -> Result<f64> {
        self.camera.check_exposure(exposure)?;
        let [shortest, longest] = self.camera.exposures;
        let mut world = self.world();
        let step = world.rig.camera.exposure_step;
        world.exposure = exposure;
        if step > 0.0 {
            let [fewest, most] = [(shortest / step).ceil(), (longest / step).floor()];
            world.exposure = (exposure / step).round().clamp(fewest, most.max(fewest)) * step;
        }
        Ok(world.exposure)
    }

    fn capture(&mut self) -> Result<Option<RawFrame>> {
        Ok(self.world().capture())
    }

    fn restart(&mut self) -> Result<()> {
        self.world().restart();
        Ok(())
    }
}

impl Clock for VirtualDevices {
    fn now(&self) -> f64 {
        self.world().now
    }

    fn sleep(&mut self, seconds: f64) {
        self.world().now += seconds.max(0.0);
    }
}

/// The light transport of an evenly coloured matte sheet that is perpendicular to projector and camera. The photo equals the pattern.
#[derive(Clone, Copy, Debug)]
pub struct MatteSheet {
    /// The number of pixels of patterns and photos.
    pub resolution: Resolution,
    /// Gray or coloured.
    pub channels: Channels,
}

impl Transport for MatteSheet {
    fn pattern_resolution(&self) -> Resolution {
        self.resolution
    }

    fn photo_resolution(&self) -> Resolution {
        self.resolution
    }

    fn channels(&self) -> Channels {
        self.channels
    }

    fn photograph(&mut self, pattern: &Image) -> Result<Image> {
        if pattern.resolution() != self.resolution {
            return Err(Error::dimension(
                "pixels of the pattern on a sheet",
                self.resolution,
                pattern.resolution(),
            ));
        }
        let count = self.channels.count();
        let pixel = |light: &[f32]| -> Vec<f32> {
            (0..count).map(|channel| light[if light.len() == count { channel } else { 0 }]).collect()
        };
        let samples = pattern.samples().chunks_exact(pattern.channels()).flat_map(pixel).collect();
        Image::new(self.resolution, count, samples)
    }
}
