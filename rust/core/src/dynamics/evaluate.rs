//! The quantities of an arm as functions from `f64` arrays to `f64` arrays, one configuration after another. Language bindings use this
//! interface. The caller provides the outputs.

use super::buffered_tree::BufferedTree;
use super::quantities::{self, Compute};
use super::{Quantity, Query, Size};
use crate::arm::{Arm, require_memory};
use crate::error::{Error, Result, finite};
use crate::scalar::Real;
use crate::scalar::rows::read_one;

/// Expand to `$each`, in which `$name` is the type that computes the quantity of `$query`.
macro_rules! with_quantity {
    ($query:expr, $name:ident => $each:expr) => {
        with_quantity!(@ $query, $name, $each, MassMatrix CoriolisMatrix Christoffel Gravity Bias InverseDynamics ForwardDynamics Regressor Energy Pose PoseVector
            Position JointPoses Jacobian JacobianDot Com ComJacobian PathDynamics InverseDynamicsDerivatives ForwardDynamicsDerivatives)
    };
    (@ $query:expr, $name:ident, $each:expr, $($quantity:ident)*) => {
        match $query.quantity {
            $(Quantity::$quantity => {
                type $name = quantities::$quantity;
                $each
            })*
        }
    };
}

impl<S: Real> BufferedTree<S> {
    /// Compute one configuration. Return whether the arguments have the sizes of the query, and all arguments and results are finite.
    fn one<Q: Compute>(&mut self, query: &Query, inputs: &[&[f64]], out: &mut [f64]) -> bool {
        // The quantity is a constant here, so the compiler resolves the branches on it.
        let query = &Query { quantity: Q::QUANTITY, ..*query };
        let n = self.tree.n();
        let mut sound = query.fits(inputs, 1, self.tree.size(), self.tree.frames.len(), out.len());
        if !sound {
            return false;
        }
        self.reserve_for(query);
        for k in 0..query.inputs().len() {
            sound &= read_one(inputs[k], &mut self.inputs[k][..query.input_length(k, n)]);
        }
        if !sound {
            return false;
        }
        self.turn();
        Q::answer(self, query, out)
    }

    fn dispatch(&mut self, query: &Query, inputs: &[&[f64]], out: &mut [f64]) -> bool {
        with_quantity!(query, Q => self.one::<Q>(query, inputs, out))
    }

    /// Compute the result of `query` for the inputs in the buffers.
    pub(super) fn answer(&mut self, query: &Query) -> Result<&[S]> {
        self.grow(query)?;
        self.reserve_for(query);
        self.turn();
        with_quantity!(query, Q => Q::compute(self, query));
        Ok(&self.out[..query.length(self.tree.size())])
    }
}

/// An evaluator of one configuration after another. After its creation, it allocates memory only at the first query of Christoffel symbols,
/// and for arms of more than 284 joints.
#[derive(Clone, Debug)]
pub struct Evaluator {
    engine: Box<BufferedTree<f64>>,
    size: Size,
    frames: usize,
}

impl Evaluator {
    /// Create an evaluator of this arm, with its buffers.
    pub fn new(arm: &Arm) -> Self {
        Evaluator::sized(arm, true)
    }

    /// Create an evaluator of an arm of any size. Errors: `Memory` if the buffers do not fit in memory.
    pub(super) fn large(arm: &Arm) -> Result<Self> {
        require_memory(arm.joints.len())?;
        Ok(Evaluator::new(arm))
    }

    /// Create an evaluator. `eager`: as for [`BufferedTree::new`].
    pub(super) fn sized(arm: &Arm, eager: bool) -> Self {
        Evaluator { engine: Box::new(BufferedTree::new(arm, eager)), size: arm.size(), frames: arm.frames.len() }
    }

    /// Number of coordinates `n`: the number of joints that are not mimic joints.
    pub fn n(&self) -> usize {
        self.size.n
    }

    /// The numbers of coordinates and bodies.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Compute one configuration, and return whether every number is finite. This is false after an overflow. It is also false if the mass
    /// matrix in forward dynamics or its derivatives is singular.
    ///
    /// [`Query::inputs`] names the inputs, and `out` has the shape [`Query::shape`], row-major. Errors: `WrongShape` for a wrong
    /// size, `Input` for inputs that are not finite or a wrong index of a frame, `Memory`.
    pub fn one(&mut self, query: &Query, inputs: &[&[f64]], out: &mut [f64]) -> Result<bool> {
        self.engine.grow(query)?;
        let sound = self.engine.dispatch(query, inputs, out);
        if !sound {
            check(query, inputs, 1, self.size, self.frames, out.len())?;
        }
        Ok(sound)
    }
}

/// Check the sizes of inputs and output for `query` at `count` configurations. Check that every input is finite, and that the frame exists.
/// Errors: `WrongShape` for sizes, otherwise `Input`.
pub(super) fn check(query: &Query, inputs: &[&[f64]], count: usize, size: Size, frames: usize, out: usize) -> Result<()> {
    let names = query.inputs();
    if inputs.len() != names.len() {
        return Err(Error::wrong("inputs", "length", format!("{} ({})", names.len(), names.join(", ")), inputs.len()));
    }
    for (k, (name, given)) in names.iter().zip(inputs).enumerate() {
        let want = count * query.input_length(k, size.n);
        if given.len() != want {
            return Err(Error::wrong(*name, "length", want, given.len()));
        }
    }
    for (name, given) in query.inputs().iter().zip(inputs) {
        finite(name, given)?;
    }
    let frame = if query.is_framed() { query.frame } else { query.wrench.unwrap_or(0) };
    if (query.is_framed() || query.wrench.is_some()) && frame >= frames {
        return Err(Error::input("frame", format!("is out of range: expected an index below {frames}, got {frame}")));
    }
    let want = count * query.length(size);
    if out != want {
        return Err(Error::wrong("out", "length", want, out));
    }
    Ok(())
}
