//! A plant in a recording, and functions of its state, its input and the wrench.

use super::PlantSpec;
use super::equations::{PlantAt, PlantEquations, PlantRates, PlantState};
use super::parameters::Parameters;
use super::stick_slip::LoopStickSlip;
use super::unilateral::Mode;
use crate::trace::expression::{vector, zeros};
use crate::trace::function::{Recorded, recorded};
use crate::trace::{E, V, sym};

impl PlantState {
    /// The parts of the state `x` of `plant`.
    pub fn of(plant: &PlantSpec, x: &[E]) -> Self {
        let (n, seen) = (plant.n(), plant.seen());
        let part = |k: usize| if (k + 1) * n <= seen { vector(&x[k * n..(k + 1) * n]) } else { zeros(0) };
        let bristles = vector(x.get(seen..seen + plant.bristles()).unwrap_or_default());
        PlantState { q: part(0), v: part(1), theta: part(2), theta_dot: part(3), bristles }
    }
}

/// A plant in a recording. Its numbers are inputs, and each evaluation records its equations.
///
/// ```
/// # use armlet_core::arm::Arm;
/// use armlet_core::plant::{PlantSpec, RecordedPlant, RigidSpec};
/// use armlet_core::trace::expression::vector;
/// use armlet_core::trace::function::recorded;
///
/// // A pendulum, `a = tau - 5 sin q`, as a function of position, velocity and torque.
/// let spec = PlantSpec::from(RigidSpec::new(Arm::pendulum(1.0, 5.0)?.into()));
/// let rates = |plant: RecordedPlant, x: &[_]| plant.rates(&x[..2], &vector(&x[2..]), &[]).x_dot.as_slice().to_vec();
/// let mut dx = recorded(3, || RecordedPlant::new(&spec, None), rates).expect("a plant does not branch").interpreted(false);
/// dx.all_inputs().copy_from_slice(&[0.3, 2.0, 4.0]);
/// dx.run();
/// assert!(dx.output(0) == [2.0] && (dx.output(1)[0] - (4.0 - 5.0 * 0.3f64.sin())).abs() < 1e-14);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub struct RecordedPlant<'a> {
    plant: &'a PlantSpec,
    numbers: Parameters,
    force_frame: Option<usize>,
    contacts: Vec<Mode<E>>,
    signs: V,
}

impl<'a> RecordedPlant<'a> {
    /// Record the numbers of `plant`. The wrench acts at `force_frame`.
    pub fn new(plant: &'a PlantSpec, force_frame: Option<usize>) -> Self {
        RecordedPlant { plant, numbers: plant.parameters(), force_frame, contacts: Vec::new(), signs: zeros(0) }
    }

    /// Hold every contact in its mode of `contacts`, independent of the state. The mode of the wall is the first, and the modes of the stops
    /// follow.
    pub fn hold_contacts(&mut self, contacts: impl Iterator<Item = Mode<E>>) {
        self.contacts = contacts.collect();
    }

    /// Hold every joint with stick-slip friction in its mode: 0 for a stuck joint, else the direction of sliding.
    pub fn hold_joints(&mut self, signs: &[E]) {
        self.signs = vector(signs);
    }

    /// The rates of the state `x` under the input `tau`, `(n,)`, and the wrench, `(6,)`.
    pub fn rates(&self, x: &[E], tau: &V, wrench: &[E]) -> PlantRates {
        self.at(x, tau, wrench, |plant, at| plant.equations(at))
    }

    /// Whether joints or motors have stick-slip friction.
    pub fn sticks(&self) -> bool {
        self.plant.sticks()
    }

    /// Depth `d` and push `k d + c d_dot` of contact `i` at the state `x`.
    pub fn contact(&self, i: usize, x: &[E]) -> [E; 2] {
        self.at(x, &zeros(self.plant.n()), &[], |_, at| at.contact(i))
    }

    /// The stick-slip friction with its loads, and the speeds on which it acts; `None` without this friction. The arguments are those of
    /// [`RecordedPlant::rates`].
    pub fn stick_slip(&self, x: &[E], tau: &V, wrench: &[E]) -> Option<(LoopStickSlip<E>, V)> {
        self.at(x, tau, wrench, |plant, at| {
            let speeds = if self.plant.kind().has_motors() { &at.x.theta_dot } else { &at.x.v };
            Some((plant.stick_slip(at)?, speeds.clone()))
        })
    }

    fn at<T>(&self, x: &[E], tau: &V, wrench: &[E], f: impl FnOnce(&dyn PlantEquations, &PlantAt) -> T) -> T {
        let x = PlantState::of(self.plant, x);
        let at = PlantAt {
            numbers: &self.numbers,
            arm: self.numbers.arm_at(&x.q),
            x,
            tau: tau.clone(),
            wrench,
            force_frame: self.force_frame,
            contacts: &self.contacts,
            signs: &self.signs,
        };
        sym::contract(|| f(self.plant.equations_of(), &at))
    }
}

/// The arguments of [`RecordedPlant::rates`] in a recording.
pub(super) struct Arguments<'a> {
    pub x: &'a [E],
    pub tau: V,
    pub wrench: &'a [E],
}

/// Record a function of the state, the input and the wrench of the plant `spec`, which are the inputs in this order. The wrench acts at
/// `force_frame`.
pub(super) fn function_of(
    spec: &PlantSpec,
    force_frame: Option<usize>,
    answer: impl FnOnce(RecordedPlant, &Arguments) -> Vec<E>,
) -> Recorded {
    let (n, states) = (spec.n(), spec.states());
    let recorded = recorded(
        states + n + 6,
        || RecordedPlant::new(spec, force_frame),
        |plant, inputs| {
            let (x, outside) = inputs.split_at(states);
            let (tau, wrench) = outside.split_at(n);
            answer(plant, &Arguments { x, tau: vector(tau), wrench })
        },
    );
    let Some(recorded) = recorded else { unreachable!("no plant reads the value of a recorded number") };
    recorded
}
