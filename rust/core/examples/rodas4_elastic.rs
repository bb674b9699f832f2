//! A stiff method with exact Jacobians. The plant is a planar arm with two elastic joints, motor-inertia reduction and Cartesian impedance.
//! The program measures the computing time of a run of 2 s at rtol 1e-6. `cargo run --release --example rodas4_elastic`.
//!
//! The state is `[q, v, theta, theta']`. `tau = (1 - B/B0) K_J (theta - q) + B/B0 (u - D0 theta')`, `u = J' (K_m (x_d - x) - D_m x') + g`,
//! with the tip position `x` and its target `x_d`. A force of `[5, -3]` N acts on the tip.

use armlet_core::integrate::{Adaptive, DualSystem, Linearised, Rodas4, System, Tolerance, Work};
use armlet_core::scalar::{Array8, Dual, Kernel, Real};
use std::marker::PhantomData;
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

impl<V: Real> DualSystem<V> for Loop {
    #[inline(always)]
    fn moving_input(&mut self, _: f64, _: &mut ()) {}
    #[inline(always)]
    fn autonomous(&self) -> bool {
        true
    }
}

/// A run on plain numbers. `V` is the type of the eight derivatives in a dual number.
struct Run<V> {
    plant: Loop,
    t_end: f64,
    rtol: f64,
    rates: PhantomData<V>,
}

impl<V: Real> Kernel for Run<V> {
    type Output = ([f64; 8], Work);

    #[inline(always)]
    fn run(self) -> Self::Output {
        let x = [-0.5, 1.6, 0.0, 0.0, -0.5, 1.6, 0.0, 0.0].map(V::One::splat);
        let mut system: Twin<V> = Linearised::new(self.plant, self.plant, [Dual::splat(0.0); 8], ());
        let tolerance = Tolerance { rtol: self.rtol, atol: 1e-3 * self.rtol, controlled: 8 };
        let method = Rodas4::new(tolerance, x, [V::One::zero(); 64], [0usize; 8], ());
        drive::<V::One, _, _>(method, &mut system, self.t_end)
    }
}

type Twin<V> = Linearised<Loop, Loop, V, [Dual<V>; 8], ()>;

#[inline(always)]
fn drive<S: Real, F: System<S>, M: Adaptive<S, F, [S; 8]>>(mut method: M, system: &mut F, t_end: f64) -> ([f64; 8], Work) {
    method.begin(system, 0.0, t_end, t_end).expect("a finite start");
    while !method.step(system).expect("a step") {}
    (method.x().map(|x| x.lane(0)), method.work())
}

/// Run the fastest variant on this processor. On x86-64 with AVX2, two AVX2 registers contain the eight rates, even if AVX-512 exists. A
/// variant with one AVX-512 register is slower: a step of RODAS with 8 states takes 1.08 us instead of 0.73 us.
fn run(plant: Loop, t_end: f64, rtol: f64) -> ([f64; 8], Work) {
    #[cfg(target_arch = "x86_64")]
    if armlet_core::scalar::isa() > armlet_core::scalar::Isa::Baseline {
        type Rates = armlet_core::scalar::lanes::Pair<armlet_core::scalar::lanes::Avx2>;
        return Rates::enter(Run::<Rates> { plant, t_end, rtol, rates: PhantomData });
    }
    Array8::enter(Run::<Array8> { plant, t_end, rtol, rates: PhantomData })
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
