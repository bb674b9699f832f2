//! `armlet.MomentumObserver`: the external torque from the generalised momentum, `r_dot = K (tau_ext - r)`.

use crate::arguments::Arguments;
use crate::arm::Arm;
use crate::arrays::{Axis, Form, SCALAR, adopted, copied, number, numbers, owned, require_finite, spread, text};
use crate::constructor_call::{NamedValues, constructor_repr, new_arguments};
use crate::errors::{Failure, entry, input_error};
use crate::interrupts::long;
use crate::seal::{Sealed, seal_call};
use armlet_core::analysis::momentum_observer::{MomentumObserver as Core, ObserverState};
use armlet_core::dynamics::Model;
use armlet_core::error::Result as CoreResult;
use armlet_core::linalg::Gain;
use armlet_core::memory;
use armlet_core::trace::c::{CFile, COptions};
use armlet_macros::entered;
use pyo3::prelude::*;
use pyo3::sync::MutexExt;
use pyo3::types::{PyDict, PyInt, PyTuple};
use std::sync::{Mutex, MutexGuard, PoisonError};

const NAME: &str = "MomentumObserver";

/// An observer of the external torque: its residual `r` follows `r_dot = K (tau_ext - r)`.
///
/// This holds if the model is exact. The observer uses positions, velocities and torques, but no accelerations. With the momentum `p = M v`
/// and the Coriolis matrix `C` of the Christoffel symbols, `r = K [p(t) - p(0) - int (tau - tau_f + C' v - g + r) ds]`. In a step of length
/// `dt`, the integrand uses the new `r_k`, and the other terms at the start of the step. So
/// `r_k = (I + K dt)^-1 (r_(k-1) + K (p_k - p_(k-1) - (tau - tau_f + C' v - g)_(k-1) dt))`.
///
/// `q`, `v` and `tau` are `(n,)`, or `(B, n)` for B arms of the same model. For elastic joints, `tau` is the torque of the joints on the
/// links.
///
/// Args:
///     arm: the model.
///     gain: `K`, 1/s, positive definite: scalar, `(n,)` or `(n, n)`.
///     friction: subtract the model's viscous and Coulomb friction `tau_f`; otherwise `r` includes it (keyword only). It cannot be
///         combined with `motor_inertia`.
///     motor_inertia: inertia `B` of the motors of elastic joints, kg m^2 or kg, scalar, `(n,)` or `(n, n)` (keyword only). With it, the
///         observer observes the motors: `q` and `v` are their positions and velocities, and `tau` is the motor torque minus the joint
///         torque. Then `r` estimates the negative friction torque of the motors.
///     threshold: `|r_i|` above the threshold is contact, N m or N, > 0: scalar or `(n,)` (keyword only). `calibrate` computes thresholds.
///
/// Raises:
///     InputError: a shape is wrong, a number is not finite, or a gain is not positive definite. A threshold that is not positive, and
///         `friction` with `motor_inertia`, also raise it.
///
/// Source: De Luca, Albu-Schaeffer, Haddadin and Hirzinger, Collision detection and safe reaction with the DLR-III lightweight
/// manipulator arm, IROS 2006.
///
/// >>> import armlet as al
/// >>> arm = al.planar_arm([0.5, 0.4], gravity=[0.0, 0.0])
/// >>> obs = al.MomentumObserver(arm, 50.0)
/// >>> obs.reset([0.3, 0.5], [0.0, 0.0])
/// >>> for _ in range(1000):
/// ...     r = obs.update([0.3, 0.5], [0.0, 0.0], [-1.0, 0.5], 1e-3)  # at rest: something holds against these torques
/// >>> r.round(6)
/// array([ 1. , -0.5])
#[pyclass(frozen, module = "armlet")]
pub struct MomentumObserver {
    observed: Mutex<Observed>,
    /// The arm of the observer.
    #[pyo3(get)]
    arm: Py<Arm>,
    arguments: NamedValues,
}

/// The observer of the core, and whether its samples are `(B, n)`.
struct Observed {
    core: Core,
    batched: bool,
}

impl Observed {
    /// The shape of an array with `width` numbers per observed arm: `(width,)` or `(B, width)`.
    fn shape(&self, width: usize) -> Vec<usize> {
        if self.batched { vec![self.core.rows(), width] } else { vec![width] }
    }

