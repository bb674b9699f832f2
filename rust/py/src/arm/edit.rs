//! The methods that make a changed copy of an arm, and the method that writes an arm as URDF.

use super::Arm;
use crate::arrays::{Axis, Form, name, number, numbers, per_entry, text, three, vector};
use crate::errors::{Failure, input_error};
use crate::interrupts::long;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::PyDict;

#[entered]
#[pymethods]
impl Arm {
    /// Return a copy of the arm with other inertial parameters, which may be any finite numbers.
    ///
    /// Args:
    ///     pi: the inertial parameters, `(p,)`, in the order of `parameters`: kg, kg m, kg m^2.
    ///
    /// Raises:
    ///     InputError: `pi` is not finite or has the wrong shape.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.planar_pr(2.0, 0.5, 0.5)
    /// >>> arm.with_parameters(2.0 * arm.parameters)
    /// planar_pr(A=4, B=1, C=1)
    fn with_parameters(&self, pi: &Bound<'_, PyAny>) -> Result<Arm, Failure> {
        let pi = vector(NAME, "pi", pi, self.model.parameters().len())?;
        long(py, || Ok(Arm { model: self.model.with_parameters(&pi)? }))
    }

    /// Return a copy of the arm with other rotor inertia and friction, which may be any finite numbers.
    ///
    /// `diag(armature)` is added to the mass matrix of the bodies. Methods with `friction=True` include the friction torque
    /// `damping v + friction sign(v)`.
    ///
    /// Args:
    ///     armature: rotor inertia at the joint side of the gear, a number or `(n,)`, kg m^2 (kg for a prismatic joint); unchanged if None (keyword
    ///         only).
    ///     damping: viscous friction, a number or `(n,)`, N m s/rad (N s/m for a prismatic joint); unchanged if None (keyword only).
    ///     friction: Coulomb friction, a number or `(n,)`, N m (N for a prismatic joint); unchanged if None (keyword only).
    ///
    /// Raises:
    ///     InputError: an argument is not finite or has the wrong shape, or the arm has no links.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.pendulum(1.0, 1.0).with_drives(armature=[0.5])
    /// >>> float(arm.mass_matrix([0.0])[0, 0]), float(arm.limits["armature"][0])
    /// (1.5, 0.5)
    #[arguments(*, armature=None, damping=None, friction=None)]
    fn with_drives(&self) -> Result<Arm, Failure> {
        let tree = self.model.tree(NAME)?;
        let read = |name: &str, value: Option<&Bound<'_, PyAny>>| value.map(|value| per_entry(NAME, name, value, tree.n())).transpose();
        let (armature, damping) = (read("armature", armature)?, read("damping", damping)?);
        let friction = read("friction", friction)?;
        long(py, || Ok(tree.with_drives(armature.as_deref(), damping.as_deref(), friction.as_deref())?.into()))
    }

    /// Return a copy of the arm with another gravity.
    ///
    /// Args:
    ///     gravity: acceleration of gravity, `(3,)`, m/s^2, world axes.
    ///
    /// Raises:
    ///     InputError: `gravity` is not finite or has the wrong shape, or the arm has no links.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_arm([1.0]).with_gravity([0.0, 0.0, 0.0]).gravity([0.3])
    /// array([0.])
    fn with_gravity(&self, gravity: &Bound<'_, PyAny>) -> Result<Arm, Failure> {
        let g = vector(NAME, "gravity", gravity, 3)?;
        long(py, || Ok(self.model.tree(NAME)?.with_gravity([g[0], g[1], g[2]])?.into()))
    }

    /// Return a copy of the arm with a new frame, such as a tool frame, that is fixed to an existing frame.
    ///
    /// Args:
    ///     name: name of the new frame.
    ///     parent: name of the existing frame.
    ///     xyz: origin of the new frame in the axes of the parent, `(3,)`, m; zero if None (keyword only).
    ///     rpy: roll, pitch and yaw of the new frame relative to the parent, `(3,)`, rad, `R = Rz(yaw) Ry(pitch) Rx(roll)`; zero if None
    ///         (keyword only).
    ///
    /// Raises:
    ///     InputError: the name exists already, the parent is unknown, a number is not finite, or the arm has no links.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.planar_arm([1.0]).with_frame("tool", "link1", xyz=[0.2, 0.0, 0.0])
    /// >>> arm.position([0.0], "tool")
    /// array([1.2, 0. , 0. ])
    #[arguments(name, parent, *, xyz=None, rpy=None)]
    fn with_frame(&self) -> Result<Arm, Failure> {
        let (name, parent) = (text(NAME, "name", name)?, text(NAME, "parent", parent)?);
        let (xyz, rpy) = (three(NAME, "xyz", xyz)?, three(NAME, "rpy", rpy)?);
        long(py, || Ok(self.model.tree(NAME)?.with_frame(&name, &parent, rpy, xyz)?.into()))
    }

