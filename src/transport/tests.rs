//! Tests of rows and matrices that are built from synthetic paths. The rigs are unlike those of the shipped scenes.

mod costs;
mod estimates;
mod memory;
mod wire;

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::contributions::Found;
use super::noise::EntrySquares;
use super::rows::Rows;
use super::spread::{Combined, Steps, classes, merge, steps};
use super::*;
use crate::operator::{Adjoint, Operator};
use crate::render::{Connection, StartPixels};
use crate::scene::Scene;
use crate::team::{Comm, Threads, threads};

/// The paths from the pixels of one endpoint (camera or projector). Each path has its start pixel, its half of the samples, and its
/// connections.
type Paths = Vec<(u32, usize, Vec<Connection>)>;

const SAMPLES: u32 = 4;

/// Paths from the camera's pixels in order, with random connections between `camera` and `projector` pixels.
fn from_camera(random: &mut Pcg64, camera: usize, projector: usize, most: u32) -> Paths {
    let mut paths = Vec::new();
    for start in 0..camera as u32 {
        for sample in 0..SAMPLES {
            let connection = |bounces| Connection {
                camera: start,
                projector: random.random_range(0..projector as u32),
                bounces,
                value: [random.random_range(0.5..1.5); 3],
            };
            let half = usize::from(2 * sample >= SAMPLES);
            paths.push((start, half, (1..=most).map(connection).collect()));
        }
    }
    paths
}

fn from_projector(random: &mut Pcg64, camera: usize, projector: usize, most: u32) -> Paths {
    let mut paths = from_camera(random, projector, camera, most);
    for connection in paths.iter_mut().flat_map(|path| &mut path.2) {
        (connection.camera, connection.projector) = (connection.projector, connection.camera);
    }
    paths
}

fn found(paths: &[Paths], split: bool, steps: Option<&Steps>) -> Found<1> {
    let mut rows = Rows::new(SAMPLES, split, steps);
    for (paths, from_camera) in paths.iter().zip([true, false]) {
        // A batch may end anywhere, even within the paths of a pixel.
        paths.chunks(7).for_each(|batch| rows.add_paths(batch, from_camera, &|rgb| [rgb[0]]));
    }
    rows.close()
}

/// The layers, row sums and sums of squares that a single process computes.
fn combined(found: Found<1>, rig: RigShape, classes: usize) -> Combined<1> {
    merge(&threads(1)[0], rig, &Steps::one(rig), found, classes, &[])
        .expect("a process alone has all it needs")
}

/// Calls `work` on this many threads.
pub(super) fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.expect("threads can be started").install(work)
}

/// The scene with a projector beside the camera.
pub(super) fn apart(scene: Scene, aside: f32) -> Scene {
    let mut projector = scene.camera.clone();
    projector.position += aside * projector.right;
    Scene { projector: Some(projector), ..scene }
}

fn layers(found: Found<1>, rig: RigShape, split: bool) -> Vec<Layer> {
    let bounces = classes(split);
    let Combined { layers, .. } = combined(found, rig, bounces.len());
    bounces.iter().zip(layers).map(|(&bounces, tiles)| Layer::of_tiles(bounces, tiles)).collect()
}

fn matrix(rig: RigShape, paths: &[Paths], split: bool) -> TransportMatrix {
    TransportMatrix::new(rig, Channels::Luma, vec![Vec::new()], layers(found(paths, split, None), rig, split))
}

/// The dense matrix of these paths. A connection adds to its entry, and for a coaxial rig also to the mirror image of this entry.
fn dense(rig: RigShape, paths: &[Paths], part: Part) -> Vec<f64> {
    let columns = rig.projector.pixels();
    let mut dense = vec![0.0; rig.camera.pixels() * columns];
    for connection in paths.iter().flatten().flat_map(|path| &path.2).filter(|c| part.holds(c.bounces)) {
        let value = f64::from(connection.value[0]) / f64::from(SAMPLES);
        dense[connection.camera as usize * columns + connection.projector as usize] += value;
        if rig.symmetric {
            dense[connection.projector as usize * columns + connection.camera as usize] += value;
        }
    }
    dense
}

fn separated() -> (RigShape, Vec<Paths>) {
    let rig = RigShape { camera: Resolution::new(5, 3), projector: Resolution::new(4, 7), symmetric: false };
    let mut random = Pcg64::seed_from_u64(3);
    let paths = vec![
        from_camera(&mut random, 15, 28, 4),
        // These paths have no one-bounce connections.
        from_projector(&mut random, 15, 28, 3),
    ];
    (rig, paths)
}

