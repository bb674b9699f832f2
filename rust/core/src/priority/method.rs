//! The five methods that map task velocities to joint velocities, and their options.

use crate::error::{Error, Result};

/// The relative error of the entries of a Jacobian that is exact up to rounding. For the Jacobian of an arm, the error is this number times
/// `1 + sum|q|`, at most 0.5.
pub const DEFAULT_ROUNDING: f64 = 8.0 * f64::EPSILON;

/// A level whose squared norm is outside of this range is scaled by a power of two.
pub(super) const TAME: std::ops::Range<f64> = 1e-120..1e120;

/// The default threshold `eps` of a level, divided by the norm of the level's largest row.
pub const DEFAULT_EPS: f64 = 0.02;

/// The method that inverts a level. `A_i = J_i N` is its projected Jacobian, with the null basis `N` of the levels above.
///
/// ```
/// use armlet_core::priority::{PriorityMethod, PriorityOptions, solve_priority};
///
/// // The smallest singular value, 0.01, is below the threshold 0.1.
/// let j = [1.0, 0.0, 0.0, 0.01];
/// let speed = |method| {
///     let options = PriorityOptions { eps: Some(vec![0.1]), ..PriorityOptions::new(method) };
///     solve_priority(2, &[&j], &[&[0.0, 1.0]], &options).map(|solution| solution.v[1])
/// };
/// assert!((speed(PriorityMethod::Exact)? - 100.0).abs() < 1e-9);
/// assert!((speed(PriorityMethod::Clamp)? - 1.0).abs() < 1e-12);
/// assert_eq!(PriorityMethod::from_name("sns")?, PriorityMethod::Sns);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PriorityMethod {
    /// The pseudo-inverse of `A_i`, with a rank that takes the size of `J_i` into account. It is discontinuous at singularities, and never
    /// disturbs a higher level.
    Exact,
    /// Clamp of the singular values `s` of `A_i`: `s -> s / max(s, eps)^2`. It is continuous, bounded by `1/eps`, and equal to `Exact` if
    /// all `s >= eps`.
    #[default]
    Clamp,
    /// Damped least squares `s -> s / (s^2 + lambda^2)` with `lambda = eps (1 - w)`. Here `w = prod min(1, s/eps)` is the manipulability
    /// relative to its value at the threshold (Nakamura and Hanafusa 1986, `nakamura1986inverse`).
    Damped,
    /// `v = sum P_{i-1} J_i# v_i`, where `P_{i-1}` projects on the null space of the levels above (Chiaverini 1997,
    /// `chiaverini1997singularity`). Algorithmic singularities do not occur, because no projected matrix is inverted. In return, lower
    /// levels have an error if tasks are not orthogonal.
    Chiaverini,
    /// `Exact` with scaled commands, whose direction is kept. Each level has the largest scale that the bounds and the higher levels allow.
    /// This is saturation in the null space (Flacco, De Luca, Khatib 2015, `flacco2015saturation`).
    Sns,
}

impl PriorityMethod {
    /// All methods.
    pub const ALL: [PriorityMethod; 5] =
        [PriorityMethod::Exact, PriorityMethod::Clamp, PriorityMethod::Damped, PriorityMethod::Chiaverini, PriorityMethod::Sns];

    /// Whether the method keeps joint velocities within bounds. The active bounds depend on the state, so a law with such a method is not
    /// compiled.
    pub fn has_bounds(self) -> bool {
        self == PriorityMethod::Sns
    }

    /// Whether the method uses the threshold `eps` on singular values.
    pub fn has_threshold(self) -> bool {
        match self {
            PriorityMethod::Clamp | PriorityMethod::Damped | PriorityMethod::Chiaverini => true,
            PriorityMethod::Exact | PriorityMethod::Sns => false,
        }
    }

    /// Whether the method accepts bounds of levels and of joint velocities.
    pub fn accepts_bounds(self) -> bool {
        self != PriorityMethod::Chiaverini
    }

    /// Require a method that accepts bounds, which the argument `name` gives. Error: `Input`.
    pub(crate) fn require_bounds(self, name: &str) -> Result<()> {
        if self.accepts_bounds() {
            return Ok(());
        }
        let problem = format!("bounds nothing: expected clamp, damped, exact or sns, got {}, which accepts no bounds", self.name());
        Err(Error::input(name, problem))
    }

