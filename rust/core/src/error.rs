//! Errors: a wrong argument, model or file, a solver without a solution, or too little memory. The outcome of a run is not an error but
//! data: see `status`.

use crate::interrupt;
use crate::status::Status;

/// The errors of the core. The Python binding maps each variant to a class, and prepends the name of the called function to the message.
///
/// ```
/// use armlet_core::arm::{Arm, STANDARD_GRAVITY};
/// use armlet_core::error::Error;
///
/// let text = "<robot name='r'>\n<link name='a'/>\n<link name='a'/>\n</robot>";
/// match Arm::from_urdf(text, "r.urdf", STANDARD_GRAVITY, None, None) {
///     Err(Error::Model { file, line, .. }) => assert_eq!((file.as_str(), line), ("r.urdf", 3)),
///     other => panic!("{other:?}"),
/// }
/// assert!(matches!(Arm::planar(&[-1.0], None, None, None, [0.0; 2]), Err(Error::Input { argument, .. }) if argument == "lengths"));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Error {
    /// An argument is invalid: `argument problem: expected .., got .. (first bad index ..)`.
    #[error("{argument} {problem}{}", at_index(index))]
    Input {
        /// Name of the argument.
        argument: String,
        /// The problem with the argument.
        problem: String,
        /// The index of the first bad entry, one number per axis. Empty if the whole argument is wrong.
        index: Box<[usize]>,
    },
    /// An argument has the wrong shape, length or count.
    #[error("{argument} has the wrong {what}: expected {expected}, got {got}{}", at_index(index))]
    WrongShape {
        /// Name of the argument.
        argument: String,
        /// The wrong property, such as "shape" or "number of joints".
        what: &'static str,
        /// The value that the function requires.
        expected: Box<str>,
        /// The value of the argument.
        got: Box<str>,
        /// The index of the wrong part of the argument, as in `Input`.
        index: Box<[usize]>,
    },
    /// A name is unknown.
    #[error("{argument} is unknown: expected one of {}{}, got {got}", of_kind(kind), listed(available))]
    Unknown {
        /// Name of the argument.
        argument: String,
        /// The kind of names, such as "frames". Empty if the name of the argument states it.
        kind: &'static str,
        /// The available names.
        available: Vec<String>,
        /// The unknown name.
        got: String,
    },
    /// A robot model is invalid. `line` counts the lines of `file` from 1.
    #[error("{file}:{line}: {problem}")]
    Model {
        /// Name of the file.
        file: String,
        /// Line, counted from 1.
        line: u32,
        /// The problem in this line.
        problem: String,
    },
    /// A solver ended without a solution, at time (or iteration) `t`.
    #[error("{problem}")]
    Solve {
        /// The outcome of the solver.
        status: Status,
        /// Time at which the solver ended, s, or the number of the iteration.
        t: f64,
        /// The problem that ended the solver.
        problem: String,
    },
    /// Stored data does not have the expected format.
    #[error("{0}")]
    Format(String),
    /// Memory is insufficient for a model, for results, or for the work memory of a call.
    #[error("the result needs {bytes} bytes, more than can be allocated")]
    Memory {
        /// The required memory, in bytes.
        bytes: u128,
    },
}

