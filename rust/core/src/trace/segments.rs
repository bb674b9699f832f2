//! A recording divided into segments. If a part of a long computation repeats, the segments before and after it become separate programs.
//!
//! A value that a later segment reads is stored in a slot of the frame, which is the memory of the program.

use super::straight::{Part, SlotTable};
use super::tape::Op;

/// The end of a segment.
#[derive(Clone)]
pub struct Cut {
    /// The number of recorded operations before the end of the segment.
    pub end: u32,
    /// The outputs of the segment, as pairs `(slot, entry)`: the slot that stores the value, and the index of its recorded operation.
    /// `join` adds the values that later segments read.
    pub outputs: Vec<(u32, u32)>,
}

/// Assign a slot, from `free` on, to each value that a later segment reads. Add the value to the outputs of its segment. Return all
/// assigned slots and the first slot after them.
pub fn join(ops: &[Op], cuts: &mut [Cut], free: u32) -> (SlotTable, u32) {
    join_from(ops, 0, SlotTable::default(), cuts, free)
}

/// Assign slots like [`join`] to the values of a recording from entry `first` on. `places` are the slots of the values before it, and of the
/// results of cuts.
pub(super) fn join_from(ops: &[Op], first: u32, mut places: SlotTable, cuts: &mut [Cut], free: u32) -> (SlotTable, u32) {
    let mut next = free;
    let given: Vec<u32> = places.keys().copied().collect();
    for k in (0..cuts.len()).rev() {
        let start = if k > 0 { cuts[k - 1].end } else { first };
        let crosses = |entry: &u32| (start..cuts[k].end).contains(entry) && !given.contains(entry);
        let crossing: Vec<u32> = places.keys().copied().filter(crosses).collect();
        for entry in crossing {
            cuts[k].outputs.push((places[&entry], entry));
        }
        cuts[k].outputs.sort_unstable();
        let before = Part { ops, start, outputs: &cuts[k].outputs, places: &places }.before();
        for entry in before {
            places.entry(entry).or_insert_with(|| {
                next += 1;
                next - 1
            });
        }
    }
    (places, next)
}
