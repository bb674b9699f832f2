//! The PR arm's loops, monomorphised through: dynamics, law, gains and method inline into one kernel.

use super::adaptive_steps::{self, Outcome, Segments};
use super::fixed_steps::{self, Faults, Record};
use super::problem::{Fixed, Options, Problem};
use super::reference::{Desired, Reference, Shared};
use super::rigid_loop::{RigidLoop, Shape};
use super::sink::{Records, Sink, record_apart};
use super::stop::Stop;
use crate::dynamics::{Model, PlanarPr};
use crate::integrate::{Dop853, Rk4, Tolerance};
use crate::law::{Adaptation, Adaptive, AdaptiveSpec, ComputedTorque, ComputedTorqueSpec, Law, LawSpec};
use crate::linalg::gain::{Diagonal, Full, Gain};
use crate::motion::Motion;
use crate::scalar::trig::Angle;
use crate::scalar::{Real, Task};

/// The runs `first .. first + LANES` of a problem (the last one repeated to fill the lanes).
pub struct Group<'a, T> {
    pub problem: &'a Problem<'a>,
    /// How time is divided; its type decides which methods a group can run.
    pub division: &'a T,
    /// In place of the laws' own, where all runs share one sampled in advance.
    pub tabulated: Option<&'a Motion>,
    pub first: usize,
    pub stop: &'a dyn Stop,
    pub sink: &'a mut dyn Sink,
}

/// A way of dividing time, which runs a closed loop from `x`.
pub trait Drive {
    type Ended;
    fn drive<S, L, U, const Z: usize, const X: usize, const MONITORED: bool, const HELD: bool>(
        &self,
        closed: PrLoop<S, L, U, Z, X, MONITORED, HELD>,
        x: [S; X],
        desired: U,
        options: &Options,
        stop: &dyn Stop,
        sink: &mut dyn Sink,
    ) -> Self::Ended
    where
        S: Real,
        L: Law<S>,
        U: Desired<S>;
}

type PrLoop<'a, 'm, S, L, U, const Z: usize, const X: usize, const MONITORED: bool, const HELD: bool> =
    RigidLoop<'a, 'm, S, PlanarPr<S>, L, Arrays<U, Z, X>, MONITORED, HELD>;

/// Vectors as arrays: `Z` states of the law, `X` of the loop, the desired motion as `U`.
pub struct Arrays<U, const Z: usize, const X: usize>(std::marker::PhantomData<U>);

impl<S: Real, U: Desired<S>, const Z: usize, const X: usize> Shape<S> for Arrays<U, Z, X> {
    type Joints = [S; 2];
    type Desired = U;
    type LawState = [S; Z];
    type State = [S; X];
    type Trig = [(S, S); 2];
    type Anchors = [Angle<S>; 2];
}

