//! The quantities of an arm as functions from `f64` arrays to `f64` arrays: one configuration by the scalar route of
//! this machine, or many in its lanes. What a binding needs, and no more: shapes are checked here once, threads and
//! outputs are the caller's.

use super::quantities::{self, Compute};
use super::regressor_rows::regressor_rows;
use super::{Quantity, Query, Workspace};
use crate::arm::{Arm, Tree};
use crate::error::{Error, Result, finite};
use crate::scalar::rows::{read_one, read_rows, write_rows};
use crate::scalar::{Fused, Isa, Kernel, Real, Task, isa, run_lanes};
use crate::spatial::PARAMETERS;
use std::marker::PhantomData;

/// Numbers that an arm's answers may take before room is made for them only when they are asked for: 8 MB.
const EAGER: usize = 1 << 20;

/// Buffers of one number type.
#[derive(Clone, Debug)]
pub(super) struct Engine<S> {
    pub(super) tree: Tree<S>,
    pub(super) ws: Workspace<S>,
    pub(super) trig: Vec<(S, S)>,
    pub(super) inputs: [Vec<S>; 4],
    pub(super) out: Vec<S>,
    pub(super) square: Vec<S>,
    /// What `out` holds an answer to: where that vanishes in every state it need not be zeroed again.
    answered: Option<Query>,
    /// Rows of regressors that are fewer than lanes.
    pub(super) rows: Vec<f64>,
}

impl<S: Real> Engine<S> {
    /// With room for every answer, or, of a lane engine and of an arm of very many joints, for none yet.
    fn new(arm: &Arm, eager: bool) -> Self {
        let tree = Tree::new(arm);
        let (n, ws) = (tree.n(), Workspace::new(&tree));
        let zeros = |k: usize| vec![S::zero(); k];
        let largest = (n * n * (PARAMETERS + 3)).max(6 * n).max(16);
        let eager = eager && largest <= EAGER;
        Engine {
            ws,
            trig: vec![(S::zero(), S::zero()); n],
            inputs: std::array::from_fn(|_| zeros(n.max(6))),
            out: zeros(if eager { largest } else { 0 }),
            square: zeros(if eager { n * n } else { 0 }),
            answered: None,
            rows: Vec::new(),
            tree,
        }
    }

    /// Room for what is asked, or an error that says how much it would be.
    fn grow(&mut self, query: &Query) -> Result<()> {
        let n = self.tree.n();
        let square = if query.quantity == Quantity::ForwardDynamicsDerivatives { n * n } else { 0 };
        if S::LANES > 1 && query.quantity == Quantity::Regressor {
            return enlarge(&mut self.rows, S::LANES * query.length(n), 0.0);
        }
        enlarge(&mut self.out, query.length(n), S::zero())?;
        enlarge(&mut self.square, square, S::zero())
    }

