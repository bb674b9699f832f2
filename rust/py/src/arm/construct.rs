//! The constructors of arms, from Python arguments, files, models of other libraries, and the pickle of `planar_pr`.

use super::lists::{as_list, chain_joint, dh_row};
use super::stored::stored;
use super::{Arm, ArmModel};
use crate::arrays::{any_vector, name, number as scalar, per_entry, vector};
use crate::errors::{Failure, entry, input_error};
use crate::interrupts::{long, paused};
use crate::seal::{Sealed, seal_call};
use armlet_core::arm::{self as core, Convention, Follows, Frame, Joint, JointType, Limits, MimicMode, UrdfOptions};
use armlet_core::dynamics::PlanarPr;
use armlet_core::memory;
use armlet_core::spatial::{Matrix3, Placement, Vector3};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyString, PyTuple};
use std::borrow::Cow;

/// The robot with a prismatic and a revolute joint on a horizontal plane, `M = [[A, B cos q2], [B cos q2, C]]`.
///
/// Args:
///     A: mass of both links, kg; > 0.
///     B: mass of link 2 times the distance of its centre from the joint, kg m; `A C > B^2`.
///     C: inertia of link 2 about the joint, kg m^2; > 0.
///
/// Raises:
///     InputError: a parameter is not finite, or the mass matrix is not positive definite at every q.
///
/// Source: Robotics 2 exam, Sapienza, 10 June 2022, exercise 1. The arm has no frames.
///
/// Returns:
///     The arm, with two joints and no frames.
///
/// >>> import armlet as al
/// >>> al.planar_pr(2.0, 0.5, 0.5).mass_matrix([0.0, 0.0])
/// array([[2. , 0.5],
///        [0.5, 0.5]])
#[entered]
#[pyfunction]
#[pyo3(name = "planar_pr")]
#[arguments(A, B, C)]
#[allow(non_snake_case)]
pub fn planar_pr() -> Result<Arm, Failure> {
    let [a, b, c] = [scalar(NAME, "A", A)?, scalar(NAME, "B", B)?, scalar(NAME, "C", C)?];
    Ok(Arm { model: ArmModel::PlanarPr(PlanarPr::new(a, b, c)?) })
}

/// Restore a `planar_pr` arm from `(A, B, C)`. The parameters are not checked, because `with_parameters` accepts physically impossible
/// ones.
#[entered]
#[pyfunction]
pub fn _restore_planar_pr(pi: [f64; 3]) -> Arm {
    Arm { model: ArmModel::PlanarPr(PlanarPr::with_parameters(pi)) }
}

/// Return the name, the parent link and the child link of each joint of a URDF text.
#[entered]
#[pyfunction]
pub fn _urdf_joints(py: Python<'_>, function: &str, xml: &str) -> PyResult<Vec<(String, String, String)>> {
    entry(py, function, || long(py, || core::urdf_joints(xml, "source")))
}

fn gravity3(function: &str, gravity: Option<&Bound<'_, PyAny>>) -> Result<[f64; 3], Failure> {
    let Some(gravity) = gravity else { return Ok(core::STANDARD_GRAVITY) };
    let g = vector(function, "gravity", gravity, 3)?;
    Ok([g[0], g[1], g[2]])
}

