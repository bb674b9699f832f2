//! Arrays in and out: the one place where numbers cross the boundary, and the only `unsafe` of this crate.
//!
//! A C-contiguous, aligned float64 array is read in place, without the borrow tracking of `PyReadonlyArray`,
//! which costs a global lock per array. Everything else (lists, integers, float32, strided, reversed, Fortran,
//! read-only) goes through `numpy.asarray`; complex, object, boolean and string arrays are refused.

mod single;

pub use single::{count, flag, flag_or_false, name, number, object, optional_number, text};

use crate::errors::{Failure, input_error};
use armlet_core::error::{Error, all_finite};
use numpy::{Element, PyArray1, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods, npyffi};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use pyo3::types::{PyFloat, PyList, PyTuple};
use std::borrow::Cow;
use std::ffi::c_int;
use std::ptr::null_mut;

pub type Converted<'a> = Result<(Vec<usize>, Cow<'a, [f64]>), Failure>;

/// The elements of a C-contiguous, aligned float64 array, in place.
fn in_place<'a>(array: &'a Bound<'_, PyArrayDyn<f64>>) -> Option<&'a [f64]> {
    // SAFETY: the GIL is held while the slice is used (callers copy before they release it), so no Python code
    // can write to or free the array meanwhile; contiguity and alignment are checked, and `Bound` keeps it alive.
    unsafe {
        let flags = (*array.as_array_ptr()).fields.flags;
        let wanted = npyffi::flags::NPY_ARRAY_C_CONTIGUOUS | npyffi::flags::NPY_ARRAY_ALIGNED;
        if flags & wanted != wanted {
            return None;
        }
        if array.len() == 0 {
            return Some(&[]);
        }
        Some(std::slice::from_raw_parts(array.data(), array.len()))
    }
}

fn numpy_function<'py>(py: Python<'py>, name: &'static str) -> PyResult<Bound<'py, PyAny>> {
    static NUMPY: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let numpy = NUMPY.get_or_try_init(py, || PyResult::Ok(py.import("numpy")?.into_any().unbind()))?;
    numpy.bind(py).getattr(name)
}

/// The numbers of a list or tuple of floats, without asking numpy; None of anything else.
fn floats(value: &Bound<'_, PyAny>) -> Option<Vec<f64>> {
    let float = |item: Bound<'_, PyAny>| item.cast::<PyFloat>().ok().map(|x| x.value());
    if let Ok(list) = value.cast_exact::<PyList>() {
        return list.iter().map(float).collect();
    }
    value.cast_exact::<PyTuple>().ok()?.iter().map(float).collect()
}

/// Any array of real numbers: its shape and its elements in C order.
pub fn numbers<'a>(function: &str, name: &str, value: &'a Bound<'_, PyAny>) -> Converted<'a> {
    if let Ok(array) = value.cast::<PyArrayDyn<f64>>()
        && let Some(slice) = in_place(array)
    {
        return Ok((array.shape().to_vec(), Cow::Borrowed(slice)));
    }
    if let Some(values) = floats(value) {
        return Ok((vec![values.len()], Cow::Owned(values)));
    }
    let py = value.py();
    let refuse = |got: String| {
        Failure::Python(input_error(py, function, name, format!("is not an array of real numbers: expected float64, got {got}")))
    };
    let array = match numpy_function(py, "asarray")?.call1((value,)) {
        Ok(array) => array,
        Err(error) if error.is_instance_of::<pyo3::exceptions::PyValueError>(py) => return Err(refuse("rows of different lengths".into())),
        Err(error) => return Err(error.into()),
    };
    let dtype = array.getattr("dtype")?;
    let kind: String = dtype.getattr("kind")?.extract()?;
    if !matches!(kind.as_str(), "i" | "u" | "f") {
        return Err(refuse(dtype.str()?.to_string()));
    }
    let shape: Vec<usize> = array.getattr("shape")?.extract()?;
    // A fresh array is aligned as well as contiguous, which `ascontiguousarray` does not promise.
    let array = numpy_function(py, "array")?.call1((&array, "float64"))?;
    let array = numpy_function(py, "ascontiguousarray")?.call1((&array,))?;
    let array = array.cast::<PyArrayDyn<f64>>().map_err(|_| refuse("something else".into()))?;
    match in_place(array) {
        Some(slice) => Ok((shape, Cow::Owned(slice.to_vec()))),
        None => Err(refuse("an array that numpy could not copy".into())),
    }
}

