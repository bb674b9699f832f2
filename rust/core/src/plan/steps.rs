//! Steps of a phase of constant torque with friction: polynomials in time, from Taylor series or from collocation.
//!
//! ```text
//! push from rest at x:                I y_ddot = p - G sin(x + y) - d y_dot          (a brake to rest is computed backwards: d < 0)
//! spread z = d(x + y)/dx at fixed t:  I z_ddot = -G cos(x + y) z - d z_dot,   z(0) = 1,  z_dot(0) = 0
//!
//! series:       y = sum y_k h^k,   S_k = (1/k) sum_j j y_j C_(k-j),   C_k = -(1/k) sum_j j y_j S_(k-j)
//!               y_(k+2) = (p [k=0] - G S_k - d (k+1) y_(k+1)) / (I (k+1)(k+2))
//! collocation:  y_ddot = sum a_k (t/h)^k with the equation of motion at Chebyshev's points of (0, h], by Newton's method
//! ```
//!
//! `y` is the distance from the rest point, and `p` the torque minus Coulomb friction. `G` is the gravity moment, `d` the viscous friction
//! and `I` the inertia. `y_k` are the Taylor coefficients of `y`, and `S_k`, `C_k` those of `sin(x + y)` and `cos(x + y)`. In the series,
//! `h` is the time since the step began. In the collocation, `t` is this time, and `h` the length of the step. The series have order 24 and
//! follow Jorba and Zou. The length of a step is chosen so that the last terms of the series are at most 1e-17 of the motion. Such a step
//! is at most a few time constants `I/d` long. After 40 time constants the motion is slow, and collocation integrates it. Collocation is
//! stiffly accurate, and its steps are as long as the slow motion allows.

use super::sine::sin_cos;
use nalgebra::{SMatrix, SVector};
use std::f64::consts::PI;
use std::sync::LazyLock;

const ORDER: usize = 24;
/// Coefficients of a polynomial in the time since a step began.
pub(super) type Series = [f64; ORDER + 1];
/// Number of points of a collocation step.
const POINTS: usize = 12;
/// Number of friction time constants after which collocation is used: exp(-40) is below the rounding error.
const SETTLED: f64 = 40.0;
/// A collocation step is short enough if the last Chebyshev coefficient of the speed is at most this fraction of the speed.
const TAIL: f64 = 2e-14;

/// Parameters of the link: inertia (kg m^2), gravity moment (N m), viscous (N m s/rad) and Coulomb friction (N m). In a motion computed
/// backwards both friction coefficients are negative.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FrictionLink {
    pub inertia: f64,
    pub g: f64,
    pub viscous: f64,
    pub coulomb: f64,
}

impl FrictionLink {
    pub fn backwards(self) -> Self {
        FrictionLink { viscous: -self.viscous, coulomb: -self.coulomb, ..self }
    }
}

/// A step that starts at `time` of its phase and has the duration `length`, both in the unit of time of the phase. `y` has the coefficients
/// of the distance, and `spread` the coefficients of the derivative of the angle with respect to the start.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Step {
    pub time: f64,
    pub length: f64,
    pub y: Series,
    pub spread: Series,
}

/// A phase of constant torque from rest, up to its present point. Its unit of time makes the initial motion of order one, to prevent an
/// overflow of the coefficients of a series.
pub(super) struct Progress {
    x: f64,
    push: f64,
    link: FrictionLink,
    /// Duration of one unit of time of the phase, s.
    pub unit: f64,
    pub time: f64,
    pub y: f64,
    pub v: f64,
    spread: (f64, f64),
    /// Length of the next collocation step to try, in units of `unit`; zero before the first collocation step.
    slow: f64,
}

/// The value of a polynomial and its derivative at the time `h`.
pub(super) fn evaluate(c: &Series, h: f64) -> (f64, f64) {
    let (mut y, mut v) = (0.0, 0.0);
    for k in (0..=ORDER).rev() {
        v = v * h + y;
        y = y * h + c[k];
    }
    (y, v)
}

/// The length of a step whose last six terms are at most 1e-17 of `size`. Six coefficients are used, because from rest at a maximum of the
/// sine, without viscous friction, only every fourth coefficient is not zero.
fn step_length(c: &Series, size: f64) -> f64 {
    (ORDER - 5..=ORDER).map(|k| (1e-17 * size / c[k].abs()).powf(1.0 / k as f64)).fold(f64::INFINITY, f64::min)
}

