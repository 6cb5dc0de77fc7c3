//! Memory and threads: a step allocates no long vector once the memory is set aside, and the bits do not depend on
//! the number of threads. An own binary, since it counts every allocation.
#![allow(clippy::unwrap_used, reason = "in a test a panic is the report")]
#![allow(unsafe_code, reason = "a global allocator that counts cannot be written without")]

mod comb;

use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

use comb::Comb;
use krylux::krylov::{
    Advance, Constraint, Diagonal, EigsMethod, EigsOptions, Factorization, ForwardOnly, METHODS, Method,
    Multiscale, Preconditioner, Side, SolveOptions, Solver, Start, Which, eigs, eigs_from,
};
use krylux::operator::Operator;

/// Counts allocations that could hold a vector of the test's space.
struct Counting;

/// Shorter ones are not counted: coefficients, partial sums.
const N: usize = 50_000;
static LONG: AtomicUsize = AtomicUsize::new(0);
/// Those that have not been given back.
static LIVE: AtomicUsize = AtomicUsize::new(0);
static ALONE: Mutex<()> = Mutex::new(());

fn count(layout: Layout) {
    if layout.size() >= 8 * N {
        LONG.fetch_add(1, SeqCst);
        LIVE.fetch_add(1, SeqCst);
    }
}

// SAFETY: everything is passed on to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout);
        unsafe { System.alloc(layout) }
    }
    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout);
        unsafe { System.alloc_zeroed(layout) }
    }
    unsafe fn realloc(&self, pointer: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        if size >= 8 * N {
            LONG.fetch_add(1, SeqCst);
            LIVE.fetch_add(1, SeqCst);
        }
        if layout.size() >= 8 * N {
            LIVE.fetch_sub(1, SeqCst);
        }
        unsafe { System.realloc(pointer, layout, size) }
    }
    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        if layout.size() >= 8 * N {
            LIVE.fetch_sub(1, SeqCst);
        }
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn long_allocations(work: impl FnOnce()) -> usize {
    let before = LONG.load(SeqCst);
    work();
    LONG.load(SeqCst) - before
}

#[test]
fn steps_allocate_no_long_vector_once_memory_is_set_aside() {
    let _alone = ALONE.lock();
    let start = Start::default();
    let mut lanczos = Factorization::lanczos(&start.vector(N), &[]).unwrap();
    let mut block = Factorization::block_lanczos(&start.block(N, 3), &[]).unwrap();
    let mut arnoldi = Factorization::arnoldi(&start.vector(N), &[]).unwrap();
    let processes: [&mut Factorization; 3] = [&mut lanczos, &mut block, &mut arnoldi];
    for process in processes {
        let without = long_allocations(|| {
            process.expand(&mut Comb::indefinite(N)).unwrap();
        });
        assert_eq!(without, 1, "the new basis vector, and that only");
        process.reserve(20);
        let with = long_allocations(|| {
            for _ in 1..20 {
                process.expand(&mut Comb::indefinite(N)).unwrap();
            }
        });
        assert_eq!(with, 0, "{} products", process.products());
    }
}

#[test]
fn storage_is_what_the_table_of_methods_says() {
    let _alone = ALONE.lock();
    let run = |method, count, products| {
        let which = Which::LargestMagnitude;
        let options =
            EigsOptions { count, which, products, method, tolerance: 0.0, ..EigsOptions::default() };
        long_allocations(|| {
            eigs(&mut Comb::indefinite(N), &options).unwrap();
        })
    };
    // The answer's vectors (one), the start as drawn, as passed on, and as orthogonalized are on top of the table.
    for (method, of_the_table) in [
        (EigsMethod::Lanczos, 12 + 2),
        (EigsMethod::BlockLanczos { block: 3 }, 12 + 3 + 1),
        (EigsMethod::Arnoldi, 12 + 2),
    ] {
        let starts = if method == (EigsMethod::BlockLanczos { block: 3 }) { 3 } else { 1 };
        let transient = 1 + 3 * starts;
        let counted = run(method, 1, 12);
        assert!((of_the_table..=of_the_table + transient).contains(&counted), "{method:?}: {counted}");
    }
    // Power iteration does not grow with the number of products.
    assert_eq!(run(EigsMethod::Power, 1, 12), run(EigsMethod::Power, 1, 40));
    assert!(run(EigsMethod::Power, 1, 12) <= 4 + 4);
}

/// Bright and dark parts that no pattern in [0, 1] gives.
fn picture() -> Vec<f64> {
    (0..N).map(|i| 1.5 + 2.0 * (i as f64 * 0.37).sin()).collect()
}

