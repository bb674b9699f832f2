//! The time derivative of the mass matrix, from the derivative of each step of the composite-body algorithm in `crba`.
//!
//! With the moments of a subtree, `(m, h, P)`, and its momentum `F_j` per unit rate, `M_ij = S_i . F_j`. `S_i` is constant in the axes of
//! body `i`, so `dM_ij/dt = S_i . dF_j/dt`. A joint with the rate `v` along `z` turns the quantities of its subtree. In its axes,
//!
//! `dh/dt = v z x h`, `dP/dt = v ([z]x P + P [z]x')`, `dF/dt = v (z x f, z x n)`,
//!
//! with the force-like parts `F = (f, n)` and the transpose `'`. A prismatic joint moves them: `dh/dt = m v z`, `dP/dt = v (z h' + h z')`,
//! `dF/dt = v (0, z x f)`. These rates are then transformed to the axes of the parent like the quantities themselves.
//!
//! This derivation is independent of the Coriolis matrix.

use super::crba::Moments;
use super::hinge::{congruence, reach, rotation, to_parent};
use crate::arm::{BASE, Body, Tree};
use crate::memory::{copies, set};
use crate::scalar::Real;
use crate::spatial::{Spatial, Sym3, Vector, Vector3};

/// Buffers of the derivative.
#[derive(Clone, Debug)]
pub struct Rates<S: Real> {
    /// The moments of each subtree and their rates.
    moments: Vec<[Moments<S>; 2]>,
    /// The momentum of each joint's subtree per unit rate, and its derivative.
    momenta: Vec<[Spatial<S>; 2]>,
}

impl<S: Real> Rates<S> {
    pub fn new(n: usize) -> Self {
        Rates { moments: copies(n, [Moments::default(); 2]), momenta: copies(n, [Spatial::zero(); 2]) }
    }
}

/// Compute `dM/dt`, `(n, n)`, at the joint rates `v`.
pub fn mass_matrix_rate<S: Real>(tree: &Tree<S>, buffers: &mut Rates<S>, trig: &[(S, S)], q: &[S], v: &[S], rate: &mut [S]) {
    let n = tree.bodies.len();
    let Rates { moments, momenta } = buffers;
    set(rate, S::zero());
    for (moments, body) in moments.iter_mut().zip(&tree.bodies) {
        *moments = [Moments::of(body), Moments::default()];
    }
    for i in (0..n).rev() {
        let body = &tree.bodies[i];
        let [whole, mut turned] = moments[i];
        momenta[i] = [momentum(body, &whole), momentum(body, &turned)];
        for j in i..body.end {
            let along = momenta[j][1];
            let x = if body.revolute { along.angular[2] } else { along.linear[2] };
            (rate[i * n + j], rate[j * n + i]) = (x, x);
        }
        if body.parent == BASE {
            continue;
        }
        let (e, p) = (rotation(body, trig[i]), reach(body, q[i]));
        let carried = |Spatial { linear, angular }: Spatial<S>| {
            let [linear, angular] = to_parent(body, &e, trig[i], [linear, angular]);
            Spatial { linear, angular: p.cross_add(linear, angular) }
        };
        for [value, slope] in &mut momenta[i..body.end] {
            let by_joint = if body.revolute {
                Spatial { linear: swept(v[i], value.linear), angular: swept(v[i], value.angular) }
            } else {
                Spatial { linear: Vector3::zero(), angular: swept(v[i], value.linear) }
            };
            let sum = Spatial { linear: slope.linear + by_joint.linear, angular: slope.angular + by_joint.angular };
            (*value, *slope) = (carried(*value), carried(sum));
        }
        turned = turned.plus(&moved(body.revolute, v[i], &whole));
        for (k, moments_of_body) in [whole, turned].into_iter().enumerate() {
            let Moments { mass, first, second } = moments_of_body;
            let [first] = to_parent(body, &e, trig[i], [first]);
            let in_parent = Moments { mass, first, second: congruence(body, &e, trig[i], second) }.shifted(p);
            moments[body.parent][k] = moments[body.parent][k].plus(&in_parent);
        }
    }
}

