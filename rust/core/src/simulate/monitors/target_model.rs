//! The target model of Cartesian impedance (Hogan 1985). It holds at every instant for an arm on which only this law, gravity and the
//! external force `F` act, away from singularities:
//!
//! `M_x x_ddot + (S_x + D_m) x_dot + K_m (x - x_d) = F`, `M_x = (J M^-1 J')^-1`, `S_x x_dot = M_x (J M^-1 C v - J_dot v)`.
//!
//! `x` are the controlled rows of the frame's pose, `x_d` their target, `J` their Jacobian, `K_m` and `D_m` the law's stiffness and
//! damping. `'` is the transpose. `J_dot v` comes from the Newton-Euler recursion, independently of the law. This form of `S_x x_dot` needs no inverse of `J`, so that it also
//! holds for redundant arms. `x_ddot = J a + J_dot v`, where `a` is the acceleration of the plant. For a moving target,
//! `D_m (x_dot - x_d_dot)` replaces `D_m x_dot`.
//!
//! Options of the law add to `F`: the feedforward wrench, the integral wrench, and the wrench of a static null space ([`StaticTorque`]). If
//! the law compensates the coupling, `M_x (x_ddot - x_d_ddot)` replaces `M_x x_ddot + S_x x_dot`.

use super::static_torque::StaticTorque;
use super::{Moment, Monitor, MonitorKind, Scope};
use crate::dynamics::ArmAt;
use crate::kinematics::Coordinates;
use crate::law::turn_rates;
use crate::linalg::cholesky;
use crate::linalg::gain::AnyGain;
use crate::plant::Plant;
use crate::scalar::{Real, labelled_numbers};
use crate::trace::Sym;

/// `M_x` counts as defined if two conditions are met. First, the smallest singular value of `J`, with rows of length one, exceeds this
/// limit. Second, the projector of the law, if there is one, has no loss.
const EPS: f64 = 0.02;

/// The target model of one run, on plain numbers or on recorded values.
pub struct TargetModel {
    coordinates: Coordinates,
    stiffness: AnyGain<Sym>,
    damping: AnyGain<Sym>,
    plant: Box<dyn Plant + Send>,
    /// The frame at which the force acts, if the problem names one. Otherwise the force acts at the law's frame.
    elsewhere: Option<usize>,
    rates: Vec<Sym>,
    /// The mass matrix `M`, shape `(n, n)`.
    mass: Vec<Sym>,
    /// The Cholesky factor `L` of `M = L L'`, shape `(n, n)`.
    factor: Vec<Sym>,
    /// The Coriolis matrix `C`, shape `(n, n)`.
    coriolis: Vec<Sym>,
    /// The Jacobian `J`, shape `(m, n)`.
    jacobian: Vec<Sym>,
    /// The product `J L^-T`, shape `(m, n)`.
    spread: Vec<Sym>,
    /// The vector `L^-1 C v`, then the vector `L^-1 J_F' F` of a force `F` at a frame with the Jacobian `J_F`, shape `(n,)`.
    torque: Vec<Sym>,
    /// A symmetric matrix, shape `(m, m)`.
    square: Vec<Sym>,
    /// The Cholesky factor of this matrix, shape `(m, m)`.
    square_factor: Vec<Sym>,
    /// The error `x_d - x`, shape `(m,)`.
    e: Vec<Sym>,
    /// The rate error `x_dot - x_d_dot`, shape `(m,)`.
    slip: Vec<Sym>,
    /// The terms of the model, shape `(m,)` each.
    terms: [Vec<Sym>; 5],
    /// `x_d_dot` and `x_d_ddot` of a target that rotates. `None` if the samples of the desired motion contain them.
    rates_of_target: Option<[Vec<Sym>; 2]>,
    coupled: bool,
    feedforward: Option<Vec<Sym>>,
    static_torque: Option<StaticTorque>,
}

fn dot(a: &[Sym], b: &[Sym]) -> Sym {
    a.iter().zip(b).fold(Sym::zero(), |sum, (&a, &b)| sum + a * b)
}