fn white() -> Vec<f64> {
    let mut photo = vec![0.0; N];
    Comb::definite(N).apply(&vec![1.0; N], &mut photo).unwrap();
    photo
}

fn steps(solver: &mut Solver, count: usize, what: &str) {
    for _ in 0..count {
        let advance = solver.step(&mut ForwardOnly(&mut Comb::definite(N))).unwrap();
        assert_eq!(advance, Advance::Continuing, "{what}");
    }
}

#[test]
fn solvers_allocate_no_long_vector_after_their_first_iteration() {
    let _alone = ALONE.lock();
    let b = picture();
    let (first, later) = (4, 12);
    for facts in METHODS {
        let plain = SolveOptions { products: 40, rtol: 0.0, ..SolveOptions::default() };
        let with =
            |m: std::sync::Arc<dyn Preconditioner>| SolveOptions { preconditioner: Some(m), ..plain.clone() };
        let mut cases = vec![("plain", plain.clone())];
        if facts.constraint == Constraint::None {
            let diagonal = || std::sync::Arc::new(Diagonal::new(white()).unwrap());
            cases.push(("diagonal", with(diagonal())));
            let multiscale = Multiscale::new(N / 100, 100, vec![1.0, 0.8, 0.6]).unwrap();
            cases.push(("multiscale", with(std::sync::Arc::new(multiscale.scaled_by(white()).unwrap()))));
            if facts.method == Method::Gmres {
                cases.push(("left", SolveOptions { side: Side::Left, ..with(diagonal()) }));
            }
            if matches!(facts.method, Method::Gmres | Method::Fgmres) {
                cases.push(("restarted", SolveOptions { restart: Some(3), ..with(diagonal()) }));
            }
        }
        for (case, options) in cases {
            let what = format!("{}, {case}", facts.name);
            let mut solver = facts.method.solver(N, &b, &options).unwrap();
            // The white photo, where it has to be taken, and an iteration.
            steps(&mut solver, first, &what);
            let counted = long_allocations(|| steps(&mut solver, later, &what));
            assert_eq!(counted, 0, "{what}");
            assert_eq!(solver.tally().products, first + later, "{what}");
        }
    }
}

#[test]
fn solvers_store_what_the_table_of_methods_says() {
    let _alone = ALONE.lock();
    // Threads of another test's pool give back what they kept when they end, which nobody waits for.
    std::thread::sleep(std::time::Duration::from_millis(200));
    let b = picture();
    for facts in METHODS {
        for products in [6, 13] {
            let mut options = SolveOptions { products, rtol: 0.0, ..SolveOptions::default() };
            if facts.constraint != Constraint::None {
                options.diagonal = Some(white());
            }
            if facts.method == Method::Fgmres {
                options.preconditioner = Some(std::sync::Arc::new(Diagonal::new(white()).unwrap()));
            }
            let before = LIVE.load(SeqCst);
            let mut solver = facts.method.solver(N, &b, &options).unwrap();
            steps(&mut solver, products, facts.name);
            let stored = LIVE.load(SeqCst) - before;
            assert_eq!(stored, facts.images + facts.images_per_product * products, "{}", facts.name);
        }
    }
}

#[test]
fn restarts_use_the_memory_that_they_set_free() {
    let _alone = ALONE.lock();
    let mut lanczos = Factorization::lanczos(&Start::default().vector(N), &[]).unwrap();
    let options = |products| EigsOptions {
        count: 2,
        products,
        tolerance: 0.0,
        max_basis: Some(10),
        ..EigsOptions::default()
    };
    eigs_from(&mut lanczos, &mut Comb::indefinite(N), &options(12)).unwrap();
    let later = long_allocations(|| {
        eigs_from(&mut lanczos, &mut Comb::indefinite(N), &options(60)).unwrap();
    });
    // The answer itself: two vectors. The ten restarts ask for nothing.
    assert!(later <= 2 + 2, "{later}");
}

#[test]
fn bits_do_not_depend_on_the_number_of_threads() {
    let _alone = ALONE.lock();
    for method in
        [EigsMethod::Power, EigsMethod::Lanczos, EigsMethod::BlockLanczos { block: 4 }, EigsMethod::Arnoldi]
    {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| {
                let max_basis = matches!(method, EigsMethod::BlockLanczos { .. }).then_some(14);
                let options =
                    EigsOptions { count: 1, products: 25, method, max_basis, ..EigsOptions::default() };
                let found = eigs(&mut Comb::indefinite(N), &options).unwrap();
                (found.values, found.vectors, found.residuals)
            })
        };
        assert_eq!(with(1), with(4), "{method:?}");
    }
}
