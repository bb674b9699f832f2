//! Observation of runs of adaptive methods: changes of contacts, joints that stick and slip, and events of the user. The observer also
//! stores the polynomials of the steps.
//!
//! If a contact changes in a step, the step is repeated up to the change. So the mode of each contact is constant in a step, and the state
//! rates have no corner.
//!
//! Guards of the contacts and joints, and event functions, are evaluated at four times of every step. Two changes of sign between two of
//! these times cancel. A parabola through three successive values predicts such a dip, which is then searched.

use super::contacts::Switching;
use super::rates_loop::RatesLoop;
use super::segments::Cut;
use crate::integrate::Adaptive;
use crate::integrate::events::{crossing, dip};
use crate::integrate::solve::node;
use crate::memory;
use crate::plant::{PlantSpec, Touch};
use crate::scalar::sign;
use crate::simulate::observer::probe::Probe;
use crate::simulate::observer::run_observer::{Guard, RunObserver};
use crate::status::Status;

/// The number of evaluations of each function per step.
const CHECKS_PER_STEP: usize = 4;
/// After this number of successive mode changes at practically the same time, the whole step is accepted.
const MOST_SWITCHES: usize = 8;
const PROGRESS: f64 = 1e-14;

/// The last evaluations of an event function.
#[derive(Clone, Copy, Debug, Default)]
struct LastValue {
    /// The sign of `value`: -1, 0 or 1.
    sign: f64,
    value: f64,
    /// The value before `value`.
    earlier: f64,
    /// The end of the last dip to the other sign between two evaluations, s.
    clear: f64,
    count: usize,
}

pub struct StepChecks<'a> {
    switching: Option<Switching>,
    probe: Probe,
    observer: Option<&'a mut RunObserver>,
    events: Vec<LastValue>,
    /// The crossings in the last step: time, s, and index of the event.
    crossed: Vec<(f64, usize)>,
    /// The last values of the guards: first of the contacts, then of the joints that stick and slip. A guard is a function whose change of
    /// sign ends a mode.
    guards: Vec<f64>,
    /// The number of values in `guards` that belong to joints that stick and slip.
    sticking: usize,
    now: Vec<f64>,
    /// The guards before `guards`.
    earlier: Vec<f64>,
    trial: Vec<f64>,
    /// The index of the guard whose change of sign ends the present mode. If it equals the number of guards, all joints with stick-slip
    /// friction are checked.
    switches: usize,
    /// The number of successive mode changes at practically the same time.
    stuck: usize,
    /// The number of states of the plant.
    states: usize,
    /// The number of states of plant and law together.
    width: usize,
    at: Vec<f64>,
}

impl<'a> StepChecks<'a> {
    /// Create the observer. `x` is a state of the loop. Its first `width` numbers are the states of plant and law.
    pub fn new(plant: &PlantSpec, observer: Option<&'a mut RunObserver>, width: usize, x: &[f64]) -> Self {
        let switching = Switching::of(plant);
        let contacts = switching.as_ref().map_or(0, Switching::guards);
        let sticking = plant.sticking_joints();
        StepChecks {
            events: vec![LastValue::default(); observer.as_ref().map_or(0, |observer| observer.events.len())],
            crossed: Vec::with_capacity(observer.as_ref().map_or(0, |observer| 2 * CHECKS_PER_STEP * observer.events.len())),
            switching,
            probe: Probe::new(plant),
            observer,
            guards: vec![0.0; contacts + sticking],
            sticking,
            now: vec![0.0; contacts + sticking],
            earlier: vec![0.0; contacts + sticking],
            trial: vec![0.0; contacts + sticking],
            switches: 0,
            stuck: 0,
            states: plant.states(),
            width,
            at: x.to_vec(),
        }
    }

    /// Determine the modes of the contacts at state `self.at`, and hold the contacts in these modes.
    fn find_contacts(&mut self, system: &mut RatesLoop, t: f64) {
        let Some(switching) = &mut self.switching else { return };
        switching.begin(system, &self.at);
        system.hold_contacts(&switching.touches);
        if let Some(observer) = self.observer.as_deref_mut() {
            observer.store_contacts(t, None, &switching.touches);
        }
    }

