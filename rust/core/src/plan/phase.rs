//! Duration of a phase of constant torque without friction that starts at rest, or ends at rest and is computed backwards.
//!
//! ```text
//! from rest at x under constant torque p:   K(y) = p y - G (cos x - cos(x + y)) = y w(y)      (K: kinetic energy after the distance y)
//! w(y) = p - G sin(x + h) sinc(h),  h = y/2                        (mean net torque over y, no cancellation at y -> 0)
//! F(x, L) = int_0^L dy / sqrt(K) = 2 sqrt(L) int_0^1 ds / sqrt(w(L s^2)),   time = sqrt(I/2) F
//! dF/dx  = sqrt(L) int_0^1 G cos(x + h) sinc(h) w^(-3/2) ds,       dF/dL = 1/sqrt(K(L))
//! ```
//!
//! `G` is the gravity moment, and `I` the inertia. The substitution `y = L s^2` removes the inverse square root at the rest point. The
//! remaining integrand is smooth unless `w` comes near zero. There the link barely passes a *maximum of gravity*, an angle where the
//! kinetic energy has a local minimum. The integral is computed by adaptive bisection with the 10-21 point Gauss-Kronrod pair. A phase that
//! brakes to rest at `x` is computed as a push from `-x`, run backwards, with the braking torque.

use super::quadrature::{Graded, Integrand, adaptive, few};
use super::sine::{sin_cos, sinc_cos_small};
use crate::scalar::{GenericKernel, Real, run_lanes};
use std::f64::consts::{PI, TAU};

/// A limit of the mean net torque, as a fraction of the sum of the torque and the absolute gravity moment. Below this limit the fixed
/// quadrature rule is not accurate enough.
const LEAST_MEAN_TORQUE: f64 = 1e-3;
/// Relative accuracy of the integral over each panel. Durations would permit a larger error, but the two quadrature rules may agree by
/// chance.
const ACCURACY: f64 = 3e-14;

/// A phase from rest at the angle `x` under the constant torque `push`, against the gravity torque `g sin`. A negative `push` pulls back.
#[derive(Debug, Clone, Copy)]
pub(super) struct Phase {
    pub x: f64,
    pub push: f64,
    pub g: f64,
    sin: f64,
    cos: f64,
    /// An angle at which the kinetic energy has a local minimum; NaN if `push >= |g|` or `push < -|g|`.
    least: f64,
}

impl Phase {
    #[inline]
    pub fn new(x: f64, push: f64, g: f64) -> Self {
        let (sin, cos) = sin_cos(x);
        let least = if g.abs() <= push {
            f64::NAN
        } else if g > 0.0 {
            PI - (push / g).asin()
        } else {
            (push / g).asin()
        };
        Phase { x, push, g, sin, cos, least }
    }

    /// The same phase from rest at another angle `x`, whose sine and cosine are known.
    #[inline]
    pub fn moved(&self, x: f64, (sin, cos): (f64, f64)) -> Self {
        Phase { x, sin, cos, ..*self }
    }

    /// Sine and cosine of the angle at rest.
    #[inline]
    pub fn angle(&self) -> (f64, f64) {
        (self.sin, self.cos)
    }

    /// Net torque at rest. The phase moves forward if and only if it is positive.
    #[inline]
    pub fn net(&self) -> f64 {
        self.push - self.g * self.sin
    }

    /// Kinetic energy after the distance `y`.
    #[inline]
    pub fn energy(&self, y: f64) -> f64 {
        let h = 0.5 * y;
        let (s, c) = sin_cos(h);
        let sinc = if h == 0.0 { 1.0 } else { s / h };
        y * (self.push - self.g * sinc * (self.sin * c + self.cos * s))
    }

    /// The first distance in `[0, 2 pi]` at which the kinetic energy has a local minimum; NaN if there is none. If `push >= 0`, later
    /// minima are not lower, since `K(y + 2 pi) = K(y) + 2 pi push`.
    #[inline]
    fn first_least(&self) -> f64 {
        let y = self.least - self.x;
        y - TAU * (y / TAU).floor()
    }

    /// The first distance in `(0, length)` at which the kinetic energy has a local minimum; `None` if there is none.
    #[inline]
    pub fn gravity_crest(&self, length: f64) -> Option<f64> {
        if self.least.is_nan() {
            return None;
        }
        let y = self.first_least();
        (y > 0.0 && y < length).then_some(y)
    }

