//! The slots of a recorded loop in a frame, which is the memory of its programs. The names of the groups are the names of a listing.

use crate::simulate::closed_loop::ClosedLoop;
use crate::simulate::problem::sampling::Parts;
use crate::simulate::sampled::frame_controller::ControllerSlots;
use crate::trace::{Signature, Slots};

/// The exogenous input at one instant: the desired motions, then the wrench. Without a force, the wrench has no slots.
#[derive(Clone, Copy, Debug)]
pub struct Instant {
    pub slots: Slots,
    /// The size of the desired motions.
    pub desired: usize,
}

impl Instant {
    pub fn add(signature: &mut Signature, [motions, force]: [&'static str; 2], [desired, wrench]: [usize; 2]) -> Self {
        let first = signature.input(motions, desired).first;
        signature.input(force, wrench);
        Instant { slots: Slots { first, count: desired + wrench }, desired }
    }

    /// The sizes of the desired motions and of the wrench.
    pub fn sizes(self) -> [usize; 2] {
        [self.desired, self.slots.count - self.desired]
    }
}

/// The slots of a recorded step.
#[derive(Clone, Debug)]
pub struct StepSlots {
    pub signature: Signature,
    /// The instants in a step at which the exogenous input is evaluated, as fractions of the step.
    pub instants: &'static [f64],
    /// Whether all lanes have the same exogenous input.
    pub shared: bool,
    /// The exogenous input at the first instant. The other instants follow.
    pub exogenous: Instant,
    pub state: Slots,
    /// The values that the metrics store between records. They follow the state.
    pub metrics: Slots,
    /// The number of these values that every step updates. The other values describe only the last record.
    pub lasting: usize,
    pub step: usize,
    pub tau: Slots,
    /// The results of the law in addition to the plant's input.
    pub law_rate: Slots,
    /// The first result in `law_rate` to which the programs add the plant's input, if the plant's input may differ from the law's output.
    pub torque_states: Option<usize>,
    /// The sampled controller.
    pub controller: ControllerSlots,
    /// The speeds of joints that stick and slip. There are none without stick-slip friction.
    pub sliding: Slots,
    /// The modes of these joints, followed by a number that is 1 if the decision about them has ended.
    pub modes: Slots,
    /// The reference values of the monitors, which are computed at the first record. There are none without records.
    pub reference: Slots,
    /// The state of a stage, and its exogenous input.
    pub stage: Slots,
    pub stage_input: Instant,
    /// The rates of one stage, to which the program of the rates writes. The rates of all stages follow.
    pub rates: Slots,
    /// The numbers of a record without the state.
    pub record: Slots,
    /// The reference values of the monitors, to which the program of the records writes. They are used only at the first record.
    pub own_reference: Slots,
}

impl StepSlots {
    /// Return the slots of the inputs of a step of `closed`, whose metrics store `metrics` numbers, and whose monitors have `reference`
    /// reference values. [`StepSlots::end`] adds the slots of the results.
    pub fn new(
        mut signature: Signature,
        closed: &ClosedLoop,
        (wrench, instants, shared): (usize, &'static [f64], bool),
        (seen, parts, torque_states, sliding): (usize, Parts, Option<usize>, Slots),
        ((metrics, lasting), reference): ((usize, usize), usize),
    ) -> Self {
        let instant = |signature: &mut Signature| Instant::add(signature, ["desired", "force"], [closed.desired(), wrench]);
        let exogenous = instant(&mut signature);
        instants[1..].iter().for_each(|_| _ = instant(&mut signature));
        let mut input = |name, count| signature.input(name, count);
        let state = input("state", closed.size());
        let metrics = input("sum", metrics);
        let step = input("h", 1).first;
        let (tau, law_rate) = (input("tau", closed.tau.len()), input("answer", closed.law_rate().len()));
        let mut if_any = |name, count, any: bool| input(name, if any { count } else { 0 });
        let measured = if_any("measured", seen, parts.measures);
        let output = if_any("output", tau.count, parts.delays);
        let output = if parts.delays { output } else { tau };
        let change = if_any("change", 1, parts.limits_rate);
        let controller = ControllerSlots { state: state.part(0, measured.count), measured, change, output, tau, others: law_rate };
        let modes = input("mode", sliding.count + sliding.count.min(1));
        let reference = input("reference", reference);
        let stage = input("stage_state", closed.size());
        let stage_input = Instant::add(&mut signature, ["stage_desired", "stage_force"], exogenous.sizes());
        let rates = signature.input("rates", closed.size());
        let (record, own_reference) = Default::default();
        StepSlots {
            signature,
            instants,
            shared,
            exogenous,
            state,
            metrics,
            lasting,
            step,
            tau,
            law_rate,
            torque_states,
            controller,
            sliding: state.part(sliding.first, sliding.count),
            modes,
            reference,
            stage,
            stage_input,
            rates,
            record,
            own_reference,
        }
    }

    /// Add the rates of `stages` separate stages, and the results: `record` numbers of a record, and the reference values.
    pub fn end(&mut self, stages: usize, record: usize) {
        (0..stages).for_each(|_| _ = self.signature.input("rates", self.rates.count));
        self.record = self.signature.output("record", record);
        self.own_reference = self.signature.output("reference", self.reference.count);
    }

    /// The state with the stored numbers of the metrics.
    pub fn carried(&self) -> Slots {
        self.state.part(0, self.state.count + self.metrics.count)
    }

    /// Pair the slots of the law's results with recorded operations: the output of the controller, then the other results.
    pub fn law_outputs(&self, results: &[u32]) -> Vec<(u32, u32)> {
        let (output, others) = results.split_at(results.len().min(self.tau.count));
        [self.controller.output.outputs(output), self.law_rate.outputs(others)].concat()
    }

    /// The number of instants of a step that are not also instants of the previous step.
    pub fn new_instants(&self) -> usize {
        self.instants.len() - usize::from(self.ends_at_last())
    }

    /// Whether the last instant of a step is the first instant of the next step.
    pub fn ends_at_last(&self) -> bool {
        self.instants.len() > 1 && self.instants.last() == Some(&1.0)
    }
}

/// The slots of the rates of a loop.
#[derive(Clone, Debug)]
pub struct RatesSlots {
    pub signature: Signature,
    pub exogenous: Instant,
    /// The states of the plant, of the law, and the integrals of the monitors.
    pub state: Slots,
    /// The numbers of states of the plant and of the law.
    pub plant: usize,
    pub law: usize,
    /// The held input, and the held rate of the law's state.
    pub tau: Slots,
    pub law_rate: Slots,
    /// The modes of contacts, two for each contact, and the modes of joints that stick and slip.
    pub contacts: Slots,
    pub sides: Slots,
    /// The rates, the law's results, the depths and pushes of contacts, the margins and the loads of joints.
    pub results: [Slots; 5],
}

impl RatesSlots {
    /// Return the slots of the inputs of the rates of `closed`. The results are added after the recording. The plant and the law have `plant` and `law` states. `modes` are the numbers
    /// of modes of contacts and of joints.
    pub fn new(
        mut signature: Signature,
        closed: &ClosedLoop,
        wrench: usize,
        [plant, law]: [usize; 2],
        [contacts, sides]: [usize; 2],
    ) -> Self {
        let exogenous = Instant::add(&mut signature, ["desired", "force"], [closed.desired(), wrench]);
        let mut input = |name, count| signature.input(name, count);
        let state = input("state", closed.size());
        let (tau, law_rate) = (input("tau", closed.tau.len()), input("answer", closed.law_rate().len()));
        let (contacts, sides) = (input("contact", contacts), input("side", sides));
        RatesSlots { signature, exogenous, state, plant, law, tau, law_rate, contacts, sides, results: Default::default() }
    }

    /// The held results of the law and the modes.
    pub fn held(&self) -> Slots {
        self.tau.part(0, self.sides.end() - self.tau.first)
    }
}
