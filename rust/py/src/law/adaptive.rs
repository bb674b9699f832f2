//! Adaptive tracking: `armlet.Adaptive`, the law of Slotine and Li with its options.

use super::{Arguments, Law};
use crate::arguments::require_partner;
use crate::arrays::{ArrayArgument, Axis, Form, WHATEVER, flag, name, numbers, owned, shown, text};
use crate::errors::{Failure, input_error};
use armlet_core::error::positive;
use armlet_core::law::{Adaptation, AdaptiveSpec, Base, JointColumn, JointColumns, LawSpec, LeakageForm, Projection, StoredRows};
use armlet_core::linalg::Gain;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyString, PyTuple};

/// Adaptive tracking (Slotine and Li): `tau = Y pi_hat + Kp e + Kd e_dot`, `pi_hat_dot = Gamma Y' s`.
///
/// `e = q_d - q`, `Lambda = Kd^-1 Kp`, `v_r = v_d + Lambda e`, `a_r = a_d + Lambda e_dot`, `s = v_r - v`, and `Y(q, v, v_r, a_r)` is the
/// arm's regressor. Without leakage and dead zone, the error `e` converges to zero from every initial state and every initial estimate.
/// This requires a rigid plant with the structure of the model, without sampling, torque limits and other forces. The estimate `pi_hat`
/// converges to the true parameters `pi` only under excitation. Without `armature=True` the rotor inertia is known, and the law adds
/// `armature a_r` to the torque.
///
/// The estimate has all inertial parameters, or the base set of inertial parameters. After them it has the requested parameters of joints
/// (friction, rotor inertia), each with its column of `Y`. The columns are `a_r` (rotor inertia), `v_r` (damping), `tanh(v_r / v_s)`
/// (Coulomb friction) and `exp(-(v_r / v_s)^2) tanh(v_r / v_s)` (Stribeck friction). `parameter_names` lists all parameters.
///
/// With leakage, `pi_hat_dot = Gamma (Y' s - sigma (pi_hat - pi_0))`. With `composite=R`, `pi_hat_dot = Gamma (Y' s + W' R e_W)` with
/// `e_W = tau_W - W pi_hat`. `W` is the filtered regressor, and `tau_W` the filtered torque. The filter is `1/(p + lambda)` with the Laplace
/// variable `p`, so the equation of motion becomes `tau_W = W pi`, which contains no acceleration. The filter uses the law's output as the
/// torque. So composite adaptation does not allow saturation, or other torques on the arm. With `composite`, `terms` has `W`, `tau_W` and
/// `e_W`. The law's state is then the estimate, followed by `n b + k + n` states of the filters. Each of b inertial parameters has `n` of
/// these states, each of k joint parameters has one, and the torques have `n`.
///
/// Args:
///     arm: the arm whose regressor is used. Its inertial parameters are not used.
///     motion: the desired motion of the joints.
///     kp, kd: positive definite gains, N m/rad and N m s/rad (N/m, N s/m): scalar, `(n,)` or `(n, n)`.
///     gamma: positive definite adaptation gain: scalar, `(p,)` or `(p, p)`, where p is the size of the estimate. The unit of entry
///         `(i, j)` is the unit of `a_i` times the unit of `a_j`, per N m.
///     estimate: initial estimate, `(p,)`, kg, kg m, kg m^2 and units of friction; zero if None (keyword only).
///     friction: estimate friction: True for "viscous" and "coulomb", or some of "viscous", "coulomb", "stribeck" (keyword only).
///     armature: estimate the rotors' inertia (keyword only).
///
/// Other Args:
///     base: the result of `arm.base_parameters()`: the law estimates only this base set (keyword only).
///     natural: adapt in the metric of the bodies' pseudo-inertias (keyword only). It requires a physically possible initial estimate,
///         which then stays physically possible. `gamma` is a scalar, or one number per body, 1/(N m), and then one per joint parameter, in
///         its squared unit per N m. It cannot be combined with `base` or `projection`.
///     projection: lower bound that keeps the estimated bodies physically possible (keyword only). In continuous time, the pseudo-inertia
///         of each body `k` stays above half of its bound: `P_k >= P_k^min / 2`. The argument is the mass of the bounds of all bodies, kg,
///         with a radius of gyration of 0.141 m about each axis. It may also be the inertial parameters of all bounds, in the shape of `arm.parameters`. The
///         true bodies must exceed the bounds. An initial estimate below the bounds is replaced by the nearest estimate that satisfies
///         them. It cannot be combined with `natural` or `base`.
///     offset: estimate a constant torque of each joint, such as the offset of a torque sensor or a constant load (keyword only).
///     friction_speed: `v_s` of "coulomb" and "stribeck", rad/s or m/s, > 0: scalar or `(n,)`; 0.1 if None (keyword only).
///     leakage: `sigma`, >= 0 (keyword only). Its unit is 1/s divided by the unit of `gamma`. With `leakage_form="e"` the unit is 1/rad or
///         1/m divided by the unit of `gamma`.
///     leakage_form: "sigma" for the constant `sigma`, "e" for `sigma |s|` in its place (e-modification) (keyword only).
///     leakage_centre: `pi_0`, `(p,)`, in the units of the estimate; the initial estimate if None (keyword only).
///     dead_zone: `s_0`, >= 0, rad/s or m/s: the estimate is constant while the norm of `s` is below it (keyword only).
///     composite: positive definite weight `R` of `e_W`, 1/(N m s^3): scalar, `(n,)` or `(n, n)`; None: no composite adaptation
///         (keyword only).
///     composite_rate: `lambda` of the filter, 1/s, > 0 (keyword only).
///     concurrent: samples of recorded motion and torque, from `al.select_samples` (keyword only). Concurrent learning adds
///         `sum_j W_j' R e_j`, `e_j = tau_j - W_j pi_hat`, to `Y' s`. The estimate then converges without excitation, if the samples
///         determine the parameters.
///     concurrent_weight: positive definite weight `R` of each sample: scalar, `(n,)` or `(n, n)` (keyword only). Its unit is 1/(N m s)
///         for samples with accelerations, and 1/(N m s^3) for windows.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite or out of its range, a gain is not positive definite, or a name is unknown. It is
///         also raised for `friction_speed`, `leakage_form`, `leakage_centre`, `composite_rate` or `concurrent_weight` without `friction`,
///         `leakage`, `composite` or `concurrent`.
///
/// Source: Slotine and Li, On the adaptive control of robot manipulators, IJRR 6(3), 1987.
/// Natural metric: Lee, Kwon and Park, A natural adaptive control law for robot manipulators, IROS 2018.
/// Projection: Pomet and Praly, Adaptive nonlinear regulation, IEEE TAC 37(6), 1992.
/// Leakage: Ioannou and Kokotovic, Instability analysis and improvement of robustness of adaptive control, Automatica 20(5), 1984.
/// E-modification: Narendra and Annaswamy, A new adaptive law for robust adaptation without persistent excitation, IEEE TAC 32(2), 1987.
/// Composite: Slotine and Li, Composite adaptive control of robot manipulators, Automatica 25(4), 1989.
/// Concurrent learning: Chowdhary and Johnson, Concurrent learning for convergence in adaptive control without persistency of excitation,
/// CDC 2010.
///
/// >>> import armlet as al
/// >>> arm = al.planar_pr(2.0, 0.5, 0.5)
/// >>> law = al.Adaptive(arm, al.Hold([1.0, 0.0]), kp=40.0, kd=20.0, gamma=5.0)
/// >>> law(0.0, [0.0, 0.0], [0.0, 0.0])
/// array([40.,  0.])
/// >>> rubbing = al.Adaptive(arm, al.Hold([1.0, 0.0]), 40.0, 20.0, 5.0, friction=True, leakage=0.01)
/// >>> rubbing.parameter_names
/// ('A', 'B', 'C', 'damping[p1]', 'damping[r2]', 'friction[p1]', 'friction[r2]')
#[pyclass(frozen, extends = Law, module = "armlet")]
pub struct Adaptive;

