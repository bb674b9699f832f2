//! The solution of the tasks of a damped stack without bounds. A stack with active bounds prefers it along free directions.

use crate::error::Result;
use crate::linalg::Svd;
use crate::priority::hierarchy::Hierarchy;
use crate::priority::method::PriorityMethod;
use crate::priority::settings::Settings;
use crate::priority::stack::{ScaledStack, Stack};

/// The solution of the tasks without bounds, level by level.
#[derive(Debug, Clone)]
pub struct Damping {
    tasks: Stack,
    scaled: ScaledStack,
    hierarchy: Hierarchy,
    known: bool,
    /// The velocities after each level, in the coordinates of the metric, shape `(levels, n)`.
    velocities: Vec<f64>,
    /// The level whose velocity is preferred; none for zero.
    level: Option<usize>,
    /// The remaining fraction `d` of each coordinate, at the start of a level.
    pub scale: Vec<f64>,
    /// The matrix `P R` of `attenuate`, row-major, and its decomposition.
    pub product: Vec<f64>,
    pub svd: Svd,
}

impl Damping {
    /// Allocate memory for a stack.
    pub fn new(stack: &Stack) -> Self {
        Damping {
            tasks: stack.clone(),
            scaled: ScaledStack::new(stack),
            hierarchy: Hierarchy::new(stack),
            known: false,
            velocities: vec![0.0; stack.rows.len() * stack.n],
            level: None,
            scale: vec![1.0; stack.n],
            product: vec![0.0; stack.n * stack.n],
            svd: Svd::new(stack.n, stack.n),
        }
    }

    /// Forget the solution of the last stack.
    pub fn begin(&mut self) {
        self.known = false;
        self.scale.fill(1.0);
    }

    /// The preferred velocity: the solution of the tasks without bounds, down to the present level.
    pub fn preferred(&self) -> Option<&[f64]> {
        let n = self.tasks.n;
        self.level.map(|level| &self.velocities[level * n..(level + 1) * n])
    }

    /// Prefer the solution of the levels down to `level`, without bounds. `None`: prefer zero velocity.
    pub fn prefer(&mut self, level: Option<usize>, given: &Stack, settings: &Settings) -> Result<()> {
        self.level = level;
        if std::mem::replace(&mut self.known, true) {
            return Ok(());
        }
        let Damping { tasks, scaled, hierarchy, velocities, .. } = self;
        let n = tasks.n;
        tasks.load_tasks(given);
        scaled.load(tasks, settings)?;
        hierarchy.start(settings);
        for (level, velocity) in scaled.levels().zip(velocities.chunks_exact_mut(n)) {
            hierarchy.project(&level)?;
            if settings.method == PriorityMethod::Damped {
                hierarchy.damped_step(&level)?;
            } else {
                hierarchy.clamped_step(&level)?;
            }
            velocity.copy_from_slice(&hierarchy.y);
        }
        Ok(())
    }
}
