//! The null space of an impedance law, and the coupling between its motion and the frame (Khatib 1987; Ott 2008):
//!
//! The torque `tau_0 = K_n (q_n - q) + D_n (q_n_dot - v)` acts as `N' tau_0`, with `N' = I - J' L J W^-1` and `L = (J W^-1 J')^-1`. `J` is
//! the Jacobian of the controlled rows, `W` a metric, and `'` the transpose:
//!
//! - dynamically consistent, `W = M`: `J M^-1 N' = 0`, so `tau_0` does not accelerate the controlled rows;
//! - static, `W = I`: `N' = I - J' (J')#`.
//!
//! Compensation of the coupling adds the torque `C v` and the wrench `L (x_d_ddot - J_dot v)` with `W = M`. Then
//! `L (x_ddot - x_d_ddot) = F` for every motion in the consistent null space, where `F` is the sum of the other wrenches of the law. This
//! requires an exact model, and a pose that is not near a singularity.
//!
//! Near singularities, `L` is clamped. First, the rows of `J W^-1/2` are scaled: the rows of position by one factor, the rows of
//! orientation by another one. In each group, the norms then have the root mean square 1. Second, eigenvalues of the scaled `J W^-1 J'`
//! below `eps^2` are replaced by `eps^2`. Third, this matrix is inverted, and the scaling is undone. The projector `N'` should remove the
//! controlled directions from `tau_0`. In the direction of a singular value `sigma` of the scaled matrix, the fraction
//! `1 - min(1, (sigma/eps)^2)` of `tau_0` remains. The largest of these fractions is the loss.

use super::sizes::{require_rows, require_size};
use crate::dynamics::{AnyArm, Dynamics, Workspace};
use crate::error::{Error, Result};
use crate::kinematics::{Coordinates, jacobian_dot};
use crate::linalg::gain::{AnyGain, Gain};
use crate::linalg::{ClampedInverse, cholesky};
use crate::motion::Motion;
use crate::scalar::Real;
use crate::trace::Sym;

/// The default `eps` of the clamp, equal to the default threshold of task priority.
pub const NULL_SPACE_EPS: f64 = 0.02;

/// The metric in which a joint torque is projected into the null space.
///
/// ```
/// use armlet_core::law::NullProjection;
///
/// assert_eq!(NullProjection::of_name("consistent")?, NullProjection::Consistent);
/// assert_eq!(NullProjection::of_name("static")?, NullProjection::Static);
/// assert!(NullProjection::of_name("dynamic").is_err());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NullProjection {
    /// The metric of the mass matrix. The projected torque does not accelerate the controlled rows.
    Consistent,
    /// The metric of the joint coordinates.
    Static,
}

impl NullProjection {
    /// Return the projection with the name `consistent` or `static`. Errors: `Input` for another name.
    pub fn of_name(name: &str) -> Result<Self> {
        match name {
            "consistent" => Ok(NullProjection::Consistent),
            "static" => Ok(NullProjection::Static),
            _ => Err(Error::input("projection", format!("is unknown: expected consistent or static, got {name}"))),
        }
    }
}

/// A spring and a damper of the joints in the null space of an impedance law, with validated parameters.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// # use armlet_core::motion::Motion;
/// use armlet_core::law::{CartesianImpedanceSpec, Gain, ImpedanceOptions, LawSpec, NullProjection, NullSpaceSpec};
/// # let model = Model::from(Arm::planar(&[0.5, 0.4, 0.3], None, None, None, [0.0, 0.0])?);
/// # let gain = |n: usize, k: f64| Gain::scalar("gain", n, k);
/// # let law = CartesianImpedanceSpec::new(model, Motion::hold(vec![0.7, 0.6])?, gain(2, 200.0)?, gain(2, 20.0)?, "link3", "xy")?;
///
/// let posture = Motion::hold(vec![0.2, 0.6, 0.4])?;
/// let null_space = NullSpaceSpec::new(3, posture, gain(3, 10.0)?, gain(3, 2.0)?, NullProjection::Static)?;
/// let law = LawSpec::from(law.with(ImpedanceOptions { null_space: Some(null_space), ..ImpedanceOptions::default() })?);
/// let terms = law.terms_at(0.0, &[0.3, 0.4, 0.5, 0.0, 0.0, 0.0], &[]);
/// let term = |name: &str| terms.iter().find(|term| term.0 == name).map_or(vec![], |term| term.2.clone());
/// let (j, torque) = (term("J"), term("null_torque"));
/// // With the static projection, J times the projected torque is zero.
/// assert!(torque.iter().any(|x| x.abs() > 0.1));
/// assert!(j.chunks(3).all(|row| row.iter().zip(&torque).map(|(j, x)| j * x).sum::<f64>().abs() < 1e-12));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct NullSpaceSpec {
    /// Desired posture `q_n`, `(n,)`, rad or m. For a fixed posture, use a motion with constant position.
    pub posture: Motion,
    /// Stiffness `K_n`, of size `n`, N m/rad or N/m.
    pub stiffness: Gain,
    /// Damping `D_n`, of size `n`, N m s/rad or N s/m.
    pub damping: Gain,
    /// The metric of the projection.
    pub projection: NullProjection,
}

