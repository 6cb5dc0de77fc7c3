//! A rig for the tests of this room. A function of the request and of the wait before the exposure makes the counts of each photo.

use super::frame_source::{CaptureRequest, Effort, FrameSource};
use crate::error::Result;
use crate::image::Resolution;
use crate::rig::{CameraInfo, ProjectorInfo, RawFrame};

/// A simulated rig. The function `photo` computes the counts of a frame from the request and the waiting time in seconds. The clock advances
/// by one for each photo.
pub(crate) struct Simulated<F> {
    /// A gray projector of 8 bits, without a refresh unless it is set.
    pub(crate) projector: ProjectorInfo,
    /// A gray camera with exposures from 1 ms to 100 s, unless they are set.
    pub(crate) camera: CameraInfo,
    pub(crate) photo: F,
    /// Seconds between the confirmation of a frame and its exposure.
    pub(crate) settle: f64,
    pub(crate) asked: Vec<CaptureRequest>,
}

impl<F> Simulated<F> {
    pub(crate) fn new(projector: Resolution, camera: Resolution, bits: u32, photo: F) -> Self {
        Self {
            projector: ProjectorInfo {
                name: "projector".into(),
                resolution: projector,
                channels: 1,
                bits: 8,
                frame_time: 0.0,
            },
            camera: CameraInfo {
                name: "camera".into(),
                resolution: camera,
                channels: 1,
                bits,
                exposures: [1e-3, 100.0],
            },
            photo,
            settle: 0.0,
            asked: Vec::new(),
        }
    }
}

impl<F: FnMut(&CaptureRequest, f64) -> Vec<u16> + Send> FrameSource for Simulated<F> {
    fn projector(&self) -> &ProjectorInfo {
        &self.projector
    }

    fn camera(&self) -> &CameraInfo {
        &self.camera
    }

    fn capture(&mut self, request: &CaptureRequest) -> Result<RawFrame> {
        self.asked.push(request.clone());
        Ok(RawFrame {
            resolution: self.camera.resolution,
            channels: self.camera.channels,
            counts: (self.photo)(request, self.settle),
            exposure: request.exposure,
            id: self.asked.len() as u64,
            started: self.asked.len() as f64,
        })
    }

    fn set_settle(&mut self, seconds: f64) {
        self.settle = seconds;
    }

    fn effort(&self) -> Effort {
        Effort { taken: self.asked.len() as u64, ..Effort::default() }
    }
}
