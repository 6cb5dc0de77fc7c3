//! Virtual devices for the figures' scenes. The shipped rig files are embedded, so that no files are needed at run time.

use std::path::Path;

use crate::error::{Error, Result};
use crate::image::Resolution;
use crate::measure::{RigFile, RigKind};
use crate::rig::VirtualRig;

const REALISTIC: &[u8] = include_bytes!("../../assets/rigs/realistic.toml");
const ONE_BIT: &[u8] = include_bytes!("../../assets/rigs/one-bit.toml");

/// Captures averaged per pattern; the virtual rig runs unattended.
const TAKES: u32 = 2;

/// An 8-bit projector of so many pixels with gamma 2.2 and a 14-bit camera, both with realistic errors.
pub(super) fn realistic(resolution: Resolution) -> Result<RigFile> {
    let (mut file, rig) = shipped("realistic.toml", REALISTIC, resolution, 2.5)?;
    file.measurement.takes = TAKES;
    Ok(RigFile { kind: RigKind::Virtual(rig), ..file })
}

/// A projector of one bit and so many pixels, and a camera of as many: the rig file, and the devices to be put into it.
pub(super) fn one_bit(resolution: Resolution) -> Result<(RigFile, VirtualRig)> {
    shipped("one-bit.toml", ONE_BIT, resolution, 1.0)
}

/// A shipped rig file, and its devices with `finer` times as many pixels per side of the camera as the projector has.
fn shipped(name: &str, bytes: &[u8], resolution: Resolution, finer: f64) -> Result<(RigFile, VirtualRig)> {
    let file = RigFile::from_bytes(Path::new(name), bytes)?;
    let RigKind::Virtual(mut rig) = file.kind.clone() else {
        return Err(Error::Data {
            path: name.into(),
            fault: "its devices are real".into(),
            help: "the figures are made by virtual devices".into(),
        });
    };
    let side = |pixels: usize| (finer * pixels as f64).round() as usize;
    rig.camera.size = Some([side(resolution.width), side(resolution.height)]);
    Ok((file, rig))
}
