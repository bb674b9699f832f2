//! The interface of a monitor, and its arguments.

use crate::dynamics::At;
use crate::law::{LawSpec, Sample, Terms};
use crate::plant::{PlantSpec, PlantState, Power};
use crate::simulate::metrics::gauge::Identities;
use crate::simulate::problem::Problem;
use crate::trace::expression::zeros;
use crate::trace::{E, V};

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

/// A record of a run.
pub struct Moment<'a> {
    /// The loop at the record.
    pub at: &'a Instant<'a>,
    /// External wrench `[f; m]`, `(6,)`, N and N m, world axes.
    pub wrench: &'a [E; 6],
    /// The plant's input, `(n,)`.
    pub tau: &'a V,
    pub identities: Identities<E>,
    /// The values of `E(0)` and `V1(0)`, which are those of the first record, with their integrals.
    pub first: [E; 2],
    /// The projection loss of the law, if it is monitored.
    pub loss: Option<E>,
    /// The named intermediate results of the law; `None` if no monitor needs them.
    pub terms: Option<&'a Terms>,
}

impl Moment<'_> {
    /// The term `name` of the law.
    pub fn term(&self, name: &str) -> V {
        self.terms.map_or_else(|| zeros(0), |terms| terms.get(name))
    }
}

/// A loop at one record.
pub struct Instant<'a> {
    /// The desired motions.
    pub desired: Vec<Sample>,
    /// The state of the plant, then of the law, then the integrals.
    pub x: &'a [E],
    /// The state of the plant by its parts.
    pub plant: PlantState,
    /// The state of the law, `(p,)`.
    pub z: V,
    /// The integrals of the monitors.
    pub integrals: &'a [E],
    /// The arm at the joint positions.
    pub arm: At<E>,
}

/// The quantities of a loop from which the rates of the monitors' integrals are computed.
pub struct Flow {
    pub power: Power,
    /// The rate at which the law's Lyapunov function decreases.
    pub dissipated: E,
    /// The rate of the law's own storage function, if this is the monitored energy.
    pub stored: Option<E>,
}

/// A monitor of one run, on plain numbers or on recorded values.
pub trait Monitor {
    /// Write the values of the monitor's series at a record, one for each of [`MonitorKind::NAMES`].
    fn evaluate(&self, at: &Moment, out: &mut [E]);
}

/// A kind of monitor.
pub trait MonitorKind {
    /// The names of the series of this monitor.
    const NAMES: &'static [&'static str];

    /// The names of the integrals that this monitor requires. These integrals are states of every monitored loop.
    const INTEGRALS: &'static [&'static str] = &[];

    /// Write the rates of the integrals of this monitor.
    fn rates(_: &Flow, _: &mut [E]) {}

    /// Whether this monitor applies to a run.
    fn applies(scope: &Scope) -> bool;

    /// Create the monitor of a run to which it applies.
    fn build<'a>(scope: &Scope<'_, 'a>) -> Option<Box<dyn Monitor + 'a>>;
}
