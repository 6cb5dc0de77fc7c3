//! The results of one dispatch: the records of consecutive light paths, and the layout of these records.

use std::ops::Range;

use rayon::prelude::*;

/// The paths of a batch that start from one pixel and belong to the same half of its samples.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Run {
    /// The pixel of the camera or projector at which the paths start.
    pub pixel: u32,
    /// The half of the samples, 0 or 1. The halves are independent.
    pub half: usize,
    /// The indices of these paths within the batch.
    pub paths: Range<usize>,
}

/// A batch in a form that can be sent to another process.
#[derive(serde::Serialize, serde::Deserialize)]
pub(crate) struct Recorded {
    first_path: u64,
    layout: RecordLayout,
    #[serde(with = "as_bytes")]
    records: Vec<[u32; 4]>,
}

/// Serializes records as raw bytes. Serializing word by word would take an eighth more processor time for a photo that two processes trace.
mod as_bytes {
    use serde::{Deserialize, Deserializer, Serializer};

    pub(super) fn serialize<S: Serializer>(records: &[[u32; 4]], to: S) -> Result<S::Ok, S::Error> {
        to.serialize_bytes(bytemuck::cast_slice(records))
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<[u32; 4]>, D::Error> {
        Ok(bytemuck::pod_collect_to_vec(<&[u8]>::deserialize(from)?))
    }
}

impl Recorded {
    pub(crate) fn batch(&self) -> Batch<'_> {
        Batch::new(self.first_path, self.layout, &self.records)
    }
}

/// Records of consecutive paths from one endpoint of the rig.
///
/// Paths are numbered `pixel · samples + sample`. Batches arrive in the order of these numbers, without gaps. If the projector stands apart
/// from the camera, the batches of the projector's paths follow the batches of the camera's paths.
pub struct Batch<'a> {
    first_path: u64,
    layout: RecordLayout,
    paths: usize,
    records: &'a [[u32; 4]],
}

impl<'a> Batch<'a> {
    pub(crate) fn new(first_path: u64, layout: RecordLayout, records: &'a [[u32; 4]]) -> Self {
        Self { first_path, layout, paths: records.len() / layout.stride(), records }
    }

    pub(crate) fn recorded(&self) -> Recorded {
        Recorded { first_path: self.first_path, layout: self.layout, records: self.records.to_vec() }
    }

    /// Number of paths.
    pub fn len(&self) -> usize {
        self.paths
    }

