//! Broadcasting by the rules of numpy. Vector arguments `(..., n)` broadcast over their leading axes, and arguments that are numbers or
//! arrays broadcast over all axes.

use crate::arrays::{ArrayArgument, Axis, Form, WHATEVER, elements, numbers, owned, require_finite, shown};
use crate::errors::{Failure, input_error};
use crate::interrupts::long;
use armlet_core::error::{Error, Result as CoreResult};
use armlet_core::interrupt;
use armlet_core::memory;
use armlet_core::trace::pages::in_large_pages;
use pyo3::prelude::*;
use pyo3::types::PyFloat;
use std::borrow::Cow;
use std::ops::Range;

/// The number of rows that are copied between two checks for Ctrl-C.
pub const CHECK_PERIOD: usize = 1 << 12;

/// `K` vector arguments of a function, broadcast over their leading axes. A *row* is one vector of each.
pub struct Broadcast<'a, const K: usize> {
    /// The common leading axes.
    pub shape: Vec<usize>,
    /// The number of rows.
    pub count: usize,
    rows: [(Cow<'a, [f64]>, usize); K],
}

impl<const K: usize> Broadcast<'_, K> {
    /// The vector of argument `k` in row `i`.
    #[inline]
    pub fn row(&self, k: usize, i: usize) -> &[f64] {
        let (values, width) = &self.rows[k];
        let i = if values.len() == *width { 0 } else { i };
        &values[i * width..(i + 1) * width]
    }
}

impl<'a, const K: usize> Broadcast<'a, K> {
    /// The vectors of argument `k` in the rows `first..last`. An argument with one vector is repeated.
    pub fn rows(&self, k: usize, first: usize, last: usize) -> Cow<'_, [f64]> {
        let (values, width) = &self.rows[k];
        if values.len() == *width && self.count != 1 {
            return Cow::Owned(values.repeat(last - first));
        }
        Cow::Borrowed(&values[first * width..last * width])
    }

    /// Copy the borrowed arguments, so that other threads cannot change them.
    pub fn owned(self) -> Result<Broadcast<'static, K>, Failure> {
        let mut rows: [(Cow<'static, [f64]>, usize); K] = std::array::from_fn(|_| (Cow::Borrowed(&[][..]), 0));
        for (to, (values, width)) in rows.iter_mut().zip(self.rows) {
            *to = (Cow::Owned(owned(values)?), width);
        }
        Ok(Broadcast { shape: self.shape, count: self.count, rows })
    }

    /// Copy the vectors of argument `k`: one if the caller passed one vector for all rows, otherwise one per row.
    pub fn given(&self, k: usize) -> Result<Vec<f64>, Failure> {
        Ok(memory::copied(&self.rows[k].0)?)
    }
}