/// Read the base set: the columns and the projection of a `BaseParameters`.
fn base_of<'py>(given: &mut Arguments<'py>, base: &Bound<'py, PyAny>, p: usize) -> Result<Base, Failure> {
    let refused = || input_error(base.py(), "Adaptive", "base", "is not a base set: expected the result of arm.base_parameters(), or None");
    let field = |name: &str| base.getattr(name).map_err(|_| refused());
    let columns: Vec<usize> = field("columns")?.call_method0("tolist")?.extract().map_err(|_| refused())?;
    let field = field("projection")?;
    let (shape, projection) = numbers("Adaptive", "base", &field, &[WHATEVER])?;
    let projection = owned(projection)?;
    if shape != [columns.len(), p] {
        let problem =
            format!("is of another arm or has columns of friction: expected a projection ({}, {p}), got {}", columns.len(), shown(&shape));
        return Err(input_error(base.py(), "Adaptive", "base", problem).into());
    }
    given.store("base", base);
    Ok(Base { columns, projection })
}

/// The root mean square distance, m, of the lower bound of a body from each plane through its centre, if `projection` is a mass. The radius
/// of gyration about an axis is `sqrt(2)` times this length. `project_parameters` uses the same length.
const LENGTH: f64 = 0.1;

/// Read the lower bounds of the projection: one mass, kg, for all bodies, or the `p` inertial parameters of the bounds.
fn projection_of<'py>(given: &mut Arguments<'py>, projection: &Bound<'py, PyAny>, p: usize) -> Result<Projection, Failure> {
    if ArrayArgument::new("Adaptive", "projection", projection)?.shape.is_empty() {
        let mass = given.number("projection", projection)?;
        return Ok(Projection::of_mass(p, mass, LENGTH)?);
    }
    Ok(Projection::new(p, &given.vector("projection", projection, p)?)?)
}

