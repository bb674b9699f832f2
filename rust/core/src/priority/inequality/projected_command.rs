//! The projection of a command on the range of its level in the null space of the tasks above, `P r`, and its length `L` (`scale`).

use crate::error::Result;
use crate::linalg::{axpy, dot, largest};
use crate::priority::hierarchy::Hierarchy;
use crate::priority::settings::Settings;
use crate::priority::stack::{Level, Stack};

/// A projected command below this fraction of the command, and an entry below this fraction of the largest, are rounding errors.
const ZERO_COMMAND: f64 = 16.0 * f64::EPSILON;

/// The projection of the commands on the ranges of the levels.
#[derive(Debug, Clone)]
pub struct Scaling {
    /// The null space of the tasks above, and the decomposition of the present level in it.
    pub hierarchy: Hierarchy,
    /// The rows and the command of the present level.
    pub jacobian: Vec<f64>,
    pub command: Vec<f64>,
    /// The vector `q`, shape `(rows,)`, and the length `L`.
    pub image: Vec<f64>,
    pub length: f64,
    /// The norm of the largest velocities within the bounds; infinite if a velocity has no bound.
    reach: f64,
}

impl Scaling {
    /// Allocate memory for a stack.
    pub fn new(stack: &Stack) -> Self {
        let most = stack.rows.iter().copied().max().unwrap_or(0);
        let [command, image] = [0; 2].map(|_| vec![0.0; most]);
        Scaling { hierarchy: Hierarchy::new(stack), jacobian: vec![0.0; most * stack.n], command, image, length: 0.0, reach: 0.0 }
    }

    /// Start a solve.
    pub fn begin(&mut self, settings: &Settings) {
        let Scaling { hierarchy, reach, .. } = self;
        *reach = f64::INFINITY;
        if let Some((lower, upper)) = &settings.bounds {
            let bounds = lower.iter().zip(upper);
            hierarchy.y.iter_mut().zip(bounds).for_each(|(y, (l, u))| *y = l.abs().max(u.abs()));
            settings.metric.iter().for_each(|metric| metric.coordinates(&mut hierarchy.y));
            *reach = dot(&hierarchy.y, &hierarchy.y).sqrt();
        }
        hierarchy.start(settings);
    }

    /// Project the first `m` rows on the null space, and remove their directions from it. Return the rank.
    pub fn use_rows(&mut self, m: usize) -> Result<usize> {
        let Scaling { hierarchy, jacobian, command, .. } = self;
        let n = hierarchy.y.len();
        let level = Level::of_rows(n, &jacobian[..m * n], &command[..m]);
        hierarchy.project(&level)?;
        let (rank, used) = hierarchy.count_rank(&level)?;
        hierarchy.remove(&level, used);
        Ok(rank)
    }

    /// Compute `q` and `L` of a level with `m` rows of this rank and norm.
    pub fn project_command(&mut self, m: usize, rank: usize, norm: f64) {
        let Scaling { hierarchy, command, image, length, reach, .. } = self;
        let (svd, command, image) = (&hierarchy.projected.svd, &command[..m], &mut image[..m]);
        image.fill(0.0);
        *length = 0.0;
        for j in 0..rank {
            let along = dot(svd.u(j), command);
            axpy(along, svd.u(j), image);
            *length = length.hypot(along / svd.s()[j]);
        }
        let biggest = largest(image);
        if *reach > 0.0 {
            *length = length.min(reach.max(biggest / norm));
        }
        if biggest <= ZERO_COMMAND * largest(command) {
            *length = 0.0;
        }
        image.iter_mut().for_each(|q| *q = if q.abs() > ZERO_COMMAND * biggest { *q / *length } else { 0.0 });
    }
}
