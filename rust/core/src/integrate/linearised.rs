//! Jacobians from the right-hand side evaluated on dual numbers.
//!
//! Column `j` of `df/dx` is the derivative of `f` along `x_j`. One evaluation computes one column per lane of the dual part.

use super::{Differentiable, System};
use crate::linalg::Pairs;
use crate::scalar::{Dual, Real};

/// A system whose right-hand side is evaluated on dual numbers.
///
/// ```
/// use armlet_core::integrate::{Differentiable, DualSystem, Linearised, System};
/// use armlet_core::scalar::{Dual, Real};
///
/// # struct Square;
/// # impl<S: Real> System<S> for Square {
/// #     type Input = S;
/// #     fn input(&mut self, t: f64, u: &mut S) { *u = S::splat(3.0 * t); }
/// #     fn rhs(&mut self, u: &S, x: &[S], dx: &mut [S]) { dx[0] = *u - x[0] * x[0]; }
/// # }
///
/// /// `x' = u(t) - x^2` with the input `u(t) = 3 t`, whose time derivative is 3.
/// impl DualSystem<f64> for Square {
///     fn moving_input(&mut self, t: f64, u: &mut Dual) {
///         *u = Dual::new(3.0 * t, 3.0);
///     }
/// }
/// let mut system = Linearised::<_, _, f64, _, _>::new(Square, Square, [Dual::zero()], Dual::zero());
/// let mut dft = [0.0];
/// system.time_derivative(2.0, &6.0, &[0.5], &mut dft);
/// assert_eq!(dft, [3.0]);
/// ```
pub trait DualSystem<V: Real>: System<Dual<V>> {
    /// Write the input at time `t`, s, to `u`. The dual part in direction 0 is the time derivative of the input.
    fn moving_input(&mut self, t: f64, u: &mut Self::Input);
    /// In a sampled loop, set the plant's input and the rate of the law's state, which remain constant until the next sample.
    fn hold(&mut self, _input: &[V::One], _rate: &[V::One]) {}
    /// Set the switches of this system to `sides`, which are the states of the switches of the same system on plain numbers.
    fn follow(&mut self, _sides: &[i8]) {}
    /// Whether the input is constant between its jumps.
    fn autonomous(&self) -> bool {
        false
    }
    /// The number of leading components on which the slope depends. Derivatives along other components, such as quadratures, are zero.
    fn leading(&self, n: usize) -> usize {
        n
    }
}

/// A system on plain numbers with the same system on dual numbers. The pair is [`Differentiable`].
///
/// ```
/// use armlet_core::integrate::{Differentiable, DualSystem, Linearised, System};
/// use armlet_core::scalar::{Dual, Real};
/// # struct Pendulum;
/// # impl<S: Real> System<S> for Pendulum {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[S], dx: &mut [S]) { (dx[0], dx[1]) = (x[1], -x[0].sin_cos().0); }
/// # }
/// # impl DualSystem<f64> for Pendulum {
/// #     fn moving_input(&mut self, _: f64, _: &mut ()) {}
/// # }
///
/// // The pendulum `q' = v`, `v' = -sin q`, on plain numbers and on dual numbers.
/// let mut system = Linearised::<_, _, f64, _, _>::new(Pendulum, Pendulum, [Dual::zero(); 2], ());
/// let (mut dx, mut j) = ([0.0; 2], [0.0; 4]);
/// system.linearise(0.0, &(), &[0.3, 2.0], &mut dx, &mut j);
/// assert_eq!(dx[0], 2.0);
/// assert!(j.iter().zip([0.0, 1.0, -0.3f64.cos(), 0.0]).all(|(j, exact)| (j - exact).abs() < 1e-15));
/// ```
pub struct Linearised<F, G, V: Real, X, U> {
    /// The system on plain numbers.
    pub system: F,
    /// The same system on dual numbers.
    pub twin: G,
    /// The memory of the twin for state, slope and input.
    x: X,
    dx: X,
    u: U,
    rates: std::marker::PhantomData<V>,
}

