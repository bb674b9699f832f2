//! The outcome of a run. A status is data: a run that diverges is a result, and not an error.

/// The outcome of a run or a solve. Codes are never changed, and Python uses the same codes.
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
    /// The run reached its end, or the solver found a result.
    #[default]
    Success = 0,
    /// The state, its derivative, a monitor or a result is not finite, or the state exceeded the limit that the caller set.
    Diverged = 1,
    /// The step size is below the resolution of time.
    StepUnderflow = 2,
    /// The maximum number of steps or iterations was reached.
    MaxSteps = 3,
    /// The caller interrupted the run.
    Interrupted = 4,
    /// An event ended the run.
    Event = 5,
    /// The command is fulfilled only in part: a direction is lost, a task is scaled, or a lower task is not reached. For derivatives of a
    /// run, this status means that the run has no derivative.
    Degraded = 6,
    /// No solution was found, for example because the constraints contradict each other.
    Infeasible = 7,
    /// The adaptive step size became so small that the run would exceed the maximum number of steps. Or the run chattered along a jump
    /// of its derivative.
    Stalled = 8,
    /// The tolerances are below the rounding error of an implicit method's error estimate.
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

    /// The name in Python (`al.Status.DIVERGED` is "diverged").
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

    /// Advice for the user: a possible change of the problem.
    pub fn advice(self) -> &'static str {
        match self {
            Status::Success => "the run reached its end",
            Status::Diverged => "the state stopped being finite or passed state_limit: reduce dt or the gains, or use an adaptive method",
            Status::StepUnderflow => {
                "the step fell below the resolution of time. The problem is singular here, or its input switches. Try looser tolerances; for an \
                 input that switches, a fixed step or a sample time"
            }
            Status::MaxSteps => "the cap on steps was reached: try looser tolerances or a shorter span",
            Status::Interrupted => "the run was interrupted by the caller",
            Status::Event => "an event ended the run",
            Status::Degraded => "part of the command was given up: see the residuals",
            Status::Infeasible => "no answer exists: see the reason",
            Status::Stalled => {
                "the steps became too small to reach the end. If the input switches (a target out of reach, a bound), take a fixed step or a sample \
                 time. Otherwise try looser tolerances"
            }
            Status::ExcessAccuracy => "the tolerances are below the rounding error of the error estimate: take looser rtol and atol",
        }
    }

    /// The code of the status.
    pub fn code(self) -> i32 {
        self as i32
    }
}
