//! Processes with steps in flight, compared to the bit with processes whose steps are all computed when the host asks.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

use super::*;
use crate::operator::{Direction, Selection, Vectors};
use crate::transport::gpu_matrix::{GpuMatrix, tests::coaxial};
use crate::transport::{Assembled, Part};

/// A process of `waiting` start vectors and `known` known ones.
#[derive(Clone, Copy, Debug)]
struct Case {
    waiting: usize,
    known: usize,
    selects: bool,
    reads: bool,
    steps: usize,
    /// Room for more columns than the steps need, so that steps are in flight at the end.
    spare: usize,
}

/// What a host that departs from the regular steps does.
#[derive(Clone, Copy, Debug)]
enum Event {
    Nothing,
    /// Looks at the last column and at `w`.
    Look,
    /// Looks at the pattern and the photo.
    Show,
    /// Removes what is left along the basis once more, after the settling.
    SecondPass,
    /// Begins the step anew, with the product.
    Again,
    /// Replaces `w` by the last column and a multiple of the first one, and brings it back.
    Replace,
    /// Multiplies in another channel, and then begins the step anew.
    Elsewhere,
}

const EVENTS: [Event; 6] =
    [Event::Look, Event::Show, Event::SecondPass, Event::Again, Event::Replace, Event::Elsewhere];

struct Process<'a> {
    vectors: DeviceVectors,
    of: (&'a GpuMatrix, &'a Assembled),
    case: Case,
    late: Vec<f64>,
    tridiagonal: Vec<[f64; 3]>,
    /// Every number that the vectors returned.
    seen: Vec<f64>,
    flown: usize,
}

const PIXELS: usize = 37 * 29;

impl<'a> Process<'a> {
    /// Columns are in buffers of at most `chunk` bytes. Known vectors are nearly eigenvectors, as those of the processes that have them.
    fn new(of: (&'a GpuMatrix, &'a Assembled), case: Case, (depth, chunk): (usize, u64)) -> Result<Self> {
        let random = &mut Pcg64::seed_from_u64(11);
        let entries: Vec<usize> = (0..PIXELS).filter(|entry| entry % 5 < 3).collect();
        let factors: Vec<f64> = entries.iter().map(|_| random.random_range(0.5..1.5)).collect();
        let selection = case.selects.then_some(Selection { entries: &entries, factors: &factors });
        let columns = case.known + case.waiting + case.steps + case.spare;
        let rows = if case.selects { entries.len() } else { PIXELS };
        let made = DeviceVectors::in_chunks(&of.0.gpu, rows, columns, chunk)?;
        let mut vectors = made.of_product(PIXELS, selection)?;
        vectors.ahead = Ahead::with_depth(depth);
        for index in 0..case.known + case.waiting {
            let size = if index < case.known { 1e-14 } else { 1.0 };
            let mut start: Vec<f64> = (0..rows).map(|_| size * random.random_range(-1.0..1.0)).collect();
            if index < case.known {
                start[7 * index] += 1.0;
            }
            vectors.load(&start)?;
            let (dots, _) = vectors.dots_and_norm(0)?;
            let (_, length) = vectors.remove_and_dot(&dots)?;
            vectors.push(length)?;
        }
        let (late, tridiagonal) = (Vec::new(), vec![[0.0; 3]; case.known]);
        Ok(Self { vectors, of, case, late, tridiagonal, seen: Vec::new(), flown: 0 })
    }

    fn multiply(&mut self, channel: usize) -> Result<()> {
        // Unit vectors are eigenvectors of the direct light.
        let part = if self.case.known > 0 { Part::Direct } else { Part::Full };
        let product = Product { part, channel, direction: Direction::Forward };
        let column = self.vectors.columns() - self.case.waiting;
        self.of.0.multiply_within(&self.of.1.matrix, product, &mut self.vectors, column)
    }

    /// `V⁺ᵀ A V s` for the late parts `s`.
    fn shown(&self, index: usize) -> f64 {
        let late = |index: usize| self.late.get(index).copied().unwrap_or(0.0);
        let mut sum = self.tridiagonal[index][1] * late(index);
        if index > 0 {
            sum += self.tridiagonal[index - 1][2] * late(index - 1);
        }
        if index + 1 < self.late.len() {
            sum += self.tridiagonal[index + 1][0] * late(index + 1);
        }
        sum
    }

