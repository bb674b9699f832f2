//! Constant folding for C code. An *entry* is the index of a recorded operation. Entries whose operands are known numbers, except sines and
//! cosines, are computed before the routine is written. Their rounding is that of the C code.

use super::super::decision::has_c;
use super::super::tape::Op;

/// The known values of entries, and the entries that equal other entries.
pub struct Folded {
    pub value: Vec<Option<f64>>,
    /// For each entry, the entry that replaces it.
    pub same: Vec<u32>,
}

impl Folded {
    /// Fold the recording `ops`. `given[k]` is the value of input `k`, if it is known. If `fused` is false, multiply-add operations round
    /// twice.
    pub fn of(ops: &[Op], given: &[Option<f64>], fused: bool) -> Self {
        let mut folded = Folded { value: vec![None; ops.len()], same: (0..ops.len() as u32).collect() };
        for (i, &op) in ops.iter().enumerate() {
            if let Op::Select(mask, yes, no) = op
                && let Some(mask) = folded.at(mask)
            {
                folded.same[i] = folded.same[if mask != 0.0 { yes } else { no } as usize];
                folded.value[i] = folded.at(folded.same[i]);
                continue;
            }
            // Native code without C is left out: where the results of the formula are not valid, the caller reports it.
            if let Op::Decided(cut, given, _) = op
                && !matches!(ops[cut as usize], Op::Decide(_, kind) if has_c(kind))
            {
                folded.same[i] = folded.same[given as usize];
                folded.value[i] = folded.at(folded.same[i]);
                continue;
            }
            // NaN is not folded, so that the routine reports it at run time.
            folded.value[i] = folded.compute(op, given, fused).filter(|x| !x.is_nan());
        }
        folded
    }

    fn at(&self, entry: u32) -> Option<f64> {
        self.value[self.same[entry as usize] as usize]
    }

    fn compute(&self, op: Op, given: &[Option<f64>], fused: bool) -> Option<f64> {
        let at = |entry| self.at(entry);
        let fma = |a: f64, b: f64, c: f64| if fused { a.mul_add(b, c) } else { a * b + c };
        Some(match op {
            Op::Const(bits) => f64::from_bits(bits),
            Op::Input(k) => return given.get(k as usize).copied().flatten(),
            Op::Add(a, b) => at(a)? + at(b)?,
            Op::Sub(a, b) => at(a)? - at(b)?,
            Op::Mul(a, b) => at(a)? * at(b)?,
            Op::Div(a, b) => at(a)? / at(b)?,
            Op::Neg(a) => -at(a)?,
            Op::Fma(a, b, c) => fma(at(a)?, at(b)?, at(c)?),
            Op::Fnma(a, b, c) => fma(-at(a)?, at(b)?, at(c)?),
            Op::Sqrt(a) => at(a)?.sqrt(),
            Op::Abs(a) => at(a)?.abs(),
            Op::Max(a, b) => pick(at(a)?, at(b)?, |a, b| a < b),
            Op::Min(a, b) => pick(at(a)?, at(b)?, |a, b| b < a),
            Op::Less(a, b) => f64::from(u8::from(at(a)? < at(b)?)),
            Op::Select(..) | Op::Sin(_) | Op::Cos(_) => return None,
            Op::Argument(..) | Op::Decide(..) | Op::Decided(..) => return None,
        })
    }
}

/// Return `b` if `second(a, b)` is true, otherwise `a`.
fn pick(a: f64, b: f64, second: impl Fn(f64, f64) -> bool) -> f64 {
    if second(a, b) { b } else { a }
}
