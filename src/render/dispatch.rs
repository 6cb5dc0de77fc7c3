//! How much of the work one dispatch takes: sized by measured time, and marked so that none goes missing.

use std::num::NonZero;
use std::sync::OnceLock;
use std::time::Duration;

use super::features::SceneFeatures;
use super::parameters::Parameters;
use crate::gpu::Gpu;

/// A dispatch aims at this time: short enough for progress, cancellation and a GPU's watchdog, long enough that its
/// overhead does not show.
const TARGET: Duration = Duration::from_millis(100);

/// Bytes of records that a dispatch leaves, at most: enough paths to keep a GPU busy.
const RECORD_BYTES: u64 = 64 << 20;

/// The same where the device is the processor itself, and the records had better stay in its caches.
const RECORD_BYTES_IN_CACHE: u64 = 8 << 20;

/// Paths in one dispatch at most: 65,535 workgroups of 64.
pub(super) const MAX_PATHS: u32 = 65_535 * 64;

/// Surfaces that the paths of one invocation meet at most, all together: software Vulkan gives up an invocation after 65,535 turns of
/// its loops. With a million triangles, a thousand surfaces were still met.
const SURFACES_OF_INVOCATION: u32 = 384;

/// Paths of one invocation at most.
const MOST_PATHS: u32 = 64;

/// Paths that one invocation may take, one after the other. On a processor eight of them take every step together, and each path would
/// have to wait for the longest of eight. Not where chains are gathered from: lanes of one pixel had better do that together; nor where
/// rays test each of a few triangles: it takes longer to compile than it saves. A GPU has other invocations to turn to, and the more of
/// them, the better. Measured: see benches/README.md.
pub(super) fn max_paths_per_invocation(
    gpu: &Gpu,
    scene: &SceneFeatures,
    gathers: bool,
    max_bounces: u32,
) -> u32 {
    if gpu.summary.is_processor() && scene.few_pairs == 0 && !gathers {
        (SURFACES_OF_INVOCATION / max_bounces).clamp(1, MOST_PATHS)
    } else {
        1
    }
}

/// What the driver of a processor shares a dispatch out to. Asked once: the answer is read from files.
fn cores() -> u32 {
    static CORES: OnceLock<u32> = OnceLock::new();
    *CORES.get_or_init(|| std::thread::available_parallelism().map_or(1, NonZero::get) as u32)
}

/// The dispatches of one tracer.
#[derive(Default)]
pub(super) struct Dispatches {
    count: u32,
}

impl Dispatches {
    /// A mark for the next dispatch, in the upper 16 bits: not 0, and another than the last 65,534 ones.
    pub(super) fn mark(&mut self) -> u32 {
        self.count = self.count % 0xffff + 1;
        self.count << 16
    }

    /// Paths that one dispatch may take, of `total`, when each leaves `stride` records of 16 bytes and an invocation takes up to `each`.
    /// On a processor as many workgroups for one core as for another, if there is room for one each.
    pub(super) fn capacity(&self, gpu: &Gpu, stride: u64, each: u32, total: u64) -> u32 {
        let wish = if gpu.shares_memory { RECORD_BYTES_IN_CACHE } else { RECORD_BYTES };
        let room = wish.min(gpu.summary.max_storage_binding).min(gpu.summary.max_buffer);
        let paths = (room / (16 * stride)).min(u64::from(MAX_PATHS)).min(total.max(64)) as u32;
        let even = if gpu.summary.is_processor() { 64 * each * cores() } else { 1 };
        if paths < even { paths } else { paths / even * even }
    }
}

/// What decides, beside a kernel and its scene, how long a path takes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Work {
    max_bounces: u32,
    stride: u32,
    bucket_mask: u32,
    gather_radius: f32,
}

impl Work {
    pub(super) fn of(parameters: &Parameters) -> Self {
        let &Parameters { max_bounces, stride, bucket_mask, gather_radius, .. } = parameters;
        Self { max_bounces, stride, bucket_mask, gather_radius }
    }
}

/// How fast a kernel is, as far as its dispatches have told: how many paths the next one takes. Kept between the traces of a tracer,
/// so that only the first one has to find out.
#[derive(Debug, Default)]
pub(super) struct DispatchSizer {
    /// `None` as long as nothing is known: the first dispatch of a pipeline compiles it, so that its time says nothing either.
    wish: Option<u32>,
    work: Option<Work>,
    /// Invocations did not come to the end of several paths.
    one_path_each: bool,
}

impl DispatchSizer {
    /// Paths of the dispatch that compiles.
    const COLD: u32 = 64;
    /// Paths of the first one that tells something.
    const FIRST: u32 = 4096;
    /// A size grows at most so many times by one measurement: what comes next may take longer.
    const GROWTH: f64 = 16.0;

