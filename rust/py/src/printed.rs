//! C code of laws, observers and functions of arms: the files of `armlet.export_c`, as pairs of a name and a text.

use crate::arguments::require_partner;
use crate::arm::Arm;
use crate::arrays::{Axis, Form, SCALAR, flag, items, name, numbers, object, optional_number, spread, text};
use crate::errors::{Failure, input_error};
use crate::interrupts::long;
use crate::law::Law;
use crate::observer::MomentumObserver;
use armlet_core::dynamics::{CFunction, Quantity, Query};
use armlet_core::integrate::{Method, MethodKind};
use armlet_core::law::CLoop;
use armlet_core::trace::c::{CFile, COptions};
use armlet_macros::entered;
use pyo3::prelude::*;

const EXPORT: &str = "export_c";

/// The largest number of functions of an arm in one export.
const MOST_FUNCTIONS: usize = 10_000;

/// A function of an arm: its name in C without the prefix, the name of its quantity, and a frame or `None`.
type Named<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Option<Bound<'py, PyAny>>);

fn options(prefix: &Bound<'_, PyAny>, fused: Option<&Bound<'_, PyAny>>) -> Result<COptions, Failure> {
    let options = COptions::new(text(EXPORT, "prefix", prefix)?);
    Ok(match fused {
        Some(fused) => COptions { fused: flag(EXPORT, "fused", fused)?, ..options },
        None => options,
    })
}

fn pairs(files: Vec<CFile>) -> Vec<(String, String)> {
    files.into_iter().map(|file| (file.name, file.text)).collect()
}

/// Return the C files of a law. `armlet.export_c` documents the arguments.
#[entered]
#[pyfunction]
#[arguments(law, prefix, fused, dt, method, sample_time, tau_max)]
pub fn _c_of_law<'py>(
    fused: Option<&Bound<'py, PyAny>>,
    dt: Option<&Bound<'py, PyAny>>,
    sample_time: Option<&Bound<'py, PyAny>>,
    tau_max: Option<&Bound<'py, PyAny>>,
) -> Result<Vec<(String, String)>, Failure> {
    const NAME: &str = EXPORT;
    let law = object::<Law>(NAME, "law", "an arm or a law such as Adaptive", law)?;
    let (state, samples) = (!law.get().spec.initial_state().is_empty(), law.get().spec.samples());
    let given_dt = dt;
    let (options, dt, given) = (options(prefix, fused)?, optional_number(NAME, "dt", dt)?, name(NAME, "method", method)?);
    let fixed: Vec<Method> = Method::ALL.iter().copied().filter(|method| matches!(method.kind(), MethodKind::ExplicitSteps(_))).collect();
    let Some(chosen) = fixed.iter().find(|method| method.name() == given) else {
        let names: Vec<&str> = fixed.iter().map(|method| method.name()).collect();
        return Err(input_error(py, NAME, "method", format!("is unknown: expected one of {}, got {given:?}", names.join(", "))).into());
    };
    let spec = law.get().spec.clone();
    require_partner(NAME, "method", (chosen.name() != "rk4").then_some(method), "a law with a state", state)?;
    let n = spec.model().n();
    let limits = |given| -> Result<Vec<f64>, Failure> {
        let (shape, values) = numbers(NAME, "tau_max", given, &[SCALAR, Form(&[Axis::Is(n)])])?;
        spread(&shape, values, n)
    };
    let period = optional_number(NAME, "sample_time", sample_time)?;
    // The core refuses invalid times.
    let invalid = |time: Option<f64>| time.is_some_and(|time| !(time > 0.0 && time.is_finite()));
    require_partner(NAME, "dt", given_dt, "a law with a state", state || invalid(dt))?;
    require_partner(NAME, "sample_time", sample_time, "a Guarded law or limits", samples || invalid(period))?;
    let timing = CLoop { dt, sample_time: period, rk4: chosen.name() == "rk4", tau_max: tau_max.map(limits).transpose()? };
    Ok(pairs(long(py, || spec.export_c(&options, &timing))?))
}

/// Return the C files of an observer. `armlet.export_c` documents the arguments.
#[entered]
#[pyfunction]
#[arguments(observer, prefix, fused)]
pub fn _c_of_observer<'py>(fused: Option<&Bound<'py, PyAny>>) -> Result<Vec<(String, String)>, Failure> {
    const NAME: &str = EXPORT;
    let observer = object::<MomentumObserver>(NAME, "observer", "an observer such as MomentumObserver", observer)?;
    let options = options(prefix, fused)?;
    Ok(pairs(observer.get().printed(py, &options)?))
}

/// Return the C files of functions of an arm. Each entry of `functions` is a name in C without the prefix, the name of a quantity, and a
/// frame or None.
#[entered]
#[pyfunction]
#[arguments(arm, functions, prefix, fused, friction, armature)]
pub fn _c_of_arm<'py>(fused: Option<&Bound<'py, PyAny>>) -> Result<Vec<(String, String)>, Failure> {
    const NAME: &str = EXPORT;
    let arm = object::<Arm>(NAME, "arm", "an arm or a law such as Adaptive", arm)?;
    let (options, friction, armature) = (options(prefix, fused)?, flag(NAME, "friction", friction)?, flag(NAME, "armature", armature)?);
    let model = &arm.get().model;
    let one = |(name, function, frame): Named| {
        let (name, function) = (text(NAME, "functions", &name)?, text(NAME, "functions", &function)?);
        let Some(&(_, quantity)) = Quantity::PRINTED.iter().find(|(known, _)| *known == function) else {
            let known: Vec<&str> = Quantity::PRINTED.iter().map(|(name, _)| *name).collect();
            let problem = format!("has one that is unknown: expected some of {}, got {function:?}", known.join(", "));
            return Err(input_error(py, NAME, "functions", problem).into());
        };
        let frame = match &frame {
            Some(frame) => Some(model.frame(crate::arrays::name(NAME, "functions", frame)?)?),
            None => None,
        };
        let loaded = matches!(quantity, Quantity::InverseDynamics | Quantity::ForwardDynamics);
        let slopes = matches!(quantity, Quantity::InverseDynamicsDerivatives | Quantity::ForwardDynamicsDerivatives);
        let rubs = loaded || slopes || matches!(quantity, Quantity::Bias | Quantity::Regressor);
        let query = Query {
            frame: frame.unwrap_or(0),
            wrench: frame.filter(|_| loaded),
            friction: friction && rubs,
            armature: armature && quantity == Quantity::Regressor,
            ..quantity.into()
        };
        Ok::<_, Failure>(CFunction { name, query })
    };
    let given = items(NAME, "functions", "a list of functions: expected triples of texts", functions, MOST_FUNCTIONS)?;
    let triples = given.iter().map(|triple| triple.extract::<Named>()).collect::<PyResult<Vec<_>>>()?;
    let functions = triples.into_iter().map(one).collect::<Result<Vec<_>, Failure>>()?;
    let core = model.core();
    Ok(pairs(long(py, || core.export_c(&functions, &options))?))
}
