//! A tape is the list of recorded operations. An *entry* is the index of an operation in this list. The tape folds constants, zeros and
//! ones, and equal operations share an entry. A *set-up parameter* is a number that is constant in a run, such as a mass or a gain. The
//! *varying* set-up parameters are those that [`Moving`] selects, for example to compute derivatives with respect to them.
//!
//! Folding does not change the value of a finite computation, except for the signs of zeros. For example, it simplifies `0 x`, `1 x`,
//! `x + 0`, `-(-x)` and `a + (-b)`. It does not regroup sums or products. A tape without folding records every operation, for comparisons
//! with the folded tape.

use super::decision::has_c;
use super::label::Labels;
use super::memo::Memo;
pub use super::operation::Op;

/// Selects the varying set-up parameters. Each of them is a separate input, even if other parameters have the same value.
#[derive(Clone, Debug)]
pub enum Moving {
    Nothing,
    All,
    /// The set-up parameters whose element in this list is true, in the order of their declaration.
    These(Vec<bool>),
}

/// A recording in progress.
pub(super) struct Tape {
    pub ops: Vec<Op>,
    memo: Memo<Op>,
    /// The inputs that several set-up parameters of equal value share, by the bits of this value.
    by_value: Memo<u64>,
    pub values: Vec<f64>,
    /// The labels of the set-up parameters that became inputs.
    pub labels: Labels,
    /// The entries of the set-up parameters in the order of recording. A parameter that is recorded by `fixed` is in the list only if
    /// `moving` is not `Nothing`. Recordings can share a program only if their lists are equal.
    pub structure: Vec<u32>,
    pub inputs: u32,
    pub set_up: bool,
    pub failed: bool,
    pub moving: Moving,
    /// Whether a product that is added or subtracted becomes a multiply-add. Instruction sets without fused multiply-add round it twice, like
    /// the product and the sum.
    pub contracts: bool,
    /// For each entry, whether it was recorded while `contracts` was true. Only such products are contracted.
    fusible: Vec<bool>,
    folds: bool,
    /// Whether the recording is for derivatives.
    pub differentiates: bool,
    /// Entries that are one where the results of native code are valid.
    pub conditions: Vec<u32>,
}

impl Tape {
    /// Return a tape with the constants 0, 1 and -1 as entries 0 to 2. A set-up parameter with such a value refers to these entries and not
    /// to an input, unless [`Moving`] selects it.
    pub fn new() -> Self {
        Tape::that(true)
    }

    /// Return a new tape. If `folds` is false, it records every operation without simplification.
    pub fn that(folds: bool) -> Self {
        let mut tape = Tape {
            ops: Vec::new(),
            memo: Memo::with_capacity_and_hasher(1024, Default::default()),
            by_value: Memo::default(),
            values: Vec::new(),
            labels: Labels::default(),
            structure: Vec::new(),
            inputs: 0,
            set_up: true,
            failed: false,
            moving: Moving::Nothing,
            contracts: false,
            fusible: Vec::new(),
            folds,
            differentiates: false,
            conditions: Vec::new(),
        };
        for x in [0.0, 1.0, -1.0] {
            tape.constant(x);
        }
        tape
    }

    /// Return a tape that continues the operations `ops` of a recording whose set-up phase has ended.
    pub fn resume(ops: Vec<Op>, inputs: u32) -> Self {
        let memo = ops.iter().enumerate().map(|(i, &op)| (op, i as u32)).collect();
        let fusible = vec![false; ops.len()];
        Tape { ops, memo, inputs, set_up: false, fusible, ..Tape::new() }
    }

    pub fn push(&mut self, op: Op) -> u32 {
        let Tape { ops, fusible, contracts, .. } = self;
        let mut append = || {
            ops.push(op);
            fusible.push(*contracts);
            ops.len() as u32 - 1
        };
        if !self.folds && op.operands().next().is_some() {
            return append();
        }
        *self.memo.entry(op).or_insert_with(append)
    }

    /// Return the entry of a constant. Both zeros have the same entry.
    pub fn constant(&mut self, x: f64) -> u32 {
        self.push(Op::Const(if x == 0.0 { 0 } else { x.to_bits() }))
    }

    pub fn new_input(&mut self) -> u32 {
        self.inputs += 1;
        self.push(Op::Input(self.inputs - 1))
    }

    /// Whether `moving` selects the next set-up parameter.
    fn next_moves(&self) -> bool {
        match &self.moving {
            Moving::Nothing => false,
            Moving::All => true,
            Moving::These(moving) => moving.get(self.structure.len()).is_some_and(|&moves| moves),
        }
    }

    /// Record a set-up parameter as an input. The values 0, 1 and -1 become constants instead, unless `moving` selects the parameter.
    pub fn given(&mut self, x: f64) -> u32 {
        let label = self.labels.next();
        let entry = if (x == 0.0 || x.abs() == 1.0) && !self.next_moves() {
            self.constant(x)
        } else {
            self.values.push(x);
            self.labels.all.push(label);
            self.new_input()
        };
        self.structure.push(entry);
        entry
    }

