//! The monotone motion without friction, from rest to rest: lengths, energies and durations of its push and its brake.

use super::phase::Phase;
use super::report::MonotoneReason;
use super::sine::sin_cos;

/// A push from rest at `x0` and a brake to rest at `x1 >= x0`, with their lengths, rad.
#[derive(Debug, Clone, Copy)]
pub(super) struct Monotone {
    pub push: Phase,
    pub brake: Phase,
    pub push_length: f64,
    pub brake_length: f64,
}

/// Kinetic energies of a monotone motion. `peak` is the energy at the switch. `push_hump` is the energy at the first local minimum during
/// the push, or infinite if there is none.
#[derive(Debug, Clone, Copy)]
pub(super) struct Energies {
    pub peak: f64,
    pub push_hump: f64,
}

/// `cos x0 - cos x1` from the sines of half the sum and of half the difference. It is accurate even for very small moves.
#[inline]
pub(super) fn drop(sum: f64, difference: f64) -> f64 {
    2.0 * sum * difference
}

impl Monotone {
    /// Create the motion from the rest point of `push` to the rest point of `brake`. The brake is computed backwards in the mirrored
    /// coordinate. `drop` is `cos x0 - cos x1`.
    #[inline]
    pub fn between(push: Phase, brake: Phase, drop: f64) -> Self {
        let (up, down) = (push.push, brake.push);
        let (distance, work) = (-brake.x - push.x, push.g * drop);
        let (push_length, brake_length) = ((down * distance + work) / (up + down), (up * distance - work) / (up + down));
        Monotone { push, brake, push_length, brake_length }
    }

    /// The reason why the motion is impossible, or `Feasible`.
    #[inline]
    pub fn reason(&self) -> MonotoneReason {
        let Monotone { push, brake, push_length, brake_length } = *self;
        if push.net() <= 0.0 {
            return MonotoneReason::StartBlocked { missing: 0.0 - push.net() };
        }
        if brake.net() <= 0.0 {
            return MonotoneReason::EndBlocked { missing: 0.0 - brake.net() };
        }
        if push_length <= 0.0 || brake_length <= 0.0 {
            return MonotoneReason::Work {
                missing: -push_length.min(brake_length) * (push.push + brake.push) / (push_length + brake_length),
            };
        }
        let peak = push.energy(push_length);
        if let Some(y) = push.gravity_crest(push_length) {
            let energy = push.energy(y);
            if energy <= 0.0 {
                return MonotoneReason::Hump { x: push.x + y, missing: -energy / y };
            }
        }
        if let Some(y) = brake.gravity_crest(brake_length) {
            let energy = brake.energy(y);
            if energy <= 0.0 {
                return MonotoneReason::Hump { x: -brake.x - y, missing: -energy / y };
            }
        }
        if peak <= 0.0 {
            return MonotoneReason::Hump { x: push.x + push_length, missing: -peak / push_length };
        }
        MonotoneReason::Feasible
    }

    /// The kinetic energies; `None` if the motion is impossible.
    #[inline]
    pub fn energies(&self) -> Option<Energies> {
        let Monotone { push, brake, push_length, brake_length } = *self;
        if !(push_length > 0.0 && brake_length > 0.0 && push.net() > 0.0 && brake.net() > 0.0) {
            return None;
        }
        let (push_hump, peak) = (push.lowest(push_length), push.energy(push_length));
        (push_hump > 0.0 && brake.lowest(brake_length) > 0.0 && peak > 0.0).then_some(Energies { peak, push_hump })
    }

    /// Durations of push and brake, divided by `sqrt(I/2)`.
    #[inline]
    pub fn time_factors(&self) -> (f64, f64) {
        (self.push.time_factor(self.push_length), self.brake.time_factor(self.brake_length))
    }
}

/// The monotone motion from `x0` to `x1 >= x0`, and quantities that the swings between these ends use.
#[derive(Debug, Clone, Copy)]
pub(super) struct MonotoneMotion {
    pub monotone: Monotone,
    /// Sine and cosine of the mean of the two end angles.
    pub middle: (f64, f64),
    /// Sine and cosine of half the difference of the end angles.
    pub half: (f64, f64),
}

impl MonotoneMotion {
    /// Create the motion from `x0` to `x1`. `up` and `down` are the absolute values of the pushing and of the braking torque bound, N m.
    #[inline]
    pub fn new(x0: f64, x1: f64, g: f64, up: f64, down: f64) -> Self {
        let (middle, half) = (sin_cos(0.5 * x0 + 0.5 * x1), sin_cos(0.5 * (x1 - x0)));
        let monotone = Monotone::between(Phase::new(x0, up, g), Phase::new(-x1, down, g), drop(middle.0, half.0));
        MonotoneMotion { monotone, middle, half }
    }

    pub fn distance(&self) -> f64 {
        -self.monotone.brake.x - self.monotone.push.x
    }

    /// The motion mirrored and run backwards.
    pub fn reversed(&self) -> Self {
        let Monotone { push, brake, push_length, brake_length } = self.monotone;
        let monotone = Monotone { push: brake, brake: push, push_length: brake_length, brake_length: push_length };
        MonotoneMotion { monotone, middle: (-self.middle.0, self.middle.1), half: self.half }
    }
}
