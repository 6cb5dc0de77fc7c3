//! The size of dispatches, which depends on their measured time, and the error for paths that the driver leaves unfinished.

use std::collections::HashMap;
use std::num::NonZero;
use std::sync::OnceLock;
use std::time::Duration;

use super::geometry::GpuScene;
use super::kernel::{Parameters, SceneFeatures};
use super::pairs::Pair;
use crate::error::Error;
use crate::gpu::Gpu;

/// The target time of a dispatch: short enough for progress, cancellation and a GPU's watchdog, and long enough to make overhead
/// negligible.
const TARGET: Duration = Duration::from_millis(100);

/// The maximum number of bytes of records that a dispatch writes. So many paths keep a GPU busy.
const RECORD_BYTES: u64 = 64 << 20;

/// The same maximum for a device that is the processor itself. The processor's caches should hold the records.
const RECORD_BYTES_IN_CACHE: u64 = 8 << 20;

/// The maximum number of paths of one dispatch: 65,535 workgroups of 64.
pub(super) const MAX_PATHS: u32 = 65_535 * 64;

/// The maximum number of surfaces that all paths of one invocation hit together. Software Vulkan stops an invocation after 65,535 loop
/// iterations. Even in a scene of a million triangles, an invocation reached a thousand surfaces within these iterations.
const SURFACES_OF_INVOCATION: u32 = 384;

const MAX_PATHS_PER_INVOCATION: u32 = 64;

/// The maximum number of paths that one invocation traces, one after the other.
///
/// Software Vulkan executes eight invocations in lockstep. With one path each, all eight would wait for the longest path. With several
/// paths each, an invocation starts its next path instead of waiting. One path each is faster in three cases: if paths gather photons,
/// because the lanes of one pixel then read the same photons; if rays test each of a few triangles, because compiling the loop takes longer
/// than the loop saves; and on a GPU, which runs other invocations while one waits. Measurements: guide/src/right/speed.md.
pub(super) fn max_paths_per_invocation(
    gpu: &Gpu,
    scene: &SceneFeatures,
    gathers: bool,
    max_bounces: u32,
) -> u32 {
    if gpu.summary.is_processor() && scene.few_pairs == 0 && !gathers {
        (SURFACES_OF_INVOCATION / max_bounces).clamp(1, MAX_PATHS_PER_INVOCATION)
    } else {
        1
    }
}

/// The number of cores over which software Vulkan distributes a dispatch. The system reads it from files, so it is determined only once.
fn cores() -> u32 {
    static CORES: OnceLock<u32> = OnceLock::new();
    *CORES.get_or_init(|| std::thread::available_parallelism().map_or(1, NonZero::get) as u32)
}

#[derive(Default)]
pub(super) struct Dispatches {
    count: u32,
}

impl Dispatches {
    /// A mark for the next dispatch, in the upper 16 bits. It is not 0, and it differs from the last 65,534 marks.
    pub(super) fn mark(&mut self) -> u32 {
        self.count = self.count % 0xffff + 1;
        self.count << 16
    }

