//! Zero crossings of functions `g_i(t, x)` along a run, located on the dense output of each step.
//!
//! An event is a change of the sign of `g` between both ends of an accepted step. At a rising crossing, `g` changes from negative to zero
//! or positive. At a falling crossing, it changes from positive to zero or negative. If `g` is zero at the start of a step, this step has
//! no event. Two changes within one step cancel and are missed. With a smaller limit of the step size, both may be detected. The root is
//! bracketed until `g` is zero or no number lies between the two ends of the bracket. The method is Chandrupatla's (1997): inverse
//! quadratic interpolation where it is safe, otherwise bisection. The event time is the later end of the bracket. A run that starts at this
//! time therefore begins after the change of sign.

use super::{Adaptive, Buffer, System};
use crate::scalar::sign;
use crate::status::Status;

/// The settings of one event.
///
/// ```
/// use armlet_core::integrate::events::Event;
/// use armlet_core::integrate::solve::{Request, solve};
/// # use armlet_core::integrate::solve::Recorder;
/// # use armlet_core::integrate::{Dopri5, Embedded, System, Tolerance};
/// # struct Oscillator;
/// # impl System<f64> for Oscillator {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { (dx[0], dx[1]) = (x[1], -x[0]); }
/// # }
/// # struct Nothing;
/// # impl Recorder for Nothing {
/// #     fn state(&mut self, _: f64, _: &[f64]) {}
/// # }
/// # let mut method = Embedded::<Dopri5, _, _, _>::new(Tolerance { rtol: 1e-9, atol: 1e-12, controlled: 2 }, [1.0, 0.0], ());
///
/// // `x = cos t` rises through zero at 3 pi/2, and for the second time at 7 pi/2, where the run ends.
/// let events = [Event { direction: 1.0, stop_after: 2 }];
/// let request = Request { events: &events, ..Request::default() };
/// let mut x = |_: usize, _: f64, x: &[f64]| x[0];
/// let end = solve(&mut Oscillator, &mut method, (0.0, 20.0), &request, &mut x, &mut Nothing);
/// assert!((end.t - 3.5 * std::f64::consts::PI).abs() < 1e-7);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Event {
    /// Positive: only rising crossings count. Negative: only falling crossings count. Zero: both count.
    pub direction: f64,
    /// The number of crossings after which the run ends. Zero: the run does not end.
    pub stop_after: usize,
}

/// Event functions, identified by an index.
///
/// ```
/// use armlet_core::integrate::events::Watched;
///
/// /// The height above a table, and the end of the first second.
/// struct Table(f64);
/// impl Watched for Table {
///     fn value(&mut self, i: usize, t: f64, x: &[f64]) -> f64 {
///         if i == 0 { x[0] - self.0 } else { t - 1.0 }
///     }
/// }
/// assert_eq!((Table(0.5).value(0, 0.0, &[2.0]), Table(0.5).value(1, 0.25, &[2.0])), (1.5, -0.75));
/// // A closure is `Watched` too.
/// assert_eq!((|_: usize, t: f64, _: &[f64]| 2.0 * t).value(0, 3.0, &[]), 6.0);
/// ```
pub trait Watched {
    /// The value of event function `i` at time `t`, s, and state `x`.
    fn value(&mut self, i: usize, t: f64, x: &[f64]) -> f64;
}

impl<G: FnMut(usize, f64, &[f64]) -> f64> Watched for G {
    fn value(&mut self, i: usize, t: f64, x: &[f64]) -> f64 {
        self(i, t, x)
    }
}

/// A crossing: the index of the event and its time.
///
/// ```
/// use armlet_core::integrate::events::{Crossing, Event, Watch};
/// # use armlet_core::integrate::{Adaptive, Dopri5, Embedded, System, Tolerance};
/// # struct Clock;
/// # impl System<f64> for Clock {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), _: &[f64], dx: &mut [f64]) { dx[0] = 1.0; }
/// # }
///
/// # let tolerance = Tolerance { rtol: 1e-6, atol: 1e-9, controlled: 1 };
/// # let mut method = Embedded::<Dopri5, _, _, _>::new(tolerance, [0.0], ());
/// // `x' = 1`, and the event `x = 0.75`.
/// let mut level = |_: usize, _: f64, x: &[f64]| x[0] - 0.75;
/// let mut watch = Watch::new(vec![Event::default()], [0.0]);
/// watch.begin(&mut level, 0.0, &[0.0]).expect("finite");
/// method.begin(&mut Clock, 0.0, 1.0, 1.0).expect("finite");
/// let mut found: Vec<Crossing> = Vec::new();
/// while !method.step(&mut Clock).expect("smooth") {
///     watch.scan(&mut Clock, &mut method, &mut level).expect("finite");
///     found.extend(&watch.crossings);
/// }
/// # watch.scan(&mut Clock, &mut method, &mut level).expect("finite");
/// # found.extend(&watch.crossings);
/// assert!(found.len() == 1 && found[0].index == 0 && !found[0].stops && (found[0].t - 0.75).abs() < 1e-12);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// The index of the event.
    pub index: usize,
    /// The time of the crossing, s.
    pub t: f64,
    /// Whether the run ends at this crossing.
    pub stops: bool,
}

