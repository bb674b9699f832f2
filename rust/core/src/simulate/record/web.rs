//! A closed loop as a WebAssembly module: a step of its method, its law, its records, its desired motions, and the poses of its arm.
//!
//! The functions are those of the loop's programs (the compiled recordings), with the same slots. So a step has the bits of a run with the
//! baseline instruction set. A *control* is a number of the loop that varies between the runs of the problem. The set-up of each run
//! computes the values of the slots that depend on this number.

use super::key::Common;
use super::slots::StepSlots;
use super::step;
use super::structure::set_up;
use super::web_steps::{self, WebSampling};
use crate::dynamics::{Model, Quantity, Query};
use crate::error::{Error, Result};
use crate::interrupt;
use crate::motion::Motion;
use crate::scalar::Real;
use crate::simulate::assembly::start;
use crate::simulate::monitors;
use crate::simulate::problem::Problem;
use crate::simulate::problem::force::Force;
use crate::simulate::sampled::clock::Clock;
use crate::trace::tape::{Moving, Op};
use crate::trace::wasm::{Action, Input, Module};
use crate::trace::{Slots, Sym, sym};

/// A loop as a WebAssembly module. Its functions have no arguments and no results, and share the memory `memory` of 64-bit numbers.
///
/// `step` advances the state by one step, and `sampled_step` by a step that begins with a sample. `law` evaluates the law, and `notes` the
/// numbers of a record. `joints` and `frames` compute the poses of the joints, and the positions of frames.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 50.0)?, Gain::scalar("kd", 1, 20.0)?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Options, Problem, web_loop};
///
/// let problem = Problem::from_rest(&plant, &law, &dvector![1.0], Options::fixed(1.0, 0.01))?;
/// let web = web_loop(&problem, &[], &[])?;
/// assert_eq!(&web.module[..4], b"\0asm");
/// let state = web.groups.iter().find(|(name, _)| *name == "state").map(|(_, slots)| *slots);
/// assert!(state.is_some_and(|state| web.frame[state.first] == 1.0));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct WebLoop {
    /// The bytes of the module.
    pub module: Vec<u8>,
    /// The names of groups of slots.
    pub groups: Vec<(&'static str, Slots)>,
    /// The numbers of all slots at the start.
    pub frame: Vec<f64>,
    /// The instants in a step at which the exogenous input is evaluated, as fractions of the step.
    pub instants: &'static [f64],
    /// The step size, s.
    pub step: f64,
    /// The number of steps between two samples of the law. Zero if the law is in every stage.
    pub period: usize,
    /// The sampled controller, if it does more than hold the output of the law.
    pub sampling: Option<WebSampling>,
    /// Whether the plant has speeds among its states. Its input is then a force or a torque, otherwise a velocity.
    pub has_speeds: bool,
    /// The names of the monitors, which follow the plant's input in a record.
    pub monitors: Vec<&'static str>,
    /// The desired motions, in the order of the exogenous input.
    pub motions: Vec<WebMotion>,
    /// The controls, in the order of their runs.
    pub controls: Vec<WebControl>,
}

/// A desired motion of a [`WebLoop`].
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 50.0)?, Gain::scalar("kd", 1, 20.0)?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// # use armlet_core::simulate::{Options, Problem, web_loop};
/// let web = web_loop(&Problem::from_rest(&plant, &law, &dvector![1.0], Options::fixed(1.0, 0.01))?, &[], &[])?;
/// // The target of the law is constant.
/// assert!(web.motions[0].dof == 1 && web.motions[0].breaks.is_none());
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct WebMotion {
    /// The number of coordinates.
    pub dof: usize,
    /// The times at which the formula changes, s. `None` for a constant position.
    pub breaks: Option<Vec<f64>>,
    /// The names of the functions for the times before, between and after the breaks. They read the time, and write to `slots`.
    pub functions: Vec<String>,
    /// Position, velocity and acceleration at the time in the slot `time`.
    pub slots: Slots,
}

