//! How much a file asks for, with limits, and how far the work on it is: a small file can place one mesh any number of times.

use super::Document;
use crate::error::{Error, Result};
use crate::scene::Watcher;
use crate::scene::triangle::MAX_TRIANGLES;

/// The largest number of primitives, counted each time a node places them. A limit is needed because a small
/// file can place any number of primitives without triangles.
const MAX_PLACEMENTS: usize = 1 << 20;

/// The largest number of triangles times morph targets.
const MAX_MORPHS: usize = 1 << 28;

/// What was counted so far.
#[derive(Default)]
pub(super) struct Counts {
    /// Number of primitives placed.
    placements: usize,
    /// Number of instances of all nodes.
    instances: usize,
    /// Number of triangles, dropped ones included.
    total: usize,
    /// Number of triangles, counted once for each morph target.
    morphs: usize,
}

impl Counts {
    /// Counts the primitives of a placed mesh, up to [`MAX_PLACEMENTS`].
    pub(super) fn placements(&mut self, document: &Document, primitives: usize) -> Result<()> {
        self.placements = self.placements.saturating_add(primitives);
        if self.placements > MAX_PLACEMENTS {
            return Err(document.fault(
                format!("more than {MAX_PLACEMENTS} primitives, all instances counted"),
                "join the meshes, or place fewer of them",
            ));
        }
        Ok(())
    }

    /// Counts the instances of a node, up to [`MAX_TRIANGLES`].
    pub(super) fn instances(&mut self, document: &Document, count: usize) -> Result<()> {
        self.instances = self.instances.saturating_add(count);
        if self.instances > MAX_TRIANGLES {
            return Err(document.fault(
                format!("more than {MAX_TRIANGLES} instances"),
                "place fewer of them, or join their meshes",
            ));
        }
        Ok(())
    }

    /// Counts the triangles of a primitive, up to [`MAX_TRIANGLES`] and [`MAX_MORPHS`]. Returns their number
    /// at all poses.
    pub(super) fn triangles(
        &mut self,
        document: &Document,
        mesh: usize,
        poses: usize,
        targets: usize,
    ) -> Result<usize> {
        let count = mesh.saturating_mul(poses);
        self.total = self.total.saturating_add(count);
        self.morphs = self.morphs.saturating_add(count.saturating_mul(targets));
        if self.total > MAX_TRIANGLES {
            return Err(document.fault(
                format!("more than {MAX_TRIANGLES} triangles, all instances counted"),
                "simplify the meshes, or place fewer of them",
            ));
        }
        if self.morphs > MAX_MORPHS {
            return Err(document.fault(
                format!("more than {MAX_MORPHS} triangles, counted once for each of their morph targets"),
                "apply the morph targets before the export",
            ));
        }
        Ok(count)
    }
}

/// The error about triangles for which there is no memory.
pub(super) fn too_many(document: &Document, count: usize) -> Error {
    document.fault(
        format!("there is no memory for {count} triangles, all instances counted"),
        "simplify the meshes, place fewer of them, or use a machine with more memory",
    )
}

/// How far the assembly of triangles is.
#[derive(Clone, Copy)]
pub(super) struct Progress<'a> {
    pub watcher: Watcher<'a>,
    /// The node that is assembled, and the number of all.
    pub position: usize,
    pub nodes: usize,
}

impl Progress<'_> {
    /// Tells the watcher that the node is begun.
    pub(super) fn begin(self) -> Result<()> {
        self.watcher.tell(self.share(0.0))
    }

    /// Tells the watcher now and then that so many triangles of the node are done.
    pub(super) fn at(self, done: usize, of: usize) -> Result<()> {
        self.watcher.count(done, || self.share(done as f32 / of as f32))
    }

    /// The share of the work that is done when this share of the node is.
    fn share(self, of_node: f32) -> f32 {
        (self.position as f32 + of_node) / self.nodes as f32
    }
}
