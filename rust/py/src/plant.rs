//! The plants `armlet.RigidArm`, `armlet.ElasticArm` and `armlet.VelocityArm`, and `armlet.Wall`, which a plant may touch.

use crate::arguments::Arguments;
use crate::arm::Arm;
use crate::arrays::{number, object, quoted, text, three};
use crate::constructor_call::{NamedValues, defined_by_arguments};
use crate::errors::{Failure, input_error};
use crate::friction;
use crate::seal::{Sealed, seal_new};
use armlet_core::plant::{ElasticSpec, JointFriction, PlantSpec, RigidSpec, Stops, VelocitySpec, Wall as CoreWall};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyTuple};

/// A controlled system. This is the base class of all plants.
#[pyclass(frozen, subclass, module = "armlet", name = "Plant")]
pub struct Plant {
    pub spec: PlantSpec,
    /// The arm of the plant.
    #[pyo3(get)]
    pub arm: Py<Arm>,
    arguments: NamedValues,
}

impl Arguments<'_> {
    /// Make the Python object of a plant from its arguments and its specification.
    fn plant(self, spec: PlantSpec) -> PyClassInitializer<Plant> {
        PyClassInitializer::from(Plant { spec, arm: self.arm.unbind(), arguments: self.arguments })
    }
}

defined_by_arguments!(Plant, arm);

#[entered]
#[pymethods]
impl Plant {
    /// The names of the parts of the state, without the bristles of friction. Each part has one number per joint.
    #[getter]
    fn _parts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.spec.kind().parts())
    }
}

/// A compliant wall that the origin of a frame may touch.
///
/// At the depth `d > 0` in the wall, the force on the frame is `f = n max(0, k d + c d_dot)` with the unit normal `n`. The wall never
/// pulls.
///
/// Args:
///     frame: name of the frame that touches the wall.
///     point: a point of the surface, `(3,)`, world axes, m.
///     normal: direction out of the wall, `(3,)`, world axes, of any length > 0.
///     stiffness: `k`, N/m, > 0 (keyword only).
///     damping: `c`, N s/m, >= 0; zero if None (keyword only).
///
/// Raises:
///     InputError: a shape is wrong, or a number is not finite or has the wrong sign.
///
/// Source: docs/plants_and_laws.md.
///
/// >>> import armlet as al
/// >>> al.Wall("link2", [0.7, 0.0, 0.0], [-1.0, 0.0, 0.0], stiffness=1e4, damping=10.0)
/// Wall('link2', point=[0.7, 0.0, 0.0], normal=[-1.0, 0.0, 0.0], stiffness=10000.0, damping=10.0)
#[pyclass(frozen, module = "armlet")]
pub struct Wall {
    frame: String,
    core: CoreWall,
}

/// The name of the frame, the point and the normal of a wall.
type Placed = (String, [f64; 3], [f64; 3]);

#[entered]
#[pymethods]
impl Wall {
    #[new]
    #[arguments(frame, point, normal, *, stiffness, damping=None)]
    fn new() -> Result<Self, Failure> {
        let damping = damping.map_or(Ok(0.0), |damping| number(NAME, "damping", damping))?;
        let stiffness = number(NAME, "stiffness", stiffness)?;
        // The index 0 is a placeholder, because a wall does not know its arm. The constructor of a plant finds the index of the frame.
        let core = CoreWall::new(0, three(NAME, "point", Some(point))?, three(NAME, "normal", Some(normal))?, stiffness, damping)?;
        Ok(Wall { frame: text(NAME, "frame", frame)?, core })
    }

    fn __repr__(&self) -> String {
        let CoreWall { point, normal, stiffness, damping, .. } = &self.core;
        format!("Wall({:?}, point={point:?}, normal={normal:?}, stiffness={stiffness:?}, damping={damping:?})", self.frame)
            .replace('"', "'")
    }

    fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<(Placed, Bound<'py, PyDict>)> {
        let keywords = PyDict::new(py);
        keywords.set_item("stiffness", self.core.stiffness)?;
        keywords.set_item("damping", self.core.damping)?;
        Ok(((self.frame.clone(), self.core.point, self.core.normal), keywords))
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Sealed<'py>> {
        seal_new(slf.as_any())
    }
}

