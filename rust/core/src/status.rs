//! How a run ended. A status is data: a diverged run is a result with a time, not a misuse.

/// The outcome of a run or a solve; the numbers are stable and cross into Python as they are.
///
/// ```
/// use armlet_core::status::Status;
///
/// assert_eq!((Status::Diverged.code(), Status::Diverged.name()), (1, "diverged"));
/// assert!(Status::MaxSteps.advice().contains("looser tolerances"));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[repr(i32)]
pub enum Status {
    /// The run reached its end, or the solve its answer.
    #[default]
    Success = 0,
    /// The state, its derivative or a monitor stopped being finite, or the state passed the limit that the caller set.
    Diverged = 1,
    /// The adaptive step fell below what the time variable can resolve.
    StepUnderflow = 2,
    /// The cap on steps or iterations was reached.
    MaxSteps = 3,
    /// The caller interrupted the run.
    Interrupted = 4,
    /// An event asked the run to stop.
    Event = 5,
    /// The answer leaves a residual that the problem did not allow for (lost directions, scaled task).
    Degraded = 6,
    /// No answer exists: the constraints exclude each other.
    Infeasible = 7,
    /// The adaptive step collapsed: at its pace the rest would take more than the cap on steps.
    Stalled = 8,
    /// The tolerances are below what rounding leaves of an implicit method's error estimate.
    ExcessAccuracy = 9,
}

impl Status {
    /// All statuses.
    pub const ALL: [Status; 10] = [
        Status::Success,
        Status::Diverged,
        Status::StepUnderflow,
        Status::MaxSteps,
        Status::Interrupted,
        Status::Event,
        Status::Degraded,
        Status::Infeasible,
        Status::Stalled,
        Status::ExcessAccuracy,
    ];

    /// The name used in Python (`al.Status.DIVERGED` is "diverged").
    pub fn name(self) -> &'static str {
        match self {
            Status::Success => "success",
            Status::Diverged => "diverged",
            Status::StepUnderflow => "step_underflow",
            Status::MaxSteps => "max_steps",
            Status::Interrupted => "interrupted",
            Status::Event => "event",
            Status::Degraded => "degraded",
            Status::Infeasible => "infeasible",
            Status::Stalled => "stalled",
            Status::ExcessAccuracy => "excess_accuracy",
        }
    }

    /// What the caller can do about it.
    pub fn advice(self) -> &'static str {
        match self {
            Status::Success => "the run reached its end",
            Status::Diverged => "the state stopped being finite or passed state_limit: reduce dt or the gains, or use an adaptive method",
            Status::StepUnderflow => {
                "the step fell below the resolution of time: the problem is singular here, or its input switches; try looser tolerances, or \
                 where the input switches a fixed step or a sample time"
            }
            Status::MaxSteps => "the cap on steps was reached: try looser tolerances or a shorter span",
            Status::Interrupted => "the run was interrupted by the caller",
            Status::Event => "an event ended the run",
            Status::Degraded => "part of the command was given up: see the residuals",
            Status::Infeasible => "no answer exists: see the reason",
            Status::Stalled => {
                "the steps collapsed and would never reach the end: where the input switches (a target out of reach, a bound) take a fixed step \
                 or a sample time; else try looser tolerances"
            }
            Status::ExcessAccuracy => {
                "the tolerances are below what rounding in double precision leaves of the error estimate: take looser rtol and atol"
            }
        }
    }

    /// The number of the status.
    pub fn code(self) -> i32 {
        self as i32
    }
}
