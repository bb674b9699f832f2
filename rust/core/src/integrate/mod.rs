//! Initial-value problems `x' = f(u(t), x)`: one method per file, each generic over the number it runs on.
//!
//! The exogenous input `u(t)` (desired motion, applied force) is evaluated once per distinct stage time. For
//! a plain `x' = f(t, x)` it is the time.

pub mod adaptive;
mod chatter;
mod columns;
mod dop853;
mod dop853_tableau;
mod dopri5;
mod embedded;
mod equal_steps;
mod euler;
pub mod events;
mod fixed;
mod linearised;
mod method;
mod radau5;
mod radau5_tableau;
mod rk4;
mod rodas4;
mod ros2;
mod rounding;
mod semi_implicit;
pub mod solve;
mod stall;
mod step_controller;
mod tableau;

pub use adaptive::{Accuracy, Adaptive, Tolerance, Tolerances, Work};
pub use columns::column_groups;
pub use dop853::{Dop853, Order8};
pub use dopri5::{Dopri5, Pair54};
pub use embedded::{Embedded, Scheme};
pub use equal_steps::{EqualSteps, Explicit, Stage};
pub use euler::{Euler, Forward1};
pub use fixed::Steps;
pub use linearised::{DualSystem, Linearised};
pub use method::{
    ExplicitAdaptive, ExplicitSteps, ImplicitAdaptive, ImplicitSteps, Kind, Method, WithAdaptive, WithExplicitSteps, WithScheme, WithSteps,
};
pub use radau5::Radau5;
pub use rk4::{Kutta4, Rk4};
pub use rodas4::Rodas4;
pub use ros2::Ros2;
pub use semi_implicit::SemiImplicit;
pub use tableau::Tableau;

use crate::linalg::Pairs;
use crate::scalar::Real;

/// The system that is integrated.
pub trait System<S: Real> {
    /// The exogenous signal at one instant.
    type Input: Clone;

    /// The input `u` at time `t`.
    fn input(&mut self, t: f64, u: &mut Self::Input);
    /// The right-hand side `dx = f(u, x)`.
    fn rhs(&mut self, u: &Self::Input, x: &[S], dx: &mut [S]);
    /// Compute all stages of an attempt of an explicit method at once; false if they must be computed one by one.
    fn attempt<C: Scheme, B: Buffer<S>>(&mut self, _: &mut Attempt<S, B>) -> bool {
        false
    }
    /// Attempts that an adaptive method may spend along a jump of the slope before the run ends.
    fn chatter_budget(&self) -> u64 {
        500_000
    }
    /// Take a sample of a sampled loop, and hold its result until the next one.
    fn sample(&mut self, _t: f64, _x: &[S]) {}
    /// Switch at `t` and `x`, where a fixed step begins. Returns whether the slope jumps.
    fn enter_step(&mut self, _t: f64, _x: &[S]) -> bool {
        false
    }
    /// Switch at `x`, where a fixed step has ended. This may move `x` to the switch. Returns whether it did.
    fn leave_step(&mut self, _x: &mut [S]) -> bool {
        false
    }
    /// Put what the system holds at rest exactly there, in a state that an adaptive method has computed.
    fn still(&mut self, _x: &mut [S]) {}
    /// The states of the system's switches, for the same system on dual numbers.
    fn sides(&mut self) -> &[i8] {
        &[]
    }
    /// Add the state at `t` to the sums after it in `x`, for a run with metrics. `h` is the time to the next step, zero at the end.
    fn sum_up(&mut self, _t: f64, _h: f64, _x: &mut [S]) {}
    /// Note the state at `t` as record `i`, for a run whose records are noted within its steps.
    fn note(&mut self, _i: usize, _t: f64, _x: &[S]) {}
    /// The held input and rate of the law since the last sample; `None` if nothing is held.
    fn held(&self) -> Option<(&[S], &[S])> {
        None
    }
    /// The component that is the rate of component `i`, if there is one: `x_i' = x_k` gives `Some(k)`.
    /// Methods that treat positions and velocities differently require this.
    fn rate_of(&self, i: usize) -> Option<usize> {
        self.pairs().rate_of(i)
    }
    /// Whether its time runs backwards, so that positions change by minus their rates.
    fn is_reversed(&self) -> bool {
        false
    }
    /// The number of leading positions, followed by their rates; none for a state in another order.
    fn pairs(&self) -> Pairs {
        Pairs::default()
    }
}

