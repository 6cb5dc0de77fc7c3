//! Tests of the memory that matrices and messages take, while they are made and afterwards.

#![allow(unsafe_code, reason = "a global allocator that counts cannot be written without")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;
use std::ops::Range;
use std::sync::atomic::{AtomicIsize, Ordering::SeqCst};

use crate::image::Resolution;
use crate::team::threads;
use crate::transport::contributions::{Chunk, Chunks, Found, Key, Row, Term, Terms};
use crate::transport::merging::{Merging, Pairs};
use crate::transport::row_sums::{FixedSums, Scale, row_sums};
use crate::transport::spread::{Combined, Steps, merge};
use crate::transport::tiles::{CompressedRows, Entries, Fragment, Pages, Tiles, groups};
use crate::transport::transpose::Sources;
use crate::transport::{Bounces, Channels, Layer, Part, RigShape, TransportMatrix, wire};

/// The bytes that some threads have allocated and not freed: the current number, and its maximum.
#[derive(Default)]
struct Counter {
    now: AtomicIsize,
    most: AtomicIsize,
}

thread_local! {
    /// The counter of this thread. Threads of other tests have no counter, or a different one.
    static COUNTER: Cell<Option<&'static Counter>> = const { Cell::new(None) };
}

struct Counting;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn count(bytes: isize) {
    // A thread that is ending has no counter any more.
    if let Ok(Some(counter)) = COUNTER.try_with(Cell::get) {
        let now = counter.now.fetch_add(bytes, SeqCst) + bytes;
        counter.most.fetch_max(now, SeqCst);
    }
}

// SAFETY: all calls go to the system's allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        count(size as isize - layout.size() as isize);
        unsafe { System.realloc(pointer, layout, size) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        unsafe { System.dealloc(pointer, layout) }
    }
}

/// The memory of a computation, in its own threads only: the bytes of its input, the peak including the input, and the bytes left at the
/// end.
#[derive(Clone, Copy, Debug)]
struct Bytes {
    given: usize,
    most: usize,
    left: usize,
}

/// Runs `make`, and then `work` on the result of `make`, on the same `threads` threads. Returns the result of `work`, and the memory of
/// `work`.
fn measured<A: Send, T: Send>(
    threads: usize,
    make: impl FnOnce() -> A + Send,
    work: impl FnOnce(A) -> T + Send,
) -> (T, Bytes) {
    let counter: &'static Counter = Box::leak(Box::default());
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .start_handler(move |_| COUNTER.set(Some(counter)))
        .build();
    pool.expect("threads can be started").install(|| {
        // The threads keep some memory after their first work, so they work once before counting starts.
        rayon::join(|| rayon::broadcast(|_| ()), || ());
        counter.now.store(0, SeqCst);
        let given = make();
        let bytes = |counter: &AtomicIsize| counter.load(SeqCst).unsigned_abs();
        let before = bytes(&counter.now);
        counter.most.store(counter.now.load(SeqCst), SeqCst);
        let made = work(given);
        (made, Bytes { given: before, most: bytes(&counter.most), left: bytes(&counter.now) })
    })
}

/// A bound for the bytes of everything except the large arrays of a test, such as lists of tasks and vectors of vectors.
const SMALL: usize = 100_000;

/// The bytes in one channel of a contribution (position, mean and error), and of a layer's entry (column and weight).
const TERM: usize = 12;
const ENTRY: usize = 8;

const SIDE: usize = 64;
const PIXELS: usize = SIDE * SIDE;
const EACH: usize = 96;

fn rig(symmetric: bool) -> RigShape {
    let size = Resolution::new(SIDE, SIDE);
    RigShape { camera: size, projector: size, symmetric }
}

/// Contributions of two-bounce light from each pixel to `each` other pixels, evenly spaced. The chunks have 64 pixels.
fn chunks(from_camera: bool, each: usize) -> Vec<Chunk<1>> {
    let chunk = |first: usize| {
        let rows = (0..64).map(|row| Row { pixel: (first + row) as u32, from_camera, end: each * (row + 1) });
        let terms = (first..first + 64).flat_map(|pixel| {
            (0..each).map(move |other| {
                let place = other * PIXELS / each + pixel * 31 % (PIXELS / each);
                Term { mean: [1.0 + other as f32], error: [0.5], ..Term::none(Key::new(place as u32, 1)) }
            })
        });
        Chunk { rows: rows.collect(), terms: Terms::Short(terms.collect()) }
    };
    (0..PIXELS).step_by(64).map(chunk).collect()
}

