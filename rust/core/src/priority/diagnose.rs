//! Diagnosis of a stack of tasks: the directions of each level that can be commanded, and the reason for each lost direction.
//!
//! `J_E` is the stack of the Jacobians `J_i` of all levels, and `overlap = sum rank J_i - rank J_E`. The singularity is **algorithmic** if
//! `rank J_E < min(sum rank J_i, n)`. It is **kinematic** if a `rank J_i` is below its number of rows. Projected ranks follow the rank rule
//! `RankRule`. The rank of the stack `J_E` is the sum of the projected ranks. `rank J_i` is the number of singular values
//! `s > rounding s_max`, with the largest singular value `s_max` of `J_i`. Each level has its own `s_max`, because tasks have different
//! units.

use std::fmt;

use super::method::{DEFAULT_ROUNDING, PriorityMethod, PriorityOptions};
use super::solver::PrioritySolver;
use crate::error::Result;
use crate::linalg::svd::Svd;
use crate::linalg::{axpy, dot};
use nalgebra::DMatrix;

/// The lost part of a command counts as rounding error if it is at most this multiple of `rounding c (|v_i| + |J_i| |v|)`. Here `v` is the
/// velocity of the levels above, and `c` the number of `RankRule`.
const COMPATIBLE: f64 = 1e3;

/// The kind of singularity of the stack.
///
/// ```
/// use armlet_core::priority::{SingularityKind, diagnose};
///
/// let (x, y, none) = ([1.0, 0.0], [0.0, 1.0], [0.0, 0.0]);
/// let kind = |first: &[f64], second: &[f64]| diagnose(2, &[1, 1], &[first, second], None, None).map(|diagnosis| diagnosis.kind);
/// assert_eq!(kind(&x, &y)?, SingularityKind::Regular);
/// assert_eq!(kind(&x, &x)?, SingularityKind::Algorithmic);
/// assert_eq!(kind(&x, &none)?, SingularityKind::Kinematic);
/// assert_eq!(SingularityKind::Both.name(), "algorithmic+kinematic");
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SingularityKind {
    /// Each task has full rank alone. The rank of the stack is the sum of these ranks, or the number of joints if it is smaller.
    Regular,
    /// Each task has full rank alone, but tasks compete for the same directions of joint space, which reduces the rank of the stack.
    Algorithmic,
    /// At least one task is singular alone. The other tasks do not reduce the rank of the stack further.
    Kinematic,
    /// The stack has both kinds of singularity.
    Both,
}

impl SingularityKind {
    /// The name of the kind in Python.
    pub fn name(self) -> &'static str {
        match self {
            SingularityKind::Regular => "regular",
            SingularityKind::Algorithmic => "algorithmic",
            SingularityKind::Kinematic => "kinematic",
            SingularityKind::Both => "algorithmic+kinematic",
        }
    }
}

/// The diagnosis of one level.
///
/// ```
/// use armlet_core::priority::diagnose;
///
/// // The second level commands x, like the first level, and y.
/// let diagnosis = diagnose(3, &[1, 2], &[&[1.0, 0.0, 0.0], &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]], None, None)?;
/// let level = &diagnosis.levels[1];
/// assert_eq!((level.rows, level.rank, level.projected_rank), (2, 2, 1));
/// assert!(level.algorithmic && !level.kinematic);
/// assert_eq!((level.lost.len(), level.lost[0][0].abs()), (1, 1.0));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct LevelDiagnosis {
    /// The number of rows of the level.
    pub rows: usize,
    /// The rank of `J_i` alone.
    pub rank: usize,
    /// The rank of `J_i N`, where `N` projects on the null space of the levels above.
    pub projected_rank: usize,
    /// The singular values of `J_i`, in descending order, in the unit of the task divided by the unit of the joints.
    pub singular_values: Vec<f64>,
    /// The singular values of `J_i N`, in descending order.
    pub projected_singular_values: Vec<f64>,
    /// Whether `rank < rows`.
    pub kinematic: bool,
    /// Whether `projected_rank < min(rank, number of directions that the levels above leave free)`.
    pub algorithmic: bool,
    /// Orthonormal directions of the level's command, shape `(rows,)` each. No joint velocity in the null space of the levels above
    /// produces them.
    pub lost: Vec<Vec<f64>>,
}