fn with_lens() -> (RigShape, Vec<Paths>) {
    let resolution = Resolution::new(6, 5);
    let rig = RigShape { camera: resolution, projector: resolution, symmetric: true };
    (rig, vec![from_camera(&mut Pcg64::seed_from_u64(4), 30, 30, 4)])
}

/// A rig with more rows than become tiles at the same time.
fn of_many_pixels() -> (RigShape, Vec<Paths>) {
    let resolution = Resolution::new(260, 130);
    let rig = RigShape { camera: resolution, projector: resolution, symmetric: true };
    (rig, vec![from_camera(&mut Pcg64::seed_from_u64(5), resolution.pixels(), resolution.pixels(), 3)])
}

fn random_vector(length: usize, seed: u64) -> Vec<f64> {
    let mut random = Pcg64::seed_from_u64(seed);
    (0..length).map(|_| random.random_range(-1.0..1.0)).collect()
}

#[test]
fn each_part_of_any_rig_is_the_sum_of_its_connections() {
    for (rig, paths) in [separated(), with_lens()] {
        for split in [false, true] {
            let matrix = matrix(rig, &paths, split);
            for part in [Part::Full, Part::Direct, Part::Global] {
                let expected = dense(rig, &paths, part);
                let csr = matrix.to_csr(part, 0).unwrap_or_else(|error| unreachable!("{error}"));
                assert_eq!((csr.rows(), csr.cols()), (rig.camera.pixels(), rig.projector.pixels()));
                assert_eq!(csr.is_symmetric(), rig.symmetric, "{part:?}");
                let mut found = vec![0.0; expected.len()];
                csr.entries().for_each(|(row, column, value)| found[row * csr.cols() + column] = value);
                for (found, expected) in found.iter().zip(&expected) {
                    // Values are rounded to `f32` three times: pixel by pixel, when rows and columns are merged, and when layers are added.
                    let bound = 3.0 * f64::from(f32::EPSILON) * expected;
                    assert!((found - expected).abs() <= bound, "{part:?}: {found} for {expected}");
                }
            }
        }
    }
}

#[test]
fn the_transpose_is_the_dual_rig() {
    let (rig, paths) = separated();
    for split in [false, true] {
        let matrix = matrix(rig, &paths, split);
        for part in [Part::Full, Part::Direct, Part::Global] {
            let mut operator = MatrixOperator::new(&matrix, part, 0);
            assert_eq!((operator.rows(), operator.cols()), (15, 28));
            let (u, v) = (random_vector(15, 1), random_vector(28, 2));
            let (mut av, mut atu) = (vec![f64::NAN; 15], vec![f64::NAN; 28]);
            assert!(operator.apply(&v, &mut av).is_ok() && operator.apply_adjoint(&u, &mut atu).is_ok());
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            // `uᵀ(A v)` and `(Aᵀ u)ᵀ v` are sums of at most 15·28 products. Terms may cancel, so the bound is relative to their magnitudes
            // (Higham 2002, eq. 3.5).
            let csr = matrix.to_csr(part, 0).unwrap_or_else(|error| unreachable!("{error}"));
            let magnitude: f64 = csr.entries().map(|(row, column, a)| (u[row] * a * v[column]).abs()).sum();
            let difference = (dot(&u, &av) - dot(&atu, &v)).abs();
            assert!(difference <= 2.0 * 60.0 * f64::EPSILON * magnitude, "{part:?}: {difference:e}");
            assert!(dot(&u, &av).abs() > 1e-3 * magnitude, "nothing was compared");
        }
    }
}

#[test]
fn where_batches_are_cut_makes_no_difference() {
    let (rig, paths) = separated();
    let whole = matrix(rig, &paths, false);
    let mut rows = Rows::<1>::new(SAMPLES, false, None);
    for (paths, from_camera) in paths.iter().zip([true, false]) {
        paths.chunks(1).for_each(|path| rows.add_paths(path, from_camera, &|rgb| [rgb[0]]));
    }
    assert_eq!(whole.layers, layers(rows.close(), rig, false));
}

#[test]
fn the_number_of_threads_makes_no_difference() {
    for (rig, paths) in [separated(), with_lens()] {
        let of = |threads| on_threads(threads, || combined(found(&paths, true, None), rig, 3));
        let one = of(1);
        assert_eq!(one, of(2));
        assert_eq!(one, of(7));
    }
}