/// Rows of `cols` columns in pieces of 64 rows, each row with [`EACH`] entries.
fn pieces(rows: usize, cols: usize) -> Vec<CompressedRows> {
    let piece = |_| {
        let mut piece = CompressedRows::with_room(1, 64, 64 * EACH);
        for row in 0..64 {
            piece.columns.extend((0..EACH).map(|at| (at * (cols / EACH) + row % 7) as u32));
            piece.weights[0].extend((0..EACH).map(|at| at as f32));
            piece.end_row();
        }
        piece
    };
    (0..rows / 64).map(piece).collect()
}

/// The maximum number of rows that become tiles at the same time, relative to all rows.
fn group(threads: usize) -> f64 {
    let longest = super::on_threads(threads, || groups(PIXELS).iter().map(Range::len).max());
    longest.unwrap_or(0) as f64 / PIXELS as f64
}

/// Contributions are freed while the matrix grows, so the peak is below the sum of their sizes. A group of rows that is being merged takes
/// additional memory: for the transpose (half of its contributions), for its rows as the tasks merged them, and for its rows as one piece.
#[test]
fn a_triangle_gives_contributions_back_while_the_tiles_grow() {
    for count in [1, 2] {
        let make = || Found::of_chunks(chunks(true, EACH));
        let alone = threads(1);
        let steps = Steps::one(rig(true));
        let (combined, bytes) =
            measured(count, make, |found| merge(&alone[0], rig(true), &steps, found, 2, &[]));
        let Combined { layers, rows, .. } = combined.unwrap_or_else(|error| unreachable!("{error}"));
        let entries: usize = layers.iter().map(Tiles::nonzeros).sum();
        let tiles: usize = layers.iter().map(Tiles::bytes).sum();
        assert!(entries > 3 * PIXELS * EACH / 2 && bytes.given >= TERM * PIXELS * EACH);
        // The first rows have the most entries on and above the diagonal.
        let share = group(count) * (2.0 - group(count));
        let of_group = (share * ((TERM / 2 + 2 * ENTRY) * PIXELS * EACH) as f64) as usize;
        // Each pixel needs memory for its sums, the location of its contributions, the cursor of a task and the number of its
        // contributions.
        let of_pixels = 150 * PIXELS;
        let bound = bytes.given.max(tiles) + of_group + of_pixels;
        assert!(bound < bytes.given + tiles, "the bound tells something: {bound}, {bytes:?}, {tiles}");
        assert!(bytes.most <= bound, "{count} threads: {bytes:?} above {bound}; {tiles} of tiles");
        // At the end, only the matrix and the sums over its rows are left. The queues of the thread pool may have grown or shrunk, by 26 kB in
        // one of thirty runs. Contributions that were kept would be 4.8 MB.
        let kept = tiles + size_of_val(&rows[..]);
        assert!(bytes.left.abs_diff(kept) < SMALL / 2, "{bytes:?}, {kept}");
    }
}

#[test]
fn rows_are_given_back_as_they_become_tiles() {
    let (tiles, bytes) = measured(1, || pieces(PIXELS, PIXELS), |pieces| Tiles::new(PIXELS, pieces));
    let of_group = (group(1) * bytes.given as f64) as usize;
    // Besides its pieces, a group is in memory two more times: as windows of rows, and as tiles.
    let bound = bytes.given.max(tiles.bytes()) + 2 * of_group + SMALL;
    assert!(bound < bytes.given + tiles.bytes(), "the bound tells something: {bound}, {bytes:?}");
    assert!(bytes.most <= bound, "{bytes:?} above {bound}");
}

#[test]
fn a_matrix_takes_the_bytes_that_it_states() {
    let make = || (pieces(PIXELS, PIXELS), pieces(PIXELS, PIXELS));
    let (matrix, bytes) = measured(1, make, |(one, more)| {
        let layers = vec![Layer::new(Bounces::One, PIXELS, one), Layer::new(Bounces::Global, PIXELS, more)];
        TransportMatrix::new(rig(true), Channels::Luma, vec![vec![1.0; PIXELS]], layers)
    });
    assert_eq!(matrix.nonzeros(), 2 * PIXELS * EACH);
    // Each entry has two bytes for its column and four for its weight, and the diagonal is additional. Padding adds less than a byte per
    // entry.
    let least = 6 * matrix.nonzeros() + 4 * PIXELS;
    assert!((least..least + matrix.nonzeros()).contains(&matrix.bytes()), "{} of {least}", matrix.bytes());
    // Lists of bands, and arrays that end within a word, make a small difference.
    let off = bytes.left.abs_diff(matrix.bytes());
    assert!(off < 4000, "{} are stated: {bytes:?}", matrix.bytes());
}