/// The default of `v_s`, rad/s or m/s. In the estimated Coulomb friction, `tanh(v_r / v_s)` replaces the sign of `v_r`.
pub(super) const FRICTION_SPEED: f64 = 0.1;

/// Read the kinds of friction that the law estimates: a flag, a name, or several names.
fn kinds_of(friction: &Bound<'_, PyAny>) -> Result<Vec<JointColumn>, Failure> {
    let py = friction.py();
    if friction.is_instance_of::<PyBool>() {
        let both = vec![JointColumn::Viscous, JointColumn::Coulomb];
        return Ok(if flag("Adaptive", "friction", friction)? { both } else { Vec::new() });
    }
    let refused = |got: String| {
        let problem = format!("is unknown: expected a flag or some of 'viscous', 'coulomb', 'stribeck', got {got}");
        Failure::from(input_error(py, "Adaptive", "friction", problem))
    };
    let shown = || friction.repr().map_or_else(|_| "an object".into(), |text| text.to_string());
    let names = if friction.is_instance_of::<PyString>() {
        vec![friction.clone()]
    } else {
        let listed = friction.try_iter().map_err(|_| refused(shown()))?;
        listed.take(16).collect::<PyResult<Vec<_>>>()?
    };
    let mut kinds = Vec::new();
    for (i, given) in names.iter().enumerate() {
        if !given.is_instance_of::<PyString>() {
            return Err(refused(shown()));
        }
        let kind = match name("Adaptive", "friction", given)? {
            "viscous" => JointColumn::Viscous,
            "coulomb" => JointColumn::Coulomb,
            "stribeck" => JointColumn::Stribeck,
            other => return Err(refused(format!("{other:?} (first bad index {i})"))),
        };
        if kinds.contains(&kind) {
            return Err(input_error(py, "Adaptive", "friction", format!("is named twice (first bad index {i})")).into());
        }
        kinds.push(kind);
    }
    Ok(kinds)
}

