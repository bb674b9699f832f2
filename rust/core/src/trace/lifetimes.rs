//! The positions at which a program reads each value, and the positions at which it stores its outputs.

use super::straight::{Instruction, Straight};
use std::collections::HashSet;

/// The computed instructions in program order, with the positions of all reads.
pub(super) struct Lifetimes {
    /// The indices of the computed instructions. Leaves (inputs and constants) are not computed.
    pub order: Vec<u32>,
    /// For each value, the increasing positions in `order` at which it is read. A final store counts as a read at the position
    /// `order.len()`.
    reads: Vec<Vec<u32>>,
    /// Outputs that are stored immediately after their computation: `(position in order, slot)`, by increasing position.
    pub early: Vec<(u32, u32)>,
    /// Outputs that are stored at the end: `(slot, value)`, leaves first. The slot of such an output is also an input, or its value is a
    /// leaf.
    pub late: Vec<(u32, u32)>,
}

pub(super) const NEVER: u32 = u32::MAX;

impl Lifetimes {
    pub fn of(program: &Straight) -> Self {
        let instructions = &program.instructions;
        let order: Vec<u32> = (0..instructions.len() as u32).filter(|&i| !instructions[i as usize].is_leaf()).collect();
        let mut position = vec![NEVER; instructions.len()];
        let mut reads = vec![Vec::new(); instructions.len()];
        for (at, &i) in order.iter().enumerate() {
            position[i as usize] = at as u32;
            for a in instructions[i as usize].operands() {
                if reads[a as usize].last() != Some(&(at as u32)) {
                    reads[a as usize].push(at as u32);
                }
            }
        }
        let read: HashSet<u32> =
            instructions.iter().filter_map(|i| if let Instruction::Input(slot) = i { Some(*slot) } else { None }).collect();
        let (mut early, mut copies, mut late) = (Vec::new(), Vec::new(), Vec::new());
        for &(slot, value) in &program.outputs {
            if instructions[value as usize].is_leaf() {
                copies.push((slot, value));
            } else if read.contains(&slot) {
                late.push((slot, value));
            } else {
                early.push((position[value as usize], slot));
            }
        }
        copies.append(&mut late);
        for &(_, value) in &copies {
            reads[value as usize].push(order.len() as u32);
        }
        early.sort_unstable();
        Lifetimes { order, reads, early, late: copies }
    }

    /// The first position from `at` on at which `value` is read. The result is [`NEVER`] if no such position exists.
    pub fn next_read(&self, value: u32, at: u32) -> u32 {
        let reads = &self.reads[value as usize];
        reads.get(reads.partition_point(|&read| read < at)).copied().unwrap_or(NEVER)
    }
}
