//! A recording as C functions of limited length, in the order of the recording. An *entry* is the index of a recorded operation. An entry
//! that must be computed at run time is one statement. A statement can contain a comparison, or compute both sine and cosine.
//!
//! Inputs are in an array `x`, and results in an array `y`. The array `w` has the values that a later function reads. If `fused` is true,
//! the code calls `fma` for each recorded multiply-add. The compiler must not fuse other operations.

use super::super::decision::{has_c, printed};
use super::super::tape::Op;
use super::fold::Folded;
use crate::scalar::hex::hex;
use crate::scalar::trig::REDUCTION_LIMIT;
use std::collections::HashMap;
use std::fmt::Write;

/// The largest number of statements in one function. It limits the time in which a compiler optimises a function.
const LENGTH: usize = 2000;

const NONE: usize = usize::MAX;

/// A recorded computation that is to be printed.
pub struct Routine<'a> {
    pub ops: &'a [Op],
    /// The value of each input, if it is known. The other inputs are `x[0]`, `x[1]`, .. in order.
    pub given: &'a [Option<f64>],
    /// The entries of the results `y[0]`, `y[1]`, ..
    pub answer: &'a [u32],
    /// Whether multiply-add operations are fused as recorded. If false, they round twice.
    pub fused: bool,
}

/// A routine as text.
pub struct Printed {
    /// The functions of the routine, each `static`.
    pub functions: String,
    /// The calls of these functions, in order. The arguments are those of the arrays `x`, `w` and `y` that the function uses. Each function
    /// returns one if the magnitudes of all angles are below `REDUCTION_LIMIT`, otherwise zero.
    pub calls: Vec<String>,
    /// The size of `w`. If it is zero, the functions have no argument `w`.
    pub slots: usize,
    /// The number of statements.
    pub statements: usize,
}

/// One statement. A call of the sine function computes one or two entries.
struct Statement {
    makes: Vec<u32>,
    reads: Vec<u32>,
}

/// The number of the function that computes an entry, and the number of the last function that reads it.
#[derive(Clone, Copy)]
struct Life {
    part: usize,
    last: usize,
    /// The index of the entry in `w`.
    slot: usize,
}

struct Printer<'a> {
    routine: &'a Routine<'a>,
    folded: Folded,
    /// For each input, its index in `x`.
    inputs: Vec<usize>,
    statements: Vec<Statement>,
    /// The number of statements in each function. The last function may have fewer.
    length: usize,
    lives: Vec<Life>,
    /// For each entry that is a result, its indices in `y`.
    answers: HashMap<u32, Vec<usize>>,
    /// The C functions of native code, by the number of its kind.
    natives: HashMap<u32, String>,
}

impl Routine<'_> {
    /// Print the functions of this routine. Their names begin with `name`. The names of the sine functions begin with `prefix`.
    pub fn print(&self, name: &str, prefix: &str) -> Printed {
        let mut next = 0;
        let place = |given: &Option<f64>| {
            next += usize::from(given.is_none());
            next - usize::from(given.is_none())
        };
        let inputs = self.given.iter().map(place).collect();
        let folded = Folded::of(self.ops, self.given, self.fused);
        let mut answers: HashMap<u32, Vec<usize>> = HashMap::new();
        for (k, &entry) in self.answer.iter().enumerate() {
            answers.entry(folded.same[entry as usize]).or_default().push(k);
        }
        let (natives, mut functions) = self.natives(name);
        let lives = vec![Life { part: NONE, last: NONE, slot: NONE }; self.ops.len()];
        let mut printer = Printer { routine: self, folded, inputs, statements: Vec::new(), length: 0, lives, answers, natives };
        printer.order();
        let slots = printer.divide();
        let parts = printer.statements.len().div_ceil(printer.length).max(1);
        let mut calls = Vec::new();
        for part in 0..parts {
            let (text, call) = printer.part(&format!("{name}_{}", part + 1), prefix, part);
            functions += &text;
            calls.push(call);
        }
        Printed { functions, calls, slots, statements: printer.statements.len() }
    }
}