    /// The kinetic energy at its first local minimum before `length`; infinite if there is none.
    #[inline]
    pub fn lowest(&self, length: f64) -> f64 {
        self.gravity_crest(length).map_or(f64::INFINITY, |y| self.energy(y))
    }

    /// Whether the phase moves forward from rest, and its kinetic energy is positive at the first local minimum before `length`.
    #[inline]
    pub fn clears(&self, length: f64) -> bool {
        self.net() > 0.0 && self.lowest(length) > 0.0
    }

    /// For a torque that is not negative: the distance at which the phase comes to rest again. It is infinite if the kinetic energy remains
    /// positive.
    pub fn reach(&self) -> f64 {
        if self.least.is_nan() {
            return f64::INFINITY;
        }
        // The energy first rises to a maximum, and then falls to a minimum. If both are at the same angle, a rounding error may make
        // `descent_length` a whole revolution.
        let least = self.first_least();
        if self.descent_length() >= least || self.energy(least) > 0.0 { f64::INFINITY } else { self.zero(least) }
    }

    /// For a negative torque: the interval of distances in which the energy first falls from zero to a minimum.
    pub fn descent(&self) -> (f64, f64) {
        let least = self.first_least();
        (if self.descent_length() < least { self.zero(least) } else { 0.0 }, least)
    }

    /// For a negative torque: the distance from a minimum of the energy to the next point with the same energy. For other torques:
    /// infinite.
    pub fn recovery(&self) -> f64 {
        if self.push < 0.0 { Phase::new(self.least, self.push, self.g).zero(TAU) } else { f64::INFINITY }
    }

    /// Find the first minimum of the energy after the distance `from`, where the energy must not fall. Return its angle, up to whole
    /// revolutions, and its distance.
    pub fn least_after(&self, from: f64) -> (f64, f64) {
        let least = self.first_least();
        // If `from` is at a minimum, a rounding error may lead to the next minimum, one revolution ahead.
        let least = if from == 0.0 && self.descent_length() < least { 0.0 } else { least };
        (self.least, least + TAU * ((from - least) / TAU).ceil().max(0.0))
    }

    /// The distance from a maximum of the energy to the minimum after it.
    fn descent_length(&self) -> f64 {
        let length = 2.0 * self.least - PI;
        length - TAU * (length / TAU).floor()
    }

    /// The zero of the energy between a maximum and the minimum at `least`, by Halley's method from the inflection point.
    fn zero(&self, least: f64) -> f64 {
        let (mut y, mut last) = (least - 0.5 * self.descent_length(), f64::INFINITY);
        for _ in 0..60 {
            let (s, c) = sin_cos(0.5 * y);
            let energy = self.push * y - 2.0 * self.g * s * (self.sin * c + self.cos * s);
            let (sin, cos) = (2.0 * s * c, 1.0 - 2.0 * s * s);
            let (rate, curvature) = (self.push - self.g * (self.sin * cos + self.cos * sin), self.g * (self.sin * sin - self.cos * cos));
            let step = energy / (rate - 0.5 * energy * curvature / rate);
            if !(step.abs() < last) {
                break;
            }
            y = (y - step).clamp(0.0, least);
            // The error after this step is proportional to the cube of the step, so a small step is the last one.
            if step.abs() <= 1e-6 * y && step.abs() <= 1e-3 * last {
                break;
            }
            last = step.abs();
        }
        y
    }

    /// The time factor `F(x, length)`: the duration of the phase divided by `sqrt(I/2)`.
    pub fn time_factor(&self, length: f64) -> f64 {
        2.0 * length.sqrt() * run_lanes(Integral::<false> { phase: *self, length, accuracy: ACCURACY })
    }

    /// The derivative `dF/dx` of the time factor at fixed length, with the relative error `accuracy`.
    pub fn time_gradient(&self, length: f64, accuracy: f64) -> f64 {
        length.sqrt() * run_lanes(Integral::<true> { phase: *self, length, accuracy })
    }

    /// The derivative `dF/dx` of the time factor at fixed length, with about three correct digits. `energy` is the kinetic energy at the
    /// end.
    #[inline]
    pub fn rough_gradient(&self, length: f64, energy: f64) -> f64 {
        let gravity_crest = self.gravity_crest(length);
        let least = gravity_crest.map_or(f64::INFINITY, |y| self.energy(y) / y).min(self.net());
        let (enough, end) = (LEAST_MEAN_TORQUE * (self.push + self.g.abs()), energy / length);
        // The fixed rule is not accurate for a phase longer than one revolution, which passes several minima of the energy. It is also not
        // accurate if the mean net torque comes near zero, because the integrand then has a narrow peak. At the end of the phase the limit
        // may be a hundred times smaller, because the fixed rule is more accurate there.
        if length > TAU || least < enough || end < 0.01 * enough {
            self.time_gradient(length, 1e-3)
        } else {
            run_lanes(FixedRule { phase: *self, length, gravity_crest })
        }
    }
}