    /// Return the time of the first mode change in the last step of `method`, if any.
    fn switch_in<'b, M>(&mut self, system: &mut RatesLoop<'b>, method: &mut M) -> Result<Option<f64>, Status>
    where
        M: Adaptive<f64, RatesLoop<'b>, Vec<f64>>,
    {
        if self.guards.is_empty() {
            return Ok(None);
        }
        let (t0, t1) = (method.t_old(), method.t());
        let (at, now, earlier, trial) = (&mut self.at, &mut self.now, &mut self.earlier, &mut self.trial);
        let (switching, sticking) = (&mut self.switching, self.sticking);
        let contacts = self.guards.len() - sticking;
        let mut evaluate = |system: &mut RatesLoop<'b>, method: &mut M, t: f64, all: &mut [f64]| {
            method.interpolate(system, t, at);
            if let Some(switching) = switching {
                switching.evaluate(system, at, &mut all[..contacts]);
            }
            if sticking > 0 {
                system.margins(t, at, &mut all[contacts..]);
            }
        };
        let mut first: Option<(f64, usize)> = None;
        // The last two times of evaluation.
        let (mut past, mut before) = (t0, t0);
        evaluate(system, method, t0, &mut self.guards);
        for k in 1..=CHECKS_PER_STEP {
            let t = place(k, t0, t1);
            evaluate(system, method, t, now);
            if now.iter().any(|guard| guard.is_nan()) {
                return Err(Status::Diverged);
            }
            for (i, &guard) in now.iter().enumerate() {
                let was = self.guards[i];
                let mut g = |t: f64| {
                    evaluate(system, method, t, trial);
                    trial[i]
                };
                let mut root = None;
                if guard < 0.0 {
                    root = Some(if was > 0.0 { crossing(&mut g, (before, was), (t, guard)) } else { before });
                } else if k > 1 && earlier[i] > 0.0 && was > 0.0 && guard > 0.0 {
                    let known = [(past, earlier[i]), (before, was), (t, guard)];
                    root = dip(&mut g, known).map(|low| crossing(&mut g, if low.0 < before { known[0] } else { known[1] }, low));
                }
                if let Some(root) = root
                    && first.is_none_or(|(earliest, _)| root < earliest)
                {
                    first = Some((root, i));
                }
                (earlier[i], self.guards[i]) = (was, guard);
            }
            if first.is_some() {
                break;
            }
            (past, before) = (before, t);
        }
        let Some((t, i)) = first else {
            self.stuck = 0;
            return Ok(None);
        };
        self.stuck = if t - t0 > PROGRESS * t1 { 0 } else { self.stuck + 1 };
        self.switches = i;
        if self.stuck <= MOST_SWITCHES {
            return Ok(Some(t));
        }
        self.stuck = 0;
        if i >= contacts {
            // Joints undo each other's mode changes at practically the same time. Continue to the end of the step with the present modes.
            self.switches = self.guards.len();
            return Ok(Some(t1));
        }
        // Contacts undo each other's mode changes at practically the same time. Continue with their modes at the end of the step.
        method.interpolate(system, t1, &mut self.at);
        self.find_contacts(system, t1);
        Ok(None)
    }

    /// Record the events up to `t1` in the last step. Return the time of the event that ends the run, if any.
    fn events_in<'b, M>(&mut self, system: &mut RatesLoop<'b>, method: &mut M, t1: f64) -> Result<Option<f64>, Status>
    where
        M: Adaptive<f64, RatesLoop<'b>, Vec<f64>>,
    {
        let Some(observer) = self.observer.as_deref_mut() else { return Ok(None) };
        let events = &observer.events;
        if events.is_empty() {
            return Ok(None);
        }
        let t0 = method.t_old();
        let (at, probe) = (&mut self.at, &mut self.probe);
        let mut value = |i: usize, t: f64| {
            method.interpolate(system, t, at);
            events[i].function.value(probe, t, at)
        };
        // The last two times of evaluation.
        let (mut past, mut before) = (t0, t0);
        self.crossed.clear();
        for k in 1..=CHECKS_PER_STEP {
            let t = place(k, t0, t1);
            for (i, seen) in self.events.iter_mut().enumerate() {
                let g = value(i, t);
                if g.is_nan() {
                    return Err(Status::Diverged);
                }
                let (sign, direction) = (sign(g), events[i].direction);
                if seen.sign != 0.0 && sign != seen.sign && direction * seen.sign <= 0.0 {
                    let root = if g == 0.0 { t } else { crossing(|t| value(i, t), (before, seen.value), (t, g)) };
                    self.crossed.push((root, i));
                }
                if k > 1 && sign != 0.0 && sign == seen.sign && sign * seen.earlier > 0.0 {
                    let known = [(past, seen.earlier), (before, seen.value), (t, g)];
                    if let Some(low) = dip(|t| sign * value(i, t), known.map(|(t, g)| (t, sign * g))).filter(|low| low.0 > seen.clear) {
                        let (low, ends) = ((low.0, sign * low.1), if low.0 < before { [known[0], known[1]] } else { [known[1], known[2]] });
                        let roots = [crossing(|t| value(i, t), ends[0], low), crossing(|t| value(i, t), low, ends[1])];
                        seen.clear = roots[1];
                        for (root, from) in roots.into_iter().zip([sign, -sign]) {
                            if direction * from <= 0.0 {
                                self.crossed.push((root, i));
                            }
                        }
                    }
                }
                (seen.earlier, seen.value, seen.sign) = (seen.value, g, sign);
            }
            (past, before) = (before, t);
        }
        self.crossed.sort_by(|a, b| a.0.total_cmp(&b.0));
        for &(t, i) in &self.crossed {
            self.events[i].count += 1;
            method.interpolate(system, t, &mut self.at);
            observer.store(|observer| observer.crossings.add(i, t, &self.at[..self.states]));
            let events = &observer.events;
            if events[i].stop_after > 0 && self.events[i].count >= events[i].stop_after {
                return Ok(Some(t));
            }
        }
        Ok(None)
    }

    /// Whether the steps must be observed.
    pub fn active(&self) -> bool {
        !self.guards.is_empty() || self.observer.is_some()
    }

    /// Start the observation at time `t`, s, and state `x`, before the first step.
    pub fn begin(&mut self, system: &mut RatesLoop, t: f64, x: &[f64]) -> Result<(), Status> {
        self.at.copy_from_slice(x);
        self.find_contacts(system, t);
        if self.sticking > 0 {
            system.settle(t, x, None);
        }
        if let Some(observer) = &self.observer {
            for (event, seen) in observer.events.iter().zip(&mut self.events) {
                seen.value = event.function.value(&mut self.probe, t, &self.at);
                if seen.value.is_nan() {
                    return Err(Status::Diverged);
                }
                seen.sign = sign(seen.value);
            }
        }
        Ok(())
    }

    /// Check the step that `method` has just accepted. The result is the time to which the step must be shortened, with the reason, if any.
    pub fn check_step<'b, M>(&mut self, system: &mut RatesLoop<'b>, method: &mut M) -> Result<Option<Cut>, Status>
    where
        M: Adaptive<f64, RatesLoop<'b>, Vec<f64>>,
    {
        let switch = self.switch_in(system, method)?;
        let end = self.events_in(system, method, switch.unwrap_or(method.t()))?;
        Ok(end.map(Cut::End).or(switch.map(Cut::Switch)))
    }

    /// Process the accepted step of `method` up to time `t`, s. This function is not called for a step that is repeated.
    pub fn store_step<'b, M>(&mut self, system: &mut RatesLoop<'b>, method: &mut M, t: f64)
    where
        M: Adaptive<f64, RatesLoop<'b>, Vec<f64>>,
    {
        let Some(observer) = self.observer.as_deref_mut() else { return };
        let t0 = method.t_old();
        if t <= t0 {
            return;
        }
        let (degree, at, width) = (method.dense_degree(), &mut self.at, self.width);
        observer.store(|observer| {
            let Some(polynomials) = &mut observer.polynomials else { return Ok(()) };
            polynomials.degree = degree;
            memory::append(&mut polynomials.ends, &[t])?;
            for k in 0..=degree {
                method.interpolate(system, if k == degree { t } else { t0 + node(k, degree) * (t - t0) }, at);
                system.remove_creep(at);
                for x in at.iter().take(width) {
                    memory::append(&mut polynomials.nodes, &[*x])?;
                }
            }
            Ok(())
        });
    }

    /// Process a switch of the system at time `t`, s, and state `x`. The state `x` may be corrected, so that it is exactly at the switch.
    pub fn switch(&mut self, system: &mut RatesLoop, t: f64, x: &mut [f64]) {
        let contacts = self.guards.len() - self.sticking;
        if let Some(joint) = self.switches.checked_sub(contacts).filter(|_| self.sticking > 0) {
            system.switch_joint(t, x, (joint < self.sticking).then_some(joint));
        } else if let Some(switching) = &mut self.switching {
            let (contact, which) = (self.switches / 2, self.switches % 2);
            let by_push = match switching.touches[contact] {
                Touch::Apart => false,
                Touch::Pressed => true,
                Touch::Slack => which == 1,
            };
            switching.switch(system, self.switches, x);
            system.hold_contacts(&switching.touches);
            if let Some(observer) = self.observer.as_deref_mut() {
                observer.store_contacts(t, Some(Guard { contact, by_push }), &switching.touches);
            }
        }
    }
}

/// Return the time of evaluation `k` in a step from `t0` to `t1`.
fn place(k: usize, t0: f64, t1: f64) -> f64 {
    if k == CHECKS_PER_STEP { t1 } else { t0 + k as f64 / CHECKS_PER_STEP as f64 * (t1 - t0) }
}
