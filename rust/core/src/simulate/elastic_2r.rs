//! The planar 2R arm with elastic joints under Cartesian impedance, monomorphised through: dynamics, law, gains and method
//! inline into one kernel. `x = [q, v, theta, theta_dot]`; a fixed target, diagonal gains, a force in steps in the plane.
//!
//! `M a = tau_J + J'F - C v - g`, `theta_ddot = B0^-1 (u - D0 w - tau_J)`, `u = J'(K_m e - D_m J v) + g`: with the plant that
//! the law describes, motors of inertia `B` under the inner loop are motors of inertia `B0`.

use super::adaptive_steps;
use super::fixed_steps::{self, Record};
use super::force::Force;
use super::planar_pr::Sink;
use super::problem::{Division, Ended, Method, Problem};
use super::schedule::Schedule;
use super::stop::Stop;
use crate::dynamics::Planar2R;
use crate::integrate::{Dop853, DualSystem, Linearised, Rk4, Rodas4, System, Tolerance};
use crate::law::{ElasticImpedanceSpec, LawSpec};
use crate::linalg::Gain;
use crate::scalar::trig::{Angle, rotate};
use crate::scalar::{Duals, Real, Task, run_lanes, run_scalar};

const STATES: usize = 8;

/// The runs `first .. first + LANES` of a problem (the last one repeated to fill the lanes), by an explicit method.
pub struct Elastic2R<'a> {
    pub problem: &'a Problem<'a>,
    pub arm: Planar2R,
    pub division: &'a Division,
    pub first: usize,
    pub stop: &'a dyn Stop,
    pub sink: &'a mut dyn Sink,
}

impl Elastic2R<'_> {
    /// Run one run by whatever the method needs.
    pub fn run_single(self) -> Ended {
        if self.problem.options.method.is_implicit() { run_lanes(ImplicitElastic2R(self)) } else { run_scalar(self) }
    }
}

/// The run `first` of a problem by an implicit method: on one number, with its derivatives in the lanes of the task's.
pub struct ImplicitElastic2R<'a>(pub Elastic2R<'a>);

impl Problem<'_> {
    fn elastic(&self, run: usize) -> &ElasticImpedanceSpec {
        match self.law(run) {
            LawSpec::ElasticImpedance(law) => law,
            _ => unreachable!("a problem's laws are of one kind"),
        }
    }

    /// The closed form of the arm, where these loops can run it all.
    pub fn elastic_2r(&self) -> Option<Planar2R> {
        let o = &self.options;
        let LawSpec::ElasticImpedance(first) = self.laws[0] else { return None };
        let coordinates = &first.outer.coordinates;
        let frame = coordinates.frame;
        let suits = |law: &LawSpec| match law {
            LawSpec::ElasticImpedance(law) => {
                let gains = [&law.outer.stiffness, &law.outer.damping, &law.inner.joint_stiffness, &law.inner.motor_damping];
                law.outer.coordinates == *coordinates
                    && law.outer.model == first.outer.model
                    && matches!(law.outer.target, crate::motion::Motion::Hold(_))
                    && gains.iter().chain(&[&law.inner.motor_inertia, &law.inner.reduced_inertia]).all(|gain| gain.is_diagonal())
            }
            _ => false,
        };
        let flat = |force: &Force| match force {
            Force::Steps { values, .. } => values.iter().all(|w| w[2..].iter().all(|&x| x == 0.0)),
            Force::Signal(_) => false,
        };
        let runs = self.plants.len().max(self.laws.len());
        let fits = !o.monitors
            && o.sampling.is_none()
            && o.tau_max.is_none()
            && matches!(o.method, Method::Rk4 | Method::Dop853 | Method::Rodas4)
            && coordinates.rows == [0, 1]
            && self.force_frame().is_none_or(|at| at == frame)
            && self.forces.iter().all(|force| flat(force))
            && self.laws.iter().all(|law| suits(law))
            && self.plants.iter().all(|plant| plant.is_free())
            && (0..runs).all(|run| self.law(run).has_storage(self.plant(run)));
        if fits { Planar2R::of(&first.outer.model, frame) } else { None }
    }
}

