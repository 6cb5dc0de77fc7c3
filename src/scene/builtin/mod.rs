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
//! | `sheet-behind-sheet` | two curved sheets that exchange no light, one behind the other |
//! | `carton` | an egg carton of twelve cups that exchange no light |
//! | `carton-eggs` | `carton` with an egg in every second cup |
//! | `nine-cells` | an egg carton of nine cups, for figure 8 of the paper, which does not state the number of cups |
//! | `nine-cells-eggs` | `nine-cells` with an egg in every cup; light passes from egg to egg |
//!
//! `cargo run --example regenerate_assets` writes the files of the shipped scenes.

mod analytic;
mod egg_carton;
mod model;

use glam::{DQuat, DVec2, DVec3, Vec3, dvec2, dvec3, vec3};

use crate::scene::Material;
use model::{matte, white_paper};

pub use analytic::{inside_sphere, parallel_plates, plane, tessellated_box};
pub use egg_carton::{carton, carton_eggs, nine_cells};
pub use model::{Model, Part};

/// All shipped scenes. Each scene is in the file `assets/scenes/NAME/scene.glb`, where `NAME` is [`Model::name`].
pub fn shipped() -> Vec<Model> {
    vec![
        zigzag(),
        corner(),
        mirror(),
        mirror_ball(),
        cornell(),
        two_sheets(),
        sheet_behind_sheet(),
        carton(),
        carton_eggs(),
        nine_cells(false),
        nine_cells(true),
    ]
}

const TAN_20_DEGREES: f32 = 0.363_970_22;
const TAN_25_DEGREES: f32 = 0.466_307_67;

/// Two white sheets side by side, each folded along the vertical into a valley: `\/\/` seen from above. The rims of the sheets are 0.8 m
/// from the camera, and their valleys 1.1 m. Each sheet is 0.4 m wide and 1.4 m high, and together they fill the view. A straight line from
/// one sheet to the other would have to pass in front of the ridge between them, but no point of a sheet is in front of the ridge. The
/// sheets therefore exchange no light. The left sheet is region 0, and the right sheet is region 1. The sheets are mirror images of each
/// other.
pub fn zigzag() -> Model {
    let fold = |name: &str, label: u32, [left, valley, right]: [f32; 3]| {
        let mut part = Part::new(name, Some(label));
        for [(x0, z0), (x1, z1)] in [[(left, -0.8), (valley, -1.1)], [(valley, -1.1), (right, -0.8)]] {
            part.quad([vec3(x0, -0.7, z0), vec3(x1, -0.7, z1), vec3(x1, 0.7, z1), vec3(x0, 0.7, z0)]);
        }
        part
    };
    let sheets = [fold("left sheet", 0, [-0.4, -0.2, 0.0]), fold("right sheet", 1, [0.0, 0.2, 0.4])];
    Model::along_z("zigzag", sheets.into(), white_paper(), (0.0, TAN_25_DEGREES))
}

/// Two white planes that meet at a right angle along a vertical edge, 1.2 m in front of the camera. Each plane extends 0.6 m towards the
/// camera and 0.6 m to its side. The planes fill the view. The left plane is region 0, and the right plane is region 1.
pub fn corner() -> Model {
    Model::along_z("corner", planes(["left", "right"]), white_paper(), (0.0, TAN_20_DEGREES))
}

/// The [`corner`] with a perfect mirror as its right half. Light returns from the wall along four kinds of path: directly, by the mirror
/// before the wall, by the mirror after the wall, or by the mirror before and after the wall. The wall (left) is region 0, and the mirror
/// (right) is region 1.
pub fn mirror() -> Model {
    let mut parts = planes(["wall", "mirror"]);
    parts[1].material = 1;
    let materials = [white_paper(), vec![perfect_mirror()]].concat();
    Model::along_z("mirror", parts, materials, (0.0, TAN_20_DEGREES))
}

fn planes([left, right]: [&str; 2]) -> Vec<Part> {
    let [mut left, mut right] = [Part::new(left, Some(0)), Part::new(right, Some(1))];
    left.quad([vec3(-0.6, -0.7, -0.6), vec3(0.0, -0.7, -1.2), vec3(0.0, 0.7, -1.2), vec3(-0.6, 0.7, -0.6)]);
    right.quad([vec3(0.0, -0.7, -1.2), vec3(0.6, -0.7, -0.6), vec3(0.6, 0.7, -0.6), vec3(0.0, 0.7, -1.2)]);
    vec![left, right]
}

fn perfect_mirror() -> Material {
    let name = "perfect mirror".into();
    Material { name, metallic: 1.0, roughness: 0.0, specular: 1.0, ..Material::default() }
}

