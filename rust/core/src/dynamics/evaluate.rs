//! The quantities of an arm as functions from `f64` arrays to `f64` arrays: one configuration by the scalar route of
//! this machine, or many in its lanes. What a binding needs, and no more: shapes are checked here once, threads and
//! outputs are the caller's.

use super::Workspace;
use super::quantities::{self, Compute};
use crate::arm::{Arm, Tree};
use crate::error::{Error, Result, finite};
use crate::scalar::rows::{read_rows, write_rows};
use crate::scalar::{Fused, Isa, Kernel, Real, Task, isa, run_lanes};
use crate::spatial::PARAMETERS;
use std::marker::PhantomData;

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
    /// `q, v, a -> (3 n, n)`: `d tau / d q` over `d tau / d v` over `d tau / d a = M`.
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
            Quantity::InverseDynamicsDerivatives | Quantity::ForwardDynamicsDerivatives => (3 * n, n),
        }
    }

    pub(super) fn length(&self, n: usize) -> usize {
        let (rows, columns) = self.shape(n);
        rows * columns
    }

    /// About how long one of many configurations takes on this machine, ns: good enough to choose how to run them.
    pub fn nanoseconds(&self, n: usize) -> f64 {
        let (joints, numbers) = (n as f64, self.length(n) as f64);
        let singly = matches!(self.quantity, Quantity::InverseDynamicsDerivatives | Quantity::ForwardDynamicsDerivatives);
        let in_lanes = if singly { 100.0 * joints + 10.0 * numbers } else { 8.0 * joints + 0.3 * numbers };
        let slower = match isa() {
            Isa::Baseline => 4.0,
            Isa::Avx2 => 2.0,
            Isa::Avx512 => 1.0,
        };
        10.0 + slower * in_lanes
    }
}

/// Buffers of one number type.
#[derive(Clone, Debug)]
pub(super) struct Engine<S> {
    pub(super) tree: Tree<S>,
    pub(super) ws: Workspace<S>,
    pub(super) trig: Vec<(S, S)>,
    pub(super) inputs: [Vec<S>; 4],
    pub(super) out: Vec<S>,
    pub(super) square: Vec<S>,
    /// Long rows on their way to memory.
    stage: Vec<f64>,
}

impl<S: Real> Engine<S> {
    /// For answers of up to `largest` numbers.
    fn new(arm: &Arm, largest: usize) -> Self {
        let tree = Tree::new(arm);
        let (n, ws) = (tree.n(), Workspace::new(&tree));
        let zeros = |k: usize| vec![S::zero(); k];
        Engine {
            ws,
            trig: vec![(S::zero(), S::zero()); n],
            inputs: std::array::from_fn(|_| zeros(n.max(6))),
            out: zeros(largest),
            square: zeros(n * n),
            stage: Vec::new(),
            tree,
        }
    }

    /// All configurations of the arrays, `S::LANES` at a time; the last lanes repeat the last one. Whether every
    /// number of the answer is finite.
    #[inline(always)]
    fn rows<Q: Compute>(&mut self, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> bool {
        let n = self.tree.n();
        let length = query.length(n);
        let (mut at, mut sound) = (0, true);
        self.out[..length].fill(S::zero());
        while at < count {
            for (k, given) in inputs.iter().enumerate() {
                let width = query.input_length(k, n);
                read_rows(given, at, count, width, &mut self.inputs[k][..width]);
            }
            for i in 0..n {
                self.trig[i] = self.inputs[0][i].sin_cos();
            }
            Q::compute(self, query);
            sound &= write_rows(&self.out[..length], &mut self.stage, &mut out[at * length..]);
            at += S::LANES;
        }
        sound
    }

    /// Each quantity in its own region. Derivatives are for single numbers: in lanes they are slower than one by one.
    fn dispatch(&mut self, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> bool {
        macro_rules! each {
            ($($name:ident)*) => {
                match query.quantity {
                    $(Quantity::$name => S::enter(Rows::<S, quantities::$name> { engine: self, query, inputs, count, out, quantity: PhantomData }),)*
                    Quantity::InverseDynamicsDerivatives | Quantity::ForwardDynamicsDerivatives => unreachable!("derivatives go one by one"),
                }
            };
        }
        each!(MassMatrix CoriolisMatrix Gravity Bias InverseDynamics ForwardDynamics Regressor Energy Pose Position Jacobian JacobianDot Com ComJacobian)
    }

    /// As [`Engine::dispatch`], derivatives included.
    fn dispatch_single(&mut self, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> bool {
        let quantity = PhantomData;
        match query.quantity {
            Quantity::InverseDynamicsDerivatives => {
                S::enter(Rows::<S, quantities::InverseDynamicsDerivatives> { engine: self, query, inputs, count, out, quantity })
            }
            Quantity::ForwardDynamicsDerivatives => {
                let quantity = PhantomData;
                S::enter(Rows::<S, quantities::ForwardDynamicsDerivatives> { engine: self, query, inputs, count, out, quantity })
            }
            _ => self.dispatch(query, inputs, count, out),
        }
    }
}

struct Rows<'a, S, Q> {
    engine: &'a mut Engine<S>,
    query: &'a Query,
    inputs: &'a [&'a [f64]],
    count: usize,
    out: &'a mut [f64],
    quantity: PhantomData<Q>,
}

impl<S: Real, Q: Compute> Kernel for Rows<'_, S, Q> {
    type Output = bool;
    #[inline(always)]
    fn run(self) -> bool {
        self.engine.rows::<Q>(self.query, self.inputs, self.count, self.out)
    }
}

