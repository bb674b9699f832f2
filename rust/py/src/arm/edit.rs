//! Arms made from arms, and an arm as URDF.

use super::Arm;
use crate::arrays::{Axis, Form, name, number, numbers, text, three, vector};
use crate::errors::{Failure, entry, input_error};
use crate::interrupts::long;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::PyDict;

#[entered]
#[pymethods]
impl Arm {
    /// The same arm with other inertial parameters; any finite numbers.
    ///
    /// Args:
    ///     pi: `(p,)`, in the order of `parameters`: kg, kg m, kg m^2.
    ///
    /// Raises:
    ///     InputError: `pi` is not finite or has the wrong shape.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.planar_pr(2.0, 0.5, 0.5)
    /// >>> arm.with_parameters(2.0 * arm.parameters)
    /// planar_pr(A=4, B=1, C=1)
    fn with_parameters(&self, py: Python<'_>, pi: &Bound<'_, PyAny>) -> PyResult<Arm> {
        const NAME: &str = "Arm.with_parameters";
        entry(py, NAME, || {
            let pi = vector(NAME, "pi", pi, self.model.parameters().len())?;
            long(py, || Ok(Arm { model: self.model.with_parameters(&pi)? }))
        })
    }

    /// The same arm with other rotors and friction; any finite numbers.
    ///
    /// `M(q) + diag(armature)`; with friction `tau = .. + damping v + friction sign(v)`.
    ///
    /// Args:
    ///     armature: rotor inertia, reduced to the joint, `(n,)`, kg m^2 (kg for a slide); that of the arm if None (keyword only).
    ///     damping: viscous friction, `(n,)`, N m s/rad (N s/m); that of the arm if None (keyword only).
    ///     friction: Coulomb friction, `(n,)`, N m (N); that of the arm if None (keyword only).
    ///
    /// Raises:
    ///     InputError: an argument is not finite or has the wrong shape, or the arm has no links.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.pendulum(1.0, 1.0).with_drives(armature=[0.5])
    /// >>> float(arm.mass_matrix([0.0])[0, 0]), float(arm.limits["armature"][0])
    /// (1.5, 0.5)
    #[pyo3(signature = (*, armature=None, damping=None, friction=None))]
    fn with_drives(
        &self,
        py: Python<'_>,
        armature: Option<&Bound<'_, PyAny>>,
        damping: Option<&Bound<'_, PyAny>>,
        friction: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Arm> {
        const NAME: &str = "Arm.with_drives";
        entry(py, NAME, || {
            let tree = self.model.tree(NAME)?;
            let read = |name: &str, value: Option<&Bound<'_, PyAny>>| value.map(|value| vector(NAME, name, value, tree.n())).transpose();
            let (armature, damping) = (read("armature", armature)?, read("damping", damping)?);
            let friction = read("friction", friction)?;
            long(py, || Ok(tree.with_drives(armature.as_deref(), damping.as_deref(), friction.as_deref())?.into()))
        })
    }

    /// The same arm under another gravity.
    ///
    /// Args:
    ///     gravity: `(3,)`, m/s^2, world axes.
    ///
    /// Raises:
    ///     InputError: `gravity` is not finite or has the wrong shape, or the arm has no links.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_arm([1.0]).with_gravity([0.0, 0.0, 0.0]).gravity([0.3])
    /// array([0.])
    fn with_gravity(&self, py: Python<'_>, gravity: &Bound<'_, PyAny>) -> PyResult<Arm> {
        const NAME: &str = "Arm.with_gravity";
        entry(py, NAME, || {
            let g = vector(NAME, "gravity", gravity, 3)?;
            long(py, || Ok(self.model.tree(NAME)?.with_gravity([g[0], g[1], g[2]])?.into()))
        })
    }

    /// The same arm with one more frame, such as that of a tool, fixed to one of its frames.
    ///
    /// Args:
    ///     name: name of the new frame.
    ///     parent: name of the frame to which it is fixed.
    ///     xyz: its origin in the parent, `(3,)`, m; zero if None (keyword only).
    ///     rpy: its roll, pitch and yaw in the parent, `(3,)`, rad, `R = Rz(yaw) Ry(pitch) Rx(roll)`; zero if None (keyword only).
    ///
    /// Raises:
    ///     InputError: a name is taken or unknown, a number is not finite, or the arm has no links.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.planar_arm([1.0]).with_frame("tool", "link1", xyz=[0.2, 0.0, 0.0])
    /// >>> arm.position([0.0], "tool")
    /// array([1.2, 0. , 0. ])
    #[pyo3(signature = (name, parent, *, xyz=None, rpy=None))]
    fn with_frame(
        &self,
        py: Python<'_>,
        name: &Bound<'_, PyAny>,
        parent: &Bound<'_, PyAny>,
        xyz: Option<&Bound<'_, PyAny>>,
        rpy: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Arm> {
        const NAME: &str = "Arm.with_frame";
        entry(py, NAME, || {
            let (name, parent) = (text(NAME, "name", name)?, text(NAME, "parent", parent)?);
            let (xyz, rpy) = (three(NAME, "xyz", xyz)?, three(NAME, "rpy", rpy)?);
            long(py, || Ok(self.model.tree(NAME)?.with_frame(&name, &parent, rpy, xyz)?.into()))
        })
    }

    /// The arm with a load fixed to a frame.
    ///
    /// Args:
    ///     frame: name of the frame.
    ///     mass: kg, not negative.
    ///     com: centre of mass in the frame, `(3,)`, m; its origin if None.
    ///     inertia: about the centre of mass in the axes of the frame, `(3, 3)`, kg m^2; zero if None.
    ///
    /// Raises:
    ///     InputError: the frame is unknown, a number is not finite, the inertia is not symmetric or physically impossible, or the arm has
    ///         no links.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.planar_arm([1.0])
    /// >>> (arm.with_payload("link1", 2.0).gravity([0.0]) - arm.gravity([0.0])).round(6)
    /// array([19.62])
    #[pyo3(signature = (frame, mass, com=None, inertia=None))]
    fn with_payload(
        &self,
        py: Python<'_>,
        frame: &Bound<'_, PyAny>,
        mass: &Bound<'_, PyAny>,
        com: Option<&Bound<'_, PyAny>>,
        inertia: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Arm> {
        const NAME: &str = "Arm.with_payload";
        entry(py, NAME, || {
            let frame = name(NAME, "frame", frame)?;
            let (mass, com) = (number(NAME, "mass", mass)?, three(NAME, "com", com)?);
            let mut about = [[0.0; 3]; 3];
            if let Some(inertia) = inertia {
                let (_, values) = numbers(NAME, "inertia", inertia, &[Form(&[Axis::Is(3), Axis::Is(3)])])?;
                about = std::array::from_fn(|i| std::array::from_fn(|j| values[3 * i + j]));
            }
            long(py, || Ok(self.model.tree(NAME)?.with_payload(frame, mass, com, about)?.into()))
        })
    }

    /// The same arm with joints locked at positions. They are no longer part of `q`, and their bodies join the body before them.
    ///
    /// Args:
    ///     joints: a dict from the names of joints to their positions, rad or m.
    ///
    /// Raises:
    ///     InputError: a joint is unknown, a position is not a finite number, or the arm has no links.
    ///
    /// >>> import armlet as al
    /// >>> al.planar_arm([1.0, 1.0]).locked({"joint2": 0.0}).position([0.0], "link2")
    /// array([2., 0., 0.])
    fn locked(&self, py: Python<'_>, joints: &Bound<'_, PyAny>) -> PyResult<Arm> {
        const NAME: &str = "Arm.locked";
        entry(py, NAME, || {
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
        })
    }

    /// The arm as URDF: the text, and a line for everything that URDF cannot express.
    ///
    /// Under the same gravity, the arm of this text has the same bits. Rotor inertia is the attribute `armature` of `<dynamics>`. Angles and
    /// a centre of mass in a URDF are rounded. The exact rotation and the ten inertial parameters are the attributes `rotation` of `<origin>` and
    /// `parameters` of `<inertial>`, which other programs ignore.
    ///
    /// Raises:
    ///     InputError: the arm has no links.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.load_urdf(al.example_urdf("seven_axis"))
    /// >>> text, lost = arm.to_urdf()
    /// >>> lost, al.load_urdf(text) == arm
    /// ([], True)
    fn to_urdf(&self, py: Python<'_>) -> PyResult<(String, Vec<String>)> {
        const NAME: &str = "Arm.to_urdf";
        entry(py, NAME, || {
            let written = long(py, || Ok(self.model.tree(NAME)?.to_urdf()))?;
            Ok((written.text, written.report))
        })
    }
}