/// The state of event detection in one run.
///
/// ```
/// use armlet_core::integrate::events::{Event, Watch};
/// # use armlet_core::integrate::{Adaptive, Dopri5, Embedded, System, Tolerance};
/// # struct Oscillator;
/// # impl System<f64> for Oscillator {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { (dx[0], dx[1]) = (x[1], -x[0]); }
/// # }
///
/// # let tolerance = Tolerance { rtol: 1e-9, atol: 1e-12, controlled: 2 };
/// # let mut method = Embedded::<Dopri5, _, _, _>::new(tolerance, [1.0, 0.0], ());
/// // `x = cos t` ends the run at its first falling zero, pi/2.
/// let mut zero = |_: usize, _: f64, x: &[f64]| x[0];
/// let mut watch = Watch::new(vec![Event { direction: -1.0, stop_after: 1 }], [0.0; 2]);
/// watch.begin(&mut zero, 0.0, &[1.0, 0.0]).expect("finite");
/// method.begin(&mut Oscillator, 0.0, 10.0, 10.0).expect("finite");
/// let end = loop {
///     method.step(&mut Oscillator).expect("smooth");
///     if let Some(t) = watch.scan(&mut Oscillator, &mut method, &mut zero).expect("finite") {
///         break t;
///     }
/// };
/// assert!((end - std::f64::consts::FRAC_PI_2).abs() < 1e-8);
/// ```
pub struct Watch<B> {
    events: Vec<Event>,
    counts: Vec<usize>,
    /// The sign of each function at the end of the last step: -1, 0 or 1.
    signs: Vec<f64>,
    values: Vec<f64>,
    /// The crossings in the last step, in order of time.
    pub crossings: Vec<Crossing>,
    at: B,
}

impl<B: Buffer<f64>> Watch<B> {
    /// Detect `events`. The size of `state` determines the size of the memory.
    pub fn new(events: Vec<Event>, state: B) -> Self {
        let n = events.len();
        Watch { events, counts: vec![0; n], signs: vec![0.0; n], values: vec![0.0; n], crossings: Vec::with_capacity(n), at: state }
    }

    /// Begin the detection at time `t`, s, and state `x`, at the start of a run or after a jump. Error: [`Status::Diverged`] if a function
    /// is NaN.
    pub fn begin<G: Watched>(&mut self, watched: &mut G, t: f64, x: &[f64]) -> Result<(), Status> {
        for i in 0..self.events.len() {
            self.values[i] = watched.value(i, t, x);
            if self.values[i].is_nan() {
                return Err(Status::Diverged);
            }
            self.signs[i] = sign(self.values[i]);
        }
        Ok(())
    }

    /// Find the crossings in the step that `method` has just accepted. Return the time of the crossing that ends the run, s, if one does.
    /// Crossings after this time are removed. Error: [`Status::Diverged`] if a function is NaN.
    pub fn scan<F, G, M>(&mut self, system: &mut F, method: &mut M, watched: &mut G) -> Result<Option<f64>, Status>
    where
        F: System<f64>,
        G: Watched,
        M: Adaptive<f64, F, B> + ?Sized,
    {
        self.crossings.clear();
        let (t0, t1) = (method.t_old(), method.t());
        for i in 0..self.events.len() {
            let (before, value) = (self.values[i], watched.value(i, t1, method.x().as_ref()));
            if value.is_nan() {
                return Err(Status::Diverged);
            }
            let (old, new) = (self.signs[i], sign(value));
            self.values[i] = value;
            self.signs[i] = new;
            let wanted = old != 0.0 && new != old && (self.events[i].direction == 0.0 || self.events[i].direction * old < 0.0);
            if wanted {
                let at = &mut self.at;
                let g = |t: f64| {
                    method.interpolate(system, t, at);
                    watched.value(i, t, at.as_ref())
                };
                let t = if value == 0.0 { t1 } else { crossing(g, (t0, before), (t1, value)) };
                self.crossings.push(Crossing { index: i, t, stops: false });
            }
        }
        self.crossings.sort_by(|a, b| a.t.total_cmp(&b.t));
        let mut end = None;
        for k in 0..self.crossings.len() {
            let crossing = &mut self.crossings[k];
            // The event that ends the run does not remove other crossings at exactly the same time.
            if end.is_some_and(|end| crossing.t > end) {
                self.crossings.truncate(k);
                break;
            }
            let i = crossing.index;
            self.counts[i] += 1;
            crossing.stops = self.events[i].stop_after > 0 && self.counts[i] >= self.events[i].stop_after;
            if crossing.stops {
                end = Some(crossing.t);
            }
        }
        Ok(end)
    }
}

