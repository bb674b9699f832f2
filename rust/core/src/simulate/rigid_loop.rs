//! A rigid arm under a law: `x = [q, v, z, quadratures]`,
//!
//! `q' = v`, `v' = M^-1 (tau - C v - g)`, `z' = ` the law's rate, and, where the run is monitored, the two
//! integrals that the identities need: the law's dissipation `s' Kd s` and the power `tau' v` put in.
//! Not `MONITORED` is the plain loop: without these, and without a limit on `tau`.
//! `HELD`: `tau` and `z'` are those of the last sample, as a real controller holds them.

use super::reference::{Desired, Reference};
use crate::dynamics::Dynamics;
use crate::integrate::{Buffer, System};
use crate::law::Law;
use crate::scalar::Real;
use crate::scalar::trig::{Angle, is_small, reach, rotate, rotate_near};

/// Where a state stands: at the anchor, near it, or nobody knows.
const ANCHOR: u8 = 0;
const NEARBY: u8 = 1;
const ANYWHERE: u8 = 2;

/// Where the vectors of a loop live: arrays for closed-form arms, the heap for any other.
pub trait Shape<S: Real> {
    /// `(n,)`
    type Joints: Buffer<S>;
    /// `[q_d, v_d, a_d]`, `(3 n,)`
    type Desired: Desired<S>;
    /// `(p,)`
    type LawState: Buffer<S>;
    /// `x = [q, v, z, quadratures]`
    type State: Buffer<S>;
    type Trig: AsRef<[(S, S)]> + AsMut<[(S, S)]>;
    type Anchors: AsRef<[Angle<S>]> + AsMut<[Angle<S>]>;
}

pub struct RigidLoop<'a, 'm, S: Real, D: Dynamics<S>, L, Q: Shape<S>, const MONITORED: bool, const HELD: bool> {
    arm: D,
    workspace: D::Workspace,
    law: L,
    /// Borrowed, so that nothing of the loop's own needs dropping and all of it can live in registers.
    reference: &'a mut Reference<'m, S>,
    /// Largest |tau| per joint, where the input saturates.
    tau_max: Option<&'a [f64]>,
    anchors: Q::Anchors,
    trig: Q::Trig,
    /// Square of the largest angle turned since the last anchor, and of its reach.
    turned: S,
    /// The plant's input as of the last evaluation.
    pub tau: Q::Joints,
    dz: Q::LawState,
    desired: Q::Desired,
}