/// The number of elements of an array of this shape; more than memory can address is a `MemoryError`.
pub fn elements(shape: &[usize]) -> Result<usize, Failure> {
    if let Some(bytes) = shape.iter().try_fold(8_usize, |bytes, &n| bytes.checked_mul(n))
        && bytes <= isize::MAX as usize
    {
        return Ok(bytes / 8);
    }
    let bytes = shape.iter().fold(8_u128, |bytes, &n| bytes.saturating_mul(n as u128));
    if bytes > isize::MAX as u128 { Err(Error::Memory { bytes }.into()) } else { Ok(bytes as usize / 8) }
}

/// The row and column, or whatever the indices are, of element `k` of an array of this shape.
pub fn index_of(shape: &[usize], mut k: usize) -> String {
    let mut index = vec![0; shape.len()];
    for (i, &n) in index.iter_mut().zip(shape).rev() {
        *i = k % n;
        k /= n;
    }
    match index.as_slice() {
        [i] => i.to_string(),
        many => format!("({})", many.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// Refuse numbers that are not finite.
pub fn require_finite(py: Python<'_>, function: &str, name: &str, shape: &[usize], values: &[f64]) -> Result<(), Failure> {
    if all_finite(values) {
        return Ok(());
    }
    match values.iter().position(|x| !x.is_finite()) {
        None => Ok(()),
        Some(k) if shape.is_empty() => {
            Err(input_error(py, function, name, format!("is not finite: expected a finite number, got {}", values[k])).into())
        }
        Some(k) => {
            let index = index_of(shape, k);
            Err(input_error(
                py,
                function,
                name,
                format!("is not finite: expected finite numbers, got {} (first bad index {index})", values[k]),
            )
            .into())
        }
    }
}

/// How a shape reads in Python: `(3,)`, `(2, 7)`.
pub fn shown(shape: &[usize]) -> String {
    match shape {
        [n] => format!("({n},)"),
        many => format!("({})", many.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// A finite vector of length `n`, copied.
pub fn vector(function: &str, name: &str, value: &Bound<'_, PyAny>, n: usize) -> Result<Vec<f64>, Failure> {
    let (shape, values) = numbers(function, name, value)?;
    if shape != [n] {
        return Err(input_error(value.py(), function, name, format!("has the wrong shape: expected ({n},), got {}", shown(&shape))).into());
    }
    require_finite(value.py(), function, name, &shape, &values)?;
    Ok(values.into_owned())
}

/// Three finite numbers, zero where none are given.
pub fn three(function: &str, name: &str, value: Option<&Bound<'_, PyAny>>) -> Result<[f64; 3], Failure> {
    let Some(value) = value else { return Ok([0.0; 3]) };
    let values = vector(function, name, value, 3)?;
    Ok([values[0], values[1], values[2]])
}

/// A finite vector of any length, copied.
pub fn any_vector(function: &str, name: &str, value: &Bound<'_, PyAny>) -> Result<Vec<f64>, Failure> {
    let (shape, values) = numbers(function, name, value)?;
    if shape.len() != 1 {
        return Err(input_error(value.py(), function, name, format!("has the wrong shape: expected (n,), got {}", shown(&shape))).into());
    }
    require_finite(value.py(), function, name, &shape, &values)?;
    Ok(values.into_owned())
}

/// The elements of a C-contiguous, aligned float64 array of exactly this shape, in place; None for anything else.
///
/// For hot reads: `numbers` takes what this leaves.
#[inline]
pub fn of_shape<'a>(value: &'a Bound<'_, PyAny>, shape: &[usize]) -> Option<&'a [f64]> {
    // SAFETY: the pointer is compared, not followed.
    of_class(value, shape, unsafe { npyffi::get_type_object(value.py(), npyffi::NpyTypes::PyArray_Type) })
}

/// Vectors of these lengths, each as for `of_shape`.
#[inline]
pub fn of_lengths<'a, const K: usize>(values: [&'a Bound<'_, PyAny>; K], lengths: [usize; K]) -> Option<[&'a [f64]; K]> {
    let mut all: [&[f64]; K] = [&[]; K];
    if K > 0 {
        // SAFETY: the pointer is compared, not followed.
        let class = unsafe { npyffi::get_type_object(values[0].py(), npyffi::NpyTypes::PyArray_Type) };
        for k in 0..K {
            all[k] = of_class(values[k], &[lengths[k]], class)?;
        }
    }
    Some(all)
}

/// As `of_shape`; `class` is numpy's array type.
#[inline(always)]
fn of_class<'a>(value: &'a Bound<'_, PyAny>, shape: &[usize], class: *mut pyo3::ffi::PyTypeObject) -> Option<&'a [f64]> {
    let flags = npyffi::flags::NPY_ARRAY_C_CONTIGUOUS | npyffi::flags::NPY_ARRAY_ALIGNED;
    // SAFETY: an object of exactly numpy's array type has these fields, its descriptor too; otherwise as for `in_place`.
    unsafe {
        if pyo3::ffi::Py_TYPE(value.as_ptr()) != class {
            return None;
        }
        let array = &(*value.as_ptr().cast::<npyffi::PyArrayObject>()).fields;
        let kind = &(*array.descr).fields;
        let native = kind.type_num == npyffi::NPY_TYPES::NPY_DOUBLE as i32 && kind.byteorder as u8 == b'=';
        if !native || array.flags & flags != flags || array.nd as usize != shape.len() {
            return None;
        }
        let mut length = 1;
        for (k, &n) in shape.iter().enumerate() {
            if *array.dimensions.add(k) != n as isize {
                return None;
            }
            length *= n;
        }
        Some(if length == 0 { &[] } else { std::slice::from_raw_parts(array.data.cast::<f64>(), length) })
    }
}

/// The elements of a caller's `out=` array, writeable and otherwise as for `of_shape`; None for what `out_slice` refuses or copies.
///
/// For hot writes: that no input overlaps is the caller's to know.
#[inline]
#[allow(clippy::mut_from_ref)]
pub fn out_of_shape<'a>(value: &'a Bound<'_, PyAny>, shape: &[usize]) -> Option<&'a mut [f64]> {
    let length = of_shape(value, shape)?.len();
    // SAFETY: `of_shape` has seen that this is an array with such elements; the GIL is held while they are written.
    unsafe {
        let array = &(*value.as_ptr().cast::<npyffi::PyArrayObject>()).fields;
        if length == 0 || array.flags & npyffi::flags::NPY_ARRAY_WRITEABLE == 0 {
            return None;
        }
        Some(std::slice::from_raw_parts_mut(array.data.cast::<f64>(), length))
    }
}

/// A new array of this shape that takes these values over.
pub fn integers<'py, T: Element>(py: Python<'py>, shape: &[usize], values: Vec<T>) -> PyResult<Bound<'py, PyAny>> {
    Ok(PyArray1::from_vec(py, values).reshape(shape)?.into_any())
}

/// A new array of this shape, zero but for what `fill` writes.
pub fn new_array<'py>(
    py: Python<'py>,
    shape: &[usize],
    fill: impl FnOnce(&mut [f64]) -> Result<(), Failure>,
) -> Result<Bound<'py, PyAny>, Failure> {
    made(py, shape, true, fill)
}

/// A new array of this shape, every number of it written by `fill`: what was in the memory before would show. Zeroing an array
/// that is written once anyway costs a pass over memory.
pub fn written_array<'py>(
    py: Python<'py>,
    shape: &[usize],
    fill: impl FnOnce(&mut [f64]) -> Result<(), Failure>,
) -> Result<Bound<'py, PyAny>, Failure> {
    made(py, shape, false, fill)
}

