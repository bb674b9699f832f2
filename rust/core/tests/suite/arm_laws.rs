//! Tests of identities of rigid-body dynamics on seeded random trees. The trees have 1 to 30 joints, with branches, prismatic joints and
//! fixed bodies.

use crate::arm_common::{Rng, close, largest, random_tree, sin_cos};
use armlet_core::arm::{Arm, Tree};
use armlet_core::dynamics::{Dynamics, Evaluator, Quantity, Query, Size, Workspace, energy};
use armlet_core::kinematics;
use armlet_core::scalar::{GenericKernel, Real};
use armlet_core::spatial::{Matrix, Vector, Vector3};

/// The rounding error of recursions over up to 30 bodies, relative to the largest entry of the result.
const EXACT: f64 = 1e-12;
const SIZES: [usize; 10] = [1, 2, 3, 4, 5, 7, 9, 14, 21, 30];

/// Computes all quantities of one arm with one number type.
struct Run<S: Real> {
    tree: Tree<S>,
    ws: Workspace<S>,
    n: usize,
}

impl<S: Real> Run<S> {
    fn new(arm: &Arm) -> Self {
        let tree = Tree::new(arm);
        let ws = Workspace::new(&tree);
        Run { n: arm.n(), tree, ws }
    }
    fn mass(&mut self, q: &[S]) -> Vec<S> {
        let mut m = vec![S::splat(f64::NAN); self.n * self.n];
        self.tree.mass_matrix(&mut self.ws, &sin_cos(q), q, &mut m);
        m
    }
    fn coriolis(&mut self, q: &[S], v: &[S]) -> Vec<S> {
        let mut c = vec![S::splat(f64::NAN); self.n * self.n];
        self.tree.coriolis_matrix(&mut self.ws, &sin_cos(q), q, v, &mut c);
        c
    }
    fn gravity(&mut self, q: &[S]) -> Vec<S> {
        let mut g = vec![S::splat(f64::NAN); self.n];
        self.tree.gravity(&mut self.ws, &sin_cos(q), q, &mut g);
        g
    }
    fn inverse(&mut self, q: &[S], v: &[S], a: &[S]) -> Vec<S> {
        let mut tau = vec![S::splat(f64::NAN); self.n];
        self.tree.inverse_dynamics(&mut self.ws, &sin_cos(q), q, v, a, &mut tau);
        tau
    }
}

fn mul<S: Real>(m: &[S], x: &[S]) -> Vec<S> {
    let n = x.len();
    (0..n).map(|i| (0..n).fold(S::zero(), |sum, j| sum + m[i * n + j] * x[j])).collect()
}

fn values<S: Real>(x: &[S]) -> Vec<f64> {
    x.iter().map(|x| x.lane(0)).collect()
}

/// Return a random vector.
fn random<S: Real>(rng: &mut Rng, n: usize, scale: f64) -> Vec<S> {
    (0..n).map(|_| S::splat(scale * rng.unit())).collect()
}

#[track_caller]
fn same<S: Real>(what: &str, got: &[S], want: &[S], tolerance: f64) {
    close(what, &values(got), &values(want), tolerance, 1.0);
}

#[derive(Clone, Copy)]
struct Laws(u64);

