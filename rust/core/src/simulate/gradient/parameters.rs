//! The parameters of a run, and groups of them. The parameters of a group have one name, and vary in the same runs. So a group of many
//! parameters needs only a few runs.
//!
//! Most loop parameters depend on only one parameter of a name. For example, `kp_i / kd_i` depends only on `kp_i` among the parameters of
//! the name `kp`. So all parameters of the name may vary in the same runs. Additional runs, the *probes*, show on which parameter a loop
//! parameter depends. Only some of the parameters vary in each probe. Each parameter has a code, whose bit `b` is set if the parameter
//! varies in probe `b`. Each loop parameter also has a code, whose bit `b` is set if its value varies in probe `b`. A loop parameter
//! depends on the parameter with the same code. The codes of all parameters must have the same number of ones. Then a loop parameter that
//! depends on several parameters has more ones. No parameter has the code of such a loop parameter, which is refused.

use crate::error::{Error, Result};
use std::ops::Range;

/// One parameter, as pairs `(run, weight)`. The derivative of a loop parameter `F` is `sum weight (F(run) - F(0))`.
pub type Parameter = Vec<(usize, f64)>;

/// The parameters of a run, listed name by name, with the number of parameters of each name.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, law::{Gain, LawSpec, PdGravitySpec}, plant::{PlantSpec, RigidSpec}};
/// # use nalgebra::dvector;
/// # use std::sync::atomic::AtomicBool;
/// # let model = Model::from(Arm::pendulum(2.0, 0.0)?);
/// # let law = PdGravitySpec::new(model.clone(), vec![0.0], Gain::scalar("kp", 1, 2.0)?, Gain::not_negative("kd", vec![0.0])?)?;
/// # let (law, plant) = (LawSpec::from(law), PlantSpec::from(RigidSpec::new(model.clone())));
/// use armlet_core::simulate::{Options, Parameters, Problem, Times, sensitivities};
///
/// // The joint oscillates with q = cos w t, with w = sqrt(kp / 2). Two laws, with kp = 2 and kp = 3, give the derivative
/// // of the loop parameters with respect to kp.
/// let stiffer = LawSpec::from(PdGravitySpec::new(model, vec![0.0], Gain::scalar("kp", 1, 3.0)?, Gain::not_negative("kd", vec![0.0])?)?);
/// let options = Options { times: Times::At(vec![1.0]), monitors: false, ..Options::fixed(1.0, 0.01) };
/// let mut problem = Problem::from_rest(&plant, &law, &dvector![1.0], options)?;
/// (problem.laws, problem.x0) = (vec![&law, &stiffer], vec![1.0, 0.0, 1.0, 0.0]);
/// let kp = vec![(0, -1.0), (1, 1.0)];
/// let parameters = Parameters { all: &[kp], sizes: &[1], shared: &[] };
/// let q = &sensitivities(&problem, parameters, &AtomicBool::new(false))?[0];
/// assert!((q[0] + 1f64.sin() / 4.0).abs() < 1e-8);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Parameters<'a> {
    /// The parameters of all names.
    pub all: &'a [Parameter],
    /// The number of parameters of each name.
    pub sizes: &'a [usize],
    /// The groups of parameters that vary in the same runs.
    pub shared: &'a [Shared],
}

/// A group of parameters that vary in the same runs. The code of parameter `first + i` is `codes[i]`. [`Parameters::all`] lists the runs
/// and weights of each parameter.
///
/// ```
/// # use armlet_core::{arm::Arm, dynamics::Model, plant::{PlantSpec, RigidSpec}};
/// # use armlet_core::law::{Gain, LawSpec, PdGravitySpec};
/// # use nalgebra::dvector;
/// # use std::sync::atomic::AtomicBool;
/// use armlet_core::simulate::{Options, Parameters, Problem, Shared, Times, sensitivities};
/// # let model = Model::from(Arm::planar(&[0.5, 0.4], None, None, None, [0.0, 0.0])?);
/// # let plant = PlantSpec::from(RigidSpec::new(model.clone()));
/// # let kd = Gain::scalar("kd", 2, 2.0)?;
/// # let pd = |kp: Gain| PdGravitySpec::new(model.clone(), vec![0.3, 0.4], kp, kd.clone()).map(LawSpec::from);
/// # let law = |a, b| Gain::diagonal("kp", vec![a, b]).and_then(pd);
///
/// // Run 0 has the gains. In runs 1 and 2 one gain varies, in run 3 both vary.
/// let laws = [law(8.0, 5.0)?, law(9.0, 5.0)?, law(8.0, 6.0)?, law(9.0, 6.0)?];
/// # let options = Options { times: Times::At(vec![0.5]), monitors: false, ..Options::fixed(0.5, 0.01) };
/// let mut problem = Problem::from_rest(&plant, &laws[0], &dvector![0.0, 0.0], options)?;
/// (problem.laws, problem.x0) = (laws.iter().collect(), vec![0.0; 16]);
/// let shared = [Shared { first: 0, probes: 1..3, codes: vec![0b01, 0b10] }];
/// let together = Parameters { all: &[vec![(3, 1.0)], vec![(3, 1.0)]], sizes: &[2], shared: &shared };
/// let apart = Parameters { all: &[vec![(0, -1.0), (1, 1.0)], vec![(0, -1.0), (2, 1.0)]], sizes: &[2], shared: &[] };
/// let q = |parameters| sensitivities(&problem, parameters, &AtomicBool::new(false)).map(|parts| parts[0].clone());
/// assert!(q(together)?.iter().zip(q(apart)?).all(|(a, b)| (a - b).abs() < 1e-12));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Shared {
    /// The index of the first parameter of this group.
    pub first: usize,
    /// The indices of the *probes*: runs of the problem in which only some parameters of the group vary.
    pub probes: Range<usize>,
    /// The code of each parameter: bit `b` is set if the parameter varies in probe `b` of `probes`.
    pub codes: Vec<u64>,
}

