//! The steps of a loop as a WebAssembly module, and the loops that have such steps.
//!
//! Joints with stick-slip friction keep their modes within a step. At the start of a step, functions decide these modes by pivots, as in
//! native code. At its end, a function stops the joints whose velocity has changed its sign.

use super::step::Recorded;
use crate::error::{Error, Result};
use crate::integrate::MethodKind;
use crate::law::Route;
use crate::plant::LoopStickSlip;
use crate::simulate::problem::Problem;
use crate::simulate::problem::sampling::Sampling;
use crate::simulate::sampled::clock::Clock;
use crate::trace::Sym;
use crate::trace::wasm::{Action, Module};

/// A sampled controller of a [`WebLoop`](super::web::WebLoop). The page stores the outputs and the measurements of the last samples.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 50.0)?, Gain::scalar("kd", 1, 20.0)?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Options, Problem, Sampling, web_loop};
///
/// let sampling = Sampling { delay: 0.02, ..Sampling::every(0.01) };
/// let options = Options { sampling: Some(sampling), ..Options::fixed(0.1, 0.005) };
/// let web = web_loop(&Problem::from_rest(&plant, &law, &dvector![1.0], options)?, &[], &[])?;
/// assert!(web.period == 2 && web.sampling.is_some_and(|sampling| sampling.delay == 4));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WebSampling {
    /// The sample period, s.
    pub period: f64,
    /// The number of steps from a sample until its output acts.
    pub delay: usize,
    /// The age of a measurement when the law receives it, in samples.
    pub sensor_delay: usize,
    /// The largest change of the input per second. Infinity means no limit.
    pub rate_limit: f64,
    /// Resolutions of the four channels of the measurement, in the units of the channels. Zero means no rounding.
    pub resolution: [f64; 4],
}

impl WebSampling {
    /// Return the controller in steps of size `dt`, s; `None` if it only holds the output of the law.
    pub(super) fn of(sampling: &Sampling, dt: f64) -> Option<Self> {
        let &Sampling { period, sensor_delay, rate_limit, resolution, .. } = sampling;
        let delay = Clock::new(sampling, dt, 0).delay();
        (!sampling.is_plain()).then_some(WebSampling { period, delay, sensor_delay, rate_limit, resolution })
    }
}

/// Refuse a loop whose steps are not one program.
pub(super) fn require(problem: &Problem) -> Result<()> {
    let (o, law) = (&problem.options, problem.law(0));
    let refused = |argument: &str, problem: String| Err(Error::input(argument, problem));
    match law.route() {
        Route::Outside => return refused("law", "is a function in Python: expected a law of armlet such as Adaptive".into()),
        Route::Bounded | Route::Deciding => {
            let problem = "has limits or bounds, which are solved in native code: expected a law without limits";
            return refused("law", format!("{problem}, got {}", law.name()));
        }
        Route::Straight | Route::Guarded => {}
    }
    if !matches!(o.method.kind(), MethodKind::ExplicitSteps(_)) {
        return refused("method", format!("has no fixed explicit steps: expected rk4, euler or semi_implicit, got {}", o.method.name()));
    }
    if problem.forces.iter().any(|force| force.constant().is_none()) {
        return refused("force", "changes in time: expected a constant force, or None".into());
    }
    let Some(sampling) = &o.sampling else { return Ok(()) };
    let parts = [
        ("jitter", sampling.jitter > 0.0),
        ("noise", sampling.noise.iter().any(|&x| x > 0.0)),
        ("torque_sensor", sampling.torque_sensor.is_some()),
    ];
    match parts.into_iter().find(|&(_, is_set)| is_set) {
        Some((part, _)) => {
            let problem = format!("has {part}, which native code computes: expected a period, delays, a rate_limit and a resolution");
            refused("sample_time", problem)
        }
        None => Ok(()),
    }
}

/// A step in which the modes of all joints remain.
const FREE_STEP: &str = "free_step";

/// The name of the function of the recorded program `name`; `None` if a page does not use it. A page records with the function `notes`, at
/// chosen steps. With stick-slip friction, the program of a step is only a part of the function `step`.
pub(super) fn function_name<'a>(problem: &Problem, name: &'a str) -> Option<&'a str> {
    match (problem.plant(0).sticks(), name) {
        (true, "step") => Some(FREE_STEP),
        (true, "sampled_step" | "sampled_rates") => None,
        _ => (!name.starts_with("noted_")).then_some(name),
    }
}

/// Add the functions of whole steps that are not one program. They are those of a step that is divided into parts, and of stick-slip
/// friction.
pub(super) fn add(problem: &Problem, recorded: &Recorded, module: &mut Module) {
    let (sticks, call) = (problem.plant(0).sticks(), |name: &str| Action::Call(name.to_owned()));
    let free_step = if sticks { FREE_STEP } else { "step" };
    if let Some(stages) = &recorded.tracing.stages {
        let count = recorded.tracing.cuts.len();
        for (name, first) in [(free_step, "rates"), ("sampled_step", "sampled_rates")] {
            let mut actions = Vec::new();
            for k in 0..count {
                actions.extend([call(&format!("segment{}", k + 1)), call(if k == 0 { first } else { "rates" })]);
                let copies = stages.moving.iter().filter(|slots| slots.count > 0);
                actions.extend(copies.map(|&from| Action::Copy { from, to: from.first + (k + 1) * recorded.slots.rates.count }));
            }
            actions.push(call(&format!("segment{}", count + 1)));
            if name == free_step || stages.sampled.is_some() && !sticks {
                module.sequence(name, &actions);
            }
        }
    }
    if !sticks {
        return;
    }
    let n = recorded.slots.sliding.count;
    let pivot = Action::CallUnless { valid: recorded.slots.modes.first + n, called: "pivot".to_owned() };
    let mut actions = vec![call("begin_modes")];
    actions.extend(std::iter::repeat_n(pivot, LoopStickSlip::<Sym>::most_pivots(n)));
    actions.extend([call(free_step), call("arrest")]);
    module.sequence("step", &actions);
    if problem.options.sampling.is_some() {
        // The modes follow from the input that acts after the sample.
        module.sequence("sampled_step", &[call("law"), call("step")]);
    }
}