/// The part of a command that one level cannot execute.
///
/// ```
/// use armlet_core::priority::diagnose;
///
/// // Both levels command the same joint, with 1 and 3 rad/s.
/// let x = [1.0, 0.0];
/// let diagnosis = diagnose(2, &[1, 1], &[&x, &x], Some(&[&[1.0], &[3.0]]), None)?;
/// let parts = diagnosis.compatibility.expect("a command was given");
/// assert!(parts[0].compatible && !parts[1].compatible);
/// assert!((parts[1].loss[0] - 2.0).abs() < 1e-15);
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Compatibility {
    /// The part of `v_i - J_i v_above` along the lost directions, shape `(rows,)`, in the unit of the task. `v_above` is the joint velocity
    /// of the levels above.
    pub loss: Vec<f64>,
    /// Whether the loss is zero up to rounding, so that the command can be executed exactly.
    pub compatible: bool,
}

/// The ranks, singular values and lost directions of a stack of levels.
///
/// ```
/// use armlet_core::priority::{SingularityKind, diagnose};
///
/// let (first, second) = ([1.0, 1.0, 0.0], [1.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
/// let diagnosis = diagnose(3, &[1, 2], &[&first, &second], None, None)?;
/// assert_eq!((diagnosis.ranks(), diagnosis.projected_ranks()), (vec![1, 2], vec![1, 1]));
/// assert_eq!((diagnosis.stacked_rank, diagnosis.overlap, diagnosis.kind), (2, 1, SingularityKind::Algorithmic));
/// assert!(diagnosis.to_string().contains("algorithmic"));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnosis {
    /// The number of joints.
    pub n: usize,
    /// The diagnosis of each level.
    pub levels: Vec<LevelDiagnosis>,
    /// The rank of all levels stacked.
    pub stacked_rank: usize,
    /// The number of directions that levels share.
    pub overlap: usize,
    /// The kind of singularity of the stack.
    pub kind: SingularityKind,
    /// The lost part of the command of each level, if a command was given.
    pub compatibility: Option<Vec<Compatibility>>,
}

impl Diagnosis {
    /// The rank of each level alone.
    pub fn ranks(&self) -> Vec<usize> {
        self.levels.iter().map(|l| l.rank).collect()
    }

    /// The rank of each level in the null space of the levels above. Level 1 is included.
    pub fn projected_ranks(&self) -> Vec<usize> {
        self.levels.iter().map(|l| l.projected_rank).collect()
    }
}

