//! The programs (recorded and compiled computations) of the state rates of one run, with their frames, which are their memory.

use super::attempt_programs::write;
use super::layout::Slots;
use super::rates_programs::{GuardProgram, RatesPrograms, RecordedRates};
use super::world::Exogenous;
use crate::integrate::{Attempt, Buffer};
use crate::scalar::Real;
use crate::scalar::trig::REDUCTION_LIMIT;
use crate::trace::{Frame, Program, form};
use std::sync::Arc;

pub struct Running<S> {
    recorded: Arc<RecordedRates>,
    frame: Frame,
    /// The frame of the program of whole attempts.
    attempt: Option<Frame>,
    /// The frame of the programs of derivatives.
    lanes: Option<Frame>,
    /// The exogenous input and its time derivative at the time of a linearisation. An attempt uses the first element as memory for the
    /// inputs of its stages.
    instants: [Exogenous<S>; 2],
    /// The derivative of the rates with respect to time, from the last linearisation.
    dft: Vec<S>,
    /// The mode of each joint that sticks and slips.
    sides: Vec<i8>,
    /// Memory for the margins of these joints.
    margins: Vec<f64>,
}

impl<S: Real> Running<S> {
    /// Create the frames for a run with the loop parameters `values`.
    pub fn new(recorded: Arc<RecordedRates>, values: &[f64]) -> Self {
        let (slots, programs) = (&recorded.slots, &recorded.programs);
        let frame = |slots: usize, lanes: usize, programs: &mut dyn Iterator<Item = &Program>| {
            let mut frame = Frame::new(slots, lanes);
            programs.for_each(|program| program.prepare(&mut frame));
            values.iter().enumerate().for_each(|(slot, &x)| frame.fill(slot, x));
            frame
        };
        let still = Exogenous { t: f64::NAN, desired: vec![S::zero(); slots.desired], wrench: [S::zero(); 6] };
        let guards = || programs.contacts.iter().chain(&programs.margins).map(|guards| &guards.program);
        let of_one_run = || std::iter::once(&programs.rates).chain(guards());
        let single = frame(of_one_run().map(Program::slots).max().unwrap_or(0), 1, &mut of_one_run());
        let lanes = programs.derivatives.as_ref().map(|all| frame(all.slots(), form(true).lanes(), &mut all.all()));
        let attempt = programs.attempt.as_ref().map(|attempt| attempt.frame(values));
        Running {
            frame: single,
            attempt,
            lanes,
            instants: [still.clone(), still],
            dft: vec![S::zero(); slots.states()],
            sides: vec![0; slots.sides],
            margins: vec![0.0; slots.sides],
            recorded,
        }
    }

    /// Hold the input `tau` of the plant and the rate `dz` of the law's state.
    pub fn hold(&mut self, tau: &[S], dz: &[S]) {
        let slots = &self.recorded.slots;
        for frame in [&mut self.frame].into_iter().chain(&mut self.lanes) {
            write(frame, slots.tau(), tau);
            write(frame, slots.law_rate(), dz);
        }
        if let (Some(program), Some(frame)) = (&self.recorded.programs.attempt, &mut self.attempt) {
            program.hold(frame, tau, dz);
        }
    }

    /// The number of modes of contacts that the programs read.
    pub fn contact_modes(&self) -> usize {
        self.recorded.slots.contact_modes()
    }

    /// Hold the contacts in the modes of the numbers `modes`, two for each contact.
    pub fn hold_contacts(&mut self, modes: &[f64]) {
        self.write_modes(0, &modes[..self.contact_modes().min(modes.len())]);
    }

    /// Whether joints stick and slip.
    pub fn sticks(&self) -> bool {
        !self.sides.is_empty()
    }

    /// Hold the joints in the modes `sides`: 0 for a stuck joint, else the direction of sliding.
    pub fn hold_sides(&mut self, sides: &[i8]) {
        for (i, &side) in sides.iter().enumerate() {
            self.sides[i] = side;
            self.write_modes(self.contact_modes() + i, &[f64::from(side)]);
        }
    }

