//! The instruction sets, and functions that run code compiled for AVX2 with FMA or for AVX-512 after a check of the processor.
//!
//! Such a call is `unsafe`, because an unsupported instruction has undefined behaviour.

use super::Kernel;
use std::sync::atomic::{AtomicU8, Ordering};

/// An instruction set for which code is selected. Later sets include the earlier ones.
///
/// ```
/// use armlet_core::scalar::{Isa, fuses, isa};
///
/// assert!(isa() <= Isa::best() && Isa::ALL.contains(&isa()));
/// assert!(Isa::Avx2 < Isa::Avx512);
/// assert_eq!(Isa::Avx2.name(), "avx2");
/// # #[cfg(target_arch = "x86_64")]
/// assert_eq!(fuses(), isa() != Isa::Baseline);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Isa {
    Baseline = 1,
    Avx2 = 2,
    Avx512 = 3,
}

impl Isa {
    pub const ALL: [Isa; 3] = [Isa::Baseline, Isa::Avx2, Isa::Avx512];

    pub fn name(self) -> &'static str {
        match self {
            Isa::Baseline => "baseline",
            Isa::Avx2 => "avx2",
            Isa::Avx512 => "avx512",
        }
    }

    /// Return the best instruction set of this processor.
    pub fn best() -> Isa {
        #[cfg(target_arch = "x86_64")]
        {
            let avx2 = is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma");
            if avx2 && is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512dq") {
                return Isa::Avx512;
            }
            if avx2 {
                return Isa::Avx2;
            }
        }
        Isa::Baseline
    }
}

static CHOSEN: AtomicU8 = AtomicU8::new(0);

/// Return the instruction set in use. It is the set in `ARMLET_ISA` if the processor has it, otherwise the best set. [`isa_request`]
/// reports a request that cannot be satisfied.
#[inline(always)]
pub fn isa() -> Isa {
    match CHOSEN.load(Ordering::Relaxed) {
        1 => Isa::Baseline,
        2 => Isa::Avx2,
        3 => Isa::Avx512,
        _ => choose(),
    }
}

/// Return whether multiply-add operations are fused. The result applies to direct evaluation and to programs (recorded machine code).
#[inline(always)]
pub fn fuses() -> bool {
    cfg!(target_arch = "aarch64") || CHOSEN.load(Ordering::Relaxed) >= Isa::Avx2 as u8 || fuses_after_all()
}

/// Return the result of [`fuses`] if the instruction set is not yet selected, or is the baseline. Direct evaluation calls `fuses` for every
/// multiply-add operation. So the code of `fuses` must be short.
#[cold]
#[inline(never)]
fn fuses_after_all() -> bool {
    isa() >= Isa::Avx2
}

#[cold]
fn choose() -> Isa {
    let isa = isa_request().ok().flatten().unwrap_or_else(Isa::best);
    CHOSEN.store(isa as u8, Ordering::Relaxed);
    isa
}

/// Return the instruction set that `ARMLET_ISA` requests, or `None` if this variable is not set. The result is an error if its value is not
/// an instruction set, or if the processor lacks this set.
pub fn isa_request() -> Result<Option<Isa>, String> {
    let Ok(name) = std::env::var("ARMLET_ISA") else { return Ok(None) };
    let best = Isa::best();
    match Isa::ALL.iter().find(|isa| isa.name() == name) {
        Some(&isa) if isa <= best => Ok(Some(isa)),
        Some(_) => Err(format!("ARMLET_ISA is not available here: expected at most {}, got {name}", best.name())),
        None => Err(format!("ARMLET_ISA is unknown: expected one of baseline, avx2, avx512, got {name}")),
    }
}

/// Run `kernel`, compiled for AVX2 and FMA. The caller has already checked [`isa`].
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(super) fn enter_avx2<K: Kernel>(kernel: K) -> K::Output {
    #[target_feature(enable = "avx2,fma")]
    fn region<K: Kernel>(kernel: K) -> K::Output {
        kernel.run()
    }
    debug_assert!(isa() >= Isa::Avx2);
    // SAFETY: `isa()` is at least Avx2 only if the processor reports AVX2 and FMA.
    unsafe { region(kernel) }
}

/// Run `kernel`. This function is never called, because [`isa`] is the baseline for this target.
#[cfg(not(target_arch = "x86_64"))]
#[inline(always)]
pub(super) fn enter_avx2<K: Kernel>(kernel: K) -> K::Output {
    kernel.run()
}

/// Run `kernel`, compiled for AVX2 if the processor has it. Loops over plain numbers use this function.
#[inline]
pub fn vectorised<K: Kernel>(kernel: K) -> K::Output {
    if isa() >= Isa::Avx2 { enter_avx2(kernel) } else { kernel.run() }
}

/// Run `kernel`, compiled for AVX-512. The caller has already checked [`isa`].
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub(super) fn enter_avx512<K: Kernel>(kernel: K) -> K::Output {
    #[target_feature(enable = "avx512f,avx512dq,avx2,fma")]
    fn region<K: Kernel>(kernel: K) -> K::Output {
        kernel.run()
    }
    debug_assert!(isa() >= Isa::Avx512);
    // SAFETY: `isa()` is Avx512 only if the processor reports AVX-512 F and DQ, AVX2 and FMA.
    unsafe { region(kernel) }
}
