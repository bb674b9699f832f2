//! What an inner torque loop is judged by: the largest `|tau_J - u|` over the joints, the torque of the springs against
//! what the outer loop asks for.

use crate::law::{Law, LawSpec};
use crate::plant::PlantSpec;
use crate::scalar::Real;

pub struct TorqueError<S: Real> {
    law: Box<dyn Law<S> + Send>,
    /// `(n, n)`
    stiffness: Vec<S>,
    u: Vec<S>,
    /// The rate of the law's state.
    rate: Vec<S>,
}

impl<S: Real> TorqueError<S> {
    /// For elastic plants under laws with an inner loop, of one shape each; their motions are those of the outer loop.
    pub fn new<'a>(plant: impl Fn(usize) -> &'a PlantSpec, law: impl Fn(usize) -> &'a LawSpec) -> Option<Self> {
        law(0).reduction()?;
        let outer = (0..S::LANES).map(|lane| law(lane).outer()).collect::<Option<Vec<LawSpec>>>()?;
        let stiffness = (0..S::LANES).map(|lane| plant(lane).elastic().map(|plant| &plant.stiffness)).collect::<Option<Vec<_>>>()?;
        let n = plant(0).n();
        Some(TorqueError {
            law: LawSpec::build::<S>(|lane| &outer[lane]),
            stiffness: (0..n * n).map(|k| S::from_lanes(|lane| stiffness[lane].at(k / n, k % n))).collect(),
            u: vec![S::zero(); n],
            rate: vec![S::zero(); outer[0].initial_state().len()],
        })
    }

    /// At plant state `x` and its (sin, cos) and law state `z`, under the desired motions.
    pub fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S]) -> S {
        let n = trig.len();
        self.law.evaluate(desired, trig, &x[..2 * n], z, &mut self.u, &mut self.rate);
        let mut worst = S::zero();
        for i in 0..n {
            let mut spring = S::zero();
            for j in 0..n {
                spring += self.stiffness[n * i + j] * (x[2 * n + j] - x[j]);
            }
            let error = (spring - self.u[i]).abs();
            // `max` would swallow a NaN.
            worst = S::select(error.lt(worst), worst, error);
        }
        worst
    }
}