/// Load an arm from a URDF file or from URDF text: any tree of revolute, continuous, prismatic and fixed joints.
///
/// Args:
///     path_or_xml: a path, `package://name/file`, or a string of XML. The Python package `xacro`, which must be installed, expands a
///         file whose name ends in `.xacro`.
///     gravity: acceleration of gravity in the axes of the base, `(3,)`, m/s^2; 9.81 m/s^2 along -z of the file's root if None (keyword
///         only).
///     root: name of the link that becomes the fixed base; the file's root if None (keyword only).
///     tip: name of a link; only the joints between the root and this link remain. All joints remain if None (keyword only).
///     mimic: treatment of joints with `<mimic>` (keyword only). "joined": the joint follows its leader, and both are one degree of
///         freedom. "independent": the joint is a separate degree of freedom.
///     search_path: folders in which `package://` searches; each folder is a package, or contains packages (keyword only). The folders of
///         the environment variables `ROS_PACKAGE_PATH` and `AMENT_PREFIX_PATH` are searched after them.
///     xacro_arguments: values of the arguments that `<xacro:arg>` declares, by name (keyword only).
///
/// A *follower* is a joint whose position is `multiplier q_leader + offset`. Its body remains in the arm, but `q` has no entry for it.
/// `arm.file_positions(q)` returns its position. The limits of a follower narrow the position and speed limits of the leader, unless they
/// would then allow no motion. The leader gets `multiplier**2` of the follower's armature and damping, and `|multiplier|` of its Coulomb
/// friction. The leader's effort limit does not change, because one motor moves the leader and its followers. If `root` and `tip` exclude a
/// leader, its first follower becomes the leader.
///
/// With `root` or `tip`, faults of the file outside of the chain do not matter: `arm.report` names the first of them. It also names the
/// parts that the arm lacks, and gravity in the axes of `root`. Without `gravity`, this is gravity of the whole robot, with the joints
/// between the file's root and `root` at zero. So a tilted mount tilts gravity. For other positions of these joints, give `gravity`.
///
/// The order of `q` is depth first, with siblings in the order of the file. The names of the frames are the names of the links. Meshes are
/// never opened. `arm.report` lists unusual values, parts that armlet does not use, and a mass matrix that is not positive definite.
///
/// Raises:
///     ModelError: the model is not well formed, or a number is implausible. `.file` and `.line` locate the error.
///     InputError: an argument is wrong, a file cannot be read, a package is not found, or xacro reports an error. A path that leads out of
///         its package also raises it.
///     ImportError: the file is xacro, and the package `xacro` is not installed.
///
/// Returns:
///     The arm.
///
/// Source: docs/arms.md.
///
/// >>> import armlet as al
/// >>> al.load_urdf(al.example_urdf("planar_2r")).n
/// 2
#[entered]
#[pyfunction]
#[arguments(path_or_xml, *, gravity=None, root=None, tip=None, mimic="joined", search_path=None, xacro_arguments=None)]
pub fn load_urdf() -> Result<Arm, Failure> {
    let root = root.map(|root| name(NAME, "root", root)).transpose()?;
    let tip = tip.map(|tip| name(NAME, "tip", tip)).transpose()?;
    let mimic = mimic.map_or(Ok(MimicMode::default()), |mimic| Ok::<_, Failure>(MimicMode::parse(name(NAME, "mimic", mimic)?)?))?;
    let gravity = gravity.map(|gravity| vector(NAME, "gravity", gravity, 3).map(|g| [g[0], g[1], g[2]])).transpose()?;
    let options = UrdfOptions { gravity, root, tip, mimic };
    // The text is borrowed, not copied, because it may be large.
    let text: Cow<'_, str> = match path_or_xml.cast::<PyString>().ok().and_then(|text| text.to_str().ok()) {
        Some(text) => text.into(),
        None => path_or_xml.call_method0("__fspath__").and_then(|path| path.extract::<String>()).map(Cow::Owned).map_err(|_| {
            let problem = format!("is of the wrong type: expected a path or a string of XML, got {}", path_or_xml.get_type());
            input_error(py, NAME, "path_or_xml", problem)
        })?,
    };
    // A string that contains `<` is XML, not a path. The XML parser reports its errors.
    let is_xml = text.contains('<') && path_or_xml.is_instance_of::<PyString>();
    // Python code finds and reads files, and expands xacro files.
    let (file, read): (Cow<'_, str>, Option<String>) = if is_xml && search_path.is_none() && xacro_arguments.is_none() {
        (text, None)
    } else {
        let files = py.import("armlet.robot_files")?;
        let (path, read): (String, _) = files.call_method1("robot_file", (&*text, is_xml, search_path, xacro_arguments))?.extract()?;
        (path.into(), read)
    };
    let (text, file): (&str, &str) = read.as_ref().map_or((&file, "<string>"), |read| (read, &file));
    long(py, || Ok(core::Arm::read_urdf(text, file, &options)?.into()))
}

