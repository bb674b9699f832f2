//! Decisions: native code between two parts of a formula, such as a decomposition that branches on its numbers.
//!
//! A formula computes results that are valid in most cases, and a number that is one if they are valid. Where they are not, the native code
//! replaces them. A recording is divided at this place.

use super::tape::Op;
use std::fmt::Debug;
use std::sync::{Mutex, PoisonError};

/// Native code with its memory. It keeps nothing from one call to the next that could change its results.
pub trait Decision: Debug + Send + Sync {
    /// Replace the `results`. They are those of the formula, which are not valid for these `arguments`. The first argument is the number
    /// that is one for valid results.
    fn decide(&mut self, arguments: &[f64], results: &mut [f64]);
}

/// A kind of native code, with the sizes that determine its memory.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Kind {
    name: &'static str,
    sizes: Vec<usize>,
}

/// A function that allocates the memory of native code for some sizes.
pub type Make = fn(&[usize]) -> Box<dyn Decision>;

/// A function that records native code for some sizes as a formula, for exports without native code. It returns the operations, whose inputs
/// are the arguments, and the indices of the results. The results are NaN where the formula is not valid. `None`: there is no formula.
pub type ClosedForm = fn(&[usize]) -> Option<(Vec<Op>, Vec<u32>)>;

/// A function that prints native code for some sizes as a C function with this name. Its arguments are the arrays of the arguments and of
/// the results.
pub type Print = fn(&[usize], &str) -> String;

/// All that is known of a kind.
type Known = (Kind, Make, ClosedForm, Option<Print>);

/// All kinds so far. The index of a kind is its number.
static KINDS: Mutex<Vec<Known>> = Mutex::new(Vec::new());

/// Return the number of a kind of native code. `name` is unique for `make` and `closed`.
pub fn kind(name: &'static str, sizes: Vec<usize>, make: Make, closed: ClosedForm) -> u32 {
    kind_with_c(name, sizes, make, closed, None)
}

/// Return the number of a kind of native code as [`kind`]. With `print`, the native code exists in C too.
pub fn kind_with_c(name: &'static str, sizes: Vec<usize>, make: Make, closed: ClosedForm, print: Option<Print>) -> u32 {
    let kind = Kind { name, sizes };
    let mut kinds = KINDS.lock().unwrap_or_else(PoisonError::into_inner);
    let known = kinds.iter().position(|(known, ..)| *known == kind);
    known.unwrap_or_else(|| {
        kinds.push((kind, make, closed, print));
        kinds.len() - 1
    }) as u32
}

/// Return what is known of the kind with this number.
fn known(kind: u32) -> Known {
    KINDS.lock().unwrap_or_else(PoisonError::into_inner)[kind as usize].clone()
}

/// Record native code of a kind as a formula ([`ClosedForm`]).
pub fn closed_form(kind: u32) -> Option<(Vec<Op>, Vec<u32>)> {
    let (Kind { sizes, .. }, _, closed, _) = known(kind);
    closed(&sizes)
}

/// Whether native code of this kind exists in C.
pub fn has_c(kind: u32) -> bool {
    KINDS.lock().unwrap_or_else(PoisonError::into_inner)[kind as usize].3.is_some()
}

/// Print native code of this kind as a C function with this name. The result is empty if it does not exist in C.
pub fn printed(kind: u32, name: &str) -> String {
    let (Kind { sizes, .. }, _, _, print) = known(kind);
    print.map_or_else(String::new, |print| print(&sizes, name))
}

/// The memory of native code in one run.
#[derive(Debug, Default)]
pub struct Decisions(Vec<Allocated>);

#[derive(Debug)]
struct Allocated {
    kind: u32,
    decision: Box<dyn Decision>,
    arguments: Vec<f64>,
    results: Vec<f64>,
}

impl Clone for Decisions {
    fn clone(&self) -> Self {
        let mut copy = Decisions::default();
        for Allocated { kind, arguments, results, .. } in &self.0 {
            copy.allocate(*kind, (arguments.len(), results.len()));
        }
        copy
    }
}

impl Decisions {
    /// Allocate the memory of native code of a kind with this many arguments and results, unless it exists.
    pub fn allocate(&mut self, kind: u32, (arguments, results): (usize, usize)) -> usize {
        if let Some(at) = self.0.iter().position(|known| known.kind == kind) {
            let known = &mut self.0[at];
            known.arguments.resize(known.arguments.len().max(arguments), 0.0);
            known.results.resize(known.results.len().max(results), 0.0);
            return at;
        }
        let (Kind { sizes, .. }, make, ..) = known(kind);
        let decision = make(&sizes);
        self.0.push(Allocated { kind, decision, arguments: vec![0.0; arguments], results: vec![0.0; results] });
        self.0.len() - 1
    }

    /// Run the native code `at` of [`Decisions::allocate`] with these numbers of arguments and results. `read` writes the arguments and the
    /// results of the formula, and `write` receives the new results.
    pub fn run(
        &mut self,
        at: usize,
        (arguments, results): (usize, usize),
        read: impl FnOnce(&mut [f64], &mut [f64]),
        write: impl FnOnce(&[f64]),
    ) {
        let memory = &mut self.0[at];
        let (arguments, results) = (&mut memory.arguments[..arguments], &mut memory.results[..results]);
        let decision = &mut memory.decision;
        read(arguments, results);
        decision.decide(arguments, results);
        write(results);
    }
}
