//! The quantities of an arm as functions from `f64` arrays to `f64` arrays: one configuration by the scalar route of
//! this machine, or many in its lanes. What a binding needs, and no more: shapes are checked here once, threads and
//! outputs are the caller's.

use super::energy::{add_friction, add_wrench, sign};
use super::{Dynamics, Workspace, derivatives, regressor};
use crate::arm::{Arm, Tree};
use crate::error::{Error, Result, finite};
use crate::kinematics as kin;
use crate::scalar::{Fused, Isa, Kernel, Real, Task, isa, run_lanes};
use crate::spatial::PARAMETERS;

/// What can be asked; inputs in this order, each `(n,)` except a wrench `(6,)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// `q -> (n, n)`.
    MassMatrix,
    /// `q, v -> (n, n)`.
    CoriolisMatrix,
    /// `q -> (n,)`.
    Gravity,
    /// `q, v -> (n,)`.
    Bias,
    /// `q, v, a -> (n,)`; with a wrench frame `q, v, a, wrench -> (n,)`.
    InverseDynamics,
    /// `q, v, tau -> (n,)`; with a wrench frame `q, v, tau, wrench -> (n,)`.
    ForwardDynamics,
    /// `q, v, v_r, a_r -> (n, p)`.
    Regressor,
    /// `q, v -> (2,)`: kinetic, potential.
    Energy,
    /// `q -> (4, 4)`.
    Pose,
    /// `q -> (3,)`.
    Position,
    /// `q -> (6, n)`.
    Jacobian,
    /// `q, v -> (6, n)`.
    JacobianDot,
    /// `q -> (3,)`.
    Com,
    /// `q -> (3, n)`.
    ComJacobian,
    /// `q, v, a -> (2 n, n)`: `d tau / d q` over `d tau / d v`; `d tau / d a` is the mass matrix.
    InverseDynamicsDerivatives,
    /// `q, v, tau -> (3 n, n)`: `d a / d q` over `d a / d v` over `d a / d tau`.
    ForwardDynamicsDerivatives,
}

/// A quantity with its options.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Query {
    pub quantity: Quantity,
    /// Of pose, position, Jacobian and its rate.
    pub frame: usize,
    /// Where the wrench `[f; n]` (world axes, at the frame origin) of inverse and forward dynamics acts.
    pub wrench: Option<usize>,
    /// Add damping and Coulomb friction to bias and inverse dynamics, take them off the torque in forward
    /// dynamics; in the regressor append columns `diag(v_r)` and `diag(sign v)`.
    pub friction: bool,
    /// In the regressor append columns `diag(a_r)`, before those of friction.
    pub armature: bool,
}

impl From<Quantity> for Query {
    fn from(quantity: Quantity) -> Self {
        Query { quantity, frame: 0, wrench: None, friction: false, armature: false }
    }
}

impl Query {
    /// Names of the inputs.
    pub fn inputs(&self) -> &'static [&'static str] {
        match (self.quantity, self.wrench.is_some()) {
            (Quantity::InverseDynamics, true) => &["q", "v", "a", "wrench"],
            (Quantity::InverseDynamics, false) => &["q", "v", "a"],
            (Quantity::ForwardDynamics, true) => &["q", "v", "tau", "wrench"],
            (Quantity::ForwardDynamics, false) => &["q", "v", "tau"],
            (Quantity::InverseDynamicsDerivatives, _) => &["q", "v", "a"],
            (Quantity::ForwardDynamicsDerivatives, _) => &["q", "v", "tau"],
            (Quantity::Regressor, _) => &["q", "v", "v_r", "a_r"],
            (Quantity::CoriolisMatrix | Quantity::Bias | Quantity::Energy | Quantity::JacobianDot, _) => &["q", "v"],
            _ => &["q"],
        }
    }

    /// Numbers per configuration of an input.
    pub fn input_length(&self, input: usize, n: usize) -> usize {
        if self.inputs()[input] == "wrench" { 6 } else { n }
    }

    /// Rows and columns of the output; one row for vectors.
    pub fn shape(&self, n: usize) -> (usize, usize) {
        match self.quantity {
            Quantity::MassMatrix | Quantity::CoriolisMatrix => (n, n),
            Quantity::Gravity | Quantity::Bias | Quantity::InverseDynamics | Quantity::ForwardDynamics => (1, n),
            Quantity::Regressor => (n, n * (PARAMETERS + usize::from(self.armature) + 2 * usize::from(self.friction))),
            Quantity::Energy => (1, 2),
            Quantity::Pose => (4, 4),
            Quantity::Position | Quantity::Com => (1, 3),
            Quantity::Jacobian | Quantity::JacobianDot => (6, n),
            Quantity::ComJacobian => (3, n),
            Quantity::InverseDynamicsDerivatives => (2 * n, n),
            Quantity::ForwardDynamicsDerivatives => (3 * n, n),
        }
    }

    fn length(&self, n: usize) -> usize {
        let (rows, columns) = self.shape(n);
        rows * columns
    }
}