/// Read the wall of a plant, and find the index of its frame.
fn wall<'py>(given: &mut Arguments<'py>, function: &str, wall: Option<&Bound<'py, PyAny>>) -> Result<Option<CoreWall>, Failure> {
    let Some(wall) = wall else { return Ok(None) };
    let object = object::<Wall>(function, "wall", "a Wall or None", wall)?;
    given.store("wall", wall);
    let model = given.model();
    let frame = model.tree("wall")?.frame_index(&object.get().frame).map_err(|error| error.of_argument("wall.frame"))?;
    Ok(Some(CoreWall { frame, ..object.get().core.clone() }))
}

/// Read the stops of a plant, and store the argument for `repr` and pickling.
fn stops<'py>(given: &mut Arguments<'py>, function: &'static str, stops: Option<&Bound<'py, PyAny>>) -> Result<Option<Stops>, Failure> {
    let found = crate::stops::stops(function, &given.model(), stops)?;
    if let (Some(_), Some(stops)) = (&found, stops) {
        given.store("stops", stops);
    }
    Ok(found)
}

/// The value of the argument `friction` for the friction of the arm that can hold joints at rest.
const STICK_SLIP: &str = "stick_slip";

/// The friction of a rigid arm.
enum RigidFriction {
    /// Whether the viscous and Coulomb friction of the arm acts.
    Flag(bool),
    /// The friction of the arm, which can hold joints at rest.
    Sticking,
    /// A friction model.
    Dry(JointFriction),
}

/// Read the argument `friction` of a plant: a flag, `STICK_SLIP`, or a friction model.
fn rigid_friction<'py>(
    given: &mut Arguments<'py>,
    function: &'static str,
    name: &'static str,
    value: Option<&Bound<'py, PyAny>>,
) -> Result<RigidFriction, Failure> {
    if let Some(value) = value.filter(|value| value.is_instance_of::<PyString>()) {
        if text(function, name, value)? != STICK_SLIP {
            let problem = format!("is unknown: expected a flag, a friction model or {STICK_SLIP:?}, got {}", quoted(value));
            return Err(input_error(value.py(), function, name, problem).into());
        }
        given.store(name, value);
        return Ok(RigidFriction::Sticking);
    }
    if let Some(value) = value
        && let Some(dry) = friction::friction(function, given.model().n(), name, value)?
    {
        given.store(name, value);
        return Ok(RigidFriction::Dry(dry));
    }
    Ok(RigidFriction::Flag(given.flag(name, value)?))
}

/// A rigid arm whose input is the joint torques: `M(q) a + C(q, v) v + g(q) + tau_f = tau + J'F`.
///
/// `tau_f` is the friction torque, and `F` an external force on a frame with the Jacobian `J`. A wall and joint stops add their forces. The
/// state is `[q, v]`, and then the deflections of the bristles of `LuGre` friction.
///
/// Args:
///     arm: the arm of the plant. The arm of a law may differ from it, to simulate an error of the model.
///     friction: True: `tau_f` is the viscous and Coulomb friction of the arm, which `planar_pr` does not have. Under an adaptive method,
///         Coulomb friction can hold joints at rest; with fixed steps it is `F sign(v)`, which chatters at rest. "stick_slip": the
///         friction of the arm can hold joints at rest under every method. A `StickSlip` or a `LuGre`: `tau_f` is this friction. False: no
///         friction (keyword only).
///     wall: a `Wall` that the arm may touch (keyword only).
///     stops: `JointStops` at the limits of the joints (keyword only).
///
/// Raises:
///     InputError: an argument has the wrong type, a frame is unknown, or a number has the wrong sign or shape.
///
/// Source: [SicilianoEtAl2009], chapter 7; docs/plants_and_laws.md.
///
/// >>> import armlet as al
/// >>> al.RigidArm(al.planar_pr(2.0, 0.5, 0.5))
/// RigidArm(planar_pr(A=2, B=0.5, C=0.5))
#[pyclass(frozen, extends = Plant, module = "armlet")]
pub struct RigidArm;

#[entered]
#[pymethods]
impl RigidArm {
    #[new]
    #[arguments(arm, *, friction=false, wall=None, stops=None)]
    fn new() -> Result<PyClassInitializer<Self>, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let friction = rigid_friction(&mut given, NAME, "friction", friction)?;
        if !matches!(friction, RigidFriction::Flag(false)) {
            given.model().tree("friction")?;
        }
        let wall = self::wall(&mut given, NAME, wall)?;
        let stops = self::stops(&mut given, NAME, stops)?;
        let spec = RigidSpec { wall, stops, ..RigidSpec::new(given.model()) };
        let spec = match friction {
            RigidFriction::Flag(friction) => RigidSpec { friction, ..spec },
            RigidFriction::Sticking => spec.with_sticking_friction()?,
            RigidFriction::Dry(dry) => spec.with_friction(Some(dry))?,
        };
        Ok(given.plant(spec.into()).add_subclass(RigidArm))
    }
}

