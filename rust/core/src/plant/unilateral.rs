//! A spring and a damper that only push: `f = max(0, k d + c d_dot)` at depth `d > 0`, no force outside.
//!
//! The force changes its formula where `d` or `k d + c d_dot` changes sign. A run that locates these instants keeps the
//! formula between them, so that no step contains a change.

use crate::error::{Error, Result, positive};
use crate::scalar::Real;

/// The state of a contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Touch {
    /// Outside.
    #[default]
    Apart,
    /// Inside, and pushing.
    Pressed,
    /// Inside, but the frame leaves so fast that spring and damper have no force.
    Slack,
}

impl Touch {
    /// At depth `depth` under the push `k d + c d_dot`.
    pub fn at(depth: f64, push: f64) -> Self {
        match (depth > 0.0, push >= 0.0) {
            (true, true) => Touch::Pressed,
            (true, false) => Touch::Slack,
            // On the surface, moving inwards.
            _ if depth == 0.0 && push > 0.0 => Touch::Pressed,
            _ => Touch::Apart,
        }
    }

    /// Two functions. One of them becomes negative where this mode ends.
    pub fn guards(self, depth: f64, push: f64) -> [f64; 2] {
        match self {
            Touch::Apart => [-depth, f64::INFINITY],
            Touch::Pressed => [push, f64::INFINITY],
            Touch::Slack => [depth, -push],
        }
    }

    /// The next state after a sign change of guard `which` at depth `depth`.
    pub fn next(self, which: usize, depth: f64) -> Self {
        match self {
            Touch::Apart => Touch::Pressed,
            Touch::Pressed if depth > 0.0 => Touch::Slack,
            Touch::Slack if which == 1 => Touch::Pressed,
            _ => Touch::Apart,
        }
    }
}

/// What spring and damper push with while they touch, `k d + c d_dot`.
pub fn pressing<S: Real>(stiffness: S, damping: S, depth: S, rate: S) -> S {
    damping.mul_add(rate, stiffness * depth)
}

/// The force at depth `depth` that grows at `rate`, and the lost power. `held` is the state of the contact, `None` to follow the plant.
pub fn push<S: Real>(stiffness: S, damping: S, depth: S, rate: S, held: Option<Touch>) -> (S, S) {
    let spring = stiffness * depth;
    let force = pressing(stiffness, damping, depth, rate);
    // The spring stores a part of the power. The rest is lost: (f - k d) d_dot.
    match held {
        None => {
            let touching = S::zero().lt(depth);
            let pushing = S::zero().lt(force);
            let force = S::select(touching, S::select(pushing, force, S::zero()), S::zero());
            let stored = S::select(touching, spring, S::zero());
            (force, (force - stored) * rate)
        }
        Some(Touch::Apart) => (S::zero(), S::zero()),
        Some(Touch::Pressed) => (force, (force - spring) * rate),
        Some(Touch::Slack) => (S::zero(), -(spring * rate)),
    }
}

/// Refuse a stiffness that is not positive, or a negative damping.
pub fn require_spring(stiffness: f64, damping: f64) -> Result<()> {
    positive("stiffness", stiffness)?;
    if !(damping >= 0.0 && damping.is_finite()) {
        return Err(Error::input("damping", format!("is negative or not finite: expected a number >= 0, got {damping}")));
    }
    Ok(())
}

/// Energy in the spring.
pub fn stored<S: Real>(stiffness: S, depth: S) -> S {
    let depth = depth.max(S::zero());
    S::splat(0.5) * stiffness * depth * depth
}