#[test]
fn some_rows_alone_are_those_of_the_whole() {
    for (rig, paths) in [separated(), with_lens(), of_many_pixels()] {
        let pixels = rig.camera.pixels();
        let whole = combined(found(&paths, true, None), rig, 3);
        let layers: Vec<_> = whole.layers.iter().map(|tiles| tiles.to_rows()).collect();
        let camera = [0..4, 4..9, 9..9, 9..pixels];
        // The projector's pixels are divided among the processes differently from the camera's pixels.
        let lit = rig.projector.pixels();
        let own =
            camera.clone().into_iter().zip([0..lit / 2, lit / 2..lit / 2, lit / 2..lit - 3, lit - 3..lit]);
        let own: Vec<StartPixels> =
            own.map(|(camera, projector)| StartPixels { camera, projector }).collect();
        let part = |comm: &Threads| {
            let steps = steps(comm, rig, &own).expect("all members do the same");
            let StartPixels { camera, projector } = &own[comm.rank()];
            let starts = [camera, projector].into_iter().zip(&paths);
            let mine: Vec<Paths> = starts
                .map(|(own, paths)| {
                    paths.iter().filter(|path| own.contains(&(path.0 as usize))).cloned().collect()
                })
                .collect();
            merge(comm, rig, &steps, found(&mine, true, Some(&steps)), 3, &[])
                .expect("all members do the same")
        };
        let parts: Vec<_> = std::thread::scope(|scope| {
            let members: Vec<_> =
                threads(4).into_iter().map(|comm| scope.spawn(move || part(&comm))).collect();
            members.into_iter().map(|member| member.join().expect("no member panics")).collect()
        });
        let mut squares = EntrySquares::default();
        for (rows, part) in camera.into_iter().zip(parts) {
            assert_eq!(part.rows, whole.rows[rows.clone()]);
            squares.add_all(&part.squares);
            let part: Vec<_> = part.layers.iter().map(|tiles| tiles.to_rows()).collect();
            assert!(
                part.iter().all(|layer| layer.row_start.len() == rows.len() + 1 && layer.weights.len() == 1)
            );
            for (part, whole) in part.iter().zip(&layers) {
                let entries = whole.row_start[rows.start]..whole.row_start[rows.end];
                assert_eq!(part.columns, whole.columns[entries.clone()]);
                assert_eq!(part.weights[0], whole.weights[0][entries]);
            }
        }
        assert_eq!(squares, whole.squares);
    }
}

#[test]
fn a_projector_of_more_pixels_than_the_camera_may_have_pixels_that_light_nothing() {
    let rig = RigShape { camera: Resolution::new(2, 1), projector: Resolution::new(4, 1), symmetric: false };
    let lit = Connection { camera: 1, projector: 0, bounces: 2, value: [3.0; 3] };
    // The numbers of the last two projector pixels are beyond the camera's pixels. These two projector pixels light nothing.
    let camera = (0..2).map(|pixel| (pixel, 0, Vec::new())).collect();
    let projector = (0..4).map(|pixel| (pixel, 0, if pixel == 0 { vec![lit] } else { Vec::new() })).collect();
    let paths: [Paths; 2] = [camera, projector];
    let of_layers = matrix(rig, &paths, false).layers.iter().map(Layer::nonzeros).sum::<usize>();
    assert_eq!(of_layers, 1);
    assert_eq!(dense(rig, &paths, Part::Full)[4] * f64::from(SAMPLES), 3.0);
}

#[test]
fn light_of_any_colour_counts_and_darkness_does_not() {
    let colors =
        [[0.5, 0.25, 0.125], [0.5, 0.25, 0.0], [0.5, 0.0, 0.25], [0.0, 0.5, 0.25], [0.0, 0.0, 0.5], [0.0; 3]];
    let connection = |(projector, value): (usize, &[f32; 3])| Connection {
        camera: 3,
        projector: projector as u32,
        bounces: 2,
        value: *value,
    };
    let path = (3, 0, colors.iter().enumerate().map(connection).collect());
    // Pixels without light are left out.
    let paths: Paths = vec![(1, 0, Vec::new()), path, (4, 0, Vec::new())];
    let mut rows = Rows::<3>::new(1, false, None);
    rows.add_paths(&paths, true, &|rgb| rgb);
    let chunks = rows.close().into_chunks();
    assert_eq!(chunks.iter().flat_map(|chunk| &chunk.rows).map(|row| row.pixel).collect::<Vec<_>>(), [3]);
    let found: Vec<(u32, [f32; 3])> = chunks
        .iter()
        .flat_map(|chunk| chunk.terms.iter())
        .map(|term| (term.key.other(), term.mean))
        .collect();
    assert_eq!(found, (0..5).map(|other| (other, colors[other as usize])).collect::<Vec<_>>());
}

