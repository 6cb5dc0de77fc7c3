//! Products that are taken together with the one that is asked for, since what comes next was announced.

use super::Product;
use crate::error::Result;

/// What was announced to an operator ([`super::Operator::announce`]), and products with it that are there already.
#[derive(Clone, Debug, Default)]
pub struct Ahead {
    next: Vec<Vec<f64>>,
    ready: Vec<Product>,
}

impl Ahead {
    /// These come next; what was announced before is forgotten.
    pub fn announce(&mut self, xs: &[Vec<f64>]) {
        self.ready.retain(|product| xs.contains(&product.from));
        self.next = xs.to_vec();
    }

    /// `y ← A x`: what is ready is handed out, once. Else `x` is multiplied, with up to `at_once − 1` of those announced after it, by
    /// `block`, which is given a vector to fill for each: `y` itself, and others as long.
    ///
    /// # Errors
    /// Whatever `block` fails with.
    pub fn product(
        &mut self,
        x: &[f64],
        y: &mut [f64],
        at_once: usize,
        block: impl FnOnce(&[&[f64]], &mut [&mut [f64]]) -> Result<()>,
    ) -> Result<()> {
        if let Some(place) = self.ready.iter().position(|product| product.from == x) {
            y.copy_from_slice(&self.ready.swap_remove(place).to);
            return Ok(());
        }
        let after = self.next.iter().skip_while(|next| *next != x).skip(1);
        let news = after.filter(|next| self.ready.iter().all(|product| product.from != **next));
        let along: Vec<&Vec<f64>> = news.take(at_once.saturating_sub(1)).collect();
        let mut products = vec![vec![0.0; y.len()]; along.len()];
        let xs: Vec<&[f64]> = std::iter::once(x).chain(along.iter().map(|x| x.as_slice())).collect();
        let mut ys: Vec<&mut [f64]> =
            std::iter::once(y).chain(products.iter_mut().map(Vec::as_mut_slice)).collect();
        block(&xs, &mut ys)?;
        let taken = along.into_iter().zip(products).map(|(from, to)| Product { from: from.clone(), to });
        self.ready.extend(taken);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;

    /// Doubles, and says how many at once.
    fn double(ahead: &mut Ahead, x: f64) -> (f64, usize) {
        let mut together = 0;
        let mut y = [f64::NAN];
        let done = ahead.product(&[x], &mut y, 3, |xs, ys| {
            together = xs.len();
            xs.iter().zip(ys).for_each(|(x, y)| y[0] = 2.0 * x[0]);
            Ok(())
        });
        assert!(done.is_ok());
        (y[0], together)
    }

    fn vectors(values: &[f64]) -> Vec<Vec<f64>> {
        values.iter().map(|&value| vec![value]).collect()
    }

    #[test]
    fn what_was_announced_is_taken_together_and_anything_else_alone() {
        let mut ahead = Ahead::default();
        assert_eq!(double(&mut ahead, 1.0), (2.0, 1));
        ahead.announce(&vectors(&[1.0, 2.0, 3.0, 4.0]));
        assert_eq!(double(&mut ahead, 1.0), (2.0, 3));
        assert_eq!(double(&mut ahead, 7.0), (14.0, 1));
        assert_eq!(double(&mut ahead, 2.0), (4.0, 0));
        ahead.announce(&vectors(&[3.0, 4.0, 5.0]));
        assert_eq!([3.0, 4.0, 5.0].map(|x| double(&mut ahead, x)), [(6.0, 0), (8.0, 2), (10.0, 0)]);
        // Handed out once: whoever asks again gets a new product.
        assert_eq!(double(&mut ahead, 4.0), (8.0, 2));
    }

    #[test]
    fn a_block_that_fails_leaves_everything_as_it_was() {
        let mut ahead = Ahead::default();
        ahead.announce(&vectors(&[1.0, 2.0]));
        let failed = ahead.product(&[1.0], &mut [0.0], 3, |_, _| Err(Error::Numerical("unplugged".into())));
        assert!(failed.is_err());
        assert_eq!([1.0, 2.0].map(|x| double(&mut ahead, x)), [(2.0, 2), (4.0, 0)]);
    }
}
