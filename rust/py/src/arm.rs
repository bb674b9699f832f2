//! `armlet.Arm`.

use crate::arrays::{Broadcast, broadcast, index_of, new_array, number, out_slice, vector};
use crate::errors::{Failure, entry, input_error};
use armlet_core::dynamics::{Dynamics, PlanarPr};
use armlet_core::scalar::Real;
use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// A robot arm: its kinematics and its dynamics `M(q) a + C(q, v) v + g(q) = tau`.
///
/// Made by `planar_pr` and the other constructors of the package. Every function takes `q` of shape
/// `(..., n)` and broadcasts over the leading axes; `C` is the Christoffel factorisation. Angles are in rad,
/// lengths in m, torques in N m.
#[pyclass(frozen, module = "armlet", name = "Arm")]
pub struct Arm {
    pub model: PlanarPr<f64>,
}

/// What a dynamics function computes from one row of its arguments.
type Row<'f> = &'f dyn Fn(&PlanarPr<f64>, &[(f64, f64)], &[&[f64]], &mut [f64]);

impl Arm {
    fn evaluate<'py, const K: usize>(
        &self,
        function: &str,
        names: [&str; K],
        values: [&Bound<'py, PyAny>; K],
        shape: &[usize],
        out: Option<&Bound<'py, PyAny>>,
        row: Row,
    ) -> PyResult<Bound<'py, PyAny>> {
        let py = values[0].py();
        entry(py, function, || {
            let inputs: Broadcast<K> = broadcast(function, names, values, self.n())?;
            let full: Vec<usize> = inputs.shape.iter().chain(shape).copied().collect();
            let width: usize = shape.iter().product();
            let fill = |data: &mut [f64]| {
                for i in 0..inputs.count {
                    let rows: [&[f64]; K] = std::array::from_fn(|k| inputs.row(k, i));
                    let q = rows[0];
                    let trig = [Real::sin_cos(q[0]), Real::sin_cos(q[1])];
                    row(&self.model, &trig, &rows, &mut data[i * width..(i + 1) * width]);
                }
                // Finite arguments can still overflow, or meet a mass matrix that has no inverse.
                if let Some(k) = data.iter().position(|x| !x.is_finite()) {
                    let at = if full.is_empty() { String::new() } else { format!(" (first bad index {})", index_of(&full, k)) };
                    let problem = format!("give a result that is not finite: expected finite numbers, got {}{at}", data[k]);
                    return Err(input_error(py, function, &names.join(", "), problem).into());
                }
                Ok::<(), Failure>(())
            };
            match out {
                None => new_array(py, &full, fill),
                Some(out) => {
                    fill(out_slice(function, out, &full, &values)?)?;
                    Ok(out.clone())
                }
            }
        })
    }

    fn no_frames(&self, py: Python<'_>, function: &str, frame: &str) -> PyErr {
        input_error(
            py,
            function,
            "frame",
            format!("is unknown: expected one of (), got {frame:?}: this arm is given by its dynamics alone"),
        )
    }
}

#[pymethods]
impl Arm {
    /// Number of joints.
    #[getter]
    pub fn n(&self) -> usize {
        2
    }

