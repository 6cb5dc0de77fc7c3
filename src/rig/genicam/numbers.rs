//! Frame numbers that grow over all sessions with a camera.

/// Half of the numbers that a GigE Vision camera has for frames: what is further back is not back, but past the last of them.
const WRAP: u64 = 1 << 15;

/// The rig's numbers of a camera's frames.
pub(super) struct Numbers {
    /// Added to the camera's.
    base: u64,
    /// The camera's last.
    last: u64,
}

impl Numbers {
    /// Numbers past `after`.
    pub(super) fn past(after: u64) -> Self {
        Self { base: after, last: 0 }
    }

    /// The number of the frame that the camera calls `number`, from 1 on.
    pub(super) fn of(&mut self, number: u64) -> u64 {
        if number + WRAP < self.last {
            // From 65535 it goes on at 1.
            self.base += 2 * WRAP - 1;
        }
        self.last = number;
        self.base + number
    }

    /// The camera counts anew.
    pub(super) fn begin(&mut self) {
        self.base += self.last;
        self.last = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_grow_past_the_cameras_last_one_and_over_restarts() {
        let mut numbers = Numbers::past(10);
        assert_eq!(
            [1, 2, 2, 65_535, 1, 2].map(|number| numbers.of(number)),
            [11, 12, 12, 65_545, 65_546, 65_547]
        );
        numbers.begin();
        assert_eq!([1, 2].map(|number| numbers.of(number)), [65_548, 65_549]);
    }
}