impl NullSpaceSpec {
    /// Create a null space for an arm of `n` joints. Errors: `WrongShape` for a wrong size.
    pub fn new(n: usize, posture: Motion, stiffness: Gain, damping: Gain, projection: NullProjection) -> Result<Self> {
        require_rows("nullspace.q_d", n, posture.dof())?;
        require_size("nullspace.stiffness", &stiffness, n)?;
        require_size("nullspace.damping", &damping, n)?;
        Ok(NullSpaceSpec { posture, stiffness, damping, projection })
    }
}

/// Null space and compensated coupling of a law in a control loop.
pub(super) struct NullSpace {
    posture: Option<(AnyGain<Sym>, AnyGain<Sym>, NullProjection)>,
    coupling: bool,
    /// The square `eps^2` of the clamp.
    floor: Sym,
    /// The mass matrix `M`, `(n, n)`.
    mass: Vec<Sym>,
    /// The Cholesky factor of the mass matrix `M`, `(n, n)`.
    factor: Vec<Sym>,
    consistent: NullSpaceProjector,
    fixed: NullSpaceProjector,
    rate: Vec<Sym>,
    full: Vec<Sym>,
    /// Memory for a wrench, `(m,)`.
    wrench: Vec<Sym>,
    work: Vec<Sym>,
    /// The torque `tau_0` of spring and damper before the projection, `(n,)`, N m or N.
    tau_0: Vec<Sym>,
    /// The projected torque `N' tau_0`, `(n,)`, N m or N.
    projected: Vec<Sym>,
    /// The added torque `N' tau_0 + C v`, `(n,)`, N m or N.
    pub torque: Vec<Sym>,
}

/// The clamped inverse `L = (J W^-1 J')^-1`, computed from the matrix `J W^-1/2` with the metric `W`.
pub(super) struct NullSpaceProjector {
    inverse: ClampedInverse<Sym>,
    /// The matrix `J W^-1/2`, `(m, n)`, which the caller writes.
    pub spread: Vec<Sym>,
    /// The product `J W^-1 J'`, `(m, m)`.
    square: Vec<Sym>,
    /// The clamped inverse `L`, `(m, m)`.
    l: Vec<Sym>,
    scales: Vec<Sym>,
    /// The loss `1 - min(1, (sigma/eps)^2)` for the smallest singular value `sigma`.
    pub loss: Sym,
}

impl NullSpaceProjector {
    pub fn new(m: usize, n: usize) -> Self {
        let zeros = |k: usize| vec![Sym::zero(); k];
        NullSpaceProjector {
            inverse: ClampedInverse::new(m),
            spread: zeros(m * n),
            square: zeros(m * m),
            l: zeros(m * m),
            scales: zeros(m),
            loss: Sym::zero(),
        }
    }

