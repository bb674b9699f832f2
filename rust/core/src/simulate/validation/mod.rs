//! Validation of a problem, except for its times. `same_structure` compares the runs of a batch.

pub mod same_structure;

use crate::dynamics::Model;
use crate::error::{Error, Result};
use crate::integrate::Method;
use crate::law::{LawSpec, Route};
use crate::memory;
use crate::simulate::problem::Problem;

impl Problem<'_> {
    /// Refuse a law that requires a sample period if the problem has none.
    fn require_period(&self, law: &LawSpec) -> Result<()> {
        let problem = match law {
            _ if self.options.sampling.is_some() => return Ok(()),
            law if law.route() == Route::Outside => "expected the sample period of a law outside of the loop, got None".to_string(),
            law if law.switches() => format!("expected the period at which {} looks for contact, got None", law.name()),
            _ => return Ok(()),
        };
        Err(Error::input("sample_time", format!("is missing: {problem}")))
    }

    /// Refuse plants and laws that do not match.
    fn validate_pairs(&self) -> Result<()> {
        self.require_same_structure()?;
        let (plant, law) = (self.plants[0], self.laws[0]);
        if law.plant() != plant.kind() {
            let problem = format!(
                "is made for another plant: expected a law for {}, got {}, a law for {}",
                plant.kind().name(),
                law.name(),
                law.plant().name()
            );
            return Err(Error::input("law", problem));
        }
        if self.options.method == Method::SemiImplicit && !plant.kind().has_speeds() {
            let name = plant.kind().name();
            let problem = format!("needs velocities among the states: expected such as rk4 for {name}, got semi_implicit");
            return Err(Error::input("method", problem));
        }
        if let Some(law) = self.laws.iter().find(|law| law.route().is_scalar())
            && self.options.sampling.is_none()
            && self.options.method.is_implicit()
        {
            let (name, method) = (law.name(), self.options.method.name());
            let problem =
                format!("needs derivatives, which {name} has not: expected such as rk4 or dop853, or a sample_time, got {method}");
            return Err(Error::input("method", problem));
        }
        self.laws.iter().try_for_each(|law| self.require_period(law))?;
        if !self.forces.is_empty() {
            if !plant.kind().has_speeds() {
                let problem = format!("takes effect only on a plant whose input is a torque: expected None for {}", plant.kind().name());
                return Err(Error::input("force", problem));
            }
            let Model::Tree(arm) = plant.model() else {
                return Err(Error::input("force", "has no frame to act at: expected a plant with links, got planar_pr"));
            };
            match self.force_frame() {
                None => {
                    return Err(Error::input(
                        "force_frame",
                        format!("is missing: expected a frame for the force, since {} has none", law.name()),
                    ));
                }
                Some(frame) if frame >= arm.frames.len() => {
                    return Err(Error::input("force_frame", format!("is out of range: expected below {}, got {frame}", arm.frames.len())));
                }
                Some(frame) => self.require_same_force_frame(frame)?,
            }
        }
        Ok(())
    }

    /// Refuse arms that are too large for the memory, before the workspaces of `at_once` runs are allocated. Errors: [`Error::Memory`].
    pub fn require_memory(&self, at_once: usize) -> Result<()> {
        // Estimates of the memory of one run: the number of matrices of the dynamics and the law, of Jacobians with their decompositions,
        // and of vectors.
        const MATRICES: usize = 6;
        const JACOBIANS: usize = 8;
        const VECTORS: usize = 64;
        let (n, states) = (self.plants[0].n(), self.plants[0].states() + self.laws[0].initial_state().len());
        let jacobians = if self.options.method.is_implicit() { JACOBIANS * states * states } else { 0 };
        memory::require((MATRICES * n * n + jacobians + VECTORS * states).saturating_mul(8 * at_once))
    }

    /// Refuse a loop that is invalid regardless of its times and its initial state.
    pub(in crate::simulate) fn validate_loop(&self) -> Result<()> {
        let o = &self.options;
        self.validate_pairs()?;
        let limit = o.tau_max.as_deref().unwrap_or_default();
        let n = self.plants[0].n();
        if o.tau_max.is_some() && limit.len() != n {
            return Err(Error::wrong("tau_max", "length", n, limit.len()));
        }
        if let Some(i) = limit.iter().position(|&x| !(x > 0.0)) {
            let error = Error::input("tau_max", format!("is not positive: expected > 0, got {}", limit[i])).at([i]);
            return Err(self.plants[0].model().name_limit(error));
        }
        if let Some(sampling) = &o.sampling {
            sampling.validate()?;
            self.validate_motor_loops(sampling.period)?;
            self.validate_sensors(sampling)?;
        }
        Ok(())
    }
}
