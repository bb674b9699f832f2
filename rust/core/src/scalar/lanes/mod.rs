//! Numbers in several lanes: an array for any processor, and registers of SSE2, AVX2 and AVX-512.

mod array;
#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod pair;
#[cfg(target_arch = "x86_64")]
mod sse2;
#[cfg(target_arch = "x86_64")]
mod vector;

pub use array::Array8;
#[cfg(target_arch = "x86_64")]
pub use avx2::Avx2;
#[cfg(target_arch = "x86_64")]
pub use avx512::Avx512;
pub use pair::Pair;
#[cfg(target_arch = "x86_64")]
pub use sse2::Sse2;
