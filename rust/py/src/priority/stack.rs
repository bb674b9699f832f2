//! The arguments of priority solvers: lists of Jacobians `(..., rows_i, n)` and task velocities `(..., rows_i)`, one array per level.
//!
//! The arrays are checked and broadcast over their leading axes. A *row of the batch* is one stack: one Jacobian and one velocity per
//! level.

use crate::arguments::require_partner;
use crate::arrays::{self, ArrayArgument, Axis, Form, PIECE, SCALAR, numbers, of_shape, owned, require_finite, shown, spread};
use crate::broadcast::{common_shape, stretch};
use crate::errors::{Failure, input_error};
use crate::interrupts::long;
use crate::task::MOST_LEVELS;
use armlet_core::memory;
use armlet_core::priority::{PriorityMethod, PriorityOptions};
use pyo3::prelude::*;
use std::borrow::Cow;

/// Return the entries of a list, tuple or other iterable of arrays, one per level.
pub fn items<'py>(function: &str, name: &str, value: &Bound<'py, PyAny>) -> Result<Vec<Bound<'py, PyAny>>, Failure> {
    arrays::items(function, name, "a list of arrays: expected one per level", value, MOST_LEVELS)
}

/// One array of one level: its elements, its leading axes, and `width`, the number of elements per row of the batch.
struct Part<'a> {
    values: Cow<'a, [f64]>,
    /// The caller's array, if its elements are not in `values`.
    lent: Option<&'a Bound<'a, PyAny>>,
    lead: Vec<usize>,
    shape: Vec<usize>,
    width: usize,
}

impl Part<'_> {
    #[inline]
    fn row(&self, i: usize) -> &[f64] {
        let i = if self.values.len() == self.width { 0 } else { i };
        &self.values[i * self.width..(i + 1) * self.width]
    }

    fn owned(self) -> Result<Part<'static>, Failure> {
        Ok(Part { values: Cow::Owned(owned(self.values)?), lent: None, lead: self.lead, shape: self.shape, width: self.width })
    }
}

impl<'a> Part<'a> {
    /// Read one array. Its last `axes` axes belong to one stack, and the others are leading axes. With `lend`, a large array with leading
    /// axes is not copied.
    fn new(value: &'a Bound<'a, PyAny>, argument: ArrayArgument<'_, 'a, '_>, axes: usize, lend: bool) -> Result<Self, Failure> {
        let lent = lend && argument.is_in_place() && argument.shape.len() > axes && argument.shape.iter().product::<usize>() > PIECE;
        let (shape, values) = if lent { (argument.shape, Cow::Borrowed(&[][..])) } else { argument.values()? };
        let (lead, last) = shape.split_at(shape.len() - axes);
        Ok(Part { values, lent: lent.then_some(value), lead: lead.to_vec(), width: last.iter().product(), shape })
    }

    /// The elements; `None` if the caller's array has changed since its shape was read.
    fn elements(&self) -> Option<&[f64]> {
        self.lent.map_or(Some(&*self.values), |array| of_shape(array, &self.shape))
    }

    /// The elements of the rows `first..last` of the batch. An array without leading axes returns all its elements.
    fn rows(&self, first: usize, last: usize) -> Option<&[f64]> {
        let all = self.elements()?;
        Some(if all.len() == self.width { all } else { &all[first * self.width..last * self.width] })
    }
}

/// A stack of levels, or a batch of stacks with leading axes.
pub struct Stack<'a> {
    pub n: usize,
    pub rows: Vec<usize>,
    /// The leading axes after broadcasting; empty for a single stack.
    pub lead: Vec<usize>,
    pub count: usize,
    jacobians: Vec<Part<'a>>,
    velocities: Vec<Part<'a>>,
    names: [&'static str; 2],
    /// Whether each level has bounds, which may be infinite. Empty if no level has bounds.
    pub intervals: Vec<bool>,
}

