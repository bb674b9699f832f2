//! The jump of the tangents at a contact change (the saltation matrix of Aizerman and Gantmakher 1958). At the zero of the guard `g(x, p)`
//! the state rates change from `f-` to `f+`, and the state `x` is continuous. `S-` and `S+` are its tangents `dx/dp` before and after the
//! change. `g_x` and `g_p` are the derivatives of `g`.
//!
//! ```text
//! S+ = S- + (f+ - f-) (g_x S- + g_p) / (g_x f-)
//! ```

use super::walk::Walker;
use crate::error::{Error, Result};
use crate::status::Status;

/// The contact changes without a jump of the tangents if the relative difference between `f-` and `f+` is at most this limit.
const SAME: f64 = 1e-12;
/// The smallest allowed value of `|g_x f-| / (|g_x| |f-|)`. Below it the contact is grazed, and the instant of the change has no
/// derivative.
const GRAZING: f64 = 1e-9;

/// The jump of a tangent `S` is `along (of_state S + of_set_up p_dot)`, where `p_dot` are the tangents of the loop parameters.
pub struct Jump {
    pub along: Vec<f64>,
    pub of_state: Vec<f64>,
    pub of_set_up: Vec<f64>,
}

fn largest(x: impl Iterator<Item = f64>) -> f64 {
    x.fold(0.0, |most, x| most.max(x.abs()))
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

impl Walker<'_> {
    /// Compute the jump at contact change `k` of the timeline. The result is `None` if the state rates before and after the change are
    /// equal up to the tolerance `SAME`. Error: `Solve` for a grazed contact.
    pub fn jump(&mut self, k: usize, t: f64, state: &[f64]) -> Result<Option<Jump>> {
        let sizes = &self.prepared.functions.sizes;
        let (switch, size, moved) = (self.prepared.timeline.contacts.switches[k], sizes.states, sizes.moved);
        let (x, acting) = (&state[self.places.x()], &state[self.places.acting()]);
        self.prepared.directions.input(t, &mut self.u);
        let mut rates = |mode: usize| -> Result<Vec<f64>> {
            let call = &mut self.rates[mode];
            call.give([&self.u, x, acting]);
            call.run(t)?;
            Ok(call.answers()[..size].to_vec())
        };
        let (before, after) = (rates(switch.before)?, rates(switch.after)?);
        let jump: Vec<f64> = before.iter().zip(&after).map(|(before, after)| after - before).collect();
        if largest(jump.iter().copied()) <= SAME * largest(before.iter().chain(&after).copied()) {
            return Ok(None);
        }
        let guard = &mut self.guards[switch.guard];
        guard.give([&self.u, x, &[]]);
        guard.more(0, 1).fill(1.0);
        guard.run(t)?;
        let (of_set_up, rest) = guard.behind(0, moved + sizes.driven() + size).split_at(moved);
        let of_state = &rest[sizes.driven()..];
        let speed: f64 = of_state.iter().zip(&before).map(|(slope, rate)| slope * rate).sum();
        if !(speed.abs() > GRAZING * norm(of_state) * norm(&before)) {
            let problem = format!("a contact is grazed at t = {t} s, where the run has no derivative");
            return Err(Error::Solve { status: Status::Degraded, t, problem });
        }
        let along = jump.iter().map(|jump| jump / speed).collect();
        Ok(Some(Jump { along, of_state: of_state.to_vec(), of_set_up: of_set_up.to_vec() }))
    }
}
