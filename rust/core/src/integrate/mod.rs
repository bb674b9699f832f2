//! Initial-value problems `x' = f(u(t), x)`, where `x'` is the time derivative: one method per file, each generic over the number type.
//!
//! The exogenous input `u(t)` (desired motion, applied force) depends only on the time. Stages at the same time can share it. For a plain
//! system `x' = f(t, x)` the input is the time.
//!
//! Terms: the *slope* is `x'`. An *attempt* is a step before the error test. A *segment* is the time between two jumps of the input or the
//! state. A *lane* is one element of a SIMD register, and computes one of several runs.
//!
//! The folder is flat, because each method has one file, and the other files are parts that methods share.

pub mod accuracy;
pub mod adaptive;
mod buffer;
mod chatter;
mod columns;
mod dop853;
mod dop853_tableau;
mod dopri5;
mod embedded;
mod equal_steps;
mod euler;
pub mod events;
mod first_step;
mod fixed;
mod method;
mod radau5;
mod radau5_tableau;
mod rk4;
mod rodas4;
mod ros2;
mod rounding;
mod scheme;
mod semi_implicit;
pub mod solve;
mod stall;
mod step_controller;
mod tableau;
mod with_method;

pub use accuracy::{Accuracy, Tolerance, Tolerances, Work};
pub use adaptive::Adaptive;
pub use buffer::Buffer;
pub use columns::column_groups;
pub use dop853::Dop853;
pub use dopri5::Dopri5;
pub use embedded::Embedded;
pub use equal_steps::{EqualSteps, Explicit, Stage};
pub use euler::Euler;
pub use fixed::Steps;
pub use method::{ExplicitAdaptive, ExplicitSteps, ImplicitAdaptive, ImplicitSteps, Method, MethodKind, STIFF};
pub use radau5::Radau5;
pub use rk4::Rk4;
pub use rodas4::Rodas4;
pub use ros2::Ros2;
pub use scheme::{Attempt, Scheme};
pub use semi_implicit::SemiImplicit;
pub(crate) use step_controller::StepController;
pub use tableau::Tableau;
pub use with_method::{WithAdaptive, WithExplicitSteps, WithScheme, WithSteps};

use crate::linalg::Pairs;
use crate::scalar::Real;

/// A system of differential equations `x' = f(u(t), x)`, as the integration methods see it. Times and step sizes are in s.
/// Unless stated otherwise, states, slopes and other arrays have one entry per state.
///
/// ```
/// use armlet_core::integrate::{Euler, Explicit, FixedStep, System};
/// use armlet_core::scalar::Real;
///
/// /// `x' = -x + u(t)` with the input `u(t) = 2 t`.
/// struct Lag;
/// impl<S: Real> System<S> for Lag {
///     type Input = f64;
///     fn input(&mut self, t: f64, u: &mut f64) {
///         *u = 2.0 * t;
///     }
///     fn rhs(&mut self, u: &f64, x: &[S], dx: &mut [S]) {
///         dx[0] = S::splat(*u) - x[0];
///     }
/// }
/// let mut x = [1.0];
/// Explicit::<Euler, _, _>::new(x, 0.0).step(&mut Lag, 0.5, 0.25, 0.75, &mut x);
/// assert_eq!(x, [1.0 + 0.25 * (1.0 - 1.0)]);
/// ```
pub trait System<S: Real> {
    /// The type of the exogenous input at one instant.
    type Input: Clone;

    /// Write the input at time `t`, s, to `u`.
    fn input(&mut self, t: f64, u: &mut Self::Input);
    /// Write the right-hand side `f(u, x)` to `dx`. `x` and `dx` have one entry per state.
    fn rhs(&mut self, u: &Self::Input, x: &[S], dx: &mut [S]);
    /// Compute all stages of an attempt of an explicit method. Return false if the method must compute them one by one.
    fn attempt<C: Scheme, B: Buffer<S>>(&mut self, _: &mut Attempt<S, B>) -> bool {
        false
    }
    /// The number of attempts that an adaptive method may spend at a jump of the slope before the run ends.
    fn chatter_budget(&self) -> u64 {
        500_000
    }
    /// The index of the component that is the rate of component `i`: `x_i' = x_k` gives `Some(k)`. Methods that treat positions and
    /// velocities differently require this index. `None` means that no component is this rate.
    fn rate_of(&self, i: usize) -> Option<usize> {
        self.pairs().rate_of(i)
    }
    /// Whether the system's time runs backwards, so that positions change with minus their rates.
    fn is_reversed(&self) -> bool {
        false
    }
    /// The pairs of positions and rates in the state: positions come first, and their rates follow. The default is no pair.
    fn pairs(&self) -> Pairs {
        Pairs::default()
    }
}