impl<T: Drive> Task for Group<'_, T> {
    type Output = T::Ended;

    #[inline(always)]
    fn run<S: Real>(self) -> T::Ended {
        let problem = self.problem;
        let last = problem.runs() - 1;
        let run = |lane: usize| (self.first + lane).min(last);
        match problem.law(0) {
            LawSpec::Adaptive(_) => {
                let spec = |lane: usize| -> &AdaptiveSpec {
                    match problem.law(run(lane)) {
                        LawSpec::Adaptive(law) => law,
                        _ => unreachable!("a problem's laws are of one kind"),
                    }
                };
                let diagonal = (0..S::LANES).all(|i| {
                    let law = spec(i);
                    law.lambda.is_diagonal() && law.kd.is_diagonal() && euclidean(law).is_diagonal()
                });
                let reference = self.reference::<S>();
                let plain = problem.options.sampling.is_none() && problem.options.tau_max.is_none() && !problem.options.monitors;
                if diagonal && plain && reference.is_shared() {
                    let law = Adaptive::new(
                        arm(|i| closed_form(problem.plant(run(i)).model())),
                        Diagonal(diagonal_of::<S, 2>(|i| &spec(i).lambda)),
                        Diagonal(diagonal_of::<S, 2>(|i| &spec(i).kd)),
                        Diagonal(diagonal_of::<S, 3>(|i| euclidean(spec(i)))),
                        [S::zero(); 2],
                        [S::zero(); 3],
                    );
                    self.close::<S, _, _, 3, 7, false, false>(law, reference, Shared::<6>::default())
                } else {
                    let law = Adaptive::new(
                        arm(|i| closed_form(problem.plant(run(i)).model())),
                        Full(full_of::<S, 4>(2, |i| &spec(i).lambda)),
                        Full(full_of::<S, 4>(2, |i| &spec(i).kd)),
                        Full(full_of::<S, 9>(3, |i| euclidean(spec(i)))),
                        [S::zero(); 2],
                        [S::zero(); 3],
                    );
                    self.close_any::<S, _, 3, 9>(law, reference)
                }
            }
            LawSpec::ComputedTorque(_) => {
                let spec = |lane: usize| -> &ComputedTorqueSpec {
                    match problem.law(run(lane)) {
                        LawSpec::ComputedTorque(law) => law,
                        _ => unreachable!("a problem's laws are of one kind"),
                    }
                };
                let law = ComputedTorque::new(
                    arm(|i| closed_form(problem.law(run(i)).model())),
                    Full(full_of::<S, 4>(2, |i| &spec(i).kp)),
                    Full(full_of::<S, 4>(2, |i| &spec(i).kd)),
                    [S::zero(); 2],
                );
                let reference = self.reference::<S>();
                self.close_any::<S, _, 0, 6>(law, reference)
            }
            _ => unreachable!("other laws have no loop of their own"),
        }
    }
}

impl<'a, T: Drive> Group<'a, T> {
    #[inline(always)]
    fn reference<S: Real>(&self) -> Reference<'a, S> {
        let last = self.problem.runs() - 1;
        match self.tabulated {
            Some(motion) => Reference::new(vec![motion]),
            None => Reference::new((0..S::LANES).map(|i| self.problem.law((self.first + i).min(last)).motions()[0]).collect()),
        }
    }

    /// The loops that are not made for speed alone carry the monitors' integrals always: fewer kernels.
    #[inline(always)]
    fn close_any<S: Real, L: Law<S>, const Z: usize, const X: usize>(self, law: L, reference: Reference<'a, S>) -> T::Ended {
        let desired = [S::zero(); 6];
        if self.problem.options.sampling.is_some() {
            self.close::<S, L, _, Z, X, true, true>(law, reference, desired)
        } else {
            self.close::<S, L, _, Z, X, true, false>(law, reference, desired)
        }
    }

    /// Close the loop and run it.
    #[inline(always)]
    fn close<S, L, U, const Z: usize, const X: usize, const MONITORED: bool, const HELD: bool>(
        self,
        law: L,
        mut reference: Reference<'a, S>,
        desired: U,
    ) -> T::Ended
    where
        S: Real,
        L: Law<S>,
        U: Desired<S>,
    {
        let problem = self.problem;
        let last = problem.runs() - 1;
        let run = |lane: usize| (self.first + lane).min(last);
        let zero = S::zero();
        let closed: PrLoop<S, L, U, Z, X, MONITORED, HELD> = RigidLoop::new(
            arm(|i| closed_form(problem.plant(run(i)).model())),
            law,
            &mut reference,
            problem.options.tau_max.as_deref(),
            ([zero; 2], [zero; Z], desired.clone()),
            ([(zero, zero); 2], [Angle::default(); 2]),
        );
        let mut x = [zero; X];
        for i in 0..2 {
            x[i] = S::from_lanes(|lane| problem.x0[4 * run(lane) + i]);
            x[2 + i] = S::from_lanes(|lane| problem.x0[4 * run(lane) + 2 + i]);
        }
        for i in 0..Z {
            x[4 + i] = S::from_lanes(|lane| problem.law(run(lane)).initial_state()[i]);
        }
        self.division.drive(closed, x, desired, &problem.options, self.stop, self.sink)
    }
}