    fn write_modes(&mut self, first: usize, modes: &[f64]) {
        for frame in [&mut self.frame].into_iter().chain(&mut self.lanes) {
            write(frame, self.recorded.slots.modes() + first, modes);
        }
        if let (Some(program), Some(frame)) = (&self.recorded.programs.attempt, &mut self.attempt) {
            program.write_modes(frame, first, modes);
        }
    }

    /// Compute an attempt, which is one trial of a step with all its stages. Return whether the result is valid, or `None` if no program
    /// exists. `input(t, u)` writes the exogenous input.
    pub fn attempt<B: Buffer<S>>(&mut self, attempt: &mut Attempt<S, B>, input: impl FnMut(f64, &mut Exogenous<S>)) -> Option<bool> {
        let (Some(program), Some(frame)) = (&self.recorded.programs.attempt, &mut self.attempt) else { return None };
        Some(program.run(frame, attempt, (&mut self.instants[0], input)))
    }

    /// Compute the rates of state `x`, write them to `dx`, and return whether they are valid.
    pub fn rates(&mut self, u: &Exogenous<S>, x: &[S], dx: &mut [S]) -> bool {
        let RecordedRates { slots, programs, .. } = &*self.recorded;
        let frame = &mut self.frame;
        write_input(frame, slots, u);
        write(frame, slots.state(), x);
        frame.fill(slots.reach(), 0.0);
        programs.rates.run(frame);
        let rates = &frame.numbers()[slots.rates()..][..dx.len()];
        dx.iter_mut().zip(rates).for_each(|(to, &from)| *to = S::splat(from));
        frame.numbers()[slots.reach()] < REDUCTION_LIMIT
    }

    /// Write the depth and the push of each contact at state `x` to `out`. Return whether they are valid. Without a program, they are not.
    pub fn contacts(&mut self, x: &[S], out: &mut [f64]) -> bool {
        let RecordedRates { slots, programs } = &*self.recorded;
        programs.contacts.as_ref().is_some_and(|contacts| guards(contacts, &mut self.frame, slots, x, out))
    }

    /// Write the margin of each joint that sticks and slips at state `x` to `out`. `input` computes the exogenous input. Return whether the
    /// margins are valid. Without a program, they are not.
    pub fn margins(&mut self, x: &[S], input: impl FnOnce(&mut Exogenous<S>), out: &mut [f64]) -> bool {
        let RecordedRates { slots, programs } = &*self.recorded;
        let Some(margins) = &programs.margins else { return false };
        let [u, _] = &mut self.instants;
        input(u);
        write_input(&mut self.frame, slots, u);
        guards(margins, &mut self.frame, slots, x, out)
    }

    /// Whether all joints certainly stay in their modes at state `x`. Sliding joints then move to their side, and the torques of stuck joints
    /// are within the static friction. `input` computes the exogenous input.
    pub fn stays(&mut self, x: &[S], input: impl FnOnce(&mut Exogenous<S>)) -> bool {
        let speeds = &x[self.recorded.slots.speeds..];
        let moves = |(&side, v): (&i8, &S)| if side == 0 { v.lane(0) == 0.0 } else { f64::from(side) * v.lane(0) > 0.0 };
        if !self.sides.iter().zip(speeds).all(moves) {
            return false;
        }
        let mut margins = std::mem::take(&mut self.margins);
        let valid = !self.sides.contains(&0) || self.margins(x, input, &mut margins);
        let stays = valid && self.sides.iter().zip(&margins).all(|(&side, &margin)| side != 0 || margin >= 0.0);
        self.margins = margins;
        stays
    }

    /// Whether [`Running::linearise`] requires the time derivative of the exogenous input.
    pub fn is_moving(&self) -> bool {
        self.recorded.programs.derivatives.as_ref().is_some_and(|derivatives| derivatives.moves)
    }