/// Whether parameter `p` belongs to one of the groups `shared`.
pub fn is_shared(shared: &[Shared], p: usize) -> bool {
    shared.iter().any(|group| (group.first..group.first + group.codes.len()).contains(&p))
}

/// Return the error that a loop parameter depends on several parameters of one group. The binding then varies each parameter in separate
/// runs.
pub fn entangled() -> Error {
    Error::input("shared", "has numbers that act together: expected parameters that move in different runs")
}

impl Shared {
    /// Pass the tangent of each varying number to `put(number, parameter, tangent)`. `base`: the numbers of run 0, which are its loop
    /// parameters or its initial state. `of(run)`: the same numbers of another run.
    pub fn rates(
        &self,
        base: &[f64],
        parameters: &[Parameter],
        mut of: impl FnMut(usize) -> Result<Vec<f64>>,
        mut put: impl FnMut(usize, usize, f64),
    ) -> Result<()> {
        let own = self.first..self.first + self.codes.len();
        let Some(weights) = parameters.get(own.clone()).filter(|own| !own.is_empty()) else { return Err(entangled()) };
        let probes: Vec<Vec<f64>> = self.probes.clone().map(&mut of).collect::<Result<_>>()?;
        let moved: Vec<Vec<f64>> = weights[0].iter().map(|&(run, _)| of(run)).collect::<Result<_>>()?;
        for (k, &x) in base.iter().enumerate() {
            let differs = |values: &Vec<f64>| values[k].to_bits() != x.to_bits();
            let code = probes.iter().enumerate().fold(0, |code, (bit, values)| code | u64::from(differs(values)) << bit);
            if code == 0 && !moved.iter().any(differs) {
                continue;
            }
            let Some(i) = self.codes.iter().position(|&known| known == code) else { return Err(entangled()) };
            let rate = weights[i].iter().zip(&moved).map(|(&(_, weight), values)| weight * (values[k] - x)).sum();
            put(k, self.first + i, rate);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The tangents of the loop parameters `f`, which are functions of the three parameters of a name.
    fn rates(f: impl Fn([f64; 3]) -> Vec<f64>) -> Option<Vec<(usize, usize, f64)>> {
        let (p, codes) = ([2.0, 3.0, 5.0], [0b011, 0b101, 0b110]);
        let probe =
            |bit: usize| std::array::from_fn(|i| if codes[i] >> bit & 1 == 1 { p[i] + 1e-3 * (1.0 + 0.2 * i as f64) } else { p[i] });
        let offsets = [-2.0, -1.0, 1.0, 2.0];
        let of = |run: usize| Ok(f(if run < 4 { probe(run - 1) } else { p.map(|x| x + 1e-3 * offsets[run - 4]) }));
        let weights = [1.0 / 12.0, -8.0 / 12.0, 8.0 / 12.0, -1.0 / 12.0];
        let parameter: Parameter = weights.iter().enumerate().map(|(j, weight)| (4 + j, weight / 1e-3)).collect();
        let mut found = Vec::new();
        let shared = Shared { first: 0, probes: 1..4, codes: codes.to_vec() };
        shared.rates(&f(p), &vec![parameter; 3], of, |k, p, rate| found.push((k, p, rate))).ok()?;
        Some(found)
    }

    #[test]
    fn numbers_of_one_parameter_come_apart_and_others_are_refused() {
        let found = rates(|p| vec![p[0] * p[0], 7.0, p[2] / 4.0, p[1], p[0]]).expect("each depends on one");
        let expected = [(0, 0, 4.0), (2, 2, 0.25), (3, 1, 1.0), (4, 0, 1.0)];
        assert_eq!(found.len(), expected.len());
        for ((k, p, rate), (number, parameter, slope)) in found.into_iter().zip(expected) {
            assert_eq!((k, p), (number, parameter));
            assert!((rate - slope).abs() < 1e-11, "four differences of numbers near 5 over 1e-3");
        }
        let several: [fn([f64; 3]) -> Vec<f64>; 3] = [|p| vec![p[0] + p[1]], |p| vec![p[0] - p[1]], |p| vec![p[0] * p[1] * p[2]]];
        assert!(several.into_iter().all(|of| rates(of).is_none()));
    }
}