    /// Return a copy of the arm with a load that is fixed to a frame.
    ///
    /// Args:
    ///     frame: name of the frame.
    ///     mass: mass of the load, kg, not negative.
    ///     com: centre of mass of the load in the frame, `(3,)`, m; the frame's origin if None.
    ///     inertia: inertia of the load about its centre of mass, in the axes of the frame, `(3, 3)`, kg m^2; zero if None.
    ///
    /// Raises:
    ///     InputError: the frame is unknown, a number is not finite, the mass is negative, or the arm has no links. An inertia that is not
    ///         symmetric, or that is physically impossible, also raises it.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.planar_arm([1.0])
    /// >>> (arm.with_payload("link1", 2.0).gravity([0.0]) - arm.gravity([0.0])).round(6)
    /// array([19.62])
    #[arguments(frame, mass, com=None, inertia=None)]
    fn with_payload(&self) -> Result<Arm, Failure> {
        let frame = name(NAME, "frame", frame)?;
        let (mass, com) = (number(NAME, "mass", mass)?, three(NAME, "com", com)?);
        let mut about = [[0.0; 3]; 3];
        if let Some(inertia) = inertia {
            let (_, values) = numbers(NAME, "inertia", inertia, &[Form(&[Axis::Is(3), Axis::Is(3)])])?;
            about = std::array::from_fn(|i| std::array::from_fn(|j| values[3 * i + j]));
        }
        long(py, || Ok(self.model.tree(NAME)?.with_payload(frame, mass, com, about)?.into()))
    }

    /// Return a copy of the arm in which some joints are locked at constant positions.
    ///
    /// `q` has no entries for locked joints. The body of a locked joint becomes a part of its parent's body.
    ///
    /// Args:
    ///     joints: a dict from the names of the locked joints to their positions, rad or m.
    ///
    /// Raises:
    ///     InputError: a joint is unknown, a position is not a finite number, or the arm has no links.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_arm([1.0, 1.0]).locked({"joint2": 0.0}).position([0.0], "link2")
    /// array([2., 0., 0.])
    fn locked(&self, joints: &Bound<'_, PyAny>) -> Result<Arm, Failure> {
        let Ok(joints) = joints.cast::<PyDict>() else {
            let problem = format!("is not a dict: expected names of joints and their positions, got {}", joints.get_type());
            return Err(input_error(py, NAME, "joints", problem).into());
        };
        let named: Vec<(String, f64)> = joints
            .iter()
            .map(|(joint, value)| {
                let joint = text(NAME, "joints", &joint)?;
                let value = number(NAME, &format!("joints[\"{joint}\"]"), &value)?;
                Ok((joint, value))
            })
            .collect::<Result<_, Failure>>()?;
        let named: Vec<(&str, f64)> = named.iter().map(|(joint, value)| (joint.as_str(), *value)).collect();
        long(py, || Ok(self.model.tree(NAME)?.locked(&named)?.into()))
    }

    /// Return the arm as URDF text, and a list of strings that name the properties that are lost and the links that are added.
    ///
    /// If the list is empty, `load_urdf(text)` returns an equal arm, without rounding errors. The attribute `armature` of `<dynamics>` is
    /// the rotor inertia. The angles and the centre of mass in a URDF are rounded. So the attribute `rotation` of `<origin>` has the exact
    /// rotation, and the attribute `parameters` of `<inertial>` has the ten inertial parameters. Other programs ignore these attributes.
    ///
    /// Raises:
    ///     InputError: the arm has no links.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.load_urdf(al.example_urdf("seven_axis"))
    /// >>> text, lost = arm.to_urdf()
    /// >>> lost, al.load_urdf(text) == arm
    /// ([], True)
    fn to_urdf(&self) -> Result<(String, Vec<String>), Failure> {
        let written = long(py, || Ok(self.model.tree(NAME)?.to_urdf()))?;
        Ok((written.text, written.report))
    }
}
