//! What is written in the records of light paths, and where.

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
    /// Slots of a path: head, connections, connections through chains, ambient light. In a batch's records the first slots of all its
    /// paths come first, then their second ones, and so on.
    pub(super) fn stride(&self) -> usize {
        self.gathered(2)
            + if self.gathers { self.max_bounces as usize - 1 } else { 0 }
            + usize::from(self.ambient)
    }

    /// The slot of the connection from the `k`-th surface.
    pub(super) fn connected(&self, k: u32) -> usize {
        k as usize - usize::from(self.direct)
    }

    /// The slot of the connection through a chain from the `k`-th surface, `k ≥ 2`.
    pub(super) fn gathered(&self, k: u32) -> usize {
        self.connected(self.max_bounces + 1) + k as usize - 2
    }
}

/// A connection as its path's record has it.
pub(crate) struct End {
    /// Without it, the rest means nothing.
    pub(crate) is_seen: bool,
    /// Of the other end of the rig.
    pub(crate) pixel: u32,
    /// As in [`Connection`], and so is the value.
    pub(crate) bounces: u32,
    pub(crate) value: [f32; 3],
}

impl End {
    /// Of the connection from the `k`-th surface.
    pub(super) fn new(k: u32, slot: [u32; 4]) -> Self {
        Self {
            is_seen: slot[0] != super::materials::NONE,
            pixel: slot[0] & PIXEL_MASK,
            bounces: k + (slot[0] >> PIXEL_BITS),
            value: value(slot),
        }
    }
}

/// Of a word for a pixel; the others are for what else belongs to it: here, the number of its chain's surfaces.
const PIXEL_BITS: u32 = 28;
/// Those bits.
pub(crate) const PIXEL_MASK: u32 = (1 << PIXEL_BITS) - 1;

/// Rays traced along a path, by its first slot.
pub(super) fn rays(head: [u32; 4]) -> u64 {
    u64::from(head[0] >> 8 & 0xff)
}

/// Light, by a slot that has it.
pub(super) fn value(slot: [u32; 4]) -> [f32; 3] {
    [f32::from_bits(slot[1]), f32::from_bits(slot[2]), f32::from_bits(slot[3])]
}
