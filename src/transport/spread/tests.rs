//! A matrix that is spread over threads has the same bits as the matrix of a single process.

use std::thread::JoinHandle;

use super::*;
use crate::image::{Image, Resolution};
use crate::observer::Estimate;
use crate::operator::{Adjoint, Operator};
use crate::scene::builtin;
use crate::sparse::Csr;
use crate::team::threads;
use crate::transport::tests::{apart, on_threads};
use crate::transport::tiles::groups;
use crate::transport::{
    Assembled, Backend, EstimatedOperator, MatrixOperator, Part, Retraced, RigShape, Transport,
    assemble_layers,
};

struct Crew {
    team: Arc<Team>,
    others: Vec<JoinHandle<()>>,
}

/// Limits `compute`, which a member of a team calls, to one thread, so that even a small matrix has several steps on every machine.
fn with_one_thread<T: Send>(compute: impl FnOnce() -> T + Send) -> T {
    on_threads(1, compute)
}

impl Crew {
    fn of(size: usize) -> Self {
        let mut comms = threads(size).into_iter().map(|comm| Arc::new(comm) as Arc<dyn Comm>);
        let leader = comms.next().unwrap_or_else(|| unreachable!("a team has a leader"));
        let serving = |comm: Arc<dyn Comm>| {
            std::thread::spawn(move || {
                let turn = comm.rank();
                with_one_thread(|| {
                    SceneWorker::new(comm, "here".into(), turn).serve();
                });
            })
        };
        Self { others: comms.map(serving).collect(), team: Team::lead(leader, Vec::new()) }
    }

    fn end(self) {
        drop(self.team);
        for other in self.others {
            other.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        }
    }
}

fn tracer(scene: &Scene, crew: Option<&Crew>) -> Result<Tracer> {
    let mut tracer = Tracer::new(scene, None)?;
    // A device rounds its sums in another way than the processors of a team.
    tracer.assemble_on_device(false);
    crew.map_or(Ok(()), |crew| share_scene(&mut tracer, scene, None, &crew.team))?;
    Ok(tracer)
}

struct Case {
    scene: Scene,
    settings: TraceSettings,
    channels: Channels,
}

/// A coaxial rig in colour; a scene with mirrors, whose paths are gathered; and a projector of another size beside the camera.
fn cases() -> Vec<Case> {
    let settings = TraceSettings::new(Resolution::new(13, 11), 6);
    vec![
        Case { scene: builtin::cornell().to_scene(), settings, channels: Channels::Rgb },
        Case { scene: builtin::mirror().to_scene(), settings, channels: Channels::Luma },
        Case {
            scene: apart(builtin::corner().to_scene(), 0.2),
            settings: TraceSettings { projector: Some(Resolution::new(9, 14)), ..settings },
            channels: Channels::Luma,
        },
    ]
}

/// Two cases whose rows are merged in several steps: a coaxial rig, and a projector of another size beside the camera.
fn cases_of_several_steps() -> Vec<Case> {
    let mut cases = cases();
    let apart = cases.swap_remove(2);
    let coaxial = cases.swap_remove(0);
    let settings = TraceSettings::new(Resolution::new(60, 50), 3);
    let projector = Some(Resolution::new(40, 70));
    vec![
        Case { settings, channels: Channels::Luma, ..coaxial },
        Case { settings: TraceSettings { projector, ..settings }, ..apart },
    ]
}

fn pattern(pixels: usize) -> Vec<f64> {
    (0..pixels).map(|pixel| (pixel * 7919 % 1013) as f64 / 1013.0 - 0.4).collect()
}

type Told = (Vec<Vec<f64>>, Vec<f64>, Vec<Csr>);

/// All results of a matrix: products with vectors and blocks in both directions, norms, entries, ambient light and noise.
fn told(traced: &Assembled) -> Result<Told> {
    let matrix = &traced.matrix;
    let (mut vectors, mut norms, mut entries) = (Vec::new(), Vec::new(), Vec::new());
    for part in [Part::Full, Part::Direct, Part::Global] {
        for channel in 0..matrix.channels().count() {
            let mut operator = MatrixOperator::new(matrix, part, channel);
            let (x, y) = (pattern(operator.cols()), pattern(operator.rows()));
            let (mut photo, mut dual) = (vec![f64::NAN; y.len()], vec![f64::NAN; x.len()]);
            operator.apply(&x, &mut photo)?;
            operator.apply_adjoint(&y, &mut dual)?;
            let mut block = [vec![f64::NAN; y.len()], vec![f64::NAN; y.len()], vec![f64::NAN; y.len()]];
            let [a, b, c] = &mut block;
            operator.apply_block(&[&x, &dual, &x], &mut [a, b, c])?;
            vectors.extend([photo, dual]);
            vectors.extend(block);
            norms.push(matrix.frobenius_norm(part, channel));
            entries.push(matrix.to_csr(part, channel)?);
        }
    }
    norms.extend(traced.ambient.samples().iter().copied().map(f64::from));
    if let Some(noise) = &traced.noise {
        norms.extend(noise.white.samples().iter().copied().map(f64::from));
        norms.extend([noise.white_relative, noise.operator, noise.global]);
    }
    norms.extend([matrix.nonzeros() as f64, traced.summary.paths as f64, traced.summary.rays as f64]);
    Ok((vectors, norms, entries))
}

