//! The interface of a monitor, and its arguments.

use crate::dynamics::ArmAt;
use crate::law::LawSpec;
use crate::plant::{PlantSpec, Power};
use crate::simulate::metrics::gauge::Identities;
use crate::simulate::problem::Problem;
use crate::trace::Sym;

/// A run whose monitors are computed.
pub struct Scope<'p, 'a> {
    pub problem: &'p Problem<'a>,
    pub run: usize,
    pub monitored: Monitored,
}

/// Properties of the monitors that all runs of a problem have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Monitored {
    /// Whether the energy is the law's storage function.
    pub storage: bool,
    /// Whether the target model of an impedance law is monitored.
    pub target: bool,
    /// Whether the projection loss of the law is monitored, see `crate::law::ProjectionLoss`.
    pub loss: bool,
}

impl Monitored {
    /// Return the properties of the monitors of `problem`.
    pub fn of(problem: &Problem) -> Self {
        Monitored { storage: problem.watches_storage(), target: problem.watches_target(), loss: problem.watches_loss() }
    }
}

impl<'a> Scope<'_, 'a> {
    pub fn plant(&self) -> &'a PlantSpec {
        self.problem.plant(self.run)
    }

    pub fn law(&self) -> &'a LawSpec {
        self.problem.law(self.run)
    }
}

/// The quantities of one record from which monitors are computed.
pub struct Moment<'a> {
    /// The law's desired motions, one after another.
    pub desired: &'a [Sym],
    /// The wrench at the frame of the force, N and N m.
    pub wrench: &'a [Sym; 6],
    /// The state of the plant.
    pub x: &'a [Sym],
    /// The state of the law.
    pub z: &'a [Sym],
    /// The input of the plant.
    pub tau: &'a [Sym],
    /// The plant's arm at the position of the record.
    pub arm: &'a mut ArmAt<Sym>,
    /// Skewness, energy and Lyapunov function, with the integrals of the law's dissipation and of the supplied power.
    pub identities: Identities<Sym>,
    /// `E - int P dt` and `V1 + int D dt` at the first record.
    pub first: [Sym; 2],
    /// The projection loss of the law. `None` if it is not monitored.
    pub loss: Option<Sym>,
    /// The monitor's own integrals, from the start to this record.
    pub integrals: &'a [Sym],
}

/// The quantities of a loop from which the rates of the monitors' integrals are computed.
pub struct Flow {
    pub power: Power,
    /// The rate at which the law's Lyapunov function decreases.
    pub dissipated: Sym,
    /// The rate of the law's own storage function, if this is the monitored energy.
    pub stored: Option<Sym>,
}

/// A monitor of one run, on plain numbers or on recorded values.
pub trait Monitor {
    /// Write the values of the monitor's series at a record, one for each of [`MonitorKind::NAMES`].
    fn evaluate(&mut self, at: &mut Moment, out: &mut [Sym]);
}

/// A kind of monitor.
pub trait MonitorKind {
    /// The names of the series of this monitor.
    const NAMES: &'static [&'static str];

    /// The names of the integrals that this monitor requires. These integrals are states of every monitored loop.
    const INTEGRALS: &'static [&'static str] = &[];

    /// Write the rates of the integrals of this monitor.
    fn rates(_: &Flow, _: &mut [Sym]) {}

    /// Whether this monitor applies to a run.
    fn applies(scope: &Scope) -> bool;

    /// Create the monitor of a run to which it applies.
    fn build(scope: &Scope) -> Option<Box<dyn Monitor + Send>>;
}
