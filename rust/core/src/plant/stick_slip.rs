//! Stick-slip friction (Karnopp 1985; Olsson et al. 1998). A joint sticks, `v_i = 0`, while the torque that holds it is within its static
//! friction. Otherwise it slides with the friction `h(v, L)`.
//!
//! Let `A` be the mass matrix of the joints or motors, and `b` the sum of all torques except friction. The accelerations `a` and the
//! friction torques `tau_f` solve
//!
//! `A a = b - tau_f`, `a_i = 0` for `i` stuck, `tau_f,i = s_i h(v_i, L_i) + sigma_2 v_i` for `i` sliding to the side `s_i`.
//!
//! For a joint at rest, `|tau_f,i| <= F_i` with the static friction `F_i = F_s + mu |L_i|`. `a_i > 0` requires `tau_f,i = F_i`, and
//! `a_i < 0` requires `tau_f,i = -F_i`. This linear complementarity problem has exactly one solution, because `A^-1` is positive definite.
//! Murty's least-index pivots find it.

use super::friction_curve::{FrictionCurve, LoopCurve};
use crate::linalg::cholesky;
use crate::scalar::{Real, labelled_numbers, sign};
use nalgebra::{DMatrix, DVector};

/// Stick-slip friction of all joints.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::plant::{FrictionCurve, JointFriction, PlantSpec, RigidSpec, StickSlip};
///
/// let curve = FrictionCurve::new(vec![2.0], Some(vec![3.0]), None, None, None)?;
/// let arm = RigidSpec::new(Arm::pendulum(1.0, 0.0)?.into());
/// let spec = PlantSpec::from(arm.with_friction(Some(JointFriction::StickSlip(StickSlip { curve })))?);
/// // At 1 rad/s, the Coulomb friction of 2 N m acts against 5 N m.
/// let (dx, _) = spec.rates_at(&[0.0, 1.0], &[5.0], &[0.0; 6], None);
/// assert!((dx[1] - 3.0).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct StickSlip {
    /// Friction curve `h(v, L)`, without bristles.
    pub curve: FrictionCurve,
}

/// The load of a joint.
#[derive(Clone, Copy, Debug)]
pub(super) enum Load<S> {
    /// The load `L` itself.
    Known(S),
    /// The load is `L = tau - tau_f`. The field is `tau`.
    Driven(S),
}

impl<S> Load<S> {
    fn set(&mut self, number: S) {
        match self {
            Load::Known(load) | Load::Driven(load) => *load = number,
        }
    }
}

/// The largest number of pivots is `PIVOTS` times the number of joints, plus `PIVOTS`.
const PIVOTS: usize = 8;
/// For a joint that has to slip, each limit of the friction torque is reduced by this fraction of the distance between both limits. So
/// rounding errors do not hold the joint.
const SLIPS: f64 = 1e-9;

/// The stick-slip friction of one plant in a control loop.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::plant::{FrictionCurve, JointFriction, PlantSpec, RigidSpec, StickSlip};
///
/// # let curve = FrictionCurve::new(vec![2.0], Some(vec![3.0]), None, None, None)?;
/// # let arm = RigidSpec::new(Arm::pendulum(1.0, 0.0)?.into());
/// # let spec = PlantSpec::from(arm.with_friction(Some(JointFriction::StickSlip(StickSlip { curve })))?);
/// // The static friction of 3 N m holds the joint at rest. A sliding joint has the Coulomb friction of 2 N m.
/// let acceleration = |tau: f64| spec.rates_at(&[0.0, 0.0], &[tau], &[0.0; 6], None).0[1];
/// assert_eq!([2.9, 3.5, -3.5].map(acceleration), [0.0, 1.5, -1.5]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone)]
pub struct LoopStickSlip<S> {
    curve: LoopCurve<S>,
    breakaway: Vec<S>,
    /// The mode of each joint. It is 0 for a stuck joint. For a joint that slides, or is about to slide, it is the direction 1 or -1.
    sides: Vec<i8>,
    /// The same modes as numbers, with which the torques are computed.
    signs: Vec<S>,
    before: Vec<i8>,
    /// The mass matrix `A` of the joints, or of the motors, `(n, n)`, which the plant writes.
    pub(super) matrix: Vec<S>,
    /// The mass matrix with the rows and columns of stuck joints replaced by those of the identity.
    sliding_matrix: Vec<S>,
    factor: Vec<S>,
    /// The sum `b` of all torques except friction, `(n,)`, N m or N, which the plant writes.
    pub(super) drive: Vec<S>,
    pub(super) loads: Vec<Load<S>>,
    torque: Vec<S>,
    /// Memory for accelerations.
    rates: Vec<S>,
    margins: Vec<S>,
}