impl Progress {
    pub fn new(x: f64, torque: f64, link: &FrictionLink) -> Self {
        let push = torque - link.coulomb;
        let FrictionLink { inertia, g, viscous, .. } = *link;
        let unit = (inertia / (push.abs() + g.abs())).sqrt().min((inertia / viscous).abs());
        let link = FrictionLink { inertia: inertia / unit / unit, viscous: viscous / unit, ..*link };
        Progress { x, push, link, unit, time: 0.0, y: 0.0, v: 0.0, spread: (1.0, 0.0), slow: 0.0 }
    }

    /// Net torque at rest, N m.
    pub fn net(&self) -> f64 {
        self.push - self.link.g * sin_cos(self.x).0
    }

    /// The rounding error of the torque, N m.
    fn noise(&self) -> f64 {
        1e-15 * (self.push.abs() + self.link.g.abs() * (1.0 + self.x.abs() + self.y))
    }

    /// Whether gravity balances the torque, so that the link only moves slowly towards an equilibrium.
    pub fn is_near_equilibrium(&self) -> bool {
        self.link.viscous > 0.0 && self.time > 0.0 && self.link.viscous * self.v <= 10.0 * self.noise()
    }

    /// Compute the next step. Its error is as small as the rounding error of a motion over the distance `size`, rad.
    pub fn step(&mut self, size: f64) -> Step {
        let settles = self.link.inertia / self.link.viscous;
        if self.time > SETTLED * settles
            && settles > 0.0
            && let Some(step) = self.collocated(settles)
        {
            return step;
        }
        let [y, cos] = self.series();
        let spread = self.spread_series(&cos);
        // `small` is about the distance that the link moves in one time constant of viscous friction. The error is relative to the
        // smaller of `size` and `self.y + small`.
        let small = y[2].abs() * settles * settles;
        let length = step_length(&y, if small.is_finite() { size.min(self.y + small) } else { size });
        Step { time: self.time, length, y, spread }
    }

    /// Advance the phase to the end of `step`.
    pub fn advance(&mut self, step: &Step) {
        (self.y, self.v) = evaluate(&step.y, step.length);
        self.spread = evaluate(&step.spread, step.length);
        self.time = step.time + step.length;
    }

    /// Taylor coefficients of the distance `y(t)`, and of `cos(x + y(t))`, with respect to time.
    fn series(&self) -> [Series; 2] {
        let FrictionLink { inertia, g, viscous, .. } = self.link;
        let (mut c, mut s, mut k) = ([0.0; ORDER + 1], [0.0; ORDER + 1], [0.0; ORDER + 1]);
        (c[0], c[1]) = (self.y, self.v);
        (s[0], k[0]) = sin_cos(self.x + self.y);
        for n in 0..ORDER - 1 {
            if n > 0 {
                let (mut sine, mut cosine) = (0.0, 0.0);
                for j in 1..=n {
                    let weight = j as f64 * c[j];
                    sine += weight * k[n - j];
                    cosine -= weight * s[n - j];
                }
                (s[n], k[n]) = (sine / n as f64, cosine / n as f64);
            }
            let force = if n == 0 { self.push - g * s[0] } else { -g * s[n] };
            c[n + 2] = (force - viscous * (n + 1) as f64 * c[n + 1]) / (inertia * ((n + 1) * (n + 2)) as f64);
        }
        [c, k]
    }

    /// Taylor coefficients of the spread with respect to time, from the coefficients of `cos(x + y)`.
    fn spread_series(&self, cos: &Series) -> Series {
        let FrictionLink { inertia, g, viscous, .. } = self.link;
        let mut z = [0.0; ORDER + 1];
        (z[0], z[1]) = self.spread;
        for n in 0..ORDER - 1 {
            let turning: f64 = (0..=n).map(|j| cos[j] * z[n - j]).sum();
            z[n + 2] = -(g * turning + viscous * (n + 1) as f64 * z[n + 1]) / (inertia * ((n + 1) * (n + 2)) as f64);
        }
        z
    }

    /// A collocation step as long as the slow motion allows; `None` if the motion is too fast.
    fn collocated(&mut self, settles: f64) -> Option<Step> {
        let (mut length, mut shortened) = (self.slow.max(settles), false);
        loop {
            let tried = Collocation::new(self, length);
            let tail = tried.tail(self);
            // `tail` is proportional to the length of the step to the power `POINTS`. So a step of the length `longest` has a tail of 0.3.
            let longest = length * (0.3 / tail).powf(1.0 / POINTS as f64);
            if tail <= 1.0 {
                // The next step tries `longest` if this step was shortened. Else `tail` may be only a rounding error, and the next step
                // tries 2 or 8 times this length.
                let longer = if tail < 0.1 { 8.0 } else { 2.0 } * length;
                self.slow = if shortened { longest } else { longer };
                let [y, spread] = tried.polynomials(self);
                return Some(Step { time: self.time, length, y, spread });
            }
            if length <= settles {
                return None;
            }
            (length, shortened) = (longest.clamp(0.2 * length, 0.8 * length).max(settles), true);
        }
    }
}