/// Read the kinds of joint parameters that the law estimates, and the speeds `v_s`.
fn columns_of<'py>(
    given: &mut Arguments<'py>,
    n: usize,
    friction: Option<&Bound<'py, PyAny>>,
    [armature, offset]: [Option<&Bound<'py, PyAny>>; 2],
    speed: Option<&Bound<'py, PyAny>>,
) -> Result<JointColumns, Failure> {
    let mut kinds = friction.map(kinds_of).transpose()?.unwrap_or_default();
    if let (Some(friction), false) = (friction, kinds.is_empty()) {
        let stored = if friction.is_instance_of::<PyBool>() || friction.is_instance_of::<PyString>() {
            friction.clone()
        } else {
            PyTuple::new(friction.py(), friction.try_iter()?.collect::<PyResult<Vec<_>>>()?)?.into_any()
        };
        given.store("friction", &stored);
    }
    if given.flag("armature", armature)? {
        kinds.push(JointColumn::Armature);
    }
    if given.flag("offset", offset)? {
        kinds.push(JointColumn::Offset);
    }
    let smooth = kinds.iter().any(|kind| matches!(kind, JointColumn::Coulomb | JointColumn::Stribeck));
    require_partner("Adaptive", "friction_speed", speed, "friction of the kind 'coulomb' or 'stribeck'", smooth)?;
    let speeds = given.rows("friction_speed", speed, n)?.unwrap_or_else(|| vec![FRICTION_SPEED; n]);
    let columns = JointColumns::new(n, &kinds, speeds)?;
    Ok(if kinds.is_empty() { JointColumns::default() } else { columns })
}

/// Add leakage and the dead zone to the law.
fn with_leakage_and_dead_zone<'py>(
    given: &mut Arguments<'py>,
    spec: AdaptiveSpec,
    leakage: Option<&Bound<'py, PyAny>>,
    [form, centre]: [Option<&Bound<'py, PyAny>>; 2],
    dead_zone: Option<&Bound<'py, PyAny>>,
) -> Result<AdaptiveSpec, Failure> {
    let p = spec.parameter_names().len();
    for (name, value) in [("leakage_form", form), ("leakage_centre", centre)] {
        require_partner("Adaptive", name, value, "leakage", leakage.is_some())?;
    }
    let sigma = leakage.map(|leakage| given.number("leakage", leakage)).transpose()?.unwrap_or(0.0);
    let form = match form {
        None => LeakageForm::Sigma,
        Some(value) => {
            let form = match text("Adaptive", "leakage_form", value)?.as_str() {
                "sigma" => LeakageForm::Sigma,
                "e" => LeakageForm::Error,
                other => {
                    let problem = format!("is unknown: expected 'sigma' or 'e', got {other:?}");
                    return Err(input_error(value.py(), "Adaptive", "leakage_form", problem).into());
                }
            };
            given.store("leakage_form", value);
            form
        }
    };
    let centre = centre.map(|centre| given.vector("leakage_centre", centre, p)).transpose()?;
    let spec = spec.leaking(sigma, form, centre)?;
    let s_0 = dead_zone.map(|zone| given.number("dead_zone", zone)).transpose()?.unwrap_or(0.0);
    Ok(spec.resting_below(s_0)?)
}

/// The default of `lambda`, 1/s: the bandwidth of the filters of composite adaptation.
const COMPOSITE_RATE: f64 = 10.0;

/// Add composite adaptation to the law, if there is a weight.
fn with_composite<'py>(
    given: &mut Arguments<'py>,
    spec: AdaptiveSpec,
    weight: Option<&Bound<'py, PyAny>>,
    rate: Option<&Bound<'py, PyAny>>,
) -> Result<AdaptiveSpec, Failure> {
    let n = given.model().n();
    let weight = weight.map(|weight| given.gain("composite", weight, n)).transpose()?;
    let value = rate.map(|rate| given.number("composite_rate", rate)).transpose()?.unwrap_or(COMPOSITE_RATE);
    positive("composite_rate", value)?;
    require_partner("Adaptive", "composite_rate", rate, "composite", weight.is_some())?;
    Ok(match weight {
        None => spec,
        Some(weight) => spec.composite(value, weight)?,
    })
}

