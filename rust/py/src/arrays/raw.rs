//! The memory of numpy arrays, and the only `unsafe` code of this crate.
//!
//! A C-contiguous, aligned float64 array is read in place. `PyReadonlyArray` would take a global lock per array to track borrows.

use super::shape::{elements, shown};
use crate::errors::{Failure, input_error};
use numpy::{Element, PyArray1, PyArrayDescrMethods, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods, npyffi};
use pyo3::prelude::*;
use pyo3::sync::PyOnceLock;
use std::any::Any;
use std::ffi::c_int;
use std::ptr::null_mut;

/// A slice of the elements of a C-contiguous, aligned array, without a copy; `None` for other arrays.
pub fn in_place<'a, T: Element>(array: &'a Bound<'_, PyArrayDyn<T>>) -> Option<&'a [T]> {
    // SAFETY: contiguity and alignment are checked, and `Bound` keeps the array alive. The slice is read only while the calling thread holds
    // the GIL, because callers copy it before they release the GIL. Before it is read, the conversion of another argument may run Python
    // code. This code may change the numbers. As in numpy, it must not free the memory (`resize` with `refcheck=False`).
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

/// A slice of the elements of a C-contiguous, aligned float64 array of exactly this shape; `None` for all other objects.
///
/// This is the fast path for small arrays. The function `numbers` reads all other arguments.
#[inline]
pub fn of_shape<'a>(value: &'a Bound<'_, PyAny>, shape: &[usize]) -> Option<&'a [f64]> {
    // SAFETY: the pointer is compared, not dereferenced.
    of_class(value, shape, unsafe { npyffi::get_type_object(value.py(), npyffi::NpyTypes::PyArray_Type) })
}

/// Slices of vectors of these lengths; `None` if [`of_shape`] returns `None` for one of them.
#[inline]
pub fn of_lengths<'a, const K: usize>(values: [&'a Bound<'_, PyAny>; K], lengths: [usize; K]) -> Option<[&'a [f64]; K]> {
    let mut all: [&[f64]; K] = [&[]; K];
    if K > 0 {
        // SAFETY: the pointer is compared, not dereferenced.
        let class = unsafe { npyffi::get_type_object(values[0].py(), npyffi::NpyTypes::PyArray_Type) };
        for k in 0..K {
            all[k] = of_class(values[k], &[lengths[k]], class)?;
        }
    }
    Some(all)
}

/// Like [`of_shape`], with `class`, the type `numpy.ndarray`, as an argument.
#[inline(always)]
fn of_class<'a>(value: &'a Bound<'_, PyAny>, shape: &[usize], class: *mut pyo3::ffi::PyTypeObject) -> Option<&'a [f64]> {
    let flags = npyffi::flags::NPY_ARRAY_C_CONTIGUOUS | npyffi::flags::NPY_ARRAY_ALIGNED;
    // SAFETY: the type is exactly `numpy.ndarray`, so the object and its descriptor have these fields. The conditions of `in_place` apply.
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

/// A mutable slice of the elements of a new array, or of the array `out=`. The result is `None` if the array is read-only or empty, or if
/// [`of_shape`] returns `None`.
///
/// The caller ensures that no input overlaps the array. It holds the GIL while it writes an array that other code can access.
#[inline]
#[allow(clippy::mut_from_ref)]
pub fn out_of_shape<'a>(value: &'a Bound<'_, PyAny>, shape: &[usize]) -> Option<&'a mut [f64]> {
    let length = of_shape(value, shape)?.len();
    // SAFETY: `of_shape` has checked the type and the memory of the array. Python code cannot access the elements while they are written:
    // this thread holds the GIL, or no other code has a reference to the array.
    unsafe {
        let array = &(*value.as_ptr().cast::<npyffi::PyArrayObject>()).fields;
        if length == 0 || array.flags & npyffi::flags::NPY_ARRAY_WRITEABLE == 0 {
            return None;
        }
        Some(std::slice::from_raw_parts_mut(array.data.cast::<f64>(), length))
    }
}

/// A type of array elements. The value whose bits are all zero must be valid.
pub trait Bits: Send + Sync + Copy {
    const TYPE: npyffi::NPY_TYPES;
    /// Whether every bit pattern is a valid element.
    const ANY_BITS: bool = true;
}

impl Bits for f64 {
    const TYPE: npyffi::NPY_TYPES = npyffi::NPY_TYPES::NPY_DOUBLE;
}

impl Bits for bool {
    const TYPE: npyffi::NPY_TYPES = npyffi::NPY_TYPES::NPY_BOOL;
    const ANY_BITS: bool = false;
}

/// Make a new array of numbers or truth values, and let `fill` write it. Before that, the elements are zero if `zeroed`, otherwise
/// undefined.
#[inline]
pub fn made<'py, T: Bits>(
    py: Python<'py>,
    shape: &[usize],
    zeroed: bool,
    fill: impl FnOnce(&mut [T]) -> Result<(), Failure>,
) -> Result<Bound<'py, PyAny>, Failure> {
    let count = elements(shape)?;
    let (api, axes, dims) = (&npyffi::PY_ARRAY_API, shape.len() as c_int, shape.as_ptr().cast_mut().cast());
    let number = T::TYPE as c_int;
    // Small arrays are zeroed here, because they fit in a cache. The system zeroes larger arrays. Arrays of truth values are always zeroed,
    // because only the bytes 0 and 1 are valid.
    let zeroed = zeroed || !T::ANY_BITS;
    let by_system = zeroed && count > 1024;
    // SAFETY: `dims` points to the length of each axis, and numpy copies these `axes` lengths. Without sufficient memory numpy returns null
    // and sets a MemoryError.
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
        // SAFETY: the memory is contiguous and aligned, and has no other reference yet. Its bits are zero, or every bit pattern is a valid
        // element.
        let out = unsafe {
            let array = &(*array.as_ptr().cast::<npyffi::PyArrayObject>()).fields;
            if zeroed && !by_system {
                std::ptr::write_bytes(array.data.cast::<T>(), 0, count);
            }
            std::slice::from_raw_parts_mut(array.data.cast::<T>(), count)
        };
        fill(out)?;
    } else {
        fill(&mut [])?;
    }
    Ok(array)
}

