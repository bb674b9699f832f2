//! Which directions of which level can be commanded, and why not (SPEC system 2, "In general").
//!
//! `overlap = sum rank J_i - rank J_E`; **algorithmic** iff `rank J_E < min(sum rank J_i, n)`; **kinematic** iff some `rank J_i` is
//! below its number of rows. Projected ranks by the null-basis rule of `levels`, stacked rank = their sum, so the numbers agree;
//! `rank J_i` counts `s > rounding s_max`. Each level has its own scale, since tasks have different units.

use std::fmt;

use super::method::{DEFAULT_ROUNDING, PriorityMethod, PriorityOptions};
use super::solver::PrioritySolver;
use crate::error::Result;
use crate::linalg::svd::Svd;
use crate::linalg::{axpy, dot};

/// A lost part of a command is rounding below this multiple of `rounding c (|v_i| + |J_i| |v|)`.
const COMPATIBLE: f64 = 1e3;

/// The kind of singularity of the stack.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// Full rank at every level.
    Regular,
    /// Tasks of full rank that compete for the same joints.
    Algorithmic,
    /// A task alone is singular.
    Kinematic,
    /// Both kinds of singularity.
    Both,
}

impl Kind {
    /// The name used in Python.
    pub fn name(self) -> &'static str {
        match self {
            Kind::Regular => "regular",
            Kind::Algorithmic => "algorithmic",
            Kind::Kinematic => "kinematic",
            Kind::Both => "algorithmic+kinematic",
        }
    }
}

/// One level of a diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelDiagnosis {
    /// Rows of the level.
    pub rows: usize,
    /// Rank of `J_i` alone, and of `J_i N` below the levels above.
    pub rank: usize,
    /// Rank in the null space of the higher levels.
    pub projected_rank: usize,
    /// Descending, in the unit of the task over that of the joints.
    pub singular_values: Vec<f64>,
    /// Singular values in the null space of the higher levels.
    pub projected_singular_values: Vec<f64>,
    /// `rank < rows`.
    pub kinematic: bool,
    /// `projected_rank < min(rank, freedom left by the levels above)`.
    pub algorithmic: bool,
    /// Orthonormal directions of the level's command, shape `(rows,)` each, that no joint velocity in the null space of the levels above produces.
    pub lost: Vec<Vec<f64>>,
}

/// The loss of a command at one level.
#[derive(Debug, Clone, PartialEq)]
pub struct Compatibility {
    /// The part of `v_i - J_i v_above` along `lost`, shape `(rows,)`, in the unit of the task.
    pub loss: Vec<f64>,
    /// Whether it is zero up to rounding: the command can be executed exactly.
    pub compatible: bool,
}

/// Ranks, singular values and lost directions of a stack of levels.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnosis {
    /// Number of joints.
    pub n: usize,
    /// One diagnosis per level.
    pub levels: Vec<LevelDiagnosis>,
    /// Rank of all levels stacked.
    pub stacked_rank: usize,
    /// Directions that levels share.
    pub overlap: usize,
    /// The kind of singularity.
    pub kind: Kind,
    /// Per level, if commands were given.
    pub compatibility: Option<Vec<Compatibility>>,
}

impl Diagnosis {
    /// The rank of each level alone.
    pub fn ranks(&self) -> Vec<usize> {
        self.levels.iter().map(|l| l.rank).collect()
    }

    /// Rank of each level below the levels above, level 1 included.
    pub fn projected_ranks(&self) -> Vec<usize> {
        self.levels.iter().map(|l| l.projected_rank).collect()
    }
}

/// Diagnose row-major `(rows_i, n)` Jacobians, highest level first, and the command if one is given.
///
/// `rows`: rows of each level. `rounding`: relative error of the entries, `DEFAULT_ROUNDING` if `None`, `8 eps (1 + sum|q|)` when an arm made
/// them. Errors: `Input` for wrong sizes or numbers that are not finite.
pub fn diagnose(n: usize, rows: &[usize], jacobians: &[&[f64]], velocities: Option<&[&[f64]]>, rounding: Option<f64>) -> Result<Diagnosis> {
    let rounding = rounding.unwrap_or(DEFAULT_ROUNDING);
    let mut solver =
        PrioritySolver::new(n, rows, &PriorityOptions { rounding: Some(rounding), ..PriorityOptions::new(PriorityMethod::Exact) })?;
    let zeros: Vec<Vec<f64>> = rows.iter().map(|r| vec![0.0; *r]).collect();
    let zeros: Vec<&[f64]> = zeros.iter().map(Vec::as_slice).collect();
    solver.load(jacobians, velocities.unwrap_or(&zeros))?;
    solver.prepare()?;
    let w = solver.workspace();
    w.begin();
    let (mut levels, mut compatibility, mut condition) = (Vec::new(), Vec::new(), 1.0);
    for (i, &m) in rows.iter().enumerate() {
        let freedom = w.project(i)?;
        let norm = w.spectral_norm(i)?;
        let projected_rank = w.svd.rank(rounding * norm * condition);
        let mut full = Svd::new(m.max(n), m.max(n));
        full.decompose(jacobians[i], m, n)?;
        let singular_values = full.s().to_vec();
        let rank = full.rank(rounding * singular_values.first().copied().unwrap_or(0.0));
        // The left vectors beyond the rank, from the transpose, whose right basis is complete.
        let transposed: Vec<f64> = (0..freedom).flat_map(|c| (0..m).map(move |r| r * freedom + c)).map(|at| w.a[at]).collect();
        full.decompose(&transposed, freedom, m)?;
        let lost: Vec<Vec<f64>> = (projected_rank..m).map(|j| full.v(j).to_vec()).collect();
        w.rest(i);
        // Undo the scaling of an extreme level by a power of two.
        let unscale = |x: f64| x * 2f64.powi(-w.exponent[i] / 2) * 2f64.powi(-(w.exponent[i] - w.exponent[i] / 2));
        let mut loss = vec![0.0; m];
        lost.iter().for_each(|u| axpy(dot(u, &w.r[..m]), u, &mut loss));
        let size = w.level(i).map(|r| w.c[r] * w.c[r]).sum::<f64>().sqrt() + norm * dot(&w.y, &w.y).sqrt();
        let compatible = dot(&loss, &loss).sqrt() <= COMPATIBLE * rounding * condition * size;
        compatibility.push(Compatibility { loss: loss.into_iter().map(unscale).collect(), compatible });
        levels.push(LevelDiagnosis {
            rows: m,
            rank,
            projected_rank,
            singular_values,
            projected_singular_values: w.svd.s().iter().map(|s| unscale(*s)).collect(),
            kinematic: rank < m,
            algorithmic: projected_rank < rank.min(freedom),
            lost,
        });
        for j in 0..projected_rank {
            let gain = dot(w.svd.u(j), &w.r[..m]) / w.svd.s()[j];
            w.move_along(j, gain);
        }
        if projected_rank > 0 {
            condition *= norm / w.svd.s()[projected_rank - 1];
        }
        w.consume(projected_rank);
    }
    let stacked_rank: usize = levels.iter().map(|l| l.projected_rank).sum();
    let sum: usize = levels.iter().map(|l| l.rank).sum();
    let kind = match (stacked_rank < sum.min(n), levels.iter().any(|l| l.kinematic)) {
        (false, false) => Kind::Regular,
        (true, false) => Kind::Algorithmic,
        (false, true) => Kind::Kinematic,
        (true, true) => Kind::Both,
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
