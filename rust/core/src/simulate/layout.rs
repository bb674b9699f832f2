//! The slots of a recorded loop in a frame, which is the memory of its programs. A slot has one number per lane. Slots follow one another
//! in the order of the functions below.

/// The positions and sizes of a recorded loop, in slots.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// The number of loop parameters. Their slots are first.
    pub given: usize,
    /// The size of the desired motions at one instant.
    pub desired: usize,
    /// The size of the wrench at one instant. The wrench follows the motions. Its size is zero without a force.
    pub wrench: usize,
    /// The instants in a step at which the exogenous input is evaluated, as fractions of the step.
    pub instants: &'static [f64],
    pub states: usize,
    /// The number of values that the metrics store between records.
    pub kept: usize,
    /// The number of these values that every step updates. The other values describe only the last record.
    pub lasting: usize,
    pub inputs: usize,
    /// The number of results of the law in addition to the plant's input.
    pub answer: usize,
    /// The number of reference values of the monitors, which are computed at the first record. It is zero without records.
    pub firsts: usize,
    /// The size of a record without the state. It is zero without records.
    pub noted: usize,
    /// The total number of inputs of the programs.
    pub all_inputs: usize,
    /// Whether all lanes have the same exogenous input.
    pub shared: bool,
}

impl Layout {
    pub fn instant(&self, k: usize) -> usize {
        self.given + k * self.exogenous()
    }
    pub fn state(&self) -> usize {
        self.instant(self.instants.len())
    }
    pub fn kept(&self) -> usize {
        self.state() + self.states
    }
    pub fn step(&self) -> usize {
        self.kept() + self.kept
    }
    /// The size of the state including the stored numbers of the metrics.
    pub fn carried(&self) -> usize {
        self.states + self.kept
    }
    pub fn tau(&self) -> usize {
        self.step() + 1
    }
    pub fn law_rate(&self) -> usize {
        self.tau() + self.inputs
    }
    /// The first slot of the reference values of the monitors.
    pub fn firsts(&self) -> usize {
        self.law_rate() + self.answer
    }
    /// The first slot of the state of a stage. The exogenous input of the stage follows.
    pub fn stage(&self) -> usize {
        self.firsts() + self.firsts
    }
    pub fn stage_input(&self) -> usize {
        self.stage() + self.states
    }
    /// The first slot to which the program of the rates writes the rates of one stage. The rates of all stages follow.
    pub fn rates(&self) -> usize {
        self.stage_input() + self.exogenous()
    }
    /// The slot of the largest angle so far, rad. It is the first slot that is not an input.
    pub fn reach(&self) -> usize {
        self.all_inputs
    }
    /// The size of the exogenous input at one instant.
    pub fn exogenous(&self) -> usize {
        self.desired + self.wrench
    }
    /// The number of instants of a step that are not also instants of the previous step.
    pub fn new_instants(&self) -> usize {
        self.instants.len() - usize::from(self.ends_at_last())
    }
    /// Whether the last instant of a step is the first instant of the next step.
    pub fn ends_at_last(&self) -> bool {
        self.instants.len() > 1 && self.instants.last() == Some(&1.0)
    }
    /// The first slot of the numbers of a record, without the state.
    pub fn noted(&self) -> usize {
        self.reach() + 1
    }
    /// The first slot to which the program of the records writes the reference values of the monitors. They are used only at the first
    /// record.
    pub fn own_firsts(&self) -> usize {
        self.noted() + self.noted
    }
    pub fn slots(&self) -> usize {
        self.own_firsts() + self.firsts
    }
}

/// The slots of a loop's quantities in a frame. The loop parameters are first, then the desired motions. The other quantities follow in
/// the order of the functions below.
#[derive(Clone, Debug, PartialEq)]
pub struct Slots {
    pub given: usize,
    /// The size of the desired motions.
    pub desired: usize,
    /// The size of the wrench. It is zero without a force.
    pub wrench: usize,
    /// The number of states of the plant.
    pub plant: usize,
    /// The number of states of the law.
    pub law: usize,
    pub quadratures: usize,
    /// The number of the plant's inputs.
    pub inputs: usize,
    /// The number of the law's results without the plant's input.
    pub answer: usize,
    /// The number of modes that are inputs: two for each contact, then one for each joint that sticks and slips.
    pub modes: usize,
    /// The number of joints that stick and slip.
    pub sides: usize,
    /// The index in the state of the first speed of these joints.
    pub speeds: usize,
}

impl Slots {
    pub fn wrench(&self) -> usize {
        self.given + self.desired
    }
    pub fn state(&self) -> usize {
        self.wrench() + self.wrench
    }
    pub fn states(&self) -> usize {
        self.plant + self.law + self.quadratures
    }
    /// The first slot of the held input. The held rate of the law's state follows.
    pub fn tau(&self) -> usize {
        self.state() + self.states()
    }
    pub fn law_rate(&self) -> usize {
        self.tau() + self.inputs
    }
    /// The first slot of the modes.
    pub fn modes(&self) -> usize {
        self.law_rate() + self.answer
    }
    /// The number of modes of contacts.
    pub fn contact_modes(&self) -> usize {
        self.modes - self.sides
    }
    /// The first slot of the rates of one run, after all inputs.
    pub fn rates(&self) -> usize {
        self.modes() + self.modes
    }
    /// The slot of the largest angle of one run.
    pub fn reach(&self) -> usize {
        self.rates() + self.states()
    }
}