/// The owner of the memory of arrays that [`adopted`] returns.
#[pyclass(frozen, module = "armlet._core", name = "_Memory")]
struct Memory {
    values: Option<Box<dyn Any + Send + Sync>>,
    bytes: usize,
}

/// Above this number of bytes, memory is freed without the interpreter lock, because freeing it takes long.
const MANY: usize = 1 << 20;

impl Drop for Memory {
    fn drop(&mut self) {
        if self.bytes > MANY {
            let values = self.values.take();
            Python::attach(|py| py.detach(|| drop(values)));
        }
    }
}

/// Make an array of this shape from the memory of `values`, without a copy. The number of values must match the shape.
pub fn adopted<'py, T: Element + Sync + 'static>(py: Python<'py>, shape: &[usize], mut values: Vec<T>) -> PyResult<Bound<'py, PyAny>> {
    assert_eq!(shape.iter().product::<usize>(), values.len(), "as many numbers as the shape says");
    let (data, bytes) = (values.as_mut_ptr(), size_of_val(&values[..]));
    let owner = Bound::new(py, Memory { values: Some(Box::new(values)), bytes })?;
    let api = &npyffi::PY_ARRAY_API;
    let (axes, dims, flags) = (shape.len() as c_int, shape.as_ptr().cast_mut().cast(), npyffi::flags::NPY_ARRAY_CARRAY);
    // SAFETY: the elements are contiguous, aligned and of this type, and their number matches the shape (see the assertion above). They do
    // not move while `owner` lives, and the array holds `owner`. No other code can access them. The first call takes over a reference to
    // the element type, and the second one a reference to `owner`.
    unsafe {
        let class = npyffi::get_type_object(py, npyffi::NpyTypes::PyArray_Type);
        let kind = T::get_dtype(py).into_dtype_ptr();
        let array = api.PyArray_NewFromDescr(py, class, kind, axes, dims, null_mut(), data.cast(), flags, null_mut());
        let array = Bound::from_owned_ptr_or_err(py, array)?;
        if api.PyArray_SetBaseObject(py, array.as_ptr().cast(), owner.into_ptr()) < 0 {
            return Err(PyErr::fetch(py));
        }
        Ok(array)
    }
}

/// Overwrite the numbers of a contiguous array of the same length that `new_array` made. Python code may hold references to it.
pub fn overwrite(array: &Bound<'_, PyAny>, values: &[f64]) -> Result<(), Failure> {
    let array = array.cast::<PyArrayDyn<f64>>().map_err(PyErr::from)?;
    assert!(array.len() == values.len() && array.is_c_contiguous(), "an array of the extension's own");
    // SAFETY: the length and the layout are asserted above, the GIL is held, and no other slice of the array exists here.
    unsafe { std::slice::from_raw_parts_mut(array.data(), values.len()) }.copy_from_slice(values);
    Ok(())
}

/// Overwrite the numbers of a vector if it has the length of `values` and only its owner has a reference. The result is false otherwise.
pub fn overwrite_unseen(array: &Bound<'_, PyArray1<f64>>, values: &[f64]) -> bool {
    let free = unseen(array, values.len());
    if free {
        // SAFETY: `unseen` has checked that the array is contiguous, aligned and of this length, and that no other reference exists.
        unsafe { std::slice::from_raw_parts_mut(array.data(), values.len()) }.copy_from_slice(values);
    }
    free
}

/// Whether an array still has `n` writeable, contiguous numbers, and only its owner has a reference.
fn unseen(array: &Bound<'_, PyArray1<f64>>, n: usize) -> bool {
    use npyffi::flags::{NPY_ARRAY_ALIGNED, NPY_ARRAY_C_CONTIGUOUS, NPY_ARRAY_OWNDATA, NPY_ARRAY_WRITEABLE};
    let wanted = NPY_ARRAY_C_CONTIGUOUS | NPY_ARRAY_ALIGNED | NPY_ARRAY_OWNDATA | NPY_ARRAY_WRITEABLE;
    // SAFETY: the fields of a live array are read while the GIL is held. A callable may have changed the shape, the type or the flags.
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

/// Whether an object is a masked array.
pub fn is_masked(value: &Bound<'_, PyAny>) -> PyResult<bool> {
    static MASKED: PyOnceLock<Py<PyAny>> = PyOnceLock::new();
    let py = value.py();
    let class = MASKED.get_or_try_init(py, || PyResult::Ok(py.import("numpy.ma")?.getattr("MaskedArray")?.unbind()))?;
    value.is_instance(class.bind(py))
}

/// A mutable slice of the elements of the caller's array `out=`. An array of another type, shape or layout, a read-only array, and an array
/// that overlaps an argument are refused.
///
/// Long work of an `Arm` writes the slice without the GIL. If another thread uses the array during the call, the values are undefined, as
/// with `out=` of numpy.
// No caller can pass the `&mut Bound` that this lint requires, because Python code can share every array.
#[allow(clippy::mut_from_ref)]
pub fn out_slice<'a>(
    function: &str,
    value: &'a Bound<'_, PyAny>,
    shape: &[usize],
    inputs: &[&Bound<'_, PyAny>],
) -> Result<&'a mut [f64], Failure> {
    let py = value.py();
    let refuse = |problem: String| -> Failure { input_error(py, function, "out", problem).into() };
    if is_masked(value).unwrap_or(true) {
        return Err(refuse(format!("is a masked array: expected a float64 array of shape {}", shown(shape))));
    }
    let Ok(array) = value.cast::<PyArrayDyn<f64>>() else {
        return Err(refuse(format!("is not a float64 array: expected shape {}, got {}", shown(shape), value.get_type())));
    };
    if array.shape() != shape {
        return Err(refuse(format!("has the wrong shape: expected {}, got {}", shown(shape), shown(array.shape()))));
    }
    if in_place(array).is_none() {
        return Err(refuse("is not C-contiguous: expected a C-contiguous array".into()));
    }
    // SAFETY: the flags are read while the GIL is held.
    if unsafe { (*array.as_array_ptr()).fields.flags } & npyffi::flags::NPY_ARRAY_WRITEABLE == 0 {
        return Err(refuse("is read-only: expected a writeable array".into()));
    }
    for input in inputs {
        let Ok(input) = input.cast::<PyArrayDyn<f64>>() else { continue };
        // SAFETY: pointers are compared, not dereferenced.
        if unsafe { overlaps(array, input) } {
            return Err(refuse("overlaps an argument: expected a separate array".into()));
        }
    }
    // SAFETY: the array is contiguous, aligned and writeable, and overlaps no input. The reference of the call keeps its memory valid,
    // also without the GIL. As in numpy, other code must not free this memory (`resize` with `refcheck=False`).
    Ok(unsafe { std::slice::from_raw_parts_mut(array.data(), array.len()) })
}

/// Whether the memory ranges of two arrays have an address in common.
///
/// # Safety
/// Both arrays must be alive. No element is read.
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