/// The force in the plane.
#[derive(Clone, Copy, Debug)]
pub struct Push<S>([S; 2]);

pub struct Loop<'a, S> {
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
    /// The motors' torque as of the last evaluation.
    tau: [S; 2],
}

/// The forces of the lanes from run `first` on: one where they are the same.
fn forces<'a>(problem: &'a Problem, first: usize, lanes: usize) -> Vec<&'a Force> {
    let last = problem.runs() - 1;
    let mut forces: Vec<&Force> = (0..lanes).filter_map(|lane| problem.force((first + lane).min(last))).collect();
    if forces.iter().all(|&f| std::ptr::eq(f, forces[0])) {
        forces.truncate(1);
    }
    forces
}

impl<'a, S: Real> Loop<'a, S> {
    fn new(problem: &'a Problem, arm: &Planar2R, first: usize, forces: &'a [&'a Force]) -> (Self, [S; STATES]) {
        let last = problem.runs() - 1;
        let run = |lane: usize| (first + lane).min(last);
        let law = |lane: usize| problem.elastic(run(lane));
        let two = |of: &dyn Fn(usize) -> [f64; 2]| -> [S; 2] { std::array::from_fn(|k| S::from_lanes(|lane| of(lane)[k])) };
        let diagonal = |gain: &Gain| [gain.at(0, 0), gain.at(1, 1)];
        let closed = Loop {
            a: arm.a.map(S::splat),
            l: arm.l.map(S::splat),
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
            tau: [S::zero(); 2],
        };
        let x = std::array::from_fn(|k| S::from_lanes(|lane| problem.x0[run(lane) * STATES + k]));
        (closed, x)
    }
}

impl<S: Real> System<S> for Loop<'_, S> {
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
        // The frame is at (j21, -j11).
        let (vx, vy) = (j11.mul_add(v1, j12 * v2), j21.mul_add(v1, j22 * v2));
        let ex = self.d_m[0].neg_mul_add(vx, self.k_m[0] * (self.target[0] - j21));
        let ey = self.d_m[1].neg_mul_add(vy, self.k_m[1] * (self.target[1] + j11));
        let ask = [j11.mul_add(ex, j21.mul_add(ey, g1)), j12.mul_add(ex, j22.mul_add(ey, g2))];
        let spring = [self.k_j[0] * (x[4] - x[0]), self.k_j[1] * (x[5] - x[1])];
        for i in 0..2 {
            let w = self.relative.neg_mul_add(x[2 + i], x[6 + i]);
            let left = self.d0[i].neg_mul_add(w, ask[i] - spring[i]);
            dx[i] = x[2 + i];
            dx[4 + i] = x[6 + i];
            dx[6 + i] = left * self.inverse_b0[i];
            self.tau[i] = self.ratio[i].mul_add(left, spring[i]);
        }
        let n1 = h.mul_add(v2 * (v1 + v1 + v2), j11.mul_add(fx, j21.mul_add(fy, spring[0] - g1)));
        let n2 = (h * v1).neg_mul_add(v1, j12.mul_add(fx, j22.mul_add(fy, spring[1] - g2)));
        let inverse = m12.neg_mul_add(m12, m11 * a3).recip();
        dx[2] = m12.neg_mul_add(n2, a3 * n1) * inverse;
        dx[3] = m12.neg_mul_add(n1, m11 * n2) * inverse;
    }
}

impl<V: Real> DualSystem<V> for Loop<'_, Duals<V>> {
    /// A force in steps does not move between its jumps.
    #[inline(always)]
    fn moving_input(&mut self, t: f64, u: &mut Push<Duals<V>>) {
        self.input(t, u);
    }
    #[inline(always)]
    fn autonomous(&self) -> bool {
        true
    }
}

/// A loop whose motor torque can be recorded.
trait Torque<S> {
    fn torque(&mut self, t: f64, x: &[S; STATES]) -> [S; 2];
}

impl<S: Real> Torque<S> for Loop<'_, S> {
    #[inline(always)]
    fn torque(&mut self, t: f64, x: &[S; STATES]) -> [S; 2] {
        let (mut u, mut dx) = (Push([S::zero(); 2]), [S::zero(); STATES]);
        self.input(t, &mut u);
        self.anchor(x);
        self.rhs(&u, x, &mut dx);
        self.tau
    }
}