    /// The memory of the exogenous input and its time derivative.
    pub fn instants(&mut self) -> &mut [Exogenous<S>; 2] {
        &mut self.instants
    }

    /// Write the rates of state `x` to `dx`, and their Jacobian with respect to `x` to `j`, shape `(n, n)`, row-major. Afterwards,
    /// [`Running::time_derivative`] returns the derivative with respect to time. Return whether the results are valid.
    pub fn linearise(&mut self, u: &Exogenous<S>, x: &[S], dx: &mut [S], j: &mut [S]) -> bool {
        let RecordedRates { slots, programs, .. } = &*self.recorded;
        let (RatesPrograms { derivatives: Some(all), .. }, Some(frame)) = (programs, &mut self.lanes) else { return false };
        write_input(frame, slots, u);
        write(frame, slots.state(), x);
        frame.fill(all.reach, 0.0);
        all.values.run(frame);
        read(frame, all.rates, 0, dx.iter_mut());
        if !(frame.slot_mut(all.reach)[0] < REDUCTION_LIMIT) {
            return false;
        }
        let n = x.len();
        j.fill(S::zero());
        let [_, u_dot] = &self.instants;
        let drift = || u_dot.desired.iter().chain(&u_dot.wrench[..slots.wrench]);
        // Each lane has one direction of differentiation. Time is the last direction of the plant's program.
        let mut along = |program: &Program, seeds: usize, column: usize, count: usize, moves: bool| {
            let directions = count + usize::from(moves);
            for first in (0..directions).step_by(frame.lanes()) {
                let width = frame.lanes().min(directions - first);
                for (lane, k) in (first..first + width).enumerate() {
                    if k < count {
                        frame.slot_mut(seeds + k)[lane] = 1.0;
                    } else {
                        drift().enumerate().for_each(|(i, rate)| frame.slot_mut(seeds + count + i)[lane] = rate.lane(0));
                    }
                }
                program.run(frame);
                for (lane, k) in (first..first + width).enumerate() {
                    if k < count {
                        frame.fill(seeds + k, 0.0);
                        read(frame, all.derivatives, lane, j[column + k..].iter_mut().step_by(n));
                    } else {
                        (0..drift().count()).for_each(|i| frame.fill(seeds + count + i, 0.0));
                        read(frame, all.derivatives, lane, self.dft.iter_mut());
                    }
                }
            }
        };
        along(&all.plant, all.along_plant, 0, slots.plant, all.moves);
        if let Some(law) = &all.law {
            along(law, all.along_law, slots.plant, slots.law, false);
        }
        true
    }

    /// The derivative of the rates with respect to time, from the last linearisation.
    pub fn time_derivative(&self) -> &[S] {
        &self.dft
    }
}

/// Write the exogenous input `u` to a frame.
fn write_input<S: Real>(frame: &mut Frame, slots: &Slots, u: &Exogenous<S>) {
    write(frame, slots.given, &u.desired);
    write(frame, slots.wrench(), &u.wrench[..slots.wrench]);
}

/// Write the functions of `guards` at state `x` to `out`, and return whether they are valid.
fn guards<S: Real>(GuardProgram { program, first }: &GuardProgram, frame: &mut Frame, slots: &Slots, x: &[S], out: &mut [f64]) -> bool {
    write(frame, slots.state(), x);
    frame.fill(slots.reach(), 0.0);
    program.run(frame);
    out.copy_from_slice(&frame.numbers()[*first..][..out.len()]);
    frame.numbers()[slots.reach()] < REDUCTION_LIMIT
}

/// Read `values` from lane `lane` of the slots from `first` on.
fn read<'a, S: Real>(frame: &Frame, first: usize, lane: usize, values: impl Iterator<Item = &'a mut S>) {
    let lanes = frame.lanes();
    let slots = frame.numbers()[first * lanes + lane..].iter().step_by(lanes);
    slots.zip(values).for_each(|(&from, to)| *to = S::splat(from));
}