type Values = SVector<f64, POINTS>;
type Square = SMatrix<f64, POINTS, POINTS>;

/// The powers `t^k` at the Chebyshev points `t` of (0, 1], and the first and second integrals of these powers from 0 to `t`.
static POWERS: LazyLock<[Square; 3]> = LazyLock::new(|| {
    let point = |i: usize| 0.5 - 0.5 * (PI * (i + 1) as f64 / POINTS as f64).cos();
    let power = |i, k: usize| f64::powi(point(i), k as i32);
    [
        Square::from_fn(power),
        Square::from_fn(|i, k| power(i, k + 1) / (k + 1) as f64),
        Square::from_fn(|i, k| power(i, k + 2) / ((k + 1) * (k + 2)) as f64),
    ]
});

/// The accelerations of the distance `y` and of the spread `z` in a step, as coefficients of polynomials in the time divided by `length`.
/// The spread is the derivative of the angle with respect to the start `x`.
struct Collocation {
    length: f64,
    accelerations: [Values; 2],
}

impl Collocation {
    fn new(phase: &Progress, length: f64) -> Self {
        let FrictionLink { inertia, g, viscous, .. } = phase.link;
        let [plain, once, twice] = &*POWERS;
        let (once, twice) = (once * length, twice * (length * length));
        let resisting = plain * inertia + once * viscous;
        let along = |start: f64, rate: f64| Values::from_fn(|i, _| start + rate * (plain[(i, 1)] * length));
        let straight = along(phase.x + phase.y, phase.v);
        let tangent = |cos: &Values| (resisting + Square::from_fn(|i, k| g * cos[i] * twice[(i, k)])).lu();
        let (mut motion, mut last, mut converged) = (Values::zeros(), f64::INFINITY, false);
        for _ in 0..12 {
            let angles = straight + twice * motion;
            let (sin, cos) = (angles.map(|x| sin_cos(x).0), angles.map(|x| sin_cos(x).1));
            let missing = sin.map(|sin| phase.push - g * sin - viscous * phase.v) - resisting * motion;
            let change = tangent(&cos).solve(&missing).unwrap_or_else(|| Values::repeat(f64::NAN));
            motion += change;
            let (way, moved) = (twice * change, twice * motion);
            let (now, size) = (way.amax(), moved.amax() + phase.v * length);
            converged = now.min(last) <= 1e-12 * size + 1e-15 * straight[0].abs();
            if !(now > 1e-15 * size && now < 0.5 * last) {
                break;
            }
            last = now;
        }
        if !converged {
            // Newton's method did not converge. NaN makes `tail` infinite, so that a shorter step is tried.
            motion.fill(f64::NAN);
        }
        let cos = (straight + twice * motion).map(|x| sin_cos(x).1);
        let drag = along(phase.spread.0, phase.spread.1).component_mul(&cos).map(|z| -g * z - viscous * phase.spread.1);
        let spread = tangent(&cos).solve(&drag).unwrap_or_else(|| Values::repeat(f64::NAN));
        Collocation { length, accelerations: [motion, spread] }
    }

    /// The last Chebyshev coefficients of the speed, relative to their tolerance: at most 1 if the step is short enough.
    fn tail(&self, phase: &Progress) -> f64 {
        let motion = &self.accelerations[0];
        let term = |k: usize| (motion[k] * self.length / (k + 1) as f64).abs() / f64::powi(2.0, 2 * k as i32 + 1);
        let tail = term(POINTS - 1).max(term(POINTS - 2));
        // A rounding error of the initial speed appears about twelve times as large in the last coefficient.
        let ratio = tail / (TAIL * phase.v + 12.0 * phase.noise() / phase.link.viscous);
        if ratio.is_nan() { f64::INFINITY } else { ratio }
    }

    /// The polynomials of the distance `y` and of the spread `z`, in the time since the step began. The spread is the derivative of the
    /// angle with respect to the start.
    fn polynomials(&self, from: &Progress) -> [Series; 2] {
        let mut series = [[0.0; ORDER + 1]; 2];
        for (c, (start, accelerations)) in series.iter_mut().zip([(from.y, from.v), from.spread].into_iter().zip(&self.accelerations)) {
            (c[0], c[1]) = start;
            let mut power = 1.0;
            for k in 0..POINTS {
                c[k + 2] = accelerations[k] / ((k + 1) * (k + 2)) as f64 * power;
                power /= self.length;
            }
        }
        series
    }
}