    /// Record a set-up parameter. Parameters of equal value that are recorded with this function share one input, unless `moving` selects
    /// them.
    pub fn shared(&mut self, x: f64) -> u32 {
        if self.next_moves() {
            return self.given(x);
        }
        if let Some(&known) = self.by_value.get(&x.to_bits()) {
            self.labels.next();
            self.structure.push(known);
            return known;
        }
        let new = self.given(x);
        self.by_value.insert(x.to_bits(), new);
        new
    }

    /// Record a set-up parameter as a constant, unless `moving` selects it. The list `structure` contains it only if `moving` is not
    /// `Nothing`.
    pub fn fixed(&mut self, x: f64) -> u32 {
        if self.set_up && self.next_moves() {
            return self.given(x);
        }
        let entry = self.constant(x);
        if self.set_up && !matches!(self.moving, Moving::Nothing) {
            self.structure.push(entry);
        }
        entry
    }

    /// The value of entry `a`, if it is a constant.
    pub fn value(&self, a: u32) -> Option<f64> {
        if let Op::Const(bits) = self.ops[a as usize] { Some(f64::from_bits(bits)) } else { None }
    }

    /// The value of entry `a`, if it is a constant and the tape folds constants.
    pub fn known(&self, a: u32) -> Option<f64> {
        self.value(a).filter(|_| self.folds)
    }

    fn negated(&self, a: u32) -> Option<u32> {
        if let Op::Neg(x) = self.ops[a as usize] { Some(x).filter(|_| self.folds) } else { None }
    }

    pub fn unary(&mut self, a: u32, f: fn(f64) -> f64, op: fn(u32) -> Op) -> u32 {
        match self.known(a) {
            Some(x) => self.constant(f(x)),
            None => self.push(op(a)),
        }
    }

    pub fn extreme(&mut self, a: u32, b: u32, f: fn(f64, f64) -> f64, op: fn(u32, u32) -> Op) -> u32 {
        match (self.known(a), self.known(b)) {
            (Some(x), Some(y)) => self.constant(f(x, y)),
            _ if a == b && self.folds => a,
            _ => self.push(op(a, b)),
        }
    }

    pub fn neg(&mut self, a: u32) -> u32 {
        match (self.known(a), self.negated(a)) {
            (Some(x), _) => self.constant(-x),
            (_, Some(b)) => b,
            _ => self.push(Op::Neg(a)),
        }
    }

    /// The factors of entry `a`, if it is a product that is contracted.
    fn product(&self, a: u32) -> Option<(u32, u32)> {
        if let Op::Mul(x, y) = self.ops[a as usize] { Some((x, y)).filter(|_| self.contracts && self.fusible[a as usize]) } else { None }
    }

    pub fn add(&mut self, a: u32, b: u32) -> u32 {
        match (self.known(a), self.known(b)) {
            (Some(x), Some(y)) => return self.constant(x + y),
            (Some(0.0), _) => return b,
            (_, Some(0.0)) => return a,
            _ => {}
        }
        match (self.negated(a), self.negated(b)) {
            (_, Some(b)) => self.sub(a, b),
            (Some(a), None) => self.sub(b, a),
            _ if a == b => self.push(Op::Add(a, b)),
            _ => match (self.product(a.max(b)), self.product(a.min(b))) {
                // Of two products, the one that was recorded last is contracted. So a sum of products is a chain of multiply-adds.
                (Some((x, y)), _) => self.push(Op::Fma(x, y, a.min(b))),
                (None, Some((x, y))) => self.push(Op::Fma(x, y, a.max(b))),
                (None, None) => self.push(Op::Add(a.min(b), a.max(b))),
            },
        }
    }

    pub fn sub(&mut self, a: u32, b: u32) -> u32 {
        match (self.known(a), self.known(b)) {
            (Some(x), Some(y)) => return self.constant(x - y),
            (Some(0.0), _) => return self.neg(b),
            (_, Some(0.0)) => return a,
            _ => {}
        }
        if let Some(b) = self.negated(b) {
            return self.add(a, b);
        }
        match (self.product(a), self.product(b)) {
            _ if a == b => self.push(Op::Sub(a, b)),
            (None, Some((x, y))) => self.push(Op::Fnma(x, y, a)),
            (Some(_), Some((x, y))) if b > a => self.push(Op::Fnma(x, y, a)),
            (Some((x, y)), _) => {
                let minus_b = self.neg(b);
                self.push(Op::Fma(x, y, minus_b))
            }
            _ => self.push(Op::Sub(a, b)),
        }
    }

