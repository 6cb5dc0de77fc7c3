//! The canvas: a source with a light transport matrix, for patterns that a user paints.

use serde::{Deserialize, Serialize};

use crate::analysis::planes::{self, Planes};
use crate::error::{Error, Result};
use crate::image::{Image, Resolution};
use crate::lab::{ExportedMatrix, Lab, LabOperator, SourceKind};
use crate::operator::{Adjoint, Operator, product};
use crate::sparse::Csr;
use crate::transport::Part;

/// The light that a photo shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Light {
    /// All light, including the ambient light.
    All,
    /// Light after one bounce.
    Direct,
    /// Light after two or more bounces.
    Global,
    /// Light after two bounces.
    Second,
    /// Light after three or more bounces.
    Later,
}

impl Light {
    /// The part of the matrix for this light; `None` for light that is no part, and is available only as a separate layer.
    pub(super) fn part(self) -> Option<Part> {
        match self {
            Self::All => Some(Part::Full),
            Self::Direct => Some(Part::Direct),
            Self::Global => Some(Part::Global),
            Self::Second | Self::Later => None,
        }
    }

    pub(super) fn holds(self, layer: Self) -> bool {
        match self {
            Self::All => true,
            Self::Global => layer != Self::Direct,
            one => one == layer,
        }
    }
}

/// An open laboratory with its operators. If the matrix is in memory, the canvas also has its columns.
pub struct Canvas<'a> {
    lab: &'a mut Lab,
    /// The sizes of patterns and of photos.
    sizes: [Resolution; 2],
    /// The layers of the matrix. Their sum is all light. The list is empty if the matrix is not in memory.
    layers: Vec<(Light, Columns)>,
    lights: Vec<Light>,
    ambient: Planes,
    operators: Vec<(Part, Vec<LabOperator>)>,
    /// The photo of a white pattern in all light, once it has been taken.
    white: Option<Planes>,
}

impl<'a> Canvas<'a> {
    /// Opens the light transport of a laboratory: traces a scene, reads a run, or connects to a rig.
    pub fn new(lab: &'a mut Lab) -> Result<Self> {
        lab.require_pictures("painting")?;
        let sizes = [lab.projector_resolution(), lab.resolution()];
        let layers = layers(lab)?;
        let lights = match (lab.kind(), layers.len()) {
            (_, 3..) => vec![Light::All, Light::Direct, Light::Global, Light::Second, Light::Later],
            (_, 1) | (SourceKind::Rig, _) => vec![Light::All],
            _ => vec![Light::All, Light::Direct, Light::Global],
        };
        let ambient = match lab.kind() {
            // A matrix holds no ambient light, and the photos of a rig do not contain it.
            SourceKind::Matrix | SourceKind::Rig => {
                vec![vec![0.0; sizes[1].pixels()]; lab.channels().count()]
            }
            _ => lab.ambient()?.planes(),
        };
        Ok(Self { lab, sizes, layers, lights, ambient, operators: Vec::new(), white: None })
    }

    /// The laboratory.
    pub fn lab(&mut self) -> &mut Lab {
        self.lab
    }

    /// The resolution of patterns.
    pub fn projector(&self) -> Resolution {
        self.sizes[0]
    }

    /// The resolution of photos.
    pub fn camera(&self) -> Resolution {
        self.sizes[1]
    }

    /// The number of planes of patterns and photos.
    pub fn channels(&self) -> usize {
        self.lab.channels().count()
    }

    /// The lights that can be shown. The first light is [`Light::All`].
    pub fn lights(&self) -> &[Light] {
        &self.lights
    }

    /// Whether patterns may be negative. They may for a matrix, since no projector has to show them.
    pub fn is_signed(&self) -> bool {
        self.lab.kind() == SourceKind::Matrix
    }

    /// Whether devices take the photos, so that each photo takes time.
    pub fn is_live(&self) -> bool {
        self.lab.kind() == SourceKind::Rig
    }

    /// The layers of the matrix in memory. Their sum is all light except the ambient light. The list is empty without such a matrix.
    pub(crate) fn layers(&self) -> &[(Light, Columns)] {
        &self.layers
    }

    /// The layers whose sum is this light, except the ambient light.
    fn layers_of(&self, light: Light) -> impl Iterator<Item = &Columns> {
        self.layers.iter().filter(move |(layer, _)| light.holds(*layer)).map(|(_, columns)| columns)
    }

