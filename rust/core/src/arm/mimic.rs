//! Mimic joints, `q_follower = multiplier q_leader + offset`. A *follower* is a mimic joint, and its *leader* is the joint that it follows.
//! Both share one degree of freedom.
//!
//! A follower has its own body. Its *drive* is its rotor inertia, viscous friction and Coulomb friction. The torque of a leader and its
//! followers is `tau = G' tau_joints` with `q_joints = G q + c`, where the prime is the transpose. So the rotor inertia and the viscous
//! friction of a follower are multiplied by `multiplier^2` and added to the leader. The Coulomb friction of a follower is multiplied by
//! `|multiplier|` and added to the leader. The follower's limits restrict the position range and the speed of the leader. The effort limit
//! of the follower is ignored, because the motor of the leader moves all joints.

use super::Arm;
use super::joint::{Joint, Limits, Mimic};
use crate::error::{Error, Result, finite, listed};
use crate::interrupt;

/// The map `q_joints = G q + c` from the coordinates `q` to the positions of all joints, in an arm with mimic joints.
///
/// ```
/// use armlet_core::arm::Arm;
///
/// let arm = Arm::planar(&[0.5, 0.4], None, None, None, [0.0; 2])?;
/// assert_eq!(arm.joining(), None);
/// let joining = arm.following(&[None, Some((0, -2.0, 0.1))])?.joining().expect("a mimic joint");
/// assert_eq!(joining.rows, [(0, 1.0, 0.0), (0, -2.0, 0.1)]);
/// assert_eq!(joining.leaders, [0]);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Joining {
    /// For each joint, the index of the coordinate that moves it, the multiplier and the offset.
    pub rows: Vec<Follows>,
    /// For each coordinate, the index of its joint.
    pub leaders: Vec<usize>,
}

/// The maximum number of bodies of an arm with mimic joints. The number is limited, because the algorithms compute matrices for all joints,
/// including followers, and then project them on the coordinates.
pub const MOST_BODIES: usize = 256;

/// The index of a joint's leader, the multiplier and the offset.
pub type Follows = (usize, f64, f64);

/// For each joint, find the joint without a leader that it follows, directly or through a chain of followers. The result is `None` for a
/// joint without a leader. The error is the index of a joint in a cycle of followers.
pub fn resolved(given: &[Option<Follows>]) -> std::result::Result<Vec<Option<Follows>>, usize> {
    let (mut out, mut known) = (given.to_vec(), vec![false; given.len()]);
    let (mut way, mut passed) = (Vec::new(), vec![false; given.len()]);
    for start in 0..given.len() {
        interrupt::check();
        let mut i = start;
        while let (false, Some((leader, ..))) = (known[i], given[i]) {
            // The chain passes this joint a second time. So the joint is in a cycle.
            if passed[i] {
                return Err(i);
            }
            passed[i] = true;
            way.push(i);
            i = leader;
        }
        known[i] = true;
        while let Some(j) = way.pop() {
            if let Some((leader, m, c)) = given[j] {
                out[j] = Some(out[leader].map_or((leader, m, c), |(root, m_0, c_0)| (root, m * m_0, m * c_0 + c)));
            }
            known[j] = true;
        }
    }
    Ok(out)
}

/// The limits and the drive of a joint. The drive is rotor inertia, viscous friction and Coulomb friction.
#[derive(Clone, Copy, Debug)]
pub struct Moved {
    pub limits: Limits,
    pub armature: f64,
    pub damping: f64,
    pub friction: f64,
}

impl Moved {
    /// Return the limits and the drive of the leader, combined with the limits and the drive of a follower. The flag is true if the
    /// position limits of leader and follower together allow no motion. The follower's position limits are then ignored.
    pub fn with(&self, follower: &Moved, multiplier: f64, offset: f64) -> (Moved, bool) {
        let own = self.limits;
        let size = multiplier.abs();
        let mut out = Moved {
            limits: own,
            armature: self.armature + multiplier * multiplier * follower.armature,
            damping: self.damping + multiplier * multiplier * follower.damping,
            friction: self.friction + size * follower.friction,
        };
        if multiplier == 0.0 {
            return (out, false);
        }
        let ends = [follower.limits.lower, follower.limits.upper].map(|end| (end - offset) / multiplier);
        let (lower, upper) = (own.lower.max(ends[0].min(ends[1])), own.upper.min(ends[0].max(ends[1])));
        out.limits.velocity = own.velocity.min(follower.limits.velocity / size);
        let empty = !(lower < upper) && own.lower < own.upper;
        if !empty {
            (out.limits.lower, out.limits.upper) = (lower, upper);
        }
        (out, empty)
    }

