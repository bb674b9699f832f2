//! The target model of Cartesian impedance (Hogan 1985), which an arm under that law alone obeys at every instant:
//!
//! `M_x x'' + (S_x + D_m) x' + K_m (x - x_d) = F`, `M_x = (J M^-1 J')^-1`, `S_x x' = M_x (J M^-1 C v - J' v)`,
//!
//! with `J'` the rate of `J` in the last term. That form of `S_x x'` needs no inverse of `J`, so it holds for redundant arms too. `x''` is
//! `J a + J' v` with the acceleration `a` of the plant; the rate of `J` comes from dual numbers. A moving target has `D_m (x' - x_d')`.

use super::force::Force;
use super::problem::Problem;
use crate::dynamics::ArmAt;
use crate::law::{CartesianImpedanceSpec, LawSpec};
use crate::linalg::cholesky;
use crate::plant::{Plant, PlantSpec};
use crate::scalar::Dual;

/// `M_x` counts as defined where the smallest singular value of `J`, its rows scaled to length one, is above this.
const EPS: f64 = 0.02;

/// One run's.
pub struct TargetModel<'a> {
    law: &'a CartesianImpedanceSpec,
    plant: Box<dyn Plant<f64> + Send>,
    force: Option<&'a Force>,
    /// The frame at which the force acts where it is not given in the law's own axes.
    elsewhere: Option<usize>,
    moving: ArmAt<Dual<f64>>,
    moving_q: Vec<Dual<f64>>,
    rates: Vec<f64>,
    /// `(n, n)`: `M` and its factor, `C`.
    mass: Vec<f64>,
    factor: Vec<f64>,
    coriolis: Vec<f64>,
    /// `(m, n)`: `J` and `J L^-T` of `M = L L'`; `(n,)`: `L^-1` of a torque.
    jacobian: Vec<f64>,
    spread: Vec<f64>,
    torque: Vec<f64>,
    /// `(m, m)`: a matrix and its factor.
    square: Vec<f64>,
    square_factor: Vec<f64>,
    /// `(m,)`: `x_d - x`, `x' - x_d'`, and the terms of the model.
    e: Vec<f64>,
    slip: Vec<f64>,
    terms: [Vec<f64>; 5],
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

impl<'a> TargetModel<'a> {
    /// Of run `run`, where [`Problem::watches_target`].
    pub fn new(problem: &Problem<'a>, run: usize) -> Option<Self> {
        let (true, LawSpec::CartesianImpedance(law)) = (problem.watches_target(), problem.law(run)) else { return None };
        let plant = problem.plant(run);
        let (n, m) = (plant.n(), law.coordinates.m());
        let zeros = |k: usize| vec![0.0; k];
        Some(TargetModel {
            law,
            plant: PlantSpec::build::<f64>(|_| plant, problem.force_frame()),
            force: problem.force(run),
            elsewhere: problem.force_frame,
            moving: ArmAt::of_lanes(|_| plant.model()),
            moving_q: vec![Dual::default(); n],
            rates: zeros(2 * n),
            mass: zeros(n * n),
            factor: zeros(n * n),
            coriolis: zeros(n * n),
            jacobian: zeros(m * n),
            spread: zeros(m * n),
            torque: zeros(n),
            square: zeros(m * m),
            square_factor: zeros(m * m),
            e: zeros(m),
            slip: zeros(m),
            terms: std::array::from_fn(|_| zeros(m)),
        })
    }