    /// A trace of such paths begins. What others took says nothing of them.
    pub(super) fn begin(&mut self, work: Work) {
        if self.work.replace(work) != Some(work) {
            self.one_path_each = false;
            self.wish = self.wish.map(|_| Self::FIRST);
        }
    }

    /// Paths that the next dispatch takes, at most `most`.
    pub(super) fn paths(&self, most: u32) -> u32 {
        self.wish.unwrap_or(Self::COLD).min(most)
    }

    /// How many of a dispatch's `paths` each invocation takes, at most `most`: so many that each core has four workgroups, which end
    /// at about the same time.
    pub(super) fn paths_per_invocation(&self, paths: u32, most: u32) -> u32 {
        paths.div_ceil(64 * 4 * cores()).clamp(1, if self.one_path_each { 1 } else { most })
    }

    /// Learns that the driver gave up invocations with several paths.
    pub(super) fn one_path_each(&mut self) {
        self.one_path_each = true;
    }

    /// How many dispatches the device should have at a time: a second one, so that it need not wait for the host, as soon as
    /// its size means something.
    pub(super) fn max_in_flight(&self) -> usize {
        if self.wish.is_some() { 2 } else { 1 }
    }

    /// Learns that a dispatch of `paths` took `elapsed`.
    pub(super) fn adapt(&mut self, paths: u32, elapsed: Duration) {
        let Some(wish) = self.wish else {
            self.wish = Some(Self::FIRST);
            return;
        };
        let factor = TARGET.as_secs_f64() / elapsed.as_secs_f64().max(1e-6);
        // The last paths of a trace, or one that may not be larger: it was mostly overhead, and says only that it was not too long.
        if paths < wish && factor >= 1.0 {
            return;
        }
        let next = f64::from(paths) * factor.min(Self::GROWTH);
        self.wish = Some((next as u32).next_multiple_of(64).clamp(64, MAX_PATHS));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORK: Work = Work { max_bounces: 6, stride: 6, bucket_mask: 0, gather_radius: 0.0 };

    fn sized(millis: &[u64]) -> DispatchSizer {
        let mut sizer = DispatchSizer::default();
        sizer.begin(WORK);
        for &millis in millis {
            sizer.adapt(sizer.paths(u32::MAX), Duration::from_millis(millis));
        }
        sizer
    }

    #[test]
    fn a_dispatch_grows_towards_its_target_and_not_by_leaps() {
        assert_eq!((sized(&[]).paths(u32::MAX), sized(&[]).max_in_flight()), (64, 1), "nothing is known");
        assert_eq!(
            (sized(&[900]).paths(u32::MAX), sized(&[900]).max_in_flight()),
            (4096, 2),
            "that was compiling"
        );
        assert_eq!(sized(&[900, 50]).paths(u32::MAX), 8192);
        assert_eq!(sized(&[900, 1]).paths(u32::MAX), 16 * 4096);
        assert_eq!(sized(&[900, 1, 1]).paths(u32::MAX), 256 * 4096);
        assert_eq!(sized(&[900, 1, 1, 1, 1]).paths(u32::MAX), MAX_PATHS);
        assert_eq!(sized(&[900, 400]).paths(u32::MAX), 1024, "too long");
        assert_eq!(sized(&[900, 1]).paths(100), 100, "no more than there is room for");
    }

    #[test]
    fn an_invocation_takes_several_paths_where_there_are_enough_for_all_cores() {
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
        assert_eq!(sizer.paths_per_invocation(1000 * 256 * cores, 64), 1, "the driver gave several up");
        sizer.begin(Work { max_bounces: 2, ..WORK });
        assert_eq!(sizer.paths_per_invocation(1000 * 256 * cores, 64), 64);
    }

    #[test]
    fn the_last_paths_of_a_trace_teach_nothing_unless_they_were_too_many() {
        let mut sizer = sized(&[900, 1]);
        sizer.adapt(64, Duration::from_millis(2));
        assert_eq!(sizer.paths(u32::MAX), 16 * 4096);
        sizer.adapt(6400, Duration::from_millis(200));
        assert_eq!(sizer.paths(u32::MAX), 3200);
    }

    #[test]
    fn the_next_trace_goes_on_where_the_last_one_ended_unless_its_paths_are_others() {
        let mut sizer = sized(&[900, 1]);
        sizer.begin(WORK);
        assert_eq!(sizer.paths(u32::MAX), 16 * 4096);
        sizer.begin(Work { max_bounces: 64, ..WORK });
        assert_eq!((sizer.paths(u32::MAX), sizer.max_in_flight()), (4096, 2));
    }
}
