//! Steps that a program declines, taken directly.
//!
//! A law that decides ranks is recorded by its route for regular stacks, which says where it does not stand. Such a step of one run is
//! taken again from the state before it, by all routes. It starts from that state alone, so that the bits of a run depend on nothing else.

use super::closed_loop::{ClosedLoop, Exogenous};
use super::general::assemble;
use super::problem::{Method, Problem};
use crate::integrate::{Advance, Euler, Rk4, SemiImplicit, System};
use crate::linalg::Pairs;
use crate::scalar::{Real, Task, run_scalar};

/// One run on plain numbers.
pub trait Direct {
    /// The law's input and rate at state `x` and time `t`.
    fn answer(&mut self, t: f64, x: &[f64], tau: &mut [f64], dz: &mut [f64]);
    /// The state after the step `[t, end]` of size `h`; `held`: the input and the rate of the law that act.
    fn step(&mut self, t: f64, h: f64, end: f64, held: Option<(&[f64], &[f64])>, x: &mut [f64]);
}

/// The run `run` of a problem.
pub fn direct<'a>(problem: &'a Problem<'a>, run: usize) -> Box<dyn Direct + 'a> {
    run_scalar(Make { problem, run })
}

struct Make<'a> {
    problem: &'a Problem<'a>,
    run: usize,
}

impl<'a> Task for Make<'a> {
    type Output = Box<dyn Direct + 'a>;
    #[inline(always)]
    fn run<S: Real>(self) -> Box<dyn Direct + 'a> {
        let closed = Turned(assemble::<S>(self.problem, |_| self.run, self.problem.watches_storage()));
        let (x, u) = (vec![S::zero(); closed.0.size()], closed.0.instant());
        match (self.problem.options.method, SemiImplicit::new(&closed, x.clone(), u.clone())) {
            (Method::SemiImplicit, Ok(method)) => Box::new(Steps::new(closed, method, x)),
            (Method::Euler, _) => Box::new(Steps::new(closed, Euler::new(x.clone(), u), x)),
            _ => Box::new(Steps::new(closed, Rk4::new(x.clone(), u), x)),
        }
    }
}

/// A loop whose angles are turned by in full at every stage.
struct Turned<'a, S: Real>(ClosedLoop<'a, S>);

impl<S: Real> System<S> for Turned<'_, S> {
    type Input = Exogenous<S>;
    fn input(&mut self, t: f64, u: &mut Exogenous<S>) {
        self.0.input(t, u);
    }
    fn anchor(&mut self, _: &[S]) {}
    fn rhs(&mut self, u: &Exogenous<S>, x: &[S], dx: &mut [S]) {
        self.0.turn_to(x);
        self.0.rates(u, x, dx);
    }
    fn pairs(&self) -> Pairs {
        self.0.pairs()
    }
}

struct Steps<'a, S: Real, M> {
    closed: Turned<'a, S>,
    method: M,
    x: Vec<S>,
    tau: Vec<S>,
    dz: Vec<S>,
}

impl<'a, S: Real, M> Steps<'a, S, M> {
    fn new(closed: Turned<'a, S>, method: M, x: Vec<S>) -> Self {
        let (tau, dz) = (closed.0.tau.clone(), closed.0.law_rate().to_vec());
        Steps { closed, method, x, tau, dz }
    }
}

fn load<S: Real>(to: &mut [S], from: &[f64]) {
    to.iter_mut().zip(from).for_each(|(to, &from)| *to = S::splat(from));
}

fn store<S: Real>(to: &mut [f64], from: &[S]) {
    to.iter_mut().zip(from).for_each(|(to, from)| *to = from.lane(0));
}

impl<'a, S: Real, M: Advance<S, Turned<'a, S>, Vec<S>>> Direct for Steps<'a, S, M> {
    fn answer(&mut self, t: f64, x: &[f64], tau: &mut [f64], dz: &mut [f64]) {
        load(&mut self.x, x);
        self.closed.0.observe(t, &self.x);
        store(tau, &self.closed.0.tau);
        store(dz, self.closed.0.law_rate());
    }

    fn step(&mut self, t: f64, h: f64, end: f64, held: Option<(&[f64], &[f64])>, x: &mut [f64]) {
        load(&mut self.x, x);
        if let Some((tau, dz)) = held {
            load(&mut self.tau, tau);
            load(&mut self.dz, dz);
            self.closed.0.hold_input(&self.tau, &self.dz);
        }
        for (k, &part) in M::INSTANTS.iter().enumerate() {
            self.closed.0.input(if part == 1.0 { end } else { t + part * h }, self.method.input(k));
        }
        self.method.advance(&mut self.closed, S::splat(h), &mut self.x);
        store(x, &self.x);
    }
}
