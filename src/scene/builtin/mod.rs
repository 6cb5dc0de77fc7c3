//! Scenes that are made in code: the shipped scenes, and scenes for tests and benchmarks.
//!
//! | shipped as `assets/scenes/NAME/scene.glb` | content |
//! |---|---|
//! | `zigzag` | two folded sheets that exchange no light |
//! | `corner` | two planes at a right angle |
//! | `mirror` | a wall and a mirror at a right angle |
//! | `mirror-ball` | a mirror ball on the floor of a white room |
//! | `cornell` | a coloured box with two blocks |
//! | `two-sheets` | two curved sheets of paper that exchange no light |
//! | `two-sheets-post` | the same behind a post, which divides one of them into two patches in the picture |
//! | `carton` | an egg carton of twelve cups that exchange no light |
//! | `carton-eggs` | the same with an egg in every second cup |
//! | `nine-cells` | an egg carton of nine cups, as in figure 8 of the paper |
//! | `nine-cells-eggs` | the same with an egg in every cup; light passes from egg to egg |
//!
//! `cargo run --example regenerate_assets` writes the files of the shipped scenes.

mod analytic;
mod cornell;
mod corner;
mod egg_carton;
mod folded_sheet;
mod glb;
mod icosphere;
mod mirror;
mod mirror_ball;
mod model;
mod tessellated_box;
mod two_sheets;
mod zigzag;

pub use analytic::{inside_sphere, parallel_plates, plane};
pub use cornell::cornell;
pub use corner::corner;
pub use egg_carton::{carton, carton_eggs, nine_cells};
pub use folded_sheet::folded_sheet;
pub use mirror::mirror;
pub use mirror_ball::mirror_ball;
pub use model::{Model, Part};
pub use tessellated_box::tessellated_box;
pub use two_sheets::{two_sheets, two_sheets_post};
pub use zigzag::zigzag;

/// All shipped scenes. The file of each is `assets/scenes/NAME/scene.glb`, where `NAME` is [`Model::name`].
pub fn shipped() -> Vec<Model> {
    vec![
        zigzag(),
        corner(),
        mirror(),
        mirror_ball(),
        cornell(),
        two_sheets(),
        two_sheets_post(),
        carton(),
        carton_eggs(),
        nine_cells(false),
        nine_cells(true),
    ]
}