/// The derivative `dF/dx` of the time factor of a phase by a fixed quadrature rule.
struct FixedRule {
    phase: Phase,
    length: f64,
    gravity_crest: Option<f64>,
}

impl GenericKernel for FixedRule {
    type Output = f64;
    #[inline(always)]
    fn run<S: Real>(self) -> f64 {
        let FixedRule { phase, length, gravity_crest } = self;
        let f = &Integral::<true> { phase, length, accuracy: f64::NAN };
        // Place more nodes where `w` may be smallest.
        let parts = match gravity_crest.map(|y| (y / length).sqrt()) {
            Some(from) => [Graded { f, from, extent: -from }, Graded { f, from, extent: 1.0 - from }],
            None => [Graded { f, from: 0.0, extent: 0.5 }, Graded { f, from: 1.0, extent: -0.5 }],
        };
        length.sqrt() * (few::<S>(&parts[0]) + few::<S>(&parts[1]))
    }
}

/// The integral of the time factor, `int_0^1 1/sqrt(w) ds` with `y = L s^2`. With `GRADIENT`, it is the integral of the derivative of the
/// time factor, `int_0^1 G cos(x + h) sinc(h) w^(-3/2) ds`.
struct Integral<const GRADIENT: bool> {
    phase: Phase,
    length: f64,
    accuracy: f64,
}

impl<const GRADIENT: bool> GenericKernel for Integral<GRADIENT> {
    type Output = f64;
    #[inline(always)]
    fn run<S: Real>(self) -> f64 {
        // Split at the maximum of gravity, near which `w` is smallest. `Graded` makes the panels near it short.
        match self.phase.gravity_crest(self.length) {
            None => adaptive::<S>(&self, self.accuracy, 0.0),
            Some(y) => {
                let from = (y / self.length).sqrt();
                let before = adaptive::<S>(&Graded { f: &self, from, extent: -from }, self.accuracy, 0.0);
                before + adaptive::<S>(&Graded { f: &self, from, extent: 1.0 - from }, self.accuracy, before)
            }
        }
    }
}

impl<const GRADIENT: bool> Integrand for Integral<GRADIENT> {
    #[inline(always)]
    fn at<S: Real>(&self, s: S) -> S {
        let Integral { phase: Phase { push, g, sin, cos, .. }, length, .. } = *self;
        let k = S::splat;
        let y = k(length) * s * s;
        // Distances up to pi require no reduction of the angle: with q = y/4 <= pi/4, sinc h = sinc q cos q and cos h = 1 - 2 sin^2 q.
        let (sinc, sin_h, cos_h) = if length <= PI {
            let q = k(0.25) * y;
            let (sinc_q, cos_q) = sinc_cos_small(q);
            let (sinc, sin_q) = (sinc_q * cos_q, q * sinc_q);
            (sinc, k(2.0) * q * sinc, k(1.0) - k(2.0) * sin_q * sin_q)
        } else {
            let h = k(0.5) * y;
            let (sin_h, cos_h) = h.sin_cos();
            let some = S::zero().lt(h);
            (S::select(some, sin_h / S::select(some, h, k(1.0)), k(1.0)), sin_h, cos_h)
        };
        let scaled = k(g) * sinc;
        let w = (k(push) - scaled * (k(sin) * cos_h + k(cos) * sin_h)).max(k(1e-18 * (push.abs() + g.abs())));
        if GRADIENT { scaled * (k(cos) * cos_h - k(sin) * sin_h) / (w * w.sqrt()) } else { k(1.0) / w.sqrt() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gradient_is_the_derivative() {
        let h = 1e-5;
        for (x, push, g, length) in [(0.3, 1.0, 0.8, 2.0), (2.0, 1.2, 1.0, 4.0), (-3.0, 2.0, 2.5, 0.4), (1.0, 1.0, -0.9, 12.0)] {
            let f = |x: f64| Phase::new(x, push, g).time_factor(length);
            let difference = (f(x + h) - f(x - h)) / (2.0 * h);
            let exact = Phase::new(x, push, g).time_gradient(length, 1e-12);
            assert!((difference - exact).abs() < 1e-8 * (1.0 + exact.abs()), "{difference} {exact}");
        }
    }
}