/// The walls of a box of 1 m with its open side at z = 0: floor, ceiling, back, left and right.
const WALLS: [[Vec3; 4]; 5] = {
    let (low, high) = (-0.5, 0.5);
    [
        [vec3(low, low, 0.0), vec3(high, low, 0.0), vec3(high, low, -1.0), vec3(low, low, -1.0)],
        [vec3(low, high, -1.0), vec3(high, high, -1.0), vec3(high, high, 0.0), vec3(low, high, 0.0)],
        [vec3(low, low, -1.0), vec3(high, low, -1.0), vec3(high, high, -1.0), vec3(low, high, -1.0)],
        [vec3(low, low, 0.0), vec3(low, low, -1.0), vec3(low, high, -1.0), vec3(low, high, 0.0)],
        [vec3(high, low, -1.0), vec3(high, low, 0.0), vec3(high, high, 0.0), vec3(high, high, -1.0)],
    ]
};

/// A white room of 1 m that is open towards the camera, 1.3 m in front of the opening. A perfect mirror ball lies on the floor. The ball
/// reflects the projected pattern sharply onto the walls, and reflects the room sharply to the camera. Separation by high-frequency
/// patterns therefore counts some indirect light as direct light, and some direct light as indirect light. If a path reaches a point of the
/// room by mirrors and returns by the same mirrors, it scatters only once and is direct light. The room is region 0, and the ball is region
/// 1. These are named regions instead of labels, because they exchange light.
pub fn mirror_ball() -> Model {
    const CENTER: DVec3 = dvec3(0.04, -0.22, -0.42);
    const RADIUS: f64 = 0.28;
    // Each of the 20,480 facets is about 2° wide. This is about one facet per pixel if the ball is 120 pixels wide.
    const SUBDIVISIONS: u32 = 5;
    let mut ball = Part::new("ball", None);
    let (vertices, inwards) = analytic::icosphere(SUBDIVISIONS);
    ball.positions = vertices.iter().map(|vertex| (CENTER + RADIUS * *vertex).as_vec3()).collect();
    ball.triangles = inwards.into_iter().map(|[a, b, c]| [a, c, b]).collect();
    ball.material = 1;
    let materials = vec![matte("white", Vec3::splat(0.7)), perfect_mirror()];
    Model::along_z("mirror-ball", vec![walls(), ball], materials, (1.3, TAN_20_DEGREES))
}

/// A white room (albedo 0.8) of 1 m that is open towards the camera, 1.3 m in front of the opening. Its back wall is 2.3 m from the camera.
pub fn room() -> Model {
    Model::along_z("room", vec![walls()], white_paper(), (1.3, TAN_20_DEGREES))
}

fn walls() -> Part {
    let mut room = Part::new("room", None);
    WALLS.into_iter().for_each(|wall| room.quad(wall));
    room
}

/// A box of 1 m that is open towards the camera, 1.3 m in front of the opening. Floor, ceiling and back wall are white, the left wall is
/// red, and the right wall is green. A short and a tall white block stand in the box. The five parts are named regions instead of labels,
/// because all of them exchange light.
pub fn cornell() -> Model {
    let [mut white, mut red, mut green] = ["white", "red", "green"].map(|name| Part::new(name, None));
    WALLS[..3].iter().for_each(|&wall| white.quad(wall));
    red.quad(WALLS[3]);
    red.material = 1;
    green.quad(WALLS[4]);
    green.material = 2;
    let short = block("short", dvec3(0.17, -0.5, -0.33), 0.3, 0.3);
    let tall = block("tall", dvec3(-0.17, -0.5, -0.62), 0.6, -0.35);
    let materials = vec![
        matte("white", Vec3::splat(0.73)),
        matte("red", vec3(0.63, 0.065, 0.05)),
        matte("green", vec3(0.14, 0.45, 0.091)),
    ];
    Model::along_z("cornell", vec![white, red, green, short, tall], materials, (1.3, TAN_20_DEGREES))
}

/// A block with a base of 0.3 m × 0.3 m around `foot`, rotated by `turn` radians about the vertical.
fn block(name: &str, foot: DVec3, height: f64, turn: f64) -> Part {
    let (sine, cosine) = turn.sin_cos();
    // Corners before the rotation: left or right, bottom or top, back or front.
    let corner = |[x, y, z]: [f64; 3]| {
        let (x, z) = (0.3 * (x - 0.5), 0.3 * (z - 0.5));
        (foot + dvec3(cosine * x + sine * z, y * height, cosine * z - sine * x)).as_vec3()
    };
    let [lbb, lbf, ltf, ltb] =
        [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 1.0, 0.0]].map(corner);
    let [rbb, rbf, rtf, rtb] =
        [[1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 0.0]].map(corner);
    let mut part = Part::new(name, None);
    for side in [
        [lbb, lbf, ltf, ltb],
        [rbb, rtb, rtf, rbf],
        [lbb, rbb, rbf, lbf],
        [ltb, ltf, rtf, rtb],
        [lbb, ltb, rtb, rbb],
        [lbf, rbf, rtf, ltf],
    ] {
        part.quad(side);
    }
    part
}

