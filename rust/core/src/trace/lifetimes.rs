//! The last read of each value of a program, and the time at which its outputs are stored.

use super::straight::{Instruction, Straight};
use std::collections::HashSet;

/// The computed instructions, in order, with the positions at which their results are read.
pub(super) struct Lifetimes {
    /// The indices of the computed instructions.
    pub order: Vec<u32>,
    /// The positions in `order` at which each value is read, increasing. The position past the end belongs to the final stores.
    reads: Vec<Vec<u32>>,
    /// Outputs that are stored immediately after their computation: `(position, slot)`, in order of positions.
    pub early: Vec<(u32, u32)>,
    /// Outputs that are stored at the end, because the slot is also an input or the value is a leaf: `(slot, value)`, leaves first.
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

    /// The first position, from `at` on, at which `value` is read; [`NEVER`] if there is none.
    pub fn next_read(&self, value: u32, at: u32) -> u32 {
        let reads = &self.reads[value as usize];
        reads.get(reads.partition_point(|&read| read < at)).copied().unwrap_or(NEVER)
    }
}