/// What friction leaves of a torque.
#[inline(always)]
fn take_friction<S: Real>(query: &Query, tree: &Tree<S>, v: &[S], tau: &mut [S]) {
    if query.friction {
        for (i, body) in tree.bodies.iter().enumerate() {
            let viscous = S::splat(body.damping).neg_mul_add(v[i], tau[i]);
            tau[i] = S::splat(body.friction).neg_mul_add(sign(v[i]), viscous);
        }
    }
}

/// Buffers of one number type.
#[derive(Clone, Debug)]
struct Engine<S> {
    tree: Tree<S>,
    ws: Workspace<S>,
    trig: Vec<(S, S)>,
    inputs: [Vec<S>; 4],
    out: Vec<S>,
    square: Vec<S>,
}

impl<S: Real> Engine<S> {
    fn new(arm: &Arm) -> Self {
        let tree = Tree::new(arm);
        let (n, ws) = (tree.n(), Workspace::new(&tree));
        let zeros = |k: usize| vec![S::zero(); k];
        let largest = (n * n * (PARAMETERS + 3)).max(6 * n).max(16);
        Engine {
            ws,
            trig: vec![(S::zero(), S::zero()); n],
            inputs: std::array::from_fn(|_| zeros(n.max(6))),
            out: zeros(largest),
            square: zeros(n * n),
            tree,
        }
    }

