//! What one dispatch hands back: the records of a run of light paths.

use rayon::prelude::*;

/// A path's connection from its `k`-th surface to the other end of the rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Connection {
    /// Camera pixel `j`, through which the light left.
    pub camera: u32,
    /// Projector pixel `i`, through which the light came.
    pub projector: u32,
    /// Number of surfaces on the way, `k`.
    pub bounces: u32,
    /// `a · F/(p_f + p_r)` per channel: contribution to `A_ji`, and to `A_ij` where the rig is coaxial, before the division
    /// by the sample count.
    pub value: [f32; 3],
}

/// What the records of a path hold.
#[derive(Clone, Copy, Debug)]
pub(super) struct Layout {
    /// Paths per pixel.
    pub(super) samples: u32,
    /// Surfaces of a path at most.
    pub(super) max_bounces: u32,
    /// The first surface's connection is the direct light, which is kept apart.
    pub(super) direct: bool,
    /// There are connections through specular chains.
    pub(super) gathers: bool,
    /// There is ambient light.
    pub(super) ambient: bool,
    /// Camera and projector are one.
    pub(super) symmetric: bool,
    /// The paths start at the camera.
    pub(super) from_camera: bool,
}

impl Layout {
    /// Slots of a path: head, connections, connections through chains, ambient light.
    pub(super) fn stride(&self) -> usize {
        self.gathered(2)
            + if self.gathers { self.max_bounces as usize - 1 } else { 0 }
            + usize::from(self.ambient)
    }

    /// The slot of the connection from the `k`-th surface.
    fn connected(&self, k: u32) -> usize {
        k as usize - usize::from(self.direct)
    }

    /// The slot of the connection through a chain from the `k`-th surface, `k ≥ 2`.
    fn gathered(&self, k: u32) -> usize {
        self.connected(self.max_bounces + 1) + k as usize - 2
    }
}

/// Records of consecutive paths from one end of the rig. Paths are numbered `pixel · samples + sample`; batches come in that
/// order, without gaps; those of the projector, where it stands apart, after those of the camera.
pub struct Batch<'a> {
    pub(super) first_path: u64,
    pub(super) layout: Layout,
    pub(super) records: &'a [[u32; 4]],
}