impl<'a, V: Real> Torque<V::One> for Twins<'a, V> {
    #[inline(always)]
    fn torque(&mut self, t: f64, x: &[V::One; STATES]) -> [V::One; 2] {
        self.system.torque(t, x)
    }
}

type Twins<'a, V> = Linearised<Loop<'a, <V as Real>::One>, Loop<'a, Duals<V>>, V, [Duals<V>; STATES], Push<Duals<V>>>;

/// Recording in a function of its own, on a copy: the loop's state keeps its registers.
#[inline(never)]
fn record_apart<S: Real>(sink: &mut dyn Sink, i: usize, t: f64, x: [S; STATES], tau: [S; 2]) {
    for lane in 0..S::LANES {
        sink.record(i, lane, t, &x.map(|x| x.lane(lane)), &tau.map(|tau| tau.lane(lane)));
    }
}

struct Records<'a> {
    schedule: &'a Schedule,
    sink: &'a mut dyn Sink,
}

impl<S: Real, F: Torque<S>> Record<F, [S; STATES]> for Records<'_> {
    #[inline(always)]
    fn record(&mut self, i: usize, closed: &mut F, x: &[S; STATES]) {
        let t = self.schedule.records[i].t;
        let tau = closed.torque(t, x);
        record_apart(self.sink, i, t, *x, tau);
    }
}

impl Task for Elastic2R<'_> {
    type Output = Ended;

    #[inline(always)]
    fn run<S: Real>(self) -> Ended {
        let forces = forces(self.problem, self.first, S::LANES);
        let (mut closed, x) = Loop::<S>::new(self.problem, &self.arm, self.first, &forces);
        let u = Push([S::zero(); 2]);
        match self.division {
            Division::Fixed(fixed) => {
                let mut method = Rk4::new(x, u);
                let mut records = Records { schedule: &fixed.schedule, sink: self.sink };
                Ended::Fixed(fixed_steps::run::<S, _, _, _>(&mut closed, &mut method, x, &fixed.schedule, 0, self.stop, &mut records))
            }
            Division::Adaptive(segments) => {
                let o = &self.problem.options;
                let mut method = Dop853::new(Tolerance { rtol: o.rtol, atol: o.atol, controlled: STATES }, x, u);
                let mut i = 0;
                Ended::Adaptive(adaptive_steps::run(
                    &mut closed,
                    &mut method,
                    segments,
                    self.stop,
                    |t, closed: &mut Loop<S>, x: &[S; STATES]| {
                        let tau = closed.torque(t, x);
                        record_apart(self.sink, i, t, *x, tau);
                        i += 1;
                    },
                ))
            }
        }
    }
}

impl Task for ImplicitElastic2R<'_> {
    type Output = Ended;

    #[inline(always)]
    fn run<V: Real>(self) -> Ended {
        let Elastic2R { problem, arm, division, first, stop, sink } = self.0;
        let Division::Adaptive(segments) = division else { unreachable!("an adaptive method divides time itself") };
        let forces = forces(problem, first, 1);
        let (closed, x) = Loop::<V::One>::new(problem, &arm, first, &forces);
        let (twin, moving) = Loop::<Duals<V>>::new(problem, &arm, first, &forces);
        let mut twins: Twins<V> = Linearised::new(closed, twin, moving, Push([Duals::default(); 2]));
        let zero = V::One::zero();
        let tolerance = Tolerance { rtol: problem.options.rtol, atol: problem.options.atol, controlled: STATES };
        let mut method = Rodas4::new(tolerance, x, [zero; STATES * STATES], [0usize; STATES], Push([zero; 2]));
        let mut i = 0;
        Ended::Adaptive(adaptive_steps::run(&mut twins, &mut method, segments, stop, |t, closed: &mut Twins<V>, x: &[V::One; STATES]| {
            let tau = closed.torque(t, x);
            record_apart(sink, i, t, *x, tau);
            i += 1;
        }))
    }
}