/// The buffers of the lanes that this machine has.
struct MakeLanes<'a>(&'a Arm);

impl Task for MakeLanes<'_> {
    type Output = Box<dyn LaneRows>;
    fn run<S: Real>(self) -> Box<dyn LaneRows> {
        Box::new(Engine::<S>::new(self.0, 0))
    }
}

/// An engine whose number is known at run time only.
trait LaneRows: Send {
    fn rows(&mut self, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> bool;
}

impl<S: Real> LaneRows for Engine<S> {
    fn rows(&mut self, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> bool {
        let length = query.length(self.tree.n());
        if self.out.len() < length {
            self.out.resize(length, S::zero());
        }
        self.dispatch(query, inputs, count, out)
    }
}

/// Many configurations in lanes, with buffers that last: they grow with the largest answer asked for.
pub struct LaneEvaluator {
    engine: Box<dyn LaneRows>,
    single: Evaluator,
}

impl LaneEvaluator {
    pub fn new(arm: &Arm) -> Self {
        LaneEvaluator { engine: run_lanes(MakeLanes(arm)), single: Evaluator::sized(arm, 3 * arm.n() * arm.n()) }
    }

    /// As [`Arm::evaluate`], of the arm that this was made for.
    pub fn rows(&mut self, query: &Query, inputs: &[&[f64]], count: usize, first: usize, last: usize, out: &mut [f64]) -> Result<bool> {
        if first > last || last > count {
            return Err(Error::input("rows", format!("is out of range: expected 0 <= first <= last <= {count}, got {first}..{last}")));
        }
        let n = self.single.n;
        check_lengths(query, inputs, count, n)?;
        let mut rows: [&[f64]; 4] = [&[]; 4];
        for (k, given) in inputs.iter().enumerate() {
            let width = query.input_length(k, n);
            rows[k] = &given[first * width..last * width];
        }
        let rows = &rows[..inputs.len()];
        check(query, rows, last - first, n, self.single.frames, out.len())?;
        if first == last {
            return Ok(true);
        }
        if matches!(query.quantity, Quantity::InverseDynamicsDerivatives | Quantity::ForwardDynamicsDerivatives) {
            return Ok(self.single.dispatch(query, rows, last - first, out));
        }
        Ok(self.engine.rows(query, rows, last - first, out))
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
        let n = arm.n();
        Evaluator::sized(arm, (n * n * (PARAMETERS + 3)).max(6 * n).max(16))
    }

    fn sized(arm: &Arm, largest: usize) -> Self {
        let route = match isa() {
            Isa::Baseline => Route::Baseline(Box::new(Engine::new(arm, largest))),
            Isa::Avx2 | Isa::Avx512 => Route::Fused(Box::new(Engine::new(arm, largest))),
        };
        Evaluator { route, n: arm.n(), frames: arm.frames.len() }
    }

    /// One configuration. Inputs as [`Query::inputs`] names them, `out` of [`Query::shape`], row-major. Whether every
    /// number of the answer is finite: a singular mass matrix and an overflow are told so.
    pub fn one(&mut self, query: &Query, inputs: &[&[f64]], out: &mut [f64]) -> Result<bool> {
        check(query, inputs, 1, self.n, self.frames, out.len())?;
        Ok(self.dispatch(query, inputs, 1, out))
    }

    fn dispatch(&mut self, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> bool {
        match &mut self.route {
            Route::Baseline(engine) => engine.dispatch_single(query, inputs, count, out),
            Route::Fused(engine) => engine.dispatch_single(query, inputs, count, out),
        }
    }
}

impl Arm {
    /// Configurations `first..last` of `count`, in lanes on the calling thread: inputs `(count, n)` in full, `out` of
    /// the rows asked for. Which rows share a call does not change their bits. Whether all of the answer is finite.
    pub fn evaluate(&self, query: &Query, inputs: &[&[f64]], count: usize, first: usize, last: usize, out: &mut [f64]) -> Result<bool> {
        LaneEvaluator::new(self).rows(query, inputs, count, first, last, out)
    }
}

fn check_lengths(query: &Query, inputs: &[&[f64]], count: usize, n: usize) -> Result<()> {
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
    }
    Ok(())
}

fn check(query: &Query, inputs: &[&[f64]], count: usize, n: usize, frames: usize, out: usize) -> Result<()> {
    check_lengths(query, inputs, count, n)?;
    for (name, given) in query.inputs().iter().zip(inputs) {
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
