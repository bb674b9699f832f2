//! The names of the slots of a loop's programs: `q1`, `v1`, `q_d1`, `h`, `kp1`, .. A slot is one number in the memory of a program.

use super::layout::{Layout, Slots};
use super::monitors;
use super::problem::Problem;
use crate::trace::label::Label;
use std::collections::HashSet;

/// The name of a slot, and the kind of its quantity.
pub type Named = (String, &'static str);

/// The names of all slots, in slot order.
pub struct SlotNames(Vec<Named>);

impl SlotNames {
    /// Name the loop parameters, which are the first slots, by their labels. Slot 17 without a label is `c17`. An underscore is added to a
    /// repeated label.
    fn of(labels: &[Label]) -> Self {
        let mut seen = HashSet::new();
        let mut unique = |(slot, &label): (usize, &Label)| {
            let mut name = match label {
                ("", _) => format!("c{slot}"),
                (name, 0) => name.to_owned(),
                (name, k) => format!("{name}{k}"),
            };
            while !seen.insert(name.clone()) {
                name.push('_');
            }
            (name, "set-up")
        };
        SlotNames(labels.iter().enumerate().map(&mut unique).collect())
    }

    fn add(&mut self, kind: &'static str, names: impl IntoIterator<Item = String>) {
        self.0.extend(names.into_iter().map(|name| (name, kind)));
    }

    /// Return the names of the slots that program `part` of a loop of fixed steps uses.
    pub fn fixed(problem: &Problem, layout: &Layout, labels: &[Label], part: &str) -> Self {
        let mut all = SlotNames::of(labels);
        let (states, exogenous) = (states(problem), exogenous(problem, layout.desired, layout.wrench));
        for &instant in layout.instants {
            let suffix = ["", "_mid", "_end"][(2.0 * instant) as usize];
            all.instant(&exogenous, layout.desired, suffix);
        }
        all.add("state", states.iter().cloned());
        all.add("sum", (1..=layout.kept).map(|k| format!("sum{k}")));
        all.add("step", ["h".to_owned()]);
        all.held(layout.inputs, layout.answer);
        let suffix = if part == "rates" { "" } else { "_stage" };
        all.add("state", states.iter().map(|name| format!("{name}{suffix}")));
        all.instant(&exogenous, layout.desired, suffix);
        for stage in 0.. {
            if all.0.len() >= layout.reach() {
                break;
            }
            let suffix = if stage > 0 { format!("_stage{stage}") } else { String::new() };
            all.add("rate", states.iter().map(|name| format!("d{name}{suffix}")));
        }
        all.add("largest angle", ["largest_angle".to_owned()]);
        all
    }

    /// Return the names of the slots that program `part` of the rates of a loop uses.
    pub fn rates(problem: &Problem, slots: &Slots, labels: &[Label], moves: bool, part: &str) -> Self {
        let mut all = SlotNames::of(labels);
        let (states, exogenous) = (states(problem), exogenous(problem, slots.desired, slots.wrench));
        all.instant(&exogenous, slots.desired, "");
        all.add("state", states.iter().cloned());
        all.held(slots.inputs, slots.answer);
        all.add("mode", (1..=slots.contact_modes() / 2).flat_map(|k| [format!("contact{k}_pushes"), format!("contact{k}_inside")]));
        all.add("mode", (1..=slots.sides).map(|k| format!("side{k}")));
        let rates = states.iter().map(|name| format!("d{name}"));
        if part != "rates" {
            let along = |names: &[String]| names.iter().map(|name| format!("along_{name}")).collect::<Vec<_>>();
            all.add("direction", along(&states[..slots.plant]));
            all.add("direction", along(if moves { &exogenous } else { &[] }));
            all.add("direction", along(&states[slots.plant..slots.plant + slots.law]));
            all.add("rate", rates.clone());
            all.add("derivative", rates.map(|name| format!("{name}_along")));
        } else {
            all.add("rate", rates);
        }
        all.add("largest angle", ["largest_angle".to_owned()]);
        all
    }

    fn instant(&mut self, exogenous: &[String], desired: usize, suffix: &str) {
        let names = |names: &[String]| names.iter().map(|name| format!("{name}{suffix}")).collect::<Vec<_>>();
        self.add("desired", names(&exogenous[..desired]));
        self.add("force", names(&exogenous[desired..]));
    }

    /// Name the results of a law: inputs of the plant, and other results.
    fn held(&mut self, inputs: usize, answer: usize) {
        self.add("held", (1..=inputs).map(|k| format!("tau{k}")));
        self.add("held", (1..=answer).map(|k| format!("answer{k}")));
    }

    /// Return the name of `slot`. The slots after all named slots contain values that one program passes to another.
    pub fn at(&self, slot: u32) -> Named {
        let slot = slot as usize;
        self.0.get(slot).cloned().unwrap_or_else(|| (format!("kept{}", slot - self.0.len()), "kept"))
    }
}

/// Return the names of the components of a loop's state.
fn states(problem: &Problem) -> Vec<String> {
    let (plant, law) = (problem.plant(0), problem.law(0));
    let own = if law.adaptive().is_some() { "estimate" } else { "z" };
    let plant = plant.kind().parts().iter().flat_map(|part| (1..=plant.n()).map(move |i| format!("{part}{i}")));
    let bristles = (1..=problem.plant(0).bristles()).map(|i| format!("bristle{i}"));
    let law = (1..=law.initial_state().len()).map(|k| format!("{own}{k}"));
    plant.chain(bristles).chain(law).chain(monitors::integrals(problem.options.monitors).map(str::to_owned)).collect()
}

/// Return the names of the desired motions and of the wrench at one instant. Motions of the joints are `q_d1, v_d1, a_d1`. Motion `k` of
/// other coordinates begins with `xk_d1`.
fn exogenous(problem: &Problem, desired: usize, wrench: usize) -> Vec<String> {
    let law = problem.law(0);
    let motions = law.motions();
    let joints = motions.len() == 1 && motions[0].dof() == problem.plant(0).n() && law.coordinates().is_none();
    let mut names: Vec<String> = Vec::new();
    for (k, motion) in motions.iter().enumerate() {
        let k = k + 1;
        let parts = if joints {
            ["q_d".into(), "v_d".into(), "a_d".into()]
        } else {
            [format!("x{k}_d"), format!("xdot{k}_d"), format!("xddot{k}_d")]
        };
        names.extend(parts.iter().flat_map(|part| (1..=motion.dof()).map(move |i| format!("{part}{i}"))));
    }
    debug_assert_eq!(names.len(), desired, "a motion has a position, a velocity and an acceleration");
    names.extend(["fx", "fy", "fz", "mx", "my", "mz"].iter().take(wrench).map(|&name| format!("force_{name}")));
    names
}
