//! The equations of the planar 2R arm with elastic joints under Cartesian impedance, and their derivatives.
//! `x = [q, v, theta, theta_dot]`; `MONITORED`: then what the law's storage function loses, and its rate.
//!
//! `M a = tau_J + J'F - C v - g`, `theta_ddot = B0^-1 (u - D0 w - tau_J)`, `u = J'(K_m e - D_m J v) + g`: with the plant that
//! the law describes, motors of inertia `B` under the inner loop are motors of inertia `B0`. `w = theta_dot`, or
//! `theta_dot - v` with relative damping; `dE/dt = F.x_dot - theta_dot'D0 w - x_dot'D_m x_dot + (theta_dot - v).u`.

use super::force::Force;
use super::problem::Problem;
use crate::dynamics::Planar2R;
use crate::integrate::{Differentiable, System};
use crate::law::{ElasticImpedanceSpec, LawSpec};
use crate::linalg::{Gain, Pairs};
use crate::scalar::trig::{Angle, rotate};
use crate::scalar::{Real, spread};

/// Size of the plant's state.
pub const STATES: usize = 8;

/// The force in the plane.
#[derive(Clone, Copy, Debug)]
pub struct Push<S>(pub [S; 2]);

pub struct Loop<'a, S, const MONITORED: bool> {
    a: [S; 5],
    l: [S; 2],
    k_j: [S; 2],
    inverse_b0: [S; 2],
    d0: [S; 2],
    /// `B B0^-1`
    ratio: [S; 2],
    relative: S,
    k_m: [S; 2],
    d_m: [S; 2],
    target: [S; 2],
    /// One for all lanes, or one per lane; none. Borrowed, so that nothing of the loop's own needs dropping and all of it can
    /// live in registers.
    forces: &'a [&'a Force],
    anchors: [Angle<S>; 2],
}

/// What slope, torque and derivatives have in common at one state.
struct At<S> {
    /// `a2 c2`, `a2 s2`, `a4 s1`, `a5 s12`.
    half: S,
    h: S,
    a4_s1: S,
    a5_s12: S,
    m11: S,
    m12: S,
    /// `1 / det M`
    inverse: S,
    /// `J`, row by row: the frame is at `(j[2], -j[0])`.
    j: [S; 4],
    x_dot: [S; 2],
    /// `K_m e - D_m J v`
    e: [S; 2],
    /// `v2 (2 v1 + v2)`
    twist: S,
    u: [S; 2],
    spring: [S; 2],
    /// `u - D0 w - tau_J`
    left: [S; 2],
    acceleration: [S; 2],
}

impl<S: Real> At<S> {
    /// `M^-1 n`.
    #[inline(always)]
    fn accelerate(&self, a3: S, [n1, n2]: [S; 2]) -> [S; 2] {
        [self.m12.neg_mul_add(n2, a3 * n1) * self.inverse, self.m12.neg_mul_add(n1, self.m11 * n2) * self.inverse]
    }
}

/// The forces of the lanes from run `first` on: one where they are the same.
pub fn forces<'a>(problem: &'a Problem, first: usize, lanes: usize) -> Vec<&'a Force> {
    let last = problem.runs() - 1;
    let mut forces: Vec<&Force> = (0..lanes).filter_map(|lane| problem.force((first + lane).min(last))).collect();
    if forces.iter().all(|&f| std::ptr::eq(f, forces[0])) {
        forces.truncate(1);
    }
    forces
}

fn law<'a>(problem: &'a Problem, run: usize) -> &'a ElasticImpedanceSpec {
    match problem.law(run) {
        LawSpec::ElasticImpedance(law) => law,
        _ => unreachable!("a problem's laws are of one kind"),
    }
}