    /// Names of the joints, in the order of `q`.
    #[getter]
    fn joint_names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, ["p1", "r2"])
    }

    /// Types of the joints, "revolute" or "prismatic", in the order of `q`.
    #[getter]
    fn joint_types<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, ["prismatic", "revolute"])
    }

    /// Names of the frames that kinematic functions take.
    #[getter]
    fn frame_names<'py>(&self, py: Python<'py>) -> Bound<'py, PyTuple> {
        PyTuple::empty(py)
    }

    /// The inertial parameters, `(p,)`: here `(A, B, C)`.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        entry(py, "Arm.parameters", || {
            new_array(py, &[3], |out| {
                out.copy_from_slice(&self.model.parameter_array());
                Ok(())
            })
        })
    }

    /// The same arm with other inertial parameters, `(p,)`; any finite numbers.
    fn with_parameters(&self, py: Python<'_>, pi: &Bound<'_, PyAny>) -> PyResult<Arm> {
        entry(py, "Arm.with_parameters", || {
            let pi = vector("Arm.with_parameters", "pi", pi, 3)?;
            Ok(Arm { model: PlanarPr::with_parameters([pi[0], pi[1], pi[2]]) })
        })
    }

    /// What the model's source said that deserves a look: warnings, one line each.
    #[getter]
    fn report<'py>(&self, py: Python<'py>) -> Bound<'py, PyTuple> {
        PyTuple::empty(py)
    }

    /// The mass matrix `M(q)`, `(..., n, n)`.
    #[pyo3(signature = (q, *, out=None))]
    fn mass_matrix<'py>(&self, q: &Bound<'py, PyAny>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("mass_matrix", ["q"], [q], &[2, 2], out, &|arm, trig, x, m| arm.mass_matrix(&mut (), trig, x[0], m))
    }

    /// The Coriolis matrix `C(q, v)` with Christoffel symbols, `(..., n, n)`.
    #[pyo3(signature = (q, v, *, out=None))]
    fn coriolis_matrix<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("coriolis_matrix", ["q", "v"], [q, v], &[2, 2], out, &|arm, trig, x, c| {
            arm.coriolis_matrix(&mut (), trig, x[0], x[1], c);
        })
    }

    /// The gravity torque `g(q)`, `(..., n)`.
    #[pyo3(signature = (q, *, out=None))]
    fn gravity<'py>(&self, q: &Bound<'py, PyAny>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("gravity", ["q"], [q], &[2], out, &|arm, trig, x, g| arm.gravity(&mut (), trig, x[0], g))
    }

    /// `C(q, v) v + g(q)`, `(..., n)`.
    #[pyo3(signature = (q, v, *, out=None))]
    fn bias<'py>(&self, q: &Bound<'py, PyAny>, v: &Bound<'py, PyAny>, out: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("bias", ["q", "v"], [q, v], &[2], out, &|arm, trig, x, h| arm.bias(&mut (), trig, x[0], x[1], h))
    }

    /// Inverse dynamics `tau = M a + C v + g`, `(..., n)`.
    #[pyo3(signature = (q, v, a, *, out=None))]
    fn inverse_dynamics<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        a: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("inverse_dynamics", ["q", "v", "a"], [q, v, a], &[2], out, &|arm, trig, x, tau| {
            arm.inverse_dynamics(&mut (), trig, x[0], x[1], x[2], tau);
        })
    }

    /// Forward dynamics `a = M^-1 (tau - C v - g)`, `(..., n)`.
    #[pyo3(signature = (q, v, tau, *, out=None))]
    fn forward_dynamics<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        tau: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("forward_dynamics", ["q", "v", "tau"], [q, v, tau], &[2], out, &|arm, trig, x, a| {
            arm.forward_dynamics(&mut (), trig, x[0], x[1], x[2], a);
        })
    }

    /// The Slotine-Li regressor, `(..., n, p)`: `Y(q, v, v_r, a_r) parameters = M a_r + C(q, v) v_r + g`.
    #[pyo3(signature = (q, v, v_r, a_r, *, out=None))]
    fn regressor<'py>(
        &self,
        q: &Bound<'py, PyAny>,
        v: &Bound<'py, PyAny>,
        v_r: &Bound<'py, PyAny>,
        a_r: &Bound<'py, PyAny>,
        out: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.evaluate("regressor", ["q", "v", "v_r", "a_r"], [q, v, v_r, a_r], &[2, 3], out, &|arm, trig, x, y| {
            arm.regressor(&mut (), trig, x[0], x[1], x[2], x[3], y);
        })
    }

    /// Kinetic and potential energy, `(...)` each, in J.
    fn energy<'py>(&self, q: &Bound<'py, PyAny>, v: &Bound<'py, PyAny>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyAny>)> {
        let part = |k: usize| {
            self.evaluate("energy", ["q", "v"], [q, v], &[], None, &move |arm, trig, x, e| {
                let (kinetic, potential) = arm.energy(&mut (), trig, x[0], x[1]);
                e[0] = [kinetic, potential][k];
            })
        };
        Ok((part(0)?, part(1)?))
    }

    /// The pose of a frame, `(..., 4, 4)`.
    fn pose(&self, py: Python<'_>, q: &Bound<'_, PyAny>, frame: &str) -> PyResult<()> {
        let _ = q;
        Err(self.no_frames(py, "pose", frame))
    }

    /// The position of a frame, `(..., 3)`.
    fn position(&self, py: Python<'_>, q: &Bound<'_, PyAny>, frame: &str) -> PyResult<()> {
        let _ = q;
        Err(self.no_frames(py, "position", frame))
    }

    /// The geometric Jacobian of a frame, `(..., 6, n)`.
    fn jacobian(&self, py: Python<'_>, q: &Bound<'_, PyAny>, frame: &str) -> PyResult<()> {
        let _ = q;
        Err(self.no_frames(py, "jacobian", frame))
    }

    fn __repr__(&self) -> String {
        let [a, b, c] = self.model.parameter_array();
        format!("planar_pr(A={a}, B={b}, C={c})")
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Arm>().is_ok_and(|other| other.get().model == self.model)
    }

    fn __hash__(&self) -> u64 {
        self.model.parameter_array().iter().fold(17, |h, x| (h ^ x.to_bits()).wrapping_mul(0x100_0000_01b3))
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, ([f64; 3],))> {
        Ok((py.import("armlet._core")?.getattr("_restore_planar_pr")?, (self.model.parameter_array(),)))
    }
}

/// The PR robot on a horizontal plane, `M = [[A, B cos q2], [B cos q2, C]]`, with parameters `(A, B, C)`.
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
/// >>> import armlet as al
/// >>> al.planar_pr(2.0, 0.5, 0.5).mass_matrix([0.0, 0.0])
/// array([[2. , 0.5],
///        [0.5, 0.5]])
#[pyfunction]
#[pyo3(name = "planar_pr", signature = (A, B, C))]
#[allow(non_snake_case)]
pub fn planar_pr(py: Python<'_>, A: &Bound<'_, PyAny>, B: &Bound<'_, PyAny>, C: &Bound<'_, PyAny>) -> PyResult<Arm> {
    const NAME: &str = "planar_pr";
    entry(py, NAME, || Ok(Arm { model: PlanarPr::new(number(NAME, "A", A)?, number(NAME, "B", B)?, number(NAME, "C", C)?)? }))
}

/// Any finite parameters: what pickling and `with_parameters` made need not be a possible robot.
#[pyfunction]
pub fn _restore_planar_pr(pi: [f64; 3]) -> Arm {
    Arm { model: PlanarPr::with_parameters(pi) }
}