impl TargetModel {
    /// Return the target model of a run to which this monitor applies.
    fn new(scope: &Scope) -> Option<Self> {
        let (problem, plant, law) = (scope.problem, scope.plant(), scope.law().impedance()?);
        let (n, m) = (plant.n(), law.coordinates.m());
        let zeros = |k: usize| vec![Sym::zero(); k];
        Some(TargetModel {
            coordinates: law.coordinates.clone(),
            stiffness: AnyGain::labelled("stiffness", &law.stiffness),
            damping: AnyGain::labelled("damping", &law.damping),
            plant: plant.build(problem.force_frame()),
            elsewhere: problem.force_frame.filter(|_| !problem.forces.is_empty()),
            rates: zeros(2 * n),
            mass: zeros(n * n),
            factor: zeros(n * n),
            coriolis: zeros(n * n),
            jacobian: zeros(m * n),
            spread: zeros(m * n),
            torque: zeros(n),
            square: zeros(m * m),
            square_factor: zeros(m * m),
            e: zeros(m),
            slip: zeros(m),
            terms: std::array::from_fn(|_| zeros(m)),
            rates_of_target: law.turns_target().then(|| [zeros(m), zeros(m)]),
            coupled: law.options().compensate_coupling,
            feedforward: law.options().feedforward.as_ref().map(|fed| labelled_numbers("feedforward", fed)),
            static_torque: StaticTorque::new(law),
        })
    }

    /// Return the largest term of the model and the largest residual. `arm` must be at the position `q` of the record. Both are zero where
    /// `M_x` is not defined, or where the law's projector has a loss.
    fn evaluate(
        &mut self,
        arm: &mut ArmAt<Sym>,
        (desired, wrench): (&[Sym], &[Sym; 6]),
        (x, z, tau): (&[Sym], &[Sym], &[Sym]),
        loss: Option<Sym>,
    ) -> [Sym; 2] {
        let (n, m) = (tau.len(), self.e.len());
        let (q, v) = x.split_at(n);
        self.turn_target(desired);
        arm.error_and_jacobian(&self.coordinates, &desired[..m], &mut self.e, &mut self.jacobian);
        let regular = self.is_regular(n, m);
        arm.mass_matrix(&mut self.mass);
        let definite = cholesky::factor_into(n, &self.mass, &mut self.factor);
        self.spread.copy_from_slice(&self.jacobian);
        self.spread.chunks_exact_mut(n).for_each(|row| cholesky::solve_lower(n, &self.factor, row));
        self.plant.rates(arm.trig(), x, tau, wrench, &mut self.rates);
        arm.coriolis_matrix(v, &mut self.coriolis);
        let bias = arm.bias_acceleration(v, self.coordinates.frame);
        let (rate, second) = match &self.rates_of_target {
            Some([rate, second]) => (&rate[..], &second[..]),
            None => (&desired[m..2 * m], &desired[2 * m..3 * m]),
        };
        let [inertial, coupling, damping, spring, force] = &mut self.terms;
        for (torque, row) in self.torque.iter_mut().zip(self.coriolis.chunks_exact(n)) {
            *torque = dot(row, v);
        }
        cholesky::solve_lower(n, &self.factor, &mut self.torque);
        for (k, &row) in self.coordinates.rows.iter().enumerate() {
            let turning = bias[row / 3][row % 3];
            inertial[k] = dot(&self.jacobian[k * n..(k + 1) * n], &self.rates[n..]) + turning;
            coupling[k] = dot(&self.spread[k * n..(k + 1) * n], &self.torque) - turning;
            self.slip[k] = dot(&self.jacobian[k * n..(k + 1) * n], v) - rate[k];
            force[k] = wrench[row];
            if self.coupled {
                inertial[k] -= second[k];
                coupling[k] = Sym::zero();
            }
        }
        self.damping.multiply(&self.slip, damping);
        self.stiffness.multiply(&self.e, spring);
        spring.iter_mut().for_each(|spring| *spring = -*spring);
        if let Some(frame) = self.elsewhere {
            let (_, there) = arm.jacobian(frame);
            for (i, torque) in self.torque.iter_mut().enumerate() {
                *torque = (0..6).fold(Sym::zero(), |sum, k| sum + there[k * n + i] * wrench[k]);
            }
            cholesky::solve_lower(n, &self.factor, &mut self.torque);
            for k in 0..m {
                force[k] = dot(&self.spread[k * n..(k + 1) * n], &self.torque);
            }
        }
        for k in 0..m {
            for l in 0..m {
                self.square[k * m + l] = dot(&self.spread[k * n..(k + 1) * n], &self.spread[l * n..(l + 1) * n]);
            }
        }
        let invertible = cholesky::factor_into(m, &self.square, &mut self.square_factor);
        cholesky::solve(m, &self.square_factor, inertial);
        cholesky::solve(m, &self.square_factor, coupling);
        if self.elsewhere.is_some() {
            cholesky::solve(m, &self.square_factor, force);
        }
        self.add_options(&desired[3 * m..], q, &v[..n], z);
        let found = self.largest_and_worst();
        let there = Sym::zero().lt(regular * definite * invertible);
        found.map(|x| {
            let x = Sym::select(there, x, Sym::zero());
            loss.map_or(x, |loss| Sym::select(Sym::zero().lt(loss), Sym::zero(), x))
        })
    }