impl<'a> Stack<'a> {
    /// Read a stack. Small contiguous arrays are borrowed, and other arrays are copied. `names` are the names of the two arguments. A
    /// diagnosis may have no `velocities`.
    pub fn read(
        py: Python<'_>,
        function: &str,
        names: [&'static str; 2],
        jacobians: &'a [Bound<'a, PyAny>],
        velocities: Option<&'a [Bound<'a, PyAny>]>,
    ) -> Result<Self, Failure> {
        Self::read_or_lend(py, function, names, jacobians, velocities, false)
    }

    /// Read a stack as [`Stack::read`] does. With `lend`, large arrays are not copied, and only [`Stack::piece`] reads them.
    pub fn read_or_lend(
        py: Python<'_>,
        function: &str,
        names: [&'static str; 2],
        jacobians: &'a [Bound<'a, PyAny>],
        velocities: Option<&'a [Bound<'a, PyAny>]>,
        lend: bool,
    ) -> Result<Self, Failure> {
        let refuse = |argument: &str, problem: String| -> Failure { input_error(py, function, argument, problem).into() };
        if jacobians.is_empty() {
            return Err(refuse(names[0], "is empty: expected at least one level, got 0".into()));
        }
        if let Some(velocities) = velocities
            && velocities.len() != jacobians.len()
        {
            let problem = format!("has the wrong number of levels: expected {}, got {}", jacobians.len(), velocities.len());
            return Err(refuse(names[1], problem));
        }
        let mut n = 0;
        let (mut blocks, mut commands, mut rows) = (Vec::new(), Vec::new(), Vec::new());
        for (i, jacobian) in jacobians.iter().enumerate() {
            let name = format!("{}[{i}]", names[0]);
            let argument =
                ArrayArgument::new(function, &name, jacobian)?.of(&[Form(&[Axis::Leading, Axis::Any("rows"), Axis::Any("n")])])?;
            let [m, columns] = argument.shape.last_chunk().copied().unwrap_or_default();
            if i == 0 {
                n = columns;
                if n == 0 {
                    return Err(refuse(&name, format!("has no columns: expected at least one joint, got {}", shown(&argument.shape))));
                }
            }
            if columns != n {
                return Err(refuse(&name, format!("has the wrong number of columns: expected {n}, got {columns}")));
            }
            rows.push(m);
            require_size(py, function, n, &rows)?;
            blocks.push(Part::new(jacobian, argument, 2, lend)?);
        }
        for (i, velocity) in velocities.unwrap_or_default().iter().enumerate() {
            let name = format!("{}[{i}]", names[1]);
            let argument = ArrayArgument::new(function, &name, velocity)?;
            if argument.shape.last() != Some(&rows[i]) {
                // If the Jacobian has no leading axes, the message about a wrong shape expects `(rows_i,)`.
                let form = if blocks[i].lead.is_empty() { &[Axis::Is(rows[i])][..] } else { &[Axis::Leading, Axis::Is(rows[i])] };
                return Err(argument.of_another_shape(&[Form(form)]));
            }
            commands.push(Part::new(velocity, argument, 1, lend)?);
        }
        let leads: Vec<Vec<usize>> = blocks.iter().chain(&commands).map(|part| part.lead.clone()).collect();
        let lead = common_shape(&leads).ok_or_else(|| {
            let all = leads.iter().map(|s| shown(s)).collect::<Vec<_>>().join(", ");
            refuse(&names.join(", "), format!("do not broadcast: expected leading axes that agree, got {all}"))
        })?;
        let count = lead.iter().product();
        for part in blocks.iter_mut().chain(&mut commands) {
            if part.lead != lead && part.lead.iter().product::<usize>() != 1 {
                // Use a copy, because other threads may write to the caller's array while its rows are repeated.
                let own = memory::copied(part.elements().ok_or_else(|| changed(py, function))?)?;
                part.lent = None;
                part.values = Cow::Owned(long(py, || stretch(&part.lead, &lead, &own, part.width))?);
            }
        }
        Ok(Stack { n, rows, lead, count, jacobians: blocks, velocities: commands, names, intervals: Vec::new() })
    }

    pub fn jacobian(&self, level: usize, i: usize) -> &[f64] {
        self.jacobians[level].row(i)
    }

    pub fn velocity(&self, level: usize, i: usize) -> &[f64] {
        self.velocities[level].row(i)
    }

    /// The Jacobians and the velocities of the rows `first..last`, level by level. An array without leading axes contributes one matrix or
    /// vector, which is valid for all rows.
    ///
    /// They may be the caller's arrays, so the interpreter lock must be held while they are read.
    pub fn piece(&self, py: Python<'_>, function: &str, first: usize, last: usize) -> Result<[Vec<&[f64]>; 2], Failure> {
        match (rows_of(&self.jacobians, first, last), rows_of(&self.velocities, first, last)) {
            (Some(jacobians), Some(velocities)) => Ok([jacobians, velocities]),
            _ => Err(changed(py, function)),
        }
    }

    /// The count of numbers in a row of the batch.
    pub fn width(&self) -> usize {
        self.jacobians.iter().chain(&self.velocities).map(|part| part.width).sum()
    }

    /// The Jacobians and the velocities of a level for all rows. An array without leading axes is one matrix or vector for all rows.
    pub fn level(&self, level: usize) -> (&[f64], &[f64]) {
        (&self.jacobians[level].values, &self.velocities[level].values)
    }

    /// Refuse numbers that are not finite. The error names the level and the index.
    pub fn require_finite(&self, py: Python<'_>, function: &str) -> Result<(), Failure> {
        for (parts, name) in [(&self.jacobians, self.names[0]), (&self.velocities, self.names[1])] {
            let bounds = |i: usize| name == self.names[1] && self.intervals.get(i) == Some(&true);
            for (i, part) in parts.iter().enumerate().filter(|(i, _)| !bounds(*i)) {
                require_finite(py, function, &format!("{name}[{i}]"), &part.shape, &part.values)?;
            }
        }
        Ok(())
    }

    /// Copy the borrowed velocities, and forget the Jacobians.
    pub fn owned_velocities(self) -> Result<Vec<Cow<'static, [f64]>>, Failure> {
        self.velocities.into_iter().map(|part| part.owned().map(|part| part.values)).collect()
    }

    /// Copy the borrowed arrays, so that the interpreter lock can be released.
    pub fn owned(self) -> Result<Stack<'static>, Failure> {
        Ok(Stack {
            n: self.n,
            rows: self.rows,
            lead: self.lead,
            count: self.count,
            jacobians: self.jacobians.into_iter().map(Part::owned).collect::<Result<_, _>>()?,
            velocities: self.velocities.into_iter().map(Part::owned).collect::<Result<_, _>>()?,
            names: self.names,
            intervals: self.intervals,
        })
    }
}

