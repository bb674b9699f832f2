//! The structure that all runs of a batch have in common, so that a row of the results has the quantities of a single run.

use crate::dynamics::Model;
use crate::error::{Error, Result};
use crate::law::LawSpec;
use crate::plant::PlantSpec;
use crate::simulate::monitors;
use crate::simulate::problem::times::Times;
use crate::simulate::problem::{Options, Problem};

impl Problem<'_> {
    /// Refuse a number of plants, laws or forces that is neither one nor the number of runs.
    ///
    /// Plants and laws that differ from the first ones in their kind, or in their model of friction, are also refused. The same applies to the
    /// numbers of joints, states and tasks.
    pub(in crate::simulate) fn require_same_structure(&self) -> Result<()> {
        let runs = self.runs();
        let counts = [("plant", self.plants.len()), ("law", self.laws.len()), ("force", self.forces.len().max(1))];
        for (name, count) in counts {
            if count != 1 && count != runs {
                return Err(Error::wrong(name, "number of entries", format!("1 or {runs}"), count));
            }
        }
        let (plant, law) = (self.plants[0], self.laws[0]);
        let mixed = |argument: &str, i: usize, expected: &str, got: &str| {
            Err(Error::input(argument, format!("mixes kinds: expected {expected} throughout, got {got}")).at([i]))
        };
        if let Some(i) = self.laws.iter().position(|l| std::mem::discriminant(*l) != std::mem::discriminant(law)) {
            return mixed("law", i, law.name(), self.laws[i].name());
        }
        let same_guard = |l: &LawSpec| match (law, l) {
            (LawSpec::Guarded(first), LawSpec::Guarded(other)) => first.same_kind(other),
            _ => true,
        };
        if let Some(i) = self.laws.iter().position(|l| !same_guard(l)) {
            let problem = "mixes guarded laws: expected one kind of law inside, and thresholds in all observers or in none";
            return Err(Error::input("law", problem).at([i]));
        }
        if let Some(i) = self.plants.iter().position(|p| p.kind() != plant.kind()) {
            return mixed("plant", i, plant.kind().name(), self.plants[i].kind().name());
        }
        let friction = |plant: &PlantSpec| plant.friction().map(std::mem::discriminant);
        if let Some(i) = self.plants.iter().position(|p| friction(p) != friction(plant)) {
            return Err(Error::input("plant", "mixes models of friction: expected one throughout").at([i]));
        }
        let is_tree = |plant: &PlantSpec| matches!(plant.model(), Model::Tree(_));
        if let Some(i) = self.plants.iter().position(|p| is_tree(p) != is_tree(plant)) {
            return Err(Error::input("plant", "mixes planar_pr with other arms: expected one of them throughout").at([i]));
        }
        if let Some(i) = self.plants.iter().position(|p| p.n() == plant.n() && p.model().angles() != plant.model().angles()) {
            return Err(Error::input("plant", "mixes types of joints: expected revolute and prismatic joints at the same places").at([i]));
        }
        if let Some(i) = self.laws.iter().position(|l| l.plant() != law.plant()) {
            return mixed("law", i, &format!("laws for {}", law.plant().name()), &format!("one for {}", self.laws[i].plant().name()));
        }
        let (n, count) = (plant.n(), |law: &LawSpec| [law.initial_state().len(), law.aims().len()]);
        let expected = count(law);
        for (i, l) in self.laws.iter().enumerate() {
            if l.model().n() != n {
                return Err(Error::wrong("law", "number of joints", n, l.model().n()).at([i]));
            }
            // Metrics have one number per task with a position.
            let quantities = ["number of states", "number of tasks with a position"];
            let compared = if self.measures.is_some() { 2 } else { 1 };
            if let Some(k) = (0..compared).find(|&k| count(l)[k] != expected[k]) {
                return Err(Error::wrong("law", quantities[k], expected[k], count(l)[k]).at([i]));
            }
        }
        if let Some(i) = self.plants.iter().position(|p| p.n() != n) {
            return Err(Error::wrong("plant", "number of joints", n, self.plants[i].n()).at([i]));
        }
        Ok(())
    }

    /// Refuse runs in which the index `frame` of the force's frame, or the axes of the force, have different meanings.
    pub(in crate::simulate) fn require_same_force_frame(&self, frame: usize) -> Result<()> {
        let coordinates = |law: &LawSpec| law.coordinates().map(|at| (at.frame, at.rows.clone()));
        let first = coordinates(self.laws[0]);
        if let Some(i) = self.laws.iter().position(|law| self.force_frame.is_none() && coordinates(law) != first) {
            return Err(
                Error::input("force_frame", "is missing: expected a frame for the force, since the laws have different ones").at([i])
            );
        }
        let first = frame_name(self.plants[0], frame);
        if let Some(i) = self.plants.iter().position(|plant| frame_name(plant, frame) != first) {
            return Err(Error::input("plant", "mixes arms with different frames: expected the frame of the force in each of them").at([i]));
        }
        Ok(())
    }

    /// Refuse runs that have other monitors than the first one. Errors: [`Error::Input`] for such runs and for mixed structures.
    pub fn require_same_monitors(&self) -> Result<()> {
        self.require_same_structure()?;
        let (argument, runs) = if self.laws.len() > 1 { ("law", self.laws.len()) } else { ("plant", self.plants.len()) };
        let options = Options { monitors: true, times: Times::Every(1), ..self.options.clone() };
        let (plants, laws) = (vec![self.plants[0]], vec![self.laws[0]]);
        let mut single = Problem { plants, laws, x0: Vec::new(), forces: Vec::new(), options, measures: None, ..*self };
        let first = monitors::names(&single);
        for i in 1..runs {
            (single.plants[0], single.laws[0]) = (self.plant(i), self.law(i));
            let other = monitors::names(&single);
            if other != first {
                let problem = format!(
                    "mixes structures: expected the monitors {} in all runs, or monitors=False, got {}",
                    first.join(", "),
                    other.join(", ")
                );
                return Err(Error::input(argument, problem).at([i]));
            }
        }
        Ok(())
    }
}

/// The name of frame `frame` of a plant's arm, if there is such a frame.
fn frame_name(plant: &PlantSpec, frame: usize) -> Option<&str> {
    let Model::Tree(arm) = plant.model() else { return None };
    arm.frames.get(frame).map(|frame| frame.name.as_str())
}
