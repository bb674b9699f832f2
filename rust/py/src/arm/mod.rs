//! `armlet.Arm`: the closed-form arms and the trees behind one class.

mod construct;
mod derivatives;
mod evaluate;
mod identify;
mod model;

pub use construct::*;
pub use identify::*;
pub use model::Model;

use crate::arrays::{new_array, number, numbers, shown, text, three, vector};
use crate::errors::{Failure, entry, input_error};
use armlet_core::dynamics::{Quantity, Query};
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
    pub model: Model,
}

impl Arm {
    fn named<'py>(py: Python<'py>, names: &[String]) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, names)
    }
}

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

    /// What the model's source said that deserves a look, and what was dropped: one line each.
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
    /// `friction`, `armature`; infinite where the model gives no limit.
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

    /// The same arm with other inertial parameters, `(p,)`; any finite numbers.
    fn with_parameters(&self, py: Python<'_>, pi: &Bound<'_, PyAny>) -> PyResult<Arm> {
        entry(py, "Arm.with_parameters", || {
            let pi = vector("Arm.with_parameters", "pi", pi, self.model.parameters().len())?;
            Ok(Arm { model: self.model.with_parameters(&pi)? })
        })
    }

    /// The same arm under another gravity `(3,)`, m/s^2, world axes.
    fn with_gravity(&self, py: Python<'_>, gravity: &Bound<'_, PyAny>) -> PyResult<Arm> {
        entry(py, "Arm.with_gravity", || {
            let g = vector("Arm.with_gravity", "gravity", gravity, 3)?;
            Ok(self.model.tree("Arm.with_gravity")?.with_gravity([g[0], g[1], g[2]])?.into())
        })
    }

    /// The same arm with a frame of its own `name` fixed to frame `parent` at `xyz` (m), turned by `rpy` (rad).
    #[pyo3(signature = (name, parent, *, xyz=None, rpy=None))]
    fn with_frame(
        &self,
        py: Python<'_>,
        name: &str,
        parent: &str,
        xyz: Option<&Bound<'_, PyAny>>,
        rpy: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Arm> {
        const NAME: &str = "Arm.with_frame";
        entry(py, NAME, || {
            let (xyz, rpy) = (three(NAME, "xyz", xyz)?, three(NAME, "rpy", rpy)?);
            Ok(self.model.tree(NAME)?.with_frame(name, parent, rpy, xyz)?.into())
        })
    }

    /// The same arm with a load in frame `frame`: `mass` in kg, its centre `com` (m) and its inertia about that
    /// centre (kg m^2, `(3, 3)`), both in the frame; zero where they are not given.
    #[pyo3(signature = (frame, mass, com=None, inertia=None))]
    fn with_payload(
        &self,
        py: Python<'_>,
        frame: &str,
        mass: &Bound<'_, PyAny>,
        com: Option<&Bound<'_, PyAny>>,
        inertia: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Arm> {
        const NAME: &str = "Arm.with_payload";
        entry(py, NAME, || {
            let (mass, com) = (number(NAME, "mass", mass)?, three(NAME, "com", com)?);
            let mut about = [[0.0; 3]; 3];
            if let Some(inertia) = inertia {
                let (shape, values) = numbers(NAME, "inertia", inertia)?;
                if shape != [3, 3] {
                    let problem = format!("has the wrong shape: expected (3, 3), got {}", shown(&shape));
                    return Err(input_error(py, NAME, "inertia", problem).into());
                }
                about = std::array::from_fn(|i| std::array::from_fn(|j| values[3 * i + j]));
            }
            Ok(self.model.tree(NAME)?.with_payload(frame, mass, com, about)?.into())
        })
    }

    /// The same arm with joints fixed at given positions: `{"joint": value}`.
    fn locked(&self, py: Python<'_>, joints: &Bound<'_, PyDict>) -> PyResult<Arm> {
        const NAME: &str = "Arm.locked";
        entry(py, NAME, || {
            let named: Vec<(String, f64)> = joints
                .iter()
                .map(|(joint, value)| {
                    let joint = text(NAME, "joints", &joint)?;
                    let value = number(NAME, &format!("joints[\"{joint}\"]"), &value)?;
                    Ok((joint, value))
                })
                .collect::<Result<_, Failure>>()?;
            let named: Vec<(&str, f64)> = named.iter().map(|(joint, value)| (joint.as_str(), *value)).collect();
            Ok(self.model.tree(NAME)?.locked(&named)?.into())
        })
    }

    /// The arm as URDF text, and a line for everything that URDF has no place for.
    fn to_urdf(&self, py: Python<'_>) -> PyResult<(String, Vec<String>)> {
        entry(py, "Arm.to_urdf", || {
            let written = self.model.tree("Arm.to_urdf")?.to_urdf();
            Ok((written.text, written.report))
        })
    }

    /// The mass matrix `M(q)`, `(..., n, n)`, armature included.
    #[pyo3(signature = (q, *, out=None))]
    fn mass_matrix<'py>(&self, q: &Bound<'py, PyAny>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("mass_matrix", ["q"], [q], Quantity::MassMatrix.into(), out)
    }

    /// The Coriolis matrix `C(q, v)` with Christoffel symbols, `(..., n, n)`: `C(q, x) y = C(q, y) x`.
    #[pyo3(signature = (q, v, *, out=None))]
    fn coriolis_matrix<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("coriolis_matrix", ["q", "v"], [q, v], Quantity::CoriolisMatrix.into(), out)
    }

    /// The gravity torque `g(q)`, `(..., n)`.
    #[pyo3(signature = (q, *, out=None))]
    fn gravity<'py>(&self, q: &Bound<'py, PyAny>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("gravity", ["q"], [q], Quantity::Gravity.into(), out)
    }

    /// `C(q, v) v + g(q)`, `(..., n)`.
    #[pyo3(signature = (q, v, *, friction=false, out=None))]
    fn bias<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        friction: bool,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("bias", ["q", "v"], [q, v], Query { friction, ..Quantity::Bias.into() }, out)
    }

    /// Inverse dynamics `tau = M a + C v + g`, `(..., n)`; less `J' wrench` where a wrench `(..., 6)` `[f; m]` in world
    /// axes acts at the origin of frame `wrench_frame`.
    #[pyo3(signature = (q, v, a, *, wrench=None, wrench_frame=None, friction=false, out=None))]
    fn inverse_dynamics<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        a: &Bound<'py, PyAny>,
        wrench: Option<&Bound<'py, PyAny>>,
        wrench_frame: Option<&str>,
        friction: bool,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let query = Query { friction, ..Quantity::InverseDynamics.into() };
        self.loaded("inverse_dynamics", "a", [q, v, a], (wrench, wrench_frame), query, out)
    }

    /// Forward dynamics `a = M^-1 (tau - C v - g)`, `(..., n)`; with `wrench` as for `inverse_dynamics`.
    #[pyo3(signature = (q, v, tau, *, wrench=None, wrench_frame=None, friction=false, out=None))]
    fn forward_dynamics<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        tau: &Bound<'py, PyAny>,
        wrench: Option<&Bound<'py, PyAny>>,
        wrench_frame: Option<&str>,
        friction: bool,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let query = Query { friction, ..Quantity::ForwardDynamics.into() };
        self.loaded("forward_dynamics", "tau", [q, v, tau], (wrench, wrench_frame), query, out)
    }

    /// The Slotine-Li regressor, `(..., n, p)`: `Y(q, v, v_r, a_r) parameters = M a_r + C(q, v) v_r + g`.
    ///
    /// `armature=True` appends `diag(a_r)`, `friction=True` then `diag(v_r)` and `diag(sign v)`.
    #[pyo3(signature = (q, v, v_r, a_r, *, armature=false, friction=false, out=None))]
    fn regressor<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        v_r: &Bound<'py, PyAny>,
        a_r: &Bound<'py, PyAny>,
        armature: bool,
        friction: bool,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let query = Query { armature, friction, ..Quantity::Regressor.into() };
        self.evaluate("regressor", ["q", "v", "v_r", "a_r"], [q, v, v_r, a_r], query, out)
    }

    /// Kinetic and potential energy, `(...)` each, in J; `out` is a tuple of two arrays.
    #[pyo3(signature = (q, v, *, out=None))]
    fn energy<'py>(&self, q: &Bound<'py, PyAny>, v: &Bound<'py, PyAny>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyTuple>> {
        let (py, values) = (q.py(), [q, v]);
        entry(py, "energy", || {
            let query = Quantity::Energy.into();
            let (leading, both) = self.flat("energy", ["q", "v"], values, &query, &[2])?;
            Self::several(py, "energy", &values, &leading, [&[], &[]], out, |k, data| {
                for (pair, to) in both.chunks_exact(2).zip(data) {
                    *to = pair[k];
                }
            })
        })
    }

    /// The pose `X_WF` of a frame, `(..., 4, 4)`: a homogeneous transform.
    #[pyo3(signature = (q, frame, *, out=None))]
    fn pose<'py>(&self, q: &Bound<'py, PyAny>, frame: &str, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        self.framed("pose", ["q"], [q], Quantity::Pose, frame, out)
    }

    /// The position `p_WF` of a frame's origin, `(..., 3)`, m.
    #[pyo3(signature = (q, frame, *, out=None))]
    fn position<'py>(&self, q: &Bound<'py, PyAny>, frame: &str, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        self.framed("position", ["q"], [q], Quantity::Position, frame, out)
    }

    /// The geometric Jacobian of a frame, `(..., 6, n)`: `[v; w]` of the frame is `J v`.
    #[pyo3(signature = (q, frame, *, out=None))]
    fn jacobian<'py>(&self, q: &Bound<'py, PyAny>, frame: &str, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        self.framed("jacobian", ["q"], [q], Quantity::Jacobian, frame, out)
    }

    /// The rate `dJ/dt` of a frame's Jacobian along `v`, `(..., 6, n)`.
    #[pyo3(signature = (q, v, frame, *, out=None))]
    fn jacobian_dot<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        frame: &str,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.framed("jacobian_dot", ["q", "v"], [q, v], Quantity::JacobianDot, frame, out)
    }

    /// The centre of mass, `(..., 3)`, m.
    #[pyo3(signature = (q, *, out=None))]
    fn center_of_mass<'py>(&self, q: &Bound<'py, PyAny>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        self.kinematic("center_of_mass", q, Quantity::Com, out)
    }

    /// The Jacobian of the centre of mass, `(..., 3, n)`.
    #[pyo3(signature = (q, *, out=None))]
    fn center_of_mass_jacobian<'py>(&self, q: &Bound<'py, PyAny>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        self.kinematic("center_of_mass_jacobian", q, Quantity::ComJacobian, out)
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