    /// The maximum number of paths of one dispatch, for a trace of `total` paths. Each path has `stride` slots of 16 bytes, and each
    /// invocation traces up to `per_invocation` paths. On a processor, all cores get the same number of workgroups, unless there are fewer
    /// workgroups than cores.
    pub(super) fn capacity(&self, gpu: &Gpu, stride: u64, per_invocation: u32, total: u64) -> u32 {
        let target = if gpu.shares_memory { RECORD_BYTES_IN_CACHE } else { RECORD_BYTES };
        let bytes = target.min(gpu.summary.max_storage_binding).min(gpu.summary.max_buffer);
        let paths = (bytes / (16 * stride)).min(u64::from(MAX_PATHS)).min(total.max(64)) as u32;
        let even = if gpu.summary.is_processor() { 64 * per_invocation * cores() } else { 1 };
        if paths < even { paths } else { paths / even * even }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PathWork {
    max_bounces: u32,
    stride: u32,
    bucket_mask: u32,
    gather_radius: f32,
}

impl PathWork {
    pub(super) fn of(parameters: &Parameters) -> Self {
        let &Parameters { max_bounces, stride, bucket_mask, gather_radius, .. } = parameters;
        Self { max_bounces, stride, bucket_mask, gather_radius }
    }
}

/// Chooses the number of paths of one kernel's dispatches: the measured time of a dispatch determines the number of paths of the next one.
/// A tracer keeps the sizer between traces, so only the first trace has to search for this number.
#[derive(Debug, Default)]
pub(super) struct DispatchSizer {
    /// The target number of paths. It is `None` before the first dispatch, whose time is not used because it includes compiling the
    /// pipeline.
    target: Option<u32>,
    work: Option<PathWork>,
    /// Whether each invocation traces only one path, because the driver stopped invocations with several paths.
    one_path_each: bool,
}

impl DispatchSizer {
    /// Number of paths of the dispatch that compiles the pipeline.
    const COLD: u32 = 64;
    /// Number of paths of the first dispatch whose time is used.
    const FIRST: u32 = 4096;
    /// The maximum factor by which one measurement increases the number of paths. It is limited because the next paths may take longer.
    const GROWTH: f64 = 16.0;

    /// Prepares for a trace of paths of this kind. If the last trace had another kind, the search for the number of paths starts again.
    pub(super) fn begin(&mut self, work: PathWork) {
        if self.work.replace(work) != Some(work) {
            self.one_path_each = false;
            self.target = self.target.map(|_| Self::FIRST);
        }
    }

    /// Begins with this number of paths if no dispatch has been measured yet, on a device that compiles kernels beforehand.
    pub(super) fn start_with(&mut self, paths: u32) {
        self.target = self.target.or(Some(paths));
    }

    pub(super) fn paths(&self, most: u32) -> u32 {
        self.target.unwrap_or(Self::COLD).min(most)
    }

    /// The number of paths per invocation, at most `most`, in a dispatch of `paths` paths. Each core gets four workgroups, so that all
    /// cores finish together.
    pub(super) fn paths_per_invocation(&self, paths: u32, most: u32) -> u32 {
        paths.div_ceil(64 * 4 * cores()).clamp(1, if self.one_path_each { 1 } else { most })
    }

    pub(super) fn one_path_each(&mut self) {
        self.one_path_each = true;
    }

    /// The maximum number of dispatches in flight: two once the number of paths has been measured, so that the device need not wait for the
    /// host.
    pub(super) fn max_in_flight(&self) -> usize {
        if self.target.is_some() { 2 } else { 1 }
    }

    pub(super) fn adapt(&mut self, paths: u32, elapsed: Duration) {
        let Some(target) = self.target else {
            self.target = Some(Self::FIRST);
            return;
        };
        let factor = TARGET.as_secs_f64() / elapsed.as_secs_f64().max(1e-6);
        // In a dispatch smaller than the target (the last one of a trace, or one at the capacity), overhead dominates. The time of such a
        // dispatch can only show that the target is too large.
        if paths < target && factor >= 1.0 {
            return;
        }
        let next = f64::from(paths) * factor.min(Self::GROWTH);
        self.target = Some((next as u32).next_multiple_of(64).clamp(64, MAX_PATHS));
    }
}

/// The number of loop iterations after which software Vulkan ends an invocation without an error.
const MAX_ITERATIONS: usize = 65_535;

/// If at least this many triangles lie in one place, the error names them as the reason. The number is smaller than the limit of
/// iterations, because a path of several bounces passes the place several times.
const PILE: usize = MAX_ITERATIONS / 16;

/// The scene's diagonal, divided by the smallest distance at which two places count as different.
const CELLS: f32 = 1000.0;

/// The error for light paths that never finished. If triangles are piled up in one place, the error names this as the reason.
pub(super) fn unfinished_paths(unfinished: u64, total: u64, scene: &GpuScene) -> Error {
    let (pile, size) = highest(&scene.pairs_in_order);
    let size = size * scene.unit.metres;
    let help = if pile >= PILE {
        format!(
            "{pile} triangles lie in one place, {size:.3} m wide, and a ray has to test all of them, but software Vulkan ends a path \
             after {MAX_ITERATIONS} tests: remove the objects that lie on one another, or trace on a GPU (--adapter)"
        )
    } else {
        "lower --max-bounces, or use another --adapter".into()
    };
    Error::UnfinishedPaths { unfinished, total, help }
}

/// The largest number of triangles whose boxes are equal up to a thousandth of the scene's size, and the diagonal of their common box.
fn highest(pairs: &[Pair]) -> (usize, f64) {
    let all = pairs.iter().map(Pair::extent).reduce(|[a, b], [c, d]| [a.min(c), b.max(d)]);
    let cell = all.map_or(1.0, |[low, high]| low.distance(high) / CELLS).max(f32::MIN_POSITIVE);
    let mut counts: HashMap<[[i64; 3]; 2], usize> = HashMap::new();
    let mut most = (0, 0.0);
    for pair in pairs {
        let [low, high] = pair.extent();
        let key =
            [low, high].map(|corner| corner.to_array().map(|coordinate| (coordinate / cell).round() as i64));
        let count = counts.entry(key).or_default();
        *count += pair.triangles().count();
        if *count > most.0 {
            most = (*count, f64::from(low.distance(high)));
        }
    }
    most
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    const WORK: PathWork = PathWork { max_bounces: 6, stride: 6, bucket_mask: 0, gather_radius: 0.0 };

    fn sized(millis: &[u64]) -> DispatchSizer {
        let mut sizer = DispatchSizer::default();
        sizer.begin(WORK);
        for &millis in millis {
            sizer.adapt(sizer.paths(u32::MAX), Duration::from_millis(millis));
        }
        sizer
    }

    #[test]
    fn a_dispatch_grows_towards_its_target_time_in_limited_steps() {
        assert_eq!((sized(&[]).paths(u32::MAX), sized(&[]).max_in_flight()), (64, 1), "nothing is known");
        assert_eq!(
            (sized(&[900]).paths(u32::MAX), sized(&[900]).max_in_flight()),
            (4096, 2),
            "the first dispatch compiled the kernel"
        );
        assert_eq!(sized(&[900, 50]).paths(u32::MAX), 8192);
        assert_eq!(sized(&[900, 1]).paths(u32::MAX), 16 * 4096);
        assert_eq!(sized(&[900, 1, 1]).paths(u32::MAX), 256 * 4096);
        assert_eq!(sized(&[900, 1, 1, 1, 1]).paths(u32::MAX), MAX_PATHS);
        assert_eq!(sized(&[900, 400]).paths(u32::MAX), 1024, "too long");
        assert_eq!(sized(&[900, 1]).paths(100), 100, "no more than the capacity");
    }

    #[test]
    fn an_invocation_traces_several_paths_where_all_cores_have_enough() {
        let cores = cores();
        let mut sizer = DispatchSizer::default();
        assert_eq!(
            [64, 256 * cores, 10 * 256 * cores].map(|paths| sizer.paths_per_invocation(paths, 64)),
            [1, 1, 10]
        );
        assert_eq!(sizer.paths_per_invocation(1000 * 256 * cores, 64), 64);
        sizer.begin(WORK);
        sizer.one_path_each();
        sizer.begin(WORK);
        assert_eq!(
            sizer.paths_per_invocation(1000 * 256 * cores, 64),
            1,
            "the driver stopped invocations with several paths"
        );
        sizer.begin(PathWork { max_bounces: 2, ..WORK });
        assert_eq!(sizer.paths_per_invocation(1000 * 256 * cores, 64), 64);
    }

    #[test]
    fn a_small_last_dispatch_changes_the_size_only_if_it_took_too_long() {
        let mut sizer = sized(&[900, 1]);
        sizer.adapt(64, Duration::from_millis(2));
        assert_eq!(sizer.paths(u32::MAX), 16 * 4096);
        sizer.adapt(6400, Duration::from_millis(200));
        assert_eq!(sizer.paths(u32::MAX), 3200);
    }

    #[test]
    fn the_next_trace_keeps_the_size_unless_its_paths_differ() {
        let mut sizer = sized(&[900, 1]);
        sizer.begin(WORK);
        assert_eq!(sizer.paths(u32::MAX), 16 * 4096);
        sizer.begin(PathWork { max_bounces: 64, ..WORK });
        assert_eq!((sizer.paths(u32::MAX), sizer.max_in_flight()), (4096, 2));
    }

    #[test]
    fn the_highest_pile_is_found() {
        let corners = [Vec3::ZERO, 3.0 * Vec3::X, 4.0 * Vec3::Y];
        let aside = corners.map(|corner| corner + Vec3::Z);
        let pairs: Vec<Pair> =
            (0..7).map(|at| Pair::alone(at, if at % 3 == 0 { aside } else { corners })).collect();
        assert_eq!(highest(&pairs), (4, 5.0));
        let nearly = |at: usize| corners.map(|corner| corner + at as f32 * 1e-6 * Vec3::Z);
        let pairs: Vec<Pair> = (0..7).map(|at| Pair::alone(at, nearly(at))).collect();
        assert_eq!(highest(&pairs).0, 7);
        assert_eq!(highest(&[]), (0, 0.0));
    }
}