impl<S: Real> LoopStickSlip<S> {
    /// Create the friction. `drives`: whether the friction acts where the plant's input acts, so that it changes its own load.
    pub(super) fn new(friction: &StickSlip, drives: bool) -> Self {
        let n = friction.curve.n();
        let zeros = |k: usize| vec![S::zero(); k];
        LoopStickSlip {
            curve: LoopCurve::new(&friction.curve),
            breakaway: labelled_numbers("static_friction", &friction.curve.breakaway),
            sides: vec![0; n],
            signs: zeros(n),
            before: vec![0; n],
            matrix: zeros(n * n),
            sliding_matrix: zeros(n * n),
            factor: zeros(n * n),
            drive: zeros(n),
            loads: vec![if drives { Load::Driven(S::zero()) } else { Load::Known(S::zero()) }; n],
            torque: zeros(n),
            rates: zeros(n),
            margins: zeros(n),
        }
    }

    /// Set the mass matrix `A`, the torques `b` and the loads.
    pub(super) fn load(&mut self, matrix: &DMatrix<S>, drive: &DVector<S>, loads: &DVector<S>) {
        self.matrix.copy_from_slice(matrix.as_slice());
        self.drive.copy_from_slice(drive.as_slice());
        self.loads.iter_mut().zip(loads).for_each(|(load, &number)| load.set(number));
    }

    /// The accelerations and the friction torques at the speeds `v`, `(n,)` each.
    pub(super) fn motion(&mut self, v: &DVector<S>) -> (DVector<S>, DVector<S>) {
        let mut a = v.clone();
        self.slide(v.as_slice());
        self.hold(a.as_mut_slice());
        (a, DVector::from_column_slice(&self.torque))
    }

    /// The numbers from which [`LoopStickSlip::settle`] decides: `A`, `b` and the loads, `(n^2 + 2 n,)`.
    pub fn loads(&self) -> Vec<S> {
        let loads = self.loads.iter().map(|load| match *load {
            Load::Known(load) | Load::Driven(load) => load,
        });
        self.matrix.iter().chain(&self.drive).copied().chain(loads).collect()
    }

    /// Set the numbers of [`LoopStickSlip::loads`].
    pub fn set_loads(&mut self, numbers: &[S]) {
        let (n, loads) = (self.drive.len(), self.matrix.len() + self.drive.len());
        self.matrix.copy_from_slice(&numbers[..n * n]);
        self.drive.copy_from_slice(&numbers[n * n..loads]);
        self.loads.iter_mut().zip(&numbers[loads..]).for_each(|(load, &number)| load.set(number));
    }

    /// Friction torques `tau_f` of the last evaluation, `(n,)`.
    pub fn torque(&self) -> &[S] {
        &self.torque
    }

    /// The mode of each joint: 0 is stuck, and 1 or -1 is the direction in which the joint slides.
    pub fn sides(&self) -> &[i8] {
        &self.sides
    }

    /// Set the mode of each joint.
    pub fn follow(&mut self, sides: &[i8]) {
        for (i, &side) in sides.iter().enumerate() {
            self.set(i, side);
        }
    }

    /// Set the modes with which the torques are computed, as numbers 0, 1 or -1.
    pub fn follow_signs(&mut self, signs: &[S]) {
        self.signs.copy_from_slice(signs);
    }

