//! `armlet.Arm`: the closed-form arms and the trees behind one class.

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
mod stored;
mod symbolic;

pub use construct::*;
pub use identify::*;
pub use model::ArmModel;
pub use stored::_restore_arm;

use crate::arrays::new_array;
use crate::errors::entry;
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// A robot arm: its kinematics and its dynamics `M(q) a + C(q, v) v + g(q) = tau`.
///
/// Made by `load_urdf`, `Arm.from_chain`, `Arm.from_dh`, `planar_arm`, `pendulum` or `planar_pr`. Every function
/// takes `q` of shape `(..., n)` and broadcasts over the leading axes; many configurations run in lanes. `C` is the
/// Christoffel factorisation. Angles are in rad, lengths in m, torques in N m. Dynamics include the rotors'
/// inertia (armature), and friction only with `friction=True`. Jacobians are geometric, rows `[v; w]`, in world
/// axes at the frame's origin.
#[pyclass(frozen, module = "armlet", name = "Arm")]
pub struct Arm {
    pub model: ArmModel,
}

/// The number of joints above which freeing the memory takes noticeable time.
const MANY: usize = 1 << 10;

impl Drop for Arm {
    /// The memory of an arm of very many links is freed without the interpreter lock.
    fn drop(&mut self) {
        if self.model.n() > MANY {
            let model = std::mem::replace(&mut self.model, ArmModel::nothing());
            Python::attach(|py| py.detach(|| drop(model)));
        }
    }
}

impl Arm {
    fn named<'py>(py: Python<'py>, names: &[String]) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, names)
    }
}

#[entered]
#[pymethods]
impl Arm {
    /// Number of joints.
    #[getter]
    pub fn n(&self) -> usize {
        self.model.n()
    }

    /// Names of the joints, in the order of `q`.
    #[getter]
    fn joint_names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        Self::named(py, &self.model.joint_names())
    }

    /// Types of the joints, "revolute", "continuous" or "prismatic", in the order of `q`.
    #[getter]
    fn joint_types<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        Self::named(py, &self.model.joint_types())
    }

    /// Names of the frames that kinematic functions take.
    #[getter]
    fn frame_names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        Self::named(py, &self.model.frame_names())
    }

    /// The frame at the tip; None for an arm without moving frames.
    ///
    /// It is the moving frame with the longest path from the base: the sum of the lengths of the offsets of joints and frame, m. Among
    /// equally long paths it is the last in the order of `frame_names`.
    ///
    /// >>> import armlet as al
    /// >>> al.load_urdf(al.example_urdf("six_axis")).tip_frame
    /// 'flange'
    #[getter]
    fn tip_frame(&self) -> Option<String> {
        self.model.tip_frame()
    }

    /// Gravity in world axes, `(3,)`, m/s^2; None for `planar_pr`, which moves on a horizontal plane.
    #[getter]
    fn gravity_vector<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let ArmModel::Tree(tree) = &self.model else { return Ok(None) };
        entry(py, "Arm.gravity_vector", || {
            new_array(py, &[3], |out| {
                out.copy_from_slice(&tree.arm().gravity);
                Ok(())
            })
        })
        .map(Some)
    }

    /// Remarks of the reader about odd or unused parts of the model's source, one line each.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        Self::named(py, self.model.report())
    }

    /// The inertial parameters, `(p,)`: ten per joint, `m, m cx, m cy, m cz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz` with the
    /// inertia about the body frame's origin; `(A, B, C)` for `planar_pr`.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let parameters = self.model.parameters();
        entry(py, "Arm.parameters", || {
            new_array(py, &[parameters.len()], |out| {
                out.copy_from_slice(&parameters);
                Ok(())
            })
        })
    }

    /// The joints' limits and drives by name, each `(n,)`: `q_min`, `q_max`, `v_max`, `effort`, `damping`,
    /// `friction`, `armature`; infinite where the model has no limit.
    #[getter]
    fn limits<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        entry(py, "Arm.limits", || {
            let all = PyDict::new(py);
            for (name, values) in self.model.limits() {
                let array = new_array(py, &[values.len()], |out| {
                    out.copy_from_slice(&values);
                    Ok(())
                })?;
                all.set_item(name, array)?;
            }
            Ok(all)
        })
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