    /// Return the limits and the drive of this joint for the coordinate `multiplier q + offset` instead of `q`.
    fn counted_by(&self, multiplier: f64, offset: f64) -> Moved {
        let ends = [self.limits.lower, self.limits.upper].map(|end| multiplier * end + offset);
        let size = multiplier.abs();
        let (lower, upper) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        let limits = Limits { lower, upper, velocity: size * self.limits.velocity, effort: self.limits.effort / size };
        Moved { limits, armature: self.armature / (size * size), damping: self.damping / (size * size), friction: self.friction / size }
    }
}

impl Joint {
    /// The limits and the drive (rotor inertia and friction) of the joint.
    pub(super) fn moved(&self) -> Moved {
        Moved { limits: self.limits, armature: self.armature, damping: self.damping, friction: self.friction }
    }

    /// Remove the drive (rotor inertia and friction) of the joint, after it has been added to the leader's drive.
    pub(super) fn undriven(&mut self) {
        (self.armature, self.damping, self.friction) = (0.0, 0.0, 0.0);
    }

    pub(super) fn set_moved(&mut self, moved: &Moved) {
        (self.limits, self.armature) = (moved.limits, moved.armature);
        (self.damping, self.friction) = (moved.damping, moved.friction);
    }
}

/// Return a line for the report: the limits of `follower` allow no motion.
pub fn no_motion(follower: &str, leader: &str) -> String {
    format!("limits of {follower}, which follows {leader}, leave {leader} no range: left out")
}

impl Arm {
    /// The joints that are not followers, in the order of `q`.
    pub fn independent(&self) -> impl Iterator<Item = &Joint> {
        let mut followers = self.mimics.iter().map(|mimic| mimic.joint).peekable();
        self.joints.iter().enumerate().filter(move |(i, _)| followers.next_if_eq(i).is_none()).map(|(_, joint)| joint)
    }

    /// For each coordinate, the index of its joint in `joints`.
    pub fn independent_indices(&self) -> Vec<usize> {
        let mut followers = self.mimics.iter().map(|mimic| mimic.joint).peekable();
        (0..self.joints.len()).filter(|i| followers.next_if_eq(i).is_none()).collect()
    }

    /// For each coordinate, whether one revolution returns all bodies to their places. This requires that its joint and all moving
    /// followers are angles, and that the multipliers of the followers are integers.
    pub fn turns(&self) -> Vec<bool> {
        let mut turns: Vec<bool> = self.joints.iter().map(|joint| joint.kind.is_angle()).collect();
        for mimic in &self.mimics {
            let whole = mimic.multiplier.fract() == 0.0;
            turns[mimic.leader] &= mimic.multiplier == 0.0 || (whole && self.joints[mimic.joint].kind.is_angle());
        }
        self.independent_indices().into_iter().map(|i| turns[i]).collect()
    }

    /// Write the positions `G q + c` of all joints, including followers, to `out`. `q`: coordinates, shape `(n,)`, rad or m.
    pub fn joint_positions(&self, q: &[f64], out: &mut [f64]) {
        match self.joining() {
            None => out.copy_from_slice(q),
            Some(joining) => {
                out.iter_mut().zip(&joining.rows).for_each(|(x, &(k, m, c))| *x = if (m, c) == (1.0, 0.0) { q[k] } else { m * q[k] + c })
            }
        }
    }

    /// Whether `mimics` are valid: sorted, finite, and with existing joints whose leaders are not followers. An arm with mimic joints has
    /// at most 256 joints.
    pub fn mimics_are_sound(&self) -> bool {
        let mut follows = vec![false; self.joints.len()];
        for mimic in &self.mimics {
            match follows.get_mut(mimic.joint) {
                Some(flag) if !*flag => *flag = true,
                _ => return false,
            }
        }
        let sound = |m: &Mimic| follows.get(m.leader) == Some(&false) && m.multiplier.is_finite() && m.offset.is_finite();
        let ordered = self.mimics.windows(2).all(|pair| pair[0].joint < pair[1].joint);
        ordered && self.mimics.iter().all(sound) && (self.mimics.is_empty() || self.joints.len() <= MOST_BODIES)
    }

