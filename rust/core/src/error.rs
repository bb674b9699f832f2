//! What a caller did wrong, or what a solver could not do. Outcomes of a run are data: see `status`.

use crate::interrupt::look;
use crate::status::Status;

/// The errors of the core. The binding maps each variant to its Python class and puts the name of the
/// called function before the message.
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
    /// An argument is not what the function takes: `argument problem: expected .., got .. (first bad index ..)`.
    #[error("{argument} {problem}")]
    Input {
        /// Name of the argument.
        argument: String,
        /// What is wrong with it.
        problem: String,
    },
    /// A robot model is not well formed; `line` is 1-based in `file`.
    #[error("{file}:{line}: {problem}")]
    Model {
        /// Name of the file.
        file: String,
        /// Line, from 1 on.
        line: u32,
        /// What is wrong there.
        problem: String,
    },
    /// A solver ended without an answer, at time (or iteration) `t`.
    #[error("{problem}")]
    Solve {
        /// How it ended.
        status: Status,
        /// Time, s, or iteration.
        t: f64,
        /// What happened.
        problem: String,
    },
    /// Stored data is not in the format it claims.
    #[error("{0}")]
    Format(String),
    /// The result does not fit in memory.
    #[error("the result needs {bytes} bytes, more than can be allocated")]
    Memory {
        /// Size of the result.
        bytes: u128,
    },
}

/// Result with the error of this crate.
pub type Result<T> = std::result::Result<T, Error>;

impl Error {
    /// `argument problem`, the form of every refusal of an argument.
    pub fn input(argument: impl Into<String>, problem: impl Into<String>) -> Self {
        Error::Input { argument: argument.into(), problem: problem.into() }
    }

    /// The same refusal under the name that the argument has for the caller.
    pub fn of_argument(self, argument: impl Into<String>) -> Self {
        match self {
            Error::Input { problem, .. } => Error::input(argument, problem),
            other => other,
        }
    }
}

/// Numbers that are read between two looks whether to stop.
const PIECE: usize = 1 << 16;

/// Whether all are finite.
pub fn all_finite(values: &[f64]) -> bool {
    if values.len() <= PIECE {
        return few_finite(values);
    }
    values.chunks(PIECE).all(|piece| {
        look();
        few_finite(piece)
    })
}

/// Without a branch per number.
fn few_finite(values: &[f64]) -> bool {
    // Zero, or NaN once a number was not finite; apart, so that no sum waits for another.
    let mut zeros = [0.0; 8];
    let (blocks, rest) = values.as_chunks::<8>();
    for block in blocks {
        for k in 0..8 {
            zeros[k] += block[k] * 0.0;
        }
    }
    zeros.iter().chain(rest).all(|x| x.is_finite())
}

/// Refuse a value that is not finite, naming the first bad index.
pub fn finite(argument: &str, values: &[f64]) -> Result<()> {
    if all_finite(values) {
        return Ok(());
    }
    match values.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(i) if values.len() == 1 => Err(Error::input(argument, format!("is not finite: expected a finite number, got {}", values[i]))),
        Some(i) => Err(Error::input(argument, format!("is not finite: expected finite numbers, got {} (first bad index {i})", values[i]))),
    }
}

/// Refuse a number that is not positive and finite.
pub fn positive(argument: &str, x: f64) -> Result<()> {
    if x > 0.0 && x.is_finite() {
        return Ok(());
    }
    Err(Error::input(argument, format!("is not positive: expected a finite number > 0, got {x}")))
}
