//! The closed loop linearised about a state `x = [plant, law]`: `d x_dot = A d x`. `A` is the derivative of the recorded plant and law, so it
//! is exact up to rounding.

use super::recordings::{EquilibriumProblem, Function, jacobian};
use crate::error::{Error, Result};
use crate::law::{Answer, LawSpec, RecordedLaw};
use crate::linalg::dot;
use crate::linalg::eigenvalues::eigenvalues;
use crate::linalg::svd::Svd;
use crate::plant::{PlantSpec, RecordedPlant};
use crate::scalar::Real;
use crate::trace::Sym;
use crate::trace::expression::stacked;
use crate::trace::function::{Recorded, recorded};

/// Compute the matrix `A` of the linearised loop, `(s, s)`, row-major, at time `t` (s), the plant's state `x` and the law's state `z`.
///
/// The `wrench` `[f; m]`, N and N m, world axes, acts at the frame `force_frame`.
pub fn loop_slope(
    plant: &PlantSpec,
    law: &LawSpec,
    t: f64,
    x: &[f64],
    z: &[f64],
    wrench: &[f64; 6],
    force_frame: Option<usize>,
) -> Result<Vec<f64>> {
    let problem = EquilibriumProblem { plant, law, wrench: *wrench, frame: force_frame };
    let branches = || format!("branches on its data: expected a law with derivatives, got {}", law.name());
    let rates = jacobian(&problem, Function::Rates(t), || loop_rates(&problem, t));
    let mut rates = rates.ok_or_else(|| Error::input("law", branches()))?;
    let s = x.len() + z.len();
    let mut slope = vec![0.0; s * s];
    rates.slopes(&[x, z].concat(), |i, j, rate| slope[i * s + j] = rate);
    Ok(slope)
}

/// Record the rates of the loop's state at time `t`, s. The result is `None` if the law branches on its data.
fn loop_rates(problem: &EquilibriumProblem, t: f64) -> Option<(Recorded, usize)> {
    let states = problem.plant.states();
    let size = states + problem.law.initial_state().len();
    let set_up = || (RecordedPlant::new(problem.plant, problem.frame), RecordedLaw::continuous(problem.law), problem.law.desired(t));
    let recorded = recorded(size, set_up, |(plant, law, desired), state| {
        let (x, z) = state.split_at(states);
        let Answer { tau, z_dot, .. } = law.answer(&desired, &x[..problem.plant.seen()], z);
        let x_dot = plant.rates(x, &tau, &problem.wrench.map(Sym::splat)).x_dot;
        stacked([&x_dot, &z_dot]).as_slice().to_vec()
    });
    recorded.map(|recorded| (recorded, size))
}

/// The modes of a loop about an equilibrium.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// use armlet_core::analysis::loop_slope::loop_modes;
/// # let model = Model::from(Arm::pendulum(2.0, 5.0)?);
/// # let plant = PlantSpec::from(RigidSpec::new(model.clone()));
///
/// let law = LawSpec::from(PdGravitySpec::new(model, vec![0.5], Gain::scalar("kp", 1, 4.0)?, Gain::scalar("kd", 1, 6.0)?)?);
/// // About the target, the loop is 2 e'' + 6 e' + 4 e = 0.
/// let modes = loop_modes(&plant, &law, &[0.5, 0.0], &[], &[0.0; 6], None)?;
/// assert!(modes.stable && modes.free == 0);
/// assert!((modes.eigenvalues[0].0 + 2.0).abs() < 1e-9 && (modes.eigenvalues[1].0 + 1.0).abs() < 1e-9);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct Modes {
    /// The number of free motions: directions with `A d x = 0`, along which the loop has no restoring torque.
    pub free: usize,
    /// Eigenvalues of the matrix `A` of the linearised loop, as `(real, imaginary)`, 1/s, by ascending real part. Free motions have zeros.
    pub eigenvalues: Vec<(f64, f64)>,
    /// Whether all eigenvalues, except those of free motions, have negative real parts, up to rounding.
    pub stable: bool,
}

/// Compute the modes of [`loop_slope`] at time zero.
///
/// A free motion without damping is a Jordan block, `d q_dot = d v`, `d v_dot = 0`. The rounding error of `A` splits the two zero
/// eigenvalues of this block by the square root of this error, to both sides of zero. So the free motions `N`, with `A N = 0`, are removed
/// first. The other eigenvalues are the eigenvalues of `Q' A Q`, with `[N Q]` orthogonal. A singular value counts as zero if it is at most
/// `FREE` times the largest. For these singular values, the unit of time is the reciprocal of the largest absolute eigenvalue.
pub fn loop_modes(plant: &PlantSpec, law: &LawSpec, x: &[f64], z: &[f64], wrench: &[f64; 6], force_frame: Option<usize>) -> Result<Modes> {
    const FREE: f64 = 1e-10;
    /// A real part below this fraction of the largest absolute eigenvalue counts as a rounding error.
    const ROUNDED_REAL_PART: f64 = 1e-9;
    let (n, s) = (plant.n(), x.len() + z.len());
    let slope = loop_slope(plant, law, 0.0, x, z, wrench, force_frame)?;
    let modes = eigenvalues(&slope, s)?;
    let fastest = modes.iter().fold(0.0f64, |most, (re, im)| most.max(re.hypot(*im)));
    let left = |values: &[(f64, f64)]| values.iter().all(|(re, _)| *re < ROUNDED_REAL_PART * fastest);
    let scaled = in_units(&slope, x.len(), n, fastest);
    let mut svd = Svd::new(s, s);
    if fastest > 0.0 {
        svd.decompose(&scaled, s, s)?;
    }
    let rank = if fastest > 0.0 { svd.rank(FREE * svd.s()[0]) } else { 0 };
    if rank == s {
        return Ok(Modes { free: 0, stable: left(&modes), eigenvalues: modes });
    }
    let mut quotient = vec![0.0; rank * rank];
    for j in 0..rank {
        let image: Vec<f64> = scaled.chunks_exact(s).map(|row| dot(row, svd.v(j))).collect();
        for i in 0..rank {
            quotient[i * rank + j] = fastest * dot(svd.v(i), &image);
        }
    }
    let mut found = if rank == 0 { Vec::new() } else { eigenvalues(&quotient, rank)? };
    let stable = left(&found);
    found.resize(s, (0.0, 0.0));
    found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    Ok(Modes { free: s - rank, eigenvalues: found, stable })
}

/// `A` in other units: times in units of `1 / fastest`, and the law's states in units that make their rows and columns equally large.
fn in_units(slope: &[f64], states: usize, n: usize, fastest: f64) -> Vec<f64> {
    let s = slope.len().isqrt();
    // The states are positions and speeds of the links, then of the motors, then deflections of friction bristles.
    let mut unit: Vec<f64> = (0..s).map(|i| if i < states && (i / n) % 2 == 1 { fastest } else { 1.0 }).collect();
    for k in states..s {
        let most = |entry: &dyn Fn(usize) -> f64| (0..states).fold(0.0f64, |most, i| most.max(entry(i).abs()));
        let row = most(&|i| slope[k * s + i] * unit[i]);
        let column = most(&|i| slope[i * s + k] / unit[i]);
        if row > 0.0 && column > 0.0 {
            unit[k] = (row / column).sqrt();
        }
    }
    (0..s * s).map(|at| slope[at] * unit[at % s] / (unit[at / s] * fastest)).collect()
}