impl Batch<'_> {
    /// Number of paths.
    pub fn len(&self) -> usize {
        self.records.len() / self.layout.stride()
    }

    /// Whether there are no paths.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Pixel of the batch's path `index`, in the camera or the projector: where the path starts.
    pub fn pixel(&self, index: usize) -> u32 {
        ((self.first_path + index as u64) / u64::from(self.layout.samples)) as u32
    }

    /// Whether each connection stands for its mirror image, too: `A_ji` and `A_ij`. So for a coaxial rig; one whose
    /// projector stands apart has its paths traced from both ends instead.
    pub fn symmetric(&self) -> bool {
        self.layout.symmetric
    }

    /// Paths from each pixel.
    pub fn samples(&self) -> u32 {
        self.layout.samples
    }

    /// Which of two independent halves of the samples path `index` belongs to, 0 or 1.
    pub fn half(&self, index: usize) -> usize {
        let samples = u64::from(self.layout.samples);
        let sample = (self.first_path + index as u64) % samples;
        usize::from(2 * sample >= samples)
    }

    /// Light of path `index` that came back the way it went, its sample of `A_jj`: direct light, in mirrors and through
    /// glass as well. Zero where the ray met nothing, and in rigs with lenses or a projector apart.
    pub fn direct(&self, index: usize) -> [f32; 3] {
        value(self.slots(index)[0])
    }

    /// Light of the scene's own that path `index` saw, in W/(m² sr); `None` where nothing emits, and for paths from the
    /// projector.
    pub fn ambient(&self, index: usize) -> Option<[f32; 3]> {
        self.layout.ambient.then(|| value(self.slots(index)[self.layout.stride() - 1]))
    }

    /// The connections of path `index`, by increasing bounces.
    pub fn connections(&self, index: usize) -> impl Iterator<Item = Connection> + '_ {
        let layout = self.layout;
        let start = self.pixel(index);
        let slots = self.slots(index);
        let surfaces = slots[0][0] & 0xff;
        let connected =
            (1 + u32::from(layout.direct)..=surfaces).map(move |k| (k, slots[layout.connected(k)]));
        let last_gathered = if layout.gathers { surfaces } else { 1 };
        let gathered = (2..=last_gathered).map(move |k| (k, slots[layout.gathered(k)]));
        connected.chain(gathered).filter(|(_, slot)| slot[0] != super::materials::NONE).map(
            move |(k, slot)| {
                let end = slot[0] & PIXEL;
                let (camera, projector) = if layout.from_camera { (start, end) } else { (end, start) };
                Connection { camera, projector, bounces: k + (slot[0] >> PIXEL_BITS), value: value(slot) }
            },
        )
    }

    /// Rays traced along path `index`.
    pub(super) fn rays(&self, index: usize) -> u64 {
        u64::from(self.slots(index)[0][0] >> 8 & 0xff)
    }

    /// Paths whose record does not carry `mark`, so that the device never finished them; and the rays that all of them took.
    pub(super) fn census(&self, mark: u32) -> (u64, u64) {
        let of_path = |index| {
            let is_lost = self.slots(index)[0][0] >> 16 != mark >> 16;
            (u64::from(is_lost), self.rays(index))
        };
        let add = |a: (u64, u64), b: (u64, u64)| (a.0 + b.0, a.1 + b.1);
        (0..self.len()).into_par_iter().with_min_len(4096).map(of_path).reduce(|| (0, 0), add)
    }

    fn slots(&self, index: usize) -> &[[u32; 4]] {
        let stride = self.layout.stride();
        &self.records[index * stride..(index + 1) * stride]
    }
}

/// A connection's pixel, below the number of its chain's surfaces.
const PIXEL_BITS: u32 = 28;
const PIXEL: u32 = (1 << PIXEL_BITS) - 1;

fn value(slot: [u32; 4]) -> [f32; 3] {
    [f32::from_bits(slot[1]), f32::from_bits(slot[2]), f32::from_bits(slot[3])]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two paths of at most three surfaces, with ambient light.
    fn batch(records: &[[u32; 4]]) -> Batch<'_> {
        let layout = Layout {
            samples: 4,
            max_bounces: 3,
            direct: true,
            gathers: false,
            ambient: true,
            symmetric: true,
            from_camera: true,
        };
        Batch { first_path: 7, layout, records }
    }

    const MARK: u32 = 5 << 16;
    const ONE: u32 = 0x3f80_0000;
    const LEFT_OVER: [u32; 4] = [9, ONE, ONE, ONE];

    fn records() -> [[u32; 4]; 8] {
        [
            // Four rays, two surfaces; then the connection from the second, a slot not reached, and ambient light.
            [MARK | 4 << 8 | 2, ONE, 0, 0],
            [6, 0, ONE, 0],
            LEFT_OVER,
            [MARK, 0, 0, ONE],
            // Three surfaces, of which the second sees no pixel.
            [MARK | 5 << 8 | 3, 0, 0, 0],
            [crate::render::materials::NONE, 0, 0, 0],
            [2, ONE, ONE, ONE],
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
        assert_eq!(batch.census(MARK), (0, 9));
    }

    #[test]
    fn a_path_without_this_dispatchs_mark_is_unfinished() {
        let mut records = records();
        assert_eq!(batch(&records).census(MARK).0, 0);
        // What an earlier dispatch left there.
        records[4][0] = 4 << 16 | 5 << 8 | 3;
        assert_eq!(batch(&records).census(MARK).0, 1);
        records[0][0] = 0;
        assert_eq!(batch(&records).census(MARK).0, 2);
    }
}