    /// Whether there are no paths.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// All paths in order, grouped by pixel and half.
    pub fn runs(&self) -> impl Iterator<Item = Run> + '_ {
        let samples = u64::from(self.layout.samples);
        // Both numbers fit their types: there are at most 2²⁰ samples, and pixels have 28 bits.
        let (mut pixel, mut sample) =
            ((self.first_path / samples) as u32, (self.first_path % samples) as usize);
        let (samples, halfway) = (samples as usize, samples.div_ceil(2) as usize);
        let mut begin = 0;
        std::iter::from_fn(move || {
            let half = usize::from(sample >= halfway);
            let left = if half == 0 { halfway } else { samples } - sample;
            let paths = begin..self.len().min(begin + left);
            let run = Run { pixel, half, paths };
            begin = run.paths.end;
            sample += left;
            if sample == samples {
                (pixel, sample) = (pixel + 1, 0);
            }
            (!run.paths.is_empty()).then_some(run)
        })
    }

    /// The pixel of the camera or projector at which path `index` of the batch starts.
    pub fn pixel(&self, index: usize) -> u32 {
        ((self.first_path + index as u64) / u64::from(self.layout.samples)) as u32
    }

    /// Whether each connection counts for `A_ji` and for its mirror image `A_ij`. This is true for a coaxial rig. If the projector stands
    /// apart, paths are traced from both endpoints instead.
    pub fn symmetric(&self) -> bool {
        self.layout.symmetric
    }

    /// Whether the paths start at the camera. Otherwise they start at a projector that stands apart.
    pub fn from_camera(&self) -> bool {
        self.layout.from_camera
    }

    /// The number of slots of each path's record. It is an upper bound of the path's contributions.
    pub(crate) fn stride(&self) -> usize {
        self.layout.stride()
    }

    /// Number of paths that start from each pixel.
    pub fn samples(&self) -> u32 {
        self.layout.samples
    }

    /// The sample of `A_jj` by path `index`: direct light that returns along its own path, possibly through mirrors and glass. It is zero
    /// if the ray hit nothing, in rigs with lenses, and in rigs with a projector that stands apart.
    pub fn direct(&self, index: usize) -> [f32; 3] {
        value(self.slot(index, 0))
    }

    /// Whether the paths record light that the scene emits.
    pub fn has_ambient(&self) -> bool {
        self.layout.ambient
    }

    /// The light that the scene itself emits towards path `index`, in W/(m² sr). It is `None` for scenes without emission, and for paths
    /// from the projector.
    pub fn ambient(&self, index: usize) -> Option<[f32; 3]> {
        self.layout.ambient.then(|| value(self.slot(index, self.layout.stride() - 1)))
    }

    /// The connections of path `index`, by increasing bounces.
    pub fn connections(&self, index: usize) -> impl Iterator<Item = Connection> + '_ {
        let (pixel, from_camera) = (self.pixel(index), self.layout.from_camera);
        self.ends(index).filter(|end| end.is_seen).map(move |end| {
            let (camera, projector) = if from_camera { (pixel, end.pixel) } else { (end.pixel, pixel) };
            Connection { camera, projector, bounces: end.bounces, value: end.value }
        })
    }

    /// The far ends of the connections of path `index`, including those outside the field of view.
    pub(crate) fn ends(&self, index: usize) -> impl Iterator<Item = End> + '_ {
        let layout = self.layout;
        let surfaces = self.slot(index, 0)[0] & 0xff;
        let last_gathered = if layout.gathers { surfaces } else { 1 };
        let connected = (1 + u32::from(layout.direct)..surfaces + 1)
            .map(move |k| (k, self.slot(index, layout.connected(k))));
        let gathered = (2..last_gathered + 1).map(move |k| (k, self.slot(index, layout.gathered(k))));
        connected.chain(gathered).map(|(k, slot)| End::new(k, slot))
    }

    pub(crate) fn rays(&self, index: usize) -> u64 {
        rays(self.slot(index, 0))
    }

    /// The number of paths whose records do not carry `mark`, because the device never finished them; and the number of rays of all paths.
    pub(super) fn unfinished_and_rays(&self, mark: u32) -> (u64, u64) {
        let count = |heads: &[[u32; 4]]| {
            heads.iter().fold((0, 0), |(unfinished, sum), head| {
                (unfinished + u64::from(head[0] >> 16 != mark >> 16), sum + rays(*head))
            })
        };
        let add = |a: (u64, u64), b: (u64, u64)| (a.0 + b.0, a.1 + b.1);
        self.records[..self.paths].par_chunks(8192).map(count).reduce(|| (0, 0), add)
    }

    fn slot(&self, index: usize, slot: usize) -> [u32; 4] {
        debug_assert!(index < self.paths);
        self.records[slot * self.paths + index]
    }
}

/// A path's connection from its `k`-th surface to the other endpoint of the rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Connection {
    /// The camera pixel `j`, at which the light arrives.
    pub camera: u32,
    /// The projector pixel `i`, from which the light comes.
    pub projector: u32,
    /// Number of surfaces on the path, `k`.
    pub bounces: u32,
    /// The weighted estimate `a · F/(p_f + p_r)` per channel, where `F` is the path's contribution, `p_f` and `p_r` are its densities from
    /// either endpoint (balance heuristic), and `a` is the area of a camera pixel on the image plane. It contributes to `A_ji`, and in a
    /// coaxial rig also to `A_ij`. It is not yet divided by the number of samples.
    pub value: [f32; 3],
}

/// The slots in the record of a path.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct RecordLayout {
    pub(crate) samples: u32,
    pub(crate) max_bounces: u32,
    /// The connection from the first surface is the direct light, and is stored in the head of the record instead of a slot.
    pub(crate) direct: bool,
    /// The record has gathered connections, which reach the other endpoint along the specular chains of photons.
    pub(crate) gathers: bool,
    pub(crate) ambient: bool,
    /// The rig is coaxial: camera and projector are one lens.
    pub(crate) symmetric: bool,
    pub(crate) from_camera: bool,
}

impl RecordLayout {
    /// The number of slots of a path: head, connections, gathered connections, ambient light. The records of a batch hold the first slots
    /// of all paths, then their second slots, and so on.
    pub(crate) fn stride(&self) -> usize {
        self.gathered(2)
            + if self.gathers { self.max_bounces as usize - 1 } else { 0 }
            + usize::from(self.ambient)
    }

    /// The maximum number of contributions of a path.
    pub(crate) fn most_ends(&self) -> usize {
        self.stride() - 1 - usize::from(self.ambient)
    }

    /// The slot of the connection from the `k`-th surface.
    fn connected(&self, k: u32) -> usize {
        k as usize - usize::from(self.direct)
    }

    /// The slot of the gathered connection from the `k`-th surface, `k ≥ 2`.
    pub(crate) fn gathered(&self, k: u32) -> usize {
        self.connected(self.max_bounces + 1) + k as usize - 2
    }
}

/// The far end of a connection, decoded from the record of its path.
pub(crate) struct End {
    /// Whether the connection exists. If not, the other members have no meaning.
    pub(crate) is_seen: bool,
    pub(crate) pixel: u32,
    /// The same value as in [`Connection`].
    pub(crate) bounces: u32,
    /// The same value as in [`Connection`].
    pub(crate) value: [f32; 3],
}

