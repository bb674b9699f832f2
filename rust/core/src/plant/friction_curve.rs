//! Dry friction of joints as a function of speed and load (Stribeck's curve; Hamon, Gautier and Garrec 2010):
//!
//! `h(v, L) = F_c + (F_s - F_c) exp(-(v / v_s)^2) + mu |L|`,
//!
//! with the Coulomb friction `F_c`, the static friction `F_s` and the Stribeck speed `v_s`. The joint transmits the torque `L` to its load,
//! and `mu` is the ratio of friction to this torque. Viscous friction is not part of `h`.

use crate::error::{Error, Result, finite};
use crate::scalar::hyperbolic::decay;
use crate::scalar::{Real, labelled_numbers};

/// The friction curves of all joints; each parameter is `(n,)`.
///
/// ```
/// use armlet_core::plant::FrictionCurve;
///
/// let curve = FrictionCurve::new(vec![2.0, 1.0], Some(vec![3.0, 1.5]), Some(vec![0.1, 0.1]), None, None)?;
/// assert_eq!((curve.n(), curve.viscous.as_slice()), (2, &[0.0, 0.0][..]));
/// // Static friction is at least the Coulomb friction.
/// let error = FrictionCurve::new(vec![2.0], Some(vec![1.0]), None, None, None).unwrap_err();
/// assert_eq!(error.argument(), Some("static"));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct FrictionCurve {
    /// Coulomb friction `F_c`, N m or N.
    pub coulomb: Vec<f64>,
    /// Static friction `F_s`, N m or N.
    pub breakaway: Vec<f64>,
    /// Stribeck speed `v_s`, rad/s or m/s. With zero, friction drops to `F_c` as soon as the joint moves.
    pub stribeck_speed: Vec<f64>,
    /// Viscous friction, N m s/rad or N s/m.
    pub viscous: Vec<f64>,
    /// Ratio `mu` of friction to load.
    pub load_ratio: Vec<f64>,
}

/// Refuse `values` if `holds` is false for any value. The error names the first refused value.
pub(super) fn require(name: &str, values: &[f64], expected: &str, holds: impl Fn(usize, f64) -> bool) -> Result<()> {
    finite(name, values)?;
    match values.iter().enumerate().find(|&(i, &x)| !holds(i, x)) {
        Some((i, x)) => Err(Error::input(name, format!("is out of range: expected {expected}, got {x}")).at([i])),
        None => Ok(()),
    }
}

/// Refuse `values` that are not `n` numbers.
pub(super) fn require_rows(name: &str, values: &[f64], n: usize) -> Result<()> {
    if values.len() == n { Ok(()) } else { Err(Error::wrong_shape(name, &[n], &[values.len()])) }
}

impl FrictionCurve {
    /// Create a curve for each joint. `None` means `coulomb` for `breakaway`, and zero for the other parameters.
    ///
    /// Errors: `WrongShape` for unequal lengths; `Input` for negative or infinite numbers, `breakaway < coulomb`, or `load_ratio >= 1`.
    pub fn new(
        coulomb: Vec<f64>,
        breakaway: Option<Vec<f64>>,
        stribeck_speed: Option<Vec<f64>>,
        viscous: Option<Vec<f64>>,
        load_ratio: Option<Vec<f64>>,
    ) -> Result<Self> {
        let n = coulomb.len();
        let zeros = |values: Option<Vec<f64>>| values.unwrap_or_else(|| vec![0.0; n]);
        let breakaway = breakaway.unwrap_or_else(|| coulomb.clone());
        let curve = FrictionCurve {
            coulomb,
            breakaway,
            stribeck_speed: zeros(stribeck_speed),
            viscous: zeros(viscous),
            load_ratio: zeros(load_ratio),
        };
        let all = [
            ("coulomb", &curve.coulomb),
            ("static", &curve.breakaway),
            ("stribeck_speed", &curve.stribeck_speed),
            ("viscous", &curve.viscous),
            ("load_ratio", &curve.load_ratio),
        ];
        all.into_iter().try_for_each(|(name, values)| require_rows(name, values, n))?;
        require("coulomb", &curve.coulomb, ">= 0", |_, x| x >= 0.0)?;
        require("static", &curve.breakaway, "at least coulomb", |i, x| x >= curve.coulomb[i])?;
        require("stribeck_speed", &curve.stribeck_speed, ">= 0", |_, x| x >= 0.0)?;
        require("viscous", &curve.viscous, ">= 0", |_, x| x >= 0.0)?;
        require("load_ratio", &curve.load_ratio, ">= 0 and < 1", |_, x| (0.0..1.0).contains(&x))?;
        Ok(curve)
    }

    /// Number of joints.
    pub fn n(&self) -> usize {
        self.coulomb.len()
    }
}

/// A friction curve in a control loop.
#[derive(Clone)]
pub(super) struct LoopCurve<S> {
    coulomb: Vec<S>,
    /// The difference `F_s - F_c` of static and Coulomb friction, N m or N; zero where `v_s` is zero.
    excess: Vec<S>,
    /// The reciprocal `1 / v_s` of the Stribeck speed, s/rad or s/m; zero where `v_s` is zero.
    per_speed: Vec<S>,
    pub viscous: Vec<S>,
    pub load_ratio: Vec<S>,
}

impl<S: Real> LoopCurve<S> {
    pub fn new(curve: &FrictionCurve) -> Self {
        let numbers = |name, x: &dyn Fn(usize) -> f64| S::labelled(name, 1, || (0..curve.n()).map(|i| S::varying(x(i))).collect());
        let smooth = |i: usize| curve.stribeck_speed[i] > 0.0;
        LoopCurve {
            coulomb: labelled_numbers("coulomb_friction", &curve.coulomb),
            excess: numbers("stribeck_friction", &|i| if smooth(i) { curve.breakaway[i] - curve.coulomb[i] } else { 0.0 }),
            per_speed: numbers("inverse_stribeck_speed", &|i| if smooth(i) { curve.stribeck_speed[i].recip() } else { 0.0 }),
            viscous: labelled_numbers("viscous_friction", &curve.viscous),
            load_ratio: labelled_numbers("load_ratio", &curve.load_ratio),
        }
    }

    /// The friction `h(v, 0)` of joint `i` without a load, N m or N.
    pub fn unloaded(&self, i: usize, v: S) -> S {
        let r = v * self.per_speed[i];
        self.excess[i] * decay(r * r) + self.coulomb[i]
    }

    /// The friction `h(v, L)` of joint `i` with the load `L`, N m or N.
    pub fn level(&self, i: usize, v: S, load: S) -> S {
        self.load_ratio[i] * load.abs() + self.unloaded(i, v)
    }
}