    /// Whether the method can keep the direction of commands by scaling. Damping changes the direction.
    pub fn keeps_direction(self) -> bool {
        matches!(self, PriorityMethod::Exact | PriorityMethod::Sns)
    }

    /// Whether the method damps small singular values of the projected Jacobian.
    pub(super) fn damps(self) -> bool {
        match self {
            PriorityMethod::Clamp | PriorityMethod::Damped => true,
            PriorityMethod::Exact | PriorityMethod::Chiaverini | PriorityMethod::Sns => false,
        }
    }

    /// The name of the method in Python.
    pub fn name(self) -> &'static str {
        match self {
            PriorityMethod::Exact => "exact",
            PriorityMethod::Clamp => "clamp",
            PriorityMethod::Damped => "damped",
            PriorityMethod::Chiaverini => "chiaverini",
            PriorityMethod::Sns => "sns",
        }
    }

    /// Return the method with this name. Errors: `Unknown`, with a list of all names.
    pub fn from_name(name: &str) -> Result<Self> {
        let found = PriorityMethod::ALL.into_iter().find(|m| m.name() == name);
        found.ok_or_else(|| Error::unknown("method", "", PriorityMethod::ALL.map(PriorityMethod::name), name))
    }
}

/// The options of a solver, in addition to its sizes.
///
/// ```
/// use armlet_core::priority::{PriorityMethod, PriorityOptions, solve_priority};
///
/// // The solution minimises `3 v_1^2 + v_2^2`.
/// let options = PriorityOptions { weight: Some(vec![3.0, 0.0, 0.0, 1.0]), ..PriorityOptions::new(PriorityMethod::Exact) };
/// let solution = solve_priority(2, &[&[1.0, 1.0]], &[&[4.0]], &options)?;
/// assert!((solution.v[0] - 1.0).abs() < 1e-14 && (solution.v[1] - 3.0).abs() < 1e-14);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PriorityOptions {
    /// The method that inverts a level.
    pub method: PriorityMethod,
    /// The threshold on the singular values of each level, in the unit of the level's Jacobian: one per level, or one for all. `None` means
    /// `DEFAULT_EPS` multiplied by the level's largest row norm, at every solve. `exact` and `sns` ignore it.
    pub eps: Option<Vec<f64>>,
    /// The relative error of the entries of the Jacobians. `None` means `DEFAULT_ROUNDING`.
    pub rounding: Option<f64>,
    /// The joint metric `W`, shape `(n, n)`, row-major, symmetric and positive definite. Of all `v` with the same task velocities, the
    /// methods prefer the smallest `v' W v`. `None` means the identity.
    pub weight: Option<Vec<f64>>,
    /// Whether the direction of each command is kept: a level that does not reach its command executes the largest feasible multiple of it.
    /// `Exact` with this option is `Sns`; `clamp`, `damped` and `chiaverini` do not accept it.
    pub keep_direction: bool,
    /// For each level, whether bounds `l <= J_i v <= u` replace its task velocity. Empty if no level has bounds.
    pub intervals: Vec<bool>,
    /// The number of first levels that are limits: methods with damping do not damp their steps.
    pub limit_levels: usize,
    /// The lower joint velocity bounds above all levels, shape `(n,)`, rad/s or m/s. Infinite entries are allowed. `None` means `-v_max`.
    pub v_min: Option<Vec<f64>>,
    /// The upper joint velocity bounds above all levels, shape `(n,)`, rad/s or m/s. `None` means `-v_min`.
    pub v_max: Option<Vec<f64>>,
}

impl PriorityOptions {
    /// Whether commands are scaled, so that levels keep their directions.
    pub fn scales_commands(&self) -> bool {
        self.keep_direction || self.method == PriorityMethod::Sns
    }

    /// Return default options with this method.
    pub fn new(method: PriorityMethod) -> Self {
        PriorityOptions { method, ..PriorityOptions::default() }
    }

    /// The lower and upper bounds of the joint velocities, shape `(n,)` each. If only one bound exists, its negative is the other bound.
    pub fn velocity_bounds(&self) -> Option<(Vec<f64>, Vec<f64>)> {
        let mirrored = |x: &Vec<f64>| x.iter().map(|bound| -bound).collect();
        match (&self.v_min, &self.v_max) {
            (Some(low), high) => Some((low.clone(), high.clone().unwrap_or_else(|| mirrored(low)))),
            (None, Some(high)) => Some((mirrored(high), high.clone())),
            (None, None) => None,
        }
    }
}