#[test]
fn a_matrix_is_read_in_pieces() {
    for threads in [1, 3] {
        let make = || Tiles::new(PIXELS, pieces(PIXELS, PIXELS));
        let (pieces, bytes) = measured(threads, make, |tiles| {
            let row_start = tiles.row_start(Entries::All);
            let columns = tiles.columns(Entries::All, &row_start).map(|piece| piece.len());
            let weights = tiles.weights(Entries::All, 0, &row_start).map(|piece| piece.len());
            columns.zip(weights).collect::<Vec<_>>()
        });
        assert!(
            pieces.len() >= 4 && pieces.iter().map(|(columns, _)| columns).sum::<usize>() == PIXELS * EACH
        );
        let longest = pieces.iter().map(|(columns, _)| *columns).max().unwrap_or(0);
        // Each thread holds a band's columns and then its weights (four bytes each), the offsets of the band's rows, and the locations of
        // these rows in a tile.
        let of_rows = 8 * 2 * PIXELS + threads * PIXELS.div_ceil(pieces.len()) * 48;
        let bound = bytes.given + threads * 2 * 4 * longest + of_rows + SMALL;
        assert!(bytes.most <= bound, "{threads} threads: {bytes:?} above {bound}");
    }
}

/// A product needs memory for the sums of the bands in progress. A block also needs memory for four interleaved vectors.
#[test]
fn products_take_the_memory_of_some_bands() {
    let make = || {
        let layers = vec![Layer::new(Bounces::Global, PIXELS, pieces(PIXELS, PIXELS))];
        let matrix = TransportMatrix::new(rig(false), Channels::Luma, vec![Vec::new()], layers);
        let (x, mut ys) = (vec![1.0; PIXELS], vec![vec![0.0; PIXELS]; 3]);
        // The first products of a process time the kernels, so they are not counted.
        matrix.apply(Part::Full, 0, &x, &mut ys[0]);
        let mut to: Vec<&mut [f64]> = ys.iter_mut().map(Vec::as_mut_slice).collect();
        matrix.apply_block(Part::Full, 0, &[x.as_slice(); 3], &mut to);
        (matrix, x, ys)
    };
    let (rows, one) = measured(1, make, |(matrix, x, mut ys)| {
        matrix.apply(Part::Full, 0, &x, &mut ys[0]);
        matrix.layers[0].tiles().band_rows()
    });
    assert!(rows <= PIXELS / 4);
    assert!(one.most <= one.given + 8 * (rows + 1) + SMALL / 10, "{one:?}");
    let ((), block) = measured(1, make, |(matrix, x, mut ys)| {
        let mut to: Vec<&mut [f64]> = ys.iter_mut().map(Vec::as_mut_slice).collect();
        matrix.apply_block(Part::Full, 0, &[x.as_slice(); 3], &mut to);
    });
    assert!(block.most <= block.given + 32 * (2 * PIXELS + rows + 1) + SMALL / 10, "{block:?}");
}

/// While rows are merged, they are in memory three times: as transposed contributions, as the rows that the tasks merged, and as one piece.
#[test]
fn merging_takes_the_contributions_and_twice_their_rows() {
    let make = || Sources::new(chunks(false, EACH), rig(false), &(0..PIXELS), false);
    let (entries, bytes) = measured(1, make, |sources| {
        let pieces = Merging::new(sources, Pairs::Apart, 0, &[]).pieces(&(0..PIXELS), 2);
        pieces.iter().flatten().map(|piece| piece.columns.len()).sum::<usize>()
    });
    assert_eq!(entries, PIXELS * EACH);
    // Each of eight tasks has the offset of each row, and the next free position of each row.
    let of_rows = 8 * 2 * 8 * PIXELS;
    let bound = bytes.given + (TERM + 2 * ENTRY) * entries + of_rows + SMALL;
    assert!(bytes.most <= bound, "{bytes:?} above {bound}");
}

