//! What a scene and its rig have, and so what a kernel is compiled for.

/// The overrides of `shaders/shared/features.wgsl`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Features {
    pub(super) scene: SceneFeatures,
    /// The scene glows, and the paths see it.
    pub(super) ambient: bool,
    pub(super) lenses: bool,
    pub(super) coaxial_pinhole: bool,
    pub(super) roulette: bool,
    /// Texels in a row of the lists by which rays from and to the one pinhole go ([`super::light_buffer`]); 0 where they do not.
    pub(super) light_buffer_side: u32,
    /// One invocation traces several paths, one after the other.
    pub(super) several_paths: bool,
}

/// What of it the surfaces decide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct SceneFeatures {
    /// Every surface is a plain Lambertian.
    pub(super) matte: bool,
    /// Some surfaces have textures, or normals and colours at their corners.
    pub(super) corners: bool,
    /// Some surfaces mirror or refract in single directions.
    pub(super) chains: bool,
    /// Some surfaces let light straight through.
    pub(super) passable: bool,
    /// Some surfaces border on a medium.
    pub(super) media: bool,
    /// Nodes and triangles of the search tree lie in one row of a texture each, and 16 bits tell nodes apart.
    pub(super) small_tree: bool,
    /// The number of pairs of triangles, where rays test each of them; 0 where they go by the search tree.
    pub(super) few_pairs: u32,
}

impl Features {
    /// By the shader's names.
    pub(super) fn constants(&self) -> [(&'static str, f64); 13] {
        let SceneFeatures { matte, corners, chains, passable, media, small_tree, few_pairs } = self.scene;
        let flag = |set: bool| f64::from(u8::from(set));
        [
            ("MATTE", flag(matte)),
            ("CORNERS", flag(corners)),
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
    fn the_shaders_overrides_are_all_set_and_no_others() {
        let scene = SceneFeatures {
            matte: true,
            corners: true,
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