impl GenericKernel for Laws {
    type Output = ();
    fn run<S: Real>(self) {
        let mut rng = Rng(self.0);
        for n in SIZES {
            let arm = random_tree(&mut rng, n);
            let mut run = Run::<S>::new(&arm);
            let mut random = |scale: f64| random::<S>(&mut rng, n, scale);
            let (q, v, x, a, s) = (random(2.0), random(1.5), random(1.5), random(3.0), random(1.0));
            let trig = sin_cos(&q);
            let zero = vec![S::zero(); n];
            let (m, c, g) = (run.mass(&q), run.coriolis(&q, &v), run.gravity(&q));
            let add = |a: Vec<S>, b: &[S]| -> Vec<S> { a.iter().zip(b).map(|(a, b)| *a + *b).collect() };

            let tau = run.inverse(&q, &v, &a);
            same("M a + C v + g", &add(add(mul(&m, &a), &mul(&c, &v)), &g), &tau, EXACT);
            same("gravity", &run.inverse(&q, &zero, &zero), &g, EXACT);
            let mut bias = zero.clone();
            run.tree.bias(&mut run.ws, &trig, &q, &v, &mut bias);
            same("bias", &bias, &run.inverse(&q, &v, &zero), EXACT);
            let cx = run.coriolis(&q, &x);
            same("C(q, x) v = C(q, v) x", &mul(&cx, &v), &mul(&c, &x), EXACT);

            let mut forward = zero.clone();
            run.tree.forward_dynamics(&mut run.ws, &trig, &q, &v, &tau, &mut forward);
            let back = run.inverse(&q, &v, &forward);
            // The test compares residuals, because the error of accelerations increases with the condition number of M.
            same("RNEA after ABA", &back, &tau, 1e-10);

            let mut y = vec![S::splat(f64::NAN); n * 10 * n];
            run.tree.regressor(&mut run.ws, &trig, &q, [&v, &x, &a], &mut y);
            let pi: Vec<S> = arm.parameters().into_iter().map(S::splat).collect();
            let y_pi: Vec<S> = (0..n).map(|i| (0..10 * n).fold(S::zero(), |t, k| t + y[i * 10 * n + k] * pi[k])).collect();
            let rotors: Vec<S> = (0..n).map(|i| S::splat(arm.joints[i].armature) * a[i]).collect();
            let want = add(add(mul(&m, &a), &mul(&c, &x)), &g);
            same("Y pi + armature ar", &add(y_pi.clone(), &rotors), &want, EXACT);
            let yt_s: Vec<S> = (0..10 * n).map(|k| (0..n).fold(S::zero(), |t, i| t + y[i * 10 * n + k] * s[i])).collect();
            let (mut products, mut transposed) = (zero.clone(), vec![S::splat(f64::NAN); 10 * n]);
            run.tree.regressor_products(&mut run.ws, &trig, &q, [&v, &x, &a], (&pi, &mut products), (&s, &mut transposed));
            same("Y pi", &products, &y_pi, EXACT);
            same("Y' s", &transposed, &yt_s, EXACT);
            let mut written = vec![S::zero(); 10 * n];
            run.tree.parameters(&mut written);
            same("parameters", &written, &pi, 1e-14);

            let (kinetic, _) = run.tree.energy(&mut run.ws, &trig, &q, &v);
            let momentum = mul(&m, &v);
            let quadratic = v.iter().zip(&momentum).fold(S::zero(), |t, (v, p)| t + *v * *p);
            same("kinetic energy", &[kinetic + kinetic], &[quadratic], EXACT);
            let m = values(&m);
            assert_eq!((0..n * n).find(|&e| m[e] != m[(e % n) * n + e / n]), None, "symmetric to the bit");
            assert!(cholesky(&m, n), "positive definite");
        }
    }
}

fn cholesky(m: &[f64], n: usize) -> bool {
    let mut l = m.to_vec();
    for j in 0..n {
        for k in 0..j {
            for i in j..n {
                l[i * n + j] -= l[i * n + k] * l[j * n + k];
            }
        }
        if l[j * n + j].is_nan() || l[j * n + j] <= 0.0 {
            return false;
        }
        let root = l[j * n + j].sqrt();
        for i in j..n {
            l[i * n + j] /= root;
        }
    }
    true
}

#[test]
fn recursions_agree() {
    for seed in 0..4 {
        Laws(seed).run::<f64>();
    }
}

/// Return the central difference of `f` along `v`, with one extrapolation. Its error is `h^4` (1e-12 for h = 1e-3) and the rounding error
/// `eps / h` (2e-13). Both errors are larger for long chains, whose higher derivatives are large.
fn slope(f: &mut dyn FnMut(f64) -> Vec<f64>) -> Vec<f64> {
    let h = 1e-3;
    let at: Vec<Vec<f64>> = [-h, h, -2.0 * h, 2.0 * h].into_iter().map(f).collect();
    (0..at[0].len()).map(|i| (8.0 * (at[1][i] - at[0][i]) - (at[3][i] - at[2][i])) / (12.0 * h)).collect()
}

const DIFFERENCE: f64 = 1e-8;

fn moved(q: &[f64], v: &[f64], h: f64) -> Vec<f64> {
    q.iter().zip(v).map(|(q, v)| q + h * v).collect()
}

