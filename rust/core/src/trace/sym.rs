//! The number type for recording: an implementation of [`Real`] that records the operations on it.
//!
//! A recording has two phases. In the *set-up*, plants, laws and arms are built. Numbers that may differ between runs are *set-up
//! parameters*: [`Real::varying`] and [`Real::parameter`] create them, and they become inputs. The numbers 0, 1 and -1 are constants
//! instead, and are folded. In the *evaluation*, [`input`] declares the inputs, and [`Real::splat`] creates constants.
//!
//! If code reads the value of a number that is not a constant, to branch on it, the recording fails ([`Recording::failed`]).

use super::differentiate;
use super::label::Label;
use super::tape::{Moving, Op, Tape};
use crate::scalar::{Kernel, Real};
use num_traits::{One, Zero};
use std::cell::RefCell;
use std::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

thread_local! {
    static TAPE: RefCell<Tape> = RefCell::new(Tape::new());
}

fn on_tape<T>(f: impl FnOnce(&mut Tape) -> T) -> T {
    TAPE.with(|tape| f(&mut tape.borrow_mut()))
}

/// A recorded value: the index of its operation on the tape of this thread. The default is the constant zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Sym(u32);

/// The result of one recording.
pub struct Recording {
    pub ops: Vec<Op>,
    /// The values of the set-up parameters that became inputs. They are the first inputs.
    pub values: Vec<f64>,
    /// The labels of the set-up parameters that became inputs.
    pub labels: Vec<Label>,
    /// The indices of the set-up parameters in `ops`, in the order of recording. Parameters of [`Real::fixed`] are included only if the
    /// recording has varying parameters (see [`Moving`]). Two loops can share a program if these lists are equal, and if the loops differ
    /// only in the values of parameters.
    pub structure: Vec<u32>,
    /// Whether the code read a value that is not a constant. Then the recording is not valid.
    pub failed: bool,
}

/// Start a new recording on this thread. The recording is then in its set-up phase.
pub fn begin() {
    begin_that(true);
}

/// Start a new recording. If `folds` is false, it records every operation without simplification.
pub fn begin_that(folds: bool) {
    on_tape(|tape| *tape = Tape::that(folds));
}

/// Start a new recording. Each set-up parameter that `moving` selects becomes a separate input, even if another parameter has the same
/// value.
pub fn begin_moving(moving: Moving) {
    begin();
    on_tape(|tape| tape.moving = moving);
}

/// End the set-up phase, and return the number of set-up parameters that became inputs.
pub fn end_set_up() -> usize {
    on_tape(|tape| {
        tape.set_up = false;
        tape.values.len()
    })
}

/// Declare a new input of the evaluation.
pub fn input() -> Sym {
    on_tape(|tape| Sym(tape.new_input()))
}

/// Return the number of operations and the number of inputs recorded so far.
pub fn recorded() -> (u32, u32) {
    on_tape(|tape| (tape.ops.len() as u32, tape.inputs))
}

/// Let native code of the number `kind` ([`decision`](super::decision)) replace the `results` of a formula where they are not valid. There,
/// the first of the `arguments` is not one.
pub fn decide(kind: u32, arguments: &[Sym], results: &mut [Sym]) {
    let entries = |values: &[Sym]| values.iter().map(|value| value.0).collect::<Vec<u32>>();
    let (arguments, given) = (entries(arguments), entries(results));
    let decided = on_tape(|tape| tape.decide(kind, &arguments, &given));
    results.iter_mut().zip(decided).for_each(|(to, entry)| *to = Sym(entry));
}

/// Return the derivative of the recorded values `of` along the direction `along` of the values `at`. Other values are constant.
pub fn derivative(of: &[Sym], at: &[Sym], along: &[Sym]) -> Vec<Sym> {
    on_tape(|tape| {
        let outputs: Vec<u32> = of.iter().map(|value| value.0).collect();
        let given: Vec<(u32, u32)> = at.iter().zip(along).map(|(value, rate)| (value.0, rate.0)).collect();
        let length = tape.ops.len();
        differentiate::derivative(tape, length, &given, &outputs).into_iter().map(Sym).collect()
    })
}

