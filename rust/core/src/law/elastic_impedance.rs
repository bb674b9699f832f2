//! Cartesian impedance through elastic joints (Ott, Albu-Schaeffer, Kugi and Hirzinger 2008). The outer loop is an impedance law, which
//! computes `u`. The inner loop converts `u` into the motor torque
//!
//! `tau = (I - B B0^-1) K_J (theta - q) + B B0^-1 ( J'[K_m (x_d - x) + D_m (x_d_dot - J v)] + g(q) - D0 w )`
//!
//! with the motor positions `theta` and the joint stiffness `K_J`. `B` is the motor inertia, `B0` its reduced value, `D0` its damping, and
//! `w` the damped velocity of `inertia_reduction`. The prime is the transpose. Units are those of revolute joints. The options are the
//! options of the rigid law, except that `tau_max` limits the motor torque `tau`. An integral wrench `F_I` contributes `B B0^-1 J' F_I` to
//! `tau`.
//!
//! For a target at rest and without options, the storage function
//! `E = v'Mv/2 + (theta-q)'K_J(theta-q)/2 + theta_dot'B0 theta_dot/2 + e'K_m e/2`, with `e = x_d - x`, obeys the identity
//! `dE/dt = F.x_dot - theta_dot'D0 w - x_dot'D_m x_dot + (theta_dot - v).u`, where `F` is the external force. The last term has no
//! definite sign.

use super::cartesian_impedance::{CartesianImpedance, CartesianImpedanceSpec};
use super::definition::{Definition, Law, Shape};
use super::impedance_options::held;
use super::inertia_reduction::{Reduction, ReductionSpec, described, reduced_facts};
use super::terms::{Instant, Term};
use crate::dynamics::{AnyArm, Dynamics};
use crate::kinematics::{Coordinates, jacobian_dot};
use crate::linalg::cholesky;
use crate::plant::PlantSpec;
use crate::scalar::Real;

/// Cartesian impedance of an arm with elastic joints, with validated parameters.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// # use armlet_core::plant::{ElasticSpec, PlantSpec};
/// use armlet_core::law::{CartesianImpedanceSpec, ElasticImpedanceSpec, Gain, ReductionSpec};
/// # let model = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?);
/// # let gain = |k: f64| Gain::scalar("gain", 2, k);
/// # let elastic = |stiffness| ElasticSpec::new(model.clone(), gain(stiffness)?, gain(0.2)?, None, None, None).map(PlantSpec::from);
///
/// let outer = CartesianImpedanceSpec::new(model.clone(), Motion::hold(vec![0.7, 0.2])?, gain(60.0)?, gain(12.0)?, "link2", "xy")?;
/// let inner = ReductionSpec::new(2, gain(2000.0)?, gain(0.2)?, gain(0.05)?, None, 0.7, false)?;
/// let law = ElasticImpedanceSpec { outer, inner };
/// // The storage function requires a plant with the stiffness of the law.
/// assert!(law.has_storage(&elastic(2000.0)?) && !law.has_storage(&elastic(1500.0)?));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct ElasticImpedanceSpec {
    /// The outer loop: the impedance law of the links.
    pub outer: CartesianImpedanceSpec,
    /// The inner loop: the reduction of motor inertia.
    pub inner: ReductionSpec,
}

impl ElasticImpedanceSpec {
    /// Whether the energy `E`, plus the energy of wall and stops, is a storage function on this plant.
    ///
    /// The plant must agree with the law's model, and have neither joint damping nor friction. The motor torque must have no limit. Rows of
    /// orientation are excluded, because there the rate of `e` is not `-J v`.
    pub fn has_storage(&self, plant: &PlantSpec) -> bool {
        !self.outer.coordinates.turns()
            && self.outer.options.tau_max.is_none()
            && described(plant, &self.outer.model, &self.inner).is_some()
    }
}

impl Definition for ElasticImpedanceSpec {
    reduced_facts!("ElasticImpedance");

    fn initial_state(&self) -> &[f64] {
        self.outer.initial_state()
    }

    fn terms(&self, at: &Instant) -> Vec<Term> {
        let n = self.outer.model.n();
        let mut law = self.build::<f64>();
        let (mut tau, mut rate) = (vec![0.0; n], vec![0.0; at.z.len()]);
        law.evaluate(at.desired, at.trig, at.x, at.z, &mut tau, &mut rate);
        let own = ["u", "tau", "integral_rate"];
        let mut terms: Vec<Term> = self.outer.terms(at).into_iter().filter(|(name, _, _)| !own.contains(name)).collect();
        if !rate.is_empty() {
            terms.push(("integral_rate", vec![rate.len()], rate));
        }
        terms.extend(self.target_dynamics(&mut law.outer, at.trig, &at.x[..n], &at.x[n..2 * n]));
        terms.extend(law.inner.terms(&self.inner));
        terms.push(("tau", vec![n], tau));
        terms
    }

    fn coordinates(&self) -> Option<&Coordinates> {
        self.outer.coordinates()
    }
}

impl Shape for ElasticImpedanceSpec {
    fn same_shape(&self, other: &Self) -> bool {
        self.outer.same_shape(&other.outer)
    }
}

impl ElasticImpedanceSpec {
    pub(super) fn build<S: Real>(&self) -> ElasticImpedance<S> {
        let mut outer: CartesianImpedance<S> = self.outer.build();
        let zeros = vec![S::zero(); self.outer.model.n()];
        ElasticImpedance { limits: outer.extras.take_torque_limits(), outer, inner: self.inner.build(), column: zeros.clone(), push: zeros }
    }

