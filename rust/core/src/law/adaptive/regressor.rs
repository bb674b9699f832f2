//! The regressor of the estimated parameters, and the regressors of momentum and drift.

use super::{AdaptiveSpec, JointColumn};
use crate::dynamics::At;
use crate::scalar::Real;
use crate::trace::expression::zeros;
use crate::trace::{E, M, V};
use nalgebra::{DMatrix, DVector};

/// The regressor `Y(q, v, v_r, a_r)` of the estimated parameters, `(n, p)`: columns of the bodies or of the base set, then the diagonals of
/// the joint columns.
pub(super) struct Regressor<'a> {
    law: &'a AdaptiveSpec,
    arm: &'a At<E>,
    /// `v`, `v_r` and `a_r`.
    rates: [V; 3],
    /// The diagonals of the joint columns, `(n,)` each.
    pub columns: Vec<V>,
}

impl AdaptiveSpec {
    /// The regressor with the smoothing speeds `speeds` of its joint columns.
    pub(super) fn regressor<'a>(&'a self, arm: &'a At<E>, speeds: &V, rates: [&V; 3]) -> Regressor<'a> {
        let columns = self.columns.diagonals(speeds.as_slice(), [rates[1], rates[2]], 1.0);
        Regressor { law: self, arm, rates: rates.map(V::clone), columns }
    }

    /// Indices of the estimated parameters of bodies.
    pub(super) fn body_columns(&self) -> Vec<usize> {
        self.base.as_ref().map_or_else(|| (0..self.model.parameter_count()).collect(), |base| base.columns.clone())
    }

    /// The regressor `Y_M` of the momentum `M v`, `(n, p)`.
    pub(super) fn momentum_regressor<S: Real>(&self, arm: &At<S>, v: &DVector<S>, speeds: &[S]) -> DMatrix<S> {
        let zero = DVector::from_element(v.len(), S::zero());
        let gravity = arm.regressor(&zero, &zero, &zero);
        let y_m = arm.regressor(&zero, &zero, v) - gravity;
        with_columns(y_m.select_columns(&self.body_columns()), &self.columns.diagonals(speeds, [&zero, v], 0.0))
    }

    /// The regressor `Y_D` of the drift `g - C' v`, with friction, `(n, p)`.
    pub(super) fn drift_regressor<S: Real>(&self, arm: &At<S>, v: &DVector<S>, speeds: &[S]) -> DMatrix<S> {
        let (n, own) = (v.len(), self.body_columns());
        let zero = DVector::from_element(n, S::zero());
        let gravity = arm.regressor(&zero, &zero, &zero);
        let mut y_d = gravity.select_columns(&own);
        // The products `Y_g' v` of the estimated parameters.
        let products = |column: nalgebra::DVectorView<S>| column.iter().zip(v).fold(S::zero(), |sum, (&g, &v)| sum + g * v);
        let of_gravity: Vec<S> = y_d.column_iter().map(products).collect();
        for i in 0..n {
            // Row i of C' v is (Y(q, v, e_i, 0) - Y_g)' v.
            let e_i = DVector::from_fn(n, |k, _| S::splat(f64::from(u8::from(k == i))));
            let [_, row] = arm.regressor_products([v, &e_i, &zero], &vec![S::zero(); gravity.ncols()], v);
            for (at, (&k, &of_gravity)) in own.iter().zip(&of_gravity).enumerate() {
                y_d[(i, at)] -= row[k] - of_gravity;
            }
        }
        with_columns(y_d, &self.columns.diagonals(speeds, [v, &zero], 1.0))
    }

    /// The regressor `Y(q, v, v, a)` on plain numbers, `(n, p)`.
    pub(super) fn plain_regressor(&self, arm: &At, v: &DVector<f64>, a: &DVector<f64>) -> DMatrix<f64> {
        let columns = self.columns.diagonals(self.columns.speeds(), [v, a], 1.0);
        with_columns(arm.regressor(v, v, a).select_columns(&self.body_columns()), &columns)
    }

    /// Rotor inertias that are known, `(n,)`; zeros if they are estimated.
    pub(super) fn known_rotors(&self) -> Vec<f64> {
        if self.columns.has(JointColumn::Armature) { vec![0.0; self.model.n()] } else { self.model.armature() }
    }
}

/// The matrix `y` with a diagonal block for each of `columns` after its columns.
fn with_columns<S: Real>(y: DMatrix<S>, columns: &[DVector<S>]) -> DMatrix<S> {
    columns.iter().fold(y, |y, column| {
        let (n, p) = y.shape();
        let mut y = y.insert_columns(p, n, S::zero());
        (0..n).for_each(|i| y[(i, p + i)] = column[i]);
        y
    })
}

impl Regressor<'_> {
    /// The matrix `Y`.
    pub fn matrix(&self) -> M {
        let [v, v_r, a_r] = &self.rates;
        with_columns(self.arm.regressor(v, v_r, a_r).select_columns(&self.law.body_columns()), &self.columns)
    }

    /// The products `Y pi` and `Y' s`, in a number of operations that is proportional to `n`.
    pub fn products(&self, pi: &V, s: &V) -> [V; 2] {
        let (n, own) = (s.len(), self.law.body_columns());
        let mut all = zeros(self.law.model.parameter_count());
        own.iter().zip(pi).for_each(|(&k, &pi)| all[k] = pi);
        let [mut y_pi, y_s] = self.arm.regressor_products(self.rates.each_ref(), all.as_slice(), s);
        let mut y_s: Vec<E> = own.iter().map(|&k| y_s[k]).collect();
        for column in &self.columns {
            y_pi += column.component_mul(&pi.rows(y_s.len(), n));
            y_s.extend(&column.component_mul(s));
        }
        [y_pi, V::from_vec(y_s)]
    }
}
