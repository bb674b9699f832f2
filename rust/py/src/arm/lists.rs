//! The joints of `Arm.from_chain`, each a dict, and the rows of `Arm.from_dh`, each a dict or four numbers.

use crate::arrays::{ArrayArgument, items, number as scalar, quoted, require_finite, shown, text};
use crate::errors::{Failure, input_error};
use armlet_core::arm::{ChainJoint, DhRow, Follows, JointKind, JointType, Limits};
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// Read a finite number, or a string with a decimal number.
fn number(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<f64, Failure> {
    let decimal = value.extract::<String>().ok().and_then(|text| text.trim().parse().ok());
    let x = decimal.map_or_else(|| scalar(function, name, value), Ok)?;
    require_finite(value.py(), function, name, &[], &[x])?;
    Ok(x)
}

/// Read the entry `key` of dict `i` of a list: a vector of `N` numbers, or `default` if the dict has no such key.
fn entry_of<const N: usize>(
    function: &str,
    joint: &Bound<'_, PyDict>,
    (list, i): (&str, usize),
    key: &str,
    default: [f64; N],
) -> Result<[f64; N], Failure> {
    let Some(value) = joint.get_item(key)? else { return Ok(default) };
    let name = format!("{list}[{i}][{key:?}]");
    let items = items(function, &name, &format!("a list: expected {N} numbers"), &value, 1024)?;
    if items.len() != N {
        let problem = format!("has the wrong length: expected {N}, got {}", items.len());
        return Err(input_error(joint.py(), function, &name, problem).into());
    }
    let mut out = [0.0; N];
    for (x, item) in out.iter_mut().zip(&items) {
        *x = number(function, &name, item)?;
    }
    Ok(out)
}

/// Read the entry `key` of dict `i` of a list: a number, or `default` if the dict has no such key.
fn scalar_of(function: &str, joint: &Bound<'_, PyDict>, (list, i): (&str, usize), key: &str, default: f64) -> Result<f64, Failure> {
    joint.get_item(key)?.map_or(Ok(default), |value| number(function, &format!("{list}[{i}][{key:?}]"), &value))
}

/// Refuse unknown keys. Otherwise a misspelt key would have its default without any message.
fn known_keys(function: &str, given: &Bound<'_, PyDict>, (list, i): (&str, usize), known: &[&str]) -> Result<(), Failure> {
    for key in given.keys() {
        if !key.extract::<String>().is_ok_and(|key| known.contains(&key.as_str())) {
            let problem = format!("has an unknown key: expected one of {}, got {}", known.join(", "), quoted(&key));
            return Err(input_error(given.py(), function, &format!("{list}[{i}]"), problem).into());
        }
    }
    Ok(())
}

const CHAIN_KEYS: [&str; 15] = [
    "type", "axis", "rpy", "xyz", "phi", "parent", "name", "lower", "upper", "velocity", "effort", "armature", "damping", "friction",
    "mimic",
];
const MIMIC_KEYS: [&str; 3] = ["joint", "multiplier", "offset"];
const DH_KEYS: [&str; 6] = ["type", "a", "alpha", "d", "theta", "phi"];

pub fn chain_joint(function: &str, joint: &Bound<'_, PyAny>, i: usize) -> Result<ChainJoint, Failure> {
    let (py, at) = (joint.py(), ("joints", i));
    let refuse = |key: &str, problem: String| -> Failure { input_error(py, function, &format!("joints[{i}]{key}"), problem).into() };
    let joint = joint.cast::<PyDict>().map_err(|_| refuse("", format!("is not a dict: got {}", joint.get_type())))?;
    known_keys(function, joint, at, &CHAIN_KEYS)?;
    let kind = joint.get_item("type")?.and_then(|kind| kind.extract::<String>().ok());
    let Some(kind) = kind.as_deref().and_then(JointType::parse) else {
        let got = joint.get_item("type")?.map_or("nothing".to_string(), |kind| quoted(&kind));
        return Err(refuse(
            "[\"type\"]",
            format!("is unknown: expected one of R, P, F, revolute, continuous, prismatic, fixed, got {got}"),
        ));
    };
    let axis = entry_of(function, joint, at, "axis", [0.0, 0.0, 1.0])?;
    let (rpy, xyz) = (entry_of(function, joint, at, "rpy", [0.0; 3])?, entry_of(function, joint, at, "xyz", [0.0; 3])?);
    let mut out = ChainJoint::new(kind, axis, rpy, xyz, entry_of(function, joint, at, "phi", [0.0; 10])?);
    if let Some(name) = joint.get_item("name")? {
        out.name = Some(text(function, &format!("joints[{i}][\"name\"]"), &name)?);
    }
    if let Some(parent) = joint.get_item("parent")? {
        let parent: Option<i64> =
            parent.extract().map_err(|_| refuse("[\"parent\"]", "is not an index: expected an integer or None".into()))?;
        out.parent = Some(match parent {
            None | Some(-1) => None,
            Some(p) if p >= 0 => Some(p as usize),
            Some(p) => return Err(refuse("[\"parent\"]", format!("is not an index: expected -1, None or an earlier joint, got {p}"))),
        });
    }
    // An infinite number means that there is no limit, as in `Arm.limits`.
    let limit = |key: &str, none: f64| match joint.get_item(key)? {
        Some(value) if scalar(function, &format!("joints[{i}][{key:?}]"), &value).is_ok_and(|x| x == none) => Ok(none),
        _ => scalar_of(function, joint, at, key, none),
    };
    let infinity = f64::INFINITY;
    out.limits = Limits {
        lower: limit("lower", -infinity)?,
        upper: limit("upper", infinity)?,
        velocity: limit("velocity", infinity)?,
        effort: limit("effort", infinity)?,
    };
    out.armature = scalar_of(function, joint, at, "armature", 0.0)?;
    out.damping = scalar_of(function, joint, at, "damping", 0.0)?;
    out.friction = scalar_of(function, joint, at, "friction", 0.0)?;
    let Limits { lower, upper, velocity, effort } = out.limits;
    let others =
        [("velocity", velocity), ("effort", effort), ("armature", out.armature), ("damping", out.damping), ("friction", out.friction)];
    if let Some((key, value)) = others.into_iter().find(|(_, value)| *value < 0.0) {
        return Err(refuse(&format!("[{key:?}]"), format!("is negative: expected a number >= 0, got {value}")));
    }
    if lower > upper {
        return Err(refuse("[\"lower\"]", format!("is above the upper limit: expected at most {upper}, got {lower}")));
    }
    if let Some(given) = joint.get_item("mimic")?.filter(|given| !given.is_none()) {
        out.mimic = Some(mimic(function, &given, i)?);
    }
    Ok(out)
}

/// Read the mimic entry of joint `i`: the index of its leader, the multiplier and the offset.
fn mimic(function: &str, given: &Bound<'_, PyAny>, i: usize) -> Result<Follows, Failure> {
    let place = format!("joints[{i}][\"mimic\"]");
    let refuse = |problem: String| -> Failure { input_error(given.py(), function, &place, problem).into() };
    let Ok(given) = given.cast::<PyDict>() else {
        return Err(refuse(format!("is not a dict: expected joint, multiplier and offset, got {}", given.get_type())));
    };
    known_keys(function, given, ("mimic of joints", i), &MIMIC_KEYS)?;
    let leader = given.get_item("joint")?.and_then(|leader| leader.extract::<usize>().ok());
    let leader = leader.ok_or_else(|| refuse("has no joint: expected the index of its leader".into()))?;
    let number_of =
        |key: &str, default: f64| given.get_item(key)?.map_or(Ok(default), |value| number(function, &format!("{place}[{key:?}]"), &value));
    Ok((leader, number_of("multiplier", 1.0)?, number_of("offset", 0.0)?))
}

pub fn dh_row(function: &str, row: &Bound<'_, PyAny>, i: usize) -> Result<DhRow, Failure> {
    let py = row.py();
    if let Ok(joint) = row.cast::<PyDict>() {
        let at = ("rows", i);
        known_keys(function, joint, at, &DH_KEYS)?;
        let kind = match joint.get_item("type")? {
            None => JointKind::Revolute,
            Some(given) => match given.extract::<String>().ok().as_deref().and_then(JointType::parse) {
                Some(JointType::Moving(kind)) => kind,
                _ => {
                    let problem = format!("is unknown: expected one of R, P, revolute, continuous, prismatic, got {}", quoted(&given));
                    return Err(input_error(py, function, &format!("rows[{i}][\"type\"]"), problem).into());
                }
            },
        };
        let get = |key: &str| scalar_of(function, joint, at, key, 0.0);
        let phi = entry_of(function, joint, at, "phi", [0.0; 10])?;
        return Ok(DhRow { kind, a: get("a")?, alpha: get("alpha")?, d: get("d")?, theta: get("theta")?, phi });
    }
    let name = format!("rows[{i}]");
    let argument = ArrayArgument::new(function, &name, row)?;
    if argument.shape != [4] {
        let shape = &argument.shape;
        let problem = format!("has the wrong shape: expected (4,) (a, alpha, d, theta) or a dict, got {}", shown(shape));
        return Err(input_error(py, function, &name, problem).into());
    }
    let (shape, x) = argument.values()?;
    require_finite(py, function, &name, &shape, &x)?;
    Ok(DhRow { kind: JointKind::Revolute, a: x[0], alpha: x[1], d: x[2], theta: x[3], phi: [0.0; 10] })
}

/// The largest number of joints in a list.
const MOST_JOINTS: usize = 1 << 24;

pub fn as_list<'py>(function: &str, name: &str, value: &Bound<'py, PyAny>) -> Result<Vec<Bound<'py, PyAny>>, Failure> {
    items(function, name, "a list: expected one entry per joint", value, MOST_JOINTS)
}
