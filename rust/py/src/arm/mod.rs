//! The class `armlet.Arm`, for the arm in closed form (`planar_pr`) and for trees of joints.

mod construct;
mod derivatives;
mod dynamics;
mod edit;
mod evaluate;
mod file_joints;
mod identify;
mod kinematics;
mod lists;
mod model;
mod show;
mod stored;
mod symbolic;

pub use construct::*;
pub use identify::*;
pub use model::ArmModel;
pub use stored::_restore_arm;

use crate::arrays::copied;
use crate::errors::Failure;
use crate::properties::properties;
use armlet_core::arm::Arm as CoreArm;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// A robot arm: its kinematics and its dynamics `M(q) a + C(q, v) v + g(q) = tau`.
///
/// `load_urdf`, `Arm.from_chain`, `Arm.from_dh`, `planar_arm`, `pendulum` and `planar_pr` make arms. The arm of `planar_pr` has equations
/// in closed form, but no links and no frames. Functions of the positions take `q` of the shape `(..., n)` and broadcast over the leading
/// axes. For many configurations they use the lanes of SIMD registers and several threads.
///
/// `C` is the matrix of the Christoffel symbols. Angles are in rad, lengths in m, torques in N m, and forces of prismatic joints in N. The
/// dynamics include the rotors' inertia (armature), and include friction only with `friction=True`. `planar_pr` has neither, and refuses
/// `friction=True` and `armature=True`. Jacobians are geometric: the first three rows are the velocity of the frame's origin, the last
/// three the angular velocity, in world axes.
#[pyclass(frozen, module = "armlet", name = "Arm")]
pub struct Arm {
    pub model: ArmModel,
}

/// For arms with more joints than this, freeing the memory takes a noticeable time.
const MANY: usize = 1 << 10;

impl Drop for Arm {
    /// Free the memory of an arm. For an arm with more than `MANY` joints the interpreter lock is released meanwhile.
    fn drop(&mut self) {
        if self.model.n() > MANY {
            let model = std::mem::replace(&mut self.model, ArmModel::nothing());
            Python::attach(|py| py.detach(|| drop(model)));
        }
    }
}

impl From<CoreArm> for Arm {
    fn from(arm: CoreArm) -> Self {
        Arm { model: arm.into() }
    }
}

impl Arm {
    fn named<'py>(py: Python<'py>, names: &[String]) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, names)
    }
}

properties!(Arm {
    /// Names of the joints, in the order of `q`.
    joint_names: PyResult<Bound<'py, PyTuple>> = |arm, py| Self::named(py, &arm.model.joint_names());
    /// Types of the joints, "revolute", "continuous" or "prismatic", in the order of `q`.
    joint_types: PyResult<Bound<'py, PyTuple>> = |arm, py| Self::named(py, &arm.model.joint_types());
    /// Names of the frames that kinematic functions accept.
    frame_names: PyResult<Bound<'py, PyTuple>> = |arm, py| Self::named(py, &arm.model.frame_names());
    /// Name of the frame at the tip; None for an arm without moving frames.
    ///
    /// The tip is the moving frame with the longest path from the base. The length of a path is the sum of the distances from joint to
    /// joint, and from the last joint to the frame, m. Among equally long paths, the last in the order of `frame_names` counts.
    ///
    /// >>> import armlet as al
    /// >>> al.load_urdf(al.example_urdf("six_axis")).tip_frame
    /// 'flange'
    tip_frame: Option<String> = |arm| arm.model.tip_frame();
    /// Remarks of `load_urdf` and other readers about unusual or unused parts of the model's file, one string each.
    report: PyResult<Bound<'py, PyTuple>> = |arm, py| Self::named(py, arm.model.report());
});

#[entered]
#[pymethods]
impl Arm {
    /// Number of joints in `q`. A follower (mimic joint) does not count.
    #[getter]
    pub fn n(&self) -> usize {
        self.model.n()
    }

    /// Gravity in world axes, `(3,)`, m/s^2; None for `planar_pr`, which moves on a horizontal plane.
    #[getter]
    fn gravity_vector<'py>(&self) -> Result<Option<Bound<'py, PyAny>>, Failure> {
        let ArmModel::Tree(tree) = &self.model else { return Ok(None) };
        copied(py, &[3], &tree.arm().gravity).map(Some)
    }

    /// The inertial parameters, `(p,)`: `m, m cx, m cy, m cz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz` of each joint's body, kg, kg m, kg m^2.
    ///
    /// The bodies have the order of `file_joint_names`. The inertia is about the origin of the body frame, in its axes. For `planar_pr` the
    /// parameters are `(A, B, C)`.
    #[getter]
    fn parameters<'py>(&self) -> Result<Bound<'py, PyAny>, Failure> {
        let parameters = self.model.parameters();
        copied(py, &[parameters.len()], &parameters)
    }

    /// Limits, friction and rotor inertia of the joints by name, each `(n,)`; a limit that the model does not have is infinite.
    ///
    /// `q_min`, `q_max`: rad or m. `v_max`: rad/s or m/s. `effort`, `friction`: N m or N. `damping`: N m s/rad or N s/m. `armature`: kg m^2
    /// or kg. The dict of `planar_pr` is empty.
    #[getter]
    fn limits<'py>(&self) -> Result<Bound<'py, PyDict>, Failure> {
        let all = PyDict::new(py);
        for (name, values) in self.model.limits() {
            all.set_item(name, copied(py, &[values.len()], &values)?)?;
        }
        Ok(all)
    }

    fn __repr__(&self) -> String {
        self.model.shown()
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Arm>().is_ok_and(|other| other.get().model == self.model)
    }

    fn __hash__(&self) -> u64 {
        self.model.parameters().iter().fold(17, |h, x| (h ^ x.to_bits()).wrapping_mul(0x100_0000_01b3))
    }
}
