//! The five maps from task velocities to joint velocities, and what they need.

use crate::error::{Error, Result};

/// Relative error of the entries of a Jacobian that is exact up to rounding; `8 eps (1 + sum|q|)` if an arm computes it.
pub const DEFAULT_ROUNDING: f64 = 8.0 * f64::EPSILON;

/// Default `eps` of a level, as a fraction of the norm of its largest row.
pub const DEFAULT_EPS: f64 = 0.02;

/// How a level's projected Jacobian `A_i = J_i N` is inverted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum PriorityMethod {
    /// Equation (5): the pseudo-inverse with scale-aware ranks. Discontinuous at singularities; never disturbs a higher level.
    Exact,
    /// Spectral clamp `s -> s / max(s, eps)^2`: continuous, bounded by `1/eps`, equal to (5) where all `s >= eps`.
    #[default]
    Clamp,
    /// Damped least squares `s -> s / (s^2 + lambda^2)`, `lambda = eps (1 - w)`, `w = prod min(1, s/eps)`: the manipulability
    /// relative to the one at the threshold (Nakamura and Hanafusa 1986, `nakamura1986inverse`).
    Damped,
    /// `v = sum P_{i-1} J_i# v_i` (Chiaverini 1997, `chiaverini1997singularity`): there are no algorithmic singularities, because no
    /// projected matrix is inverted. In return, lower levels have an error wherever tasks are not orthogonal.
    Chiaverini,
    /// Saturation in the null space (Flacco, De Luca, Khatib 2015, `flacco2015saturation`): joint bounds by fixing
    /// saturated joints and scaling the task, direction kept.
    Sns,
}

impl PriorityMethod {
    /// All methods.
    pub const ALL: [PriorityMethod; 5] =
        [PriorityMethod::Exact, PriorityMethod::Clamp, PriorityMethod::Damped, PriorityMethod::Chiaverini, PriorityMethod::Sns];

    /// Whether the map keeps joint velocities within bounds. In a law the bounds depend on the state, so such a law is not recorded.
    pub fn has_bounds(self) -> bool {
        self == PriorityMethod::Sns
    }

    /// The name used in Python.
    pub fn name(self) -> &'static str {
        match self {
            PriorityMethod::Exact => "exact",
            PriorityMethod::Clamp => "clamp",
            PriorityMethod::Damped => "damped",
            PriorityMethod::Chiaverini => "chiaverini",
            PriorityMethod::Sns => "sns",
        }
    }

    /// The method of that name. Errors: `Input`, listing the names.
    pub fn from_name(name: &str) -> Result<Self> {
        let found = PriorityMethod::ALL.into_iter().find(|m| m.name() == name);
        found.ok_or_else(|| Error::unknown("method", "", PriorityMethod::ALL.map(PriorityMethod::name), name))
    }
}

/// The options of a solver, besides its sizes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct PriorityOptions {
    /// How a level is inverted.
    pub method: PriorityMethod,
    /// Threshold on the singular values of each level, in the unit of the level's Jacobian; one per level or one for all.
    /// `None`: `DEFAULT_EPS` of the level's largest row norm, measured at every solve. Unused by `exact` and `sns`.
    pub eps: Option<Vec<f64>>,
    /// Relative error of the entries of the Jacobians; `None`: `DEFAULT_ROUNDING`.
    pub rounding: Option<f64>,
    /// Symmetric positive definite joint metric `W`, row-major `(n, n)`: the maps minimise `v' W v`. `None`: identity.
    pub weight: Option<Vec<f64>>,
    /// Joint velocity bounds for `sns`, shape `(n,)`, rad/s or m/s; infinite entries are allowed.
    pub v_min: Option<Vec<f64>>,
    /// Upper joint velocity bounds.
    pub v_max: Option<Vec<f64>>,
}

impl PriorityOptions {
    /// The defaults with this method.
    pub fn new(method: PriorityMethod) -> Self {
        PriorityOptions { method, ..PriorityOptions::default() }
    }
}