impl<F, G, V, X, U> Linearised<F, G, V, X, U>
where
    V: Real,
    G: DualSystem<V, Input = U>,
    X: Clone + AsMut<[Dual<V>]>,
{
    /// Combine a system and its twin. `state` has the length of the system's state, and `input` is an input of the twin.
    pub fn new(system: F, twin: G, state: X, input: U) -> Self {
        Linearised { system, twin, dx: state.clone(), x: state, u: input, rates: std::marker::PhantomData }
    }
}

impl<S, F, G, V, X, U> System<S> for Linearised<F, G, V, X, U>
where
    S: Real,
    F: System<S>,
    V: Real<One = S>,
    G: DualSystem<V, Input = U>,
{
    type Input = F::Input;
    fn input(&mut self, t: f64, u: &mut F::Input) {
        self.system.input(t, u);
    }
    fn rhs(&mut self, u: &F::Input, x: &[S], dx: &mut [S]) {
        self.system.rhs(u, x, dx);
    }
    fn sample(&mut self, t: f64, x: &[S]) {
        self.system.sample(t, x);
        if let Some((input, rate)) = self.system.held() {
            self.twin.hold(input, rate);
        }
    }
    fn enter_step(&mut self, t: f64, x: &[S]) -> bool {
        let switches = self.system.enter_step(t, x);
        self.twin.follow(self.system.sides());
        switches
    }
    fn leave_step(&mut self, x: &mut [S]) -> bool {
        let switches = self.system.leave_step(x);
        self.twin.follow(self.system.sides());
        switches
    }
    fn still(&mut self, x: &mut [S]) {
        self.system.still(x);
    }
    fn sides(&mut self) -> &[i8] {
        self.system.sides()
    }
    fn held(&self) -> Option<(&[S], &[S])> {
        self.system.held()
    }
    fn rate_of(&self, i: usize) -> Option<usize> {
        self.system.rate_of(i)
    }
    fn is_reversed(&self) -> bool {
        self.system.is_reversed()
    }
    fn pairs(&self) -> Pairs {
        self.system.pairs()
    }
    fn chatter_budget(&self) -> u64 {
        self.system.chatter_budget()
    }
}

impl<S, F, G, V, X, U> Differentiable<S> for Linearised<F, G, V, X, U>
where
    S: Real,
    F: System<S>,
    V: Real<One = S>,
    G: DualSystem<V, Input = U>,
    X: Clone + AsMut<[Dual<V>]>,
{
    fn linearise(&mut self, t: f64, _: &F::Input, x: &[S], dx: &mut [S], j: &mut [S]) {
        let n = x.len();
        let (state, slope) = (&mut self.x.as_mut()[..n], &mut self.dx.as_mut()[..n]);
        self.twin.input(t, &mut self.u);
        let leading = self.twin.leading(n);
        for row in j.chunks_exact_mut(n) {
            row[leading..].fill(S::zero());
        }
        for first in (0..leading).step_by(V::LANES) {
            let columns = V::LANES.min(leading - first);
            for i in 0..n {
                state[i] = if i >= first && i < first + columns { Dual::seed(x[i], i - first) } else { Dual::new(x[i], V::zero()) };
            }
            self.twin.rhs(&self.u, state, slope);
            for i in 0..n {
                for k in 0..columns {
                    j[i * n + first + k] = S::splat(slope[i].rate.lane(k));
                }
            }
        }
        for i in 0..n {
            dx[i] = slope[i].value;
        }
    }

    fn time_derivative(&mut self, t: f64, _: &F::Input, x: &[S], dft: &mut [S]) {
        let n = x.len();
        let (state, slope) = (&mut self.x.as_mut()[..n], &mut self.dx.as_mut()[..n]);
        self.twin.moving_input(t, &mut self.u);
        for i in 0..n {
            state[i] = Dual::new(x[i], V::zero());
        }
        self.twin.rhs(&self.u, state, slope);
        for i in 0..n {
            dft[i] = S::splat(slope[i].rate.lane(0));
        }
    }

    fn autonomous(&self) -> bool {
        self.twin.autonomous()
    }
}
