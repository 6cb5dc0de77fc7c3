//! The exact view of a scene, and its view through the devices of virtual rigs.

use std::path::Path;

use super::settings::OperatorChoice;
use super::source::{Source, not_a_rig};
use super::{Lab, RigSource};
use crate::error::{Error, Result};
use crate::measure::{Calibration, RigFile};

impl Lab {
    /// The same scene seen by the virtual devices of a rig file. This scene replaces the scene that the file names. It is traced again only
    /// if the devices have other channels than this laboratory. If the file names no calibration, the devices are treated as ideal until
    /// [`Lab::calibrate`] or [`Lab::set_calibration`] is called.
    ///
    /// ```
    /// use krylux::lab::Lab;
    /// use krylux::measure::RigFile;
    /// use krylux::calibrate::CalibrateOptions;
    ///
    /// # fn main() -> krylux::Result<()> {
    /// let mut exact = Lab::builder("assets/scenes/corner/scene.glb").size(32, 32).open()?;
    /// let mut rig = exact.through_rig(RigFile::load("assets/rigs/realistic.toml".as_ref())?)?;
    /// rig.calibrate(&CalibrateOptions::default())?;
    /// let [seen, light] = [rig.white()?, exact.white()?].map(|photo| photo.plane(0));
    /// # let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    /// # let cosine = product(&seen, &light) / (product(&seen, &seen) * product(&light, &light)).sqrt();
    /// # // A calibrated camera sees the same picture but for vignetting and noise, in its own units.
    /// # assert!(cosine > 0.99 && seen != light, "{cosine}");
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`crate::Error::Data`] if there is no scene or the devices are real; [`crate::Error::Option`] if the scene's projector has other
    /// pixels than its camera; the errors of loading the calibration that the file names.
    pub fn through_rig(&self, file: RigFile) -> Result<Self> {
        let rig = RigSource::in_front_of(self.scene_source()?, file, &self.observer)?;
        let mut settings = self.settings.clone();
        settings.operator.choice = OperatorChoice::Auto;
        Ok(Self::new(Source::Rig(Box::new(rig)), settings, self.observer.clone()))
    }

    /// Uses this calibration for photos of the rig from now on. Call it before the first photo of a run.
    ///
    /// # Errors
    /// [`crate::Error::Option`] if the source is not a rig; [`crate::Error::Rig`] when the calibration belongs to other devices.
    pub fn set_calibration(&mut self, calibration: Calibration) -> Result<()> {
        let Source::Rig(rig) = &mut self.source else { return Err(self.is_no_rig()) };
        rig.calibrated_by(calibration)?;
        // The open light transport still uses the previous calibration.
        self.transport = None;
        Ok(())
    }

    pub(crate) fn is_no_rig(&self) -> Error {
        not_a_rig(Path::new(&self.name()))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::analysis::plan::Twin;
    use crate::image::Resolution;
    use crate::lab::{RunOptions, Settings};
    use crate::measure::RigKind;
    use crate::rig::CameraInfo;
    use crate::scene::builtin;

    fn ideal() -> Result<RigFile> {
        RigFile::load("assets/rigs/ideal.toml".as_ref())
    }

    fn corner(width: usize, height: usize) -> Result<Lab> {
        Lab::builder_of_scene(builtin::corner().to_scene()).size(width, height).samples(4).open()
    }

    fn fault<T>(done: Result<T>) -> String {
        done.map_or_else(|error| error.to_string(), |_| String::new())
    }

    #[test]
    fn rigs_share_the_matrix_of_their_scene_whoever_asks_first() -> Result<()> {
        let mut exact = corner(12, 9)?;
        let mut rig = exact.through_rig(ideal()?)?;
        assert_eq!((rig.resolution(), rig.unit()), (Resolution::new(12, 9), "DN/s"));
        let seen = rig.white()?.plane(0);
        let [twin, another] = [&rig, &rig.through_rig(ideal()?)?].map(|lab| lab.rig().map(RigSource::twin));
        let (Some(Ok(Twin::Traced(twin))), Some(Ok(Twin::Traced(another)))) = (twin, another) else {
            unreachable!("a scene is traced")
        };
        assert!(Arc::ptr_eq(&twin, &another));
        assert!(exact.assembled()?.is_some_and(|traced| Arc::ptr_eq(&traced, &twin)));
        let light = exact.white()?.plane(0);
        let unit = seen.iter().sum::<f64>() / light.iter().sum::<f64>();
        // The camera has 65535 counts and an exposure of 0.1 s, so one count is 10 DN/s.
        let off = seen.iter().zip(&light).map(|(seen, light)| (seen - unit * light).abs());
        assert!(off.fold(0.0, f64::max) <= 10.0);
        Ok(())
    }

    #[test]
    fn a_run_keeps_the_rig_file_and_refuses_one_that_a_program_changed() -> Result<()> {
        let folder = tempfile::tempdir().map_err(Error::writing(Path::new("a temporary folder")))?;
        let into =
            |name: &str| RunOptions { folder: Some(folder.path().join(name)), ..RunOptions::default() };
        let exact = corner(8, 8)?;
        let mut rig = exact.through_rig(ideal()?)?;
        rig.begin_run("photo", &into("whole"))?;
        let white = rig.white()?;
        drop(rig);
        assert_eq!(crate::open(folder.path().join("whole"))?.white()?, white);
        let mut file = ideal()?;
        file.measurement.takes += 1;
        let mut changed = exact.through_rig(file)?;
        changed.begin_run("photo", &into("changed"))?;
        let said = fault(changed.white());
        assert!(said.contains("ideal.toml") && said.contains("not what the rig was opened by"), "{said}");
        Ok(())
    }

    #[test]
    fn calibrations_are_those_of_the_devices_and_scenes_have_none() -> Result<()> {
        let mut exact = corner(8, 8)?;
        let mut rig = exact.through_rig(ideal()?)?;
        let Some(ideal_devices) = rig.rig().map(|rig| rig.calibration.clone()) else { unreachable!() };
        let mut known = ideal_devices.clone();
        known.camera.black = 7.0;
        rig.set_calibration(known.clone())?;
        assert_eq!(rig.rig().map(|rig| &rig.calibration), Some(&known));
        let camera_info = CameraInfo { resolution: Resolution::new(9, 9), ..known.camera_info.clone() };
        let other = Calibration { camera_info, ..known };
        assert!(fault(rig.set_calibration(other)).contains("9x9"));
        assert!(fault(exact.set_calibration(ideal_devices)).contains("is no rig"));
        assert!(fault(exact.calibrate(&Default::default())).contains("is no rig"));
        Ok(())
    }

    #[test]
    fn what_has_no_scene_or_real_devices_is_refused() -> Result<()> {
        let matrix = crate::sparse::Csr::new(1, vec![0, 1], vec![0], vec![1.0])?;
        assert!(
            fault(Lab::builder_of_matrix(matrix, "one").open()?.through_rig(ideal()?)).contains("no scene")
        );
        let text = "kind = \"hardware\"\n[projector]\nkind = \"x11\"\nsize = [8, 8]\n[camera]\nkind = \"gige\"\naddress = \"192.168.1.20\"\nsize = [8, 8]\n";
        let real = RigFile::from_bytes(Path::new("real.toml"), text.as_bytes())?;
        assert!(matches!(real.kind, RigKind::Hardware(_)));
        let exact = corner(8, 8)?;
        assert!(fault(exact.through_rig(real)).contains("real.toml"));
        let settings =
            crate::lab::TraceOverrides { projector: Some(Resolution::new(4, 4)), ..Default::default() };
        let settings = Settings { trace: settings, ..Settings::default() };
        let apart =
            Lab::builder_of_scene(builtin::corner().to_scene()).settings(settings).size(8, 8).open()?;
        assert!(fault(apart.through_rig(ideal()?)).contains("--projector-size"));
        Ok(())
    }
}