impl<'a, S: Real, const MONITORED: bool> Loop<'a, S, MONITORED> {
    /// The loop of the runs from `first` on, and its state at the start.
    pub fn new<const X: usize>(problem: &'a Problem, arm: &Planar2R, first: usize, forces: &'a [&'a Force]) -> (Self, [S; X]) {
        let last = problem.runs() - 1;
        let run = |lane: usize| (first + lane).min(last);
        let law = |lane: usize| law(problem, run(lane));
        let two = |of: &dyn Fn(usize) -> [f64; 2]| -> [S; 2] { std::array::from_fn(|k| S::from_lanes(|lane| of(lane)[k])) };
        let diagonal = |gain: &Gain| [gain.at(0, 0), gain.at(1, 1)];
        let closed = Loop {
            a: spread(&arm.a),
            l: spread(&arm.l),
            k_j: two(&|i| diagonal(&law(i).inner.joint_stiffness)),
            inverse_b0: two(&|i| diagonal(&law(i).inner.reduced_inertia).map(|b| 1.0 / b)),
            d0: two(&|i| diagonal(&law(i).inner.motor_damping)),
            ratio: two(&|i| {
                let (b, b0) = (diagonal(&law(i).inner.motor_inertia), diagonal(&law(i).inner.reduced_inertia));
                [b[0] / b0[0], b[1] / b0[1]]
            }),
            relative: S::from_lanes(|i| f64::from(law(i).inner.relative)),
            k_m: two(&|i| diagonal(&law(i).outer.stiffness)),
            d_m: two(&|i| diagonal(&law(i).outer.damping)),
            target: two(&|i| {
                let mut sample = [0.0; 6];
                law(i).outer.target.sample(0.0, &mut sample);
                [sample[0], sample[1]]
            }),
            forces,
            anchors: [Angle::default(); 2],
        };
        let x = std::array::from_fn(|k| if k < STATES { S::from_lanes(|lane| problem.x0[run(lane) * STATES + k]) } else { S::zero() });
        (closed, x)
    }

    #[inline(always)]
    fn at(&self, u: &Push<S>, x: &[S]) -> At<S> {
        let ((s1, c1), (s2, c2)) = (rotate(&self.anchors[0], x[0]), rotate(&self.anchors[1], x[1]));
        let (s12, c12) = (s1.mul_add(c2, c1 * s2), c2.mul_add(c1, -(s1 * s2)));
        let ([a1, a2, a3, a4, a5], [l1, l2], [fx, fy]) = (self.a, self.l, u.0);
        let (v1, v2) = (x[2], x[3]);
        let half = a2 * c2;
        let (m11, m12, h) = (a1 + (half + half), a3 + half, a2 * s2);
        let g2 = a5 * c12;
        let g1 = a4.mul_add(c1, g2);
        let (j12, j22) = (-(l2 * s12), l2 * c12);
        let (j11, j21) = (l1.neg_mul_add(s1, j12), l1.mul_add(c1, j22));
        let (vx, vy) = (j11.mul_add(v1, j12 * v2), j21.mul_add(v1, j22 * v2));
        let ex = self.d_m[0].neg_mul_add(vx, self.k_m[0] * (self.target[0] - j21));
        let ey = self.d_m[1].neg_mul_add(vy, self.k_m[1] * (self.target[1] + j11));
        let ask = [j11.mul_add(ex, j21.mul_add(ey, g1)), j12.mul_add(ex, j22.mul_add(ey, g2))];
        let spring: [S; 2] = std::array::from_fn(|i| self.k_j[i] * (x[4 + i] - x[i]));
        let left = std::array::from_fn(|i| {
            let w = self.relative.neg_mul_add(x[2 + i], x[6 + i]);
            self.d0[i].neg_mul_add(w, ask[i] - spring[i])
        });
        let twist = v2 * (v1 + v1 + v2);
        let n1 = h.mul_add(twist, j11.mul_add(fx, j21.mul_add(fy, spring[0] - g1)));
        let n2 = (h * v1).neg_mul_add(v1, j12.mul_add(fx, j22.mul_add(fy, spring[1] - g2)));
        let mut at = At {
            half,
            h,
            a4_s1: a4 * s1,
            a5_s12: a5 * s12,
            m11,
            m12,
            inverse: m12.neg_mul_add(m12, m11 * a3).recip(),
            j: [j11, j12, j21, j22],
            x_dot: [vx, vy],
            e: [ex, ey],
            twist,
            u: ask,
            spring,
            left,
            acceleration: [S::zero(); 2],
        };
        at.acceleration = at.accelerate(a3, [n1, n2]);
        at
    }

    #[inline(always)]
    fn slope(&self, at: &At<S>, u: &Push<S>, x: &[S], dx: &mut [S]) {
        for i in 0..2 {
            dx[i] = x[2 + i];
            dx[2 + i] = at.acceleration[i];
            dx[4 + i] = x[6 + i];
            dx[6 + i] = at.left[i] * self.inverse_b0[i];
        }
        if MONITORED {
            let outside = u.0[0].mul_add(at.x_dot[0], u.0[1] * at.x_dot[1]);
            let mut stored = outside;
            for i in 0..2 {
                let w = self.relative.neg_mul_add(x[2 + i], x[6 + i]);
                stored = (x[6 + i] - x[2 + i]).mul_add(at.u[i], stored);
                stored = (self.d0[i] * w).neg_mul_add(x[6 + i], stored);
                stored = (self.d_m[i] * at.x_dot[i]).neg_mul_add(at.x_dot[i], stored);
            }
            (dx[8], dx[9]) = (outside - stored, stored);
        }
    }

    /// The motors' torque.
    #[inline(always)]
    pub fn torque(&mut self, t: f64, x: &[S]) -> [S; 2] {
        let mut u = Push([S::zero(); 2]);
        self.input(t, &mut u);
        self.anchor(x);
        let at = self.at(&u, x);
        std::array::from_fn(|i| self.ratio[i].mul_add(at.left[i], at.spring[i]))
    }
}

impl<S: Real, const MONITORED: bool> System<S> for Loop<'_, S, MONITORED> {
    type Input = Push<S>;

