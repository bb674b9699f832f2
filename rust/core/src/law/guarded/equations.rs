//! The equations of a guarded law: see the parent module.

use super::{GuardedSpec, Reaction};
use crate::law::definition::Shape;
use crate::law::equations::{Answer, Equations, Loop};
use crate::linalg::Gain;
use crate::plant::Parameters;
use crate::scalar::{Real, sign};
use crate::trace::expression::{clamp, constant, indicator, largest, magnitudes, select, stacked, zeros};
use crate::trace::{E, V};

impl Shape for GuardedSpec {
    fn same_shape(&self, other: &Self) -> bool {
        let alike = match (&self.reaction, &other.reaction) {
            (Some(Reaction::Float(one)), Some(Reaction::Float(two))) => one.is_some() == two.is_some(),
            (Some(one), Some(two)) => std::mem::discriminant(one) == std::mem::discriminant(two),
            (one, two) => one.is_none() && two.is_none(),
        };
        alike && self.inner.same_shape(&other.inner) && self.model.same_geometry(&other.model)
    }
}

impl Equations for GuardedSpec {
    fn parameters(&self, period: Option<f64>) -> Parameters {
        let inner = self.inner.parameters(period);
        let gain = period.map_or_else(|| self.gain.clone(), |period| sampled_gain(&self.gain, period));
        let (stiffness, damping) = self.reaction.as_ref().map_or((None, None), Reaction::gains);
        let [viscous, coulomb] = &self.friction;
        let retreat = if let Some(Reaction::Retract(_, _, speed, duration)) = self.reaction { Some([speed, duration]) } else { None };
        Parameters::of_arm(&self.model)
            .around(inner)
            .gain("observer_gain", &gain)
            .numbers("observer_damping", viscous)
            .numbers("observer_friction", coulomb)
            .option(self.joint_stiffness.as_ref(), |numbers, gain| numbers.gain("law_joint_stiffness", gain))
            .option(self.reacts().then_some(&self.thresholds), |numbers, x| numbers.numbers("threshold", x))
            .option(stiffness, |numbers, gain| numbers.gain("reaction_stiffness", gain))
            .option(damping, |numbers, gain| numbers.gain("reaction_damping", gain))
            .option(retreat, |numbers, [speed, duration]| numbers.number("reaction_speed", speed).number("reaction_duration", duration))
    }

    fn equations(&self, at: &Loop) -> Answer {
        let n = at.q.len();
        let p = at.z.len() - self.own_states();
        let [z, w] = [at.z.rows(0, p), at.z.rows(p, n)].map(|part| part.into_owned());
        let Answer { mut tau, z_dot: mut inner_rate, .. } = self.inner.equations(&at.inner(z));

        // The observer: r = K (p - w), w_dot = tau - tau_f + C' v - g + r.
        let arm = at.arm();
        let momentum = at.term("momentum", arm.mass_matrix() * &at.v);
        // The difference is not fused, so that the residual starts at exactly zero.
        let r = at.gain("observer_gain") * &E::as_written(|| &momentum - &w);
        let g = arm.gravity();

        let mut reaction = zeros(0);
        let mut reacting = E::zero();
        if self.reacts() {
            let Contact { torque, rate, hot } = self.react(at, &at.z.rows_range(p + 2 * n..).into_owned(), &r, &g);
            let reacts = E::zero().lt(hot);
            tau = select(reacts, &torque, &tau);
            inner_rate = select(reacts, &zeros(p), &inner_rate);
            (reaction, reacting) = (rate, hot);
        }
        let tau = clamp(&tau, at.tau_max);
        let r = at.term("residual", r);
        E::term("reacting", &[1], || vec![reacting]);

        let observed = match &self.joint_stiffness {
            None => tau.clone(),
            Some(_) => at.gain("law_joint_stiffness") * &(&at.theta - &at.q),
        };
        let tau_f = at.vector("observer_damping").component_mul(&at.v) + at.vector("observer_friction").component_mul(&at.v.map(sign));
        let w_dot = observed - g - tau_f + &r + arm.coriolis_matrix(&at.v).tr_mul(&at.v);
        Answer::with_rate(tau, stacked([&inner_rate, &w_dot, &r, &reaction]))
    }

    fn start_state(&self, at: &Loop) -> V {
        let (n, p) = (at.q.len(), at.z.len() - self.own_states());
        let inner = self.inner.start_state(&at.inner(at.z.rows(0, p).into_owned()));
        stacked([&inner, &(at.arm().mass_matrix() * &at.v), &at.z.rows_range(p + n..).into_owned()])
    }
}

/// The reaction at one sample.
struct Contact {
    /// Torque of the reaction, `(n,)`, N m or N.
    torque: V,
    /// Rate of the part of the law's state that begins with `c`.
    rate: V,
    /// 1 from the sample of contact on, else 0.
    hot: E,
}

impl GuardedSpec {
    /// Length of the law's state without the state of the inner law.
    fn own_states(&self) -> usize {
        self.start.len() - self.inner.initial_state().len()
    }

    /// Detect contact, and compute the torque of the reaction. `z` is the part of the law's state that begins with `c`: `c`, the time since
    /// contact, `y_c c` and `r_c c`.
    fn react(&self, at: &Loop, z: &V, r: &V, g: &V) -> Contact {
        let (n, one) = (r.len(), constant(1.0));
        let (y, y_dot) = if self.joint_stiffness.is_some() { (&at.theta, &at.theta_dot) } else { (&at.q, &at.v) };
        let (c, elapsed) = (z[0], z[1]);
        let before = E::zero().lt(c);
        let level = largest(&magnitudes(r).component_div(at.vector("threshold")));
        let first = E::select(before, E::zero(), indicator(one.lt(level)));
        let hot = E::select(before, one, first);

        let y_c = select(before, &(z.rows(2, n) / E::select(before, c, one)), y);
        let (mut ahead, mut ahead_dot) = (y_c - y, -y_dot);
        if let Some(Reaction::Retract(..)) = self.reaction {
            // At the sample of contact, `r_c` is the residual of this sample.
            let r_c = select(before, &z.rows(2 + n, n).into_owned(), r);
            let most = largest(&magnitudes(&r_c));
            let direction = r_c / E::select(E::zero().lt(most), most, one);
            let (speed, duration) = (at.number("reaction_speed"), at.number("reaction_duration"));
            ahead += &direction * (speed * elapsed.min(duration));
            ahead_dot += direction * E::select(elapsed.lt(duration), speed, E::zero());
        }
        let mut torque = g.clone();
        for (name, x) in [("reaction_stiffness", &ahead), ("reaction_damping", &ahead_dot)] {
            if at.numbers().has(name) {
                torque += at.gain(name) * x;
            }
        }
        let rate = stacked([&V::from_vec(vec![first, hot]), &(y * first), &(r * first)]);
        Contact { torque, rate, hot }
    }
}

/// The observer gain `K_T = K (I + K T)^-1` of a sampled loop with the sample time `period`.
fn sampled_gain(gain: &Gain, period: f64) -> Gain {
    let n = gain.n();
    if gain.is_diagonal() {
        return Gain::unchecked(n, (0..n).map(|i| gain.at(i, i) / (gain.at(i, i) * period + 1.0)).collect());
    }
    let sum = (0..n * n).map(|k| gain.at(k / n, k % n) * period + f64::from(u8::from(k / n == k % n))).collect();
    Gain::unchecked(n, sum).solve(gain)
}