    /// Refuse samples whose number of arms differs from the earlier samples.
    fn require_rows(&self, py: Python<'_>, function: &str, shape: &[usize]) -> Result<(), Failure> {
        let expected = self.shape(self.core.n());
        if self.core.rows() > 0 && shape != expected {
            let problem = format!("has another shape than before: expected {expected:?}, got {shape:?}");
            return Err(input_error(py, function, "q", problem).into());
        }
        Ok(())
    }
}

/// The data of an observer of links (not of motors): the model, the gain, and the subtracted viscous and Coulomb friction, `(n,)` each.
pub type Links = (Model, Gain, [Vec<f64>; 2]);

/// The shape and the numbers of an argument `(n,)` or `(B, n)`.
type Rows = (Vec<usize>, Vec<f64>);

impl MomentumObserver {
    /// Lock the observer. A waiting thread releases the interpreter lock, because the thread that holds the observer may need this lock.
    fn observed(&self, py: Python<'_>) -> MutexGuard<'_, Observed> {
        self.observed.lock_py_attached(py).unwrap_or_else(PoisonError::into_inner)
    }

    /// The model, the gain, the subtracted friction and the thresholds of an observer of links; `None` for an observer of motors.
    pub fn of_links(&self, py: Python<'_>) -> Option<(Links, Option<Vec<f64>>)> {
        let observed = self.observed(py);
        let (model, gain, friction) = observed.core.of_links()?;
        Some(((model.clone(), gain.clone(), friction.clone()), observed.core.thresholds().map(<[f64]>::to_vec)))
    }

    /// The files of C code that compute the observer.
    pub fn printed(&self, py: Python<'_>, options: &COptions) -> Result<Vec<CFile>, Failure> {
        self.detached(py, |observed| observed.core.export_c(options))
    }

    /// Call `work` on the observer without the interpreter lock.
    fn detached<T: Send>(&self, py: Python<'_>, work: impl FnOnce(&mut Observed) -> CoreResult<T> + Send) -> Result<T, Failure> {
        long(py, || work(&mut self.observed.lock().unwrap_or_else(PoisonError::into_inner)))
    }

    /// Read `K` arguments `(n,)` or `(B, n)`, which must have equal shapes.
    fn rows<const K: usize>(&self, function: &str, given: [(&'static str, &Bound<'_, PyAny>); K]) -> Result<[Rows; K], Failure> {
        let n = self.observed(given[0].1.py()).core.n();
        let forms = [Form(&[Axis::Is(n)]), Form(&[Axis::Any("B"), Axis::Is(n)])];
        let mut all = std::array::from_fn(|_| (Vec::new(), Vec::new()));
        for (k, (name, value)) in given.iter().enumerate() {
            let (shape, values) = numbers(function, name, value, &forms)?;
            require_finite(value.py(), function, name, &shape, &values)?;
            all[k] = (shape.to_vec(), owned(values)?);
            if all[k].0 != all[0].0 {
                let problem = format!("has another shape than {}: expected {:?}, got {:?}", given[0].0, all[0].0, all[k].0);
                return Err(input_error(value.py(), function, name, problem).into());
            }
        }
        Ok(all)
    }

    /// Compute the wrenches at a frame, and the remainder of the residual that they do not explain.
    fn wrench_and_unexplained<'py>(
        &self,
        function: &str,
        q: &Bound<'py, PyAny>,
        frame: &Bound<'py, PyAny>,
        eps: Option<&Bound<'py, PyAny>>,
    ) -> Result<[Bound<'py, PyAny>; 2], Failure> {
        let py = q.py();
        let [(shape, q)] = self.rows(function, [("q", q)])?;
        let frame = text(function, "frame", frame)?;
        let eps = eps.map(|eps| number(function, "eps", eps)).transpose()?;
        self.observed(py).require_rows(py, function, &shape)?;
        let (wrench, unexplained, [wide, narrow]) = self.detached(py, |observed| {
            let (rows, n) = (observed.core.rows(), observed.core.n());
            let (mut wrench, mut unexplained) = (memory::zeros(6 * rows)?, memory::zeros(n * rows)?);
            observed.core.wrench(&q, &frame, eps, &mut wrench, &mut unexplained)?;
            Ok((wrench, unexplained, [6, n].map(|width| observed.shape(width))))
        })?;
        Ok([adopted(py, &wide, wrench)?, adopted(py, &narrow, unexplained)?])
    }
}

