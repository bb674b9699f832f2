//! Listings of the programs of a closed loop: the operations of each stage as text.

use super::key::Common;
use super::rates;
use super::slot_names::{Named, SlotNames};
use super::step;
use super::step_programs::Watch;
use super::structure;
use crate::error::{Error, Result};
use crate::integrate::MethodKind;
use crate::simulate::problem::Problem;
use crate::trace::instruction::{Form, Set};
use crate::trace::listing::{self, Listing, Lowered};
use crate::trace::{Signature, engine, form, program};
use std::collections::BTreeSet;

/// The listing of one program of a loop.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 50.0)?, Gain::scalar("kd", 1, 20.0)?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Options, Problem, list_loop};
///
/// let problem = Problem::from_rest(&plant, &law, &dvector![1.0], Options::fixed(1.0, 0.01))?;
/// let listed = list_loop(&problem, false, None)?;
/// let operations = listed.parts.iter().find(|(part, _)| *part == listed.part).map_or(0, |&(_, operations)| operations);
/// assert!(operations > 10);
/// let lowered = listed.stages.iter().find(|(stage, _)| *stage == "lowered");
/// assert!(lowered.is_some_and(|(_, listing)| listing.lines.len() >= operations));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct Listed {
    /// The name of the program among the programs of the loop.
    pub part: String,
    /// The names of all programs of the loop, each with its number of operations.
    pub parts: Vec<(String, usize)>,
    /// The name of the engine, as runs report it.
    pub engine: &'static str,
    /// The name of the instruction set.
    pub set: &'static str,
    /// The number of lanes of a register.
    pub lanes: usize,
    /// The size of the machine code in bytes, and the number of spilled values. `None` if armlet makes no machine code for this processor.
    pub size: Option<(usize, usize)>,
    /// All inputs that one or more stages of the program read. An input that is a loop parameter has a value.
    pub inputs: Vec<(Named, Option<f64>)>,
    /// The stages "recorded" (if available), "simplified", "lowered" and "machine", each with its listing.
    pub stages: Vec<(&'static str, Listing)>,
}

/// Return the listing of program `part` of the loop of run 0. If `batch` is true, this program computes several lanes of a batch. If `part`
/// is `None`, the listing shows the whole step, or the rates if no program computes a whole step. Errors: [`Error::Input`] for a loop that
/// has a law that is not recorded, [`Error::Unknown`] for an unknown part, and errors of an invalid loop.
pub fn list_loop(problem: &Problem, batch: bool, part: Option<&str>) -> Result<Listed> {
    // Joints stick and slip between steps, so that no program computes several steps.
    let fixed = matches!(problem.options.method.kind(), MethodKind::ExplicitSteps(_)) && !problem.plant(0).sticks();
    require_recordable(problem)?;
    problem.validate_loop()?;
    if batch && !fixed {
        let what = if problem.plant(0).sticks() { "stick-slip friction" } else { problem.options.method.name() };
        return Err(Error::input("batch", format!("is not used: expected False for {what}, whose runs are computed one by one, got True")));
    }
    let common = if fixed { Common::of(problem, batch) } else { Common::of_functions(problem) };
    let parameters = structure::loop_parameters(problem, 0, common);
    let mut parts: Vec<(String, Form, usize)> = Vec::new();
    let found = record(problem, common, fixed, None, &mut |name, part, stream, scratch, lanes| {
        parts.push((name, form(lanes), Lowered::of(part, stream, scratch, form(lanes)).straight.operations()));
    });
    let whole = parts.iter().any(|(name, ..)| name == "step");
    let chosen = part.unwrap_or(if whole { "step" } else { "rates" });
    let Some(&(_, chosen_form, _)) = parts.iter().find(|(name, ..)| name == chosen) else {
        return Err(Error::unknown("part", "", parts.iter().map(|(name, ..)| name.as_str()), chosen));
    };
    let slots = SlotNames::of(problem, found.signature(chosen), &parameters.labels, chosen);
    let names = |slot: u32| slots.at(slot).0;
    let (mut stages, mut size, mut read) = (Vec::new(), None, BTreeSet::new());
    record(problem, common, fixed, Some(!whole), &mut |name, part, stream, scratch, lanes| {
        if name == chosen {
            read.extend(Lowered::of(part, stream, scratch, form(lanes)).inputs);
            stages.push(("recorded", listing::recorded(part, &names)));
        }
    });
    record(problem, common, fixed, None, &mut |name, part, stream, scratch, lanes| {
        if name == chosen {
            let lowered = Lowered::of(part, stream, scratch, form(lanes));
            stages.push(("simplified", listing::recorded(part, &names)));
            stages.push(("lowered", lowered.listing(&names)));
            stages.push(("machine", lowered.code(chosen_form, scratch.free, &names)));
            size = program::size(&lowered.straight, scratch.free, chosen_form);
            read.extend(lowered.inputs);
        }
    });
    let inputs = read.into_iter().map(|slot| (slots.at(slot), parameters.values.get(slot as usize).copied())).collect();
    let set = match chosen_form.set {
        Set::Sse2 => "SSE2",
        Set::Avx2 => "AVX2",
        Set::Avx512 => "AVX-512",
        Set::Neon => "NEON",
    };
    let parts = parts.into_iter().map(|(name, _, operations)| (name, operations)).collect();
    Ok(Listed { part: chosen.to_owned(), parts, engine: engine().name(), set, lanes: chosen_form.lanes(), size, inputs, stages })
}

/// Pass each program of the loop of run 0 to `watch`. The problem must have an explicit method of fixed steps. Return the loop parameters,
/// which are the first slots of a frame, and the slot of the step size.
pub fn watch_steps(problem: &Problem, batch: bool, watch: Watch) -> (Vec<f64>, usize) {
    let common = Common::of(problem, batch);
    let recorded = step::record_watched(problem, 0, common, None, watch);
    (structure::loop_parameters(problem, 0, common).values, recorded.slots.step)
}

/// The signatures of the programs of a recorded loop.
struct Signatures {
    step_or_rates: Signature,
    derivatives: Option<Signature>,
}

impl Signatures {
    /// The signature of program `part`.
    fn signature(&self, part: &str) -> &Signature {
        self.derivatives.as_ref().filter(|_| part != "rates").unwrap_or(&self.step_or_rates)
    }
}

/// Record the loop. If `plain` is `None`, the operations are simplified. If it is `Some(in_parts)`, every operation is kept, and `in_parts`
/// selects whether the step is divided into parts.
fn record(problem: &Problem, common: Common, fixed: bool, plain: Option<bool>, watch: Watch) -> Signatures {
    if fixed {
        let recorded = step::record_watched(problem, 0, common, plain, watch);
        return Signatures { step_or_rates: recorded.slots.signature, derivatives: None };
    }
    let (step_or_rates, derivatives) = rates::record_watched(problem, 0, common, plain.is_none(), watch);
    Signatures { step_or_rates, derivatives }
}

/// Refuse a loop whose law is not recorded.
fn require_recordable(problem: &Problem) -> Result<()> {
    if problem.law(0).route().is_recordable() {
        return Ok(());
    }
    let expected = "expected a law of armlet such as Adaptive, got a function in Python";
    Err(Error::input("law", format!("has the loop run directly, without a program: {expected}")))
}
