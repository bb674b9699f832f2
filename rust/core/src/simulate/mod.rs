//! Simulation of closed loops: a plant with a law, integrated by a method, alone or in batches. Monitors check the identities of the
//! theory.
//!
//! Terms of this directory:
//!
//! - A *loop* is a plant with a law. Its state is `x = [plant, law, integrals]`, where the integrals are those of the monitors. The *input*
//!   `tau` of the plant is the output of the law after saturation.
//! - The *exogenous input* is the desired motion and the external force.
//! - A *record* is the stored data at one time: state, input and monitors. *Metrics* are numbers that summarise all records of a run.
//! - A *sample* is one evaluation of a sampled law. Its output is *held* until the next sample.
//! - The *skewness* is the largest absolute entry of `N + N'` with `N = dM/dt - 2 C`, which is zero in theory. `M` is the mass matrix, `C`
//!   the Coriolis matrix, and `'` the transpose.
//! - A *lane* is one element of a SIMD register. A *group* is a set of runs that are computed at the same time, one per lane.
//! - A *loop parameter* is a number that is constant in a run, such as a mass, a gain, a target or a limit.
//! - A *program* is a recorded computation (the module `trace`). It *declines* a step if its results are not valid. Its *frame* is its
//!   memory, and a *slot* of the frame has one number per lane.
//! - Two runs have the same *structure* if the recordings of their loops have the same operations. Then one program computes both.
//! - A *level* is one priority of a law with task priorities. Its norms are those of its task error and of its residual. The residual is
//!   the commanded minus the achieved velocity or acceleration.
//!
//! Each of these folders depends only on folders before it: `problem`, `metrics`, `monitors`, `validation`, `sampled`, `record`, `loops`,
//! `fixed`, `observer`, `adaptive`, `runs`, `batch`, `gradient`.

mod adaptive;
mod assembly;
mod balances;
mod batch;
mod closed_loop;
mod columns;
mod fixed;
mod gradient;
mod loops;
mod metrics;
mod monitors;
mod observer;
mod problem;
mod record;
mod recorded_monitors;
mod runs;
mod sampled;
mod stop;
mod validation;
#[doc(hidden)]
mod world;

pub use crate::integrate::Method;
pub use crate::parallel::default_threads;
#[doc(hidden)]
pub use adaptive::rates_loop::RatesLoop;
pub use balances::NAMES as BALANCES;
pub use batch::priority::{solve_rows, solve_stacks, solve_stacks_by};
pub use batch::rows::{BatchRuns, Metric};
pub use batch::stepper::BatchStepper;
pub use batch::{Keep, lanes, simulate_batch};
pub use gradient::{
    Parameter, Parameters, RecordParts, Rows, Shared, adjoint, adjoint_of_rows, record_parts, sensitivities, sensitivities_of_rows,
};
#[doc(hidden)]
pub use loops::stepped_loop::SteppedLoop;
pub use observer::event::{Crossings, Event, EventFunction, Signal};
pub use observer::run_observer::{Guard, Polynomials, RunObserver, Switched};
pub use problem::bound::DEFAULT_STATE_LIMIT;
pub use problem::force::{Force, Wrench};
pub use problem::measures::Measures;
pub use problem::sampling::{CHANNELS, Sampling};
pub use problem::times::Times;
pub use problem::{Options, Problem};
pub use record::listing::{Listed, list_loop, watch_steps};
pub use record::web::{WebControl, WebLoop, WebMotion, web_loop};
pub use record::web_steps::WebSampling;
pub use runs::single::{Run, simulate, simulate_observed};
pub use runs::stepper::{Stepping, require_fixed_steps, stepper};
pub use stop::{Poller, Stop};
#[doc(hidden)]
pub use world::Exogenous;