/// Return the text of an example URDF of the package.
///
/// Args:
///     name: name of the example, such as "six_axis". The error for an unknown name lists the valid names.
///
/// Returns:
///     The URDF as a string, for `load_urdf`.
///
/// Raises:
///     InputError: the name is unknown.
///
/// Source: docs/arms.md.
///
/// >>> import armlet as al
/// >>> al.load_urdf(al.example_urdf("seven_axis")).n
/// 7
#[entered]
#[pyfunction]
pub fn example_urdf(name: &Bound<'_, PyAny>) -> Result<&'static str, Failure> {
    Ok(core::example_urdf(self::name(NAME, "name", name)?)?)
}

/// A planar arm with n revolute joints in the x-y plane; `q1` is measured from the x axis.
///
/// The frames "link1" to "linkn" are at the tips of the links.
///
/// Args:
///     lengths: lengths of the links, `(n,)`, m; not negative.
///     masses: masses of the links, `(n,)`, kg, not negative; 1 kg per metre of length if None (keyword only, as all below).
///     coms: distance of each link's centre of mass from the joint of the link, `(n,)`, m; half the length if None.
///     inertias: inertia of each link about its centre of mass, `(n,)`, kg m^2, not negative; the inertia of a uniform rod if None.
///     gravity: acceleration of gravity in the x-y plane, `(2,)`, m/s^2; (0, -9.81) if None.
///
/// Returns:
///     The arm.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, or a length, mass or inertia is negative.
///
/// Source: [SicilianoEtAl2009], section 7.3; docs/arms.md.
///
/// >>> import armlet as al
/// >>> al.planar_arm([1.0, 1.0]).position([0.0, 0.0], "link2")
/// array([2., 0., 0.])
#[entered]
#[pyfunction]
#[arguments(lengths, *, masses=None, coms=None, inertias=None, gravity=None)]
pub fn planar_arm() -> Result<Arm, Failure> {
    let lengths = any_vector(NAME, "lengths", lengths)?;
    let given = |name, value: Option<&Bound<'_, PyAny>>| value.map(|v| per_entry(NAME, name, v, lengths.len())).transpose();
    let (masses, coms, inertias) = (given("masses", masses)?, given("coms", coms)?, given("inertias", inertias)?);
    let gravity = match gravity {
        Some(gravity) => vector(NAME, "gravity", gravity, 2)?,
        None => vec![0.0, -9.81],
    };
    let (masses, coms, inertias) = (masses.as_deref(), coms.as_deref(), inertias.as_deref());
    long(py, || Ok(core::Arm::planar(&lengths, masses, coms, inertias, [gravity[0], gravity[1]])?.into()))
}

/// A pendulum of one link: `inertia a + gravity_moment sin(q) = tau`, where `q` is measured from the downward vertical.
///
/// Args:
///     inertia: inertia of the link about the joint, kg m^2; > 0.
///     gravity_moment: mass times gravity times the distance of the centre of mass from the joint, N m.
///
/// Source: Robotics 2 exam, Sapienza, 10 June 2022, exercise 4.
///
/// Returns:
///     The arm, with one joint and the frame "link1", whose origin is on the joint axis.
///
/// Raises:
///     InputError: a number is not finite, or the inertia is not positive.
///
/// >>> import armlet as al
/// >>> float(al.pendulum(1.0, 2.0).gravity([1.5707963267948966])[0])
/// 2.0
#[entered]
#[pyfunction]
pub fn pendulum(inertia: &Bound<'_, PyAny>, gravity_moment: &Bound<'_, PyAny>) -> Result<Arm, Failure> {
    Ok(core::Arm::pendulum(scalar(NAME, "inertia", inertia)?, scalar(NAME, "gravity_moment", gravity_moment)?)?.into())
}

/// The tuples of a joint, of a frame and of an arm. The tuple of an arm is the argument of [`_restore_tree`].
type JointState = (String, String, Option<usize>, [[f64; 3]; 4], [f64; 3], [f64; 7], [f64; 10], Option<Follows>);
type FrameState = (String, Option<usize>, [[f64; 3]; 4], Option<String>);
type TreeState<'py> = (String, Bound<'py, PyList>, Bound<'py, PyList>, [f64; 3], Vec<String>);

fn placed([a, b, c, t]: [[f64; 3]; 4]) -> Placement {
    Placement { rotation: Matrix3::from_columns(&[Vector3::from(a), Vector3::from(b), Vector3::from(c)]), translation: Vector3::from(t) }
}

/// Make an arm from the joints and frames of a model of another library, such as Pinocchio or MuJoCo.
#[entered]
#[pyfunction]
pub fn _restore_tree(state: TreeState<'_>) -> Result<Arm, Failure> {
    let (name, joints, frames, gravity, report) = state;
    let count = joints.len();
    let damaged = || Failure::from(armlet_core::error::Error::Format("the stored arm is damaged".into()));
    let joint = |i: usize, state: &Bound<'_, PyAny>| {
        let (name, kind, parent, placement, axis, drive, parameters, leader): JointState = state.extract()?;
        let Some(JointType::Moving(kind)) = JointType::parse(&kind) else { return Err(damaged()) };
        if parent.is_some_and(|p| p >= i) {
            return Err(damaged());
        }
        let [lower, upper, velocity, effort, armature, damping, friction] = drive;
        let limits = Limits { lower, upper, velocity, effort };
        Ok((Joint { name, kind, parent, placement: placed(placement), axis, limits, armature, damping, friction, parameters }, leader))
    };
    let (joints, follows): (Vec<Joint>, Vec<Option<Follows>>) = paused(&memory::collected(joints.iter())?, joint)?.into_iter().unzip();
    let frame = |_: usize, state: &Bound<'_, PyAny>| {
        let (name, body, placement, joint): FrameState = state.extract()?;
        if body.is_some_and(|b| b >= count) { Err(damaged()) } else { Ok(Frame { name, body, placement: placed(placement), joint }) }
    };
    let frames = paused(&memory::collected(frames.iter())?, frame)?;
    long(py, || Ok(core::Arm { name, joints, mimics: Vec::new(), frames, gravity, report }.following(&follows)?.into()))
}