#[entered]
#[pymethods]
impl MomentumObserver {
    #[new]
    #[arguments(arm, gain, *, friction=false, motor_inertia=None, threshold=None)]
    fn new() -> Result<Self, Failure> {
        let mut given = Arguments::new(NAME, arm)?;
        let model = given.model();
        let n = model.n();
        let gain = given.gain("gain", gain, n)?;
        let friction = given.flag("friction", friction)?;
        if friction {
            model.tree("friction")?;
        }
        let mut core = Core::new(model, gain, friction)?;
        if let Some(inertia) = motor_inertia {
            core = core.of_motors(given.gain("motor_inertia", inertia, n)?)?;
        }
        if let Some(threshold) = threshold {
            let (shape, values) = numbers(NAME, "threshold", threshold, &[SCALAR, Form(&[Axis::Is(n)])])?;
            core.set_thresholds(spread(&shape, values, n)?)?;
            given.store_copy("threshold", threshold)?;
        }
        let Arguments { arm, arguments, .. } = given;
        let observed = Mutex::new(Observed { core, batched: false });
        Ok(MomentumObserver { observed, arm: arm.unbind(), arguments })
    }

    /// Restart the observer at the positions `q` (rad or m) and velocities `v` (rad/s or m/s), `(n,)` or `(B, n)`, with `r = 0`.
    fn reset(&self, q: &Bound<'_, PyAny>, v: &Bound<'_, PyAny>) -> Result<(), Failure> {
        let [(shape, q), (_, v)] = self.rows(NAME, [("q", q), ("v", v)])?;
        self.detached(py, |observed| {
            observed.core.reset(&q, &v)?;
            observed.batched = shape.len() > 1;
            Ok(())
        })
    }

    /// Process the next sample, and return `r`, N m or N, of the shape of `q`.
    ///
    /// Args:
    ///     q, v: positions (rad or m) and velocities (rad/s or m/s) at the sample, `(n,)` or `(B, n)`.
    ///     tau: the torques since the last sample, N m or N, of the shape of `q`.
    ///     dt: the time since the last sample, s, > 0.
    ///
    /// Without an earlier `reset`, the first sample starts the observer with `r = 0`.
    ///
    /// Raises:
    ///     InputError: a shape is wrong, a number is not finite, `dt` is not positive, or `r` would not be finite. The observer then does
    ///         not change.
    #[arguments(q, v, tau, dt)]
    fn update<'py>(&self) -> Result<Bound<'py, PyAny>, Failure> {
        let [(shape, q), (_, v), (_, tau)] = self.rows(NAME, [("q", q), ("v", v), ("tau", tau)])?;
        let dt = number(NAME, "dt", dt)?;
        self.observed(py).require_rows(py, NAME, &shape)?;
        let residual = self.detached(py, |observed| {
            observed.core.update(&q, &v, &tau, dt)?;
            observed.batched = shape.len() > 1;
            memory::copied(&observed.core.state().residual)
        })?;
        Ok(adopted(py, &shape, residual)?)
    }

    /// The last residual `r`, `(n,)` or `(B, n)`, N m or N; None before the first sample or `reset`.
    #[getter]
    fn residual<'py>(&self) -> Result<Option<Bound<'py, PyAny>>, Failure> {
        let observed = self.observed(py);
        let values = &observed.core.state().residual;
        if values.is_empty() { Ok(None) } else { Ok(Some(copied(py, &observed.shape(observed.core.n()), values)?)) }
    }

    /// The thresholds of contact `(n,)`, N m or N; None without thresholds.
    #[getter]
    fn threshold<'py>(&self) -> Result<Option<Bound<'py, PyAny>>, Failure> {
        let observed = self.observed(py);
        observed.core.thresholds().map(|thresholds| copied(py, &[thresholds.len()], thresholds)).transpose()
    }

