//! The quantities of the planar PR arm in closed form, as [`super::Evaluator`] computes them for trees, and the regressors of both kinds of
//! arms.

use super::{Dynamics, Model, PlanarPr, Quantity, Query};
use crate::error::{Error, Result};
use crate::scalar::Real;

/// Require a query without friction, armature and offset, which the planar PR arm has not. Errors: `Input`.
pub(super) fn require_rigid_bodies(query: &Query) -> Result<()> {
    let flags = [("friction", query.friction), ("armature", query.armature), ("offset", query.offset)];
    let given: Vec<&str> = flags.into_iter().filter(|(_, flag)| *flag).map(|(name, _)| name).collect();
    if given.is_empty() {
        return Ok(());
    }
    let are = if given.len() == 1 { "is" } else { "are" };
    Err(Error::input(given.join(", "), format!("{are} not part of this arm: expected False for planar_pr, got True")))
}

impl PlanarPr<f64> {
    /// Evaluate `query` at one configuration. The inputs `x` are finite, `(2,)` each, and `out` has the size of the result.
    /// Errors: `Input` for friction, armature or a quantity that requires links.
    pub fn evaluate(&self, query: &Query, x: &[&[f64]], out: &mut [f64]) -> Result<()> {
        let q = x[0];
        let trig = [Real::sin_cos(q[0]), Real::sin_cos(q[1])];
        require_rigid_bodies(query)?;
        match query.quantity {
            Quantity::MassMatrix => self.mass_matrix(&mut (), &trig, q, out),
            Quantity::CoriolisMatrix => self.coriolis_matrix(&mut (), &trig, q, x[1], out),
            Quantity::Christoffel => self.christoffel(trig[1], out),
            Quantity::Gravity => self.gravity(&mut (), &trig, q, out),
            Quantity::Bias => self.bias(&mut (), &trig, q, x[1], out),
            Quantity::InverseDynamics => self.inverse_dynamics(&mut (), &trig, q, x[1], x[2], out),
            Quantity::PathDynamics => {
                let (inertia, rest) = out.split_at_mut(2);
                let (curvature, weight) = rest.split_at_mut(2);
                self.inverse_dynamics(&mut (), &trig, q, &[0.0; 2], x[1], inertia);
                self.inverse_dynamics(&mut (), &trig, q, x[1], x[2], curvature);
                weight.fill(0.0);
            }
            Quantity::ForwardDynamics => self.forward_dynamics(&mut (), &trig, q, x[1], x[2], out),
            Quantity::Regressor => self.regressor(&mut (), &trig, q, [x[1], x[2], x[3]], out),
            Quantity::Energy => (out[0], out[1]) = self.energy(&mut (), &trig, q, x[1]),
            Quantity::InverseDynamicsDerivatives => self.inverse_dynamics_slopes(trig[1], x[1], x[2], out),
            Quantity::ForwardDynamicsDerivatives => {
                let mut a = [0.0; 2];
                self.forward_dynamics(&mut (), &trig, q, x[1], x[2], &mut a);
                self.forward_dynamics_slopes(trig[1], x[1], &a, out);
            }
            _ => return Err(Error::input("arm", "has no links: expected an arm with a kinematic model, got planar_pr")),
        }
        Ok(())
    }
}

impl Model {
    /// Compute regressors, `(count, n, p)`, with the columns that `query` selects, at `q, v, v_r, a_r`, each `(count, n)`. Errors: as for
    /// [`PlanarPr::evaluate`] or [`super::Functions::rows`].
    pub fn regressors(&self, query: &Query, states: [&[f64]; 4], out: &mut [f64]) -> Result<()> {
        match self {
            Model::PlanarPr(arm) => {
                for (i, y) in out.chunks_exact_mut(6).enumerate() {
                    arm.evaluate(query, &states.map(|x| &x[2 * i..2 * i + 2]), y)?;
                }
                Ok(())
            }
            Model::Tree(arm) => {
                let count = states[0].len() / arm.n().max(1);
                arm.evaluate(query, &states, count, out).map(drop)
            }
        }
    }
}