#[entered]
#[pymethods]
impl Arm {
    /// Make an arm from a list of joints, each a dict. `gravity`: `(3,)`, m/s^2, world axes; (0, 0, -9.81) if None.
    ///
    /// Only the key `type` is required:
    ///
    /// - `type`: "R", "P", "F", or "revolute", "continuous", "prismatic", "fixed";
    /// - `axis`: direction of the joint axis in the joint frame, `(3,)`, of any length > 0; (0, 0, 1) by default;
    /// - `rpy`, `xyz`: placement of the joint frame in the parent's body frame at q = 0 (rad, m); zero by default;
    /// - `phi`: the ten inertial parameters about the origin of the body frame, in the order of `Arm.parameters` (kg, kg m, kg m^2); zero
    ///   by default.
    ///
    /// The other keys are `name`, `lower`, `upper`, `velocity`, `effort`, `armature`, `damping`, `friction`, and:
    ///
    /// - `parent`: index of an earlier joint; -1 or None is the base, and the default is the previous joint;
    /// - `mimic`: a dict with `joint`, the index of the leader, `multiplier` (default 1) and `offset` (default 0), as in a URDF.
    ///
    /// The frames "link1", "link2", .. are the body frames.
    ///
    /// Raises:
    ///     InputError: the list is empty, a key or type is unknown, a name is repeated, a shape is wrong, or a number is not finite. It is
    ///         also raised for an axis of length zero, for an index of no valid joint, and for `lower` above `upper`. A negative
    ///         `velocity`, `effort`, `armature`, `damping` or `friction` also raises it.
    ///
    /// >>> import armlet as al
    /// >>> arm = al.Arm.from_chain([{"type": "R", "axis": [0, 0, 1], "phi": [1, 0.5, 0, 0, 0, 0, 0, 0, 0, 0.3]}])
    /// >>> arm.mass_matrix([0.0])
    /// array([[0.3]])
    #[staticmethod]
    #[arguments(joints, *, gravity=None)]
    fn from_chain() -> Result<Arm, Failure> {
        let list = as_list(NAME, "joints", joints)?;
        let list = paused(&list, |i, joint| chain_joint(NAME, joint, i))?;
        let gravity = gravity3(NAME, gravity)?;
        long(py, || Ok(core::Arm::from_chain(&list, gravity)?.into()))
    }

    /// Make an arm from Denavit-Hartenberg rows `(a, alpha, d, theta)`, lengths in m and angles in rad.
    ///
    /// A row may also be a dict with the keys `a`, `alpha`, `d`, `theta` and `phi`, which are zero by default. Its key `type` is "R" (the
    /// default), "P", "revolute", "continuous" or "prismatic". `convention`: "standard" or "modified" (Craig). `gravity`: `(3,)`, m/s^2,
    /// world axes. The frames "link1", "link2", .. are the Denavit-Hartenberg frames.
    ///
    /// Raises:
    ///     InputError: the list is empty, a key, a type or the convention is unknown, a shape is wrong, or a number is not finite.
    ///
    /// >>> import armlet as al
    /// >>> al.Arm.from_dh([(1.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)]).position([0.0, 0.0], "link2")
    /// array([2., 0., 0.])
    #[staticmethod]
    #[arguments(rows, *, convention="standard", gravity=None)]
    fn from_dh() -> Result<Arm, Failure> {
        let convention = Convention::parse(convention.map_or(Ok("standard"), |given| name(NAME, "convention", given))?)?;
        let list = as_list(NAME, "rows", rows)?;
        let list = paused(&list, |i, row| dh_row(NAME, row, i))?;
        let gravity = gravity3(NAME, gravity)?;
        long(py, || Ok(core::Arm::from_dh(&list, convention, gravity)?.into()))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        match &self.model {
            ArmModel::PlanarPr(arm) => seal_call(py, "_restore_planar_pr", (arm.parameter_array(),).into_pyobject(py)?),
            ArmModel::Tree(tree) => {
                entry(py, "Arm.__reduce__", || Ok(seal_call(py, "_restore_arm", PyTuple::new(py, stored(py, tree.arm())?)?)?))
            }
        }
    }
}
