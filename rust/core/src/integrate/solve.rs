//! Runs a method from `t0` to `t_end`. Results are states at requested times, events, and the polynomials of the steps.
//!
//! A polynomial of degree `d` is represented by its values at the `d + 1` Chebyshev points of the second kind in its step,
//! `t_k = t_old + (1 - cos(pi k / d))/2 (t - t_old)`. Barycentric interpolation evaluates it (Berrut and Trefethen 2004).

use super::events::{Event, Watch, Watched};
use super::{Adaptive, Buffer, System, Work};
use crate::status::Status;

/// Receives the results of a run during the run.
///
/// ```
/// use armlet_core::integrate::solve::Recorder;
///
/// /// The largest value of the first component.
/// struct Largest(f64);
/// impl Recorder for Largest {
///     fn state(&mut self, _: f64, x: &[f64]) {
///         self.0 = self.0.max(x[0]);
///     }
/// }
/// # use armlet_core::integrate::solve::{Request, solve};
/// # use armlet_core::integrate::{Dopri5, Embedded, System, Tolerance};
/// # struct Oscillator;
/// # impl System<f64> for Oscillator {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { (dx[0], dx[1]) = (x[1], -x[0]); }
/// # }
/// # let tolerance = Tolerance { rtol: 1e-9, atol: 1e-12, controlled: 2 };
/// # let mut method = Embedded::<Dopri5, _, _, _>::new(tolerance, [0.0, 2.0], ());
/// # let mut nothing = |_: usize, _: f64, _: &[f64]| 1.0;
/// // `x = 2 sin t` at the requested times.
/// let (mut largest, times) = (Largest(0.0), [0.0, 0.5, 1.0, 1.5, 2.0]);
/// let request = Request { times: Some(&times), ..Request::default() };
/// solve(&mut Oscillator, &mut method, (0.0, 2.0), &request, &mut nothing, &mut largest);
/// assert!((largest.0 - 2.0 * 1.5f64.sin()).abs() < 1e-7);
/// ```
pub trait Recorder {
    /// Receives the state at a requested time. If no times are requested, it receives the states at `t0` and after every step. `t`: time,
    /// s.
    fn state(&mut self, t: f64, x: &[f64]);
    /// Receives a crossing of event `index`, with its time, s, and state.
    fn event(&mut self, _index: usize, _t: f64, _x: &[f64]) {}
    /// Receives the value `x` of the polynomial of the last step, for each Chebyshev point in order. `t` is the time at the end of the
    /// polynomial, s: the end of the step, or the event that ends the run.
    fn node(&mut self, _t: f64, _x: &[f64]) {}
    /// Is called before every step. If the result is `true`, the run ends with [`Status::Interrupted`].
    fn interrupted(&mut self) -> bool {
        false
    }
}

/// The requested results of a run.
///
/// ```
/// use armlet_core::integrate::events::Event;
/// use armlet_core::integrate::solve::{Request, solve};
/// use armlet_core::status::Status;
/// # use armlet_core::integrate::solve::Recorder;
/// # use armlet_core::integrate::{Dopri5, Embedded, System, Tolerance};
/// # struct Fall;
/// # impl System<f64> for Fall {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { (dx[0], dx[1]) = (x[1], -9.81); }
/// # }
/// # struct Nothing;
/// # impl Recorder for Nothing {
/// #     fn state(&mut self, _: f64, _: &[f64]) {}
/// # }
/// # let tolerance = Tolerance { rtol: 1e-9, atol: 1e-12, controlled: 2 };
/// # let mut method = Embedded::<Dopri5, _, _, _>::new(tolerance, [9.81, 0.0], ());
///
/// // A fall from 9.81 m, which ends at the floor after sqrt(2) s.
/// let events = [Event { direction: -1.0, stop_after: 1 }];
/// let request = Request { times: Some(&[]), events: &events, ..Request::default() };
/// let mut height = |_: usize, _: f64, x: &[f64]| x[0];
/// let end = solve(&mut Fall, &mut method, (0.0, 10.0), &request, &mut height, &mut Nothing);
/// assert_eq!(end.status, Status::Event);
/// assert!((end.t - 2f64.sqrt()).abs() < 1e-9);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Request<'a> {
    /// The times of the requested states, s, increasing and within the time span. `None` requests the states at the start and after every
    /// step.
    pub times: Option<&'a [f64]>,
    /// Whether to return the polynomials of the steps.
    pub dense: bool,
    /// The events to locate.
    pub events: &'a [Event],
}