    fn set(&mut self, i: usize, side: i8) {
        (self.sides[i], self.signs[i]) = (side, S::splat(f64::from(side)));
    }

    /// Whether joint `i` slides.
    fn slides(&self, i: usize) -> S::Mask {
        S::zero().lt(self.signs[i].abs())
    }

    /// Whether any joint is stuck.
    pub fn holds(&self) -> bool {
        self.sides.contains(&0)
    }

    /// The friction torque of joint `i` that slides to `side`, from the friction `unloaded + mu |L|` and the torque `viscous`.
    fn sliding(&self, i: usize, side: S, unloaded: S, viscous: S) -> S {
        let ratio = self.curve.load_ratio[i];
        match self.loads[i] {
            Load::Known(load) => side * (ratio * load.abs() + unloaded) + viscous,
            // With `r = tau - s h(v, 0) - sigma_2 v`, the load obeys `L = r - s mu |L|`. So `r` has the sign of `L`.
            Load::Driven(tau) => {
                let rest = tau - (side * unloaded + viscous);
                let against = S::select(rest.lt(S::zero()), -(side * ratio), side * ratio);
                tau - rest / (S::splat(1.0) + against)
            }
        }
    }

    /// The friction torque of joint `i` that slides at the speed `v`.
    fn kinetic(&self, i: usize, v: S) -> S {
        self.sliding(i, self.signs[i], self.curve.unloaded(i, v), self.curve.viscous[i] * v)
    }

    /// The friction torque at which joint `i` starts to slide to `side`, which is 1 or -1. Its sign is the sign of `side`.
    fn limit(&self, i: usize, side: S) -> S {
        self.sliding(i, side, self.breakaway[i], S::zero())
    }

    /// The limits of the friction torque of joint `i` at rest.
    fn limits(&self, i: usize) -> [S; 2] {
        [1.0, -1.0].map(|side| self.limit(i, S::splat(side)))
    }

    /// Compute the friction torques of sliding joints at the speeds `v`. The torque of stuck joints is set to zero.
    pub(super) fn slide(&mut self, v: &[S]) {
        for i in 0..v.len() {
            self.torque[i] = S::select(self.slides(i), self.kinetic(i, v[i]), S::zero());
        }
    }

    /// Compute the accelerations `a` and the torques of stuck joints from the mass matrix `A`, the torques `b` and the torques of sliding
    /// joints.
    pub(super) fn hold(&mut self, a: &mut [S]) {
        let (n, zero) = (a.len(), S::zero());
        for i in 0..n {
            let slides = self.slides(i);
            a[i] = S::select(slides, self.drive[i] - self.torque[i], zero);
            for j in 0..n {
                let alone = if i == j { S::splat(1.0) } else { zero };
                let coupled = S::select(self.slides(j), self.matrix[i * n + j], alone);
                self.sliding_matrix[i * n + j] = S::select(slides, coupled, alone);
            }
        }
        cholesky::factor_into(n, &self.sliding_matrix, &mut self.factor);
        cholesky::solve(n, &self.factor, a);
        for i in 0..n {
            a[i] = S::select(self.slides(i), a[i], zero);
        }
        for i in 0..n {
            let row = &self.matrix[i * n..(i + 1) * n];
            let held = row.iter().zip(&*a).fold(self.drive[i], |held, (&m, &a)| held - m * a);
            self.torque[i] = S::select(self.slides(i), self.torque[i], held);
        }
    }

    /// Return one number per joint, which becomes negative where the joint's mode ends.
    ///
    /// For a stuck joint the number is the distance of the torque from its nearer limit. For a sliding joint it is the speed in the
    /// direction of sliding. Before the call, set `A`, `b` and the loads for the speeds `v`.
    pub fn margins(&mut self, v: &[S]) -> &[S] {
        if self.holds() {
            self.slide(v);
            let mut rates = std::mem::take(&mut self.rates);
            self.hold(&mut rates);
            self.rates = rates;
        }
        for (i, &v) in v.iter().enumerate() {
            let [up, down] = self.limits(i);
            let held = (up - self.torque[i]).min(self.torque[i] - down);
            self.margins[i] = S::select(self.slides(i), self.signs[i] * v, held);
        }
        &self.margins
    }