/// Even a chunk with a single pixel is not freed before the row of this pixel is merged.
#[test]
fn how_contributions_are_cut_into_chunks_makes_no_difference() {
    let resolution = Resolution::new(64, 40);
    let rig = RigShape { camera: resolution, projector: resolution, symmetric: true };
    let paths = from_camera(&mut Pcg64::seed_from_u64(6), 2560, 2560, 3);
    let of = |pixels: usize| {
        let part = |paths: &[(u32, usize, Vec<Connection>)]| {
            let mut rows = Rows::<1>::new(SAMPLES, false, None);
            rows.add_paths(paths, true, &|rgb| [rgb[0]]);
            rows.close().into_chunks()
        };
        let chunks = paths.chunks(pixels * SAMPLES as usize).flat_map(part).collect();
        on_threads(1, || {
            assert!(tiles::groups(2560).len() > 1, "rows become tiles group by group");
            combined(Found::of_chunks(chunks), rig, 2)
        })
    };
    let whole = of(2560);
    assert!(whole == of(1) && whole == of(100));
}

#[test]
fn chunks_are_told_whether_they_are_of_a_matrix() {
    use super::contributions::{Chunk, Key, Row, Term, Terms};
    let chunk = |pixels: [u32; 2], keys: [(u32, u32); 3]| {
        let row = |(at, pixel)| Row { pixel, from_camera: true, end: [2, 3][at] };
        let terms = keys.map(|(other, class)| Term::<1>::none(Key::new(other, class)));
        Chunk { rows: pixels.into_iter().enumerate().map(row).collect(), terms: Terms::Short(terms.into()) }
    };
    let keys = [(0, 1), (8, 0), (8, 1)];
    let is_of = |chunk: Chunk<1>| chunk.is_of(&(4..7), 9, 2);
    assert!(is_of(chunk([4, 6], keys)));
    assert!(chunk([4, 6], [(0, 1), (0, 2), (8, 1)]).is_of(&(4..7), 9, 3), "classes ascend as well");
    for (what, chunk) in [
        ("a pixel before", chunk([3, 6], keys)),
        ("a pixel behind", chunk([4, 7], keys)),
        ("pixels that descend", chunk([6, 4], keys)),
        ("a pixel twice", chunk([5, 5], keys)),
        ("keys that descend", chunk([4, 6], [(8, 0), (0, 1), (8, 1)])),
        ("a key twice", chunk([4, 6], [(8, 0), (8, 0), (8, 1)])),
        ("an end that there is not", chunk([4, 6], [(0, 1), (9, 0), (8, 1)])),
        ("a class that there is not", chunk([4, 6], [(0, 2), (8, 0), (8, 1)])),
    ] {
        assert!(!is_of(chunk), "{what}");
    }
}

#[test]
fn a_pattern_has_the_pixels_and_channels_of_its_rig() {
    let size = Resolution::new(2, 1);
    let pattern =
        |channels: usize| Image::new(size, channels, (0..2 * channels).map(|at| at as f32).collect());
    let planes_of = |channels, kind| pattern(channels).and_then(|pattern| planes(&pattern, size, kind));
    let is = |found: Result<Vec<Vec<f64>>>, expected: &[[f64; 2]]| found.is_ok_and(|found| found == expected);
    assert!(is(planes_of(1, Channels::Luma), &[[0.0, 1.0]]));
    assert!(is(planes_of(1, Channels::Rgb), &[[0.0, 1.0]; 3]), "a gray pattern serves all channels");
    assert!(is(planes_of(3, Channels::Rgb), &[[0.0, 3.0], [1.0, 4.0], [2.0, 5.0]]));
    assert!(planes_of(3, Channels::Luma).is_err(), "a photo in luminance has a gray pattern");
    assert!(pattern(1).and_then(|pattern| planes(&pattern, Resolution::new(1, 2), Channels::Luma)).is_err());
}

#[test]
fn a_photo_is_the_product_with_the_explicit_matrix() {
    let matrix = Csr::new(2, vec![0, 2, 3], vec![0, 1, 0], vec![1.0, 0.5, 0.25]);
    let mut explicit =
        ExplicitMatrix::new(matrix.expect("well formed"), Resolution::new(2, 1)).expect("of two pixels");
    let pattern = Image::new(Resolution::new(2, 1), 1, vec![2.0, 4.0]).expect("two samples");
    assert_eq!(explicit.photograph(&pattern).expect("it fits").samples(), [4.0, 0.5]);
    assert!(ExplicitMatrix::new(explicit.matrix().clone(), Resolution::new(2, 2)).is_err());
}

#[test]
fn direct_and_global_light_of_an_explicit_matrix_add_up_to_it() {
    let matrix = Csr::new(2, vec![0, 2, 4], vec![0, 1, 0, 1], vec![4.0, 1.0, 2.0, 8.0]).expect("well formed");
    let weights = |part| ExplicitMatrix::part_of(&matrix, part).expect("well formed").weights().to_vec();
    assert_eq!([weights(Part::Direct), weights(Part::Global)], [vec![4.0, 8.0], vec![1.0, 2.0]]);
}