    /// `out` from `inputs`. `OP` is the quantity, known at compile time so that each has its own region.
    #[inline(always)]
    fn compute<const OP: u8>(&mut self, query: &Query) {
        let Engine { tree, ws, trig, inputs, out, square } = self;
        let n = tree.n();
        let [q, v, x, y] = inputs;
        for i in 0..n {
            trig[i] = q[i].sin_cos();
        }
        let (trig, q, v, x) = (&trig[..n], &q[..n], &v[..n], &mut x[..n]);
        let out = &mut out[..query.length(n)];
        let one = S::splat(1.0);
        match OP {
            op if op == Quantity::MassMatrix as u8 => tree.mass_matrix(ws, trig, q, out),
            op if op == Quantity::CoriolisMatrix as u8 => tree.coriolis_matrix(ws, trig, q, v, out),
            op if op == Quantity::Gravity as u8 => tree.gravity(ws, trig, q, out),
            op if op == Quantity::Bias as u8 => {
                tree.bias(ws, trig, q, v, out);
                if query.friction {
                    add_friction(tree, v, out);
                }
            }
            op if op == Quantity::InverseDynamics as u8 => {
                tree.inverse_dynamics(ws, trig, q, v, x, out);
                if query.friction {
                    add_friction(tree, v, out);
                }
                if let Some(frame) = query.wrench {
                    kin::place(tree, trig, q, &mut ws.poses);
                    add_wrench(tree, &ws.poses, frame, std::array::from_fn(|k| y[k]), -one, out);
                }
            }
            op if op == Quantity::ForwardDynamics as u8 => {
                take_friction(query, tree, v, x);
                if let Some(frame) = query.wrench {
                    kin::place(tree, trig, q, &mut ws.poses);
                    add_wrench(tree, &ws.poses, frame, std::array::from_fn(|k| y[k]), one, x);
                }
                tree.forward_dynamics(ws, trig, q, v, x, out);
            }
            op if op == Quantity::Regressor as u8 => {
                let (_, width) = query.shape(n);
                regressor::regressor(tree, width, &mut ws.poses, &mut ws.links, trig, q, v, x, &y[..n], out);
                for i in 0..n {
                    let mut at = i * width + PARAMETERS * n + i;
                    if query.armature {
                        out[at] = y[i];
                        at += n;
                    }
                    if query.friction {
                        (out[at], out[at + n]) = (x[i], sign(v[i]));
                    }
                }
            }
            op if op == Quantity::Energy as u8 => (out[0], out[1]) = tree.energy(ws, trig, q, v),
            op if op == Quantity::Pose as u8 => {
                let (r, p) = kin::frame_pose(tree, &mut ws.poses, trig, q, query.frame);
                for k in 0..3 {
                    (out[4 * k], out[4 * k + 1], out[4 * k + 2], out[4 * k + 3]) = (r.0[0][k], r.0[1][k], r.0[2][k], p[k]);
                    out[12 + k] = S::zero();
                }
                out[15] = one;
            }
            op if op == Quantity::Position as u8 => {
                out.copy_from_slice(&kin::frame_pose(tree, &mut ws.poses, trig, q, query.frame).1.0);
            }
            op if op == Quantity::Jacobian as u8 => {
                kin::jacobian(tree, &mut ws.poses, trig, q, query.frame, out);
            }
            op if op == Quantity::JacobianDot as u8 => {
                kin::jacobian_dot(tree, &mut ws.poses, &mut ws.motion, trig, q, v, query.frame, out);
            }
            op if op == Quantity::Com as u8 => out.copy_from_slice(&kin::com(tree, &mut ws.poses, trig, q).1.0),
            op if op == Quantity::InverseDynamicsDerivatives as u8 => {
                let (by_q, by_v) = out.split_at_mut(n * n);
                derivatives::inverse_dynamics_by_q(tree, ws, trig, q, v, x, by_q);
                derivatives::inverse_dynamics_by_v(tree, ws, trig, q, v, query.friction, by_v);
            }
            op if op == Quantity::ForwardDynamicsDerivatives as u8 => {
                take_friction(query, tree, v, x);
                let (by_q, rest) = out.split_at_mut(n * n);
                let (by_v, by_tau) = rest.split_at_mut(n * n);
                tree.forward_dynamics(ws, trig, q, v, x, &mut y[..n]);
                derivatives::forward_dynamics_derivatives(tree, ws, trig, q, v, &y[..n], query.friction, square, by_q, by_v, by_tau);
            }
            _ => kin::com_jacobian(tree, &mut ws.poses, &mut ws.subtrees, trig, q, out),
        }
    }

    /// Configurations `first..last` of the arrays, `S::LANES` at a time; the last lanes repeat the last one.
    #[inline(always)]
    fn rows<const OP: u8>(&mut self, query: &Query, inputs: &[&[f64]], first: usize, last: usize, out: &mut [f64]) {
        let n = self.tree.n();
        let length = query.length(n);
        let mut at = first;
        while at < last {
            for (k, given) in inputs.iter().enumerate() {
                let width = query.input_length(k, n);
                for i in 0..width {
                    self.inputs[k][i] = S::from_lanes(|lane| given[(at + lane).min(last - 1) * width + i]);
                }
            }
            self.compute::<OP>(query);
            let rows = &mut out[(at - first) * length..];
            if last - at >= S::LANES {
                // Value by value, all lanes of one: a lane chosen at run time would go through memory each time.
                let rows = &mut rows[..S::LANES * length];
                for (k, from) in self.out[..length].iter().enumerate() {
                    for lane in 0..S::LANES {
                        rows[lane * length + k] = from.lane(lane);
                    }
                }
            } else {
                for (k, to) in rows.iter_mut().enumerate() {
                    *to = self.out[k % length].lane(k / length);
                }
            }
            at += S::LANES;
        }
    }

    fn dispatch(&mut self, query: &Query, inputs: &[&[f64]], first: usize, last: usize, out: &mut [f64]) {
        macro_rules! each {
            ($($name:ident)*) => {
                match query.quantity {
                    $(Quantity::$name => S::enter(Rows::<S, { Quantity::$name as u8 }> { engine: self, query, inputs, first, last, out }),)*
                }
            };
        }
        each!(MassMatrix CoriolisMatrix Gravity Bias InverseDynamics ForwardDynamics Regressor Energy Pose Position Jacobian JacobianDot Com ComJacobian InverseDynamicsDerivatives ForwardDynamicsDerivatives)
    }
}