/// A system with derivatives, for implicit methods. `n` is the number of states.
///
/// ```
/// use armlet_core::integrate::{Differentiable, FixedStep, Ros2, System};
/// # struct Decay;
/// # impl System<f64> for Decay {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { dx[0] = -1e6 * x[0]; }
/// # }
///
/// /// The stiff system `x' = -1e6 x`.
/// impl Differentiable<f64> for Decay {
///     fn linearise(&mut self, _: f64, u: &(), x: &[f64], dx: &mut [f64], j: &mut [f64]) {
///         self.rhs(u, x, dx);
///         j[0] = -1e6;
///     }
///     fn time_derivative(&mut self, _: f64, _: &(), _: &[f64], dft: &mut [f64]) {
///         dft[0] = 0.0;
///     }
/// }
/// let mut x = [1.0];
/// Ros2::new(x, [0.0], [0], ()).step(&mut Decay, 0.0, 0.1, 0.1, &mut x);
/// assert!(x[0].abs() < 1e-4);
/// ```
pub trait Differentiable<S: Real>: System<S> {
    /// Write the slope `f(u, x)` to `dx`, shape `(n,)`, and `df/dx` to `j`, shape `(n, n)`, row-major. `u` is the input at time `t`.
    fn linearise(&mut self, t: f64, u: &Self::Input, x: &[S], dx: &mut [S], j: &mut [S]);
    /// Write `df/dt` at constant `x` to `dft`, shape `(n,)`. This derivative is not zero if the input changes with time. `u` is the input
    /// at time `t`.
    fn time_derivative(&mut self, t: f64, u: &Self::Input, x: &[S], dft: &mut [S]);
    /// Whether the input is constant between its jumps. Then `df/dt` is zero there and is not computed.
    fn autonomous(&self) -> bool {
        false
    }
    /// Whether the caller requests a stop. Methods check this during long matrix decompositions.
    fn stopped(&mut self) -> bool {
        false
    }
}

/// A method whose step can be computed with inputs that the caller has set. The step size may differ between lanes.
///
/// ```
/// use armlet_core::integrate::{Advance, Explicit, Rk4, System};
/// # struct Integral;
/// # impl System<f64> for Integral {
/// #     type Input = f64;
/// #     fn input(&mut self, t: f64, u: &mut f64) { *u = t; }
/// #     fn rhs(&mut self, u: &f64, _: &[f64], dx: &mut [f64]) { dx[0] = *u; }
/// # }
///
/// // `x' = u`, with given inputs at the start, the middle and the end of the step: Simpson's rule.
/// let (mut method, mut x) = (Explicit::<Rk4, _, _>::new([0.0], 0.0), [0.0]);
/// let inputs = [1.0, 4.0, 1.0];
/// for (k, u) in inputs.into_iter().enumerate() {
///     *Advance::<f64, Integral, _>::input(&mut method, k) = u;
/// }
/// method.advance(&mut Integral, 0.6, &mut x);
/// assert!((x[0] - 1.8f64).abs() < 1e-15);
/// ```
pub trait Advance<S: Real, F: System<S>, B: Buffer<S>> {
    /// The instants of the inputs, as increasing fractions of the step.
    const INSTANTS: &'static [f64];

    /// The memory of the input at instant `k`.
    fn input(&mut self, k: usize) -> &mut F::Input;
    /// Advance `x` by `h` with these inputs. `h`: step size, s, one per lane.
    fn advance(&mut self, system: &mut F, h: S, x: &mut B);
    /// Advance `x` over the step `[t, end]` of size `h`, s, and evaluate all inputs first.
    fn advance_anew(&mut self, system: &mut F, t: f64, h: f64, end: f64, x: &mut B) {
        for (k, &part) in Self::INSTANTS.iter().enumerate() {
            system.input(if part == 1.0 { end } else { t + part * h }, self.input(k));
        }
        self.advance(system, S::splat(h), x);
    }
}

/// A method of fixed step size.
///
/// ```
/// use armlet_core::integrate::{Euler, Explicit, FixedStep, Rk4, System};
/// # struct Growth;
/// # impl System<f64> for Growth {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { dx[0] = x[0]; }
/// # }
///
/// /// Integrate `x' = x` from 1 over 1 s.
/// fn run<M: FixedStep<f64, Growth, [f64; 1]>>(mut method: M) -> f64 {
///     let mut x = [1.0];
///     for k in 0..10 {
///         method.step(&mut Growth, 0.1 * k as f64, 0.1, 0.1 * (k + 1) as f64, &mut x);
///     }
///     x[0]
/// }
/// assert!((run(Explicit::<Euler, _, _>::new([0.0], ())) - 1.1f64.powi(10)).abs() < 1e-14);
/// assert!((run(Explicit::<Rk4, _, _>::new([0.0], ())) - 1f64.exp()).abs() < 3e-6);
/// ```
pub trait FixedStep<S: Real, F: System<S>, B: Buffer<S>> {
    /// Advance `x` from `t` to `t + h`, s. `end` is the time at which the last input is evaluated. It is `t + h`, or just before `t + h` if
    /// the input jumps there.
    fn step(&mut self, system: &mut F, t: f64, h: f64, end: f64, x: &mut B);
    /// Advance `x` by `count` steps of size `h`, s, starting at time `first * h`, with the samples of a sampled system. Return false, without
    /// a change of `x`, if the steps must be computed one by one.
    fn stride(&mut self, _system: &mut F, _first: usize, _count: usize, _h: f64, _x: &mut B) -> bool {
        false
    }
    /// Discard the stored values of the previous step, because the input or the state has jumped.
    fn restart(&mut self);
}