    /// Terms for diagnosis: mass matrix `M`, Coriolis matrix `S`, gravity torque `g`, `Jdot`, and in the task space `M_x = (J M^-1 J')^-1`
    /// and `S_x = M_x (J M^-1 S - Jdot) M^-1 J' M_x`.
    ///
    /// `M_x` and `S_x` are NaN where `J` loses rank. The torque does not use them.
    fn target_dynamics(&self, outer: &mut CartesianImpedance<f64>, trig: &[(f64, f64)], q: &[f64], v: &[f64]) -> Vec<Term> {
        let (n, m) = (q.len(), self.outer.coordinates.m());
        let (mut mass, mut coriolis, mut g) = (vec![0.0; n * n], vec![0.0; n * n], vec![0.0; n]);
        outer.arm.mass_matrix(&mut outer.workspace, trig, q, &mut mass);
        outer.arm.coriolis_matrix(&mut outer.workspace, trig, q, v, &mut coriolis);
        outer.arm.gravity(&mut outer.workspace, trig, q, &mut g);
        let mut rate = vec![0.0; m * n];
        if let AnyArm::Tree(tree) = &outer.arm {
            let (ws, full) = (&mut outer.workspace, &mut vec![0.0; 6 * n]);
            jacobian_dot(tree, &mut ws.poses, &mut ws.motion, (trig, q), v, self.outer.coordinates.frame, full);
            self.outer.coordinates.copy_rows(full, &mut rate);
        }
        let jacobian = &outer.jacobian;
        let nan = || vec![f64::NAN; m * m];
        // `spread` is `J M^-1`, `(m, n)`; `None` if `M` is not positive definite.
        let spread = cholesky::factor(n, &mass).map(|l| {
            let mut rows = jacobian.clone();
            rows.chunks_exact_mut(n).for_each(|row| cholesky::solve(n, &l, row));
            rows
        });
        let (mut m_x, mut s_x) = (nan(), nan());
        if let Some(rows) = &spread {
            let product = |a: &[f64], b: &[f64]| -> Vec<f64> {
                // The product a b' of two matrices (m, n).
                (0..m * m).map(|at| (0..n).map(|k| a[at / m * n + k] * b[at % m * n + k]).sum()).collect()
            };
            if let Some(l) = cholesky::factor(m, &product(jacobian, rows)) {
                // Multiply by M_x from the right, row by row: M_x is symmetric.
                let times_m_x = |x: &mut [f64]| x.chunks_exact_mut(m).for_each(|row| cholesky::solve(m, &l, row));
                m_x = (0..m * m).map(|at| f64::from(u8::from(at / m == at % m))).collect();
                times_m_x(&mut m_x);
                let drift: Vec<f64> =
                    (0..m * n).map(|at| (0..n).map(|k| rows[at / n * n + k] * coriolis[k * n + at % n]).sum::<f64>() - rate[at]).collect();
                let mut right = product(&drift, rows);
                times_m_x(&mut right);
                s_x = (0..m * m).map(|at| (0..m).map(|k| m_x[at / m * m + k] * right[k * m + at % m]).sum()).collect();
            }
        }
        vec![
            ("M", vec![n, n], mass),
            ("S", vec![n, n], coriolis),
            ("g", vec![n], g),
            ("Jdot", vec![m, n], rate),
            ("M_x", vec![m, m], m_x),
            ("S_x", vec![m, m], s_x),
        ]
    }
}

/// Cartesian impedance through elastic joints in a control loop.
pub struct ElasticImpedance<S: Real> {
    outer: CartesianImpedance<S>,
    inner: Reduction<S>,
    /// Limits of the motor torque, `(n,)`, N m; `None` without limits.
    limits: Option<Vec<S>>,
    /// The effect of the rate of entry `k` of the integral wrench on the joint torques: row `k` of `J` times this rate, `(n,)`.
    column: Vec<S>,
    /// The effect of `column` on the motor torque, `(n,)`.
    push: Vec<S>,
}

impl<S: Real> ElasticImpedance<S> {
    /// Limit the motor torque. Stop the rate `dz` of the integral where it would move a torque further beyond its limit.
    fn limit(&mut self, tau: &mut [S], dz: &mut [S]) {
        let Some(limits) = &self.limits else { return };
        let n = tau.len();
        for (k, rate) in dz.iter_mut().enumerate() {
            for (column, &j) in self.column.iter_mut().zip(&self.outer.jacobian[k * n..(k + 1) * n]) {
                *column = j * *rate;
            }
            self.inner.spread(&self.column, &mut self.push);
            for (i, &limit) in limits.iter().enumerate() {
                *rate = held(tau[i], limit, self.push[i], *rate);
            }
        }
        for (tau, &limit) in tau.iter_mut().zip(limits) {
            *tau = tau.clamped(-limit, limit);
        }
    }
}

impl<S: Real> Law<S> for ElasticImpedance<S> {
    fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], z: &[S], tau: &mut [S], dz: &mut [S]) {
        self.outer.evaluate(desired, trig, x, z, tau, dz);
        self.inner.apply(x, tau);
        self.limit(tau, dz);
    }

    fn storage_rate(&self, x: &[S], outside: S) -> S {
        outside + self.inner.power(x) + self.outer.power(x)
    }
}
