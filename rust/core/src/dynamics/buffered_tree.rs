//! The tree of an arm with the buffers of a query.

use super::{Quantity, Query, Workspace};
use crate::arm::{Arm, Tree};
use crate::error::Result;
use crate::memory;
use crate::scalar::Real;
use crate::spatial::PARAMETERS;

/// Largest size of an arm's results, in numbers (8 MB), for which memory is allocated in advance. Larger results are allocated at the first
/// query.
const EAGER: usize = 1 << 20;

/// The tree of an arm and the buffers, on one number type.
#[derive(Clone, Debug)]
pub struct BufferedTree<S: Real> {
    pub tree: Tree<S>,
    pub ws: Workspace<S>,
    pub trig: Vec<(S, S)>,
    pub inputs: [Vec<S>; 4],
    pub out: Vec<S>,
    pub square: Vec<S>,
    /// The query whose result is in `out`. Entries that a query does not write are zero at every state, so only a different query sets
    /// `out` to zero.
    answered: Option<Query>,
}

impl<S: Real> BufferedTree<S> {
    /// Create the buffers. With `eager`, allocate memory for all results but Christoffel symbols, if the largest has at most `EAGER`
    /// numbers. Otherwise the first query allocates the memory.
    pub fn new(arm: &Arm, eager: bool) -> Self {
        let tree = Tree::new(arm);
        let (n, ws) = (tree.n(), Workspace::new(&tree));
        let zeros = |k: usize| memory::copies(k, S::zero());
        let largest = (n * (PARAMETERS * tree.bodies.len() + 3 * n)).max(6 * n).max(16).max(16 * tree.bodies.len());
        let eager = eager && largest <= EAGER;
        BufferedTree {
            ws,
            trig: memory::copies(n, (S::zero(), S::zero())),
            inputs: std::array::from_fn(|_| zeros(n.max(6))),
            out: zeros(if eager { largest } else { 0 }),
            square: zeros(if eager { n * n } else { 0 }),
            answered: None,
            tree,
        }
    }

    /// Allocate memory for a query, or return an error with its size.
    pub fn grow(&mut self, query: &Query) -> Result<()> {
        let (n, size) = (self.tree.n(), self.tree.size());
        let square = if matches!(query.quantity, Quantity::ForwardDynamicsDerivatives | Quantity::Christoffel) { n * n } else { 0 };
        memory::enlarge(&mut self.out, query.length(size), S::zero())?;
        memory::enlarge(&mut self.square, square, S::zero())
    }

    /// Compute sine and cosine of every coordinate.
    #[inline]
    pub fn turn(&mut self) {
        for (trig, q) in self.trig.iter_mut().zip(&self.inputs[0]) {
            *trig = q.sin_cos();
        }
    }

    pub fn reserve_for(&mut self, query: &Query) {
        if self.answered != Some(*query) {
            memory::set(&mut self.out[..query.length(self.tree.size())], S::zero());
            self.answered = Some(*query);
        }
    }
}
