//! The levels of priority of a law: a list of tasks, or of lists of tasks that share a level.

use super::{MOST_LEVELS, Task};
use crate::arrays::{items, number};
use crate::errors::{Failure, input_error};
use armlet_core::arm::Arm;
use armlet_core::error::Error;
use armlet_core::law::Level;
use pyo3::prelude::*;
use pyo3::types::{PyList, PyTuple};

/// The tasks of a law as they are stored, and its tasks in order of priority.
pub struct Levels {
    pub stored: Py<PyTuple>,
    pub tasks: Vec<Level>,
}

impl Levels {
    /// Read the argument `tasks`. An entry is a task, or a list of tasks for one level. An entry of this list is a task or a pair of a task
    /// and its weight.
    pub fn read(function: &str, tasks: &Bound<'_, PyAny>, arm: &Arm) -> Result<Self, Failure> {
        let py = tasks.py();
        let refuse = |argument: &str, problem: String| -> Failure { input_error(py, function, argument, problem).into() };
        if tasks.is_instance_of::<Task>() {
            return Err(refuse("tasks", "is a single task: expected a list of tasks, the highest first".into()));
        }
        let entries = items(function, "tasks", "a list: expected tasks, the highest first", tasks, MOST_LEVELS)?;
        if entries.is_empty() {
            return Err(refuse("tasks", "is empty: expected at least one task, got 0".into()));
        }
        let (mut stored, mut levels) = (Vec::with_capacity(entries.len()), Vec::with_capacity(entries.len()));
        for (i, entry) in entries.iter().enumerate() {
            let place = format!("tasks[{i}]");
            let is_group = entry.is_instance_of::<PyList>() || entry.is_instance_of::<PyTuple>();
            if !is_group {
                let Ok(task) = entry.cast::<Task>() else {
                    let kind = entry.get_type().name().map(|name| name.to_string()).unwrap_or_default();
                    return Err(refuse("tasks", format!("is of the wrong type: expected tasks, got {kind} (first bad index {i})")));
                };
                levels.push(named(task.get().level(arm), &place)?);
                stored.push(entry.clone());
                continue;
            }
            let group = items(function, &place, "a list: expected tasks of one level", entry, MOST_LEVELS)?;
            if group.is_empty() {
                return Err(refuse(&place, "is empty: expected at least one task of the level, got 0".into()));
            }
            for (j, member) in group.iter().enumerate() {
                let place = format!("tasks[{i}][{j}]");
                let pair = member.cast::<PyTuple>().ok().filter(|pair| pair.len() == 2);
                let first = pair.map_or(Ok(member.clone()), |pair| pair.get_item(0))?;
                let Ok(task) = first.cast::<Task>() else {
                    return Err(refuse(&place, "is of the wrong type: expected a task, or a task and its weight".into()));
                };
                let mut level = named(task.get().level(arm), &place)?;
                level.joins = j > 0;
                if let Some(pair) = pair {
                    level.weight = number(function, &place, &pair.get_item(1)?)?;
                    if !(level.weight > 0.0 && level.weight.is_finite()) {
                        return Err(refuse(&place, format!("has no positive weight: expected a finite number > 0, got {}", level.weight)));
                    }
                }
                levels.push(level);
            }
            stored.push(PyTuple::new(py, group)?.into_any());
        }
        if levels.len() > MOST_LEVELS {
            return Err(refuse("tasks", format!("is too long: expected at most {MOST_LEVELS} tasks, got {}", levels.len())));
        }
        Ok(Levels { stored: PyTuple::new(py, stored)?.unbind(), tasks: levels })
    }

    /// The number of levels.
    pub fn count(&self) -> usize {
        self.tasks.iter().filter(|task| !task.joins).count()
    }
}

/// Name the place of a task in an error of one of its arguments.
fn named<T>(made: Result<T, Error>, place: &str) -> Result<T, Error> {
    made.map_err(|error| match error.argument().map(|argument| format!("{place}.{argument}")) {
        Some(argument) => error.of_argument(argument),
        None => error,
    })
}