/// Several of them, written together.
pub fn written_arrays<'py, const N: usize>(
    py: Python<'py>,
    shape: &[usize],
    fill: impl FnOnce([&mut [f64]; N]) -> Result<(), Failure>,
) -> Result<[Bound<'py, PyAny>; N], Failure> {
    let arrays = (0..N).map(|_| written_array(py, shape, |_| Ok(()))).collect::<Result<Vec<_>, _>>()?;
    let arrays: [_; N] = arrays.try_into().unwrap_or_else(|_| unreachable!("as many as were made"));
    fill(arrays.each_ref().map(|array| out_of_shape(array, shape).unwrap_or_default()))?;
    Ok(arrays)
}

fn made<'py>(
    py: Python<'py>,
    shape: &[usize],
    zeroed: bool,
    fill: impl FnOnce(&mut [f64]) -> Result<(), Failure>,
) -> Result<Bound<'py, PyAny>, Failure> {
    let count = elements(shape)?;
    let (api, axes, dims) = (&npyffi::PY_ARRAY_API, shape.len() as c_int, shape.as_ptr().cast_mut().cast());
    let number = npyffi::NPY_TYPES::NPY_DOUBLE as c_int;
    // What fits in a cache is zeroed by hand, quicker than by the system.
    let by_system = zeroed && count > 1024;
    // SAFETY: the shape is that many sizes, read and not kept; what numpy has no memory for is null and a MemoryError.
    let array = unsafe {
        let array = if by_system {
            api.PyArray_Zeros(py, axes, dims, api.PyArray_DescrFromType(py, number), 0)
        } else {
            let class = npyffi::get_type_object(py, npyffi::NpyTypes::PyArray_Type);
            api.PyArray_New(py, class, axes, dims, number, null_mut(), null_mut(), 0, 0, null_mut())
        };
        Bound::from_owned_ptr_or_err(py, array)?
    };
    if count > 0 {
        // SAFETY: contiguous, aligned, of some bits that are float64 whatever they are, and nobody else has seen the array yet.
        let out = unsafe {
            let array = &(*array.as_ptr().cast::<npyffi::PyArrayObject>()).fields;
            std::slice::from_raw_parts_mut(array.data.cast::<f64>(), count)
        };
        if zeroed && !by_system {
            out.fill(0.0);
        }
        fill(out)?;
    } else {
        fill(&mut [])?;
    }
    Ok(array)
}

