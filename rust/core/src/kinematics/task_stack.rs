//! A stack of tasks at one state, or at one state per lane. The bodies are placed once, then every task writes its rows.

use super::Bodies;
use super::task::{TaskFunction, TaskKind};
use crate::arm::{Arm, Tree};
use crate::scalar::Real;

/// Task functions of one arm with their buffers; evaluation allocates nothing.
#[derive(Clone, Debug)]
pub struct TaskStack<S: Real = f64> {
    bodies: Bodies<S>,
    functions: Vec<TaskFunction>,
    rows: Vec<usize>,
}

impl<S: Real> TaskStack<S> {
    pub fn new(arm: &Arm, functions: Vec<TaskFunction>) -> Self {
        Self::of_tree(Tree::new(arm), functions)
    }

    fn of_tree(tree: Tree<S>, functions: Vec<TaskFunction>) -> Self {
        let needed = functions.iter().map(|function| function.bodies(&tree)).max().unwrap_or(0);
        TaskStack { rows: functions.iter().map(TaskFunction::rows).collect(), bodies: Bodies::new(tree, needed), functions }
    }

    pub fn n(&self) -> usize {
        self.bodies.n()
    }

    /// Rows of each task.
    pub fn rows(&self) -> &[usize] {
        &self.rows
    }

    pub fn functions(&self) -> &[TaskFunction] {
        &self.functions
    }

    /// Relative error of the entries of Jacobians at the last `q`: `8 eps (1 + sum|q|)`.
    pub fn rounding(&self) -> S {
        let turned = self.bodies.q.iter().fold(S::splat(1.0), |sum, q| sum + q.abs());
        // Above 1 the entries are unknown, and no rank can be decided.
        let (relative, most) = (S::splat(8.0 * f64::EPSILON) * turned, S::splat(0.5));
        S::select(relative.lt(most), relative, most)
    }

    /// Place the bodies at `q` `(n,)`.
    pub fn place(&mut self, q: &[S]) {
        self.bodies.place(q);
    }

    /// As [`TaskStack::place`], with the known (sin, cos) of the coordinates.
    pub fn place_at(&mut self, q: &[S], trig: &[(S, S)]) {
        self.bodies.place_at(q, trig);
    }

    /// Compute the velocities of the bodies, as last placed, at joint rates `v` `(n,)`.
    pub fn set_moving(&mut self, v: &[S]) {
        self.bodies.set_moving(v);
    }

    /// Error `e` and feed-forward velocity `w` of task `k`, `(rows,)` each, for its target `[x_d, x_d', x_d'']`; if requested also the
    /// feed-forward acceleration `a`.
    pub fn error(&mut self, k: usize, desired: &[S], e: &mut [S], w: &mut [S], a: Option<&mut [S]>) {
        let function = &self.functions[k];
        let (target, rest) = desired.split_at(function.target_size());
        let (rate, acceleration) = rest.split_at(target.len());
        function.error(&mut self.bodies, target, e);
        function.feedforward(&self.bodies, [target, rate, acceleration], w, a);
    }

    /// The stacked Jacobians `(sum rows, n)`, row-major.
    pub fn jacobians(&mut self, j: &mut [S]) {
        self.write(j, false);
    }

    /// The stacked `dJ/dt` `(sum rows, n)` at the rates of [`TaskStack::set_moving`].
    pub fn jacobians_dot(&mut self, j: &mut [S]) {
        self.write(j, true);
    }

    fn write(&mut self, mut j: &mut [S], rate: bool) {
        let n = self.n();
        j.fill(S::zero());
        for (function, rows) in self.functions.iter().zip(&self.rows) {
            let (own, rest) = j.split_at_mut(rows * n);
            function.jacobian(&mut self.bodies, rate, own);
            j = rest;
        }
    }
}

impl TaskStack {
    /// The same tasks on another number type.
    pub fn lift<S: Real>(&self) -> TaskStack<S> {
        TaskStack::of_tree(self.bodies.tree.lift(), self.functions.clone())
    }
}
