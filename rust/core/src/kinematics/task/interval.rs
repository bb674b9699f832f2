//! A task within bounds, as the distance of its coordinates from them. The error `clip(x, lower, upper) - x` is zero between the bounds, where
//! the Jacobian has rows of zeros. Otherwise both are those of the task whose target is the nearest bound.

use super::TaskFunction;
use super::kind::TaskKind;
use crate::arm::Tree;
use crate::error::{Error, Result};
use crate::kinematics::Bodies;
use crate::scalar::Real;

/// A task within bounds.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::kinematics::{TaskFunction, TaskStack};
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
/// let height = TaskFunction::frame(&arm, "link2", "y")?.within(vec![0.0], [vec![-0.2], vec![0.3]])?;
/// let mut stack = TaskStack::new(&arm, vec![height]);
/// // The tip is at a height of 0.4 m, 0.1 m above the upper bound.
/// stack.place(&[0.0, std::f64::consts::FRAC_PI_2]);
/// let (mut e, mut w, mut j) = ([0.0], [0.0], [0.0; 2]);
/// stack.error(0, &[], &mut e, &mut w, None);
/// stack.jacobians(&mut j);
/// assert!((e[0] + 0.1).abs() < 1e-15 && (j[0] - 0.5).abs() < 1e-15);
/// stack.place(&[0.0, 0.0]);
/// stack.error(0, &[], &mut e, &mut w, None);
/// stack.jacobians(&mut j);
/// assert_eq!((e, j), ([0.0], [0.0; 2]));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Interval {
    function: Box<TaskFunction>,
    /// The target from which the bounds are measured.
    target: Vec<f64>,
    lower: Vec<f64>,
    upper: Vec<f64>,
}

impl TaskFunction {
    /// The task within bounds of its coordinates, measured from a constant target. Errors: `WrongShape` for wrong lengths, `Input` for an
    /// invalid target, or for bounds out of order.
    pub fn within(self, target: Vec<f64>, [lower, upper]: [Vec<f64>; 2]) -> Result<Self> {
        self.require_target(&target)?;
        for (name, bound) in [("lower", &lower), ("upper", &upper)] {
            if bound.len() != self.rows() {
                return Err(Error::wrong_shape(name, &[self.rows()], &[bound.len()]));
            }
        }
        if let Some(i) = (0..lower.len()).find(|&i| !(lower[i] <= upper[i])) {
            let problem = format!("is out of order: expected lower <= upper, got {} and {}", lower[i], upper[i]);
            return Err(Error::input("lower", problem).at([i]));
        }
        Ok(Interval { function: Box::new(self), target, lower, upper }.into())
    }
}

impl TaskKind for Interval {
    fn rows(&self) -> usize {
        self.lower.len()
    }

    /// The target has no entries, because the bounds are the target.
    fn target_size(&self) -> usize {
        0
    }

    fn bodies<S: Real>(&self, tree: &Tree<S>) -> usize {
        self.function.bodies(tree)
    }

    fn error<S: Real>(&self, at: &mut Bodies<S>, _: &[S], e: &mut [S]) {
        let target: Vec<S> = self.target.iter().map(|x| S::splat(*x)).collect();
        self.function.error(at, &target, e);
        for ((e, lower), upper) in e.iter_mut().zip(&self.lower).zip(&self.upper) {
            *e = (S::splat(*lower) + *e).max(S::zero()) + (S::splat(*upper) + *e).min(S::zero());
        }
    }

    fn feedforward<S: Real>(&self, _: &Bodies<S>, _: [&[S]; 3], w: &mut [S], a: Option<&mut [S]>) {
        w.fill(S::zero());
        if let Some(a) = a {
            a.fill(S::zero());
        }
    }

    fn jacobian<S: Real>(&self, at: &mut Bodies<S>, rate: bool, j: &mut [S]) {
        let mut e = vec![S::zero(); self.rows()];
        self.error(at, &[], &mut e);
        self.function.jacobian(at, rate, j);
        for (row, e) in j.chunks_exact_mut(at.n()).zip(e) {
            row.iter_mut().for_each(|entry| *entry = S::select(S::zero().lt(e.abs()), *entry, S::zero()));
        }
    }
}