/// The end of a run: its status, its time, and the numbers of its evaluations and steps.
///
/// ```
/// use armlet_core::integrate::solve::{Recorder, Request, SolveOutcome, solve};
/// use armlet_core::status::Status;
/// # use armlet_core::integrate::{Dopri5, Embedded, System, Tolerance};
/// # struct Explosion;
/// # impl System<f64> for Explosion {
/// #     type Input = ();
/// #     fn input(&mut self, _: f64, _: &mut ()) {}
/// #     fn rhs(&mut self, _: &(), x: &[f64], dx: &mut [f64]) { dx[0] = x[0] * x[0]; }
/// # }
/// # struct Nothing;
/// # impl Recorder for Nothing {
/// #     fn state(&mut self, _: f64, _: &[f64]) {}
/// # }
/// # let tolerance = Tolerance { rtol: 1e-6, atol: 1e-9, controlled: 1 };
/// # let mut method = Embedded::<Dopri5, _, _, _>::new(tolerance, [1.0], ());
/// # let mut nothing = |_: usize, _: f64, _: &[f64]| 1.0;
///
/// // The solution `1 / (1 - t)` of `x' = x^2` grows without bound before t = 1 s.
/// let SolveOutcome { status, t, work } =
///     solve(&mut Explosion, &mut method, (0.0, 2.0), &Request::default(), &mut nothing, &mut Nothing);
/// assert!(status != Status::Success && (t - 1.0).abs() < 1e-3);
/// assert!(work.evaluations > work.steps && work.steps > 10);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SolveOutcome {
    /// The reason of the end.
    pub status: Status,
    /// The time at the end, s.
    pub t: f64,
    /// The numbers of evaluations, steps and decompositions of the run.
    pub work: Work,
}

/// The position of Chebyshev point `k` for a polynomial of degree `d`, as a fraction of the step: `(1 - cos(pi k / d))/2`.
pub fn node(k: usize, d: usize) -> f64 {
    0.5 * (1.0 - (std::f64::consts::PI * k as f64 / d as f64).cos())
}

/// Run `method` on `system` from the state stored in `method`. `(t0, t_end)`: time span, s. `watched` evaluates the event functions, and
/// `recorder` receives the results.
pub fn solve<F, B, M, G, R>(
    system: &mut F,
    method: &mut M,
    (t0, t_end): (f64, f64),
    request: &Request<'_>,
    watched: &mut G,
    recorder: &mut R,
) -> SolveOutcome
where
    F: System<f64>,
    B: Buffer<f64>,
    M: Adaptive<f64, F, B> + ?Sized,
    G: Watched,
    R: Recorder,
{
    let mut t = t0;
    let status = run(system, method, (t0, t_end), request, watched, recorder, &mut t).err().unwrap_or(Status::Success);
    SolveOutcome { status, t, work: method.work() }
}

fn run<F, B, M, G, R>(
    system: &mut F,
    method: &mut M,
    (t0, t_end): (f64, f64),
    request: &Request<'_>,
    watched: &mut G,
    recorder: &mut R,
    reached: &mut f64,
) -> Result<(), Status>
where
    F: System<f64>,
    B: Buffer<f64>,
    M: Adaptive<f64, F, B> + ?Sized,
    G: Watched,
    R: Recorder,
{
    let mut watch = Watch::new(request.events.to_vec(), method.x().clone());
    let mut x_t = method.x().clone();
    method.begin(system, t0, t_end, t_end)?;
    watch.begin(watched, t0, method.x().as_ref())?;
    let degree = method.dense_degree();
    // The index of the next requested time.
    let mut next = 0;
    match request.times {
        None => recorder.state(t0, method.x().as_ref()),
        Some(times) => {
            while next < times.len() && times[next] <= t0 {
                recorder.state(t0, method.x().as_ref());
                next += 1;
            }
        }
    }
    while *reached < t_end {
        if recorder.interrupted() {
            return Err(Status::Interrupted);
        }
        let done = method.step(system)?;
        let stop = if request.events.is_empty() { None } else { watch.scan(system, method, watched)? };
        for crossing in &watch.crossings {
            method.interpolate(system, crossing.t, &mut x_t);
            recorder.event(crossing.index, crossing.t, x_t.as_ref());
        }
        let (t_old, t) = (method.t_old(), stop.unwrap_or(method.t()));
        *reached = t;
        if request.dense {
            for k in 0..=degree {
                let t_k = if k == degree { t } else { t_old + node(k, degree) * (t - t_old) };
                method.interpolate(system, t_k, &mut x_t);
                recorder.node(t, x_t.as_ref());
            }
        }
        match request.times {
            None => {
                method.interpolate(system, t, &mut x_t);
                recorder.state(t, x_t.as_ref());
            }
            Some(times) => {
                while next < times.len() && times[next] <= t {
                    method.interpolate(system, times[next], &mut x_t);
                    recorder.state(times[next], x_t.as_ref());
                    next += 1;
                }
            }
        }
        if stop.is_some() {
            return Err(Status::Event);
        }
        if done {
            break;
        }
    }
    Ok(())
}
