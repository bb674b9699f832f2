//! Loops as WebAssembly, for `armlet.export_web`.

use crate::arrays::{adopted, items, nonnegative_integer};
use crate::errors::{Failure, input_error};
use crate::interrupts::long;
use crate::loops::Loops;
use armlet_core::simulate::web_loop;
use armlet_core::trace::tape::Op;
use armlet_core::trace::wasm::Module;
use armlet_core::trace::{Part, Scratch, SlotTable};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyList};

/// The largest length of a list.
const MOST: usize = 1 << 20;

/// Read a list of integers.
fn counts(function: &'static str, name: &'static str, value: &Bound<'_, PyAny>) -> Result<Vec<usize>, Failure> {
    items(function, name, "a list", value, MOST)?.iter().map(|each| nonnegative_integer(function, name, each)).collect()
}

/// Return the loop of run 0 as a dict: a WebAssembly module, its slots and its numbers. `positions` has the number of positions of each
/// control, whose runs follow run 0. `frames` are the indices of frames whose positions are computed.
#[entered]
#[pyfunction]
#[arguments(plant, law, q0, positions, frames, options)]
pub fn _web_loop<'py>(options: &Bound<'py, PyDict>) -> Result<Bound<'py, PyDict>, Failure> {
    const NAME: &str = "export_web";
    let loops = Loops::of(NAME, plant, law, options)?;
    let (positions, frames) = (counts(NAME, "positions", positions)?, counts(NAME, "frames", frames)?);
    let total = positions.iter().fold(1, |sum: usize, &count| sum.saturating_add(count));
    let made = loops.with_problem(q0, |problem, rows, _| {
        if total != rows {
            let problem = format!("have a wrong sum: expected one run for each position and run 0, got {rows} runs");
            return Err(input_error(py, NAME, "positions", problem).into());
        }
        long(py, || web_loop(&problem, &positions, &frames))
    })?;
    let fields = PyDict::new(py);
    fields.set_item("module", PyBytes::new(py, &made.module))?;
    let groups = PyDict::new(py);
    for (name, slots) in made.groups {
        groups.set_item(name, (slots.first, slots.count))?;
    }
    fields.set_item("groups", groups)?;
    fields.set_item("frame", adopted(py, &[made.frame.len()], made.frame)?)?;
    fields.set_item("instants", made.instants.to_vec())?;
    fields.set_item("dt", made.step)?;
    fields.set_item("period", made.period)?;
    let sampling = made.sampling.map(|each| (each.period, each.delay, each.sensor_delay, each.rate_limit, each.resolution));
    fields.set_item("sampling", sampling)?;
    fields.set_item("has_speeds", made.has_speeds)?;
    fields.set_item("monitors", made.monitors)?;
    let motions = PyList::empty(py);
    for motion in made.motions {
        let one = PyDict::new(py);
        one.set_item("dof", motion.dof)?;
        one.set_item("breaks", motion.breaks)?;
        one.set_item("functions", motion.functions)?;
        one.set_item("first", motion.slots.first)?;
        motions.append(one)?;
    }
    fields.set_item("motions", motions)?;
    let controls: Vec<_> = made.controls.into_iter().map(|control| (control.slots, control.values)).collect();
    fields.set_item("controls", controls)?;
    Ok(fields)
}

/// Return a WebAssembly module with the function `f`, for tests. `operations` are pairs of a name and operands. The operand of "input" is a
/// slot, and the operand of "number" has the bits of the number. `outputs` are pairs of a slot and the index of an operation.
#[entered]
#[pyfunction]
#[arguments(operations, outputs, reach)]
pub fn _wasm_of_operations<'py>() -> Result<Bound<'py, PyBytes>, Failure> {
    let outputs = items(NAME, "outputs", "a list", outputs, MOST)?;
    let outputs = outputs.iter().map(|pair| pair.extract::<(u32, u32)>()).collect::<PyResult<Vec<_>>>()?;
    let reach: u32 = reach.extract()?;
    let mut ops: Vec<Op> = Vec::new();
    for (k, operation) in items(NAME, "operations", "a list", operations, MOST)?.iter().enumerate() {
        let (name, operands): (String, Vec<u64>) = operation.extract()?;
        let wrong = |problem: &str| input_error(py, NAME, "operations", format!("{problem} (first bad index {k})"));
        let at = |i: usize| operands.get(i).filter(|&&a| a < k as u64).map(|&a| a as u32).ok_or_else(|| wrong("has a later operand"));
        let first = || operands.first().copied().ok_or_else(|| wrong("has no operand"));
        ops.push(match name.as_str() {
            "number" => Op::Const(first()?),
            "input" => Op::Input(first()? as u32),
            "add" => Op::Add(at(0)?, at(1)?),
            "sub" => Op::Sub(at(0)?, at(1)?),
            "mul" => Op::Mul(at(0)?, at(1)?),
            "div" => Op::Div(at(0)?, at(1)?),
            "neg" => Op::Neg(at(0)?),
            "fma" => Op::Fma(at(0)?, at(1)?, at(2)?),
            "fnma" => Op::Fnma(at(0)?, at(1)?, at(2)?),
            "sqrt" => Op::Sqrt(at(0)?),
            "abs" => Op::Abs(at(0)?),
            "max" => Op::Max(at(0)?, at(1)?),
            "min" => Op::Min(at(0)?, at(1)?),
            "sin" => Op::Sin(at(0)?),
            "cos" => Op::Cos(at(0)?),
            "less" => Op::Less(at(0)?, at(1)?),
            "select" => Op::Select(at(0)?, at(1)?, at(2)?),
            _ => return Err(wrong("has an unknown name").into()),
        });
    }
    if outputs.iter().any(|&(_, entry)| entry as usize >= ops.len()) {
        return Err(input_error(py, NAME, "outputs", "has an unknown operation").into());
    }
    let mut module = Module::default();
    let part = Part { ops: &ops, start: 0, outputs: &outputs, places: &SlotTable::default() };
    let added = module.function("f", part, Scratch { reach, free: 0 });
    debug_assert!(added, "these operations have no cut");
    Ok(PyBytes::new(py, &module.finish()))
}