    /// Compute the wrench `F = [f; m]` at the origin of `frame` that explains `r` best: `(6,)` or `(B, 6)`, N and N m, world axes.
    ///
    /// `F` is the least-squares solution of `r = J' F` with the smallest norm, if all nonzero singular values of `J'` are at least `eps`. A
    /// smaller one, `s`, is inverted as `s / eps^2`. The default of `eps` is 0.02 times the largest row norm of `J'`. The
    /// argument `q` must be the positions of the last sample.
    #[arguments(q, frame, *, eps=None)]
    fn wrench<'py>(&self) -> Result<Bound<'py, PyAny>, Failure> {
        let [wrench, _] = self.wrench_and_unexplained(NAME, q, frame, eps)?;
        Ok(wrench)
    }

    /// Compute the part of `r` that the wrench `F` at a frame does not explain: `r - J' F`, N m or N, of the shape of `q`.
    ///
    /// The method has the same arguments as `wrench`.
    #[arguments(q, frame, *, eps=None)]
    fn unexplained<'py>(&self) -> Result<Bound<'py, PyAny>, Failure> {
        let [_, unexplained] = self.wrench_and_unexplained(NAME, q, frame, eps)?;
        Ok(unexplained)
    }

    /// Set the threshold of each joint to `|mean| + sigmas * deviation` of recorded `residuals`, `(K, n)`, N m or N.
    ///
    /// The record must be without contact, with `K >= 2`. `deviation` is the standard deviation; `sigmas` is 5 if None.
    #[arguments(residuals, sigmas = 5.0)]
    fn calibrate(&self) -> Result<(), Failure> {
        let n = self.observed(py).core.n();
        let (shape, values) = numbers(NAME, "residuals", residuals, &[Form(&[Axis::Any("K"), Axis::Is(n)])])?;
        require_finite(py, NAME, "residuals", &shape, &values)?;
        let sigmas = sigmas.map_or(Ok(5.0), |sigmas| number(NAME, "sigmas", sigmas))?;
        Ok(self.observed(py).core.calibrate(&values, sigmas)?)
    }

    /// The index of the joint of the touched link, or -1 without contact: an integer, or an array `(B,)`.
    ///
    /// The joint is the outermost one with `|r_i|` above its threshold, because a force on a link loads no joint further out. If several
    /// branches have such a joint, the result is the one with the largest ratio of `|r_i|` to its threshold.
    fn contact<'py>(&self) -> Result<Bound<'py, PyAny>, Failure> {
        let observed = self.observed(py);
        let found: Vec<i64> = observed.core.contacts()?.into_iter().map(|joint| joint.map_or(-1, |joint| joint as i64)).collect();
        if observed.batched {
            Ok(adopted(py, &[found.len()], found)?)
        } else {
            Ok(PyInt::new(py, found.first().copied().unwrap_or(-1)).into_any())
        }
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        constructor_repr(slf.as_any(), Some(slf.get().arm.bind(slf.py()).as_any()), &slf.get().arguments)
    }

    /// The pickled form: the arguments, the state and the thresholds.
    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Sealed<'py>> {
        let (_, keywords) = new_arguments(py, Some(self.arm.bind(py).as_any()), &self.arguments)?;
        let observed = self.observed(py);
        let ObserverState { residual, momentum, drift } = observed.core.state().clone();
        let thresholds = observed.core.thresholds().map(<[f64]>::to_vec);
        let parts: Bound<'py, PyTuple> = (keywords, (residual, momentum, drift), thresholds, observed.batched).into_pyobject(py)?;
        seal_call(py, "_restore_observer", parts)
    }
}

/// Restore a pickled `MomentumObserver` from its arguments, state and thresholds. `batched`: its samples are `(B, n)`.
#[entered]
#[pyfunction]
pub fn _restore_observer<'py>(
    py: Python<'py>,
    keywords: Bound<'py, PyDict>,
    state: (Vec<f64>, Vec<f64>, Vec<f64>),
    thresholds: Option<Vec<f64>>,
    batched: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let made = py.get_type::<MomentumObserver>().call((), Some(&keywords))?;
    let observer = made.cast::<MomentumObserver>()?.clone();
    entry(py, NAME, || {
        let observer = observer.get();
        let (residual, momentum, drift) = state;
        let mut observed = observer.observed(py);
        observed.core.resume(ObserverState { residual, momentum, drift })?;
        if let Some(thresholds) = thresholds {
            observed.core.set_thresholds(thresholds)?;
        }
        observed.batched = batched;
        Ok(())
    })?;
    Ok(made)
}
