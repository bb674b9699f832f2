//! The operations of a recording.

/// An operation. Its operands are indices of earlier entries of the tape.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Op {
    /// A constant, stored as the bits of a number.
    Const(u64),
    Input(u32),
    Add(u32, u32),
    Sub(u32, u32),
    Mul(u32, u32),
    Div(u32, u32),
    Neg(u32),
    /// `a b + c`
    Fma(u32, u32, u32),
    /// `c - a b`
    Fnma(u32, u32, u32),
    Sqrt(u32),
    Abs(u32),
    /// `b` if `a < b`, otherwise `a`.
    Max(u32, u32),
    /// `b` if `b < a`, otherwise `a`.
    Min(u32, u32),
    Sin(u32),
    Cos(u32),
    /// A mask, which is true where `a < b`.
    Less(u32, u32),
    /// `Select(mask, yes, no)`: `yes` where the mask is true, otherwise `no`.
    Select(u32, u32, u32),
    /// `Argument(before, x)`: the list of arguments `before`, and `x` at its end. Entry 0 is the empty list.
    Argument(u32, u32),
    /// `Decide(arguments, kind)`: a cut of the tape, at which native code of this kind may replace results
    /// ([`super::decision`]).
    Decide(u32, u32),
    /// `Decided(cut, given, k)`: result `k` after the cut, which is `given` before it.
    Decided(u32, u32, u32),
}

impl Op {
    /// The indices of the operands.
    #[inline]
    pub fn operands(self) -> impl Iterator<Item = u32> {
        let (count, all) = match self {
            Op::Const(_) | Op::Input(_) => (0, [0; 3]),
            Op::Neg(a) | Op::Sqrt(a) | Op::Abs(a) => (1, [a, 0, 0]),
            Op::Sin(a) | Op::Cos(a) => (1, [a, 0, 0]),
            Op::Add(a, b) | Op::Sub(a, b) | Op::Mul(a, b) | Op::Div(a, b) | Op::Max(a, b) | Op::Min(a, b) | Op::Less(a, b) => {
                (2, [a, b, 0])
            }
            Op::Fma(a, b, c) | Op::Fnma(a, b, c) | Op::Select(a, b, c) => (3, [a, b, c]),
            Op::Decide(a, _) => (1, [a, 0, 0]),
            Op::Argument(a, b) | Op::Decided(a, b, _) => (2, [a, b, 0]),
        };
        all.into_iter().take(count)
    }

    /// Return the operation with operands `f(operand)`.
    pub fn on(self, f: impl Fn(u32) -> u32) -> Self {
        match self {
            Op::Const(_) | Op::Input(_) => self,
            Op::Add(a, b) => Op::Add(f(a), f(b)),
            Op::Sub(a, b) => Op::Sub(f(a), f(b)),
            Op::Mul(a, b) => Op::Mul(f(a), f(b)),
            Op::Div(a, b) => Op::Div(f(a), f(b)),
            Op::Neg(a) => Op::Neg(f(a)),
            Op::Fma(a, b, c) => Op::Fma(f(a), f(b), f(c)),
            Op::Fnma(a, b, c) => Op::Fnma(f(a), f(b), f(c)),
            Op::Sqrt(a) => Op::Sqrt(f(a)),
            Op::Abs(a) => Op::Abs(f(a)),
            Op::Max(a, b) => Op::Max(f(a), f(b)),
            Op::Min(a, b) => Op::Min(f(a), f(b)),
            Op::Sin(a) => Op::Sin(f(a)),
            Op::Cos(a) => Op::Cos(f(a)),
            Op::Less(a, b) => Op::Less(f(a), f(b)),
            Op::Select(mask, yes, no) => Op::Select(f(mask), f(yes), f(no)),
            Op::Argument(before, x) => Op::Argument(f(before), f(x)),
            Op::Decide(arguments, kind) => Op::Decide(f(arguments), kind),
            Op::Decided(cut, given, k) => Op::Decided(f(cut), f(given), k),
        }
    }
}