/// The data of an attempt of an explicit method.
pub struct Attempt<'a, S, B> {
    /// The step, s.
    pub h: S,
    /// The times of the inputs of the stages after the first.
    pub times: &'a [f64],
    /// The state at the start of the step.
    pub x: &'a [S],
    /// The slopes of all stages: the first is an argument, the others are results.
    pub slopes: &'a mut [B],
    /// The new state, a result.
    pub y: &'a mut [S],
    /// The estimates of the error, results.
    pub estimates: &'a mut [B],
}

/// A system with derivatives, for implicit methods. `n` is the number of states.
pub trait Differentiable<S: Real>: System<S> {
    /// Write the slope of `rhs` to `dx`, and `df/dx` to `j`, `(n, n)` row-major. `u` is the input at `t`.
    fn linearise(&mut self, t: f64, u: &Self::Input, x: &[S], dx: &mut [S], j: &mut [S]);
    /// Write `df/dt` at fixed `x`, which results from the change of the input, to `dft`, `(n,)`. `u` is the input at `t`.
    fn time_derivative(&mut self, t: f64, u: &Self::Input, x: &[S], dft: &mut [S]);
    /// Whether the input is constant. Then `df/dt` is zero and is not computed.
    fn autonomous(&self) -> bool {
        false
    }
    /// Whether the caller requests a stop: checked during long decompositions.
    fn stopped(&mut self) -> bool {
        false
    }
}

/// The arithmetic of a step without its times: the inputs are already set, and the step may differ between lanes.
pub trait Advance<S: Real, F: System<S>, B: Buffer<S>> {
    /// The instants of the inputs, as parts of the step, increasing.
    const INSTANTS: &'static [f64];

    /// The input at instant `k`.
    fn input(&mut self, k: usize) -> &mut F::Input;
    /// Advance `x` by `h` with these inputs.
    fn advance(&mut self, system: &mut F, h: S, x: &mut B);
    /// Advance `x` over the step `[t, end]` of size `h`, with all inputs taken anew.
    fn advance_anew(&mut self, system: &mut F, t: f64, h: f64, end: f64, x: &mut B) {
        for (k, &part) in Self::INSTANTS.iter().enumerate() {
            system.input(if part == 1.0 { end } else { t + part * h }, self.input(k));
        }
        self.advance(system, S::splat(h), x);
    }
}

/// The storage of a state: an array for small closed-form systems, the heap for others.
pub trait Buffer<S>: Clone + AsRef<[S]> + AsMut<[S]> {}
impl<S, B: Clone + AsRef<[S]> + AsMut<[S]>> Buffer<S> for B {}

/// A method of fixed step.
pub trait FixedStep<S: Real, F: System<S>, B: Buffer<S>> {
    /// Advance `x` from `t` to `t + h`. `end` is the time at which the input at the end is taken: `t + h`, or
    /// just before it if the input jumps there.
    fn step(&mut self, system: &mut F, t: f64, h: f64, end: f64, x: &mut B);
    /// Advance `x` by `count` steps of `h` from the time `first h` on, all at once; false if the method only has single steps.
    fn stride(&mut self, _system: &mut F, _first: usize, _count: usize, _h: f64, _x: &mut B) -> bool {
        false
    }
    /// Discard the stored values of the previous step, because the input or the state has jumped.
    fn restart(&mut self);
}