    /// Compute the clamped inverse `L` from `spread`. `rows` are the indices of the controlled rows in a pose, and `floor` is `eps^2`.
    pub fn prepare(&mut self, rows: &[usize], floor: Sym) {
        let (m, one, zero) = (rows.len(), Sym::splat(1.0), Sym::zero());
        let n = self.spread.len() / m;
        for k in 0..m {
            for l in 0..=k {
                let (a, b) = (&self.spread[k * n..(k + 1) * n], &self.spread[l * n..(l + 1) * n]);
                let entry = a.iter().zip(b).fold(zero, |sum, (&a, &b)| a.mul_add(b, sum));
                (self.square[k * m + l], self.square[l * m + k]) = (entry, entry);
            }
        }
        for turns in [false, true] {
            let of = |&k: &usize| (rows[k] > 2) == turns;
            let count = (0..m).filter(of).count();
            let sum = (0..m).filter(of).fold(zero, |sum, k| sum + self.square[k * m + k]) * Sym::splat(1.0 / count.max(1) as f64);
            // Rows that no joint moves are not scaled.
            let moved = Sym::splat(f64::MIN_POSITIVE).lt(sum);
            let scale = Sym::select(moved, one / Sym::select(moved, sum, one).sqrt(), one);
            (0..m).filter(of).for_each(|k| self.scales[k] = scale);
        }
        for k in 0..m {
            for l in 0..m {
                self.square[k * m + l] = self.square[k * m + l] * (self.scales[k] * self.scales[l]);
            }
        }
        let least = self.inverse.compute(&self.square, floor, &mut self.l);
        for k in 0..m {
            for l in 0..m {
                self.l[k * m + l] = self.l[k * m + l] * (self.scales[k] * self.scales[l]);
            }
        }
        self.loss = one - (least.max(zero) / floor).min(one);
    }

    /// Write the product `L x` to `out`.
    fn apply(&self, x: &[Sym], out: &mut [Sym]) {
        for (row, out) in self.l.chunks_exact(x.len()).zip(out) {
            *out = row.iter().zip(x).fold(Sym::zero(), |sum, (&l, &x)| l.mul_add(x, sum));
        }
    }
}

/// The arguments of an evaluation: the state of the joints, the Jacobian, and the samples of the motions.
pub(super) struct Place<'a> {
    pub trig: &'a [(Sym, Sym)],
    pub q: &'a [Sym],
    pub v: &'a [Sym],
    pub jacobian: &'a [Sym],
    /// Desired acceleration `x_d_ddot` of the rows, `(m,)`, m/s^2 and rad/s^2.
    pub acceleration: &'a [Sym],
    /// Desired posture `q_n`, then its velocity and its acceleration, `(n,)` each; empty without a null space.
    pub posture: &'a [Sym],
    /// Gravity torque `g(q)`, `(n,)`.
    pub gravity: &'a [Sym],
}

impl NullSpace {
    /// Create the terms of a law with `m` rows and `n` joints, with the threshold `eps` of the clamp. `None` if there is neither a null space
    /// nor a compensated coupling.
    pub fn new(null_space: Option<&NullSpaceSpec>, coupling: bool, eps: f64, [m, n]: [usize; 2]) -> Option<Self> {
        if null_space.is_none() && !coupling {
            return None;
        }
        let zeros = |k: usize| vec![Sym::zero(); k];
        let posture = null_space.map(|spec| {
            let stiffness = AnyGain::labelled("null_stiffness", &spec.stiffness);
            let damping = AnyGain::labelled("null_damping", &spec.damping);
            (stiffness, damping, spec.projection)
        });
        Some(NullSpace {
            posture,
            coupling,
            floor: Sym::labelled("null_eps_squared", 0, || Sym::varying(eps * eps)),
            mass: zeros(n * n),
            factor: zeros(n * n),
            consistent: NullSpaceProjector::new(m, n),
            fixed: NullSpaceProjector::new(m, n),
            rate: zeros(m * n),
            full: zeros(6 * n),
            wrench: zeros(m),
            work: zeros(m.max(n)),
            tau_0: zeros(n),
            projected: zeros(n),
            torque: zeros(n),
        })
    }

    /// The projector of the null space; without a null space, the projector of the coupling.
    fn projector(&self) -> &NullSpaceProjector {
        match self.posture {
            Some((_, _, NullProjection::Static)) => &self.fixed,
            Some((_, _, NullProjection::Consistent)) | None => &self.consistent,
        }
    }