/// Overwrite an array that `new_array` made and Python may hold too: of the same length, contiguous.
pub fn overwrite(array: &Bound<'_, PyAny>, values: &[f64]) -> Result<(), Failure> {
    let array = array.cast::<PyArrayDyn<f64>>().map_err(PyErr::from)?;
    assert!(array.len() == values.len() && array.is_c_contiguous(), "an array of the extension's own");
    // SAFETY: the elements are those checked above; the GIL is held and no other borrow is alive here.
    unsafe { std::slice::from_raw_parts_mut(array.data(), values.len()) }.copy_from_slice(values);
    Ok(())
}

/// A vector of the extension's own that callables are given one after another: written anew only while nobody else can see it.
#[derive(Default)]
pub struct Lent(Option<Py<PyArray1<f64>>>);

impl Lent {
    /// An array that holds `values`.
    pub fn array<'py>(&mut self, py: Python<'py>, values: &[f64]) -> Bound<'py, PyAny> {
        if let Some(kept) = &self.0
            && unseen(kept.bind(py), values.len())
        {
            // SAFETY: contiguous, aligned and of this length, and nobody else holds it or knows where it is.
            unsafe { std::slice::from_raw_parts_mut(kept.bind(py).data(), values.len()) }.copy_from_slice(values);
        } else {
            self.0 = Some(PyArray1::from_slice(py, values).unbind());
        }
        match &self.0 {
            Some(kept) => kept.bind(py).clone().into_any(),
            None => unreachable!("just kept"),
        }
    }
}

