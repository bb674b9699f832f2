//! The quantities of an arm on nalgebra's types, one configuration at a time.
//!
//! Each function copies its result out of [`Evaluator::one`]. Loops call that function directly, with slices.

use super::{Evaluator, Quantity, Query};
use crate::error::{Error, Result};
use crate::status::Status;
use nalgebra::{DMatrix, DVector, Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

/// # On nalgebra's types
///
/// `q`, `v`, `a` and `tau` are `(n,)`. A frame is an index (see [`crate::arm::Arm::frame_index`]). A wrong size is the error `WrongShape`.
/// A number that is not finite, or an index without a frame, is the error `Input`. A result that is not finite, because of a singular mass
/// matrix or an overflow, is the error `Solve`.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Evaluator;
/// use nalgebra::dvector;
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0, -9.81])?;
/// let (tip, mut arm) = (arm.frame_index("link2")?, Evaluator::new(&arm));
/// let (q, v, a) = (dvector![0.3, -0.8], dvector![1.0, 0.5], dvector![0.2, -2.0]);
/// let tau = arm.inverse_dynamics(&q, &v, &a)?;
/// let expected = arm.mass_matrix(&q)? * &a + arm.coriolis_matrix(&q, &v)? * &v + arm.gravity(&q)?;
/// assert!((&tau - expected).norm() < 1e-13);
/// assert!((arm.forward_dynamics(&q, &v, &tau)? - a).norm() < 1e-12);
/// let twist = arm.jacobian(&q, tip)? * &v;
/// assert!((twist[5] - 1.5).abs() < 1e-15);
/// let pose = arm.pose(&q, tip)?;
/// assert!((pose.translation.y - (0.5 * 0.3f64.sin() + 0.4 * (-0.5f64).sin())).abs() < 1e-15);
/// assert!((pose.rotation.angle() - 0.5).abs() < 1e-12);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
impl Evaluator {
    fn answer(&mut self, query: impl Into<Query>, inputs: &[&DVector<f64>]) -> Result<DMatrix<f64>> {
        let query = query.into();
        let (rows, columns) = query.shape(self.size());
        let mut out = vec![0.0; rows * columns];
        let inputs: Vec<&[f64]> = inputs.iter().map(|input| input.as_slice()).collect();
        if !self.one(&query, &inputs, &mut out)? {
            let problem = "the answer is not finite: the mass matrix is singular, or a number overflows";
            return Err(Error::Solve { status: Status::Diverged, t: 0.0, problem: problem.into() });
        }
        Ok(DMatrix::from_row_slice(rows, columns, &out))
    }

    fn vector(&mut self, quantity: Quantity, inputs: &[&DVector<f64>]) -> Result<DVector<f64>> {
        self.answer(quantity, inputs).map(|row| row.row(0).transpose())
    }

    /// Mass matrix `M(q)`, `(n, n)`, kg m^2, kg m or kg. Errors, also of the functions below: `WrongShape` for a wrong length, `Input`
    /// for an input that is not finite. A result that is not finite is the error `Solve`.
    pub fn mass_matrix(&mut self, q: &DVector<f64>) -> Result<DMatrix<f64>> {
        self.answer(Quantity::MassMatrix, &[q])
    }

    /// Coriolis matrix `C(q, v)`, `(n, n)`, in the Christoffel factorisation.
    pub fn coriolis_matrix(&mut self, q: &DVector<f64>, v: &DVector<f64>) -> Result<DMatrix<f64>> {
        self.answer(Quantity::CoriolisMatrix, &[q, v])
    }

    /// Gravity torque `g(q)`, `(n,)`, N m or N.
    pub fn gravity(&mut self, q: &DVector<f64>) -> Result<DVector<f64>> {
        self.vector(Quantity::Gravity, &[q])
    }

    /// Bias torque `C(q, v) v + g(q)`, `(n,)`, N m or N.
    pub fn bias(&mut self, q: &DVector<f64>, v: &DVector<f64>) -> Result<DVector<f64>> {
        self.vector(Quantity::Bias, &[q, v])
    }

    /// Inverse dynamics `tau = M a + C v + g`, `(n,)`, N m or N.
    pub fn inverse_dynamics(&mut self, q: &DVector<f64>, v: &DVector<f64>, a: &DVector<f64>) -> Result<DVector<f64>> {
        self.vector(Quantity::InverseDynamics, &[q, v, a])
    }

    /// Forward dynamics `a = M^-1 (tau - C v - g)`, `(n,)`, rad/s^2 or m/s^2. A singular mass matrix is an error (`Solve`).
    pub fn forward_dynamics(&mut self, q: &DVector<f64>, v: &DVector<f64>, tau: &DVector<f64>) -> Result<DVector<f64>> {
        self.vector(Quantity::ForwardDynamics, &[q, v, tau])
    }

    /// The Slotine-Li regressor, `(n, 10 b)` for `b` bodies: `Y pi = M a_r + C(q, v) v_r + g`.
    pub fn regressor(&mut self, q: &DVector<f64>, v: &DVector<f64>, v_r: &DVector<f64>, a_r: &DVector<f64>) -> Result<DMatrix<f64>> {
        self.answer(Quantity::Regressor, &[q, v, v_r, a_r])
    }

    /// Kinetic and potential energy, J.
    pub fn energy(&mut self, q: &DVector<f64>, v: &DVector<f64>) -> Result<(f64, f64)> {
        self.answer(Quantity::Energy, &[q, v]).map(|row| (row[0], row[1]))
    }

    /// Pose `X_WF` of the frame with this index in the world, m.
    pub fn pose(&mut self, q: &DVector<f64>, frame: usize) -> Result<Isometry3<f64>> {
        let x = self.answer(Query { frame, ..Quantity::Pose.into() }, &[q])?;
        let rotation = Rotation3::from_matrix_unchecked(Matrix3::from(x.fixed_view::<3, 3>(0, 0)));
        let translation = Translation3::from(Vector3::from(x.fixed_view::<3, 1>(0, 3)));
        Ok(Isometry3::from_parts(translation, UnitQuaternion::from_rotation_matrix(&rotation)))
    }

    /// Geometric Jacobian, `(6, n)`: `J v = [linear; angular]` of the frame's origin, m/s and rad/s, world axes.
    pub fn jacobian(&mut self, q: &DVector<f64>, frame: usize) -> Result<DMatrix<f64>> {
        self.answer(Query { frame, ..Quantity::Jacobian.into() }, &[q])
    }

    /// Rate of the geometric Jacobian, `dJ/dt`, `(6, n)`.
    pub fn jacobian_dot(&mut self, q: &DVector<f64>, v: &DVector<f64>, frame: usize) -> Result<DMatrix<f64>> {
        self.answer(Query { frame, ..Quantity::JacobianDot.into() }, &[q, v])
    }
}
