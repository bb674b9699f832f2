//! The places of the quantities of a recorded loop in a frame.

/// All places and sizes are in slots.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout {
    /// The numbers of the set-up come first.
    pub given: usize,
    /// Numbers of the desired motions at one instant, and of the wrench behind them: none without a force.
    pub desired: usize,
    pub wrench: usize,
    /// The instants of a step at which the exogenous input is taken, as parts of the step.
    pub instants: &'static [f64],
    pub states: usize,
    /// The number of metrics in the state, and how many of them every step updates.
    pub kept: usize,
    pub lasting: usize,
    pub inputs: usize,
    /// The number of results of the law besides the plant's input.
    pub answer: usize,
    /// One if the law reports whether its result is valid, else none.
    pub guards: usize,
    /// The number of reference values of the monitors, from the first record, and the size of a record without the state. Zero without
    /// records.
    pub firsts: usize,
    pub noted: usize,
    /// The number of norms of levels, which are last in a record.
    pub norms: usize,
    /// All inputs of the programs.
    pub all_inputs: usize,
    /// The exogenous input is the same for all lanes.
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
    /// Numbers of a state with those that it carries.
    pub fn carried(&self) -> usize {
        self.states + self.kept
    }
    pub fn tau(&self) -> usize {
        self.step() + 1
    }
    pub fn law_rate(&self) -> usize {
        self.tau() + self.inputs
    }
    /// The slot that is one as long as the law's results are valid, else zero. A step changes it.
    pub fn stands(&self) -> usize {
        self.law_rate() + self.answer
    }
    /// The reference values of the monitors.
    pub fn firsts(&self) -> usize {
        self.stands() + self.guards
    }
    /// The state and the exogenous input of a stage.
    pub fn stage(&self) -> usize {
        self.firsts() + self.firsts
    }
    pub fn stage_input(&self) -> usize {
        self.stage() + self.states
    }
    /// The slots to which the program of the rates writes. The stored rates of every stage follow.
    pub fn rates(&self) -> usize {
        self.stage_input() + self.exogenous()
    }
    /// The largest angle: the first slot that is not an input.
    pub fn reach(&self) -> usize {
        self.all_inputs
    }
    /// Numbers of the exogenous input at one instant.
    pub fn exogenous(&self) -> usize {
        self.desired + self.wrench
    }
    /// Instants that a step does not have in common with the one before it.
    pub fn new_instants(&self) -> usize {
        self.instants.len() - usize::from(self.ends_at_last())
    }
    /// Whether the last instant of a step is the first one of the next.
    pub fn ends_at_last(&self) -> bool {
        self.instants.len() > 1 && self.instants.last() == Some(&1.0)
    }
    /// The results of a record without the state. At the first record, the reference values of the monitors follow.
    pub fn noted(&self) -> usize {
        self.reach() + 1
    }
    pub fn own_firsts(&self) -> usize {
        self.noted() + self.noted
    }
    /// The slot that is one if the norms of levels in a record are valid, else zero.
    pub fn noted_stands(&self) -> usize {
        self.own_firsts() + self.firsts
    }
    pub fn slots(&self) -> usize {
        self.noted_stands() + usize::from(self.norms > 0)
    }
}