/// A result with the error type of this crate.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// Return an error with the message `argument problem`, the form of most errors about an argument.
    pub fn input(argument: impl Into<String>, problem: impl Into<String>) -> Self {
        Error::Input { argument: argument.into(), problem: problem.into(), index: Box::default() }
    }

    /// Return the error that the property `what` of an argument is wrong.
    pub fn wrong(argument: impl Into<String>, what: &'static str, expected: impl ToString, got: impl ToString) -> Self {
        let (expected, got) = (expected.to_string().into(), got.to_string().into());
        Error::WrongShape { argument: argument.into(), what, expected, got, index: Box::default() }
    }

    /// Return the error that an array has the wrong shape.
    pub fn wrong_shape(argument: impl Into<String>, expected: &[usize], got: &[usize]) -> Self {
        Error::wrong(argument, "shape", tuple(expected), tuple(got))
    }

    /// Return the error that `got` is not one of the `available` names of this `kind`.
    pub fn unknown<T: Into<String>>(
        argument: impl Into<String>,
        kind: &'static str,
        available: impl IntoIterator<Item = T>,
        got: impl Into<String>,
    ) -> Self {
        let available = available.into_iter().map(Into::into).collect();
        Error::Unknown { argument: argument.into(), kind, available, got: got.into() }
    }

    /// Return the error with the index of the wrong entry. Only `Input` and `WrongShape` have an index.
    pub fn at(mut self, at: impl Into<Vec<usize>>) -> Self {
        if let Error::Input { index, .. } | Error::WrongShape { index, .. } = &mut self {
            *index = at.into().into_boxed_slice();
        }
        self
    }

    /// Return the error with the name that the caller uses for the argument.
    pub fn of_argument(mut self, name: impl Into<String>) -> Self {
        if let Error::Input { argument, .. } | Error::WrongShape { argument, .. } | Error::Unknown { argument, .. } = &mut self {
            *argument = name.into();
        }
        self
    }

    /// The part of the message between the name of the argument and its index. The result is `None` for errors that are not about an
    /// argument.
    pub fn problem(&self) -> Option<String> {
        let text = self.to_string();
        let end = text.len() - at_index(self.index()).len();
        self.argument().map(|argument| text[argument.len() + 1..end].to_string())
    }

    /// The name of the wrong argument, if the error is about an argument.
    pub fn argument(&self) -> Option<&str> {
        match self {
            Error::Input { argument, .. } | Error::WrongShape { argument, .. } | Error::Unknown { argument, .. } => Some(argument),
            Error::Model { .. } | Error::Solve { .. } | Error::Format(_) | Error::Memory { .. } => None,
        }
    }

    /// The index of the first bad entry of the argument, one number per axis. Empty if there is none.
    pub fn index(&self) -> &[usize] {
        match self {
            Error::Input { index, .. } | Error::WrongShape { index, .. } => index,
            Error::Unknown { .. } | Error::Model { .. } | Error::Solve { .. } | Error::Format(_) | Error::Memory { .. } => &[],
        }
    }

    /// The available names, if the error is an unknown name. Empty for other errors.
    pub fn available(&self) -> &[String] {
        if let Error::Unknown { available, .. } = self { available } else { &[] }
    }
}

/// Return the text `(first bad index ..)`, or an empty text without an index.
fn at_index(index: &[usize]) -> String {
    match index {
        [] => String::new(),
        [i] => format!(" (first bad index {i})"),
        more => format!(" (first bad index {})", tuple(more)),
    }
}

/// Return the numbers in the notation of a Python tuple.
fn tuple(numbers: &[usize]) -> String {
    match numbers {
        [one] => format!("({one},)"),
        more => format!("({})", more.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

fn of_kind(kind: &str) -> String {
    if kind.is_empty() { String::new() } else { format!("the {kind} ") }
}

/// The maximum number of names of a list that a message shows.
const NAMES_SHOWN: usize = 20;

/// Return the first names of a list, and the number of the remaining names.
pub(crate) fn listed<T: AsRef<str>>(names: &[T]) -> String {
    let shown = names.iter().take(NAMES_SHOWN).map(AsRef::as_ref).collect::<Vec<_>>().join(", ");
    if names.len() > NAMES_SHOWN { format!("{shown} and {} more", names.len() - NAMES_SHOWN) } else { shown }
}

/// The number of values between two checks for a stop request.
const PIECE: usize = 1 << 16;

/// Return whether all values are finite.
pub fn all_finite(values: &[f64]) -> bool {
    if values.len() <= PIECE {
        return few_finite(values);
    }
    values.chunks(PIECE).all(|piece| {
        interrupt::check();
        few_finite(piece)
    })
}

/// Return whether a few values are finite. The loop has no branch per value.
fn few_finite(values: &[f64]) -> bool {
    // Each sum is zero, or NaN after a value that is not finite. Eight independent sums need not wait for one another.
    let mut zeros = [0.0; 8];
    let (blocks, rest) = values.as_chunks::<8>();
    for block in blocks {
        for k in 0..8 {
            zeros[k] += block[k] * 0.0;
        }
    }
    zeros.iter().chain(rest).all(|x| x.is_finite())
}

/// Refuse values that are not finite. Errors: `Input`, with the first bad index if there are several values.
pub fn finite(argument: &str, values: &[f64]) -> Result<()> {
    if all_finite(values) {
        return Ok(());
    }
    match values.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(i) if values.len() == 1 => Err(Error::input(argument, format!("is not finite: expected a finite number, got {}", values[i]))),
        Some(i) => Err(Error::input(argument, format!("is not finite: expected finite numbers, got {}", values[i])).at([i])),
    }
}

/// Refuse a number that is not positive and finite. Errors: `Input`.
pub fn positive(argument: &str, x: f64) -> Result<()> {
    if x > 0.0 && x.is_finite() {
        return Ok(());
    }
    Err(Error::input(argument, format!("is not positive: expected a finite number > 0, got {x}")))
}