    /// Add the wrenches of the law's options, and the wrench of a static null space, to the force.
    fn add_options(&mut self, posture: &[Sym], q: &[Sym], v: &[Sym], z: &[Sym]) {
        let (n, m) = (q.len(), self.e.len());
        let [_, _, _, _, force] = &mut self.terms;
        for added in self.feedforward.as_deref().into_iter().chain((z.len() == m).then_some(z)) {
            force.iter_mut().zip(added).for_each(|(force, &added)| *force += added);
        }
        if let Some(null) = &mut self.static_torque {
            null.evaluate(posture, q, v, &self.jacobian);
            cholesky::solve_lower(n, &self.factor, &mut null.torque);
            for k in 0..m {
                null.wrench[k] = dot(&self.spread[k * n..(k + 1) * n], &null.torque);
            }
            cholesky::solve(m, &self.square_factor, &mut null.wrench);
            force.iter_mut().zip(&null.wrench).for_each(|(force, &added)| *force += added);
        }
    }

    fn largest_and_worst(&self) -> [Sym; 2] {
        let [inertial, coupling, damping, spring, force] = &self.terms;
        let (mut largest, mut worst) = (Sym::zero(), Sym::zero());
        for k in 0..self.e.len() {
            let residual = (inertial[k] + coupling[k] + damping[k] + spring[k] - force[k]).abs();
            // `max` would ignore a residual that is NaN.
            worst = Sym::select(residual.lt(worst), worst, residual);
            for term in [inertial, coupling, damping, spring, force] {
                let term = term[k].abs();
                largest = Sym::select(largest.lt(term), term, largest);
            }
        }
        [largest, worst]
    }

    /// Compute `x_d_dot` and `x_d_ddot` for a target with a moving rotation vector.
    fn turn_target(&mut self, desired: &[Sym]) {
        let m = self.e.len();
        if let Some([rate, second]) = &mut self.rates_of_target {
            rate.copy_from_slice(&desired[m..2 * m]);
            second.copy_from_slice(&desired[2 * m..3 * m]);
            turn_rates(&self.coordinates.rows, &desired[..3 * m], rate, second);
        }
    }

    /// Return one if the smallest eigenvalue of `J J'` exceeds `EPS^2`, where rows of `J` have length one. Otherwise return zero.
    fn is_regular(&mut self, n: usize, m: usize) -> Sym {
        for k in 0..m {
            for l in 0..m {
                let (a, b) = (&self.jacobian[k * n..(k + 1) * n], &self.jacobian[l * n..(l + 1) * n]);
                self.square[k * m + l] = dot(a, b) / (dot(a, a) * dot(b, b)).sqrt();
            }
            self.square[k * m + k] -= Sym::splat(EPS * EPS);
        }
        cholesky::factor_into(m, &self.square, &mut self.square_factor)
    }
}

/// The target model as a monitor: the largest term and the largest residual.
pub struct Target;

impl MonitorKind for Target {
    const NAMES: &'static [&'static str] = &["target", "target_balance"];

    fn applies(scope: &Scope) -> bool {
        scope.monitored.target
    }

    fn build(scope: &Scope) -> Option<Box<dyn Monitor + Send>> {
        Some(Box::new(TargetModel::new(scope)?))
    }
}

impl Monitor for TargetModel {
    fn evaluate(&mut self, at: &mut Moment, out: &mut [Sym]) {
        out.copy_from_slice(&TargetModel::evaluate(self, at.arm, (at.desired, at.wrench), (at.x, at.z, at.tau), at.loss));
    }
}
