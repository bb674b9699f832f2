//! Positions of a problem that are outside of joint limits. Initial positions have the limits of the plant's arm, and targets have the
//! limits of the law's arm.

use super::Problem;
use crate::arm::{Arm, Outside};
use crate::dynamics::Model;
use crate::law::{JointReference, LawSpec};

/// Return the arm of a model, or `None` for a model without joint limits.
fn limited(model: &Model) -> Option<&Arm> {
    match model {
        Model::Tree(arm) => Some(arm),
        Model::PlanarPr(_) => None,
    }
}

/// Return the positions to which a law moves the joints: its target, or both ends of its motion.
fn wanted(law: &LawSpec, motion: bool) -> Vec<Vec<f64>> {
    match law.joint_reference() {
        Some(JointReference::Target(q)) if !motion => vec![q],
        Some(JointReference::Motion) if motion => {
            let Some(motion) = law.motions().first().copied() else { return Vec::new() };
            let ends = [0.0, motion.breaks().last().copied().unwrap_or(0.0)];
            let ends = ends.map(|t| {
                let mut sample = vec![0.0; 3 * motion.dof()];
                motion.sample(t, &mut sample);
                sample.truncate(motion.dof());
                sample
            });
            ends.into()
        }
        _ => Vec::new(),
    }
}

impl Problem<'_> {
    /// Return the first position outside of the joint limits for each of the arguments `q0`, `law.target` and `law.motion`, if there is
    /// one. The string is the argument with the index of the position. Only the two ends of a motion are checked. If `batch` is true, the
    /// index of an initial position includes its row.
    pub fn outside(&self, batch: bool) -> Vec<(String, Outside)> {
        // One plant may have several initial states. A problem that is not yet validated may also have too many of them.
        let starts = self.x0.chunks_exact(self.plants[0].states()).enumerate();
        let starts = starts.filter_map(|(run, x)| Some((limited(self.plants[run.min(self.plants.len() - 1)].model())?, x)));
        let mut found: Vec<_> = Outside::first(starts).map(|start| (format!("q0{}", start.index(batch)), start)).into_iter().collect();
        for (name, motion) in [("law.target", false), ("law.motion", true)] {
            let arms = self.laws.iter().filter_map(|law| Some((limited(law.model())?, wanted(law, motion))));
            let all: Vec<(&Arm, Vec<f64>)> = arms.flat_map(|(arm, rows)| rows.into_iter().map(move |q| (arm, q))).collect();
            if let Some(mut target) = Outside::first(all.iter().map(|(arm, q)| (*arm, &q[..]))) {
                if self.laws.len() == 1 {
                    // The two ends of a motion belong to one law. So the number of checked rows is one.
                    target.of = 1;
                }
                found.push((format!("{name}[{}]", target.joint), target));
            }
        }
        found
    }
}
