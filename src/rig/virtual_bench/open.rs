//! Opening a virtual rig.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

use super::VirtualRig;
use super::devices::{VirtualCameraHandle, VirtualClock, VirtualProjectorHandle};
use super::screen::Screen;
use super::sensor::Sensor;
use super::view::View;
use super::world::World;
use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::rig::{CameraInfo, Devices, Frame, ProjectorInfo, Stamp};
use crate::transport::Transport;

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

    /// Opens the rig on `light`, the light transport of its [`scene`](Self::scene) with at least [`channels`](Self::channels)
    /// channels. The screen shows level 0. With `after`, the last frame of an earlier session, the rig continues as if that session
    /// had never ended (see [`Projector::restore`](crate::rig::Projector::restore)).
    ///
    /// The units of the light transport do not matter: the camera's sensitivity is relative to the white photo.
    ///
    /// # Errors
    /// [`Error::Rig`] when the light transport has another size or too few channels, or the white photo is dark; an error of
    /// `light` when it cannot be photographed.
    pub fn open(&self, light: Box<dyn Transport + Send>, after: Option<Stamp>) -> Result<Devices> {
        self.check_light(light.as_ref())?;
        let (projector, camera) = (self.projector_info(), self.camera_info());
        let mut view = View::new(light, camera.resolution, &self.camera, &self.splitter)?;
        let screen = Screen::new(&self.projector, projector.resolution);
        let frame = |level| Frame::filled(projector.resolution, projector.channels, level);
        let brightest = screen.emit(&frame(projector.highest()));
        let white = view.lit_by(&brightest)?;
        view.set_stray(self.splitter.stray, &brightest, &white);
        let white = white.concat();
        let sensor =
            Sensor::new(&self.camera, camera.resolution, self.seed, &white).ok_or_else(|| Error::Rig {
                device: camera.name.clone(),
                fault: "it sees nothing even when the projector shows white".into(),
                help: "correct the poses of camera and projector, or the camera's shift, scale or homography"
                    .into(),
            })?;
        let own_light = view.unlit()?;
        let mut world = World {
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
        let world = Arc::new(Mutex::new(world));
        Ok(Devices {
            projector: Box::new(VirtualProjectorHandle { info: projector, world: Arc::clone(&world) }),
            camera: Box::new(VirtualCameraHandle {
                info: camera,
                step: self.camera.exposure_step,
                world: Arc::clone(&world),
            }),
            clock: Box::new(VirtualClock { world }),
        })
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
        Err(Error::Rig {
            device: "virtual rig".into(),
            fault,
            help: "give a coaxial scene of the size and channels that the rig file says".into(),
        })
    }
}