    /// All configurations of the arrays, `S::LANES` at a time; the last lanes repeat the last one. A single number takes one
    /// configuration. Whether the arguments are what is asked for, and every number finite; alone, every number of the arguments too.
    #[inline(always)]
    fn rows<Q: Compute>(&mut self, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> bool {
        // Known here while compiling, so that what depends on it is decided then.
        let query = &Query { quantity: Q::QUANTITY, ..*query };
        let n = self.tree.n();
        let fits = query.fits(inputs, count, n, self.tree.frames.len(), out.len());
        if !fits || S::LANES == 1 && count != 1 {
            return false;
        }
        if S::LANES > 1 && Q::QUANTITY == Quantity::Regressor {
            return regressor_rows(self, query, inputs, count, out);
        }
        if self.answered != Some(*query) {
            self.out[..query.length(n)].fill(S::zero());
            self.answered = Some(*query);
        }
        if S::LANES == 1 { self.alone::<Q>(query, inputs, out) } else { self.side_by_side::<Q>(query, inputs, count, out) }
    }

    #[inline(always)]
    fn alone<Q: Compute>(&mut self, query: &Query, inputs: &[&[f64]], out: &mut [f64]) -> bool {
        let n = self.tree.n();
        let mut sound = true;
        for k in 0..query.inputs().len() {
            sound &= read_one(inputs[k], &mut self.inputs[k][..query.input_length(k, n)]);
        }
        if !sound {
            return false;
        }
        S::sin_cos_each(&self.inputs[0][..n], &mut self.trig[..n]);
        Q::answer(self, query, out)
    }

    #[inline(always)]
    fn side_by_side<Q: Compute>(&mut self, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> bool {
        let n = self.tree.n();
        let length = query.length(n);
        let (mut at, mut sound) = (0, true);
        while at < count {
            for (k, given) in inputs.iter().enumerate() {
                let width = query.input_length(k, n);
                read_rows(given, at, count, width, &mut self.inputs[k][..width]);
            }
            S::sin_cos_each(&self.inputs[0][..n], &mut self.trig[..n]);
            Q::compute(self, query);
            sound &= write_rows(&self.out[..length], &mut out[at * length..]);
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

    /// As [`Engine::dispatch`], of one configuration, derivatives included.
    fn dispatch_single(&mut self, query: &Query, inputs: &[&[f64]], out: &mut [f64]) -> bool {
        let (quantity, count) = (PhantomData, 1);
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

/// At least so many numbers, or an error that says how much memory they are.
fn enlarge<T: Copy>(buffer: &mut Vec<T>, length: usize, fill: T) -> Result<()> {
    if buffer.len() < length {
        let bytes = length as u128 * size_of::<T>() as u128;
        buffer.try_reserve_exact(length - buffer.len()).map_err(|_| Error::Memory { bytes })?;
        buffer.resize(length, fill);
    }
    Ok(())
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
        Box::new(Engine::<S>::new(self.0, false))
    }
}

/// An engine whose number is known at run time only.
trait LaneRows: Send {
    fn rows(&mut self, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> Result<bool>;
}

impl<S: Real> LaneRows for Engine<S> {
    fn rows(&mut self, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> Result<bool> {
        self.grow(query)?;
        Ok(self.dispatch(query, inputs, count, out))
    }
}

/// Many configurations in lanes, with buffers that last: they grow with the largest answer asked for.
pub struct LaneEvaluator {
    engine: Box<dyn LaneRows>,
    single: Evaluator,
}

impl LaneEvaluator {
    pub fn new(arm: &Arm) -> Self {
        LaneEvaluator { engine: run_lanes(MakeLanes(arm)), single: Evaluator::sized(arm, false) }
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
            return self.single.each(query, rows, last - first, out);
        }
        self.engine.rows(query, rows, last - first, out)
    }
}

#[derive(Clone, Debug)]
enum Route {
    Baseline(Box<Engine<f64>>),
    Fused(Box<Engine<Fused>>),
}

/// One configuration after another, without allocating for arms of up to two hundred joints.
#[derive(Clone, Debug)]
pub struct Evaluator {
    route: Route,
    n: usize,
    frames: usize,
}

impl Evaluator {
    pub fn new(arm: &Arm) -> Self {
        Evaluator::sized(arm, true)
    }

    fn sized(arm: &Arm, eager: bool) -> Self {
        let route = match isa() {
            Isa::Baseline => Route::Baseline(Box::new(Engine::new(arm, eager))),
            Isa::Avx2 | Isa::Avx512 => Route::Fused(Box::new(Engine::new(arm, eager))),
        };
        Evaluator { route, n: arm.n(), frames: arm.frames.len() }
    }

    /// One configuration. Inputs as [`Query::inputs`] names them, `out` of [`Query::shape`], row-major. Whether every
    /// number of the answer is finite: a singular mass matrix and an overflow are told so.
    pub fn one(&mut self, query: &Query, inputs: &[&[f64]], out: &mut [f64]) -> Result<bool> {
        let sound = match &mut self.route {
            Route::Baseline(engine) => engine.grow(query).map(|()| engine.dispatch_single(query, inputs, out)),
            Route::Fused(engine) => engine.grow(query).map(|()| engine.dispatch_single(query, inputs, out)),
        }?;
        if !sound {
            check(query, inputs, 1, self.n, self.frames, out.len())?;
        }
        Ok(sound)
    }

    /// Configuration by configuration: inputs and room were checked.
    fn each(&mut self, query: &Query, inputs: &[&[f64]], count: usize, out: &mut [f64]) -> Result<bool> {
        let (length, mut sound) = (query.length(self.n), true);
        for i in 0..count {
            let mut row: [&[f64]; 4] = [&[]; 4];
            for (k, given) in inputs.iter().enumerate() {
                let width = query.input_length(k, self.n);
                row[k] = &given[i * width..][..width];
            }
            sound &= self.one(query, &row[..inputs.len()], &mut out[i * length..][..length])?;
        }
        Ok(sound)
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
    let frame = if query.is_framed() { query.frame } else { query.wrench.unwrap_or(0) };
    if (query.is_framed() || query.wrench.is_some()) && frame >= frames {
        return Err(Error::input("frame", format!("is out of range: expected an index below {frames}, got {frame}")));
    }
    let want = count * query.length(n);
    if out != want {
        return Err(Error::input("out", format!("has the wrong length: expected {want}, got {out}")));
    }
    Ok(())
}
