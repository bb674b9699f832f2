//! The arguments of the call of a constructor, which the object stores. They determine its `repr` and its pickle.

use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

/// The names and values of arguments.
pub type NamedValues = Vec<(&'static str, Py<PyAny>)>;

/// Define pickling for a base class with the field `arguments`. A class with an arm names the field of the arm, and also receives `repr`.
macro_rules! defined_by_arguments {
    ($class:ident $(, $arm:ident)?) => {
        #[entered]
        #[pymethods]
        impl $class {
            $(fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
                let arm = slf.get().$arm.bind(slf.py());
                $crate::constructor_call::constructor_repr(slf.as_any(), Some(arm.as_any()), &slf.get().arguments)
            })?

            fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<$crate::constructor_call::NewArguments<'py>> {
                let arm: Option<&Bound<'py, PyAny>> = None $(.or(Some(self.$arm.bind(py).as_any())))?;
                $crate::constructor_call::new_arguments(py, arm, &self.arguments)
            }

            fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<$crate::seal::Sealed<'py>> {
                $crate::seal::seal_new(slf.as_any())
            }
        }
    };
}
pub(crate) use defined_by_arguments;

/// The `repr` of an object: `Name(arm, argument=value, ..)`, without an arm if the object has none.
pub fn constructor_repr(
    object: &Bound<'_, PyAny>,
    arm: Option<&Bound<'_, PyAny>>,
    arguments: &[(&'static str, Py<PyAny>)],
) -> PyResult<String> {
    let (py, mut parts) = (object.py(), Vec::new());
    if let Some(arm) = arm {
        // The `repr` of an arm with links is a table. Only its first line is used here.
        parts.push(arm.repr()?.to_string().lines().next().unwrap_or_default().to_string());
    }
    for (name, value) in arguments {
        let value = value.bind(py);
        let value = value.call_method0("tolist").unwrap_or_else(|_| value.clone());
        parts.push(format!("{name}={}", short_repr(&value)?));
    }
    Ok(format!("{}({})", object.get_type().name()?, parts.join(", ")))
}

/// The largest number of characters of an argument in a `repr`.
const LONGEST: usize = 240;

/// Copy an argument for `repr` and pickling. An array becomes a list, and an object without a copy is returned unchanged.
pub fn stored_form(value: &Bound<'_, PyAny>) -> PyResult<Py<PyAny>> {
    match value.call_method0("tolist") {
        Ok(list) => Ok(list.unbind()),
        Err(_) => Ok(value.call_method0("copy").unwrap_or_else(|_| value.clone()).unbind()),
    }
}

/// The `repr` of a value. A long one is cut off, and a large array is only named with its shape.
pub fn short_repr(value: &Bound<'_, PyAny>) -> PyResult<String> {
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
pub type NewArguments<'py> = (Bound<'py, PyTuple>, Bound<'py, PyDict>);

/// The arguments of the constructor call that makes an equal object, with the arm if the object has an arm.
pub fn new_arguments<'py>(
    py: Python<'py>,
    arm: Option<&Bound<'py, PyAny>>,
    arguments: &[(&'static str, Py<PyAny>)],
) -> PyResult<NewArguments<'py>> {
    let keywords = PyDict::new(py);
    if let Some(arm) = arm {
        keywords.set_item("arm", arm)?;
    }
    for (name, value) in arguments {
        keywords.set_item(name, value)?;
    }
    Ok((PyTuple::empty(py), keywords))
}
