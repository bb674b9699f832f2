//! The planar 2R arm with elastic joints under Cartesian impedance, monomorphised through: dynamics, law, gains and method
//! inline into one kernel, [`Loop`]. For a fixed target, diagonal gains and a force in steps in the plane.

use super::adaptive_steps;
use super::elastic_2r_loop::{Loop, Push, STATES, forces};
use super::fixed_steps::{self, Record};
use super::force::Force;
use super::problem::{Division, Ended, Method, Problem};
use super::sink::{Records, Sink, record_apart};
use super::stop::Stop;
use crate::dynamics::Planar2R;
use crate::integrate::{Adaptive, Dop853, Rk4, Rodas4, Tolerance};
use crate::law::LawSpec;
use crate::scalar::{Real, Task, run_scalar};

/// Size of the state with the monitors' quadratures.
const MONITORED: usize = STATES + 2;

/// The runs `first .. first + LANES` of a problem (the last one repeated to fill the lanes), by fixed steps.
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
        match self.division {
            Division::Fixed(_) => run_scalar(self),
            Division::Adaptive(_) => run_scalar(AdaptiveElastic2R(self)),
        }
    }
}

/// The run `first` of a problem by an adaptive method.
pub struct AdaptiveElastic2R<'a>(pub Elastic2R<'a>);

impl Problem<'_> {
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
        let fits = o.sampling.is_none()
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

impl<S: Real, const X: usize, const M: bool> Record<Loop<'_, S, M>, [S; X]> for Records<'_> {
    #[inline(always)]
    fn record(&mut self, i: usize, closed: &mut Loop<S, M>, x: &[S; X]) {
        let t = self.schedule.records[i].t;
        let tau = closed.torque(t, x);
        record_apart(self.sink, i, t, *x, tau);
    }
}

impl Task for Elastic2R<'_> {
    type Output = Ended;

    #[inline(always)]
    fn run<S: Real>(self) -> Ended {
        if self.problem.options.monitors { self.fixed::<S, MONITORED, true>() } else { self.fixed::<S, STATES, false>() }
    }
}

impl Task for AdaptiveElastic2R<'_> {
    type Output = Ended;

    #[inline(always)]
    fn run<S: Real>(self) -> Ended {
        let o = &self.0.problem.options;
        let tolerance = Tolerance { rtol: o.rtol, atol: o.atol, controlled: STATES };
        match (o.method, o.monitors) {
            (Method::Rodas4, false) => self.0.rodas4::<S, STATES, { STATES * STATES }, false>(tolerance),
            (Method::Rodas4, true) => self.0.rodas4::<S, MONITORED, { MONITORED * MONITORED }, true>(tolerance),
            (_, false) => self.0.dop853::<S, STATES, false>(tolerance),
            (_, true) => self.0.dop853::<S, MONITORED, true>(tolerance),
        }
    }
}

impl<'a> Elastic2R<'a> {
    #[inline(always)]
    fn fixed<S: Real, const X: usize, const M: bool>(self) -> Ended {
        let Division::Fixed(fixed) = self.division else { unreachable!("a method of fixed steps divides time beforehand") };
        let forces = forces(self.problem, self.first, S::LANES);
        let (mut closed, x) = Loop::<S, M>::new::<X>(self.problem, &self.arm, self.first, &forces);
        let mut method = Rk4::new(x, Push([S::zero(); 2]));
        let mut records = Records { schedule: &fixed.schedule, sink: self.sink };
        Ended::Fixed(fixed_steps::run::<S, _, _, _>(&mut closed, &mut method, x, &fixed.schedule, 0, self.stop, &mut records))
    }

    #[inline(always)]
    fn dop853<S: Real, const X: usize, const M: bool>(self, tolerance: Tolerance) -> Ended {
        self.adaptive::<S, X, M, _>(|x| Dop853::new(tolerance, x, Push([S::zero(); 2])))
    }

    #[inline(always)]
    fn rodas4<S: Real, const X: usize, const XX: usize, const M: bool>(self, tolerance: Tolerance) -> Ended {
        self.adaptive::<S, X, M, _>(|x| Rodas4::new(tolerance, x, [S::zero(); XX], [0usize; X], Push([S::zero(); 2])))
    }

    #[inline(always)]
    fn adaptive<S: Real, const X: usize, const M: bool, A>(self, method: impl FnOnce([S; X]) -> A) -> Ended
    where
        A: for<'b> Adaptive<S, Loop<'b, S, M>, [S; X]>,
    {
        let Division::Adaptive(segments) = self.division else { unreachable!("an adaptive method divides time itself") };
        let forces = forces(self.problem, self.first, 1);
        let (mut closed, x) = Loop::<S, M>::new::<X>(self.problem, &self.arm, self.first, &forces);
        let (mut method, sink, mut i) = (method(x), self.sink, 0);
        let record = |t: f64, closed: &mut Loop<S, M>, x: &[S; X]| {
            let tau = closed.torque(t, x);
            record_apart(sink, i, t, *x, tau);
            i += 1;
        };
        Ended::Adaptive(adaptive_steps::run(&mut closed, &mut method, segments, self.stop, record))
    }
}