    /// For each coordinate, the next coordinate towards the base. `None` at the base.
    pub fn parents(&self) -> Vec<Option<usize>> {
        let joining = self.joining();
        let coordinate = |i: usize| joining.as_ref().map_or(i, |joining| joining.rows[i].0);
        let inwards = |(k, i): (usize, usize)| {
            let mut next = self.joints[i].parent;
            while let Some(j) = next.filter(|&j| coordinate(j) == k) {
                next = self.joints[j].parent;
            }
            next.map(coordinate)
        };
        self.independent_indices().into_iter().enumerate().map(inwards).collect()
    }

    /// Return the map from coordinates to joints. The result is `None` for an arm without mimic joints.
    pub fn joining(&self) -> Option<Joining> {
        if self.mimics.is_empty() {
            return None;
        }
        let leaders = self.independent_indices();
        let mut rows: Vec<Follows> = vec![(0, 1.0, 0.0); self.joints.len()];
        for (k, &i) in leaders.iter().enumerate() {
            rows[i].0 = k;
        }
        for mimic in &self.mimics {
            rows[mimic.joint] = (rows[mimic.leader].0, mimic.multiplier, mimic.offset);
        }
        Some(Joining { rows, leaders })
    }

    /// Set the leaders of followers, given as pairs of a joint and its leader. If the leader is not part of the arm, its first follower
    /// with a multiplier other than zero becomes the leader. Errors: `Input` for numbers that are not finite, or too many joints.
    pub(super) fn set_mimics(&mut self, mut followers: Vec<(usize, Leader)>) -> Result<()> {
        followers.sort_by_key(|(joint, _)| *joint);
        let (mut first, mut mimics): (Vec<&(usize, Leader)>, _) = (Vec::new(), Vec::new());
        for pair @ (joint, Leader { at, name, multiplier, offset, .. }) in &followers {
            interrupt::check();
            let (joint, multiplier, offset) = (*joint, *multiplier, *offset);
            finite(&format!("mimic of {}", self.joints[joint].name), &[multiplier, offset])?;
            if let Some(leader) = *at {
                mimics.push(Mimic { joint, leader, multiplier, offset });
            } else if let Some((leader, other)) = first.iter().find(|(_, other)| other.name == *name) {
                let ratio = multiplier / other.multiplier;
                mimics.push(Mimic { joint, leader: *leader, multiplier: ratio, offset: offset - ratio * other.offset });
            } else if multiplier != 0.0 {
                first.push(pair);
            }
        }
        for (joint, leader) in first {
            self.joints[*joint].set_moved(&leader.moved.counted_by(leader.multiplier, leader.offset));
            self.report
                .push(format!("joint {} leads in the place of {}, which is no part of the arm", self.joints[*joint].name, leader.name));
        }
        if !mimics.is_empty() && self.joints.len() > MOST_BODIES {
            let problem = "has too many joints for some that follow others: expected at most";
            let hint = "read it with mimic=\"independent\"";
            return Err(Error::input("mimic", format!("{problem} {MOST_BODIES}, got {}; {hint}", self.joints.len())));
        }
        self.mimics = mimics;
        Ok(())
    }

    /// Add a line with all followers and their leaders to the report.
    pub(super) fn report_mimics(&mut self) {
        let equation =
            |m: &Mimic| format!("{} = {} {} + {}", self.joints[m.joint].name, m.multiplier, self.joints[m.leader].name, m.offset);
        let lines: Vec<String> = self.mimics.iter().map(equation).collect();
        if !lines.is_empty() {
            self.report.push(format!("joined with their leaders: {}", listed(&lines)));
        }
    }
}

/// The leader of a joint. `at` is its index in the arm, or `None` if it is not part of the arm. `moved` has its limits and drive.
pub struct Leader {
    pub at: Option<usize>,
    pub name: String,
    pub moved: Moved,
    pub multiplier: f64,
    pub offset: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cycle_is_reported_by_one_of_its_joints() {
        let follows = |leaders: &[Option<usize>]| resolved(&leaders.iter().map(|leader| leader.map(|k| (k, 2.0, 0.5))).collect::<Vec<_>>());
        assert_eq!(follows(&[Some(1), Some(1)]), Err(1));
        // Joints 0 and 1 only lead into the cycle of joints 2, 3 and 4.
        assert_eq!(follows(&[Some(1), Some(2), Some(3), Some(4), Some(2), None]), Err(2));
        assert_eq!(follows(&[Some(1), Some(2), Some(0)]), Err(0));
        // A joint that was already resolved, and then a cycle.
        assert_eq!(follows(&[Some(1), None, Some(0), Some(4), Some(3)]), Err(3));
        assert_eq!(follows(&[Some(1), Some(2), None]), Ok(vec![Some((2, 4.0, 1.5)), Some((2, 2.0, 0.5)), None]));
    }
}
