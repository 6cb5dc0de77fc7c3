// Features of a scene and its rig. A kernel is compiled for exactly these features: software Vulkan executes
// both sides of every branch, so that code costs time even where it is not used. The host sets the values
// (`render::features`).

// Every surface is plain Lambertian.
override MATTE: bool = false;
// Some surfaces have textures, or normals and colours at their corners.
override CORNERS: bool = true;
// Some surfaces are rough, and neither plain Lambertian nor smooth: they have microfacets.
override FACETS: bool = true;
// Some surfaces transmit light into what lies behind them.
override TRANSMITS: bool = true;
// Some surfaces reflect or refract into single directions, so that paths have specular chains.
override CHAINS: bool = true;
// Some surfaces let light pass straight through, so that shadow rays have to look at the surfaces that they
// meet.
override PASSABLE: bool = true;
// Some surfaces border on a medium.
override MEDIA: bool = true;
// The scene emits light, and the paths of this kernel record it.
override AMBIENT: bool = true;
// The camera or the projector has an aperture.
override LENSES: bool = true;
// Camera and projector are one pinhole: light can return along its own path, and direct light is a diagonal
// matrix.
override COAXIAL_PINHOLE: bool = false;
// Paths may end by Russian roulette.
override ROULETTE: bool = true;
// Texels in a row of the light buffer, where rays from and to the shared pinhole use it; else 0.
override LIGHT_BUFFER_SIDE: u32 = 0u;
// One invocation traces several paths, one after the other.
override SEVERAL_PATHS: bool = false;
// The search tree is small: its nodes and its triangles lie in one texture row each, and 16 bits are enough
// for a node's index.
override SMALL_TREE: bool = false;
// Number of pairs of triangles, where they are so few that testing each is cheaper than a search tree; else
// 0.
override FEW_PAIRS: u32 = 0u;
