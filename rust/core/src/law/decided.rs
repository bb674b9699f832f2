//! Laws with task priorities. Their solver decides the numerical rank of each task's projected Jacobian. With `f64`, the solver may use
//! every algorithm of the module `priority`. A recorded law only uses the algorithm `Regular`, which has no branch. It also reports whether
//! its result is valid.

use super::definition::Law;
use crate::error::Result;
use crate::priority::{PrioritySolver, Regular};
use crate::scalar::Real;
use crate::trace::Sym;
use std::any::Any;

/// The interface between a law and a solver of prioritised tasks.
pub trait Solve {
    type Number: Real;

    /// Create a solver with the sizes and options of `solver`; `None` if this kind of solver does not support the method of `solver`.
    fn of(solver: PrioritySolver) -> Option<Self>
    where
        Self: Sized;
    /// The stacked Jacobians and commands of the tasks, which the caller writes.
    fn inputs(&mut self) -> (&mut [Self::Number], &mut [Self::Number]);
    /// Solve for the present Jacobians, whose entries have the relative error `rounding`. `bounds` sets the bounds, if the method has any.
    fn solve(&mut self, rounding: Self::Number, bounds: impl FnOnce(&mut PrioritySolver) -> Result<()>) -> Result<()>;
    /// The computed joint velocities, or joint accelerations in a law of accelerations, `(n,)`.
    fn v(&self) -> &[Self::Number];
    /// The residuals of the tasks of all levels, stacked.
    fn residuals(&self) -> &[Self::Number];
    /// Return 1 if the results are valid, and 0 if another algorithm is required. The return value is `None` for a solver that is always
    /// valid.
    fn stands(&self) -> Option<Self::Number>;
}

impl Solve for PrioritySolver {
    type Number = f64;

    fn of(solver: PrioritySolver) -> Option<Self> {
        Some(solver)
    }
    fn inputs(&mut self) -> (&mut [f64], &mut [f64]) {
        PrioritySolver::inputs(self)
    }
    fn solve(&mut self, rounding: f64, bounds: impl FnOnce(&mut PrioritySolver) -> Result<()>) -> Result<()> {
        bounds(self)?;
        self.set_rounding(rounding)?;
        self.run().map(|_| ())
    }
    fn v(&self) -> &[f64] {
        PrioritySolver::v(self)
    }
    fn residuals(&self) -> &[f64] {
        PrioritySolver::residuals(self)
    }
    fn stands(&self) -> Option<f64> {
        None
    }
}

/// The algorithm [`Regular`] on recorded numbers.
pub struct RecordedSolver {
    route: Regular<Sym>,
    jacobian: Vec<Sym>,
    command: Vec<Sym>,
    stands: Sym,
}

impl Solve for RecordedSolver {
    type Number = Sym;

    fn of(solver: PrioritySolver) -> Option<Self> {
        let total = solver.rows().iter().sum::<usize>();
        if solver.method().has_bounds() {
            return None;
        }
        let (jacobian, command) = (vec![Sym::zero(); total * solver.n()], vec![Sym::zero(); total]);
        Some(RecordedSolver { route: solver.regular(), jacobian, command, stands: Sym::zero() })
    }
    fn inputs(&mut self) -> (&mut [Sym], &mut [Sym]) {
        (&mut self.jacobian, &mut self.command)
    }
    fn solve(&mut self, rounding: Sym, _: impl FnOnce(&mut PrioritySolver) -> Result<()>) -> Result<()> {
        self.stands = self.route.solve(rounding, &self.jacobian, &self.command);
        Ok(())
    }
    fn v(&self) -> &[Sym] {
        &self.route.v
    }
    fn residuals(&self) -> &[Sym] {
        &self.route.residual
    }
    fn stands(&self) -> Option<Sym> {
        Some(self.stands)
    }
}

/// A law with one of two kinds of solvers, chosen by the number type of the loop.
pub enum Decided<L, R> {
    Plain(L, Buffers<f64>),
    Recorded(R, Buffers<Sym>),
}

/// Inputs and outputs of a law, converted to its number type.
pub struct Buffers<T> {
    desired: Vec<T>,
    trig: Vec<(T, T)>,
    x: Vec<T>,
    tau: Vec<T>,
}

impl<T: Real> Buffers<T> {
    fn new([desired, n, states]: [usize; 3]) -> Self {
        let zeros = |k: usize| vec![T::zero(); k];
        Buffers { desired: zeros(desired), trig: vec![(T::zero(), T::zero()); n], x: zeros(states), tau: zeros(n) }
    }

    fn evaluate<S: Real>(
        &mut self,
        law: &mut impl Law<T>,
        (to, back): (impl Fn(S) -> T, impl Fn(T) -> S),
        (desired, trig, x): (&[S], &[(S, S)], &[S]),
        tau: &mut [S],
    ) {
        self.desired.iter_mut().zip(desired).for_each(|(own, &given)| *own = to(given));
        self.trig.iter_mut().zip(trig).for_each(|(own, given)| *own = (to(given.0), to(given.1)));
        self.x.iter_mut().zip(x).for_each(|(own, &given)| *own = to(given));
        law.evaluate(&self.desired, &self.trig, &self.x, &[], &mut self.tau, &mut []);
        tau.iter_mut().zip(&self.tau).for_each(|(tau, &own)| *tau = back(own));
    }
}

/// `x` as type `B` if `A` and `B` are the same type; otherwise `None`.
fn same<A: Any, B: Any + Copy>(x: A) -> Option<B> {
    (&x as &dyn Any).downcast_ref().copied()
}

impl<L, R> Decided<L, R> {
    /// Create the law for the number type `S`. `sizes` are the numbers of desired values, joints and plant states.
    pub fn new<S: Real>(sizes: [usize; 3], plain: impl FnOnce() -> L, recorded: impl FnOnce() -> Option<R>) -> Self {
        let recorded = if same::<S, Sym>(S::zero()).is_some() { recorded() } else { None };
        match recorded {
            Some(law) => Decided::Recorded(law, Buffers::new(sizes)),
            None => Decided::Plain(plain(), Buffers::new(sizes)),
        }
    }
}

impl<S: Real, L: Law<f64>, R: Law<Sym>> Law<S> for Decided<L, R> {
    fn evaluate(&mut self, desired: &[S], trig: &[(S, S)], x: &[S], _: &[S], tau: &mut [S], _: &mut [S]) {
        let given = (desired, trig, x);
        match self {
            Decided::Plain(law, buffers) => buffers.evaluate(law, (|x: S| x.lane(0), S::splat), given, tau),
            Decided::Recorded(law, buffers) => {
                buffers.evaluate(law, (|x: S| same(x).unwrap_or_default(), |x: Sym| same(x).unwrap_or_default()), given, tau);
            }
        }
    }

    fn stands(&self) -> Option<S> {
        match self {
            Decided::Plain(..) => None,
            Decided::Recorded(law, _) => law.stands().and_then(same),
        }
    }
}
