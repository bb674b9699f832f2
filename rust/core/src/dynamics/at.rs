//! An arm at one configuration `q`: its quantities as vectors and matrices. Formulas of laws, plants and monitors use it, and occasional
//! evaluations on plain numbers. Joint torques are in N m for revolute joints, and in N for prismatic joints.

use super::{AnyArm, Dynamics, Model, Workspace};
use crate::kinematics::{Coordinates, jacobian_dot};
use crate::scalar::Real;
use crate::spatial::Vector3;
use nalgebra::{DMatrix, DVector};
use std::cell::RefCell;
use std::sync::Arc;

/// An arm at one configuration.
///
/// ```
/// use armlet_core::arm::Arm;
/// use armlet_core::dynamics::Model;
/// use nalgebra::dvector;
///
/// let model = Model::from(Arm::pendulum(1.0, 5.0)?);
/// let arm = model.at(&[0.3]);
/// assert!((arm.gravity()[0] - 5.0 * 0.3f64.sin()).abs() < 1e-15);
/// let (kinetic, _) = arm.energy(&dvector![2.0]);
/// assert!((kinetic - 2.0).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct At<S: Real = f64> {
    arm: Arc<AnyArm<S>>,
    q: Vec<S>,
    /// (sin, cos) of each coordinate.
    trig: Vec<(S, S)>,
    memory: RefCell<Workspace<S>>,
}

impl Model {
    /// The arm at the configuration `q`, `(n,)`.
    pub fn at<S: Real>(&self, q: &[S]) -> At<S> {
        At::new(&Arc::new(AnyArm::new(self)), q)
    }
}

/// The values that `fill` writes to a slice of zeros, as a vector.
fn vector<S: Real>(length: usize, fill: impl FnOnce(&mut [S])) -> DVector<S> {
    let mut values = vec![S::zero(); length];
    fill(&mut values);
    DVector::from_vec(values)
}

/// The values that `fill` writes to a slice of zeros in row-major order, as a matrix.
fn matrix<S: Real>(rows: usize, columns: usize, fill: impl FnOnce(&mut [S])) -> DMatrix<S> {
    let mut values = vec![S::zero(); rows * columns];
    fill(&mut values);
    DMatrix::from_row_slice(rows, columns, &values)
}

impl<S: Real> At<S> {
    /// The arm `arm` at the configuration `q`, `(n,)`, rad or m.
    pub fn new(arm: &Arc<AnyArm<S>>, q: &[S]) -> Self {
        let trig = q.iter().map(|q| q.sin_cos()).collect();
        At { memory: RefCell::new(arm.workspace()), arm: arm.clone(), q: q.to_vec(), trig }
    }

    /// This arm at another configuration `q`, `(n,)`, rad or m.
    pub fn at(&self, q: &DVector<S>) -> Self {
        At::new(&self.arm, q.as_slice())
    }

    /// Set the configuration `q`, `(n,)`, rad or m.
    pub fn move_to(&mut self, q: &[S]) {
        self.q.copy_from_slice(q);
        for (trig, q) in self.trig.iter_mut().zip(q) {
            *trig = q.sin_cos();
        }
    }

    /// Number of coordinates `n`.
    pub fn n(&self) -> usize {
        self.q.len()
    }

    /// Compute with the arm, its memory, and (sin, cos) of each coordinate. A recording has exactly the operations of the recursions, so that
    /// they have the same bits on plain numbers.
    fn compute<T>(&self, f: impl FnOnce(&AnyArm<S>, &mut Workspace<S>, &[(S, S)], &[S]) -> T) -> T {
        S::as_written(|| f(&self.arm, &mut self.memory.borrow_mut(), &self.trig, &self.q))
    }

    /// The mass matrix `M(q)`, `(n, n)`.
    pub fn mass_matrix(&self) -> DMatrix<S> {
        matrix(self.n(), self.n(), |m| self.write_mass_matrix(m))
    }

    /// Write the mass matrix to `m`, `(n, n)`, row-major.
    pub fn write_mass_matrix(&self, m: &mut [S]) {
        self.compute(|arm, ws, trig, q| arm.mass_matrix(ws, trig, q, m));
    }

    /// The Coriolis matrix `C(q, v)`, `(n, n)`, in the Christoffel factorisation.
    pub fn coriolis_matrix(&self, v: &DVector<S>) -> DMatrix<S> {
        matrix(self.n(), self.n(), |c| self.compute(|arm, ws, trig, q| arm.coriolis_matrix(ws, trig, q, v.as_slice(), c)))
    }

    /// The gravity torque `g(q)`, `(n,)`.
    pub fn gravity(&self) -> DVector<S> {
        vector(self.n(), |g| self.compute(|arm, ws, trig, q| arm.gravity(ws, trig, q, g)))
    }

    /// The bias torque `C(q, v) v + g(q)`, `(n,)`.
    pub fn bias(&self, v: &DVector<S>) -> DVector<S> {
        vector(self.n(), |out| self.compute(|arm, ws, trig, q| arm.bias(ws, trig, q, v.as_slice(), out)))
    }

    /// The inverse dynamics `tau = M a + C v + g`, `(n,)`.
    pub fn inverse_dynamics(&self, v: &DVector<S>, a: &DVector<S>) -> DVector<S> {
        vector(self.n(), |tau| self.compute(|arm, ws, trig, q| arm.inverse_dynamics(ws, trig, q, v.as_slice(), a.as_slice(), tau)))
    }