impl<S, L, U, const Z: usize, const X: usize, const MONITORED: bool, const HELD: bool>
    Record<PrLoop<'_, '_, S, L, U, Z, X, MONITORED, HELD>, [S; X]> for Records<'_>
where
    S: Real,
    L: Law<S>,
    U: Desired<S>,
{
    #[inline(always)]
    fn record(&mut self, i: usize, closed: &mut PrLoop<S, L, U, Z, X, MONITORED, HELD>, x: &[S; X]) {
        let t = self.schedule.records[i].t;
        if !HELD {
            closed.observe(t, x);
        }
        record_apart(self.sink, i, t, *x, closed.tau);
    }
}

impl Drive for Fixed {
    type Ended = Faults;

    #[inline(always)]
    fn drive<S, L, U, const Z: usize, const X: usize, const MONITORED: bool, const HELD: bool>(
        &self,
        mut closed: PrLoop<S, L, U, Z, X, MONITORED, HELD>,
        x: [S; X],
        desired: U,
        _: &Options,
        stop: &dyn Stop,
        sink: &mut dyn Sink,
    ) -> Faults
    where
        S: Real,
        L: Law<S>,
        U: Desired<S>,
    {
        let mut method = Rk4::new(x, desired);
        let mut records = Records { schedule: &self.schedule, sink };
        fixed_steps::run::<S, _, _, _>(&mut closed, &mut method, x, &self.schedule, self.hold, stop, &mut records)
    }
}

impl Drive for Segments {
    type Ended = Outcome;

    #[inline(always)]
    fn drive<S, L, U, const Z: usize, const X: usize, const MONITORED: bool, const HELD: bool>(
        &self,
        mut closed: PrLoop<S, L, U, Z, X, MONITORED, HELD>,
        x: [S; X],
        desired: U,
        options: &Options,
        stop: &dyn Stop,
        sink: &mut dyn Sink,
    ) -> Outcome
    where
        S: Real,
        L: Law<S>,
        U: Desired<S>,
    {
        let tolerance = Tolerance { rtol: options.rtol, atol: options.atol, controlled: 4 + Z };
        let mut method = Dop853::new(tolerance, x, desired);
        let mut i = 0;
        adaptive_steps::run::<S, _, _, _>(&mut closed, &mut method, self, stop, |t, closed, x| {
            if !HELD {
                closed.observe(t, x);
            }
            record_apart(sink, i, t, *x, closed.tau);
            i += 1;
        })
    }
}

/// The gain of a law that [`Problem::is_planar_pr`].
#[inline(always)]
fn euclidean(law: &AdaptiveSpec) -> &Gain {
    match &law.adaptation {
        Adaptation::Euclidean(gamma) => gamma,
        Adaptation::Natural(_) => unreachable!("this loop is for the Euclidean law"),
    }
}

/// The arm of a problem that [`Problem::is_planar_pr`].
#[inline(always)]
fn closed_form(model: &Model) -> &PlanarPr<f64> {
    match model {
        Model::PlanarPr(arm) => arm,
        Model::Tree(_) => unreachable!("this loop is for the closed-form arm"),
    }
}

#[inline(always)]
fn arm<'a, S: Real>(of: impl Fn(usize) -> &'a PlanarPr<f64>) -> PlanarPr<S> {
    PlanarPr::from_lanes(|i| *of(i))
}

#[inline(always)]
fn diagonal_of<'a, S: Real, const N: usize>(of: impl Fn(usize) -> &'a Gain) -> [S; N] {
    std::array::from_fn(|i| S::from_lanes(|lane| of(lane).at(i, i)))
}

#[inline(always)]
fn full_of<'a, S: Real, const NN: usize>(n: usize, of: impl Fn(usize) -> &'a Gain) -> [S; NN] {
    std::array::from_fn(|k| S::from_lanes(|lane| of(lane).at(k / n, k % n)))
}