#[test]
fn a_spread_matrix_has_the_bits_of_one_process() -> Result<()> {
    for Case { scene, settings, channels } in cases() {
        for split in [false, true] {
            let alone = assemble_layers(&mut tracer(&scene, None)?, &settings, channels, split)?;
            let expected = told(&alone)?;
            for size in 2..5 {
                let crew = Crew::of(size);
                {
                    let mut tracer = tracer(&scene, Some(&crew))?;
                    let mut traced = assemble_layers(&mut tracer, &settings, channels, split)?;
                    let placed = [Backend::Gpu, Backend::Auto].map(|place| traced.place(&tracer, place));
                    assert!(matches!(placed, [Err(Error::Option { .. }), Ok(None)]) && !traced.is_on_gpu());
                    assert_eq!(traced.matrix.processes(), size);
                    let own = traced.matrix.rows.len();
                    assert!(own > 0 && own < settings.resolution.pixels(), "each process has some rows");
                    assert!(traced.matrix.bounces().eq(alone.matrix.bounces()), "the same layers are kept");
                    // In every process, an entry takes two bytes for its column and four for each weight.
                    let least = traced.matrix.nonzeros() * (2 + 4 * channels.count());
                    assert!(traced.matrix.bytes() >= least, "{} of {least}", traced.matrix.bytes());
                    assert!(told(&traced)? == expected, "{} with {size} processes", scene.path.display());
                }
                crew.end();
            }
        }
    }
    Ok(())
}

#[test]
fn a_matrix_that_is_merged_in_several_steps_has_the_bits_of_one_process() -> Result<()> {
    for Case { scene, settings, channels } in cases_of_several_steps() {
        let expected = told(&assemble_layers(&mut tracer(&scene, None)?, &settings, channels, false)?)?;
        for size in [2, 3] {
            let steps = with_one_thread(|| groups(settings.resolution.pixels() / size).len());
            assert!(steps > 1, "{size} processes have {steps} steps");
            let crew = Crew::of(size);
            {
                let mut tracer = tracer(&scene, Some(&crew))?;
                let traced = with_one_thread(|| assemble_layers(&mut tracer, &settings, channels, false))?;
                assert!(told(&traced)? == expected, "{size} processes");
            }
            crew.end();
        }
    }
    Ok(())
}

#[test]
fn photos_that_are_traced_anew_have_the_bits_of_one_process() -> Result<()> {
    let photos = |tracer: &mut Tracer, case: &Case| -> Result<_> {
        let mut retraced = Retraced { tracer, settings: case.settings, channels: case.channels };
        let white = Image::filled(retraced.pattern_resolution(), 1, 0.7);
        let photos = retraced.photograph_with_error(&white)?;
        let mut operator = EstimatedOperator::new(retraced, Part::Global, 0);
        let x = pattern(operator.cols());
        let mut y = vec![f64::NAN; operator.rows()];
        operator.apply(&x, &mut y)?;
        Ok((photos, y, operator.standard_errors()))
    };
    for case in cases() {
        let expected = photos(&mut tracer(&case.scene, None)?, &case)?;
        for size in [2, 3] {
            let crew = Crew::of(size);
            assert!(photos(&mut tracer(&case.scene, Some(&crew))?, &case)? == expected);
            crew.end();
        }
    }
    Ok(())
}

#[test]
fn a_leader_that_is_stopped_leaves_a_team_that_goes_on() -> Result<()> {
    struct Stop;
    impl Observer for Stop {
        fn step(&self, _: &Step<'_>) -> ControlFlow<()> {
            ControlFlow::Break(())
        }
    }

    let Case { scene, settings, channels } = cases().swap_remove(0);
    let crew = Crew::of(3);
    {
        let mut tracer = tracer(&scene, Some(&crew))?;
        let white = Image::filled(settings.resolution, 1, 1.0);
        let expected = Retraced { tracer: &mut tracer, settings, channels }.photograph(&white)?;
        tracer.observe(Arc::new(Stop));
        let stopped = Retraced { tracer: &mut tracer, settings, channels }.photograph(&white);
        assert!(matches!(stopped, Err(Error::Interrupted)), "{stopped:?}");
        let stopped = assemble_layers(&mut tracer, &settings, channels, false);
        assert!(matches!(stopped, Err(Error::Interrupted)));
        tracer.observe(Arc::new(()));
        let traced = Arc::new(assemble_layers(&mut tracer, &settings, channels, false)?);
        let again = Retraced { tracer: &mut tracer, settings, channels }.photograph(&white)?;
        assert!(again == expected);
        let mut rig = Arc::clone(&traced);
        let difference = rig.photograph(&white)?;
        assert_eq!(difference.resolution(), expected.resolution());
    }
    crew.end();
    Ok(())
}

#[test]
fn a_trace_stops_when_the_leader_goes_on_without_it() {
    let [leader, other]: [_; 2] = threads(2).try_into().ok().expect("there are two");
    let stop = StopByLeader(Arc::new(other));
    let step = Step { stage: "tracing", done: 1, total: 2, estimate: Estimate::None };
    assert!(stop.step(&step).is_continue());
    leader.send(1, &[0]);
    assert!(stop.step(&step).is_break());
}

#[test]
fn rows_that_the_leader_has_dropped_are_not_kept() {
    let comm: Arc<dyn Comm> = Arc::new(threads(1).swap_remove(0));
    let mut worker = SceneWorker::new(comm, "here".into(), 0);
    let size = Resolution::new(1, 1);
    let rig = RigShape { camera: size, projector: size, symmetric: true };
    for id in [3, 4] {
        let matrix = TransportMatrix::new(rig, Channels::Luma, vec![vec![1.0]], Vec::new());
        worker.matrices.insert(id, (matrix, Vec::new()));
    }
    worker.release(3);
    assert_eq!(worker.matrices.keys().collect::<Vec<_>>(), [&4]);
}