/// The slots that depend on a control, and their numbers at each position of the control, `(positions, slots)`.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 50.0)?, Gain::scalar("kd", 1, 20.0)?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// # use armlet_core::simulate::{Options, Problem, web_loop};
/// let mut problem = Problem::from_rest(&plant, &law, &dvector![1.0], Options::fixed(1.0, 0.01))?;
/// // The runs after run 0 are two positions of a control of the initial position.
/// problem.x0 = vec![1.0, 0.0, 2.0, 0.0, 3.0, 0.0];
/// let web = web_loop(&problem, &[2], &[])?;
/// assert_eq!((web.controls[0].slots.len(), web.controls[0].values.as_slice()), (1, &[2.0, 3.0][..]));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct WebControl {
    /// The slots.
    pub slots: Vec<usize>,
    /// The numbers of all positions, one position after another.
    pub values: Vec<f64>,
}

/// Write the loop of run 0 as WebAssembly. `positions` has the number of positions of each control. The runs after run 0 are the positions
/// of the first control, then those of the next one. `frames` are the indices of frames whose positions are computed.
///
/// Errors: [`Error::Input`] for a loop whose steps are not one program, or whose motion has no formula. Also for a control that changes the
/// structure of the loop, and for two controls that change one number.
pub fn web_loop(problem: &Problem, positions: &[usize], frames: &[usize]) -> Result<WebLoop> {
    problem.validate()?;
    web_steps::require(problem)?;
    let names = monitors::names(problem);
    let common = Common { notes: Some(names.len()), sums: false, ..Common::of(problem, false) };
    let moving = varying(problem, common, positions)?;
    let (mut module, mut cut) = (Module::default(), None);
    let recorded = step::record_moving(problem, 0, common, Moving::These(moving.clone()), &mut |name, part, _, scratch, _| {
        if let Some(known) = web_steps::function_name(problem, &name)
            && !module.function(known, part, scratch)
        {
            cut = Some(name);
        }
    });
    if cut.is_some() {
        let problem = format!("branches in native code, which a page does not have: expected another law, got {}", problem.law(0).name());
        return Err(Error::input("law", problem));
    }
    web_steps::add(problem, &recorded, &mut module);
    let StepSlots { signature, exogenous, state, tau, controller, reference, record, own_reference, step, instants, .. } =
        recorded.slots.clone();
    module.reserve(signature.slots().saturating_sub(module.slots()));
    let arm = (problem.plant(0).model(), state.part(0, problem.plant(0).n()), signature.angle() as u32);
    let [joints, positions_of_frames] = poses(&mut module, arm, frames)?;
    let time = module.reserve(1);
    let motions = motions(problem, &mut module, time.first, signature.angle() as u32)?;
    let h = problem.options.grid();
    let base = set_up_of(problem, 0, common, Moving::These(moving.clone()));
    let numbers = |run: usize| numbers(problem, (run, common), (&moving, &base, positions), &recorded.slots);
    let base = numbers(0)?;
    let mut frame = vec![0.0; module.slots()];
    base.iter().for_each(|&(slot, x)| frame[slot] = x);
    frame[step] = h;
    for k in 1..instants.len() {
        frame.copy_within(exogenous.slots.numbers(1), exogenous.slots.first + k * exogenous.slots.count);
    }
    let groups = [
        ("exogenous", exogenous.slots),
        ("force", exogenous.slots.part(exogenous.desired, exogenous.slots.count - exogenous.desired)),
        ("state", state),
        ("h", Slots { first: step, count: 1 }),
        ("tau", tau),
        ("output", controller.output),
        ("change", controller.change),
        ("measured", controller.measured),
        ("reference", reference),
        ("record", record),
        ("own_reference", own_reference),
        ("angle", Slots { first: signature.angle(), count: 1 }),
        ("joints", joints),
        ("frames", positions_of_frames),
        ("time", time),
    ];
    let mut controls = Vec::new();
    let mut first = 1;
    for &count in positions {
        controls.push(control(&base, first..first + count, numbers)?);
        first += count;
    }
    require_apart(&controls)?;
    Ok(WebLoop {
        module: module.finish(),
        groups: groups.to_vec(),
        frame,
        instants,
        step: h,
        period: problem.options.sampling.as_ref().map_or(0, |sampling| Clock::new(sampling, h, 0).period()),
        sampling: problem.options.sampling.as_ref().and_then(|sampling| WebSampling::of(sampling, h)),
        has_speeds: problem.plant(0).kind().has_speeds(),
        monitors: names,
        motions,
        controls,
    })
}

