//! Large memory in large pages, which Linux provides on request (`madvise`).
//!
//! The first access to a page takes longer than writing it. A number of a new array takes 4.7 ns with pages of 4 KiB, and 1 ns with pages
//! of 2 MiB.

/// Size in bytes from which pages of 2 MiB are requested, as in numpy.
const LARGE: usize = 1 << 22;

/// Return `memory` unchanged, and request large pages for its untouched part if it is large.
pub fn in_large_pages<T>(memory: Vec<T>) -> Vec<T> {
    let bytes = memory.capacity() * size_of::<T>();
    if bytes >= LARGE {
        system::advise(memory.as_ptr() as usize, bytes);
    }
    memory
}

#[cfg(target_os = "linux")]
mod system {
    use std::ffi::{c_int, c_void};

    unsafe extern "C" {
        fn madvise(address: *mut c_void, length: usize, advice: c_int) -> c_int;
    }

    /// `MADV_HUGEPAGE` of `sys/mman.h`.
    const HUGE: c_int = 14;
    const PAGE: usize = 4096;

    /// Request large pages for the whole pages within this memory. The answer of the system changes no number.
    pub fn advise(start: usize, bytes: usize) {
        let first = start.next_multiple_of(PAGE);
        // SAFETY: this advice changes no byte; of what is not mapped the system says that.
        let _ = unsafe { madvise(first as *mut c_void, bytes - (first - start), HUGE) };
    }
}

#[cfg(not(target_os = "linux"))]
mod system {
    pub fn advise(_: usize, _: usize) {}
}

#[cfg(test)]
mod tests {
    use super::in_large_pages;

    #[test]
    fn numbers_stay_as_they_are() {
        for count in [0, 7, super::LARGE / 8, super::LARGE / 8 + 1] {
            let memory = in_large_pages((0..count).map(|k| k as f64).collect::<Vec<_>>());
            assert!(memory.len() == count && memory.iter().enumerate().all(|(k, x)| *x == k as f64), "{count}");
        }
        assert_eq!(in_large_pages(vec![0.0; super::LARGE]).iter().sum::<f64>(), 0.0);
    }
}
