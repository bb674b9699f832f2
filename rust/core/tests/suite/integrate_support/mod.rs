//! Problems, most of them with known solutions, generic over the number type, and a common interface to the methods.

use armlet_core::integrate::*;
use armlet_core::scalar::Real;
use armlet_core::status::Status;
use armlet_core::trace::by_engine::REPAYS;
use armlet_core::trace::function::recorded;
use armlet_core::trace::{Jacobian, Sym};

/// A problem `x' = f(t, x)` with `N` states.
pub trait Problem {
    const N: usize;
    fn f<S: Real>(t: S, x: &[S], dx: &mut [S]);
    fn start() -> Vec<f64>;
    fn autonomous() -> bool {
        false
    }
    fn rate_of(_i: usize) -> Option<usize> {
        None
    }
    fn is_reversed() -> bool {
        false
    }
    /// The number of attempts at jumps after which the run ends.
    fn chatter_budget() -> u64 {
        u64::MAX
    }
}

pub trait Exact: Problem {
    fn exact(t: f64) -> Vec<f64>;
}

pub struct Of<P>(pub std::marker::PhantomData<P>);

impl<P: Problem, S: Real> System<S> for Of<P> {
    type Input = S;
    fn input(&mut self, t: f64, u: &mut S) {
        *u = S::splat(t);
    }
    fn rhs(&mut self, t: &S, x: &[S], dx: &mut [S]) {
        P::f(*t, x, dx);
    }
    fn rate_of(&self, i: usize) -> Option<usize> {
        P::rate_of(i)
    }
    fn is_reversed(&self) -> bool {
        P::is_reversed()
    }
    fn chatter_budget(&self) -> u64 {
        P::chatter_budget()
    }
}

/// A problem with the derivatives of its recorded right-hand side.
pub struct Twin<P> {
    plain: Of<P>,
    /// The right-hand side as a function of the time and the state.
    recorded: Jacobian,
    /// The time and the state.
    at: Vec<f64>,
    /// The direction of the time.
    along_time: Vec<f64>,
}

impl<P: Problem> Twin<P> {
    fn place(&mut self, t: f64, x: &[f64]) {
        self.at[0] = t;
        self.at[1..].copy_from_slice(x);
    }
}

impl<P: Problem> System<f64> for Twin<P> {
    type Input = f64;
    fn input(&mut self, t: f64, u: &mut f64) {
        self.plain.input(t, u);
    }
    fn rhs(&mut self, t: &f64, x: &[f64], dx: &mut [f64]) {
        self.plain.rhs(t, x, dx);
    }
    fn is_reversed(&self) -> bool {
        P::is_reversed()
    }
    fn rate_of(&self, i: usize) -> Option<usize> {
        P::rate_of(i)
    }
    fn chatter_budget(&self) -> u64 {
        P::chatter_budget()
    }
}

impl<P: Problem> Differentiable<f64> for Twin<P> {
    fn linearise(&mut self, _: f64, t: &f64, x: &[f64], dx: &mut [f64], j: &mut [f64]) {
        self.plain.rhs(t, x, dx);
        self.place(*t, x);
        self.recorded.slopes(&self.at, |i, k, slope| {
            if k > 0 {
                j[i * P::N + k - 1] = slope;
            }
        });
    }
    fn time_derivative(&mut self, _: f64, t: &f64, x: &[f64], dft: &mut [f64]) {
        self.place(*t, x);
        self.recorded.along(&self.at, &self.along_time, dft);
    }
    fn autonomous(&self) -> bool {
        P::autonomous()
    }
}

pub fn of<P: Problem>() -> Of<P> {
    Of(std::marker::PhantomData)
}

pub fn twin<P: Problem>() -> Twin<P> {
    let record = |(), x: &[Sym]| {
        let mut dx = vec![Sym::zero(); P::N];
        P::f(x[0], &x[1..], &mut dx);
        dx
    };
    let recorded = Jacobian::new(recorded(1 + P::N, || (), record).expect("it does not branch"), P::N);
    let (at, mut along_time) = (vec![0.0; 1 + P::N], vec![0.0; 1 + P::N]);
    along_time[0] = 1.0;
    let mut twin = Twin { plain: of(), recorded, at, along_time };
    // The first evaluation prepares the derivatives, and a later one their machine code.
    (0..REPAYS).for_each(|_| twin.time_derivative(0.0, &0.0, &P::start(), &mut vec![0.0; P::N]));
    twin
}

pub type Boxed<P> = Box<dyn Adaptive<f64, Twin<P>, Vec<f64>>>;
pub const ADAPTIVE: [(&str, f64); 4] = [("dopri5", 5.0), ("dop853", 8.0), ("radau5", 5.0), ("rodas4", 4.0)];