struct Rows<'a, S, const OP: u8> {
    engine: &'a mut Engine<S>,
    query: &'a Query,
    inputs: &'a [&'a [f64]],
    first: usize,
    last: usize,
    out: &'a mut [f64],
}

impl<S: Real, const OP: u8> Kernel for Rows<'_, S, OP> {
    type Output = ();
    #[inline(always)]
    fn run(self) {
        self.engine.rows::<OP>(self.query, self.inputs, self.first, self.last, self.out);
    }
}

/// Rows in lanes, buffers included.
struct Lanes<'a> {
    arm: &'a Arm,
    query: &'a Query,
    inputs: &'a [&'a [f64]],
    first: usize,
    last: usize,
    out: &'a mut [f64],
}

impl Task for Lanes<'_> {
    type Output = ();
    fn run<S: Real>(self) {
        Engine::<S>::new(self.arm).dispatch(self.query, self.inputs, self.first, self.last, self.out);
    }
}

#[derive(Clone, Debug)]
enum Route {
    Baseline(Box<Engine<f64>>),
    Fused(Box<Engine<Fused>>),
}

/// One configuration after another, without allocating.
#[derive(Clone, Debug)]
pub struct Evaluator {
    route: Route,
    n: usize,
    frames: usize,
}

impl Evaluator {
    pub fn new(arm: &Arm) -> Self {
        let route = match isa() {
            Isa::Baseline => Route::Baseline(Box::new(Engine::new(arm))),
            Isa::Avx2 | Isa::Avx512 => Route::Fused(Box::new(Engine::new(arm))),
        };
        Evaluator { route, n: arm.n(), frames: arm.frames.len() }
    }

    /// One configuration. Inputs as [`Query::inputs`] names them, `out` of [`Query::shape`], row-major.
    pub fn one(&mut self, query: &Query, inputs: &[&[f64]], out: &mut [f64]) -> Result<()> {
        check(query, inputs, 1, self.n, self.frames, out.len())?;
        match &mut self.route {
            Route::Baseline(engine) => engine.dispatch(query, inputs, 0, 1, out),
            Route::Fused(engine) => engine.dispatch(query, inputs, 0, 1, out),
        }
        Ok(())
    }
}

impl Arm {
    /// Configurations `first..last` of `count`, in lanes on the calling thread: inputs `(count, n)` in full, `out` of
    /// the rows asked for. Which rows share a call does not change their bits.
    pub fn evaluate(&self, query: &Query, inputs: &[&[f64]], count: usize, first: usize, last: usize, out: &mut [f64]) -> Result<()> {
        if first > last || last > count {
            return Err(Error::input("rows", format!("is out of range: expected 0 <= first <= last <= {count}, got {first}..{last}")));
        }
        let frames = self.frames.len();
        check(query, inputs, count, self.n(), frames, out.len() + (count - (last - first)) * query.length(self.n()))?;
        if first < last {
            run_lanes(Lanes { arm: self, query, inputs, first, last, out });
        }
        Ok(())
    }
}

fn check(query: &Query, inputs: &[&[f64]], count: usize, n: usize, frames: usize, out: usize) -> Result<()> {
    let names = query.inputs();
    if inputs.len() != names.len() {
        return Err(Error::input(
            "inputs",
            format!("has the wrong length: expected {} ({}), got {}", names.len(), names.join(", "), inputs.len()),
        ));
    }
    for (k, (name, given)) in names.iter().zip(inputs).enumerate() {
        let want = count * query.input_length(k, n);
        if given.len() != want {
            return Err(Error::input(*name, format!("has the wrong length: expected {want}, got {}", given.len())));
        }
        finite(name, given)?;
    }
    let needs_frame = matches!(query.quantity, Quantity::Pose | Quantity::Position | Quantity::Jacobian | Quantity::JacobianDot);
    let frame = if needs_frame { query.frame } else { query.wrench.unwrap_or(0) };
    if (needs_frame || query.wrench.is_some()) && frame >= frames {
        return Err(Error::input("frame", format!("is out of range: expected an index below {frames}, got {frame}")));
    }
    let want = count * query.length(n);
    if out != want {
        return Err(Error::input("out", format!("has the wrong length: expected {want}, got {out}")));
    }
    Ok(())
}