/// Record the formulas of `f` with contraction: a product that is added or subtracted becomes a multiply-add. Functions of bodies keep
/// their operations ([`Real::as_written`]), so that they have the same bits on plain numbers.
pub fn contract<T>(f: impl FnOnce() -> T) -> T {
    with_contraction(true, f)
}

fn with_contraction<T>(contracts: bool, f: impl FnOnce() -> T) -> T {
    let before = on_tape(|tape| std::mem::replace(&mut tape.contracts, contracts));
    let made = f();
    on_tape(|tape| tape.contracts = before);
    made
}

/// Record for derivatives from now on: formulas may compute more, so that they have derivatives ([`differentiates`]).
pub fn differentiate() {
    on_tape(|tape| tape.differentiates = true);
}

/// Whether the recording is for derivatives.
pub fn differentiates() -> bool {
    on_tape(|tape| tape.differentiates)
}

/// Whether a value is a constant of the recording.
pub fn is_constant(value: Sym) -> bool {
    on_tape(|tape| tape.known(value.0).is_some())
}

/// Require that `valid` is one where the results of native code are valid ([`validity`]).
pub fn require(valid: Sym) {
    on_tape(|tape| tape.conditions.push(valid.0));
}

/// Return a number that is one if the results of all cuts so far are valid without native code, otherwise zero. It is `None` without a cut.
pub fn validity() -> Option<Sym> {
    on_tape(|tape| tape.validities()).into_iter().map(Sym).reduce(Sym::min)
}

