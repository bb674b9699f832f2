//! A stack of tasks at one state, or at one state per lane (one entry of a SIMD register). The bodies are placed once, then every task
//! writes its rows.

use super::Bodies;
use super::task::{TaskFunction, TaskKind};
use crate::arm::{Arm, Tree};
use crate::scalar::Real;
use nalgebra::DMatrix;

/// Task functions of one arm, with buffers. Evaluation allocates nothing.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::kinematics::{TaskFunction, TaskStack};
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
/// let tasks = vec![TaskFunction::frame(&arm, "link2", "xy")?, TaskFunction::posture(&arm, None)?];
/// let mut stack = TaskStack::<f64>::new(&arm, tasks);
/// stack.place(&[0.0, 0.0]);
/// let mut j = [1.0; 8];
/// stack.jacobians(&mut j);
/// assert_eq!(stack.rows(), [2, 2]);
/// assert_eq!(j, [0.0, 0.0, 0.9, 0.4, 1.0, 0.0, 0.0, 1.0]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct TaskStack<S: Real = f64> {
    bodies: Bodies<S>,
    functions: Vec<TaskFunction>,
    rows: Vec<usize>,
}

impl<S: Real> TaskStack<S> {
    /// Create a stack of the tasks `functions` of an arm.
    pub fn new(arm: &Arm, functions: Vec<TaskFunction>) -> Self {
        Self::of_tree(Tree::new(arm), functions)
    }

    fn of_tree(tree: Tree<S>, functions: Vec<TaskFunction>) -> Self {
        let needed = functions.iter().map(|function| function.bodies(&tree)).max().unwrap_or(0);
        TaskStack { rows: functions.iter().map(TaskFunction::rows).collect(), bodies: Bodies::new(tree, needed), functions }
    }

    /// Number of coordinates `n`: the number of joints that are not mimic joints.
    pub fn n(&self) -> usize {
        self.bodies.n()
    }

    /// Number of rows of each task.
    pub fn rows(&self) -> &[usize] {
        &self.rows
    }

    /// The task functions, in their order.
    pub fn functions(&self) -> &[TaskFunction] {
        &self.functions
    }

    /// Assumed relative error of the entries of the Jacobians at the last `q`: `8 eps (1 + sum|q|)`, at most 0.5.
    pub fn rounding(&self) -> S {
        let turned = self.bodies.q.iter().fold(S::splat(1.0), |sum, q| sum + q.abs());
        // With a relative error above 1 the entries would be unknown, and no rank could be decided. So 0.5 is the largest value.
        let (relative, most) = (S::splat(8.0 * f64::EPSILON) * turned, S::splat(0.5));
        S::select(relative.lt(most), relative, most)
    }

    /// Place the bodies at `q` `(n,)`.
    pub fn place(&mut self, q: &[S]) {
        self.bodies.place(q);
    }

    /// Place the bodies at `q`, `(n,)`, whose (sin, cos) are known.
    pub fn place_at(&mut self, q: &[S], trig: &[(S, S)]) {
        self.bodies.place_at(q, trig);
    }

    /// Compute the velocities of the placed bodies at joint rates `v`, `(n,)`.
    pub fn set_moving(&mut self, v: &[S]) {
        self.bodies.set_moving(v);
    }

    /// Compute the error `e` and the feed-forward velocity `w` of task `k`, `(rows,)` each, for its target `x_d` with time derivatives,
    /// `[x_d, x_d', x_d'']`. If `a` is `Some`, compute the feed-forward acceleration too.
    pub fn error(&mut self, k: usize, desired: &[S], e: &mut [S], w: &mut [S], a: Option<&mut [S]>) {
        let function = &self.functions[k];
        let (target, rest) = desired.split_at(function.target_size());
        let (rate, acceleration) = rest.split_at(target.len());
        function.error(&mut self.bodies, target, e);
        function.feedforward(&self.bodies, [target, rate, acceleration], w, a);
    }

    /// Write the stacked Jacobians, `(sum rows, n)`, row-major, to `j`.
    pub fn jacobians(&mut self, j: &mut [S]) {
        self.write(j, false);
    }

    /// Write the stacked rates `dJ/dt`, `(sum rows, n)`, to `j`, at the joint rates of [`TaskStack::set_moving`].
    pub fn jacobians_dot(&mut self, j: &mut [S]) {
        self.write(j, true);
    }

    /// The stacked Jacobians, `(sum rows, n)`, or their rates at the joint rates of [`TaskStack::set_moving`].
    pub fn jacobian_matrix(&mut self, rate: bool) -> DMatrix<S> {
        let (rows, n) = (self.rows.iter().sum(), self.n());
        let mut j = vec![S::zero(); rows * n];
        self.write(&mut j, rate);
        DMatrix::from_row_slice(rows, n, &j)
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
    /// Copy the tasks to another number type.
    pub fn lift<S: Real>(&self) -> TaskStack<S> {
        TaskStack::of_tree(self.bodies.tree.lift(), self.functions.clone())
    }
}
