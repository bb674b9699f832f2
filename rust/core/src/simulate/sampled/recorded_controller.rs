//! The controller of a recorded loop: the law with the measured state, and the limited rate of its output.

use super::frame_controller::ControllerSlots;
use crate::scalar::Real;
use crate::simulate::closed_loop::ClosedLoop;
use crate::simulate::world::Exogenous;
use crate::trace::Sym;

/// The controller of a loop. Without sampling, its output is the law's output.
pub struct Controller {
    /// The measured state of the plant. Empty if the law receives the exact state.
    measured: Vec<Sym>,
    /// The output that acts, if outputs are delayed.
    delayed: Option<Vec<Sym>>,
    /// The output at the previous sample, and its largest change. `None` without a limit.
    limit: Option<(Vec<Sym>, Sym)>,
    /// The first result of the law that contains its output, if another output may act.
    torque_states: Option<usize>,
}

impl Controller {
    /// Declare the inputs of a controller. `tau` is the plant's input.
    pub fn declare(slots: &ControllerSlots, tau: &[Sym], torque_states: Option<usize>) -> Self {
        let measured = slots.measured.declare();
        let delayed = slots.output != slots.tau;
        let output = if delayed { slots.output.declare() } else { tau.to_vec() };
        let limit = slots.change.declare().first().map(|&change| (output, change));
        Controller { measured, delayed: delayed.then(|| tau.to_vec()), limit, torque_states }
    }

    /// Evaluate the law at state `x`. Return the output of the controller, and the other results of the law. These are without the law's
    /// output, if another output may act.
    pub fn sample(&self, closed: &mut ClosedLoop, u: &Exogenous<Sym>, x: &[Sym]) -> [Vec<Sym>; 2] {
        closed.answer(u, &[&self.measured, &x[self.measured.len()..]].concat());
        let (mut tau, mut others) = (closed.tau.clone(), closed.law_rate().to_vec());
        if let Some(first) = self.torque_states {
            others[first..].iter_mut().zip(&tau).for_each(|(rate, &tau)| *rate -= tau);
        }
        if let Some((last, change)) = &self.limit {
            tau.iter_mut().zip(last).for_each(|(tau, &last)| *tau = tau.clamped(last - *change, last + *change));
        }
        [tau, others]
    }

    /// The output that acts in the step after a sample with these results.
    pub fn acting<'a>(&'a self, [output, _]: &'a [Vec<Sym>; 2]) -> &'a [Sym] {
        self.delayed.as_ref().unwrap_or(output)
    }

    /// Hold the results of a sample.
    pub fn hold(&self, closed: &mut ClosedLoop, results: &[Vec<Sym>; 2]) {
        let (tau, mut dz) = (self.acting(results), results[1].clone());
        if let Some(first) = self.torque_states {
            dz[first..].iter_mut().zip(tau).for_each(|(rate, &tau)| *rate += tau);
        }
        closed.hold_input(tau, &dz);
    }
}