    #[inline(always)]
    fn input(&mut self, t: f64, u: &mut Push<S>) {
        match self.forces {
            [] => {}
            [force] => {
                let w = force.at(t);
                u.0 = [S::splat(w[0]), S::splat(w[1])];
            }
            forces => u.0 = std::array::from_fn(|k| S::from_lanes(|lane| forces[lane].at(t)[k])),
        }
    }

    #[inline(always)]
    fn anchor(&mut self, x: &[S]) {
        for i in 0..2 {
            self.anchors[i].move_to(x[i]);
        }
    }

    #[inline(always)]
    fn rhs(&mut self, u: &Push<S>, x: &[S], dx: &mut [S]) {
        self.slope(&self.at(u, x), u, x, dx);
    }

    #[inline(always)]
    fn pairs(&self) -> Pairs {
        Pairs { joints: 2, count: 2 }
    }
}

/// By hand: duals take three times as long, and most of their rates are zero.
impl<S: Real, const MONITORED: bool> Differentiable<S> for Loop<'_, S, MONITORED> {
    #[inline(always)]
    fn linearise(&mut self, _: f64, u: &Push<S>, x: &[S], dx: &mut [S], j: &mut [S]) {
        let at = self.at(u, x);
        self.slope(&at, u, x, dx);
        let n = x.len();
        let ([_, _, a3, _, _], [fx, fy], [j11, j12, j21, j22], [vx, vy]) = (self.a, u.0, at.j, at.x_dot);
        let ([ex, ey], [a1, a2], (v1, v2)) = (at.e, at.acceleration, (x[2], x[3]));
        let (both, zero) = (v1 + v2, S::zero());
        // Along q1, q2 the columns of J turn: d(j11, j21) = (-j21, j11), (-j22, j12), and d(j12, j22) = (-j22, j12) twice.
        let fold = |x: S, y: S| j12.mul_add(y, -(j22 * x));
        let turn = |x: S, y: S| j11.mul_add(y, -(j21 * x));
        let x_dot_q = [[-vy, -(j22 * both)], [vx, j12 * both]];
        let e_q: [[S; 2]; 2] =
            std::array::from_fn(|row| std::array::from_fn(|k| -self.d_m[row].mul_add(x_dot_q[row][k], self.k_m[row] * at.j[2 * row + k])));
        let along = |k: usize| (j11.mul_add(e_q[0][k], j21 * e_q[1][k]), j12.mul_add(e_q[0][k], j22 * e_q[1][k]));
        let ((u11, u21), (u12, u22), bend) = (along(0), along(1), fold(ex, ey) - at.a5_s12);
        let u_q = [[u11 + turn(ex, ey) - at.a4_s1 - at.a5_s12, u12 + bend], [u21 + bend, u22 + bend]];
        let damped = |k: usize, l: usize| -(self.d_m[0] * at.j[k]).mul_add(at.j[l], self.d_m[1] * at.j[2 + k] * at.j[2 + l]);
        let u_v = [[damped(0, 0), damped(0, 1)], [damped(1, 0), damped(1, 1)]];
        // M da = dn - dM a.
        let push = fold(fx, fy) + at.a5_s12;
        let (h2, h_v1) = (at.h + at.h, at.h * v1);
        let columns = [
            [turn(fx, fy) + at.a4_s1 + at.a5_s12 - self.k_j[0], push],
            [
                at.half.mul_add(at.twist, push) + at.h.mul_add(a1 + a1, at.h * a2),
                (at.half * v1).neg_mul_add(v1, push) - self.k_j[1] + at.h * a1,
            ],
            [h2 * v2, -(h_v1 + h_v1)],
            [h2 * both, zero],
            [self.k_j[0], zero],
            [zero, self.k_j[1]],
        ];
        j.fill(zero);
        for (k, column) in columns.into_iter().enumerate() {
            let a = at.accelerate(a3, column);
            (j[2 * n + k], j[3 * n + k]) = (a[0], a[1]);
        }
        for i in 0..2 {
            (j[i * n + 2 + i], j[(4 + i) * n + 6 + i]) = (S::splat(1.0), S::splat(1.0));
            let (row, inverse) = (&mut j[(6 + i) * n..(7 + i) * n], self.inverse_b0[i]);
            for k in 0..2 {
                (row[k], row[2 + k]) = (u_q[i][k], u_v[i][k]);
            }
            row[i] += self.k_j[i];
            row[2 + i] = self.d0[i].mul_add(self.relative, row[2 + i]);
            (row[4 + i], row[6 + i]) = (-self.k_j[i], -self.d0[i]);
            for entry in row {
                *entry *= inverse;
            }
        }
        if MONITORED {
            for k in 0..2 {
                let (slip, w) = ([x[6] - v1, x[7] - v2], x[6 + k]);
                let lost = |rate: [S; 2], u: [S; 2]| {
                    let lost = (self.d_m[0] * vx).mul_add(rate[0], self.d_m[1] * vy * rate[1]);
                    slip[0].mul_add(u[0], slip[1].mul_add(u[1], -(lost + lost)))
                };
                let outside = |rate: [S; 2]| fx.mul_add(rate[0], fy * rate[1]);
                let (rate_q, rate_v) = ([x_dot_q[0][k], x_dot_q[1][k]], [at.j[k], at.j[2 + k]]);
                let by_q = lost(rate_q, [u_q[0][k], u_q[1][k]]);
                let by_v = (self.d0[k] * self.relative).mul_add(w, lost(rate_v, [u_v[0][k], u_v[1][k]]) - at.u[k]);
                let by_w = self.d0[k].neg_mul_add(self.relative.neg_mul_add(x[2 + k], w + w), at.u[k]);
                (j[8 * n + k], j[9 * n + k]) = (-by_q, by_q + outside(rate_q));
                (j[8 * n + 2 + k], j[9 * n + 2 + k]) = (-by_v, by_v + outside(rate_v));
                (j[8 * n + 6 + k], j[9 * n + 6 + k]) = (-by_w, by_w);
            }
        }
    }

    /// A force in steps does not move between its jumps, nor does the target.
    fn time_derivative(&mut self, _: f64, _: &Push<S>, _: &[S], dft: &mut [S]) {
        dft.fill(S::zero());
    }

    #[inline(always)]
    fn autonomous(&self) -> bool {
        true
    }
}