/// Diagnose a stack of Jacobians, shape `(rows_i, n)` each, row-major, the highest level first. If `velocities` is given, also diagnose the
/// command.
///
/// `rows`: number of rows of each level. `rounding`: relative error of the entries, by default `DEFAULT_ROUNDING`; for the Jacobian of an
/// arm it is `DEFAULT_ROUNDING (1 + sum|q|)`, at most 0.5. Errors: `WrongShape` for wrong sizes, `Input` for numbers that are not finite.
pub fn diagnose(n: usize, rows: &[usize], jacobians: &[&[f64]], velocities: Option<&[&[f64]]>, rounding: Option<f64>) -> Result<Diagnosis> {
    let rounding = rounding.unwrap_or(DEFAULT_ROUNDING);
    let options = PriorityOptions { rounding: Some(rounding), ..PriorityOptions::new(PriorityMethod::Exact) };
    let mut solver = PrioritySolver::new(n, rows, &options)?;
    let zeros: Vec<Vec<f64>> = rows.iter().map(|r| vec![0.0; *r]).collect();
    let zeros: Vec<&[f64]> = zeros.iter().map(Vec::as_slice).collect();
    let PrioritySolver { settings, given, scaled, hierarchy, .. } = &mut solver;
    given.load(jacobians, velocities.unwrap_or(&zeros))?;
    scaled.load(given, settings)?;
    hierarchy.start(settings);
    let (mut levels, mut compatibility) = (Vec::new(), Vec::new());
    for (i, level) in scaled.levels().enumerate() {
        let (m, dim, condition) = (level.rows(), hierarchy.null_space.dim(), hierarchy.rank_rule.condition);
        hierarchy.project(&level)?;
        let (projected_rank, _) = hierarchy.count_rank(&level)?;
        let mut full = Svd::new(m.max(n), m.max(n));
        full.decompose(jacobians[i], m, n)?;
        let singular_values = full.s().to_vec();
        let rank = full.rank(rounding * singular_values.first().copied().unwrap_or(0.0));
        // Only the basis of right singular vectors is complete. So the left singular vectors beyond the rank come from the transpose.
        let mut a = vec![0.0; m * dim];
        hierarchy.null_space.project(&level, &mut a);
        full.decompose(DMatrix::from_row_slice(m, dim, &a).as_slice(), dim, m)?;
        let lost: Vec<Vec<f64>> = (projected_rank..m).map(|j| full.v(j).to_vec()).collect();
        let norm = hierarchy.projected.norm(&hierarchy.null_space);
        let size = dot(level.command, level.command).sqrt() + norm * dot(&hierarchy.y, &hierarchy.y).sqrt();
        hierarchy.step(&level, projected_rank, |s, along| along / s);
        let mut loss = vec![0.0; m];
        lost.iter().for_each(|u| axpy(dot(u, &hierarchy.residual[..m]), u, &mut loss));
        let compatible = dot(&loss, &loss).sqrt() <= COMPATIBLE * rounding * condition * size;
        compatibility.push(Compatibility { loss: loss.into_iter().map(|x| level.unscaled(x)).collect(), compatible });
        levels.push(LevelDiagnosis {
            rows: m,
            rank,
            projected_rank,
            singular_values,
            projected_singular_values: hierarchy.projected.svd.s().iter().map(|s| level.unscaled(*s)).collect(),
            kinematic: rank < m,
            algorithmic: projected_rank < rank.min(dim),
            lost,
        });
        hierarchy.remove(&level, projected_rank);
    }
    let stacked_rank: usize = levels.iter().map(|l| l.projected_rank).sum();
    let sum: usize = levels.iter().map(|l| l.rank).sum();
    let kind = match (stacked_rank < sum.min(n), levels.iter().any(|l| l.kinematic)) {
        (false, false) => SingularityKind::Regular,
        (true, false) => SingularityKind::Algorithmic,
        (false, true) => SingularityKind::Kinematic,
        (true, true) => SingularityKind::Both,
    };
    let compatibility = velocities.map(|_| compatibility);
    Ok(Diagnosis { n, levels, stacked_rank, overlap: sum.saturating_sub(stacked_rank), kind, compatibility })
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: stacked rank {} of {} joints", self.kind.name(), self.stacked_rank, self.n)?;
        for (i, l) in self.levels.iter().enumerate() {
            if l.lost.is_empty() {
                continue;
            }
            write!(f, "; level {} commands {} of {} rows", i + 1, l.projected_rank, l.rows)?;
            match (l.kinematic, l.projected_rank < l.rank) {
                (true, true) => write!(f, " (rank {} alone, the rest taken by higher levels)", l.rank)?,
                (true, false) => write!(f, " (rank {} alone)", l.rank)?,
                _ => write!(f, " (the rest taken by higher levels)")?,
            }
            if l.projected_rank > 0 && l.lost.len() == 1 {
                let entries: Vec<String> = l.lost[0].iter().map(|x| format!("{x:.3}")).collect();
                write!(f, " and loses direction ({})", entries.join(", "))?;
            }
            if let Some(c) = self.compatibility.as_ref().map(|c| &c[i]) {
                write!(f, "{}", if c.compatible { ", compatibly" } else { ", which the command needs" })?;
            }
        }
        write!(f, ".")
    }
}