/// Add concurrent learning to the law, if there are samples.
fn with_concurrent_learning<'py>(
    given: &mut Arguments<'py>,
    spec: AdaptiveSpec,
    stored: Option<&Bound<'py, PyAny>>,
    weight: Option<&Bound<'py, PyAny>>,
) -> Result<AdaptiveSpec, Failure> {
    let (n, p) = (given.model().n(), spec.parameter_names().len());
    let value =
        weight.map_or_else(|| Ok(Gain::scalar("concurrent_weight", n, 1.0)?), |weight| given.gain("concurrent_weight", weight, n))?;
    require_partner("Adaptive", "concurrent_weight", weight, "concurrent", stored.is_some())?;
    let Some(stored) = stored else { return Ok(spec) };
    let field = |name: &str| {
        let problem = "is no set of samples: expected the result of al.select_samples, with W and tau, or None";
        stored.getattr(name).map_err(|_| Failure::from(input_error(stored.py(), "Adaptive", "concurrent", problem)))
    };
    let (w, tau) = (field("W")?, field("tau")?);
    let (shape, rows) = numbers("Adaptive", "concurrent", &w, &[Form(&[Axis::Any("N"), Axis::Is(n), Axis::Is(p)])])?;
    let (_, torques) = numbers("Adaptive", "concurrent", &tau, &[Form(&[Axis::Is(shape[0]), Axis::Is(n)])])?;
    given.store("concurrent", stored);
    Ok(spec.concurrent(StoredRows { rows: owned(rows)?, torques: owned(torques)? }, &value)?)
}

#[entered]
#[pymethods]
impl Adaptive {
    #[new]
    #[arguments(
        arm, motion, kp, kd, gamma, *, estimate=None, base=None, natural=false, projection=None, friction=false, armature=false,
        friction_speed=None, leakage=0.0, leakage_form="sigma", leakage_centre=None, dead_zone=0.0, composite=None, composite_rate=10.0,
        concurrent=None, concurrent_weight=1.0, offset=false
    )]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let model = given.model();
        let (n, p) = (model.n(), model.parameter_count());
        let motion = given.motion("motion", motion)?;
        let (kp, kd) = (given.gain("kp", kp, n)?, given.gain("kd", kd, n)?);
        let base = base.map(|base| base_of(&mut given, base, p)).transpose()?;
        let columns = columns_of(&mut given, n, friction, [armature, offset], friction_speed)?;
        let joint_parameters = columns.count();
        let estimated = base.as_ref().map_or(p, |base| base.columns.len()) + joint_parameters;
        let adaptation = if given.flag("natural", natural)? {
            let bodies = p / 10;
            let gamma = given.gain("gamma", gamma, bodies + joint_parameters)?;
            if !gamma.is_diagonal() {
                let wanted = bodies + joint_parameters;
                let problem = format!("is a matrix: expected a scalar or ({wanted},), one number per body, for natural adaptation");
                return Err(input_error(arm.py(), NAME, "gamma", problem).into());
            }
            Adaptation::Natural((0..bodies + joint_parameters).map(|i| gamma.at(i, i)).collect())
        } else {
            Adaptation::Euclidean(given.gain("gamma", gamma, estimated)?)
        };
        let start = estimate.map(|estimate| given.vector("estimate", estimate, estimated)).transpose()?;
        let mut spec = AdaptiveSpec::with_columns(model, motion, [kp, kd], adaptation, base, columns, start)?;
        if let Some(projection) = projection {
            spec = spec.projected(projection_of(&mut given, projection, p)?)?;
        }
        spec = with_leakage_and_dead_zone(&mut given, spec, leakage, [leakage_form, leakage_centre], dead_zone)?;
        spec = with_composite(&mut given, spec, composite, composite_rate)?;
        spec = with_concurrent_learning(&mut given, spec, concurrent, concurrent_weight)?;
        Ok(given.law(spec).add_subclass(Adaptive))
    }

    /// Names of the `p` estimated parameters, in the order of the estimate.
    #[getter]
    fn parameter_names<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        match &slf.as_super().get().spec {
            LawSpec::Adaptive(law) => PyTuple::new(slf.py(), law.parameter_names()),
            _ => Ok(PyTuple::empty(slf.py())),
        }
    }
}
