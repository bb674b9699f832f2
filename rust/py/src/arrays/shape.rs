//! The expected shapes of arguments, and the text of shapes and indices in messages.

use crate::errors::Failure;
use armlet_core::error::Error;

/// One axis of a shape that an argument may have.
#[derive(Clone, Copy)]
pub enum Axis<'a> {
    /// An axis of this length.
    Is(usize),
    /// An axis of any length. The text is its name in messages.
    Any(&'a str),
    /// Any number of axes. Only the first entry of a [`Form`] may be `Leading`.
    Leading,
}

/// A shape that an argument may have, axis by axis. `Form(&[])` is a single number.
#[derive(Clone, Copy)]
pub struct Form<'a>(pub &'a [Axis<'a>]);

/// The form of a single number.
pub const SCALAR: Form<'static> = Form(&[]);
/// The form that every shape matches.
pub const WHATEVER: Form<'static> = Form(&[Axis::Leading]);

impl Form<'_> {
    pub fn fits(self, shape: &[usize]) -> bool {
        let (axes, shape) = match self.0 {
            [Axis::Leading, axes @ ..] if shape.len() >= axes.len() => (axes, &shape[shape.len() - axes.len()..]),
            axes => (axes, shape),
        };
        axes.len() == shape.len() && axes.iter().zip(shape).all(|(axis, n)| !matches!(axis, Axis::Is(m) if m != n))
    }
}

/// The text of forms in a message, such as `a scalar, (3,) or (3, 3)`.
pub fn expected(forms: &[Form<'_>]) -> String {
    let words: Vec<String> = forms.iter().map(|form| form.to_string()).collect();
    match words.as_slice() {
        [] => "nothing".into(),
        [one] => one.clone(),
        [most @ .., last] => format!("{} or {last}", most.join(", ")),
    }
}

impl std::fmt::Display for Form<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.0.is_empty() {
            return f.write_str("a scalar");
        }
        let words: Vec<String> = self
            .0
            .iter()
            .map(|axis| match axis {
                Axis::Is(n) => n.to_string(),
                Axis::Any(name) => (*name).to_string(),
                Axis::Leading => "...".to_string(),
            })
            .collect();
        write!(f, "({}{})", words.join(", "), if words.len() == 1 { "," } else { "" })
    }
}

/// The number of elements of an array of this shape. More float64 numbers than memory can address are a `MemoryError`.
pub fn elements(shape: &[usize]) -> Result<usize, Failure> {
    if let Some(bytes) = shape.iter().try_fold(8_usize, |bytes, &n| bytes.checked_mul(n))
        && bytes <= isize::MAX as usize
    {
        return Ok(bytes / 8);
    }
    let bytes = shape.iter().fold(8_u128, |bytes, &n| bytes.saturating_mul(n as u128));
    if bytes > isize::MAX as u128 { Err(Error::Memory { bytes }.into()) } else { Ok(bytes as usize / 8) }
}

/// The text of the indices of element `k`, in C order, of an array of this shape: for a matrix its row and column.
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

/// The text of a shape as Python shows it, such as `(3,)` or `(2, 7)`.
pub fn shown(shape: &[usize]) -> String {
    match shape {
        [n] => format!("({n},)"),
        many => format!("({})", many.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ")),
    }
}