    /// Name the results of the last evaluation: `L` of the projector, `(m, m)`, its loss, `tau_0` and `N' tau_0`.
    pub fn name_terms(&self) {
        let (projector, n, m) = (self.projector(), self.tau_0.len(), self.wrench.len());
        Sym::term("L", &[m, m], || projector.l.clone());
        Sym::term("loss", &[], || vec![projector.loss]);
        if self.posture.is_some() {
            Sym::term("tau_0", &[n], || self.tau_0.clone());
            Sym::term("null_torque", &[n], || self.projected.clone());
        }
    }

    /// Write the torque of null space and coupling to `self.torque`. The law adds this torque to `J' F + g`. If the coupling is
    /// compensated, add its wrench to `force`.
    pub fn evaluate(&mut self, arm: &AnyArm<Sym>, ws: &mut Workspace<Sym>, coordinates: &Coordinates, at: &Place, force: &mut [Sym]) {
        let n = at.q.len();
        let consistent = matches!(self.posture, Some((_, _, NullProjection::Consistent)));
        if consistent || self.coupling {
            arm.mass_matrix(ws, at.trig, at.q, &mut self.mass);
            cholesky::factor_into(n, &self.mass, &mut self.factor);
            self.consistent.spread.copy_from_slice(at.jacobian);
            self.consistent.spread.chunks_exact_mut(n).for_each(|row| cholesky::solve_lower(n, &self.factor, row));
            self.consistent.prepare(&coordinates.rows, self.floor);
        }
        self.torque.fill(Sym::zero());
        if self.coupling {
            arm.bias(ws, at.trig, at.q, at.v, &mut self.torque);
            self.torque.iter_mut().zip(at.gravity).for_each(|(torque, &g)| *torque -= g);
            self.couple(arm, ws, coordinates, at, force);
        }
        if self.posture.is_some() {
            self.project(&coordinates.rows, at);
        }
    }

    /// Add the wrench `L (x_d_ddot - J_dot v)` to `force`.
    fn couple(&mut self, arm: &AnyArm<Sym>, ws: &mut Workspace<Sym>, coordinates: &Coordinates, at: &Place, force: &mut [Sym]) {
        let (n, m) = (at.q.len(), force.len());
        if let AnyArm::Tree(tree) = arm {
            jacobian_dot(tree, &mut ws.poses, &mut ws.motion, (at.trig, at.q), at.v, coordinates.frame, &mut self.full);
            coordinates.copy_rows(&self.full, &mut self.rate);
        }
        for k in 0..m {
            let row = &self.rate[k * n..(k + 1) * n];
            self.wrench[k] = row.iter().zip(at.v).fold(at.acceleration[k], |rest, (&j, &v)| j.neg_mul_add(v, rest));
        }
        self.consistent.apply(&self.wrench, &mut self.work[..m]);
        force.iter_mut().zip(&self.work).for_each(|(force, &added)| *force += added);
    }

    /// Compute the projected torque `N' tau_0`, and add it to `self.torque`.
    fn project(&mut self, rows: &[usize], at: &Place) {
        let (n, m) = (at.q.len(), self.wrench.len());
        let Some((stiffness, damping, projection)) = &self.posture else { return };
        for i in 0..n {
            self.work[i] = at.posture[i] - at.q[i];
        }
        stiffness.multiply(&self.work[..n], &mut self.tau_0);
        for i in 0..n {
            self.work[i] = at.posture[n + i] - at.v[i];
        }
        damping.add_to(&self.work[..n], &mut self.tau_0);
        self.work[..n].copy_from_slice(&self.tau_0);
        let projector = if *projection == NullProjection::Static {
            self.fixed.spread.copy_from_slice(at.jacobian);
            self.fixed.prepare(rows, self.floor);
            &self.fixed
        } else {
            cholesky::solve_lower(n, &self.factor, &mut self.work[..n]);
            &self.consistent
        };
        for (row, wrench) in projector.spread.chunks_exact(n).zip(&mut self.wrench) {
            *wrench = row.iter().zip(&self.work).fold(Sym::zero(), |sum, (&a, &b)| a.mul_add(b, sum));
        }
        projector.apply(&self.wrench, &mut self.work[..m]);
        for i in 0..n {
            let rest = (0..m).fold(self.tau_0[i], |rest, k| at.jacobian[k * n + i].neg_mul_add(self.work[k], rest));
            self.projected[i] = rest;
            self.torque[i] += rest;
        }
    }
}
