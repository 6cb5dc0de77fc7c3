//! The light transport matrix, traced or photographed column by column.

use crate::analysis::brute_force;
use crate::analysis::plan::Twin;
use crate::analysis::probe::epipolar_lines_of_map;
use crate::error::{Error, Result};
use crate::io::sparse::ProductNoise;
use crate::lab::notes::Kind;
use crate::lab::source::Source;
use crate::lab::{Lab, LabOperator, SourceKind, lock, transport};
use crate::scene::epipolar_lines;
use crate::sparse::Csr;
use crate::transport::{Assembled, Bounces, Part};

impl Lab {
    /// The light transport matrix of every channel, `[channel]`, each with a name for its file. The matrix of a scene is traced, and the
    /// matrix of a rig is photographed column by column. With `split_bounces`, three matrices replace the matrix of `part`: the first
    /// bounce, the second bounce, and all later bounces. The laboratory must then have been opened with
    /// [`split_bounces`](crate::lab::Settings::split_bounces). `photos` is the number of photos that a rig may take; the default is 4096.
    ///
    /// # Errors
    /// [`Error::Option`] for a request that the source does not support; the errors of [`Lab::operator`].
    pub fn matrices(
        &mut self,
        part: Part,
        split_bounces: bool,
        photos: Option<usize>,
    ) -> Result<Vec<Vec<ExportedMatrix>>> {
        if self.run.is_none() {
            self.warn_of_darkness();
        }
        if matches!(self.kind(), SourceKind::Scene | SourceKind::Matrix) {
            return self.matrices_in_memory(part, split_bounces, photos);
        }
        if split_bounces {
            let fault = "a photo does not tell how often its light has bounced";
            return Err(Error::option("--split-bounces", fault)
                .help("give --part direct or --part global, which are told apart by shifted patterns"));
        }
        let resolution = self.projector_resolution();
        brute_force::check_photos(resolution, self.channels(), photos)?;
        let operators = self.operators(part)?;
        self.expect(resolution.pixels());
        let columns = |mut operator: LabOperator| {
            let matrix = brute_force::columns(&mut operator)?;
            Ok(vec![ExportedMatrix { suffix: "", matrix, direct: None, noise: None }])
        };
        self.photos(|_| operators.into_iter().map(columns).collect())
    }

    fn matrices_in_memory(
        &mut self,
        part: Part,
        split_bounces: bool,
        photos: Option<usize>,
    ) -> Result<Vec<Vec<ExportedMatrix>>> {
        if photos.is_some() {
            return Err(Error::option("--photos", "a scene's matrix is traced, not photographed")
                .help("leave it out; --spp says how many light paths are traced"));
        }
        let count = self.channels().count();
        if !split_bounces {
            if let Some(traced) = self.assembled()? {
                return (0..count).map(|at| Ok(vec![ExportedMatrix::of(&traced, part, at)?])).collect();
            }
            let direct = if part == Part::Full { self.matrices_of(Part::Direct)? } else { None };
            let noise = lock(self.transport()?).noise()?.filter(|_| part == Part::Full);
            let mut direct = direct.unwrap_or_default().into_iter();
            let exported = |channel| -> Result<_> {
                let matrix = self.matrix(part, channel)?;
                Ok(vec![ExportedMatrix { suffix: "", matrix, direct: direct.next(), noise }])
            };
            return (0..count).map(exported).collect();
        }
        let Some(traced) = self.assembled()? else {
            return Err(Error::option("--split-bounces", "the bounces of this matrix are not known")
                .help("leave it out, or give a scene"));
        };
        bounces_apart(&traced)
    }