/// An arm whose input `u` is the joint velocities, rad/s or m/s: `q_dot = u`, with the state `q`.
///
/// >>> import armlet as al
/// >>> al.VelocityArm(al.planar_arm([0.5, 0.4]))
/// VelocityArm(Arm "planar": 2 joints, 2 frames, gravity [0.0, -9.81, 0.0])
#[pyclass(frozen, extends = Plant, module = "armlet")]
pub struct VelocityArm;

#[entered]
#[pymethods]
impl VelocityArm {
    #[new]
    fn new(arm: &Bound<'_, PyAny>) -> Result<PyClassInitializer<Self>, Failure> {
        let given = Arguments::new(NAME, arm)?;
        let spec = VelocitySpec { model: given.model() };
        Ok(given.plant(spec.into()).add_subclass(VelocityArm))
    }
}

/// An arm with elastic joints, whose input is the motor torques: springs couple the links and the motors.
///
/// The links follow `M(q) a + C(q, v) v + g(q) = tau_J + J'F` with the external force `F`. The motors follow
/// `B theta_ddot + tau_f + tau_J = tau` with the friction `tau_f`. The springs have the torque `tau_J = K (theta - q) + D (theta_dot - v)`
/// with the joint damping `D`. A wall and joint stops add their forces to the links. Motor positions, inertias and torques are converted to
/// the joint side of the gears. The state is `[q, v, theta, theta_dot]`, and then the deflections of the bristles of `LuGre` friction.
///
/// Args:
///     arm: the arm of the links.
///     stiffness: `K`, N m/rad or N/m, positive definite: scalar, `(n,)` or `(n, n)`.
///     motor_inertia: `B`, kg m^2 or kg, positive definite: scalar, `(n,)` or `(n, n)`.
///     joint_damping: `D`, damping in parallel with the springs, N m s/rad or N s/m, `(n,)`, >= 0; zero if None (keyword only).
///     motor_friction: `tau_f`: a `StickSlip`, a `LuGre`, or coefficients of viscous friction, N m s/rad or N s/m, `(n,)`, >= 0; no
///         friction if None (keyword only).
///     wall: a `Wall` that the arm may touch (keyword only).
///     stops: `JointStops` at the limits of the links (keyword only).
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite or has the wrong sign, a matrix is not positive definite, or a frame is
///         unknown.
///
/// Source: Spong, Modeling and control of elastic joint robots, J. Dyn. Sys. Meas. Control 109, 1987.
///
/// >>> import armlet as al
/// >>> plant = al.ElasticArm(al.planar_arm([0.5, 0.4]), [800.0, 500.0], [0.4, 0.25])
#[pyclass(frozen, extends = Plant, module = "armlet")]
pub struct ElasticArm;

#[entered]
#[pymethods]
impl ElasticArm {
    #[new]
    #[arguments(arm, stiffness, motor_inertia, *, joint_damping=None, motor_friction=None, wall=None, stops=None)]
    fn new<'py>() -> Result<PyClassInitializer<Self>, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let model = given.model();
        let n = model.n();
        let (stiffness, inertia) = (given.gain("stiffness", stiffness, n)?, given.gain("motor_inertia", motor_inertia, n)?);
        let mut optional = |name, value: Option<&Bound<'py, PyAny>>| value.map(|value| given.vector(name, value, n)).transpose();
        let damping = optional("joint_damping", joint_damping)?;
        let dry = motor_friction.map_or(Ok(None), |value| friction::friction(NAME, n, "motor_friction", value))?;
        let friction = if dry.is_some() { None } else { optional("motor_friction", motor_friction)? };
        if let (Some(_), Some(value)) = (&dry, motor_friction) {
            given.store("motor_friction", value);
        }
        let wall = self::wall(&mut given, NAME, wall)?;
        let stops = self::stops(&mut given, NAME, stops)?;
        let spec = ElasticSpec::new(model, stiffness, inertia, damping, friction, wall)?.with_stops(stops).with_friction(dry)?;
        Ok(given.plant(spec.into()).add_subclass(ElasticArm))
    }
}