    /// The largest term of the model and the largest residual, at time `t`, plant state `x` and input `tau`, with `arm` moved to its `q`;
    /// zeros where `M_x` is not defined.
    pub fn evaluate(&mut self, t: f64, arm: &mut ArmAt, desired: &[f64], x: &[f64], tau: &[f64]) -> [f64; 2] {
        let (n, m) = (tau.len(), self.e.len());
        let (q, v) = x.split_at(n);
        arm.error_and_jacobian(&self.law.coordinates, &desired[..m], &mut self.e, &mut self.jacobian);
        if !self.is_regular(n, m) {
            return [0.0; 2];
        }
        arm.mass_matrix(&mut self.mass);
        if !cholesky::factor_into(n, &self.mass, &mut self.factor) {
            return [0.0; 2];
        }
        self.spread.copy_from_slice(&self.jacobian);
        self.spread.chunks_exact_mut(n).for_each(|row| cholesky::solve_lower(n, &self.factor, row));
        let wrench = self.force.map_or([0.0; 6], |force| force.at(t));
        self.plant.rates(arm.trig(), x, tau, &wrench, &mut self.rates);
        arm.coriolis_matrix(v, &mut self.coriolis);
        for (q, (&value, &rate)) in self.moving_q.iter_mut().zip(q.iter().zip(v)) {
            *q = Dual::new(value, rate);
        }
        self.moving.move_to(&self.moving_q);
        let (_, moving) = self.moving.jacobian(self.law.coordinates.frame);
        let [inertial, coupling, damping, spring, force] = &mut self.terms;
        for (torque, row) in self.torque.iter_mut().zip(self.coriolis.chunks_exact(n)) {
            *torque = dot(row, v);
        }
        cholesky::solve_lower(n, &self.factor, &mut self.torque);
        for (k, &row) in self.law.coordinates.rows.iter().enumerate() {
            let turning: f64 = moving[row * n..(row + 1) * n].iter().zip(v).map(|(j, v)| j.rate * v).sum();
            inertial[k] = dot(&self.jacobian[k * n..(k + 1) * n], &self.rates[n..]) + turning;
            coupling[k] = dot(&self.spread[k * n..(k + 1) * n], &self.torque) - turning;
            self.slip[k] = dot(&self.jacobian[k * n..(k + 1) * n], v) - desired[m + k];
        }
        for k in 0..m {
            damping[k] = (0..m).map(|l| self.law.damping.at(k, l) * self.slip[l]).sum();
            spring[k] = -(0..m).map(|l| self.law.stiffness.at(k, l) * self.e[l]).sum::<f64>();
            force[k] = wrench[self.law.coordinates.rows[k]];
        }
        if let (Some(frame), Some(_)) = (self.elsewhere, self.force) {
            let (_, there) = arm.jacobian(frame);
            for (i, torque) in self.torque.iter_mut().enumerate() {
                *torque = (0..6).map(|k| there[k * n + i] * wrench[k]).sum();
            }
            cholesky::solve_lower(n, &self.factor, &mut self.torque);
            for k in 0..m {
                force[k] = dot(&self.spread[k * n..(k + 1) * n], &self.torque);
            }
        }
        for k in 0..m {
            for l in 0..m {
                self.square[k * m + l] = dot(&self.spread[k * n..(k + 1) * n], &self.spread[l * n..(l + 1) * n]);
            }
        }
        if !cholesky::factor_into(m, &self.square, &mut self.square_factor) {
            return [0.0; 2];
        }
        cholesky::solve(m, &self.square_factor, inertial);
        cholesky::solve(m, &self.square_factor, coupling);
        if self.elsewhere.is_some() {
            cholesky::solve(m, &self.square_factor, force);
        }
        let (mut largest, mut worst) = (0.0f64, 0.0f64);
        for k in 0..m {
            let residual = (inertial[k] + coupling[k] + damping[k] + spring[k] - force[k]).abs();
            // `max` would swallow a NaN.
            worst = if residual <= worst { worst } else { residual };
            for term in [&inertial, &coupling, &damping, &spring, &force] {
                largest = largest.max(term[k].abs());
            }
        }
        [largest, worst]
    }

    /// Whether `J` is far enough from a singularity: with rows of length one, the smallest eigenvalue of `J J'` is above `EPS^2`.
    fn is_regular(&mut self, n: usize, m: usize) -> bool {
        for k in 0..m {
            for l in 0..m {
                let (a, b) = (&self.jacobian[k * n..(k + 1) * n], &self.jacobian[l * n..(l + 1) * n]);
                self.square[k * m + l] = dot(a, b) / (dot(a, a) * dot(b, b)).sqrt();
            }
            self.square[k * m + k] -= EPS * EPS;
        }
        cholesky::factor_into(m, &self.square, &mut self.square_factor)
    }
}