    /// One part of the matrix, `[channel]`. Returns `None` if there is no matrix in memory, or if it does not hold its direct light
    /// separately.
    pub(crate) fn matrices_of(&mut self, part: Part) -> Result<Option<Vec<Csr>>> {
        if let Source::Matrix(source) = &self.source {
            let is_known = part == Part::Full || source.has_direct();
            let channels = 0..source.channels();
            return is_known
                .then(|| channels.map(|channel| source.part(part, channel)).collect())
                .transpose();
        }
        if let Source::Model(source) = &self.source {
            // A model knows the rows of its direct light alone.
            let direct = source.model.channels.iter().map(|channel| channel.direct_matrix().cloned());
            return Ok(if part == Part::Direct { direct.collect() } else { None });
        }
        let Some(traced) = self.assembled()? else { return Ok(None) };
        let channels = 0..traced.matrix.channels().count();
        channels.map(|channel| traced.matrix.to_csr(part, channel)).collect::<Result<_>>().map(Some)
    }
}

impl Lab {
    /// The map from camera to projector of each channel, if photos and patterns have different sizes and a matrix is in memory; otherwise
    /// empty. A row is the mean over the camera pixels that a projector pixel lights directly. If the direct light is not known, all light
    /// takes its place.
    pub(crate) fn maps_to_projector(&mut self) -> Result<Vec<Csr>> {
        if self.resolution() == self.projector_resolution() {
            return Ok(Vec::new());
        }
        Ok(self.direct_or_all()?.iter().map(map_to_projector).collect())
    }

    fn direct_or_all(&mut self) -> Result<Vec<Csr>> {
        match self.matrices_of(Part::Direct)? {
            Some(direct) => Ok(direct),
            None => Ok(self.matrices_of(Part::Full)?.unwrap_or_default()),
        }
    }

    /// The projector pixel that lights each camera pixel most; `None` if it is the pixel at the same place. The photos of a calibrated rig
    /// are seen at the projector's pixels. In front of the devices of another virtual rig, the traced scene tells.
    ///
    /// # Errors
    /// [`Error::Option`] if no matrix is in memory.
    pub(crate) fn homes(&mut self) -> Result<Option<Vec<Option<usize>>>> {
        let is_apart = match &self.source {
            Source::Scene(scene) => scene.scene.projector.is_some(),
            Source::Rig(rig) => !rig.is_calibrated && !rig.is_symmetric(),
            Source::Run(run) => run.note.kind == Kind::Scene && !run.note.symmetric,
            Source::Matrix(matrix) => matrix.has_direct() && matrix.direct_diagonal().is_none(),
            Source::Model(source) => {
                source.model.channels.iter().any(|channel| channel.direct_matrix().is_some())
            }
        };
        if !is_apart && self.resolution() == self.projector_resolution() {
            return Ok(None);
        }
        let direct = match &self.source {
            Source::Rig(rig) => match rig.twin()? {
                Twin::Traced(traced) => vec![traced.matrix.to_csr(Part::Direct, 0)?],
                Twin::Explicit(_) => Vec::new(),
            },
            _ => self.direct_or_all()?,
        };
        let Some(direct) = direct.first() else {
            let fault = "photos and patterns have different pixels, and without a matrix the map between them is not known";
            return Err(Error::option("--operator", fault).help("use --operator replay, or give the scene"));
        };
        let light = map_to_projector(direct).transposed();
        let home = |row: usize| {
            let (columns, weights) = light.row(row);
            let brightest = columns.iter().zip(weights).max_by(|a, b| a.1.total_cmp(b.1))?;
            (*brightest.1 > 0.0).then_some(*brightest.0 as usize)
        };
        Ok(Some((0..light.rows()).map(home).collect()))
    }

    /// The number of the epipolar line of each camera pixel and of each projector pixel, by the poses of the devices, or else by the map
    /// between their pictures.
    ///
    /// # Errors
    /// [`Error::Option`] naming `--mask` if the rig is coaxial, or if neither the poses nor the map tell the lines.
    pub(crate) fn epipolar_lines(&mut self) -> Result<[Vec<Option<u32>>; 2]> {
        if let Some(lines) = self.epipolar_lines_of_poses()? {
            return Ok(lines);
        }
        let sizes = [self.resolution(), self.projector_resolution()];
        match self.homes()? {
            Some(homes) => epipolar_lines_of_map(&homes, sizes),
            None => {
                let fault = format!(
                    "epipolar lines need the poses of camera and projector, or a map between their pictures, which {} does not have",
                    self.name()
                );
                Err(Error::option("--mask", fault).help("give the scene, or a mask's weights in a file"))
            }
        }
    }