impl End {
    pub(super) fn new(k: u32, slot: [u32; 4]) -> Self {
        Self {
            is_seen: slot[0] != crate::render::materials::NONE,
            pixel: slot[0] & PIXEL_MASK,
            bounces: k + (slot[0] >> PIXEL_BITS),
            value: value(slot),
        }
    }
}

/// The number of bits of a word that hold a pixel. The other bits hold the number of surfaces of the far specular chain.
const PIXEL_BITS: u32 = 28;
pub(crate) const PIXEL_MASK: u32 = (1 << PIXEL_BITS) - 1;

pub(crate) fn rays(head: [u32; 4]) -> u64 {
    u64::from(head[0] >> 8 & 0xff)
}

pub(super) fn value(slot: [u32; 4]) -> [f32; 3] {
    [f32::from_bits(slot[1]), f32::from_bits(slot[2]), f32::from_bits(slot[3])]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A batch of paths of at most three surfaces, with ambient light.
    pub(crate) fn batch(records: &[[u32; 4]]) -> Batch<'_> {
        let layout = RecordLayout {
            samples: 4,
            max_bounces: 3,
            direct: true,
            gathers: false,
            ambient: true,
            symmetric: true,
            from_camera: true,
        };
        Batch::new(7, layout, records)
    }

    const MARK: u32 = 5 << 16;
    const ONE: u32 = 0x3f80_0000;
    const LEFT_OVER: [u32; 4] = [9, ONE, ONE, ONE];

    fn records() -> [[u32; 4]; 8] {
        [
            // The first path has four rays and two surfaces; the second has five rays and three surfaces.
            [MARK | 4 << 8 | 2, ONE, 0, 0],
            [MARK | 5 << 8 | 3, 0, 0, 0],
            // The connections from the second surfaces. The second path's connection is outside the field of view.
            [6, 0, ONE, 0],
            [crate::render::materials::NONE, 0, 0, 0],
            // The connections from the third surfaces: only the second path has one.
            LEFT_OVER,
            [2, ONE, ONE, ONE],
            // Ambient light.
            [MARK, 0, 0, ONE],
            [MARK, 0, 0, 0],
        ]
    }

    #[test]
    fn a_record_reads_back_as_it_was_written() {
        let records = records();
        let batch = batch(&records);
        assert_eq!((batch.len(), batch.pixel(0), batch.pixel(1)), (2, 1, 2));
        assert_eq!((batch.direct(0), batch.ambient(0)), ([1.0, 0.0, 0.0], Some([0.0, 0.0, 1.0])));
        let connections = |path| batch.connections(path).collect::<Vec<_>>();
        assert_eq!(
            connections(0),
            [Connection { camera: 1, projector: 6, bounces: 2, value: [0.0, 1.0, 0.0] }]
        );
        assert_eq!(connections(1), [Connection { camera: 2, projector: 2, bounces: 3, value: [1.0; 3] }]);
        assert_eq!(batch.unfinished_and_rays(MARK), (0, 9));
    }

    #[test]
    fn runs_do_not_cross_pixels_or_halves_of_the_samples() {
        let runs = |first_path, samples, paths: usize| {
            let records = vec![[0; 4]; 4 * paths];
            let batch = batch(&records);
            let batch = Batch::new(first_path, RecordLayout { samples, ..batch.layout }, &records);
            let halves = |path: usize| {
                let at = first_path + path as u64;
                (
                    (at / u64::from(samples)) as u32,
                    usize::from(2 * (at % u64::from(samples)) >= u64::from(samples)),
                )
            };
            let mut next = 0;
            for Run { pixel, half, paths } in batch.runs() {
                assert_eq!(paths.start, next);
                next = paths.end;
                assert!(paths.clone().all(|path| halves(path) == (pixel, half)), "{first_path}, {samples}");
                assert!(next == batch.len() || halves(next) != (pixel, half), "{first_path}, {samples}");
            }
            assert_eq!(next, paths);
        };
        for samples in 1..6 {
            for first_path in 0..12 {
                (0..14).for_each(|paths| runs(first_path, samples, paths));
            }
        }
    }

    #[test]
    fn a_path_without_the_dispatchs_mark_is_unfinished() {
        let mut records = records();
        assert_eq!(batch(&records).unfinished_and_rays(MARK).0, 0);
        // The record carries the mark of an earlier dispatch.
        records[1][0] = 4 << 16 | 5 << 8 | 3;
        assert_eq!(batch(&records).unfinished_and_rays(MARK).0, 1);
        records[0][0] = 0;
        assert_eq!(batch(&records).unfinished_and_rays(MARK).0, 2);
    }
}