#[test]
fn rates_agree_with_differences() {
    let mut rng = Rng(11);
    for n in SIZES {
        let arm = random_tree(&mut rng, n);
        let mut run = Run::<f64>::new(&arm);
        let (q, v) = (rng.vector(n, 2.0), rng.vector(n, 0.7));
        let c = run.coriolis(&q, &v);
        let sum: Vec<f64> = (0..n * n).map(|k| c[k] + c[(k % n) * n + k / n]).collect();
        let m_dot = slope(&mut |h| run.mass(&moved(&q, &v, h)));
        close("dM/dt = C + C'", &sum, &m_dot, DIFFERENCE, 1.0);

        // The power balance is dT/dt + dU/dt = v . tau.
        let a = rng.vector(n, 1.0);
        let tau = run.inverse(&q, &v, &a);
        let power: f64 = tau.iter().zip(&v).map(|(t, v)| t * v).sum();
        let rate = slope(&mut |h| {
            let (q, v): (Vec<f64>, Vec<f64>) = (0..n).map(|i| (q[i] + h * v[i] + 0.5 * h * h * a[i], v[i] + h * a[i])).unzip();
            let (t, u) = run.tree.energy(&mut run.ws, &sin_cos(&q), &q, &v);
            vec![t + u]
        });
        close("dE/dt = v . tau", &rate, &[power], DIFFERENCE, 10.0);
        let g = run.gravity(&q);
        for i in 0..n {
            let mut e = vec![0.0; n];
            e[i] = 1.0;
            let rate = slope(&mut |h| {
                let q = moved(&q, &e, h);
                vec![run.tree.energy(&mut run.ws, &sin_cos(&q), &q, &vec![0.0; n]).1]
            });
            close("g = dU/dq", &rate, &[g[i]], DIFFERENCE, 10.0);
        }
    }
}

#[test]
fn jacobians_agree_with_differences() {
    let mut rng = Rng(12);
    for n in SIZES {
        let arm = random_tree(&mut rng, n);
        let mut run = Run::<f64>::new(&arm);
        let (q, v) = (rng.vector(n, 2.0), rng.vector(n, 0.7));
        for frame in 0..arm.frames.len() {
            let mut j = vec![f64::NAN; 6 * n];
            kinematics::jacobian(&run.tree, &mut run.ws.poses, &sin_cos(&q), &q, frame, &mut j);
            let jv: Vec<f64> = (0..6).map(|r| (0..n).map(|k| j[r * n + k] * v[k]).sum()).collect();
            let mut pose = |h: f64| {
                let q = moved(&q, &v, h);
                let (r, p) = kinematics::frame_pose(&run.tree, &mut run.ws.poses, &sin_cos(&q), &q, frame);
                [p, r.axis(0), r.axis(1), r.axis(2)].map(Vector::array).concat()
            };
            let (at, rate) = (pose(0.0), slope(&mut pose));
            close("p' = Jv v", &rate[..3], &jv[..3], DIFFERENCE, 1.0);
            let w = Vector3::from([jv[3], jv[4], jv[5]]);
            for k in 1..4 {
                let column = Vector3::from([at[3 * k], at[3 * k + 1], at[3 * k + 2]]);
                close("R' = [w]x R", &rate[3 * k..3 * k + 3], &w.cross(column).array(), DIFFERENCE, 1.0);
            }
            let mut j_dot = vec![f64::NAN; 6 * n];
            kinematics::jacobian_dot(&run.tree, &mut run.ws.poses, &mut run.ws.motion, (&sin_cos(&q), &q), &v, frame, &mut j_dot);
            let rate = slope(&mut |h| {
                let (q, mut j) = (moved(&q, &v, h), vec![0.0; 6 * n]);
                kinematics::jacobian(&run.tree, &mut run.ws.poses, &sin_cos(&q), &q, frame, &mut j);
                j
            });
            close("dJ/dt", &j_dot, &rate, DIFFERENCE, 1.0);

            // The virtual power of a wrench determines the torque J' F. `frame_pose` computes the poses at `q` again, because the
            // differences changed them.
            let wrench: [f64; 6] = std::array::from_fn(|_| rng.unit());
            let want: Vec<f64> = (0..n).map(|k| 0.25 - 2.0 * (0..6).map(|r| j[r * n + k] * wrench[r]).sum::<f64>()).collect();
            let mut tau = vec![0.25; n];
            kinematics::frame_pose(&run.tree, &mut run.ws.poses, &sin_cos(&q), &q, frame);
            energy::add_wrench(&run.tree, &run.ws.poses, frame, wrench, -2.0, &mut tau);
            close("J' F", &tau, &want, EXACT, 1.0);
        }
        let mut j = vec![f64::NAN; 3 * n];
        kinematics::com_jacobian(&run.tree, &mut run.ws.poses, &mut run.ws.subtrees, &sin_cos(&q), &q, &mut j);
        let jv: Vec<f64> = (0..3).map(|r| (0..n).map(|k| j[r * n + k] * v[k]).sum()).collect();
        let rate = slope(&mut |h| {
            let q = moved(&q, &v, h);
            kinematics::com(&run.tree, &mut run.ws.poses, &sin_cos(&q), &q).1.array().to_vec()
        });
        close("com rate", &jv, &rate, DIFFERENCE, 1.0);
    }
}