    /// The forward dynamics `a = M^-1 (tau - C v - g)`, `(n,)`.
    pub fn forward_dynamics(&self, v: &DVector<S>, tau: &DVector<S>) -> DVector<S> {
        vector(self.n(), |a| self.compute(|arm, ws, trig, q| arm.forward_dynamics(ws, trig, q, v.as_slice(), tau.as_slice(), a)))
    }

    /// The Slotine-Li regressor `Y(q, v, v_r, a_r)`, `(n, p)`, for `p` inertial parameters.
    pub fn regressor(&self, v: &DVector<S>, v_r: &DVector<S>, a_r: &DVector<S>) -> DMatrix<S> {
        let rates = [v, v_r, a_r].map(DVector::as_slice);
        matrix(self.n(), self.arm.parameter_count(), |y| self.compute(|arm, ws, trig, q| arm.regressor(ws, trig, q, rates, y)))
    }

    /// The products `Y pi`, `(n,)`, and `Y' s`, `(p,)`, with the regressor `Y(q, v, v_r, a_r)`, in a number of operations that is
    /// proportional to `n`. `rates` is `[v, v_r, a_r]`.
    pub fn regressor_products(&self, rates: [&DVector<S>; 3], pi: &[S], s: &DVector<S>) -> [DVector<S>; 2] {
        let (mut y_pi, mut yt_s) = (vec![S::zero(); self.n()], vec![S::zero(); pi.len()]);
        let rates = rates.map(DVector::as_slice);
        self.compute(|arm, ws, trig, q| arm.regressor_products(ws, trig, q, rates, (pi, &mut y_pi), (s.as_slice(), &mut yt_s)));
        [y_pi, yt_s].map(DVector::from_vec)
    }

    /// Kinetic and potential energy, J, at the velocity `v`.
    pub fn energy(&self, v: &DVector<S>) -> (S, S) {
        self.compute(|arm, ws, trig, q| arm.energy(ws, trig, q, v.as_slice()))
    }

    /// The friction torque of the joints of the model at the velocity `v`: viscous and Coulomb friction.
    pub fn friction(&self, v: &DVector<S>) -> DVector<S> {
        let of =
            |tree: &crate::arm::Tree<S>| v.iter().enumerate().map(|(i, &v)| super::energy::friction_torque(tree.leader(i), v)).collect();
        DVector::from_vec(self.arm.tree().map_or_else(|| vec![S::zero(); v.len()], |tree| S::as_written(|| of(tree))))
    }

    /// Position of a frame, m, world axes.
    pub fn position(&self, frame: usize) -> Vector3<S> {
        self.compute(|arm, ws, trig, q| arm.position(ws, trig, q, frame))
    }

    /// Position of a frame, m, world axes, and its geometric Jacobian, `(6, n)`.
    pub fn jacobian(&self, frame: usize) -> (Vector3<S>, DMatrix<S>) {
        let mut position = Vector3::from([S::zero(); 3]);
        let j = matrix(6, self.n(), |j| position = self.compute(|arm, ws, trig, q| arm.jacobian(ws, trig, q, frame, j)));
        (position, j)
    }

    /// The acceleration of a frame at the velocity `v` and zero joint accelerations, `[v; w]` in world axes. It comes from the Newton-Euler
    /// recursion.
    pub fn bias_acceleration(&self, v: &DVector<S>, frame: usize) -> [Vector3<S>; 2] {
        self.compute(|arm, ws, trig, q| arm.bias_acceleration(ws, (trig, q), v.as_slice(), frame))
    }

    /// The values of `m` Cartesian coordinates, `(m,)`, m and rad.
    pub fn coordinates(&self, coordinates: &Coordinates) -> DVector<S> {
        vector(coordinates.m(), |x| {
            self.compute(|arm, ws, trig, q| {
                if let AnyArm::Tree(tree) = arm {
                    coordinates.position(tree, &mut ws.poses, trig, q, x);
                }
            });
        })
    }

    /// The error `e`, `(m,)`, of `m` Cartesian coordinates to `target`, and their Jacobian, `(m, n)`.
    pub fn error_and_jacobian(&self, coordinates: &Coordinates, target: &DVector<S>) -> (DVector<S>, DMatrix<S>) {
        let (m, n) = (coordinates.m(), self.n());
        let (mut e, mut full) = (vec![S::zero(); m], vec![S::zero(); 6 * n]);
        let j = matrix(m, n, |j| {
            self.compute(|arm, ws, trig, q| {
                arm.error_and_jacobian(ws, coordinates, &mut full, (trig, q), target.as_slice(), (&mut e, j));
            });
        });
        (DVector::from_vec(e), j)
    }

    /// The rate of the Jacobian of `m` Cartesian coordinates at the velocity `v`, `(m, n)`.
    pub fn jacobian_dot(&self, coordinates: &Coordinates, v: &DVector<S>) -> DMatrix<S> {
        let mut full = vec![S::zero(); 6 * self.n()];
        matrix(coordinates.m(), self.n(), |rate| {
            self.compute(|arm, ws, trig, q| {
                if let AnyArm::Tree(tree) = arm {
                    jacobian_dot(tree, &mut ws.poses, &mut ws.motion, (trig, q), v.as_slice(), coordinates.frame, &mut full);
                    coordinates.copy_rows(&full, rate);
                }
            });
        })
    }
}
