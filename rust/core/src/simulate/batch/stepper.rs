//! Single steps of many arms of one kind. Each row of the batch is an arm with a separate input, which is held during a call.

use crate::error::{Result, positive};
use crate::integrate::Method;
use crate::law::{ExternalSpec, LawSpec};
use crate::parallel;
use crate::plant::PlantSpec;
use crate::scalar::trig::REDUCTION_LIMIT;
use crate::simulate::problem::sampling::Sampling;
use crate::simulate::problem::times::Times;
use crate::simulate::problem::{Options, Problem};
use crate::simulate::record::key::Common;
use crate::simulate::record::step::{self, Recorded};
use crate::simulate::record::structure;
use crate::simulate::runs::stepper::stepper;
use crate::status::Status;
use crate::trace::rows::{self, Rows};
use crate::trace::{Engine, Frame, engine, form};
use std::sync::Arc;

/// The number of rows that a thread computes as one piece of work. The calling thread computes a batch of at most this number of rows,
/// without other threads.
const CHUNK: usize = 64;

/// Computes the steps of all rows. The caller stores the states.
///
/// ```
/// # use armlet_core::arm::Arm;
/// # use armlet_core::dynamics::Model;
/// use armlet_core::plant::{PlantSpec, RigidSpec};
/// use armlet_core::simulate::BatchStepper;
///
/// // Two arms of 2 kg m^2 without gravity, at rest, under 2 N m and 4 N m for 100 ms.
/// let plant = PlantSpec::from(RigidSpec::new(Model::from(Arm::pendulum(2.0, 0.0)?)));
/// let stepper = BatchStepper::new(&plant, 2, 1e-3)?;
/// let mut x = [0.0; 4];
/// let stopped = stepper.advance(&[2.0, 4.0], 100, 1, &mut || false, &mut x);
/// assert!(!stopped && (x[0] - 0.005).abs() < 1e-12 && (x[2] - 0.01).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct BatchStepper {
    plant: PlantSpec,
    law: LawSpec,
    options: Options,
    /// The program of a step, and the loop parameters, which are its first inputs. `None` for joints that stick and slip.
    recorded: Option<(Arc<Recorded>, Vec<f64>)>,
}

impl BatchStepper {
    /// Prepare steps of size `dt`, s, of the classical Runge-Kutta method, for `count` rows of `plant`. Errors:
    /// [`Error::Input`](crate::error::Error::Input) if `dt` is not positive.
    pub fn new(plant: &PlantSpec, count: usize, dt: f64) -> Result<Self> {
        positive("dt", dt)?;
        let law = LawSpec::External(ExternalSpec::idle(plant.model(), plant.kind()));
        let options = Options {
            t_end: 0.0,
            dt: Some(dt),
            method: Method::Rk4,
            rtol: 1e-8,
            atol: 1e-10,
            max_step: None,
            sampling: Some(Sampling::every(dt)),
            times: Times::Every(1),
            tau_max: None,
            monitors: false,
            state_limit: f64::INFINITY,
        };
        let packed = count > 1;
        let mut made = BatchStepper { plant: plant.clone(), law, options, recorded: None };
        let problem = made.problem();
        problem.validate()?;
        let recorded = (!plant.sticks()).then(|| recorded_step(&problem, Common { long: packed, ..Common::of(&problem, packed) }));
        made.recorded = recorded;
        Ok(made)
    }

    /// The number of states of a row.
    pub fn states(&self) -> usize {
        self.plant.states()
    }