    /// Stop the joints whose velocity is opposite to their direction of slip. Return whether any velocity changes.
    pub fn arrest(&mut self, v: &mut [S]) -> bool {
        let mut any = false;
        for (i, v) in v.iter_mut().enumerate() {
            let before = v.lane(0);
            *v = self.stop(i, *v);
            any |= v.lane(0) != before;
        }
        self.read_sides();
        any
    }

    /// Stop joint `i` if its velocity `v` is opposite to its direction of slip. Return its velocity. The function has no branch on the
    /// numbers.
    pub fn stop(&mut self, i: usize, v: S) -> S {
        self.signs[i] = S::select((self.signs[i] * v).lt(S::zero()), S::zero(), self.signs[i]);
        // The rounding error of the speed of a stuck joint is removed too.
        S::select(self.slides(i), v, S::zero())
    }

    /// The mode of each joint as a number.
    pub fn signs(&self) -> &[S] {
        &self.signs
    }

    /// Copy the modes from their numbers.
    fn read_sides(&mut self) {
        self.sides.iter_mut().zip(&self.signs).for_each(|(side, sign)| *side = sign.lane(0) as i8);
    }

    /// Determine the modes of the joints at the speeds `v`. Moving joints slide. The modes of joints at rest follow from the
    /// complementarity problem for `A`, `b` and the loads. The joint `leaving` has to slip: its static friction is slightly reduced, so
    /// that rounding errors do not hold it. Return whether any mode changes.
    pub fn settle(&mut self, v: &[S], leaving: Option<usize>) -> bool {
        self.before.copy_from_slice(&self.sides);
        self.begin(v);
        if v.iter().any(|v| sign(*v).lane(0) == 0.0) {
            for _ in 0..Self::most_pivots(v.len()) {
                if self.pivot(v, leaving).lane(0) == 1.0 {
                    break;
                }
            }
        }
        self.read_sides();
        self.sides != self.before
    }

    /// The largest number of pivots for `n` joints.
    pub const fn most_pivots(n: usize) -> usize {
        PIVOTS * (n + 1)
    }

    /// Begin to determine the modes at the speeds `v`: moving joints slide, and joints at rest are stuck.
    pub fn begin(&mut self, v: &[S]) {
        self.signs.iter_mut().zip(v).for_each(|(to, &v)| *to = sign(v));
    }

    /// Change the mode of the first joint at rest whose mode contradicts its torque or its acceleration. Return 1 if there is none, else
    /// 0. The function has no branch on the numbers.
    pub fn pivot(&mut self, v: &[S], leaving: Option<usize>) -> S {
        let (zero, one) = (S::zero(), S::splat(1.0));
        for i in 0..v.len() {
            let sliding = S::select(zero.lt(v[i].abs()), self.kinetic(i, v[i]), self.limit(i, self.signs[i]));
            self.torque[i] = S::select(self.slides(i), sliding, zero);
        }
        let mut a = std::mem::take(&mut self.rates);
        self.hold(&mut a);
        let mut settled = one;
        for (i, &a) in a.iter().enumerate() {
            let (sign, torque, [up, down]) = (self.signs[i], self.torque[i], self.limits(i));
            let leaves = leaving == Some(i);
            let slack = if leaves { S::splat(SLIPS) * (up - down) } else { zero };
            let stuck = S::select((up - slack).lt(torque), one, S::select(torque.lt(down + slack), -one, zero));
            let slides = if leaves { sign } else { S::select((sign * a).lt(zero), zero, sign) };
            // Moving joints keep their modes, and so do the joints after the first one that changes.
            let now = S::select(self.slides(i), slides, stuck);
            let now = S::select(zero.lt(v[i].abs()), sign, S::select(zero.lt(settled), now, sign));
            settled = S::select(zero.lt((now - sign).abs()), zero, settled);
            self.signs[i] = now;
        }
        self.rates = a;
        settled
    }
}
