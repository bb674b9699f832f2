//! A spring and a damper that only push: `f = max(0, k d + c d_dot)` at the depth `d > 0`, and no force outside.
//!
//! The formula of the force changes where `d` or `k d + c d_dot` changes its sign. A run can locate these instants. Between them it keeps
//! the mode of the contact ([`Touch`]), so that the formula does not change within a step.

use crate::error::{Error, Result, positive};
use crate::scalar::Real;

/// The mode of a contact.
///
/// ```
/// use armlet_core::plant::Touch;
///
/// assert_eq!([Touch::at(-0.1, 0.0), Touch::at(0.1, 5.0), Touch::at(0.1, -5.0)], [Touch::Apart, Touch::Pressed, Touch::Slack]);
/// // A pressed contact ends where its push of 5 N becomes negative.
/// assert_eq!(Touch::Pressed.guards(0.1, 5.0)[0], 5.0);
/// assert_eq!((Touch::Pressed.next(0, 0.1), Touch::Pressed.next(0, -0.1)), (Touch::Slack, Touch::Apart));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Touch {
    /// The frame or joint is outside, without a force.
    #[default]
    Apart,
    /// The frame or joint is inside, with a pushing force.
    Pressed,
    /// The frame or joint is inside, without a force. It leaves so fast that spring and damper would pull.
    Slack,
}

impl Touch {
    /// The mode at the depth `depth` with the push `k d + c d_dot`.
    pub fn at(depth: f64, push: f64) -> Self {
        match (depth > 0.0, push >= 0.0) {
            (true, true) => Touch::Pressed,
            (true, false) => Touch::Slack,
            // The frame is on the surface, and moves inwards.
            _ if depth == 0.0 && push > 0.0 => Touch::Pressed,
            _ => Touch::Apart,
        }
    }

    /// Two numbers, 0 or 1: whether the contact pushes, and whether frame or joint is inside.
    pub fn numbers(self) -> [f64; 2] {
        match self {
            Touch::Apart => [0.0, 0.0],
            Touch::Pressed => [1.0, 1.0],
            Touch::Slack => [0.0, 1.0],
        }
    }

    /// Compute two numbers. One of them becomes negative where this mode ends.
    pub fn guards(self, depth: f64, push: f64) -> [f64; 2] {
        match self {
            Touch::Apart => [-depth, f64::INFINITY],
            Touch::Pressed => [push, f64::INFINITY],
            Touch::Slack => [depth, -push],
        }
    }

    /// The next mode, after the guard `which` changed its sign at the depth `depth`.
    pub fn next(self, which: usize, depth: f64) -> Self {
        match self {
            Touch::Apart => Touch::Pressed,
            Touch::Pressed if depth > 0.0 => Touch::Slack,
            Touch::Slack if which == 1 => Touch::Pressed,
            _ => Touch::Apart,
        }
    }
}

/// The mode of a contact as truth values of a number type.
///
/// ```
/// use armlet_core::plant::{Mode, Touch};
///
/// let slack = Mode::<f64>::from(Touch::Slack);
/// assert!(slack.inside && !slack.pushes);
/// assert_eq!(Touch::Slack.numbers(), [0.0, 1.0]);
/// ```
#[derive(Clone, Copy)]
pub struct Mode<S: Real> {
    /// Whether spring and damper push.
    pub pushes: S::Mask,
    /// Whether the frame or joint is inside.
    pub inside: S::Mask,
}

impl<S: Real> Mode<S> {
    /// The mode that [`Touch::numbers`] describes. Both numbers are 0 or 1.
    pub fn of([pushes, inside]: [S; 2]) -> Self {
        Mode { pushes: S::zero().lt(pushes), inside: S::zero().lt(inside) }
    }
}

impl<S: Real> From<Touch> for Mode<S> {
    fn from(state: Touch) -> Self {
        Mode::of(state.numbers().map(S::splat))
    }
}

/// The push `k d + c d_dot` of spring and damper, N or N m.
pub fn pressing<S: Real>(stiffness: S, damping: S, depth: S, rate: S) -> S {
    damping * rate + stiffness * depth
}

/// The force at the depth `depth` with the rate `rate`, and the lost power. `held` is the mode of the contact. With `None`, the mode
/// follows from the state.
pub fn push<S: Real>(stiffness: S, damping: S, depth: S, rate: S, held: Option<Mode<S>>) -> (S, S) {
    let (zero, spring) = (S::zero(), stiffness * depth);
    let force = pressing(stiffness, damping, depth, rate);
    let (inside, force) = match held {
        Some(mode) => (mode.inside, S::select(mode.pushes, force, zero)),
        None => {
            let inside = zero.lt(depth);
            let pushes = zero.lt(force);
            (inside, S::select(inside, S::select(pushes, force, zero), zero))
        }
    };
    // The spring stores a part of the power. The rest is lost: (f - k d) d_dot.
    let stored = S::select(inside, spring, zero);
    (force, (force - stored) * rate)
}

/// Refuse a stiffness that is not positive, or a negative damping. Errors: `Input`.
pub fn require_spring(stiffness: f64, damping: f64) -> Result<()> {
    positive("stiffness", stiffness)?;
    if !(damping >= 0.0 && damping.is_finite()) {
        return Err(Error::input("damping", format!("is negative or not finite: expected a number >= 0, got {damping}")));
    }
    Ok(())
}

/// Energy stored in the spring, J.
pub fn stored<S: Real>(stiffness: S, depth: S) -> S {
    let depth = depth.max(S::zero());
    S::splat(0.5) * stiffness * depth * depth
}
