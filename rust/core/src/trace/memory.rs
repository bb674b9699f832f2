//! Executable memory. Pages are written first and become executable afterwards. For one thread, they are never writable and executable at
//! the same time.
//!
//! Rules of operating systems:
//! - Linux, Windows, the BSDs, macOS on Intel: an anonymous mapping changes from writable to executable (mprotect,
//!   VirtualProtect).
//! - macOS on Apple silicon: a mapping with MAP_JIT is either writable or executable, separately for each thread. A process with the
//!   hardened runtime requires the entitlement `com.apple.security.cs.allow-jit` for such a mapping.
//! - A system that forbids new executable pages (hardened runtime, SELinux `execmem`, PaX, prctl PR_SET_MDWE): [`Code::new`]
//!   returns the system's error.
//!
//! Cases that are not covered:
//! - the hardened runtime on Intel, where the call succeeds and the process ends at the first instruction;
//! - iOS;
//! - unwinding and debugging through the code, which has no unwind tables.
//!
//! `make test` does not compile the code for Apple silicon and for Windows on aarch64.
//!
//! On aarch64, the instruction cache is not updated by writes. It is flushed before the first run.

use std::io::{Error, ErrorKind, Result};
use std::sync::atomic::{AtomicUsize, Ordering};

#[cfg(all(target_os = "macos", target_arch = "aarch64"))]
#[path = "memory_apple.rs"]
mod pages;

#[cfg(not(all(target_os = "macos", target_arch = "aarch64")))]
mod pages {
    pub use memmap2::Mmap as Pages;
    use memmap2::MmapMut;

    /// Executable pages that start with `bytes`.
    pub fn executable(bytes: &[u8]) -> std::io::Result<Pages> {
        let mut pages = MmapMut::map_anon(bytes.len())?;
        pages[..bytes.len()].copy_from_slice(bytes);
        let pages = pages.make_exec()?;
        super::flush(pages.as_ptr(), bytes.len());
        Ok(pages)
    }
}

/// The signature of the machine code. Arguments: frame, constants, stream, number of iterations.
pub type Function = extern "C" fn(*mut f64, *const f64, *const f64, usize);

/// Machine code of one [`Function`] in executable, read-only memory.
pub struct Code {
    pages: pages::Pages,
    /// The position of the code in the pages.
    start: usize,
}

/// The size of a cache line, and of the part of an address that selects the line of an instruction cache.
const LINE: usize = 64;
const PAGE: usize = 4096;

/// Return the position in a page at which code of this length begins: where the previous code ended. If all codes began at the start of a
/// page, the programs of one loop would compete for the same lines of the instruction cache.
fn next_start(length: usize) -> usize {
    static END: AtomicUsize = AtomicUsize::new(0);
    END.fetch_add(length.next_multiple_of(LINE), Ordering::Relaxed) % PAGE
}

impl Code {
    /// Copy machine code to new memory, and make this memory executable.
    ///
    /// # Errors
    /// The code is empty, memory is insufficient, or the system refuses executable pages.
    pub fn new(bytes: &[u8]) -> Result<Code> {
        if bytes.is_empty() {
            return Err(Error::new(ErrorKind::InvalidInput, "no machine code"));
        }
        let start = next_start(bytes.len());
        let placed = [vec![0; start].as_slice(), bytes].concat();
        Ok(Code { pages: pages::executable(&placed)?, start })
    }

    /// The address of the machine code.
    pub fn address(&self) -> *const u8 {
        self.pages.as_ptr().wrapping_add(self.start)
    }

    /// Call the function.
    ///
    /// # Safety
    /// The bytes are a function of signature [`Function`], in machine code that this processor can run. `frame`, `constants` and `stream`
    /// are valid and aligned for every slot that the code accesses in `turns` iterations.
    pub unsafe fn run(&self, frame: *mut f64, constants: *const f64, stream: *const f64, turns: usize) {
        // SAFETY: the mapping exists as long as `self` and is executable. The caller guarantees that its content is this function.
        unsafe {
            let function: Function = std::mem::transmute(self.address());
            function(frame, constants, stream, turns);
        }
    }
}

/// Make written instructions visible to the instruction fetch. On x86-64, the processor makes them visible without an operation.
#[cfg(not(target_arch = "aarch64"))]
fn flush(_: *const u8, _: usize) {}

/// Make written instructions visible to the instruction fetch.
#[cfg(all(target_arch = "aarch64", target_vendor = "apple"))]
fn flush(start: *const u8, bytes: usize) {
    unsafe extern "C" {
        fn sys_icache_invalidate(start: *const core::ffi::c_void, bytes: usize);
    }
    // SAFETY: calls a function of the system library on a mapped range.
    unsafe { sys_icache_invalidate(start.cast(), bytes) }
}

/// Make written instructions visible to the instruction fetch.
#[cfg(all(target_arch = "aarch64", windows))]
fn flush(start: *const u8, bytes: usize) {
    use core::ffi::c_void;
    unsafe extern "system" {
        fn GetCurrentProcess() -> *mut c_void;
        fn FlushInstructionCache(process: *mut c_void, start: *const c_void, bytes: usize) -> i32;
    }
    // SAFETY: calls functions of kernel32 on a mapped range.
    unsafe { FlushInstructionCache(GetCurrentProcess(), start.cast(), bytes) };
}