    /// Takes a step; `event` happens after call `after` of its calls.
    fn step(&mut self, event: Event, after: usize) -> Result<()> {
        let Case { waiting, known, .. } = self.case;
        let total = self.vectors.columns();
        let first = total.saturating_sub(2 * waiting);
        self.happens(event, after == 0)?;
        self.multiply(1)?;
        if self.case.reads {
            self.happens(Event::Show, true)?;
        }
        self.happens(event, after == 1)?;
        let (along, length) = self.vectors.dots_and_norm(first)?;
        self.happens(event, after == 2)?;
        self.seen.extend(along.iter().chain([&length]));
        let of_last = along.last().copied().unwrap_or_default();
        let mut ahead = vec![0.0; total - 1];
        for (index, ahead) in ahead.iter_mut().enumerate().take(first).filter(|_| !self.late.is_empty()) {
            let shown = if waiting == 1 { self.shown(index) } else { 0.0 };
            *ahead = shown - of_last * self.late[index];
        }
        let settling = Settling { late: &self.late, along: &along, ahead: &ahead };
        let (mut rest, mut length) = self.vectors.settle_and_dot(&settling)?;
        self.seen.extend(rest.iter().chain([&length]));
        self.happens(event, after == 3)?;
        if after == 3 && matches!(event, Event::SecondPass) {
            (rest, length) = self.vectors.remove_and_dot(&rest)?;
            self.late.clear();
        } else {
            if known > 0 {
                self.vectors.remove(&rest[..known])?;
                self.happens(event, after == 4)?;
                rest[..known].fill(0.0);
            }
            self.late = rest.iter().map(|rest| rest / length).collect();
        }
        self.seen.extend(rest.iter().chain([&length]));
        self.vectors.push(length)?;
        let above = if along.len() > 1 { along[along.len() - 2] } else { 0.0 };
        self.tridiagonal.push([above, of_last, length]);
        self.flown += usize::from(self.vectors.ahead.flight.is_some());
        Ok(())
    }

    fn happens(&mut self, event: Event, now: bool) -> Result<()> {
        let last = self.vectors.columns().saturating_sub(1);
        match event {
            _ if !now => {}
            Event::Nothing | Event::SecondPass => {}
            Event::Look => {
                self.seen.extend(&*self.vectors.column(last)?);
                self.seen.extend(&*self.vectors.work()?);
            }
            Event::Show => {
                let product = self.vectors.product();
                self.seen.extend(product.iter().flat_map(|product| product.from.iter().chain(&product.to)));
            }
            Event::Again => {
                let (dots, _) = self.vectors.dots_and_norm(last)?;
                self.seen.extend(dots);
                self.multiply(1)?;
            }
            Event::Elsewhere => {
                self.multiply(2)?;
                self.seen.extend(&*self.vectors.work()?);
                self.multiply(1)?;
            }
            Event::Replace => {
                let column = self.vectors.column(last)?.into_owned();
                let before = self.vectors.work()?.into_owned();
                self.vectors.load(&column)?;
                self.vectors.remove(&[0.5])?;
                self.seen.extend(&*self.vectors.work()?);
                self.vectors.load(&before)?;
            }
        }
        Ok(())
    }

    /// All steps, with these events at some of them. Returns the bits of all numbers and columns.
    fn run(mut self, events: &[(usize, usize, Event)]) -> Result<(Vec<u64>, usize)> {
        for step in 0..self.case.steps {
            let event = events.iter().find(|(at, ..)| *at == step);
            let (after, event) = event.map_or((0, Event::Nothing), |&(_, after, event)| (after, event));
            self.step(event, after)?;
        }
        for index in 0..self.vectors.columns() {
            self.seen.extend(&*self.vectors.column(index)?);
        }
        // Without columns, `w` and the last product stay.
        self.vectors.clear();
        self.seen.extend(&*self.vectors.work()?);
        self.happens(Event::Show, true)?;
        self.vectors.push(2.0)?;
        self.seen.extend(&*self.vectors.column(0)?);
        Ok((self.seen.iter().map(|value| value.to_bits()).collect(), self.flown))
    }
}

#[test]
fn steps_in_flight_find_the_bits_of_steps_that_the_host_asks_for() -> Result<()> {
    let assembled = coaxial();
    let on_device = GpuMatrix::on(&Gpu::for_tests(), &assembled.matrix)?;
    let of = (&on_device, &assembled);
    for (waiting, known) in [(1, 0), (1, 1), (3, 0), (2, 2)] {
        for (selects, reads) in [(false, false), (true, true), (false, true)] {
            let case = Case { waiting, known, selects, reads, steps: 14, spare: 2 };
            let (expected, flown) = Process::new(of, case, (0, 1 << 20))?.run(&[])?;
            assert_eq!(flown, 0, "without steps in flight");
            for depth in [1, 3] {
                let (found, flown) = Process::new(of, case, (depth, 1 << 20))?.run(&[])?;
                assert!(found == expected, "{case:?}, depth {depth}: the same bits");
                // The first steps have inner products with all columns.
                let least = case.steps - 2 * waiting - 1;
                assert!(flown >= least, "{case:?}, depth {depth}: {flown} steps of {least} were in flight");
            }
        }
    }
    Ok(())
}

