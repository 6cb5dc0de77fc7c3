//! Frame numbers that increase over all sessions with a camera.

/// Half the range of a GigE Vision camera's frame numbers. A number that is further back than this belongs to the next round.
const WRAP: u64 = 1 << 15;

/// Converts a camera's frame numbers to those of the rig.
pub(super) struct Numbers {
    /// The number that is added to the camera's.
    base: u64,
    /// The camera's last number.
    last: u64,
}

impl Numbers {
    /// Numbers from `after + 1` on.
    pub(super) fn past(after: u64) -> Self {
        Self { base: after, last: 0 }
    }

    /// The rig's number of the frame with the camera's `number`, which counts from 1.
    pub(super) fn of(&mut self, number: u64) -> u64 {
        if number + WRAP < self.last {
            // The camera's number after 65535 is 1.
            self.base += 2 * WRAP - 1;
        }
        self.last = number;
        self.base + number
    }

    /// Notes that the camera starts again at 1.
    pub(super) fn begin(&mut self) {
        self.base += self.last;
        self.last = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_increase_when_the_camera_wraps_around_and_when_it_restarts() {
        let mut numbers = Numbers::past(10);
        assert_eq!(
            [1, 2, 2, 65_535, 1, 2].map(|number| numbers.of(number)),
            [11, 12, 12, 65_545, 65_546, 65_547]
        );
        numbers.begin();
        assert_eq!([1, 2].map(|number| numbers.of(number)), [65_548, 65_549]);
    }
}