/// Refuse arguments that are not finite. Arguments of a wrong type were refused earlier.
pub fn require_all_finite<const K: usize>(function: &str, names: [&str; K], values: [&Bound<'_, PyAny>; K]) -> Result<(), Failure> {
    for k in 0..K {
        let (shape, data) = numbers(function, names[k], values[k], &[WHATEVER])?;
        require_finite(values[k].py(), function, names[k], &shape, &data)?;
    }
    Ok(())
}

/// Read arguments `(..., n)` whose last axes have these lengths, and broadcast their leading axes as numpy does.
///
/// It does not check that the numbers are finite. [`require_all_finite`] checks this.
pub fn broadcast<'a, const K: usize>(
    function: &str,
    names: [&str; K],
    values: [&'a Bound<'_, PyAny>; K],
    widths: [usize; K],
) -> Result<Broadcast<'a, K>, Failure> {
    let mut shapes: [Vec<usize>; K] = std::array::from_fn(|_| Vec::new());
    let mut rows: [(Cow<'a, [f64]>, usize); K] = std::array::from_fn(|_| (Cow::Borrowed(&[][..]), 0));
    for k in 0..K {
        let width = widths[k];
        let (mut shape, data) = numbers(function, names[k], values[k], &[Form(&[Axis::Leading, Axis::Is(width)])])?;
        shape.pop();
        shapes[k] = shape;
        rows[k] = (data, width);
    }
    let shape = common_shape(&shapes).ok_or_else(|| {
        let all = shapes.iter().map(|s| shown(s)).collect::<Vec<_>>().join(", ");
        input_error(values[0].py(), function, &names.join(", "), format!("do not broadcast: expected leading axes that agree, got {all}"))
    })?;
    let count = elements(&shape)?;
    for k in 0..K {
        let single = shapes[k].iter().product::<usize>() == 1;
        if shapes[k] != shape && !single {
            // Use a copy, because other threads may write to the caller's array while its rows are repeated.
            let own = memory::copied(&rows[k].0)?;
            rows[k].0 = Cow::Owned(long(values[k].py(), || stretch(&shapes[k], &shape, &own, widths[k]))?);
        }
    }
    Ok(Broadcast { shape, count, rows })
}

/// The common leading axes after broadcasting; `None` if these axes do not broadcast.
pub fn common_shape(shapes: &[Vec<usize>]) -> Option<Vec<usize>> {
    let axes = shapes.iter().map(Vec::len).max().unwrap_or(0);
    let mut common = vec![1; axes];
    for shape in shapes {
        let skip = axes - shape.len();
        for (i, &n) in shape.iter().enumerate() {
            let c = &mut common[skip + i];
            if *c == 1 {
                *c = n;
            } else if n != 1 && n != *c {
                return None;
            }
        }
    }
    Some(common)
}

/// Repeat the rows, of `width` numbers, of an array with the leading axes `from`, so that its leading axes become `to`.
pub fn stretch(from: &[usize], to: &[usize], data: &[f64], width: usize) -> CoreResult<Vec<f64>> {
    let count = to.iter().try_fold(1_usize, |count, &n| count.checked_mul(n)).unwrap_or(usize::MAX);
    let skip = to.len() - from.len();
    let mut out = Vec::new();
    let bytes = count as u128 * width as u128 * 8;
    out.try_reserve_exact(count.saturating_mul(width)).map_err(|_| Error::Memory { bytes })?;
    let mut index = vec![0; to.len()];
    for i in 0..count {
        if i % CHECK_PERIOD == 0 {
            interrupt::check();
        }
        let row = from.iter().zip(&index[skip..]).fold(0, |row, (&n, &i)| row * n + if n == 1 { 0 } else { i });
        out.extend_from_slice(&data[row * width..(row + 1) * width]);
        for axis in (0..to.len()).rev() {
            index[axis] += 1;
            if index[axis] < to[axis] {
                break;
            }
            index[axis] = 0;
        }
    }
    Ok(out)
}

/// Read a real number: a Python float or int, a numpy scalar, or an array without axes. The result is `None` for arrays with axes.
pub fn number_or_array(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<Option<f64>, Failure> {
    if let Ok(x) = value.cast::<PyFloat>() {
        return Ok(Some(x.value()));
    }
    let argument = ArrayArgument::new(function, name, value)?;
    Ok(if argument.shape.is_empty() { Some(argument.values()?.1[0]) } else { None })
}

/// `K` arguments that are numbers or arrays, copied, for a batch of problems. A *column* has one number for all problems, or one for each.
pub struct Columns<const K: usize> {
    pub shape: Vec<usize>,
    pub count: usize,
    /// All columns in one allocation, so that the system can use larger pages.
    numbers: Vec<f64>,
    places: [Range<usize>; K],
}

impl<const K: usize> Columns<K> {
    /// The numbers of column `k`.
    #[inline]
    pub fn column(&self, k: usize) -> &[f64] {
        &self.numbers[self.places[k].clone()]
    }

    /// The last column but one, and a mutable slice of the last column.
    pub fn last_two(&mut self) -> (&[f64], &mut [f64]) {
        let (before, last) = self.numbers.split_at_mut(self.places[K - 1].start);
        (&before[self.places[K - 2].clone()], last)
    }

    /// The numbers of problem `i` of the batch.
    #[inline]
    pub fn row(&self, i: usize) -> [f64; K] {
        std::array::from_fn(|k| if let [x] = self.column(k) { *x } else { self.column(k)[i] })
    }
}

/// A function that refuses invalid numbers. Its arguments after `py` are the function, the argument's name, the shape and the numbers.
pub type Check = fn(Python<'_>, &str, &str, &[usize], &[f64]) -> Result<(), Failure>;

/// Read arguments of any shape, broadcast them as numpy does, and apply `check` to them.
///
/// `answer` is the size of one result in bytes. Results that do not fit in memory are refused before any copy.
pub fn columns<const K: usize>(
    function: &str,
    names: [&str; K],
    values: [&Bound<'_, PyAny>; K],
    check: Check,
    answer: usize,
) -> Result<Columns<K>, Failure> {
    let mut shapes: [Vec<usize>; K] = std::array::from_fn(|_| Vec::new());
    for k in 0..K {
        shapes[k] = ArrayArgument::new(function, names[k], values[k])?.shape;
    }
    let shape = common_shape(&shapes).ok_or_else(|| {
        let all = shapes.iter().map(|s| shown(s)).collect::<Vec<_>>().join(", ");
        input_error(values[0].py(), function, &names.join(", "), format!("do not broadcast: expected shapes that agree, got {all}"))
    })?;
    let (count, answers) = (elements(&shape)?, elements(&shape)?.saturating_mul(answer));
    let total =
        shapes.iter().fold(0_usize, |total, shape| total.saturating_add(if elements(shape).is_ok_and(|n| n == 1) { 1 } else { count }));
    memory::require(total.saturating_mul(8).saturating_add(answers))?;
    let (mut all, mut places) = (in_large_pages(memory::reserved(total)?), std::array::from_fn(|_| 0..0));
    for k in 0..K {
        let (py, start) = (values[k].py(), all.len());
        let read = ArrayArgument::new(function, names[k], values[k])?.append_to(&mut all)?;
        // An object of the caller may have another shape when it is read the second time.
        if read != shapes[k] {
            let problem = format!("changes its shape: expected {}, got {}", shown(&shapes[k]), shown(&read));
            return Err(input_error(py, function, names[k], problem).into());
        }
        check(py, function, names[k], &read, &all[start..])?;
        if shapes[k] != shape && all.len() - start != 1 {
            let own = memory::copied(&all[start..])?;
            all.truncate(start);
            let stretched = long(py, || stretch(&shapes[k], &shape, &own, 1))?;
            memory::ensure(&mut all, stretched.len())?;
            all.extend_from_slice(&stretched);
        }
        places[k] = start..all.len();
    }
    Ok(Columns { count, shape, numbers: all, places })
}
