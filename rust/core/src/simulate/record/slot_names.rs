//! The names of the slots of a loop's programs: `q1`, `v1`, `q_d1`, `h`, `kp1`, .. A slot is one number in the memory of a program.

use crate::integrate::MethodKind;
use crate::simulate::monitors;
use crate::simulate::problem::Problem;
use crate::trace::Signature;
use crate::trace::label::Label;
use std::collections::HashSet;

/// The name of a slot, and the kind of its quantity.
pub type Named = (String, &'static str);

/// The names of all slots, in slot order.
pub struct SlotNames(Vec<Named>);

impl SlotNames {
    /// Name the loop parameters, which are the first slots, by their labels. Slot 17 without a label is `c17`. An underscore is added to a
    /// repeated label.
    fn parameters(labels: &[Label]) -> Self {
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

    /// Return the names of the slots of a loop's program `part`, which has this signature.
    pub fn of(problem: &Problem, signature: &Signature, labels: &[Label], part: &str) -> Self {
        let mut all = SlotNames::parameters(labels);
        let (states, exogenous) = (states(problem), exogenous(problem));
        let motions = exogenous.len() - if problem.forces.is_empty() { 0 } else { 6 };
        let (desired, force) = exogenous.split_at(motions);
        let plant = problem.plant(0).states();
        let mut before: Vec<&str> = Vec::new();
        for (group, count) in signature.groups() {
            // A group of this name occurs once for each instant or stage.
            let k = before.iter().filter(|name| **name == group).count();
            let stage = if part == "rates" { "" } else { "_stage" };
            let numbered = |name: &str| (1..=count).map(|i| format!("{name}{i}")).collect::<Vec<_>>();
            let with = |names: &[String], before: &str, after: &str| names.iter().map(|name| format!("{before}{name}{after}")).collect();
            let (kind, names) = match group {
                "desired" => ("desired", with(desired, "", instant(problem, k))),
                "force" => ("force", with(force, "", instant(problem, k))),
                "state" => ("state", states.clone()),
                "sum" => ("sum", numbered(group)),
                "h" => ("step", vec![group.to_owned()]),
                "tau" | "answer" | "output" => ("held", numbered(group)),
                "measured" => ("measurement", with(&states[..count], "measured_", "")),
                "change" => ("limit", vec!["change".into(); count]),
                "contact" => ("mode", (1..=count / 2).flat_map(|i| [format!("contact{i}_pushes"), format!("contact{i}_inside")]).collect()),
                "side" => ("mode", numbered(group)),
                "stage_state" => ("state", with(&states, "", stage)),
                "stage_desired" => ("desired", with(desired, "", stage)),
                "stage_force" => ("force", with(force, "", stage)),
                "rates" => ("rate", with(&states, "d", &if k > 0 { format!("_stage{k}") } else { String::new() })),
                "along_plant" => ("direction", with(&[&states[..plant], &exogenous].concat()[..count], "along_", "")),
                "along_law" => ("direction", with(&states[plant..plant + count], "along_", "")),
                "derivatives" => ("derivative", with(&states, "d", "_along")),
                "largest_angle" => ("largest angle", vec![group.to_owned()]),
                _ => (group, numbered(group)),
            };
            debug_assert_eq!(names.len(), count, "a name for each slot of {group}");
            all.0.extend(names.into_iter().map(|name| (name, kind)));
            before.push(group);
        }
        all
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

/// Return the end of the names of the exogenous input at instant `k` of a step.
fn instant(problem: &Problem, k: usize) -> &'static str {
    match problem.options.method.kind() {
        MethodKind::ExplicitSteps(method) => ["", "_mid", "_end"][(2.0 * method.instants()[k]) as usize],
        MethodKind::ImplicitSteps(_) | MethodKind::ExplicitAdaptive(_) | MethodKind::ImplicitAdaptive(_) => "",
    }
}

/// Return the names of the desired motions and of the wrench at one instant. Motions of the joints are `q_d1, v_d1, a_d1`. Motion `k` of
/// other coordinates begins with `xk_d1`.
fn exogenous(problem: &Problem) -> Vec<String> {
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
    if !problem.forces.is_empty() {
        names.extend(["fx", "fy", "fz", "mx", "my", "mz"].map(|name| format!("force_{name}")));
    }
    names
}