/// Whether an array of `n` numbers is as it was made and held by its owner alone.
fn unseen(array: &Bound<'_, PyArray1<f64>>, n: usize) -> bool {
    use npyffi::flags::{NPY_ARRAY_ALIGNED, NPY_ARRAY_C_CONTIGUOUS, NPY_ARRAY_OWNDATA, NPY_ARRAY_WRITEABLE};
    let wanted = NPY_ARRAY_C_CONTIGUOUS | NPY_ARRAY_ALIGNED | NPY_ARRAY_OWNDATA | NPY_ARRAY_WRITEABLE;
    // SAFETY: reads of a live array's own fields, with the GIL held. A callable may have changed its shape, its type or its flags.
    unsafe {
        let fields = &(*array.as_array_ptr()).fields;
        pyo3::ffi::Py_REFCNT(array.as_ptr()) == 1
            && fields.weakreflist.is_null()
            && fields.base.is_null()
            && fields.flags & wanted == wanted
            && fields.nd == 1
            && *fields.dimensions == n as npyffi::npy_intp
            && array.cast::<PyArrayDyn<f64>>().is_ok()
    }
}

/// A new vector, filled by `fill`.
pub fn new_vector<'py>(
    py: Python<'py>,
    n: usize,
    fill: impl FnOnce(&mut [f64]) -> Result<(), Failure>,
) -> Result<Bound<'py, PyAny>, Failure> {
    new_array(py, &[n], fill)
}

/// The elements of a caller's `out=` array of the wanted shape, refused where writing it would be wrong.
// The array owns its elements and Python shares it freely: `&Bound` is all that ever stands for one.
#[allow(clippy::mut_from_ref)]
pub fn out_slice<'a>(
    function: &str,
    value: &'a Bound<'_, PyAny>,
    shape: &[usize],
    inputs: &[&Bound<'_, PyAny>],
) -> Result<&'a mut [f64], Failure> {
    let py = value.py();
    let refuse = |problem: String| -> Failure { input_error(py, function, "out", problem).into() };
    let Ok(array) = value.cast::<PyArrayDyn<f64>>() else {
        return Err(refuse(format!("is not a float64 array: expected shape {}, got {}", shown(shape), value.get_type())));
    };
    if array.shape() != shape {
        return Err(refuse(format!("has the wrong shape: expected {}, got {}", shown(shape), shown(array.shape()))));
    }
    if in_place(array).is_none() {
        return Err(refuse("is not C-contiguous: expected a C-contiguous array".into()));
    }
    // SAFETY: the flags are read under the GIL.
    if unsafe { (*array.as_array_ptr()).fields.flags } & npyffi::flags::NPY_ARRAY_WRITEABLE == 0 {
        return Err(refuse("is read-only: expected a writeable array".into()));
    }
    for input in inputs {
        let Ok(input) = input.cast::<PyArrayDyn<f64>>() else { continue };
        // SAFETY: pointers are compared, not followed.
        if unsafe { overlaps(array, input) } {
            return Err(refuse("overlaps an argument: expected an array of its own".into()));
        }
    }
    // SAFETY: contiguous, aligned, writeable, apart from the inputs, and the GIL is held while it is written.
    Ok(unsafe { std::slice::from_raw_parts_mut(array.data(), array.len()) })
}

/// A new array of truth values.
pub fn new_flags<'py>(py: Python<'py>, shape: &[usize], values: &[bool]) -> PyResult<Bound<'py, PyAny>> {
    let array = PyArrayDyn::<bool>::zeros(py, shape, false);
    array.readwrite().as_slice_mut()?.copy_from_slice(values);
    Ok(array.into_any())
}

/// Whether the memory that two arrays span has an address in common.
///
/// # Safety
/// Both arrays must be alive; nothing is read through their pointers.
unsafe fn overlaps(a: &Bound<'_, PyArrayDyn<f64>>, b: &Bound<'_, PyArrayDyn<f64>>) -> bool {
    let span = |x: &Bound<'_, PyArrayDyn<f64>>| {
        let start = x.data() as isize;
        let (mut low, mut high) = (start, start + 8);
        for (&n, &stride) in x.shape().iter().zip(x.strides()) {
            let reach = (n as isize - 1).max(0) * stride;
            low += reach.min(0);
            high += reach.max(0);
        }
        (low, high)
    };
    let ((a0, a1), (b0, b1)) = (span(a), span(b));
    !a.is_empty() && !b.is_empty() && a0 < b1 && b0 < a1
}
