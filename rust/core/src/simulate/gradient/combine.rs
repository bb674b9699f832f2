//! Linear combinations of slopes, which are the state rates at the stages of a step. They apply to states, and to tangents, whose rows have
//! one direction per lane.

use crate::integrate::Tableau;
use crate::scalar::Kernel;
use crate::scalar::instruction_set::vectorised;

/// The operation `y += factor x`, in a form that is compiled for SIMD registers.
struct Add<'a> {
    y: &'a mut [f64],
    factor: f64,
    x: &'a [f64],
}

impl Kernel for Add<'_> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        for (y, x) in self.y.iter_mut().zip(self.x) {
            *y += self.factor * x;
        }
    }
}

/// Compute `y += factor x`.
pub fn add(y: &mut [f64], factor: f64, x: &[f64]) {
    vectorised(Add { y, factor, x });
}

/// Compute `y = x + h sum_j a_j k_j`. `slopes` contains the `k_j` one after another.
pub fn add_slopes(x: &[f64], h: f64, a: &[f64], slopes: &[f64], y: &mut [f64]) {
    y.copy_from_slice(x);
    for (&a, slope) in a.iter().zip(slopes.chunks_exact(x.len().max(1))).filter(|(a, _)| **a != 0.0) {
        add(y, h * a, slope);
    }
}

/// Advance a state, or its tangents along `lanes` directions, by one step. A semi-implicit method computes the new positions from the new
/// velocities. For this, it sets the slopes of the positions to zero.
pub fn advance(tableau: &Tableau, h: f64, slopes: &mut [f64], followers: &[(usize, usize)], x: &mut [f64], lanes: usize) {
    let size = x.len().max(1);
    for (&b, slope) in tableau.b.iter().zip(slopes.chunks_exact_mut(size)) {
        if tableau.follows {
            followers.iter().for_each(|&(position, _)| slope[position * lanes..(position + 1) * lanes].fill(0.0));
        }
        add(x, h * b, slope);
    }
    if tableau.follows {
        for &(position, rate) in followers {
            for lane in 0..lanes {
                x[position * lanes + lane] += h * x[rate * lanes + lane];
            }
        }
    }
}
