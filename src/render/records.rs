//! The layout of light paths' records.

/// A path's connection from its `k`-th surface to the other end of the rig.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Connection {
    /// Camera pixel `j`, in which the light arrives.
    pub camera: u32,
    /// Projector pixel `i`, from which the light comes.
    pub projector: u32,
    /// Number of surfaces on the path, `k`.
    pub bounces: u32,
    /// The weighted estimate `a · F/(p_f + p_r)` per channel (balance heuristic; `a` is the area of a camera
    /// pixel on the image plane): the contribution to `A_ji`, and in a coaxial rig also to `A_ij`. It is not
    /// yet divided by the number of samples.
    pub value: [f32; 3],
}

/// Which slots the record of a path has.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(super) struct Layout {
    /// Paths per pixel.
    pub(super) samples: u32,
    /// The most surfaces of a path.
    pub(super) max_bounces: u32,
    /// The connection from the first surface is the direct light, which is stored in the head instead of a
    /// slot.
    pub(super) direct: bool,
    /// There are gathered connections, through specular chains of the other endpoint.
    pub(super) gathers: bool,
    /// There is a slot for ambient light.
    pub(super) ambient: bool,
    /// The rig is coaxial: camera and projector are one lens.
    pub(super) symmetric: bool,
    /// The paths start at the camera.
    pub(super) from_camera: bool,
}

impl Layout {
    /// Number of slots of a path: head, connections, gathered connections, ambient light. The records of a
    /// batch hold the first slots of all paths, then their second slots, and so on.
    pub(super) fn stride(&self) -> usize {
        self.gathered(2)
            + if self.gathers { self.max_bounces as usize - 1 } else { 0 }
            + usize::from(self.ambient)
    }

    /// The most connections of a path.
    pub(super) fn most_ends(&self) -> usize {
        self.stride() - 1 - usize::from(self.ambient)
    }

    /// The slot of the connection from the `k`-th surface.
    pub(super) fn connected(&self, k: u32) -> usize {
        k as usize - usize::from(self.direct)
    }

    /// The slot of the gathered connection from the `k`-th surface, `k ≥ 2`.
    pub(super) fn gathered(&self, k: u32) -> usize {
        self.connected(self.max_bounces + 1) + k as usize - 2
    }
}

/// The far end of a connection, as the record of its path holds it.
pub(crate) struct End {
    /// The connection exists. Otherwise the other members have no meaning.
    pub(crate) is_seen: bool,
    /// The pixel of the other endpoint.
    pub(crate) pixel: u32,
    /// As in [`Connection`].
    pub(crate) bounces: u32,
    /// As in [`Connection`].
    pub(crate) value: [f32; 3],
}

impl End {
    /// Reads the slot of the connection from the `k`-th surface.
    pub(super) fn new(k: u32, slot: [u32; 4]) -> Self {
        Self {
            is_seen: slot[0] != super::materials::NONE,
            pixel: slot[0] & PIXEL_MASK,
            bounces: k + (slot[0] >> PIXEL_BITS),
            value: value(slot),
        }
    }
}

/// Bits of a word that hold a pixel. The other bits hold the number of surfaces of the far chain.
const PIXEL_BITS: u32 = 28;
/// Masks those bits.
pub(crate) const PIXEL_MASK: u32 = (1 << PIXEL_BITS) - 1;

/// Number of rays traced for a path, from the head of its record.
pub(super) fn rays(head: [u32; 4]) -> u64 {
    u64::from(head[0] >> 8 & 0xff)
}

/// The light in a slot, in RGB.
pub(super) fn value(slot: [u32; 4]) -> [f32; 3] {
    [f32::from_bits(slot[1]), f32::from_bits(slot[2]), f32::from_bits(slot[3])]
}
