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
use crate::law::{CartesianImpedanceSpec, turn_rates};
use crate::linalg::Cholesky;
use crate::plant::{Parameters, RecordedPlant};
use crate::scalar::Real;
use crate::trace::expression::{constant, magnitudes, vector, zeros};
use crate::trace::{E, M, V};

/// `M_x` counts as defined if two conditions are met. First, the smallest singular value of `J`, with rows of length one, exceeds this
/// limit. Second, the projector of the law, if there is one, has no loss.
const EPS: f64 = 0.02;

/// The target model of one law.
struct TargetModel<'a> {
    law: &'a CartesianImpedanceSpec,
    numbers: Parameters,
    plant: RecordedPlant<'a>,
    /// The frame of the external wrench, if it is not the frame of the law.
    force_frame: Option<usize>,
    static_torque: Option<StaticTorque>,
}

impl<'a> TargetModel<'a> {
    fn new(scope: &Scope<'_, 'a>) -> Option<Self> {
        let (problem, law) = (scope.problem, scope.law().impedance()?);
        let numbers = Parameters::default()
            .gain("stiffness", &law.stiffness)
            .gain("damping", &law.damping)
            .option(law.options().feedforward.as_ref(), |numbers, x| numbers.numbers("feedforward", x));
        Some(TargetModel {
            law,
            numbers,
            plant: RecordedPlant::new(scope.plant(), problem.force_frame()),
            force_frame: problem.force_frame.filter(|_| !problem.forces.is_empty()),
            static_torque: StaticTorque::new(law),
        })
    }

    /// The terms of the target model, `(m,)` each, whose signed sum is zero: inertial, coupling, damping, spring, and minus the force. The
    /// last result is positive where the model holds.
    fn terms(&self, moment: &Moment) -> ([V; 5], E) {
        let (at, coordinates, options) = (moment.at, &self.law.coordinates, self.law.options());
        let (v, m) = (&at.plant.v, coordinates.m());
        let [x_d, mut x_d_dot, mut x_d_ddot] = at.desired[0].clone();
        if self.law.turns_target() {
            [x_d_dot, x_d_ddot] = turn_rates(&coordinates.rows, [&x_d, &x_d_dot, &x_d_ddot]);
        }
        let (e, j) = at.arm.error_and_jacobian(coordinates, &x_d);
        let mass = Cholesky::of(&at.arm.mass_matrix());
        let spread = mass.solve_lower(&j.transpose()).transpose();
        let m_x = Cholesky::of(&(&spread * spread.transpose()));
        // J M^-1 tau of a torque tau.
        let acceleration = |tau: &V| &spread * mass.solve_lower_vector(tau);

        let n = v.len();
        let a = self.plant.rates(&at.x[..2 * n], moment.tau, moment.wrench).x_dot.rows(n, n).into_owned();
        let bias = at.arm.bias_acceleration(v, coordinates.frame);
        let j_dot_v = V::from_fn(m, |k, _| bias[coordinates.rows[k] / 3][coordinates.rows[k] % 3]);
        let mut x_ddot = &j * a + &j_dot_v;
        let mut coupling = acceleration(&(at.arm.coriolis_matrix(v) * v)) - j_dot_v;
        if options.compensate_coupling {
            x_ddot -= x_d_ddot;
            coupling = zeros(m);
        }
        let damping = self.numbers.get_gain("damping") * &(&j * v - x_d_dot);
        let spring = -(self.numbers.get_gain("stiffness") * &e);

        let mut force = match self.force_frame {
            Some(frame) => m_x.solve_vector(&acceleration(&at.arm.jacobian(frame).1.tr_mul(&vector(moment.wrench)))),
            None => V::from_iterator(m, coordinates.rows.iter().map(|&row| moment.wrench[row])),
        };
        if options.feedforward.is_some() {
            force += self.numbers.get_numbers("feedforward");
        }
        if options.integral_gain.is_some() {
            force += &at.z;
        }
        if let Some(null_space) = &self.static_torque {
            force += m_x.solve_vector(&acceleration(&null_space.torque(&at.desired[1], &at.plant, &j)));
        }
        let valid = regularity(&j) * mass.definite * m_x.definite;
        ([m_x.solve_vector(&x_ddot), m_x.solve_vector(&coupling), damping, spring, -force], valid)
    }
}

/// One if the smallest singular value of the Jacobian `j` with normalised rows exceeds `EPS`, otherwise zero.
fn regularity(j: &M) -> E {
    let square = j * j.transpose();
    let m = square.nrows();
    let normalised = M::from_fn(m, m, |k, l| {
        let own = if k == l { constant(EPS * EPS) } else { E::zero() };
        square[(k, l)] / (square[(k, k)] * square[(l, l)]).sqrt() - own
    });
    Cholesky::of(&normalised).definite
}

/// The target model of a Cartesian impedance law.
pub struct Target;

impl MonitorKind for Target {
    const NAMES: &'static [&'static str] = &["target", "target_balance"];

    fn applies(scope: &Scope) -> bool {
        scope.monitored.target
    }

    fn build<'a>(scope: &Scope<'_, 'a>) -> Option<Box<dyn Monitor + 'a>> {
        Some(Box::new(TargetModel::new(scope)?))
    }
}

impl Monitor for TargetModel<'_> {
    /// The largest term and the largest residual, or zeros where the model does not hold.
    fn evaluate(&self, at: &Moment, out: &mut [E]) {
        let (terms, valid) = self.terms(at);
        let residual = magnitudes(&terms.iter().skip(1).fold(terms[0].clone(), |sum, term| sum + term));
        // `max` would ignore a residual that is NaN.
        let worst = residual.iter().fold(E::zero(), |worst, &residual| E::select(residual.lt(worst), worst, residual));
        let sizes = terms.iter().flat_map(|term| magnitudes(term).iter().copied().collect::<Vec<E>>());
        let largest = sizes.fold(E::zero(), |largest, term| E::select(largest.lt(term), term, largest));
        let holds = |x: E| {
            let x = E::select(E::zero().lt(valid), x, E::zero());
            at.loss.map_or(x, |loss| E::select(E::zero().lt(loss), E::zero(), x))
        };
        (out[0], out[1]) = (holds(largest), holds(worst));
    }
}
