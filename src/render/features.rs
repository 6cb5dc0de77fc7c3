//! The features of a scene and its rig for which a kernel is compiled.

/// The values of the overrides of `shaders/shared/features.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Features {
    pub(super) scene: SceneFeatures,
    /// The scene emits light, and the paths record it.
    pub(super) ambient: bool,
    /// The camera or the projector has an aperture.
    pub(super) lenses: bool,
    /// Camera and projector are one pinhole.
    pub(super) coaxial_pinhole: bool,
    /// Paths may end by Russian roulette.
    pub(super) roulette: bool,
    /// Texels in a row of the light buffer, where rays from and to the pinhole use it
    /// ([`super::light_buffer`]); else 0.
    pub(super) light_buffer_side: u32,
    /// One invocation traces several paths, one after the other.
    pub(super) several_paths: bool,
}

/// The features that the scene's surfaces decide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct SceneFeatures {
    /// Every surface is plain Lambertian.
    pub(super) matte: bool,
    /// Some surfaces have textures, or normals and colours at their corners.
    pub(super) corners: bool,
    /// Some surfaces are rough, and neither plain Lambertian nor smooth.
    pub(super) facets: bool,
    /// Some surfaces transmit light.
    pub(super) transmits: bool,
    /// Some surfaces reflect or refract into single directions.
    pub(super) chains: bool,
    /// Some surfaces let light pass straight through.
    pub(super) passable: bool,
    /// Some surfaces border on a medium.
    pub(super) media: bool,
    /// The nodes and the triangles of the search tree lie in one texture row each, and 16 bits are enough for
    /// a node's index.
    pub(super) small_tree: bool,
    /// The number of pairs of triangles, where rays test each of them; 0 where rays traverse the search tree.
    pub(super) few_pairs: u32,
}

impl Features {
    /// The values by the names of the shader's overrides.
    pub(super) fn constants(&self) -> [(&'static str, f64); 15] {
        let SceneFeatures {
            matte,
            corners,
            facets,
            transmits,
            chains,
            passable,
            media,
            small_tree,
            few_pairs,
        } = self.scene;
        let flag = |set: bool| f64::from(u8::from(set));
        [
            ("MATTE", flag(matte)),
            ("CORNERS", flag(corners)),
            ("FACETS", flag(facets)),
            ("TRANSMITS", flag(transmits)),
            ("CHAINS", flag(chains)),
            ("PASSABLE", flag(passable)),
            ("MEDIA", flag(media)),
            ("AMBIENT", flag(self.ambient)),
            ("LENSES", flag(self.lenses)),
            ("COAXIAL_PINHOLE", flag(self.coaxial_pinhole)),
            ("ROULETTE", flag(self.roulette)),
            ("LIGHT_BUFFER_SIDE", f64::from(self.light_buffer_side)),
            ("SEVERAL_PATHS", flag(self.several_paths)),
            ("SMALL_TREE", flag(small_tree)),
            ("FEW_PAIRS", f64::from(few_pairs)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exactly_the_shaders_overrides_are_set() {
        let scene = SceneFeatures {
            matte: true,
            corners: true,
            facets: true,
            transmits: true,
            chains: true,
            passable: true,
            media: true,
            small_tree: true,
            few_pairs: 4,
        };
        let features = Features {
            scene,
            ambient: true,
            lenses: true,
            coaxial_pinhole: true,
            roulette: true,
            light_buffer_side: 128,
            several_paths: true,
        };
        let module = crate::gpu::shader::module("trace_paths").unwrap_or_else(|e| unreachable!("{e}"));
        let mut declared: Vec<_> =
            module.overrides.iter().filter_map(|(_, constant)| constant.name.clone()).collect();
        let mut set: Vec<_> = features.constants().iter().map(|(name, _)| (*name).to_owned()).collect();
        declared.sort();
        set.sort();
        assert_eq!(declared, set);
    }
}