/// A recorded set-up: operations, structure and values.
type SetUp = (Vec<Op>, Vec<u32>, Vec<f64>);

/// Record the set-up of run `run` with the varying parameters `moving`.
fn set_up_of(problem: &Problem, run: usize, common: Common, moving: Moving) -> SetUp {
    sym::begin_moving(moving);
    drop(set_up(problem, run, common));
    let recording = sym::finish();
    (recording.ops, recording.structure, recording.values)
}

/// The error that the loop of run `run` has another structure.
fn restructures(positions: &[usize], run: usize) -> Error {
    let problem = "has a number that changes the structure of the loop: expected a range in which the loop remains the same";
    let mut last = 0;
    let control = positions.iter().position(|count| {
        last += count;
        run <= last
    });
    Error::input("controls", problem).at([control.unwrap_or(0)])
}

/// For each set-up parameter, whether its values differ between the runs.
fn varying(problem: &Problem, common: Common, positions: &[usize]) -> Result<Vec<bool>> {
    let (.., base) = set_up_of(problem, 0, common, Moving::All);
    let mut moving = vec![false; base.len()];
    for run in 1..problem.runs() {
        interrupt::check();
        let (.., values) = set_up_of(problem, run, common, Moving::All);
        if values.len() != base.len() {
            return Err(restructures(positions, run));
        }
        moving.iter_mut().zip(base.iter().zip(&values)).for_each(|(moves, (a, b))| *moves |= a.to_bits() != b.to_bits());
    }
    Ok(moving)
}

/// The numbers of run `run` with their slots: loop parameters, initial state, constant desired positions and the force at the first instant.
/// `base` is the set-up of run 0 with the varying parameters `moving`.
fn numbers(
    problem: &Problem,
    (run, common): (usize, Common),
    (moving, base, positions): (&[bool], &SetUp, &[usize]),
    slots: &StepSlots,
) -> Result<Vec<(usize, f64)>> {
    interrupt::check();
    let (ops, structure, values) = set_up_of(problem, run, common, Moving::These(moving.to_vec()));
    if (&ops, &structure) != (&base.0, &base.1) {
        return Err(restructures(positions, run));
    }
    let mut all: Vec<(usize, f64)> = values.into_iter().enumerate().collect();
    all.extend((slots.state.first..).zip(start::<f64>(problem, |_| run)));
    let mut at = slots.exogenous.slots.first;
    for (motion, base) in problem.law(run).motions().into_iter().zip(problem.law(0).motions()) {
        let mut row = vec![0.0; 3 * motion.dof()];
        motion.sample(0.0, &mut row);
        if motion.moves() && !motion.is_same(base) {
            return Err(Error::input(
                "controls",
                "has a number of a desired motion: expected a number of a constant target or of another part",
            ));
        }
        let count = row.len();
        all.extend((at..).zip(row));
        at += count;
    }
    all.extend((at..).zip(problem.force(run).and_then(Force::constant).into_iter().flatten()));
    Ok(all)
}

/// The slots whose numbers differ from `base` in some of the `runs`, and these numbers.
fn control(
    base: &[(usize, f64)],
    runs: std::ops::Range<usize>,
    numbers: impl Fn(usize) -> Result<Vec<(usize, f64)>>,
) -> Result<WebControl> {
    let rows = runs.map(numbers).collect::<Result<Vec<_>>>()?;
    let differs = |k: usize| rows.iter().any(|row| row[k].1.to_bits() != base[k].1.to_bits());
    let columns: Vec<usize> = (0..base.len()).filter(|&k| differs(k)).collect();
    let values = rows.iter().flat_map(|row| columns.iter().map(|&k| row[k].1)).collect();
    Ok(WebControl { slots: columns.into_iter().map(|k| base[k].0).collect(), values })
}

