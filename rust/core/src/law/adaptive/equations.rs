//! Adaptive tracking (Slotine and Li 1987):
//!
//! `e = q_d - q`, `Lambda = Kd^-1 Kp`, `v_r = v_d + Lambda e`, `a_r = a_d + Lambda e_dot`, `s = v_r - v`,
//! `tau = Y(q, v, v_r, a_r) pi_hat + Kp e + Kd e_dot = Y pi_hat + Kd s`, `pi_hat_dot = Gamma Y' s`.
//!
//! The regressor `Y` satisfies `Y pi = M(q) a_r + C(q, v) v_r + g(q)` for the inertial parameters `pi`. The prime is the transpose.
//!
//! Rotor inertias (armature) and friction may be among the estimated parameters `pi` (`joint_columns`). If rotor inertias are not
//! estimated, they are known, and the torque `armature a_r` is added. The options replace `Y' s` by a vector `w`: see `restraint`,
//! `composite` and `concurrent`. `projection` and the natural metric (`adaptation`) replace `Gamma`.

use super::projection::Projector;
use super::{Adaptation, AdaptiveSpec, LeakageForm};
use crate::law::definition::Shape;
use crate::law::equations::{Adapting, Answer, Equations, Loop};
use crate::plant::Parameters;
use crate::scalar::Real;
use crate::spatial::PARAMETERS;
use crate::spatial::pseudo_inertia::natural_rate;
use crate::trace::expression::{constant, select, stacked, zeros};
use crate::trace::{E, V};

impl Shape for AdaptiveSpec {
    /// Whether both laws estimate the same parameters in the same metric with the same options.
    fn same_shape(&self, other: &Self) -> bool {
        let columns = |law: &AdaptiveSpec| law.base.as_ref().map(|base| base.columns.clone());
        std::mem::discriminant(&self.adaptation) == std::mem::discriminant(&other.adaptation)
            && columns(self) == columns(other)
            && self.projection.is_some() == other.projection.is_some()
            && self.columns.same_kinds(&other.columns)
            && self.restraint.same_shape(&other.restraint)
            && self.composite.is_some() == other.composite.is_some()
            && self.concurrent.is_some() == other.concurrent.is_some()
    }
}

impl Equations for AdaptiveSpec {
    fn parameters(&self, _: Option<f64>) -> Parameters {
        let numbers = Parameters::of_arm(&self.model)
            .gain("lambda", &self.lambda)
            .gain("kd", &self.kd)
            .fixed("rotors", &self.known_rotors())
            .numbers("friction_speed", self.columns.speeds());
        let numbers = match &self.adaptation {
            Adaptation::Euclidean(gamma) => numbers.gain("gamma", gamma),
            Adaptation::Natural(gamma) => numbers.numbers("gamma", gamma),
        };
        let restraint = &self.restraint;
        numbers
            .option(self.projection.as_ref(), |numbers, projection| numbers.made("projection", Projector::<E>::new(projection)))
            .option((restraint.leakage > 0.0).then_some(restraint), |numbers, restraint| {
                numbers.number("leakage", restraint.leakage).numbers("leakage_centre", &restraint.centre)
            })
            .option((restraint.dead_zone > 0.0).then_some(restraint.dead_zone), |numbers, x| numbers.number("dead_zone", x))
            .option(self.composite.as_ref(), |numbers, own| numbers.number("composite_rate", own.rate).gain("composite", &own.weight))
            .option(self.concurrent.as_ref(), |numbers, own| {
                numbers.matrix("stored_gram", self.parameter_sizes().1, &own.gram).numbers("stored_moment", &own.moment)
            })
    }