    /// The ambient light, which is present without the projector. Only [`Light::All`] includes it.
    pub(super) fn ambient_of(&self, light: Light) -> Option<&Planes> {
        (light == Light::All).then_some(&self.ambient)
    }

    /// The photo of a pattern, one plane for each channel. It equals the photo of [`Lab::photo`] before that photo is rounded.
    ///
    /// # Errors
    /// [`Error::Dimension`] when the pattern does not have the projector's pixels or channels; the errors of [`Lab::operator`].
    pub fn photo(&mut self, light: Light, pattern: &Planes) -> Result<Planes> {
        Error::check_size("planes of the pattern", self.channels(), pattern.len())?;
        for plane in pattern {
            Error::check_size("pixels of the pattern", self.projector().pixels(), plane.len())?;
        }
        if self.is_live() {
            return Ok(self.lab.photo(&Image::from_planes(self.projector(), pattern)?)?.planes());
        }
        let photo = match light.part() {
            Some(part) => {
                let photo = |(of, pattern): (&mut LabOperator, &Vec<f64>)| product(of, pattern);
                self.operators(part)?.iter_mut().zip(pattern).map(photo).collect::<Result<Planes>>()?
            }
            None => {
                let mut photo = vec![vec![0.0; self.camera().pixels()]; self.channels()];
                for (channel, (photo, pattern)) in photo.iter_mut().zip(pattern).enumerate() {
                    self.layers_of(light).for_each(|columns| columns.multiply(channel, pattern, photo));
                }
                photo
            }
        };
        Ok(match self.ambient_of(light) {
            Some(ambient) => planes::sum(&photo, ambient),
            None => photo,
        })
    }

    /// The photo of a white pattern in all light. It is taken only once.
    pub(super) fn white(&mut self) -> Result<&Planes> {
        let white = match self.white.take() {
            Some(white) => white,
            None => {
                let pattern = vec![vec![1.0; self.projector().pixels()]; self.channels()];
                self.photo(Light::All, &pattern)?
            }
        };
        Ok(self.white.insert(white))
    }

    /// Adds the effect of a change of one projector pixel to a photo. Returns `false` if the columns of the matrix are not in memory.
    pub fn add_pixel(&self, light: Light, pixel: usize, change: &[f64], photo: &mut Planes) -> bool {
        for (channel, (photo, &change)) in photo.iter_mut().zip(change).enumerate() {
            self.layers_of(light).for_each(|columns| columns.add(channel, pixel, change, photo));
        }
        !self.layers.is_empty()
    }

    /// The number of changed pixels whose update takes about as long as a full product.
    pub fn pixels_of_a_product(&self) -> usize {
        // A single pixel takes more time than its share of a full product, which is parallel and reads its entries in order.
        if self.layers.is_empty() { 0 } else { self.projector().pixels() / 4 }
    }

    /// The light of one projector pixel at full brightness, without the ambient light. It is a column of the matrix.
    pub fn column(&mut self, light: Light, pixel: usize) -> Result<Planes> {
        let mut photo = vec![vec![0.0; self.camera().pixels()]; self.channels()];
        if self.add_pixel(light, pixel, &vec![1.0; self.channels()], &mut photo) {
            return Ok(photo);
        }
        let mut pattern = vec![vec![0.0; self.projector().pixels()]; self.channels()];
        pattern.iter_mut().for_each(|plane| plane[pixel] = 1.0);
        let photo = self.photo(light, &pattern)?;
        Ok(match self.ambient_of(light) {
            Some(ambient) => planes::difference(&photo, ambient),
            None => photo,
        })
    }

    /// The light from each projector pixel to one camera pixel: a row of the matrix, a dual photograph. `None` if the devices cannot be
    /// exchanged.
    pub fn row(&mut self, light: Light, pixel: usize) -> Result<Option<Planes>> {
        let projector = self.projector().pixels();
        if !self.layers.is_empty() {
            let mut pattern = vec![vec![0.0; projector]; self.channels()];
            for (channel, plane) in pattern.iter_mut().enumerate() {
                self.layers_of(light).for_each(|columns| columns.add_row(channel, pixel, plane));
            }
            return Ok(Some(pattern));
        }
        let (Some(part), false) = (light.part(), self.is_live()) else { return Ok(None) };
        let mut seen = vec![0.0; self.camera().pixels()];
        seen[pixel] = 1.0;
        let product = |operator: &mut LabOperator| {
            let mut pattern = vec![0.0; operator.cols()];
            operator.apply_adjoint(&seen, &mut pattern)?;
            Ok(pattern)
        };
        self.operators(part)?.iter_mut().map(product).collect::<Result<_>>().map(Some)
    }