#[test]
fn friction_opposes_motion_and_rests_at_zero() {
    let mut rng = Rng(5);
    let arm = random_tree(&mut rng, 3);
    let tree = Tree::<f64>::new(&arm);
    let mut tau = vec![0.0; 3];
    energy::add_friction(&tree, &[0.0, -2.0, 1e-300], &mut tau);
    let of = |i: usize, v: f64| arm.joints[i].damping * v + arm.joints[i].friction * if v == 0.0 { 0.0 } else { v.signum() };
    assert_eq!(tau, [0.0, of(1, -2.0), of(2, 1e-300)]);
    assert!(largest(&tau) > 0.0);
}

#[test]
fn dynamics_along_a_path_are_inverse_dynamics_in_parts() {
    let mut rng = Rng(17);
    for n in [1, 3, 6] {
        let arm = random_tree(&mut rng, n);
        let light = Arm { gravity: [0.0; 3], ..arm.clone() };
        let [q, slope, curvature]: [Vec<f64>; 3] = std::array::from_fn(|_| rng.vector(n, 1.0));
        let still = vec![0.0; n];
        let of = |arm: &Arm, quantity: Quantity, v: &[f64], a: &[f64]| {
            let mut out = vec![f64::NAN; quantity_length(quantity, n)];
            Evaluator::new(arm).one(&quantity.into(), &[&q, v, a], &mut out).unwrap();
            out
        };
        let expected = [
            of(&light, Quantity::InverseDynamics, &still, &slope),
            of(&light, Quantity::InverseDynamics, &slope, &curvature),
            of(&arm, Quantity::InverseDynamics, &still, &still),
        ];
        assert_eq!(of(&arm, Quantity::PathDynamics, &slope, &curvature), expected.concat());
    }
}

fn quantity_length(quantity: Quantity, n: usize) -> usize {
    let (rows, columns) = Query::from(quantity).shape(Size { n, bodies: n });
    rows * columns
}

#[test]
fn derivatives_agree_with_differences() {
    let mut rng = Rng(13);
    for n in [1, 2, 3, 5, 8, 14] {
        let arm = random_tree(&mut rng, n);
        let [q, v, x]: [Vec<f64>; 3] = std::array::from_fn(|_| rng.vector(n, 1.0));
        for (value, slopes) in [
            (Quantity::InverseDynamics, Quantity::InverseDynamicsDerivatives),
            (Quantity::ForwardDynamics, Quantity::ForwardDynamicsDerivatives),
        ] {
            let mut evaluator = Evaluator::new(&arm);
            let with = |quantity: Quantity| Query { friction: true, ..quantity.into() };
            let blocks = slopes_shape(slopes, n);
            let mut got = vec![f64::NAN; blocks * n * n];
            evaluator.one(&with(slopes), &[&q, &v, &x], &mut got).unwrap();
            for block in 0..blocks {
                for j in 0..n {
                    let rate = slope(&mut |h| {
                        let mut at = [q.clone(), v.clone(), x.clone()];
                        // The step must not change the sign of v, because friction jumps at zero.
                        at[block][j] += if block == 1 { h * v[j].abs().min(1.0) } else { h };
                        let mut out = vec![0.0; n];
                        evaluator.one(&with(value), &[&at[0], &at[1], &at[2]], &mut out).unwrap();
                        out
                    });
                    let scale = if block == 1 { v[j].abs().min(1.0) } else { 1.0 };
                    let column: Vec<f64> = (0..n).map(|i| scale * got[(block * n + i) * n + j]).collect();
                    // The tolerance is relative to the largest derivative. Derivatives of accelerations are large if the last link is
                    // light.
                    close(&format!("{slopes:?} {block} by {j}"), &column, &rate, 10.0 * DIFFERENCE, largest(&column).max(1.0));
                }
            }
        }
    }
}

fn slopes_shape(quantity: Quantity, n: usize) -> usize {
    Query::from(quantity).shape(Size { n, bodies: n }).0 / n
}
