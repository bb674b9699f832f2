//! The closed loop linearised about a state: `d x_dot = A d x`, `x = [plant, law]`, one column per dual evaluation of
//! plant and law, so exact to rounding.

use crate::error::Result;
use crate::law::LawSpec;
use crate::linalg::eigenvalues::eigenvalues;
use crate::plant::PlantSpec;
use crate::scalar::{Dual, Real};

/// `A`, row-major `(s, s)`, at time `t`, plant state `x` and law state `z`, under `wrench` `[f; m]` (world axes) at
/// `force_frame`.
pub fn loop_slope(
    plant: &PlantSpec,
    law: &LawSpec,
    t: f64,
    x: &[f64],
    z: &[f64],
    wrench: &[f64; 6],
    force_frame: Option<usize>,
) -> Vec<f64> {
    let (n, states, s) = (plant.n(), x.len(), x.len() + z.len());
    let mut plant = PlantSpec::build::<Dual>(|_| plant, force_frame);
    let desired = law.desired(t);
    let mut law = LawSpec::build::<Dual>(|_| law);
    let wrench: Vec<Dual> = wrench.iter().map(|&w| Dual::splat(w)).collect();
    let mut moving: Vec<Dual> = x.iter().chain(z).map(|&x| Dual::splat(x)).collect();
    let (mut tau, mut dx) = (vec![Dual::default(); n], vec![Dual::default(); s]);
    let mut slope = vec![0.0; s * s];
    for j in 0..s {
        moving[j].rate = 1.0;
        let trig: Vec<(Dual, Dual)> = moving[..n].iter().map(|q| q.sin_cos()).collect();
        let (x, z) = moving.split_at(states);
        let (dx_plant, dz) = dx.split_at_mut(states);
        law.evaluate(&desired, &trig, x, z, &mut tau, dz);
        plant.rates(&trig, x, &tau, &wrench, dx_plant);
        for i in 0..s {
            slope[i * s + j] = dx[i].rate;
        }
        moving[j].rate = 0.0;
    }
    slope
}

/// `(real, imaginary)` of the eigenvalues of [`loop_slope`], by real part, ascending.
pub fn loop_eigenvalues(
    plant: &PlantSpec,
    law: &LawSpec,
    x: &[f64],
    z: &[f64],
    wrench: &[f64; 6],
    force_frame: Option<usize>,
) -> Result<Vec<(f64, f64)>> {
    eigenvalues(&loop_slope(plant, law, 0.0, x, z, wrench, force_frame), x.len() + z.len())
}