impl Routine<'_> {
    /// The C functions of native code with their names by the number of its kind, and their text.
    fn natives(&self, name: &str) -> (HashMap<u32, String>, String) {
        let (mut names, mut text) = (HashMap::new(), String::new());
        for op in self.ops {
            if let Op::Decide(_, kind) = *op
                && has_c(kind)
                && !names.contains_key(&kind)
            {
                let name = format!("{name}_stack{}", if names.is_empty() { String::new() } else { format!("_{}", names.len() + 1) });
                text += &printed(kind, &name);
                names.insert(kind, name);
            }
        }
        (names, text)
    }
}

impl Printer<'_> {
    fn op(&self, entry: u32) -> Op {
        self.routine.ops[entry as usize]
    }

    /// Whether an entry is computed at run time.
    fn is_computed(&self, entry: u32) -> bool {
        self.folded.value[entry as usize].is_none() && !matches!(self.op(entry), Op::Const(_) | Op::Input(_))
    }

    /// The entries that the statement of `entry` reads. The statement of a selection contains its comparison.
    fn reads(&self, entry: u32) -> Vec<u32> {
        let same = |entry: u32| self.folded.same[entry as usize];
        let of = |op: Op| op.operands().map(same).collect::<Vec<u32>>();
        match self.op(entry) {
            Op::Select(mask, yes, no) => match self.op(same(mask)) {
                Op::Less(a, b) => vec![same(a), same(b), same(yes), same(no)],
                _ => vec![same(mask), same(yes), same(no)],
            },
            Op::Decided(cut, given, _) => self.arguments(cut).into_iter().chain([same(given)]).collect(),
            op => of(op),
        }
    }

    /// The arguments of a cut.
    fn arguments(&self, cut: u32) -> Vec<u32> {
        let mut all = Vec::new();
        if let Op::Decide(mut list, _) = self.op(cut) {
            while let Op::Argument(before, x) = self.op(list) {
                all.push(self.folded.same[x as usize]);
                list = before;
            }
        }
        all.reverse();
        all
    }

    /// List the statements that the results require, in the order of the recording.
    fn order(&mut self) {
        let count = self.routine.ops.len();
        let mut needed = vec![false; count];
        self.answers.keys().for_each(|&entry| needed[entry as usize] = true);
        for i in (0..count as u32).rev() {
            if needed[i as usize] && self.is_computed(i) {
                self.reads(i).into_iter().for_each(|a| needed[a as usize] = true);
            }
        }
        let mut turns: HashMap<u32, usize> = HashMap::new();
        for i in (0..count as u32).filter(|&i| needed[i as usize]) {
            if !self.is_computed(i) {
                continue;
            }
            // One statement has both sine and cosine of an angle, or all results of a cut.
            let turn = match self.op(i) {
                Op::Sin(a) | Op::Cos(a) => Some(self.folded.same[a as usize]),
                Op::Decided(cut, ..) => Some(cut),
                _ => None,
            };
            if let Some(&at) = turn.and_then(|turn| turns.get(&turn)) {
                let reads: Vec<u32> = self.reads(i).into_iter().filter(|&a| self.is_computed(a)).collect();
                let statement = &mut self.statements[at];
                statement.makes.push(i);
                statement.reads.extend(reads);
                continue;
            }
            if let Some(turn) = turn {
                turns.insert(turn, self.statements.len());
            }
            let reads = self.reads(i).into_iter().filter(|&a| self.is_computed(a)).collect();
            self.statements.push(Statement { makes: vec![i], reads });
        }
    }

    /// Divide the statements into functions of equal length, except the last one. Assign elements of `w` to the values that later functions
    /// read. Return the size of `w`.
    fn divide(&mut self) -> usize {
        let parts = self.statements.len().div_ceil(LENGTH).max(1);
        self.length = self.statements.len().div_ceil(parts).max(1);
        for (k, statement) in self.statements.iter().enumerate() {
            let part = k / self.length;
            statement.makes.iter().for_each(|&entry| self.lives[entry as usize] = Life { part, last: part, slot: NONE });
            statement.reads.iter().for_each(|&entry| self.lives[entry as usize].last = part);
        }
        let (mut free, mut slots): (Vec<(usize, usize)>, usize) = (Vec::new(), 0);
        for (k, statement) in self.statements.iter().enumerate() {
            for &entry in &statement.makes {
                let life = &mut self.lives[entry as usize];
                if life.last == life.part {
                    continue;
                }
                // An element of `w` is free after the last function that reads it.
                let at = free.iter().position(|&(last, _)| last < k / self.length);
                life.slot = at.map_or(slots, |at| free.swap_remove(at).1);
                slots = slots.max(life.slot + 1);
                free.push((life.last, life.slot));
            }
        }
        slots
    }

    /// Return the text of function number `part`, and its call.
    fn part(&self, name: &str, prefix: &str, part: usize) -> (String, String) {
        let first = (part * self.length).min(self.statements.len());
        let last = (first + self.length).min(self.statements.len());
        let (mut text, mut here) = (String::new(), vec![false; self.routine.ops.len()]);
        let mut used = Used { turns: false, text: &mut text };
        if part == 0 {
            self.leaves(&mut used);
        }
        for statement in &self.statements[first..last] {
            for &entry in &statement.reads {
                let life = self.lives[entry as usize];
                if life.part != part && !std::mem::replace(&mut here[entry as usize], true) {
                    used.line(format_args!("const double t{entry} = w[{}];", life.slot));
                }
            }
            self.statement(statement, prefix, &mut used);
            for &entry in &statement.makes {
                for k in self.answers.get(&entry).into_iter().flatten() {
                    used.line(format_args!("y[{k}] = t{entry};"));
                }
                if self.lives[entry as usize].slot != NONE {
                    used.line(format_args!("w[{}] = t{entry};", self.lives[entry as usize].slot));
                }
            }
        }
        let turns = used.turns;
        let arrays = [("x", "const double *restrict x"), ("w", "double *restrict w"), ("y", "double *restrict y")];
        let arrays: Vec<_> = arrays.into_iter().filter(|(name, _)| text.contains(&format!("{name}["))).collect();
        let (parameters, arguments): (Vec<_>, Vec<_>) = arrays.into_iter().map(|(name, parameter)| (parameter, name)).unzip();
        let parameters = if parameters.is_empty() { "void".into() } else { parameters.join(", ") };
        let (start, end) = if turns { ("    int sound = 1;\n", "sound") } else { ("", "1") };
        (
            format!("static int {name}({parameters})\n{{\n{start}{text}    return {end};\n}}\n\n"),
            format!("{name}({})", arguments.join(", ")),
        )
    }

    /// Write the results that need no statement: inputs and known numbers.
    fn leaves(&self, used: &mut Used) {
        for (k, &entry) in self.routine.answer.iter().enumerate() {
            let entry = self.folded.same[entry as usize];
            if !self.is_computed(entry) {
                used.line(format_args!("y[{k}] = {};", self.operand(entry)));
            }
        }
    }

    /// Return the expression for an entry.
    fn operand(&self, entry: u32) -> String {
        let entry = self.folded.same[entry as usize];
        match (self.folded.value[entry as usize], self.op(entry)) {
            (Some(x), _) if x.is_sign_negative() => format!("({})", hex(x)),
            (Some(x), _) => hex(x),
            (_, Op::Const(bits)) => hex(f64::from_bits(bits)),
            (_, Op::Input(k)) => format!("x[{}]", self.inputs[k as usize]),
            _ => format!("t{entry}"),
        }
    }

    fn statement(&self, statement: &Statement, prefix: &str, used: &mut Used) {
        let entry = statement.makes[0];
        let at = |a: u32| self.operand(a);
        let fused = self.routine.fused;
        let value = match self.op(entry) {
            Op::Sin(a) | Op::Cos(a) => return self.turn(statement, &at(a), prefix, used),
            Op::Const(_) | Op::Input(_) => return,
            Op::Decided(cut, ..) => return self.cut(statement, cut, used),
            // Only results of cuts are read.
            Op::Argument(..) | Op::Decide(..) => return,
            Op::Add(a, b) => format!("{} + {}", at(a), at(b)),
            Op::Sub(a, b) => format!("{} - {}", at(a), at(b)),
            Op::Mul(a, b) => format!("{} * {}", at(a), at(b)),
            Op::Div(a, b) => format!("{} / {}", at(a), at(b)),
            Op::Neg(a) => format!("-{}", at(a)),
            Op::Fma(a, b, c) if fused => format!("fma({}, {}, {})", at(a), at(b), at(c)),
            Op::Fma(a, b, c) => format!("{} * {} + {}", at(a), at(b), at(c)),
            Op::Fnma(a, b, c) if fused => format!("fma(-{}, {}, {})", at(a), at(b), at(c)),
            Op::Fnma(a, b, c) => format!("{} - {} * {}", at(c), at(a), at(b)),
            Op::Sqrt(a) => format!("sqrt({})", at(a)),
            Op::Abs(a) => format!("fabs({})", at(a)),
            Op::Max(a, b) => format!("{0} < {1} ? {1} : {0}", at(a), at(b)),
            Op::Min(a, b) => format!("{1} < {0} ? {1} : {0}", at(a), at(b)),
            Op::Less(a, b) => format!("{} < {} ? 1.0 : 0.0", at(a), at(b)),
            Op::Select(mask, yes, no) => {
                let mask = match self.op(self.folded.same[mask as usize]) {
                    Op::Less(a, b) => format!("{} < {}", at(a), at(b)),
                    _ => format!("{} != 0.0", at(mask)),
                };
                format!("{mask} ? {} : {}", at(yes), at(no))
            }
        };
        used.line(format_args!("const double t{entry} = {value};"));
    }

    /// Write a call of native code, which replaces the results of the formula where they are not valid.
    fn cut(&self, statement: &Statement, cut: u32, used: &mut Used) {
        let Op::Decide(_, kind) = self.op(cut) else { return };
        let all = self.routine.ops.iter().filter(|op| matches!(op, Op::Decided(of, ..) if *of == cut)).count();
        let arguments: Vec<String> = self.arguments(cut).into_iter().map(|a| self.operand(a)).collect();
        used.line(format_args!("double d{cut}[{all}];"));
        for &entry in &statement.makes {
            if let Op::Decided(_, given, k) = self.op(entry) {
                used.line(format_args!("d{cut}[{k}] = {};", self.operand(given)));
            }
        }
        used.line(format_args!("if (!({} == 1.0)) {{", arguments[0]));
        used.line(format_args!("    const double a{cut}[{}] = {{{}}};", arguments.len(), arguments.join(", ")));
        used.line(format_args!("    {}(a{cut}, d{cut});", self.natives[&kind]));
        used.line(format_args!("}}"));
        for &entry in &statement.makes {
            if let Op::Decided(_, _, k) = self.op(entry) {
                used.line(format_args!("const double t{entry} = d{cut}[{k}];"));
            }
        }
    }

    /// Write a call that computes sine and cosine of an angle.
    fn turn(&self, statement: &Statement, angle: &str, prefix: &str, used: &mut Used) {
        let first = statement.makes[0];
        let of = |sine: bool| {
            let is = |&&entry: &&u32| matches!(self.op(entry), Op::Sin(_)) == sine;
            statement.makes.iter().find(is).map_or(format!("{}{first}", if sine { "s" } else { "c" }), |entry| format!("t{entry}"))
        };
        let (sin, cos) = (of(true), of(false));
        used.line(format_args!("double {sin}, {cos};"));
        used.line(format_args!("{prefix}_sin_cos({angle}, &{sin}, &{cos});"));
        used.line(format_args!("sound &= fabs({angle}) < {};", hex(REDUCTION_LIMIT)));
        used.turns = true;
    }
}

/// The text of a function during its construction. `turns`: whether the function checks angles.
struct Used<'a> {
    turns: bool,
    text: &'a mut String,
}

impl Used<'_> {
    fn line(&mut self, line: std::fmt::Arguments) {
        // Writing to a string does not fail.
        let _ = writeln!(self.text, "    {line}");
    }
}
