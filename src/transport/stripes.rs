//! An array shared out to several tasks, so that each of its entries is one task's.

/// Every n-th stripe of an array, which is one task's. Stripes are narrow, so that each task gets as much of a batch's pixels.
pub(super) struct Stripes<'a, T> {
    mine: Vec<&'a mut [T]>,
    /// For each stripe of the array its place among `mine`, or a place beyond them.
    places: Vec<u32>,
}

impl<T> Stripes<'_, T> {
    /// Entries of a stripe.
    const WIDTH: usize = 16;

    /// The stripes of `values` for each of `tasks` tasks.
    pub(super) fn of(values: &mut [T], tasks: usize) -> Vec<Stripes<'_, T>> {
        let count = values.len().div_ceil(Self::WIDTH);
        let mut stripes: Vec<Stripes<'_, T>> =
            (0..tasks).map(|_| Stripes { mine: Vec::new(), places: vec![u32::MAX; count] }).collect();
        for (stripe, values) in values.chunks_mut(Self::WIDTH).enumerate() {
            let Stripes { mine, places } = &mut stripes[stripe % tasks];
            places[stripe] = mine.len() as u32;
            mine.push(values);
        }
        stripes
    }

    /// The entry number `index`, if this task has it.
    pub(super) fn at(&mut self, index: usize) -> Option<&mut T> {
        let place = self.places[index / Self::WIDTH];
        self.mine.get_mut(place as usize).map(|stripe| &mut stripe[index % Self::WIDTH])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stripes_go_round_the_tasks() {
        for tasks in 1..5 {
            let mut owner = [usize::MAX; 101];
            for (task, mut stripes) in Stripes::of(&mut owner, tasks).into_iter().enumerate() {
                (0..101).for_each(|index| stripes.at(index).into_iter().for_each(|owner| *owner = task));
            }
            assert!((0..101).all(|index| owner[index] == index / 16 % tasks), "in the place of its index");
        }
    }
}