    fn equations(&self, at: &Loop) -> Answer {
        let (kd, lambda) = (at.gain("kd"), at.gain("lambda"));
        let [q_d, v_d, a_d] = at.desired_terms(0, &["q_d", "v_d", "a_d"]);
        let e = at.term("e", q_d - &at.q);
        let e_dot = at.term("e_dot", &v_d - &at.v);
        let v_r = at.term("v_r", v_d + lambda * &e);
        let a_r = at.term("a_r", a_d + lambda * &e_dot);
        let s = at.term("s", &v_r - &at.v);

        let pi_hat = at.z.rows(0, self.parameter_sizes().1).into_owned();
        let y = self.regressor(at.arm(), at.vector("friction_speed"), [&at.v, &v_r, &a_r]);
        at.term_on_request("Y", [s.len(), pi_hat.len()], || y.matrix());
        let [y_pi, y_s] = y.products(&pi_hat, &s);
        let tau = y_pi + kd * &s + at.vector("rotors").component_mul(&a_r);

        let (w, filter_rates) = self.adaptation_vector(at, &s, &y_s, &pi_hat, &tau);
        let mut rate = self.estimate_rate(at, &pi_hat, &w);
        let mut withheld = &y_s - w;
        if self.restraint.dead_zone > 0.0 {
            let s_0 = at.number("dead_zone");
            let inside = s.dot(&s).lt(s_0 * s_0);
            rate = select(inside, &zeros(rate.len()), &rate);
            withheld = select(inside, &y_s, &withheld);
        }
        let rate = at.term("estimate_rate", rate);
        let adaptation = Adapting { a_r, columns: y.columns, withheld, s: s.clone() };
        let dissipation = s.dot(&(kd * &s));
        Answer { dissipation, adaptation: Some(adaptation), ..Answer::with_rate(tau, stacked([&rate, &filter_rates])) }
    }

    fn start_state(&self, at: &Loop) -> V {
        if self.composite.is_none() {
            return at.z.clone();
        }
        stacked([&at.z.rows(0, self.parameter_sizes().1).into_owned(), &self.first_filters(at)])
    }
}

impl AdaptiveSpec {
    /// The vector `w` of the adaptation `pi_hat_dot = Gamma w`: `Y' s` with leakage and the adaptation from the filtered dynamics and from
    /// stored samples. The rates of the filters are the second result.
    fn adaptation_vector(&self, at: &Loop, s: &V, y_s: &V, pi_hat: &V, tau: &V) -> (V, V) {
        let (mut w, mut filter_rates) = (y_s.clone(), zeros(0));
        if self.restraint.leakage > 0.0 {
            let size = if self.restraint.form == LeakageForm::Error { s.dot(s).sqrt() } else { constant(1.0) };
            w -= (pi_hat - at.vector("leakage_centre")) * (at.number("leakage") * size);
        }
        if self.composite.is_some() {
            let (push, rates) = self.composite_adaptation(at, tau, pi_hat);
            w += push;
            filter_rates = rates;
        }
        if self.concurrent.is_some() {
            w += at.vector("stored_moment") - at.numbers().get_matrix("stored_gram") * pi_hat;
        }
        (w, filter_rates)
    }

    /// The rate of the estimate in the metric of the law, with its projection.
    fn estimate_rate(&self, at: &Loop, pi_hat: &V, w: &V) -> V {
        if let Adaptation::Natural(_) = self.adaptation {
            return natural(at.vector("gamma"), pi_hat, w);
        }
        let gamma = at.gain("gamma");
        let mut rate = gamma * w;
        if self.projection.is_some() {
            let projector: &Projector<E> = at.numbers().get_made("projection");
            projector.correct(gamma, pi_hat.as_slice(), w.as_slice(), rate.as_mut_slice());
        }
        rate
    }
}

/// The rates of the estimate in the natural metric: `P_hat_dot = gamma P_hat L P_hat` of each body, then `gamma w` of each parameter of a
/// joint column.
fn natural(gamma: &V, pi_hat: &V, w: &V) -> V {
    let bodies = (pi_hat.len() - gamma.len()) / (PARAMETERS - 1);
    let block = |x: &V, i: usize| -> [E; PARAMETERS] { std::array::from_fn(|k| x[PARAMETERS * i + k]) };
    let of_bodies = (0..bodies).flat_map(|i| natural_rate(&block(pi_hat, i), &block(w, i), gamma[i]));
    let of_joints = (bodies..gamma.len()).map(|k| gamma[k] * w[PARAMETERS * bodies + k - bodies]);
    V::from_vec(of_bodies.chain(of_joints).collect())
}