pub fn adaptive<P: Problem + 'static>(name: &str, rtol: f64, atol: f64) -> Boxed<P> {
    let tolerance = Tolerance { rtol, atol, controlled: P::N };
    let (x, j) = (P::start(), vec![0.0; P::N * P::N]);
    match name {
        "dopri5" => Box::new(Embedded::<Dopri5, _, _, _>::new(tolerance, x, 0.0)),
        "dop853" => Box::new(Embedded::<Dop853, _, _, _>::new(tolerance, x, 0.0)),
        "radau5" => Box::new(Radau5::new(tolerance, x, 0.0)),
        "rodas4" => Box::new(Rodas4::new(tolerance, x, j, vec![0; P::N], 0.0)),
        other => panic!("{other}"),
    }
}

pub fn fixed<P: Problem>(name: &str) -> Box<dyn FixedStep<f64, Twin<P>, Vec<f64>>> {
    let (x, j) = (P::start(), vec![0.0; P::N * P::N]);
    match name {
        "euler" => Box::new(Explicit::<Euler, _, _>::new(x, 0.0)),
        "semi_implicit" => Box::new(SemiImplicit::new::<f64, _>(&twin::<P>(), x, 0.0).unwrap()),
        "rk4" => Box::new(Explicit::<Rk4, _, _>::new(x, 0.0)),
        "ros2" => Box::new(Ros2::new(x, j, vec![0; P::N], 0.0)),
        other => panic!("{other}"),
    }
}

/// Run a method to its end, or to an error.
pub fn run<P: Problem + 'static>(method: &mut Boxed<P>, t: f64, t_end: f64) -> Result<(), Status> {
    let mut system = twin::<P>();
    method.begin(&mut system, t, t_end, t_end)?;
    while !method.step(&mut system)? {}
    Ok(())
}

pub fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
}

/// A point on a circle with varying speed. Its rate is a nonlinear function of time.
pub struct Circle;
impl Problem for Circle {
    const N: usize = 2;
    fn f<S: Real>(t: S, x: &[S], dx: &mut [S]) {
        let speed = S::splat(1.0) + S::splat(0.5) * t.sin_cos().1;
        dx[0] = -(x[1] * speed);
        dx[1] = x[0] * speed;
    }
    fn start() -> Vec<f64> {
        Self::exact(0.0)
    }
}
impl Exact for Circle {
    fn exact(t: f64) -> Vec<f64> {
        let (s, c) = (t + 0.5 * t.sin()).sin_cos();
        vec![c, s]
    }
}

/// `x0 = 1 / (2 - t/2)` has a rate that is proportional to its square. The rate of `x1 = exp(sin t)` is computed from `x0` too.
pub struct Riccati;
impl Problem for Riccati {
    const N: usize = 2;
    fn f<S: Real>(t: S, x: &[S], dx: &mut [S]) {
        dx[0] = S::splat(0.5) * x[0] * x[0];
        let one = x[0] * S::splat(-0.5).mul_add(t, S::splat(2.0));
        dx[1] = t.sin_cos().1 * x[1] * one * one;
    }
    fn start() -> Vec<f64> {
        Self::exact(0.0)
    }
}
impl Exact for Riccati {
    fn exact(t: f64) -> Vec<f64> {
        vec![1.0 / (2.0 - 0.5 * t), t.sin().exp()]
    }
}

/// A harmonic oscillator with the states position and velocity.
pub struct Oscillator;
impl Problem for Oscillator {
    const N: usize = 2;
    fn f<S: Real>(_: S, x: &[S], dx: &mut [S]) {
        dx[0] = x[1];
        dx[1] = -x[0];
    }
    fn start() -> Vec<f64> {
        vec![1.0, 0.0]
    }
    fn autonomous() -> bool {
        true
    }
    fn rate_of(i: usize) -> Option<usize> {
        (i == 0).then_some(1)
    }
}
impl Exact for Oscillator {
    fn exact(t: f64) -> Vec<f64> {
        vec![t.cos(), -t.sin()]
    }
}

/// The oscillator in reversed time: the rate of its position is minus its velocity.
pub struct Rewound;
impl Problem for Rewound {
    const N: usize = 2;
    fn f<S: Real>(_: S, x: &[S], dx: &mut [S]) {
        dx[0] = -x[1];
        dx[1] = x[0];
    }
    fn start() -> Vec<f64> {
        Oscillator::start()
    }
    fn rate_of(i: usize) -> Option<usize> {
        Oscillator::rate_of(i)
    }
    fn is_reversed() -> bool {
        true
    }
}
impl Exact for Rewound {
    fn exact(t: f64) -> Vec<f64> {
        Oscillator::exact(-t)
    }
}

/// Ten coupled decays. Their Jacobian takes more than one evaluation with dual numbers.
pub struct Chain;
impl Problem for Chain {
    const N: usize = 10;
    fn f<S: Real>(t: S, x: &[S], dx: &mut [S]) {
        for i in 0..10 {
            let fed = if i == 0 { t.sin_cos().0 } else { x[i - 1] * x[i - 1] };
            dx[i] = fed - S::splat(1.0 + i as f64) * x[i] * x[(i + 3) % 10];
        }
    }
    fn start() -> Vec<f64> {
        (0..10).map(|i| 1.0 - 0.05 * i as f64).collect()
    }
}
