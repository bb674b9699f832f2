//! The jump of the tangents at a contact change or another branch at which the state rates jump. It is the saltation matrix of Aizerman and
//! Gantmakher (1958). At the zero of `g(t, x, p)` the state rates change from `f-` to `f+`, and the state `x` is continuous. `S-` and `S+` are
//! its tangents `dx/dp` before and after the change. `g_x`, `g_p` and `g_t` are the derivatives of `g`.
//!
//! ```text
//! S+ = S- + (f+ - f-) (g_x S- + g_p) / (g_x f- + g_t)
//! ```
//!
//! If `f+` leads back to the zero, the state slides along it with the rates `f- + s (f+ - f-)`, where `s` keeps `g` at zero (Filippov
//! 1988). With these rates as `f+`, the denominator is `g_x (f- - f+)`, and `g_x S+ + g_p` is zero.

use super::walk::Walker;
use crate::error::{Error, Result};
use crate::status::Status;

/// The rates change without a jump of the tangents if the relative difference between `f-` and `f+` is at most this limit.
const SAME: f64 = 1e-12;
/// The smallest allowed value of `|g_x f- + g_t| / (|g_x| |f-| + |g_t|)`. Below it the zero is grazed, and the instant of the change has no
/// derivative.
const GRAZING: f64 = 1e-9;

/// The jump of a tangent `S` is `along (of_state S + of_input u_dot + of_set_up p_dot)`, where `u_dot` and `p_dot` are the tangents of the
/// exogenous input and of the loop parameters.
pub struct Jump {
    pub along: Vec<f64>,
    pub of_state: Vec<f64>,
    /// Empty if `g` does not depend on the exogenous input.
    pub of_input: Vec<f64>,
    pub of_set_up: Vec<f64>,
    /// The denominator: the rate of `g`, or of its change if the state slides.
    pub speed: f64,
    /// Whether the rates after the change lead back to the zero.
    pub slides: bool,
}

fn largest<'a>(x: impl IntoIterator<Item = &'a f64>) -> f64 {
    x.into_iter().fold(0.0, |most, x| most.max(x.abs()))
}

fn norm(x: &[f64]) -> f64 {
    x.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Return the error that the zero of `what` is grazed at time `t`.
pub fn grazed(what: &str, t: f64) -> Error {
    let problem = format!("{what} is grazed at t = {t} s, where the run has no derivative");
    Error::Solve { status: Status::Degraded, t, problem }
}

impl Jump {
    /// Return the jump at time `t` from the rates `[f-, f+]` and the derivatives of `g`. `drift` is `g_t`, and `what` is the name of the
    /// change. The other derivatives are with respect to state, exogenous input and loop parameters. The result is `None` if the rates are
    /// equal up to the tolerance. Error: `Solve` for a grazed zero.
    pub fn between(
        [before, after]: [&[f64]; 2],
        [of_state, of_input, of_set_up]: [&[f64]; 3],
        drift: f64,
        (what, t): (&str, f64),
    ) -> Result<Option<Jump>> {
        let jump: Vec<f64> = before.iter().zip(after).map(|(before, after)| after - before).collect();
        let (difference, size) = (largest(&jump), largest(before.iter().chain(after)));
        if !(difference > SAME * size) {
            return Ok(None);
        }
        let rate = |rates: &[f64]| of_state.iter().zip(rates).map(|(slope, rate)| slope * rate).sum::<f64>() + drift;
        let (toward, away) = (rate(before), rate(after));
        let slides = toward * away < 0.0;
        let speed = if slides { toward - away } else { toward };
        if !(speed.abs() > GRAZING * (norm(of_state) * norm(before) + drift.abs())) {
            return Err(grazed(what, t));
        }
        let along = jump.iter().map(|jump| jump / speed).collect();
        Ok(Some(Jump { along, of_state: of_state.to_vec(), of_input: of_input.to_vec(), of_set_up: of_set_up.to_vec(), speed, slides }))
    }
}

impl Walker<'_> {
    /// Compute the jump at contact change `k` of the timeline. The result is `None` if the state rates do not jump. Error: `Solve` for a
    /// grazed contact.
    pub fn jump(&mut self, k: usize, t: f64, state: &[f64]) -> Result<Option<Jump>> {
        let sizes = &self.prepared.functions.sizes;
        let (switch, size, moved) = (self.prepared.timeline.contacts.switches[k], sizes.states, sizes.moved);
        let (x, acting) = (&state[self.places.x()], &state[self.places.acting()]);
        self.prepared.directions.input(t, &mut self.u);
        let mut rates = |mode: usize| -> Result<Vec<f64>> {
            self.hold(mode);
            self.rates.give([&self.u, x, acting, &self.modes]);
            self.rates.run(t)?;
            Ok(self.rates.answers()[..size].to_vec())
        };
        let (before, after) = (rates(switch.before)?, rates(switch.after)?);
        let guard = &mut self.guards[switch.guard];
        guard.give([&self.u, x, &[], &[]]);
        guard.more(0, 1).fill(1.0);
        guard.run(t)?;
        let (of_set_up, rest) = guard.behind(0, moved + sizes.driven() + size).split_at(moved);
        Jump::between([&before, &after], [&rest[sizes.driven()..], &[], of_set_up], 0.0, ("a contact", t))
    }
}