/// A named intermediate result: its name, its shape and its values in row-major order.
pub type NamedTerm = (&'static str, Vec<usize>, Vec<Sym>);

thread_local! {
    static TERMS: RefCell<Option<Vec<NamedTerm>>> = const { RefCell::new(None) };
}

/// Collect the named intermediate results from now on ([`Real::term`]).
pub fn collect_terms() {
    TERMS.set(Some(Vec::new()));
}

/// Whether named intermediate results are collected.
pub fn collects_terms() -> bool {
    TERMS.with_borrow(Option::is_some)
}

/// Return the collected intermediate results, and collect no more.
pub fn terms() -> Vec<NamedTerm> {
    TERMS.take().unwrap_or_default()
}

/// End the recording of this thread and return it.
pub fn finish() -> Recording {
    let tape = on_tape(|tape| std::mem::replace(tape, Tape::new()));
    Recording { ops: tape.ops, values: tape.values, labels: tape.labels.all, structure: tape.structure, failed: tape.failed }
}

impl Sym {
    /// The index of the value's operation in the recording.
    pub fn index(self) -> u32 {
        self.0
    }
}

// The following functions are compiled once, in this file. Generic callers share them.

#[inline(never)]
fn varying(x: f64) -> Sym {
    on_tape(|tape| Sym(if tape.set_up { tape.given(x) } else { tape.constant(x) }))
}

#[inline(never)]
fn shared(x: f64) -> Sym {
    on_tape(|tape| Sym(tape.shared(x)))
}

#[inline(never)]
fn label(name: &'static str, first: u32) -> Label {
    on_tape(|tape| tape.labels.begin(name, first))
}

#[inline(never)]
fn end_label(before: Label) {
    on_tape(|tape| tape.labels.end(before));
}

macro_rules! operator {
    ($trait:ident, $method:ident, $assign:ident, $assign_method:ident) => {
        impl $trait for Sym {
            type Output = Sym;
            fn $method(self, other: Sym) -> Sym {
                on_tape(|tape| Sym(tape.$method(self.0, other.0)))
            }
        }
        impl $assign for Sym {
            fn $assign_method(&mut self, other: Sym) {
                *self = $trait::$method(*self, other);
            }
        }
    };
}
operator!(Add, add, AddAssign, add_assign);
operator!(Sub, sub, SubAssign, sub_assign);
operator!(Mul, mul, MulAssign, mul_assign);

impl Zero for Sym {
    fn zero() -> Sym {
        Real::zero()
    }
    /// Whether the number is the constant zero.
    fn is_zero(&self) -> bool {
        on_tape(|tape| tape.value(self.0) == Some(0.0))
    }
}

impl One for Sym {
    fn one() -> Sym {
        Sym::splat(1.0)
    }
}

operator!(Div, div, DivAssign, div_assign);

impl Neg for Sym {
    type Output = Sym;
    fn neg(self) -> Sym {
        on_tape(|tape| Sym(tape.neg(self.0)))
    }
}

impl Real for Sym {
    type Mask = Sym;
    const LANES: usize = 1;

    fn splat(x: f64) -> Sym {
        on_tape(|tape| Sym(tape.constant(x)))
    }
    fn from_lanes(mut f: impl FnMut(usize) -> f64) -> Sym {
        varying(f(0))
    }
    fn varying(x: f64) -> Sym {
        varying(x)
    }
    fn parameter(x: f64) -> Sym {
        shared(x)
    }
    fn fixed(x: f64) -> Sym {
        on_tape(|tape| Sym(tape.fixed(x)))
    }
    fn labelled<T>(name: &'static str, first: u32, f: impl FnOnce() -> T) -> T {
        let before = label(name, first);
        let made = f();
        end_label(before);
        made
    }
    fn as_written<T>(f: impl FnOnce() -> T) -> T {
        with_contraction(false, f)
    }
    fn lane(self, _: usize) -> f64 {
        on_tape(|tape| {
            let value = tape.value(self.0);
            tape.failed |= value.is_none();
            value.unwrap_or(f64::NAN)
        })
    }
    fn mul_add(self, b: Sym, c: Sym) -> Sym {
        on_tape(|tape| Sym(tape.fma(self.0, b.0, c.0)))
    }
    fn neg_mul_add(self, b: Sym, c: Sym) -> Sym {
        on_tape(|tape| Sym(tape.fnma(self.0, b.0, c.0)))
    }
    fn recip(self) -> Sym {
        Sym::splat(1.0) / self
    }
    fn sqrt(self) -> Sym {
        on_tape(|tape| Sym(tape.unary(self.0, f64::sqrt, Op::Sqrt)))
    }
    fn abs(self) -> Sym {
        on_tape(|tape| Sym(tape.unary(self.0, f64::abs, Op::Abs)))
    }
    fn max(self, other: Sym) -> Sym {
        on_tape(|tape| Sym(tape.extreme(self.0, other.0, |x, y| if x < y { y } else { x }, Op::Max)))
    }
    fn min(self, other: Sym) -> Sym {
        on_tape(|tape| Sym(tape.extreme(self.0, other.0, |x, y| if y < x { y } else { x }, Op::Min)))
    }
    fn sin_cos(self) -> (Sym, Sym) {
        on_tape(|tape| match tape.known(self.0) {
            Some(0.0) => (Sym(tape.constant(0.0)), Sym(tape.constant(1.0))),
            _ => {
                let (sin, cos) = tape.turn(self.0);
                (Sym(sin), Sym(cos))
            }
        })
    }
    /// A result replaces an earlier one of the same name.
    fn term(name: &'static str, shape: &[usize], values: impl FnOnce() -> Vec<Sym>) {
        if !collects_terms() {
            return;
        }
        let values = values();
        TERMS.with_borrow_mut(|terms| {
            if let Some(terms) = terms {
                terms.retain(|(known, ..)| *known != name);
                terms.push((name, shape.to_vec(), values));
            }
        });
    }
    fn lt(self, other: Sym) -> Sym {
        on_tape(|tape| Sym(tape.less(self.0, other.0)))
    }
    fn select(mask: Sym, yes: Sym, no: Sym) -> Sym {
        on_tape(|tape| Sym(tape.select(mask.0, yes.0, no.0)))
    }
    /// Whether a mask may be true in some lane. A mask that is unknown at recording may be true.
    fn any(mask: Sym) -> bool {
        on_tape(|tape| tape.value(mask.0).is_none_or(|x| x != 0.0))
    }
    /// Whether a mask is certainly true in all lanes. A mask that is unknown at recording may be false in some lane.
    fn all(mask: Sym) -> bool {
        on_tape(|tape| tape.value(mask.0).is_some_and(|x| x != 0.0))
    }
    fn enter<K: Kernel>(kernel: K) -> K::Output {
        kernel.run()
    }
}
