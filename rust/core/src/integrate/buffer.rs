//! The memory of a state.

/// The memory of a state: an array for small closed-form systems, a vector for others.
///
/// ```
/// use armlet_core::integrate::Buffer;
///
/// fn sum<B: Buffer<f64>>(state: &B) -> f64 {
///     state.as_ref().iter().sum()
/// }
/// // An array for a small system, and memory on the heap for others.
/// assert_eq!((sum(&[1.0, 2.0]), sum(&vec![1.0; 100])), (3.0, 100.0));
/// ```
pub trait Buffer<S>: Clone + AsRef<[S]> + AsMut<[S]> {}
impl<S, B: Clone + AsRef<[S]> + AsMut<[S]>> Buffer<S> for B {}