    /// Return the product if it requires no new multiplication: a factor is 0, 1 or -1, or both factors are constants.
    fn trivial_product(&mut self, a: u32, b: u32) -> Option<u32> {
        match (self.known(a), self.known(b)) {
            (Some(x), Some(y)) => Some(self.constant(x * y)),
            (Some(0.0), _) | (_, Some(0.0)) => Some(0),
            (Some(1.0), _) => Some(b),
            (_, Some(1.0)) => Some(a),
            (Some(-1.0), _) => Some(self.neg(b)),
            (_, Some(-1.0)) => Some(self.neg(a)),
            _ => None,
        }
    }

    /// Return `trivial_product` if it is exact. Then a separate sum rounds like the fused operation.
    fn exact_product(&mut self, a: u32, b: u32) -> Option<u32> {
        match (self.known(a), self.known(b)) {
            (Some(x), Some(y)) if x.mul_add(y, -(x * y)) != 0.0 => None,
            _ => self.trivial_product(a, b),
        }
    }

    pub fn mul(&mut self, a: u32, b: u32) -> u32 {
        if let Some(product) = self.trivial_product(a, b) {
            return product;
        }
        match (self.negated(a), self.negated(b)) {
            (Some(a), Some(b)) => self.mul(a, b),
            (Some(x), None) => {
                let product = self.mul(x, b);
                self.neg(product)
            }
            (None, Some(y)) => {
                let product = self.mul(a, y);
                self.neg(product)
            }
            _ => self.push(Op::Mul(a.min(b), a.max(b))),
        }
    }

    pub fn fma(&mut self, a: u32, b: u32, c: u32) -> u32 {
        if let Some(product) = self.exact_product(a, b) {
            return self.add(product, c);
        }
        if self.known(c) == Some(0.0) {
            return self.mul(a, b);
        }
        match (self.negated(a), self.negated(b)) {
            (Some(a), Some(b)) => self.fma(a, b, c),
            (Some(a), None) => self.fnma(a, b, c),
            (None, Some(b)) => self.fnma(a, b, c),
            _ => self.push(Op::Fma(a.min(b), a.max(b), c)),
        }
    }

    pub fn fnma(&mut self, a: u32, b: u32, c: u32) -> u32 {
        if let Some(product) = self.exact_product(a, b) {
            return self.sub(c, product);
        }
        match (self.negated(a), self.negated(b)) {
            (Some(a), Some(b)) => self.fnma(a, b, c),
            (Some(a), None) => self.fma(a, b, c),
            (None, Some(b)) => self.fma(a, b, c),
            _ => self.push(Op::Fnma(a.min(b), a.max(b), c)),
        }
    }

    /// Record sine and cosine of entry `a`, and return both entries.
    pub fn turn(&mut self, a: u32) -> (u32, u32) {
        (self.push(Op::Sin(a)), self.push(Op::Cos(a)))
    }

    pub fn div(&mut self, a: u32, b: u32) -> u32 {
        match (self.known(a), self.known(b)) {
            (Some(x), Some(y)) => self.constant(x / y),
            (Some(0.0), _) => 0,
            (_, Some(1.0)) => a,
            _ => self.push(Op::Div(a, b)),
        }
    }

    pub fn less(&mut self, a: u32, b: u32) -> u32 {
        match (self.known(a), self.known(b)) {
            (Some(x), Some(y)) => self.constant(f64::from(u8::from(x < y))),
            _ => self.push(Op::Less(a, b)),
        }
    }

    /// Record a cut, and return the entries of the results after it. Results of a formula that are always valid are not replaced.
    pub fn decide(&mut self, kind: u32, arguments: &[u32], given: &[u32]) -> Vec<u32> {
        if self.known(arguments[0]) == Some(1.0) {
            return given.to_vec();
        }
        let list = arguments.iter().fold(0, |before, &x| self.push(Op::Argument(before, x)));
        let cut = self.push(Op::Decide(list, kind));
        given.iter().zip(0..).map(|(&given, k)| self.push(Op::Decided(cut, given, k))).collect()
    }

    /// The entries that are one if the results of a cut are valid, for all cuts so far. Native code with derivatives, or with C code, has its
    /// conditions in place of the validity of the formula.
    pub fn validities(&self) -> Vec<u32> {
        let first = |mut list: u32| {
            while let Op::Argument(before, x) = self.ops[list as usize] {
                if before == 0 {
                    return x;
                }
                list = before;
            }
            list
        };
        let without_c = |op: &Op| if let Op::Decide(list, kind) = *op { (!has_c(kind)).then(|| first(list)) } else { None };
        let cuts = self.ops.iter().filter_map(without_c);
        cuts.filter(|entry| self.known(*entry) != Some(0.0)).chain(self.conditions.iter().copied()).collect()
    }

    pub fn select(&mut self, mask: u32, yes: u32, no: u32) -> u32 {
        match self.known(mask) {
            Some(x) if x != 0.0 => yes,
            Some(_) => no,
            None if yes == no && self.folds => yes,
            None => self.push(Op::Select(mask, yes, no)),
        }
    }
}
