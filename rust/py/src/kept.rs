//! The arguments that an object keeps from the call of its constructor. They determine its `repr` and its pickle.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// The names and values of arguments.
pub type Kept = Vec<(&'static str, Py<PyAny>)>;

/// Define `repr` and pickling for a base class with the fields `arm` and `arguments`.
macro_rules! stands_on_arm {
    ($class:ident) => {
        #[entered]
        #[pymethods]
        impl $class {
            fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
                $crate::kept::shown_as(slf.as_any(), Some(slf.get().arm.bind(slf.py()).as_any()), &slf.get().arguments)
            }

            fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<$crate::kept::Call<'py>> {
                $crate::kept::call(py, Some(self.arm.bind(py).as_any()), &self.arguments)
            }

            fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<$crate::seal::Sealed<'py>> {
                $crate::seal::seal_new(slf.as_any())
            }
        }
    };
}

/// Define pickling for a base class with the field `arguments`.
macro_rules! made_of_arguments {
    ($class:ident) => {
        #[entered]
        #[pymethods]
        impl $class {
            fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<$crate::kept::Call<'py>> {
                $crate::kept::call(py, None, &self.arguments)
            }

            fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<$crate::seal::Sealed<'py>> {
                $crate::seal::seal_new(slf.as_any())
            }
        }
    };
}
pub(crate) use {made_of_arguments, stands_on_arm};

/// The `repr` of an object: `Name(arm, argument=value, ..)`, without an arm if the object has none.
pub fn shown_as(object: &Bound<'_, PyAny>, arm: Option<&Bound<'_, PyAny>>, arguments: &[(&'static str, Py<PyAny>)]) -> PyResult<String> {
    let (py, mut parts) = (object.py(), Vec::new());
    if let Some(arm) = arm {
        // The `repr` of an arm with links is a table. Only its first line is used here.
        parts.push(arm.repr()?.to_string().lines().next().unwrap_or_default().to_string());
    }
    for (name, value) in arguments {
        let value = value.bind(py);
        let value = value.call_method0("tolist").unwrap_or_else(|_| value.clone());
        parts.push(format!("{name}={}", brief(&value)?));
    }
    Ok(format!("{}({})", object.get_type().name()?, parts.join(", ")))
}

/// The largest number of characters of an argument in a `repr`.
const LONGEST: usize = 240;

/// The `repr` of a value. A long one is cut off, and a large array is only named with its shape.
pub fn brief(value: &Bound<'_, PyAny>) -> PyResult<String> {
    let many = value.getattr("size").and_then(|size| size.extract::<usize>()).is_ok_and(|size| size > LONGEST / 6);
    if let (true, Ok(shape)) = (many, value.getattr("shape")) {
        return Ok(format!("an array {}", shape.repr()?));
    }
    let text = value.repr()?.to_string();
    match text.char_indices().nth(LONGEST) {
        None => Ok(text),
        Some((end, _)) => Ok(format!("{}...", &text[..end])),
    }
}

/// The positional and keyword arguments of a call.
pub type Call<'py> = (Bound<'py, PyTuple>, Bound<'py, PyDict>);

/// The arguments of the constructor call that makes an equal object, with the arm if the object has an arm.
pub fn call<'py>(py: Python<'py>, arm: Option<&Bound<'py, PyAny>>, arguments: &[(&'static str, Py<PyAny>)]) -> PyResult<Call<'py>> {
    let keywords = PyDict::new(py);
    if let Some(arm) = arm {
        keywords.set_item("arm", arm)?;
    }
    for (name, value) in arguments {
        keywords.set_item(name, value)?;
    }
    Ok((PyTuple::empty(py), keywords))
}