/// On four threads, the tasks' sums together take at most a quarter of the contributions' memory. If they would take more, a single task
/// computes all sums.
#[test]
fn sums_over_rows_take_a_quarter_of_the_contributions() {
    for (each, tasks) in [(3, 1), (24, 2), (72, 4)] {
        let work = |chunks: Vec<Chunk<1>>| {
            let chunks: Vec<&Chunk<1>> = chunks.iter().collect();
            row_sums(&chunks, rig(true), Scale::new(130))
        };
        let (sums, bytes) = measured(4, || chunks(true, each), work);
        let (alone, _) = measured(1, || chunks(true, each), work);
        let counts = |threads| {
            let count = |chunks| Sources::new(chunks, rig(true), &(0..PIXELS), false).counts(0);
            measured(threads, || chunks(true, each), count).0
        };
        let terms = counts(4);
        assert!(sums == alone && terms == counts(1));
        assert_eq!(
            (Found::of_chunks(chunks(true, each)).about.of_class, terms.iter().sum::<u32>()),
            ([0, PIXELS * each, 0], (2 * PIXELS * each) as u32)
        );
        // Each row has two sums of sixteen bytes each.
        let of_task = 32 * PIXELS;
        assert!(tasks == 1 || tasks * of_task <= bytes.given / 4);
        // The list of rows with contributions has 32 bytes for each row. Its allocated memory may be twice as large.
        let of_lists = 2 * 32 * PIXELS;
        let made = size_of::<FixedSums<1>>() * PIXELS;
        let bound = bytes.given + tasks * of_task + of_lists + made;
        assert!(bytes.most <= bound, "{each} of each pixel: {bytes:?} above {bound}");
    }
}

/// Long arrays are on separate pages, which the system gets back when they are freed. Short arrays end within a word.
#[test]
fn long_arrays_are_on_pages_of_their_own() {
    for (length, own) in [(1, 8), (1001, 4008), ((1 << 20) - 1, 1 << 22), (1 << 20, 0), ((1 << 20) + 1, 0)] {
        let (_, bytes) = measured(1, || (), |()| Pages::<f32>::zeros(length));
        assert_eq!(bytes.left, own, "{length} numbers of four bytes");
    }
}

/// Contributions in small chunks are joined into long chunks on separate pages. The remaining small chunks take less than four megabytes.
#[test]
fn many_small_chunks_are_joined_while_they_come() {
    let rows = || chunks(true, EACH).into_iter().chain(chunks(true, EACH)).chain(chunks(true, EACH));
    let all = 3 * TERM * PIXELS * EACH;
    let (joined, bytes) = measured(
        1,
        || (),
        |()| {
            let mut joined = Chunks::new();
            // The input has three times the minimum size of a long chunk.
            rows().for_each(|chunk| joined.push(chunk));
            joined.into_chunks()
        },
    );
    assert_eq!(joined.iter().map(|chunk| TERM * chunk.terms.len()).sum::<usize>(), all);
    let lengths: Vec<usize> = joined.iter().map(|chunk| TERM * chunk.terms.len()).collect();
    let (last, long) = lengths.split_last().expect("there are some");
    let of_chunk = all / 192;
    assert!(long.iter().all(|bytes| (1 << 22..(1 << 22) + of_chunk).contains(bytes)), "{lengths:?}");
    assert!(*last < (1 << 22) + of_chunk);
    let of_rows = 2 * size_of::<Row>() * 3 * PIXELS;
    assert!(bytes.left < (1 << 22) + of_rows, "{bytes:?}");
}

#[test]
fn messages_take_no_more_than_their_bytes() {
    let (message, _) = measured(
        1,
        || chunks(true, EACH),
        |chunks| wire::chunks_to_bytes(&chunks.iter().collect::<Vec<_>>(), true, &(100..3000)),
    );
    assert!(message.len() > TERM * PIXELS * EACH / 2);
    assert_eq!(message.capacity(), message.len(), "its length is known before");
    let fragments: Vec<Fragment> = (0..40).map(|number| fragment(number, 150 + number)).collect();
    let mut message = Vec::new();
    wire::put_fragments(&mut message, &fragments).expect("memory takes all bytes");
    let free = message.capacity() - message.len();
    assert!(
        free < 64 * 40,
        "its lengths are taken to be a little longer than they are: {free} of {}",
        message.len()
    );
}

fn fragment(first: usize, entries: usize) -> Fragment {
    Fragment {
        first,
        base: 7,
        row_start: (0..11).map(|row| (row * entries / 10) as u32).collect(),
        columns: (0..entries).map(|at| at as u16).collect(),
        weights: vec![vec![0.5; entries]; 2],
    }
}
