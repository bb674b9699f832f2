//! The macro `properties!`, which defines the read-only properties of a class.

/// Define properties, each with its docstring, its name and its Rust type. The value is that of an expression, `|object| ..` or
/// `|object, py| ..`. Without an expression it is the field with this name in the field `core` of the object.
macro_rules! properties {
    ($class:ident { $($(#[$doc:meta])* $name:ident: $type:ty $(= |$object:ident $(, $py:ident)?| $value:expr)?;)* }) => {
        #[entered]
        #[pymethods]
        impl $class {
            $(
                $(#[$doc])*
                #[getter]
                #[allow(unused_variables)]
                fn $name<'py>(&self, py: Python<'py>) -> $type {
                    $crate::properties::value!(self, py, $name $(, $object $(, $py)?, $value)?)
                }
            )*
        }
    };
}

/// The value of a property.
macro_rules! value {
    ($self:ident, $token:ident, $name:ident) => {
        $self.core.$name
    };
    ($self:ident, $token:ident, $name:ident, $object:ident, $value:expr) => {{
        let $object = $self;
        $value
    }};
    ($self:ident, $token:ident, $name:ident, $object:ident, $py:ident, $value:expr) => {{
        let ($object, $py) = ($self, $token);
        $value
    }};
}
pub(crate) use {properties, value};