    fn problem(&self) -> Problem<'_> {
        Problem {
            plants: vec![&self.plant],
            laws: vec![&self.law],
            x0: vec![0.0; self.plant.states()],
            forces: Vec::new(),
            force_frame: None,
            options: self.options.clone(),
            measures: None,
        }
    }

    /// Advance the states `x`, shape `(B, states)`, by `steps` steps. `tau`: inputs, shape `(B, n)`, in the unit of
    /// [`Run::tau`](crate::simulate::Run::tau). Return whether `poll` stopped the work before all rows were complete. The states have no limit: those
    /// of a row that diverges become infinite or NaN.
    pub fn advance(&self, tau: &[f64], steps: usize, threads: usize, poll: &mut dyn FnMut() -> bool, x: &mut [f64]) -> bool {
        let (states, n) = (self.states(), self.plant.n());
        assert!(steps > 0 && x.len() * n == tau.len() * states, "a state and an input for each row");
        if x.len() <= CHUNK * states {
            self.chunk(tau, steps, x);
            return false;
        }
        let work = |first: usize, last: usize, x: &mut [f64]| self.chunk(&tau[first * n..last * n], steps, x);
        parallel::rows(threads, poll, (states, CHUNK), x, work).is_err()
    }

    fn chunk(&self, tau: &[f64], steps: usize, x: &mut [f64]) {
        match &self.recorded {
            Some(recorded) => self.run(recorded, engine(), (tau, steps), x),
            None => self.stick_and_slip(tau, steps, x),
        }
    }

    /// Advance rows by a program.
    fn run(&self, (recorded, values): &(Arc<Recorded>, Vec<f64>), engine: Engine, (tau, steps): (&[f64], usize), x: &mut [f64]) {
        let (states, n, lanes) = (self.states(), self.plant.n(), form(recorded.lanes).lanes());
        let (slots, programs) = (&recorded.slots, recorded.programs_for(engine));
        let mut frame = Frame::new(programs.slots(), lanes);
        programs.prepare(&mut frame);
        values.iter().enumerate().for_each(|(slot, &value)| frame.fill(slot, value));
        frame.fill(slots.step, self.options.grid());
        for (x, tau) in x.chunks_mut(states * lanes).zip(tau.chunks(n * lanes)) {
            frame.fill(slots.signature.angle(), 0.0);
            rows::read(&mut frame, slots.state.first, &[Rows { numbers: x, width: states }], 0);
            rows::read(&mut frame, slots.tau.first, &[Rows { numbers: tau, width: n }], 0);
            match programs.whole_steps() {
                Some(whole) => whole.plain().run_along(&mut frame, &[], steps),
                None => (0..steps).for_each(|_| programs.advance(&mut frame, false, |_, _| ())),
            }
            if engine == Engine::Interpreter || frame.slot_mut(slots.signature.angle()).iter().all(|&reach| reach < REDUCTION_LIMIT) {
                rows::write(&frame, slots.state.first, states, x);
                continue;
            }
            // A row in which an angle left the range of the program's sines is repeated by the interpreter.
            for (lane, (x, tau)) in x.chunks_exact_mut(states).zip(tau.chunks_exact(n)).enumerate() {
                if frame.slot_mut(slots.signature.angle())[lane] < REDUCTION_LIMIT {
                    (0..states).for_each(|k| x[k] = frame.slot_mut(slots.state.first + k)[lane] + 0.0);
                } else {
                    self.interpret(tau, steps, x);
                }
            }
        }
    }

    /// Advance one row by the interpreter.
    fn interpret(&self, tau: &[f64], steps: usize, x: &mut [f64]) {
        let problem = self.problem();
        self.run(&recorded_step(&problem, Common::of(&problem, false)), Engine::Interpreter, (tau, steps), x);
    }

    /// Advance rows of a plant whose joints stick and slip.
    fn stick_and_slip(&self, tau: &[f64], steps: usize, x: &mut [f64]) {
        let problem = self.problem();
        let Ok(mut stepping) = stepper(&problem) else { unreachable!("refused when the stepper was made") };
        let mut input = vec![0.0; self.plant.n()];
        for (x, tau) in x.chunks_exact_mut(self.states()).zip(tau.chunks_exact(self.plant.n())) {
            stepping.reset(x);
            for _ in 0..steps {
                stepping.step(Some(tau), None);
            }
            stepping.read(x, &mut input);
            if stepping.status() != Status::Success {
                x.fill(f64::NAN);
            }
            x.iter_mut().for_each(|x| *x += 0.0);
        }
    }
}

/// Record a step, with its loop parameters.
fn recorded_step(problem: &Problem, common: Common) -> (Arc<Recorded>, Vec<f64>) {
    let parameters = structure::loop_parameters(problem, 0, common);
    let seen = step::of_run(problem, 0, common, &parameters);
    (seen.recorded.clone(), parameters.values)
}