/// The elements of the rows `first..last` of each part.
fn rows_of<'s>(parts: &'s [Part<'_>], first: usize, last: usize) -> Option<Vec<&'s [f64]>> {
    parts.iter().map(|part| part.rows(first, last)).collect()
}

/// The error for an array that another thread has changed.
fn changed(py: Python<'_>, function: &str) -> Failure {
    let problem = "were changed while they were read: expected arrays that keep their size and layout";
    input_error(py, function, "jacobians, velocities", problem).into()
}

/// Refuse sizes that would need too much memory. They can occur if the caller passes the transpose of an array with many rows.
pub fn require_size(py: Python<'_>, function: &str, n: usize, rows: &[usize]) -> Result<(), Failure> {
    let total = rows.iter().fold(0usize, |sum, m| sum.saturating_add(*m));
    for (name, size) in [("n", n), ("rows", total)] {
        if size > MOST_LEVELS {
            return Err(input_error(py, function, name, format!("is too large: expected at most {MOST_LEVELS}, got {size}")).into());
        }
    }
    Ok(())
}

/// Read one number for all `n` joints or levels, or one for each. Infinite numbers are accepted, and the core refuses NaN.
pub fn per_joint(function: &str, name: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<Vec<f64>, Failure> {
    let (shape, values) = numbers(function, name, value, &[SCALAR, Form(&[Axis::Is(n)])])?;
    spread(&shape, values, n)
}

/// Read the name of the method, whose default is "clamp".
#[inline]
pub fn method_name<'a>(function: &str, given: Option<&'a Bound<'_, PyAny>>) -> Result<&'a str, Failure> {
    given.map_or(Ok("clamp"), |method| arrays::name(function, "method", method))
}

/// The common Python keywords of all solvers.
#[derive(Clone, Copy)]
pub struct Keywords<'a, 'py> {
    pub method: &'a str,
    pub eps: Option<&'a Bound<'py, PyAny>>,
    pub rounding: Option<f64>,
    pub weight: Option<&'a Bound<'py, PyAny>>,
    pub v_min: Option<&'a Bound<'py, PyAny>>,
    pub v_max: Option<&'a Bound<'py, PyAny>>,
    pub scale: Option<&'a Bound<'py, PyAny>>,
}

impl Keywords<'_, '_> {
    /// Whether the caller set no other keywords than the method and the rounding.
    pub fn plain(&self) -> bool {
        [self.eps, self.weight, self.v_min, self.v_max, self.scale].iter().all(Option::is_none)
    }

    pub fn options(&self, function: &str, n: usize, levels: usize) -> Result<PriorityOptions, Failure> {
        let method = PriorityMethod::from_name(self.method)?;
        let mut options = PriorityOptions { rounding: self.rounding, ..PriorityOptions::new(method) };
        require_partner(function, "eps", self.eps, "the methods clamp, damped and chiaverini", method.has_threshold())?;
        for (name, value) in [("v_min", self.v_min), ("v_max", self.v_max)] {
            require_partner(function, name, value, "the methods exact, clamp, damped and sns", method.accepts_bounds())?;
        }
        if let Some(scale) = self.scale {
            let name = arrays::name(function, "scale", scale)?;
            if name != "direction" {
                return Err(
                    input_error(scale.py(), function, "scale", format!("is unknown: expected direction or None, got {name}")).into()
                );
            }
            require_partner(function, "scale", self.scale, "the methods exact and sns", method.keeps_direction())?;
            options.keep_direction = true;
        }
        if let Some(eps) = self.eps {
            options.eps = Some(per_joint(function, "eps", eps, levels)?);
        }
        if let Some(weight) = self.weight {
            let (shape, values) = numbers(function, "weight", weight, &[Form(&[Axis::Is(n), Axis::Is(n)])])?;
            require_finite(weight.py(), function, "weight", &shape, &values)?;
            options.weight = Some(owned(values)?);
        }
        options.v_min = self.v_min.map(|v| per_joint(function, "v_min", v, n)).transpose()?;
        options.v_max = self.v_max.map(|v| per_joint(function, "v_max", v, n)).transpose()?;
        Ok(options)
    }
}