/// Refuse two controls that change one number.
fn require_apart(controls: &[WebControl]) -> Result<()> {
    for (k, control) in controls.iter().enumerate() {
        if controls[..k].iter().any(|other| other.slots.iter().any(|slot| control.slots.contains(slot))) {
            let problem = "changes a number that another control also changes: expected controls of different numbers";
            return Err(Error::input("controls", problem).at([k]));
        }
    }
    Ok(())
}

/// Add the functions `joints` and `frames` of an arm whose positions are in the slots `q`. Return the slots of their results.
fn poses(module: &mut Module, (model, q, angle): (&Model, Slots, u32), frames: &[usize]) -> Result<[Slots; 2]> {
    let mut add = |name: &str, queries: &[Query]| -> Result<Slots> {
        let first = module.slots();
        for (k, query) in queries.iter().enumerate() {
            let recorded = model.recorded(query)?;
            let results = module.reserve(recorded.answer.len());
            let inputs = recorded.values.iter().map(|&x| Input::Value(x)).chain((q.first..q.end()).map(Input::Slot));
            let inputs: Vec<Input> = inputs.collect();
            if !module.formula(&format!("{name}{k}"), &recorded.ops, &inputs, (&recorded.answer, results.first, angle)) {
                return Err(Error::input("arm", "has a pose that branches in native code"));
            }
        }
        let actions: Vec<Action> = (0..queries.len()).map(|k| Action::Call(format!("{name}{k}"))).collect();
        module.sequence(name, &actions);
        Ok(Slots { first, count: module.slots() - first })
    };
    if let Model::PlanarPr(_) = model {
        return Ok(Default::default());
    }
    let frames: Vec<Query> = frames.iter().map(|&frame| Query { frame, ..Quantity::Position.into() }).collect();
    Ok([add("joints", &[Quantity::JointPoses.into()])?, add("frames", &frames)?])
}

/// Add the functions of the desired motions, which read the time from slot `time`.
fn motions(problem: &Problem, module: &mut Module, time: usize, angle: u32) -> Result<Vec<WebMotion>> {
    let mut all = Vec::new();
    for (k, motion) in problem.law(0).motions().into_iter().enumerate() {
        let breaks = match motion {
            Motion::Hold(_) => None,
            Motion::Quintic(_) | Motion::BangBang(_) | Motion::Sinusoid(_) => Some(motion.breaks()),
            Motion::Table(_) | Motion::Spline(_) | Motion::TimedPath(_) | Motion::Acceleration(_) => {
                let name = motion.name();
                let problem = format!("has a motion that is not exported: expected a target, Quintic, BangBang or Sinusoid, got {name}");
                return Err(Error::input("law", problem));
            }
        };
        let slots = module.reserve(if breaks.is_some() { 3 * motion.dof() } else { 0 });
        let mut functions = Vec::new();
        for piece in 0..breaks.as_ref().map_or(0, |breaks| breaks.len() + 1) {
            // Recorded operations are not simplified, so that they round as in `Motion::sample`.
            sym::begin_that(false);
            sym::end_set_up();
            let (t, mut out) = (sym::input(), vec![Sym::zero(); slots.count]);
            match motion {
                Motion::Quintic(m) => m.on_piece::<_, 3, 0>(piece, t, &mut out),
                Motion::BangBang(m) => m.on_piece::<_, 3, 0>(piece, t, &mut out),
                Motion::Sinusoid(m) => m.evaluate::<_, 3, 0>(t, &mut out),
                _ => {}
            }
            let (answer, recording): (Vec<u32>, _) = (out.into_iter().map(Sym::index).collect(), sym::finish());
            let name = format!("motion{k}_{piece}");
            let added = module.formula(&name, &recording.ops, &[Input::Slot(time)], (&answer, slots.first, angle));
            debug_assert!(added, "a motion has no cut");
            functions.push(name);
        }
        all.push(WebMotion { dof: motion.dof(), breaks, functions, slots });
    }
    Ok(all)
}