/// Make written instructions visible to the instruction fetch (Arm Architecture Reference Manual, B2.4.4).
///
/// First write the lines of the data cache to the level of memory that both caches share. Then invalidate the lines of the instruction
/// cache.
#[cfg(all(target_arch = "aarch64", not(target_vendor = "apple"), not(windows)))]
fn flush(start: *const u8, bytes: usize) {
    use core::arch::asm;
    let (start, end) = (start as usize, start as usize + bytes);
    // SAFETY: reads the sizes of the cache lines, and cleans or invalidates lines of a mapped range.
    unsafe {
        let sizes: usize;
        asm!("mrs {}, ctr_el0", out(reg) sizes, options(nomem, nostack));
        let lines = |bytes: usize| (start & !(bytes - 1)..end).step_by(bytes);
        for line in lines(4 << (sizes >> 16 & 15)) {
            asm!("dc cvau, {}", in(reg) line, options(nostack));
        }
        asm!("dsb ish", options(nostack));
        for line in lines(4 << (sizes & 15)) {
            asm!("ic ivau, {}", in(reg) line, options(nostack));
        }
        asm!("dsb ish", "isb", options(nostack));
    }
}

#[cfg(all(test, unix, any(target_arch = "x86_64", target_arch = "aarch64")))]
mod tests {
    use super::*;

    /// movsd xmm0, [rdi]; addsd xmm0, [rsi]; movsd [rdi], xmm0; ret
    #[cfg(target_arch = "x86_64")]
    const SUM: [u8; 13] = [0xF2, 0x0F, 0x10, 0x07, 0xF2, 0x0F, 0x58, 0x06, 0xF2, 0x0F, 0x11, 0x07, 0xC3];

    /// ldr d0, [x0]; ldr d1, [x1]; fadd d0, d0, d1; str d0, [x0]; ret
    #[cfg(target_arch = "aarch64")]
    #[rustfmt::skip]
    const SUM: [u8; 20] = [
        0x00, 0x00, 0x40, 0xFD, 0x21, 0x00, 0x40, 0xFD, 0x00, 0x28, 0x61, 0x1E, 0x00, 0x00, 0x00, 0xFD, 0xC0, 0x03, 0x5F, 0xD6,
    ];

    #[test]
    fn runs_code() {
        let code = Code::new(&SUM).unwrap();
        let mut frame = [1.5];
        // SAFETY: this code reads and writes one number of each argument.
        unsafe { code.run(frame.as_mut_ptr(), [2.0].as_ptr(), std::ptr::null(), 1) };
        assert_eq!(frame, [3.5]);
    }

    #[test]
    fn refuses_empty_code() {
        assert_eq!(Code::new(&[]).err().unwrap().kind(), ErrorKind::InvalidInput);
    }

    /// A child process gives up the right to make pages executable (Linux 6.3), as on a hardened system. On aarch64 the test does not run,
    /// because the emulator itself needs this right.
    #[cfg(all(target_os = "linux", target_arch = "x86_64"))]
    #[test]
    fn returns_the_refusal_of_the_system() {
        const NAME: &str = "trace::memory::tests::returns_the_refusal_of_the_system";
        const CHILD: &str = "ARMLET_TEST_REFUSED_CODE";
        unsafe extern "C" {
            fn prctl(option: i32, argument: u64, _: u64, _: u64, _: u64) -> i32;
        }
        const PR_SET_MDWE: i32 = 65;
        if std::env::var_os(CHILD).is_some() {
            // SAFETY: the call changes permissions of this process and does not access memory.
            let refused = unsafe { prctl(PR_SET_MDWE, 1, 0, 0, 0) } == 0;
            // A kernel without this option cannot refuse executable pages.
            assert_eq!(Code::new(&SUM).is_err(), refused);
            return;
        }
        let child = std::process::Command::new(std::env::current_exe().unwrap()).args(["--exact", NAME]).env(CHILD, "1").output().unwrap();
        let output = String::from_utf8_lossy(&child.stdout);
        assert!(child.status.success() && output.contains("1 passed"), "{output}");
    }

    #[test]
    fn goes_between_threads() {
        fn shared<T: Send + Sync>() {}
        shared::<Code>();
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn is_never_writable_and_executable() {
        let code = Code::new(&SUM.repeat(1000)).unwrap();
        let address = code.address() as usize;
        let maps = std::fs::read_to_string("/proc/self/maps").unwrap();
        let rights = |line: &str| {
            let (range, rest) = line.split_once(' ').unwrap();
            let (start, end) = range.split_once('-').unwrap();
            let hex = |text| usize::from_str_radix(text, 16).unwrap();
            (hex(start)..hex(end)).contains(&address).then(|| rest[..4].to_owned())
        };
        assert_eq!(maps.lines().find_map(rights).as_deref(), Some("r-xp"));
    }
}