impl<'a, 'm, S, D, L, Q, const MONITORED: bool, const HELD: bool> RigidLoop<'a, 'm, S, D, L, Q, MONITORED, HELD>
where
    S: Real,
    D: Dynamics<S>,
    L: Law<S>,
    Q: Shape<S>,
{
    #[inline(always)]
    pub fn new(
        arm: D,
        law: L,
        reference: &'a mut Reference<'m, S>,
        tau_max: Option<&'a [f64]>,
        (joints, law_state, desired): (Q::Joints, Q::LawState, Q::Desired),
        (trig, anchors): (Q::Trig, Q::Anchors),
    ) -> Self {
        let workspace = arm.workspace();
        RigidLoop { arm, workspace, law, reference, tau_max, anchors, trig, turned: S::zero(), tau: joints, dz: law_state, desired }
    }

    /// Sine and cosine of the joints.
    #[inline(always)]
    fn turn<const FROM: u8>(&mut self, x: &[S]) {
        let n = self.tau.as_ref().len();
        let (anchors, trig) = (self.anchors.as_ref(), self.trig.as_mut());
        for i in 0..n {
            if !self.arm.is_angle(i) {
                continue;
            }
            if FROM == ANCHOR {
                trig[i] = (anchors[i].sin, anchors[i].cos);
                continue;
            }
            let (near, square) = rotate_near(&anchors[i], x[i]);
            self.turned = self.turned.max(square);
            trig[i] = if FROM == NEARBY { near } else { rotate(&anchors[i], x[i]) };
        }
    }

    #[inline(always)]
    fn slope<const FROM: u8>(&mut self, u: &Q::Desired, x: &[S], dx: &mut [S]) {
        let n = self.tau.as_ref().len();
        self.turn::<FROM>(x);
        if !HELD {
            self.control(u.lanes(self.reference).as_ref(), x);
        }
        let (q, v) = (&x[..n], &x[n..2 * n]);
        for i in 0..n {
            dx[i] = v[i];
        }
        self.arm.forward_dynamics(&mut self.workspace, self.trig.as_ref(), q, v, self.tau.as_ref(), &mut dx[n..2 * n]);
        let dz = self.dz.as_ref();
        for i in 0..dz.len() {
            dx[2 * n + i] = dz[i];
        }
        if MONITORED {
            let k = 2 * n + dz.len();
            dx[k] = self.law.dissipation();
            let tau = self.tau.as_ref();
            let mut power = tau[0] * v[0];
            for i in 1..n {
                power = tau[i].mul_add(v[i], power);
            }
            dx[k + 1] = power;
        }
    }

    /// The law at the current (sin, cos): `self.tau` and `self.dz`.
    #[inline(always)]
    fn control(&mut self, desired: &[S], x: &[S]) {
        let n = self.tau.as_ref().len();
        let p = self.dz.as_ref().len();
        self.law.evaluate(desired, self.trig.as_ref(), &x[..2 * n], &x[2 * n..2 * n + p], self.tau.as_mut(), self.dz.as_mut());
        if let (true, Some(limit)) = (MONITORED, self.tau_max) {
            let tau = self.tau.as_mut();
            for i in 0..n {
                tau[i] = tau[i].clamped(S::splat(-limit[i]), S::splat(limit[i]));
            }
        }
    }

    /// Evaluate the law at state `x` and time `t`, into `self.tau`: the held input of a sampled loop, or the
    /// input to record.
    #[inline(always)]
    pub fn observe(&mut self, t: f64, x: &[S]) {
        let mut desired = self.desired.clone();
        desired.sample(self.reference, t);
        self.anchor(x);
        self.turn::<ANCHOR>(x);
        self.control(desired.lanes(self.reference).as_ref(), x);
    }
}

impl<S, D, L, Q, const MONITORED: bool, const HELD: bool> System<S> for RigidLoop<'_, '_, S, D, L, Q, MONITORED, HELD>
where
    S: Real,
    D: Dynamics<S>,
    L: Law<S>,
    Q: Shape<S>,
{
    type Input = Q::Desired;

    #[inline(always)]
    fn input(&mut self, t: f64, u: &mut Q::Desired) {
        if HELD {
            return;
        }
        u.sample(self.reference, t);
    }

    #[inline(always)]
    fn sample(&mut self, t: f64, x: &[S]) {
        if HELD {
            self.observe(t, x);
        }
    }

    #[inline(always)]
    fn anchor(&mut self, x: &[S]) {
        let n = self.tau.as_ref().len();
        // An anchor that strayed may have the sine of a state it was not for.
        let kept = !self.strayed();
        self.turned = S::zero();
        let anchors = self.anchors.as_mut();
        for i in 0..n {
            if self.arm.is_angle(i) {
                if kept { anchors[i].move_to(x[i]) } else { anchors[i] = Angle::new(x[i]) }
            }
        }
    }

    #[inline(always)]
    fn anchor_near(&mut self, x: &[S]) {
        let n = self.tau.as_ref().len();
        self.turned = S::zero();
        let anchors = self.anchors.as_mut();
        for i in 0..n {
            if self.arm.is_angle(i) {
                anchors[i].move_near(x[i]);
                let reach = reach(x[i]);
                self.turned = self.turned.max(reach * reach);
            }
        }
    }

    #[inline(always)]
    fn rhs(&mut self, u: &Q::Desired, x: &[S], dx: &mut [S]) {
        self.slope::<ANYWHERE>(u, x, dx);
    }

    #[inline(always)]
    fn rhs_at_anchor(&mut self, u: &Q::Desired, x: &[S], dx: &mut [S]) {
        self.slope::<ANCHOR>(u, x, dx);
    }

    #[inline(always)]
    fn rhs_near(&mut self, u: &Q::Desired, x: &[S], dx: &mut [S]) {
        self.slope::<NEARBY>(u, x, dx);
    }

    #[inline(always)]
    fn strayed(&self) -> bool {
        !S::all(is_small(self.turned))
    }
}
