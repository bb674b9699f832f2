//! Executable pages on Apple silicon. A mapping with MAP_JIT is executable, except in a thread that has requested to write to it.
//! Source: Apple, "Porting just-in-time compilers to Apple silicon".

use std::ffi::{c_int, c_void};
use std::io::{Error, Result};
use std::ptr::null_mut;

unsafe extern "C" {
    fn mmap(address: *mut c_void, bytes: usize, protection: c_int, flags: c_int, file: c_int, offset: i64) -> *mut c_void;
    fn munmap(address: *mut c_void, bytes: usize) -> c_int;
    /// `executes` = 0: this thread may write to mappings with MAP_JIT. `executes` = 1: this thread may execute them.
    fn pthread_jit_write_protect_np(executes: c_int);
}

const READ_WRITE_EXECUTE: c_int = 1 | 2 | 4;
const MAP_PRIVATE_ANON_JIT: c_int = 0x0002 | 0x1000 | 0x0800;

/// A mapping that is written only once.
pub struct Pages {
    start: *mut c_void,
    bytes: usize,
}

// SAFETY: no code writes to the mapping after its construction. It belongs to the process and not to a thread.
unsafe impl Send for Pages {}
// SAFETY: no code writes to the mapping after its construction. It belongs to the process and not to a thread.
unsafe impl Sync for Pages {}

impl Pages {
    pub fn as_ptr(&self) -> *const u8 {
        self.start.cast()
    }
}

impl Drop for Pages {
    fn drop(&mut self) {
        // SAFETY: the mapping was made with this length, and no reference to it exists any more.
        unsafe { munmap(self.start, self.bytes) };
    }
}

/// Executable pages that start with `bytes`.
pub fn executable(bytes: &[u8]) -> Result<Pages> {
    // SAFETY: the mapping is new. The copy writes within its length, while this thread may write to it. The copy cannot panic, so that the
    // thread always returns to executing.
    unsafe {
        let start = mmap(null_mut(), bytes.len(), READ_WRITE_EXECUTE, MAP_PRIVATE_ANON_JIT, -1, 0);
        if start as isize == -1 {
            return Err(Error::last_os_error());
        }
        pthread_jit_write_protect_np(0);
        bytes.as_ptr().copy_to_nonoverlapping(start.cast(), bytes.len());
        pthread_jit_write_protect_np(1);
        super::flush(start.cast(), bytes.len());
        Ok(Pages { start, bytes: bytes.len() })
    }
}