/// Two white sheets of paper side by side. Each sheet is bent about a vertical axis into a trough that opens towards the camera: a part of
/// a cylinder, of 120° on the left and 100° on the right. The sheets are 0.43 m and 0.41 m wide from rim to rim and 0.9 m high, with a gap
/// of 2 mm between them. All rims are 0.85 m from the camera, and all other points are farther away. The rims block every line from one
/// sheet to the other, so the sheets exchange no light. The left sheet is region 0, and the right sheet is region 1. Unlike the sheets of
/// `zigzag`, they are not mirror images of each other.
pub fn two_sheets() -> Model {
    let sheets = vec![
        trough("left sheet", 0, [-0.441, -0.011], (0.85, 60.0), 24),
        trough("right sheet", 1, [-0.009, 0.401], (0.85, 50.0), 24),
    ];
    Model::along_z("two-sheets", sheets, white_paper(), (0.0, 0.45))
}

/// Two white sheets of paper, bent about vertical axes into troughs that open towards the camera. The front sheet is a part of a cylinder
/// of 120°. It is 0.197 m wide, its rims are 0.62 m from the camera, and it hides the middle of the other sheet, of 90°, which is 0.8 m wide
/// and has its rims at 0.78 m. In a picture of 128 pixels per side, the front rims are between two columns of pixels. No point inside the front trough sees the sheet behind it, so the two exchange no light. The visible parts
/// of the rear sheet do not touch in the picture. They exchange light behind the front sheet, and by reflection from its back side. The
/// front sheet is region 0, and the rear sheet is region 1.
pub fn sheet_behind_sheet() -> Model {
    let sheets = vec![
        trough("front sheet", 0, [-0.0987, 0.0987], (0.62, 60.0), 24),
        trough("rear sheet", 1, [-0.4, 0.4], (0.78, 45.0), 24),
    ];
    Model::along_z("sheet-behind-sheet", sheets, white_paper(), (0.0, TAN_20_DEGREES))
}

/// The [`sheet_behind_sheet`] with a black lining 2 mm behind the front sheet, so that its back side reflects nothing. Lining and front
/// sheet are region 0.
pub fn sheet_behind_lined_sheet() -> Model {
    let mut model = Model { name: "sheet-behind-lined-sheet", ..sheet_behind_sheet() };
    let mut lining = trough("lining", 0, [-0.0987, 0.0987], (0.622, 60.0), 24);
    lining.material = 1;
    model.parts.push(lining);
    model.materials.push(matte("black", Vec3::ZERO));
    model
}

/// A glossy white sheet that is bent about a vertical axis into a trough of 90°, 0.6 m wide, with its rims 0.8 m from the camera before the
/// sheet is turned by 9° and leant by 6°. If it is smooth, it has one specular spot, where it faces the camera. A `roughness` of 1 leaves no
/// gloss. The sheet is region 0.
pub fn glossy_sheet(roughness: f32) -> Model {
    const SHEET: f64 = 0.88;
    let mut sheet = trough("glossy sheet", 0, [-0.3, 0.3], (0.8, 45.0), 48);
    let turn = DQuat::from_rotation_x(6.0_f64.to_radians()) * DQuat::from_rotation_y(9.0_f64.to_radians());
    for position in &mut sheet.positions {
        *position = (turn * (position.as_dvec3() + SHEET * DVec3::Z) - SHEET * DVec3::Z).as_vec3();
    }
    let material = Material {
        roughness,
        specular: if roughness < 1.0 { 1.0 } else { 0.0 },
        ..matte("glossy paper", Vec3::splat(0.8))
    };
    Model::along_z("glossy-sheet", vec![sheet], vec![material], (0.0, TAN_20_DEGREES))
}

/// A sheet that is bent to a circular arc from `left` to `right` (in metres along x). The arc spans `2·angle` degrees. Its rims are `rim`
/// metres from the camera along its axis, and all other points are farther away. It is approximated by flat `strips`.
fn trough(name: &str, label: u32, [left, right]: [f64; 2], (rim, angle): (f64, f64), strips: usize) -> Part {
    let angle = angle.to_radians();
    let radius = (right - left) / (2.0 * angle.sin());
    let axis = dvec2((left + right) / 2.0, -rim + radius * angle.cos());
    let profile = |strip: usize| -> DVec2 {
        // The ends are set exactly, because rounding could move one rim in front of the other.
        match strip {
            0 => dvec2(left, -rim),
            _ if strip == strips => dvec2(right, -rim),
            _ => {
                let turn = angle * (2.0 * strip as f64 / strips as f64 - 1.0);
                axis + radius * dvec2(turn.sin(), -turn.cos())
            }
        }
    };
    let mut part = Part::new(name, Some(label));
    part.grid(strips, 1, |strip, end| {
        let at = profile(strip);
        let height = if end == 0 { -0.45 } else { 0.45 };
        dvec3(at.x, height, at.y).as_vec3()
    });
    part
}