/// A predicted minimum above this fraction of the smallest known value is not searched.
const LOW: f64 = 0.5;
/// The largest number of evaluations of a search for a negative value.
const DIPS: usize = 4;

/// Return a point `(t, g(t))` with a negative value between three points with positive values; `None` if none is found. `points`: three
/// pairs `(t, g(t))` in order of time. The minimum of the parabola through three points is the next point.
pub fn dip(mut g: impl FnMut(f64) -> f64, mut points: [(f64, f64); 3]) -> Option<(f64, f64)> {
    for _ in 0..DIPS {
        let [a, b, c] = points;
        let slopes = ((b.1 - a.1) / (b.0 - a.0), (c.1 - b.1) / (c.0 - b.0));
        let bend = (slopes.1 - slopes.0) / (c.0 - a.0);
        let t = 0.5 * (a.0 + b.0) - 0.5 * slopes.0 / bend;
        // For points on a line, `t` is not finite.
        if !(bend > 0.0 && t > a.0 && t < c.0 && t != b.0) {
            return None;
        }
        let least = a.1 + (slopes.0 + bend * (t - b.0)) * (t - a.0);
        if least > LOW * a.1.min(b.1).min(c.1) {
            return None;
        }
        let new = (t, g(t));
        if new.1 < 0.0 {
            return Some(new);
        }
        points = match (t < b.0, new.1 < b.1) {
            (true, true) => [a, new, b],
            (true, false) => [new, b, c],
            (false, true) => [b, new, c],
            (false, false) => [a, b, new],
        };
    }
    None
}

/// Return a root of `g` between `a` and `b`, which are pairs `(t, g(t))` with opposite signs. If `g` has no value that is exactly zero,
/// return the later of two adjacent numbers between which the sign changes.
pub fn crossing(mut g: impl FnMut(f64) -> f64, a: (f64, f64), b: (f64, f64)) -> f64 {
    // In the loop, `a` is the newest point, `b` is on the other side of the root, and `c` is the end that left the bracket last.
    let (mut a, mut b) = (b, a);
    let mut c;
    let mut part = 0.5;
    // Bisection alone needs about 52 evaluations, or more for a root near `t = 0`. The limit also ends the loop for NaN.
    for _ in 0..200 {
        let middle = a.0 + part * (b.0 - a.0);
        let inside = |t: f64| (t > a.0 && t < b.0) || (t > b.0 && t < a.0);
        let mut t = middle;
        if !inside(t) {
            t = 0.5 * a.0 + 0.5 * b.0;
            if !inside(t) {
                break;
            }
        }
        let value = g(t);
        if (value > 0.0) == (a.1 > 0.0) && value != 0.0 {
            c = a;
        } else {
            c = b;
            b = a;
        }
        a = (t, value);
        if value == 0.0 {
            return t;
        }
        let width = (b.0 - a.0).abs();
        let least = (2.0 * f64::EPSILON * a.0.abs() / width).min(0.5);
        let (xi, phi) = ((a.0 - b.0) / (c.0 - b.0), (a.1 - b.1) / (c.1 - b.1));
        part = if phi * phi < xi && (1.0 - phi) * (1.0 - phi) < 1.0 - xi {
            a.1 / (b.1 - a.1) * c.1 / (b.1 - c.1) + (c.0 - a.0) / (b.0 - a.0) * a.1 / (c.1 - a.1) * b.1 / (c.1 - b.1)
        } else {
            0.5
        };
        // The next point keeps a distance from both ends. NaN is replaced by the middle.
        part = if part.is_nan() { 0.5 } else { part.clamp(least, 1.0 - least) };
    }
    a.0.max(b.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roots_are_found_to_the_last_bit() {
        let mut calls = 0;
        for (g, root) in [
            (&(|t: f64| t * t - 2.0) as &dyn Fn(f64) -> f64, 2f64.sqrt()),
            (&|t: f64| (t - 1.3).powi(3), 1.3),
            (&|t: f64| if t < 1.7 { -1.0 } else { 1e-300 }, 1.7),
            (&|t: f64| (20.0 * (t - 1.1)).tanh() * 1e20, 1.1),
        ] {
            let counted = |t: f64| {
                calls += 1;
                g(t)
            };
            let t = crossing(counted, (1.0, g(1.0)), (2.0, g(2.0)));
            // `t` is the later end of the bracket, whose ends are adjacent numbers.
            assert!((t - root).abs() <= 2.0 * f64::EPSILON * root || g(t) == 0.0, "{t} {root}");
            assert!(g(t) >= 0.0);
        }
        // Bisection alone would take 52 evaluations per root.
        assert!(calls < 160, "{calls}");
    }

    #[test]
    fn a_function_that_is_nan_ends() {
        assert!(crossing(|_| f64::NAN, (0.0, -1.0), (1.0, 1.0)).is_finite());
    }
}
