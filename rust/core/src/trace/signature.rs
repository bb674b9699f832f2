//! The signature of a recorded function: named groups of inputs and of results, from which the slots of its frame follow.
//!
//! A frame has these slots in order: the set-up parameters, the inputs, the largest magnitude of an angle, and the results. A program uses
//! further slots for its intermediate values.

use super::straight::Scratch;
use super::sym::{self, Sym};
use std::ops::Range;

/// Consecutive slots of a frame: the numbers of one group.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Slots {
    pub first: usize,
    pub count: usize,
}

impl Slots {
    /// The slot after the last one.
    pub fn end(self) -> usize {
        self.first + self.count
    }

    /// Return the `count` slots from number `from` of this group on.
    pub fn part(self, from: usize, count: usize) -> Slots {
        Slots { first: self.first + from, count }
    }

    /// The indices of these slots in the numbers of a frame with `lanes` lanes.
    pub fn numbers(self, lanes: usize) -> Range<usize> {
        self.first * lanes..self.end() * lanes
    }

    /// The numbers of these inputs in a recording.
    pub fn inputs(self) -> Range<u32> {
        self.first as u32..self.end() as u32
    }

    /// Declare these slots as the next inputs of the recording of this thread.
    pub fn declare(self) -> Vec<Sym> {
        debug_assert_eq!(sym::recorded().1 as usize, self.first, "the inputs have the order of their slots");
        (0..self.count).map(|_| sym::input()).collect()
    }

    /// Pair the first of these slots with recorded operations, given by their indices `entries`: `(slot, index)`.
    pub fn outputs(self, entries: &[u32]) -> Vec<(u32, u32)> {
        (self.first as u32..).zip(entries.iter().copied()).collect()
    }
}

/// Named groups of inputs and results.
///
/// ```
/// use armlet_core::trace::Signature;
///
/// // One set-up parameter, a state of two numbers, a step size, and the next state.
/// let mut signature = Signature::new(1);
/// let (state, step) = (signature.input("state", 2), signature.input("step", 1));
/// let next = signature.output("next", 2);
/// assert_eq!([state.first, step.first, signature.angle(), next.first, signature.slots()], [1, 3, 4, 5, 7]);
/// ```
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Signature {
    inputs: Vec<Group>,
    outputs: Vec<Group>,
    angle: usize,
    slots: usize,
}

/// The name of a group, and its number of slots.
pub type Group = (&'static str, usize);

impl Signature {
    /// Return the signature of a function of `parameters` set-up parameters.
    pub fn new(parameters: usize) -> Self {
        Signature { inputs: Vec::new(), outputs: Vec::new(), angle: parameters, slots: parameters + 1 }
    }

    /// Add a group of inputs after the other inputs. Inputs are added before results.
    pub fn input(&mut self, name: &'static str, count: usize) -> Slots {
        assert!(self.outputs.is_empty(), "a result has a slot already");
        let slots = Slots { first: self.angle, count };
        self.inputs.push((name, count));
        (self.angle, self.slots) = (slots.end(), slots.end() + 1);
        slots
    }

    /// Add a group of results after the other results.
    pub fn output(&mut self, name: &'static str, count: usize) -> Slots {
        let slots = Slots { first: self.slots, count };
        self.outputs.push((name, count));
        self.slots = slots.end();
        slots
    }

    /// Return the signature without the results.
    pub fn of_inputs(&self) -> Self {
        Signature { inputs: self.inputs.clone(), outputs: Vec::new(), angle: self.angle, slots: self.angle + 1 }
    }

    /// The groups in the order of their slots, after the set-up parameters.
    pub fn groups(&self) -> impl Iterator<Item = Group> {
        self.inputs.iter().copied().chain([("largest_angle", 1)]).chain(self.outputs.iter().copied())
    }

    /// The slot of the largest magnitude of an angle, rad. The set-up parameters and the inputs are before it.
    pub fn angle(&self) -> usize {
        self.angle
    }

    /// The number of slots of all groups, with the set-up parameters.
    pub fn slots(&self) -> usize {
        self.slots
    }

    /// The slots of a program that may use the slots from `free` on for intermediate values.
    pub fn scratch(&self, free: usize) -> Scratch {
        Scratch { reach: self.angle as u32, free }
    }
}
