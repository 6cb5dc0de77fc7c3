// What a scene and its rig have. A kernel is compiled for just that: software Vulkan executes both sides of every branch, so
// that what is compiled costs whether it is used or not. Set by `render::features`.

// Every surface is a plain Lambertian.
override MATTE: bool = false;
// Some surfaces have textures, or normals and colours at their corners.
override CORNERS: bool = true;
// Some surfaces mirror or refract in single directions.
override CHAINS: bool = true;
// Some surfaces let light straight through: shadow rays must look at what they meet.
override PASSABLE: bool = true;
// Some surfaces border on a medium.
override MEDIA: bool = true;
// The scene emits light of its own, and this kernel's paths see it.
override AMBIENT: bool = true;
// Some end of the rig has an aperture.
override LENSES: bool = true;
// Both ends are one pinhole: light finds back the way it came, and direct light is a diagonal.
override COAXIAL_PINHOLE: bool = false;
// Paths may end by Russian roulette.
override ROULETTE: bool = true;
// Where rays from and to the pinhole that both ends share are traced by lists of what can be seen from it: texels in a row of the
// lists' raster; else 0.
override LIGHT_BUFFER_SIDE: u32 = 0u;
// One invocation traces several paths, one after the other.
override SEVERAL_PATHS: bool = false;
// The search tree is small: its nodes and triangles lie in one row of a texture each, and 16 bits tell nodes apart.
override SMALL_TREE: bool = false;
// Number of pairs of triangles, where they are so few that testing each is cheaper than a search tree; else 0.
override FEW_PAIRS: u32 = 0u;