    /// The epipolar lines, if the poses of the devices are known. Fails as [`Self::epipolar_lines`] for a coaxial rig.
    pub(crate) fn epipolar_lines_of_poses(&self) -> Result<Option<[Vec<Option<u32>>; 2]>> {
        let Ok(source) = self.scene_source() else { return Ok(None) };
        let (camera, projector) = (&source.scene.camera, source.scene.projector.as_ref());
        let sizes = [self.resolution(), self.projector_resolution()];
        let lines = projector.and_then(|projector| epipolar_lines(camera, projector, sizes));
        match (lines, &self.source) {
            (None, _) => {
                let fault =
                    "a coaxial rig has no epipolar lines: the line of every projector pixel is a point";
                let help = "give a scene whose projector stands apart, or another mask";
                Err(Error::option("--mask", fault).help(help))
            }
            (Some([_, lit]), Source::Rig(rig)) if rig.is_calibrated => Ok(Some([lit.clone(), lit])),
            (Some(lines), _) => Ok(Some(lines)),
        }
    }
}

/// Each row is the mean over the camera pixels that a projector pixel lights by `light`.
fn map_to_projector(light: &Csr) -> Csr {
    light.transposed().with_row_sums_of_one()
}

/// A matrix for a file.
#[derive(Clone, Debug)]
pub struct ExportedMatrix {
    /// The text that is added to the name of the file.
    pub suffix: &'static str,
    /// The matrix.
    pub matrix: Csr,
    /// Its light of one bounce, if that is known.
    pub direct: Option<Csr>,
    /// Its noise, if that is known.
    pub noise: Option<ProductNoise>,
}

impl ExportedMatrix {
    pub(super) fn of(traced: &Assembled, part: Part, channel: usize) -> Result<Self> {
        let matrix = traced.matrix.to_csr(part, channel)?;
        let direct = match part {
            Part::Full => traced.matrix.to_csr(Part::Direct, channel)?,
            Part::Direct => matrix.clone(),
            Part::Global => without_entries(&matrix)?,
        };
        let noise = transport::product_noise(traced).map(|of| match part {
            Part::Full => of,
            Part::Direct => ProductNoise { full: of.direct, direct: of.direct, global: 0.0 },
            Part::Global => ProductNoise { full: of.global, direct: 0.0, global: of.global },
        });
        Ok(Self { suffix: "", matrix, direct: Some(direct), noise })
    }
}

fn without_entries(matrix: &Csr) -> Result<Csr> {
    Csr::new(matrix.cols(), vec![0; matrix.rows() + 1], Vec::new(), Vec::new())
}

/// Separate matrices of the first bounce, the second bounce and all later bounces, `[channel]`.
pub(super) fn bounces_apart(traced: &Assembled) -> Result<Vec<Vec<ExportedMatrix>>> {
    let later = |suffix, matrix: Csr| {
        let direct = Some(without_entries(&matrix)?);
        Ok(ExportedMatrix { suffix, matrix, direct, noise: None })
    };
    let channel = |channel| {
        let direct = ExportedMatrix::of(traced, Part::Direct, channel)?;
        let mut matrices = vec![ExportedMatrix { suffix: "_direct", ..direct }];
        for layer in &*traced.matrix.layers()? {
            match layer.bounces() {
                // The direct part already contains the first bounce.
                Bounces::One => {}
                Bounces::Two => matrices.push(later("_second", layer.to_csr(channel)?)?),
                Bounces::Rest | Bounces::Global => matrices.push(later("_rest", layer.to_csr(channel)?)?),
            }
        }
        Ok(matrices)
    };
    (0..traced.matrix.channels().count()).map(channel).collect()
}