#[test]
fn a_host_that_departs_from_its_steps_finds_the_vectors_that_it_expects() -> Result<()> {
    let assembled = coaxial();
    let gpu = Gpu::for_tests();
    // A discrete GPU has separate memory that the host cannot read.
    let far = Gpu { shares_memory: false, ..gpu.clone() };
    let on_devices = [GpuMatrix::on(&gpu, &assembled.matrix)?, GpuMatrix::on(&far, &assembled.matrix)?];
    let random = &mut Pcg64::seed_from_u64(12);
    let mut flown = 0;
    for round in 0..60 {
        let case = Case {
            waiting: random.random_range(1..4),
            known: random.random_range(0..3),
            selects: random.random_range(0..2) == 0,
            reads: random.random_range(0..2) == 0,
            steps: random.random_range(12..18),
            spare: random.random_range(0..3),
        };
        let events: Vec<(usize, usize, Event)> = (0..random.random_range(0..4))
            .map(|_| {
                let event = EVENTS[random.random_range(0..EVENTS.len())];
                let after = match event {
                    Event::SecondPass => 3,
                    Event::Again | Event::Elsewhere => 1,
                    _ => random.random_range(0..5),
                };
                (random.random_range(0..case.steps), after, event)
            })
            .collect();
        let of = (&on_devices[round % 2], &assembled);
        // Buffers of one column, of some, and of all.
        let chunk = [1, 5 * 8 * PIXELS as u64, 1 << 20][round % 3];
        let (expected, _) = Process::new(of, case, (0, chunk))?.run(&events)?;
        let depth = random.random_range(1..5);
        let (found, in_flight) = Process::new(of, case, (depth, chunk))?.run(&events)?;
        assert!(found == expected, "round {round}: {case:?} with {events:?}");
        flown += in_flight;
    }
    assert!(flown > 60 * 5, "{flown} steps were in flight");
    Ok(())
}

#[test]
fn coefficients_that_the_device_has_not_used_are_computed() -> Result<()> {
    let assembled = coaxial();
    let on_device = GpuMatrix::on(&Gpu::for_tests(), &assembled.matrix)?;
    let case = Case { waiting: 1, known: 0, selects: false, reads: false, steps: 12, spare: 0 };
    // The late parts, the parts ahead and the divisor, each changed by much less than they are, but more than by rounding.
    for wrong in 0..3 {
        let take = |depth| -> Result<(Vec<u64>, bool)> {
            let mut process = Process::new((&on_device, &assembled), case, (depth, 1 << 20))?;
            for _ in 0..8 {
                process.step(Event::Nothing, 0)?;
            }
            process.multiply(1)?;
            assert_eq!(process.vectors.ahead.flight.is_some(), depth > 0);
            let total = process.vectors.columns();
            let (along, _) = process.vectors.dots_and_norm(total - 2)?;
            let of_last = along[1];
            let mut late = process.late.clone();
            let mut ahead: Vec<f64> =
                (0..total - 1).map(|index| process.shown(index) - of_last * late[index]).collect();
            let size = late.iter().fold(0.0_f64, |size, late| size.max(late.abs()));
            match wrong {
                0 => late[2] += 1e-14 * size,
                1 => ahead[2] += 1e-12 * size,
                _ => {}
            }
            let settling = Settling { late: &late, along: &along, ahead: &ahead };
            let (rest, length) = process.vectors.settle_and_dot(&settling)?;
            let divisor = if wrong == 2 { length * (1.0 + 1e-14) } else { length };
            process.vectors.push(divisor)?;
            let column = process.vectors.column(total)?.into_owned();
            let numbers = rest.iter().chain(&column).map(|value| value.to_bits()).collect();
            Ok((numbers, process.vectors.ahead.flight.is_some()))
        };
        let [(expected, _), (found, still_flies)] = [take(0)?, take(2)?];
        assert!(found == expected && !still_flies, "case {wrong}");
    }
    Ok(())
}

#[test]
fn flights_begin_again_until_some_were_short() -> Result<()> {
    let assembled = coaxial();
    let on_device = GpuMatrix::on(&Gpu::for_tests(), &assembled.matrix)?;
    let case = Case { waiting: 2, known: 1, selects: false, reads: false, steps: 40, spare: 0 };
    let mut process = Process::new((&on_device, &assembled), case, (2, 1 << 20))?;
    let mut flies = Vec::new();
    for round in 0..5 {
        // The first steps have inner products with all columns.
        for _ in 0..if round == 0 { 5 } else { 3 } {
            process.step(Event::Nothing, 0)?;
        }
        let is_flying = process.vectors.ahead.flight.is_some();
        // A step that leaves out the removal along the known vector: the sums on the device are those of a later step.
        process.multiply(1)?;
        let total = process.vectors.columns();
        let (along, _) = process.vectors.dots_and_norm(total - 4)?;
        let of_last = along[3];
        let ahead: Vec<f64> = process.late.iter().map(|late| -of_last * late).collect();
        let settling = Settling { late: &process.late, along: &along, ahead: &ahead };
        let (rest, length) = process.vectors.settle_and_dot(&settling)?;
        process.vectors.push(length)?;
        process.late = rest.iter().map(|rest| rest / length).collect();
        process.late[0] = 0.0;
        process.tridiagonal.push([0.0; 3]);
        let landed = process.vectors.ahead.flight.is_none() && process.vectors.ahead.shape.is_none();
        assert!(landed || !is_flying, "round {round}");
        flies.push(is_flying);
    }
    assert_eq!(flies, [true, true, true, false, false]);
    Ok(())
}
