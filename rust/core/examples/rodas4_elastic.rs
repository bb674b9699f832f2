//! A stiff method with exact Jacobians. The plant is a planar arm with two elastic joints, motor-inertia reduction and Cartesian impedance.
//! The program measures the computing time of a run of 2 s at rtol 1e-6. `cargo run --release --example rodas4_elastic`.
//!
//! The state is `[q, v, theta, theta']`. `tau = (1 - B/B0) K_J (theta - q) + B/B0 (u - D0 theta')`, `u = J' (K_m (x_d - x) - D_m x') + g`,
//! with the tip position `x` and its target `x_d`. A force of `[5, -3]` N acts on the tip.

use armlet_core::integrate::{Adaptive, Differentiable, Rodas4, System, Tolerance, Work};
use armlet_core::scalar::Real;
use armlet_core::trace::function::recorded;
use armlet_core::trace::{Jacobian, Sym};
use std::time::Instant;

/// The joint stiffness, the reduced motor inertia and its damping.
#[derive(Clone, Copy)]
struct Loop {
    stiffness: f64,
    inertia: f64,
    damping: f64,
}

impl<S: Real> System<S> for Loop {
    type Input = ();

    #[inline(always)]
    fn input(&mut self, _: f64, _: &mut ()) {}
    #[inline(always)]
    fn rhs(&mut self, _: &(), x: &[S], dx: &mut [S]) {
        let k = S::splat;
        let ((s1, c1), (s2, c2)) = (x[0].sin_cos(), x[1].sin_cos());
        let (s12, c12) = (s1 * c2 + c1 * s2, c1 * c2 - s1 * s2);
        let (m11, m12, m22) = (k(0.5).mul_add(c2, k(0.85)), k(0.25).mul_add(c2, k(0.175)), k(0.175));
        let twist = k(0.25) * s2;
        let coriolis = [-(twist * x[3] * (x[2] + x[2] + x[3])), twist * x[2] * x[2]];
        let gravity = [k(14.715) * c1 + k(4.905) * c12, k(4.905) * c12];
        let (j12, j22) = (k(-0.5) * s12, k(0.5) * c12);
        let (j11, j21) = (j12 - k(0.5) * s1, j22 + k(0.5) * c1);
        let (vx, vy) = (j11 * x[2] + j12 * x[3], j21 * x[2] + j22 * x[3]);
        let ex = k(400.0) * (k(0.6) - k(0.5) * (c1 + c12)) - k(4.0) * vx;
        let ey = k(400.0) * (k(0.3) - k(0.5) * (s1 + s12)) - k(4.0) * vy;
        let u = [j11 * ex + j21 * ey + gravity[0], j12 * ex + j22 * ey + gravity[1]];
        let push = [k(5.0) * j11 - k(3.0) * j21, k(5.0) * j12 - k(3.0) * j22];
        let ratio = 0.5 / self.inertia;
        let inverse = (m11 * m22 - m12 * m12).recip();
        let mut net = [S::zero(); 2];
        for i in 0..2 {
            let elastic = k(self.stiffness) * (x[4 + i] - x[i]);
            let motor = k(1.0 - ratio) * elastic + k(ratio) * (u[i] - k(self.damping) * x[6 + i]);
            net[i] = elastic + push[i] - coriolis[i] - gravity[i];
            dx[i] = x[2 + i];
            dx[4 + i] = x[6 + i];
            dx[6 + i] = k(2.0) * (motor - elastic);
        }
        dx[2] = (m22 * net[0] - m12 * net[1]) * inverse;
        dx[3] = (m11 * net[1] - m12 * net[0]) * inverse;
    }
}

/// The loop with its recorded right-hand side, which runs as machine code after the first evaluations.
struct Compiled {
    rates: Jacobian,
}

impl Compiled {
    fn new(plant: Loop) -> Self {
        let record = |mut plant: Loop, x: &[Sym]| {
            let mut dx = vec![Sym::zero(); 8];
            plant.rhs(&(), x, &mut dx);
            dx
        };
        let recorded = recorded(8, || plant, record).expect("it does not branch");
        Compiled { rates: Jacobian::new(recorded, 8) }
    }
}

impl System<f64> for Compiled {
    type Input = ();
    fn input(&mut self, _: f64, _: &mut ()) {}
    fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) {
        dx.copy_from_slice(self.rates.value(x));
    }
}

impl Differentiable<f64> for Compiled {
    fn linearise(&mut self, _: f64, u: &(), x: &[f64], dx: &mut [f64], j: &mut [f64]) {
        self.rhs(u, x, dx);
        self.rates.slopes(x, |i, k, slope| j[8 * i + k] = slope);
    }
    fn time_derivative(&mut self, _: f64, _: &(), _: &[f64], dft: &mut [f64]) {
        dft.fill(0.0);
    }
    fn autonomous(&self) -> bool {
        true
    }
}

fn run(plant: Loop, t_end: f64, rtol: f64) -> ([f64; 8], Work) {
    let mut system = Compiled::new(plant);
    let tolerance = Tolerance { rtol, atol: 1e-3 * rtol, controlled: 8 };
    let mut method = Rodas4::new(tolerance, [-0.5, 1.6, 0.0, 0.0, -0.5, 1.6, 0.0, 0.0], [0.0; 64], [0usize; 8], ());
    method.begin(&mut system, 0.0, t_end, t_end).expect("a finite start");
    while !method.step(&mut system).expect("a step") {}
    (*Adaptive::<f64, Compiled, _>::x(&method), Adaptive::<f64, Compiled, [f64; 8]>::work(&method))
}

fn main() {
    for (stiffness, inertia) in [(1e4, 1e-3), (1e5, 1e-4), (1e6, 1e-5)] {
        let plant = Loop { stiffness, inertia, damping: 1.4 * f64::sqrt(stiffness * inertia) };
        let mut best = f64::INFINITY;
        let mut work = Work::default();
        for _ in 0..200 {
            let began = Instant::now();
            work = run(plant, 2.0, 1e-6).1;
            best = best.min(began.elapsed().as_secs_f64());
        }
        let ends = [1e-6, 1e-10].map(|rtol| run(plant, 0.2, rtol).0);
        let error = [0, 1, 4, 5].iter().map(|&i| (ends[0][i] - ends[1][i]).abs()).fold(0.0, f64::max);
        println!(
            "K_J {stiffness:.0e}: {:.3} ms, {} steps, {} rejected, {:.0} ns each; error of q and theta at 0.2 s {error:.1e}",
            1e3 * best,
            work.steps,
            work.rejections,
            1e9 * best / (work.steps + work.rejections) as f64
        );
    }
}