    /// The operators of a part, one for each channel. Their products are not recorded, because a page requests many thousands of them.
    pub(super) fn operators(&mut self, part: Part) -> Result<&mut Vec<LabOperator>> {
        let at = match self.operators.iter().position(|(of, _)| *of == part) {
            Some(at) => at,
            None => {
                self.operators.push((part, self.lab.reference_operators(part)?));
                self.operators.len() - 1
            }
        };
        Ok(&mut self.operators[at].1)
    }
}

fn layers(lab: &mut Lab) -> Result<Vec<(Light, Columns)>> {
    let has_matrix = match lab.kind() {
        SourceKind::Scene => lab.assembled()?.is_some(),
        SourceKind::Matrix => true,
        SourceKind::Run | SourceKind::Rig => false,
    };
    if !has_matrix {
        return Ok(Vec::new());
    }
    // The nested vectors `[channel][layer]` become `[layer][channel]`.
    let by_layer = |lights: &[Light], matrices: Vec<Vec<ExportedMatrix>>| {
        let mut channels: Vec<_> = matrices.into_iter().map(Vec::into_iter).collect();
        let layer = |&light: &Light| {
            let of_channels = channels.iter_mut().filter_map(|layers| Some(layers.next()?.matrix));
            (light, Columns::new(of_channels.collect()))
        };
        lights.iter().map(layer).collect::<Vec<_>>()
    };
    let has_parts =
        lab.resolution() == lab.projector_resolution() || lab.matrices_of(Part::Direct)?.is_some();
    if lab.kind() == SourceKind::Scene && lab.settings().split_bounces {
        let lights = [Light::Direct, Light::Second, Light::Later];
        return Ok(by_layer(&lights, lab.matrices(Part::Full, true, None)?));
    }
    if lab.kind() == SourceKind::Matrix && !has_parts {
        return Ok(by_layer(&[Light::All], lab.matrices(Part::Full, false, None)?));
    }
    let mut found = by_layer(&[Light::Direct], lab.matrices(Part::Direct, false, None)?);
    found.extend(by_layer(&[Light::Global], lab.matrices(Part::Global, false, None)?));
    Ok(found)
}

/// The columns of a matrix, for each channel. Row `p` of these matrices is the light of projector pixel `p`.
#[derive(Clone, Debug)]
pub struct Columns {
    by_channel: Vec<Csr>,
}

impl Columns {
    /// The columns of these matrices, one matrix for each channel. A symmetric matrix is not transposed, since its rows equal its columns.
    pub(super) fn new(matrices: Vec<Csr>) -> Self {
        let columns = |matrix: Csr| if matrix.is_symmetric() { matrix } else { matrix.transposed() };
        Self { by_channel: matrices.into_iter().map(columns).collect() }
    }

    pub(super) fn channels(&self) -> &[Csr] {
        &self.by_channel
    }

    pub(super) fn nonzeros(&self) -> usize {
        self.by_channel.first().map_or(0, |matrix| matrix.weights().len())
    }

    pub(super) fn add(&self, channel: usize, pixel: usize, change: f64, photo: &mut [f64]) {
        let (places, values) = self.by_channel[channel].row(pixel);
        for (&place, &value) in places.iter().zip(values) {
            photo[place as usize] += change * value;
        }
    }

    pub(super) fn multiply(&self, channel: usize, pattern: &[f64], photo: &mut [f64]) {
        let lit = pattern.iter().enumerate().filter(|(_, value)| **value != 0.0);
        lit.for_each(|(pixel, &value)| self.add(channel, pixel, value, photo));
    }

    /// Adds a row of the matrix, the light from each projector pixel to one camera pixel, to `pattern`.
    fn add_row(&self, channel: usize, pixel: usize, pattern: &mut [f64]) {
        let matrix = &self.by_channel[channel];
        for (projector, found) in pattern.iter_mut().enumerate() {
            let (places, values) = matrix.row(projector);
            if let Ok(at) = places.binary_search(&(pixel as u32)) {
                *found += values[at];
            }
        }
    }
}