/// The momentum of a subtree with these moments, per unit rate of its joint, about the joint origin.
fn momentum<S: Real>(body: &Body<S>, moments: &Moments<S>) -> Spatial<S> {
    let Moments { mass, first, second: Sym3([xx, _, yy, xz, yz, _]) } = *moments;
    let ([hx, hy, _], zero) = (first.array(), S::zero());
    if body.revolute {
        Spatial { linear: Vector3::from([-hy, hx, zero]), angular: Vector3::from([-xz, -yz, xx + yy]) }
    } else {
        Spatial { linear: Vector3::from([zero, zero, mass]), angular: Vector3::from([hy, -hx, zero]) }
    }
}

/// The product `v z x a`.
fn swept<S: Real>(v: S, a: Vector3<S>) -> Vector3<S> {
    Vector3::from([-(v * a[1]), v * a[0], S::zero()])
}

/// The rates of the moments of a subtree, from the rate `v` of its joint.
fn moved<S: Real>(revolute: bool, v: S, moments: &Moments<S>) -> Moments<S> {
    let Moments { mass, first, second: Sym3([xx, xy, yy, xz, yz, _]) } = *moments;
    let (zero, two) = (S::zero(), v + v);
    let (first, second) = if revolute {
        (swept(v, first), [-(two * xy), v * (xx - yy), two * xy, -(v * yz), v * xz, zero])
    } else {
        (Vector3::from([zero, zero, v * mass]), [zero, zero, zero, v * first[0], v * first[1], two * first[2]])
    };
    Moments { mass: zero, first, second: Sym3(second) }
}

#[cfg(test)]
mod tests {
    use crate::arm::{Arm, EXAMPLES, STANDARD_GRAVITY};
    use crate::dynamics::{ArmAt, Model, PlanarPr};
    use crate::spatial::Vector;

    /// The model at `q + v t`, and the velocity `v`.
    fn moved(model: &Model, t: f64) -> (ArmAt, Vec<f64>) {
        let v: Vec<f64> = (0..model.n()).map(|i| 0.7 - 0.2 * (i * i) as f64).collect();
        let q: Vec<f64> = v.iter().enumerate().map(|(i, v)| 0.4 - 0.3 * i as f64 + v * t).collect();
        (model.at(&q), v)
    }

    /// Compare `exact` with central differences of `f(t)`. The step has an error of 1e-8 times the third derivative. Rounding adds an error
    /// of 1e-16 / 1e-4.
    fn check(exact: &[f64], f: impl Fn(f64) -> Vec<f64>) {
        let largest = exact.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        assert!(largest > 1e-3, "nothing changes");
        for (k, ((after, before), exact)) in f(1e-4).iter().zip(f(-1e-4)).zip(exact).enumerate() {
            let difference = (after - before) / 2e-4;
            assert!((exact - difference).abs() < 1e-6 * (1.0 + largest), "{k}: {exact} {difference}");
        }
    }

    fn models() -> Vec<Model> {
        let arms = EXAMPLES.map(|(name, text)| Model::from(Arm::from_urdf(text, name, STANDARD_GRAVITY, None, None).unwrap()));
        arms.into_iter().chain(PlanarPr::new(3.0, 0.5, 0.2).map(Model::PlanarPr)).collect()
    }

    #[test]
    fn it_is_the_derivative_of_the_mass_matrix() {
        for model in models() {
            let size = model.n() * model.n();
            let ((mut arm, v), mut rate) = (moved(&model, 0.0), vec![f64::NAN; size]);
            arm.mass_matrix_rate(&v, &mut rate);
            check(&rate, |t| {
                let mut m = vec![0.0; size];
                moved(&model, t).0.mass_matrix(&mut m);
                m
            });
        }
    }

    #[test]
    fn the_bias_acceleration_is_the_derivative_of_the_velocity_at_constant_rates() {
        for model in models() {
            let Model::Tree(tree) = &model else { continue };
            let (frame, (mut arm, v)) = (tree.frames.len() - 1, moved(&model, 0.0));
            let bias = arm.bias_acceleration(&v, frame).map(|a| a.array());
            check(bias.as_flattened(), |t| {
                let (mut arm, v) = moved(&model, t);
                arm.jacobian(frame).1.chunks_exact(v.len()).map(|row| row.iter().zip(&v).map(|(j, v)| j * v).sum()).collect()
            });
        }
    }
}
