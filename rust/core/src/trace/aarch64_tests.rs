//! Tests of the NEON encoder against assembler text. `make test-aarch64` assembles the text, and runs the code in an emulator.

use super::super::checks::{BINARIES, ORDERS, Operation, PRODUCTS};
use super::super::harness;
use super::super::trials::trials;
use super::*;

/// Offsets, in bytes, near the limits of the addressing forms: nine signed bits, 4095 operands of 8 or 16 bytes, 16 bits, and 32 bits.
const OFFSETS: [i32; 22] = [
    0,
    8,
    16,
    248,
    255,
    256,
    264,
    257,
    32_760,
    32_768,
    32_761,
    65_520,
    65_528,
    65_536,
    131_072,
    -8,
    -256,
    -257,
    -264,
    -65_536,
    i32::MAX - 7,
    i32::MIN,
];
const REGISTERS: [u8; 5] = [0, 7, 8, 16, 29];

fn forms() -> [Form; 2] {
    [true, false].map(|packed| Form { set: Set::Neon, packed })
}

fn sources() -> Vec<Source> {
    let slots = [Base::Frame, Base::Constants].into_iter().flat_map(|base| OFFSETS.map(|offset| (base, offset)));
    let memory = slots.flat_map(|(base, offset)| [Source::Slot(base, offset), Source::Spread(base, offset)]);
    REGISTERS.into_iter().map(Source::Register).chain(memory).collect()
}

/// Every operation with all combinations of equal registers, and with every offset of operands in memory.
fn operations() -> Vec<Operation> {
    let mut all = Vec::new();
    for dst in REGISTERS {
        for a in REGISTERS {
            for b in sources() {
                if !matches!(b, Source::Register(_)) && (dst, a) != (16, 8) && (dst, a) != (29, 29) {
                    continue;
                }
                all.extend(BINARIES.map(|op| Operation::Binary(op, dst, a, b)));
                all.extend(PRODUCTS.iter().flat_map(|&product| ORDERS.map(|order| Operation::Fused(product, order, dst, a, b))));
                all.push(Operation::Less(dst, a, b));
                if let Source::Slot(base, offset) = b {
                    all.push(Operation::Store(base, offset, dst));
                }
            }
            for b in REGISTERS {
                all.extend(REGISTERS.map(|c| Operation::Select(dst, a, b, c)));
            }
            all.push(Operation::SignMask(dst, a));
            all.extend([0, 1, 52, 63].map(|bits| Operation::ShiftLeft(dst, a, bits)));
        }
        all.extend(sources().into_iter().flat_map(|source| [Operation::Sqrt(dst, source), Operation::Load(dst, source)]));
    }
    all
}

/// The expected code of the encoder, as assembler text.
struct Text {
    packed: bool,
    lines: Vec<String>,
}

impl Text {
    fn of(form: Form, operation: Operation) -> Vec<String> {
        let mut text = Text { packed: form.packed, lines: Vec::new() };
        match operation {
            Operation::Binary(op, dst, a, b) => text.binary(op, dst, a, b),
            Operation::Fused(product, order, dst, a, b) => text.fused(product, order, dst, a, b),
            Operation::Sqrt(dst, a) => {
                let a = text.fetch(a);
                text.number("fsqrt", &[dst, a]);
            }
            Operation::Load(dst, from) => text.load(dst, from),
            Operation::Store(base, offset, from) => text.access("st", form.packed, from, base, offset),
            Operation::Less(dst, a, b) => {
                let b = text.fetch(b);
                text.number("fcmgt", &[dst, b, a]);
            }
            Operation::Select(dst, mask, yes, no) => text.select(dst, mask, yes, no),
            Operation::SignMask(dst, a) => text.lines.push(format!("cmlt v{dst}.2d, v{a}.2d, #0")),
            Operation::ShiftLeft(dst, a, bits) => text.lines.push(format!("shl v{dst}.2d, v{a}.2d, #{bits}")),
        }
        text.lines
    }

    fn operands(&mut self, name: &str, registers: &[u8], write: impl Fn(&u8) -> String) {
        self.lines.push(format!("{name} {}", registers.iter().map(write).collect::<Vec<_>>().join(", ")));
    }

    fn number(&mut self, name: &str, registers: &[u8]) {
        let packed = self.packed;
        self.operands(name, registers, |r| if packed { format!("v{r}.2d") } else { format!("d{r}") });
    }

    fn bits(&mut self, name: &str, registers: &[u8]) {
        self.operands(name, registers, |r| format!("v{r}.16b"));
    }

    fn copy(&mut self, dst: u8, from: u8) {
        if dst != from {
            self.bits("mov", &[dst, from]);
        }
    }

    fn fetch(&mut self, source: Source) -> u8 {
        if let Source::Register(register) = source {
            return register;
        }
        self.load(31, source);
        31
    }

    fn load(&mut self, dst: u8, from: Source) {
        match from {
            Source::Register(from) => self.copy(dst, from),
            Source::Slot(base, offset) => self.access("ld", self.packed, dst, base, offset),
            Source::Spread(base, offset) => {
                self.access("ld", false, dst, base, offset);
                if self.packed {
                    self.lines.push(format!("dup v{dst}.2d, v{dst}.d[0]"));
                }
            }
        }
    }

    fn access(&mut self, name: &str, wide: bool, register: u8, base: Base, offset: i32) {
        let size = if wide { 16 } else { 8 };
        let register = format!("{}{register}", if wide { "q" } else { "d" });
        let base = if base == Base::Frame { "x0" } else { "x1" };
        if offset >= 0 && offset % size == 0 && offset / size <= 4095 {
            return self.lines.push(format!("{name}r {register}, [{base}, #{offset}]"));
        }
        if (-256..=255).contains(&offset) {
            return self.lines.push(format!("{name}ur {register}, [{base}, #{offset}]"));
        }
        let offset = i64::from(offset) as u64;
        let (low, high) = (offset & 0xFFFF, offset >> 16 & 0xFFFF);
        let negative = offset >> 63 == 1;
        self.lines.push(if negative { format!("movn x9, #{}", 0xFFFF - low) } else { format!("movz x9, #{low}") });
        if high != if negative { 0xFFFF } else { 0 } {
            self.lines.push(format!("movk x9, #{high}, lsl #16"));
        }
        self.lines.push(format!("{name}r {register}, [{base}, x9]"));
    }

    fn binary(&mut self, op: Binary, dst: u8, a: u8, b: Source) {
        let b = self.fetch(b);
        match op {
            Binary::Add => self.number("fadd", &[dst, a, b]),
            Binary::Sub => self.number("fsub", &[dst, a, b]),
            Binary::Mul => self.number("fmul", &[dst, a, b]),
            Binary::Div => self.number("fdiv", &[dst, a, b]),
            Binary::And => self.bits("and", &[dst, a, b]),
            Binary::AndNot => self.bits("bic", &[dst, b, a]),
            Binary::Or => self.bits("orr", &[dst, a, b]),
            Binary::Xor => self.bits("eor", &[dst, a, b]),
            Binary::Min | Binary::Max => {
                let mask = if [a, b].contains(&dst) { 30 } else { dst };
                self.number("fcmgt", &if op == Binary::Min { [mask, b, a] } else { [mask, a, b] });
                self.select(dst, mask, a, b);
            }
        }
    }

    fn select(&mut self, dst: u8, mask: u8, yes: u8, no: u8) {
        if dst == no {
            self.bits("bit", &[dst, yes, mask]);
        } else if dst == yes && dst != mask {
            self.bits("bif", &[dst, no, mask]);
        } else {
            self.copy(dst, mask);
            self.bits("bsl", &[dst, yes, no]);
        }
    }

    fn fused(&mut self, product: Product, order: Order, dst: u8, a: u8, b: Source) {
        let b = self.fetch(b);
        let [x, y, z] = match order {
            Order::P231 => [a, b, dst],
            Order::P213 => [a, dst, b],
            Order::P132 => [dst, b, a],
        };
        if !self.packed {
            let name = ["fmadd", "fnmsub", "fmsub", "fnmadd"][product as usize];
            return self.number(name, &[dst, x, y, z]);
        }
        let (name, negative) = [("fmla", false), ("fmla", true), ("fmls", false), ("fmls", true)][product as usize];
        let in_place = dst == z && (!negative || ![x, y].contains(&dst));
        let sum = if in_place { dst } else { z.max(30) };
        if negative {
            self.number("fneg", &[sum, z]);
        } else {
            self.copy(sum, z);
        }
        self.number(name, &[sum, x, y]);
        self.copy(dst, sum);
    }
}

fn assembled(form: Form, fill: impl FnOnce(&mut Assembler)) -> Vec<u8> {
    let mut code = Assembler::new(form);
    fill(&mut code);
    code.finish()
}

/// Return the text and the bytes of all operations, of the end of an iteration, of the prologue and epilogue, and of the return
/// instruction.
fn encoded() -> (Vec<String>, Vec<u8>) {
    let (mut lines, mut bytes) = (Vec::new(), Vec::new());
    for form in forms() {
        for operation in operations() {
            let (text, code) = (Text::of(form, operation), assembled(form, |code| operation.emit(code)));
            assert_eq!(code.len(), 4 * text.len(), "{form:?} {operation:?}");
            lines.extend(text);
            bytes.extend(code);
        }
    }
    let enter = ["stp d8, d9, [sp, #-64]!", "stp d10, d11, [sp, #16]", "stp d12, d13, [sp, #32]", "stp d14, d15, [sp, #48]"];
    let leave = ["ldp d14, d15, [sp, #48]", "ldp d12, d13, [sp, #32]", "ldp d10, d11, [sp, #16]", "ldp d8, d9, [sp], #64", "ret"];
    lines.extend(["add x2, x2, #2, lsl #12", "add x2, x2, #128", "subs x3, x3, #1", "b.ne .-12"].map(String::from));
    lines.extend([&enter[..], &leave].concat().into_iter().map(String::from));
    bytes.extend(assembled(forms()[0], |code| code.repeat_from(0, 2 * 4096 + 128)));
    bytes.extend(assembled(forms()[0], |code| {
        code.enter(CallingConvention::SystemV);
        code.leave(CallingConvention::SystemV);
        code.ret();
    }));
    (lines, bytes)
}

/// Check at least one form of each instruction against the word of the GNU assembler. `make test-aarch64` compares all operations.
#[test]
fn words_are_those_of_the_assembler() {
    let known: [(&str, u32); 53] = [
        ("fadd v29.2d, v16.2d, v8.2d", 0x4E68_D61D),
        ("fsub v29.2d, v16.2d, v8.2d", 0x4EE8_D61D),
        ("fmul v29.2d, v16.2d, v8.2d", 0x6E68_DE1D),
        ("fdiv v29.2d, v16.2d, v8.2d", 0x6E68_FE1D),
        ("fsqrt v29.2d, v16.2d", 0x6EE1_FA1D),
        ("fcmgt v29.2d, v16.2d, v8.2d", 0x6EE8_E61D),
        ("fneg v30.2d, v29.2d", 0x6EE0_FBBE),
        ("fmla v29.2d, v16.2d, v8.2d", 0x4E68_CE1D),
        ("fmls v29.2d, v16.2d, v8.2d", 0x4EE8_CE1D),
        ("fadd d29, d16, d8", 0x1E68_2A1D),
        ("fsub d29, d16, d8", 0x1E68_3A1D),
        ("fmul d29, d16, d8", 0x1E68_0A1D),
        ("fdiv d29, d16, d8", 0x1E68_1A1D),
        ("fsqrt d29, d16", 0x1E61_C21D),
        ("fcmgt d29, d16, d8", 0x7EE8_E61D),
        ("fmadd d29, d16, d8, d29", 0x1F48_761D),
        ("fmsub d29, d16, d8, d29", 0x1F48_F61D),
        ("fnmadd d29, d16, d8, d29", 0x1F68_761D),
        ("fnmsub d29, d16, d8, d29", 0x1F68_F61D),
        ("and v29.16b, v16.16b, v8.16b", 0x4E28_1E1D),
        ("bic v29.16b, v16.16b, v8.16b", 0x4E68_1E1D),
        ("orr v29.16b, v16.16b, v8.16b", 0x4EA8_1E1D),
        ("eor v29.16b, v16.16b, v8.16b", 0x6E28_1E1D),
        ("mov v29.16b, v16.16b", 0x4EB0_1E1D),
        ("bsl v29.16b, v16.16b, v8.16b", 0x6E68_1E1D),
        ("bit v29.16b, v16.16b, v8.16b", 0x6EA8_1E1D),
        ("bif v29.16b, v16.16b, v8.16b", 0x6EE8_1E1D),
        ("cmlt v29.2d, v16.2d, #0", 0x4EE0_AA1D),
        ("shl v29.2d, v16.2d, #52", 0x4F74_561D),
        ("dup v29.2d, v29.d[0]", 0x4E08_07BD),
        ("ldr q29, [x1, #65520]", 0x3DFF_FC3D),
        ("ldr d29, [x1, #32760]", 0xFD7F_FC3D),
        ("str q29, [x0, #65520]", 0x3DBF_FC1D),
        ("str d29, [x0, #32760]", 0xFD3F_FC1D),
        ("ldur q29, [x1, #-256]", 0x3CD0_003D),
        ("ldur d29, [x1, #255]", 0xFC4F_F03D),
        ("stur q29, [x0, #-256]", 0x3C90_001D),
        ("stur d29, [x0, #255]", 0xFC0F_F01D),
        ("ldr q29, [x1, x9]", 0x3CE9_683D),
        ("ldr d29, [x1, x9]", 0xFC69_683D),
        ("str q29, [x0, x9]", 0x3CA9_681D),
        ("str d29, [x0, x9]", 0xFC29_681D),
        ("movz x9, #65528", 0xD29F_FF09),
        ("movn x9, #256", 0x9280_2009),
        ("movk x9, #32768, lsl #16", 0xF2B0_0009),
        ("stp d8, d9, [sp, #-64]!", 0x6DBC_27E8),
        ("stp d14, d15, [sp, #48]", 0x6D03_3FEE),
        ("ldp d14, d15, [sp, #48]", 0x6D43_3FEE),
        ("ldp d8, d9, [sp], #64", 0x6CC4_27E8),
        ("ret", 0xD65F_03C0),
        ("add x2, x2, #128", 0x9102_0042),
        ("subs x3, x3, #1", 0xF100_0463),
        ("b.ne .-12", 0x54FF_FFA1),
    ];
    let (lines, bytes) = encoded();
    assert_eq!(bytes.len(), 4 * lines.len());
    for (text, word) in known {
        let at = lines.iter().position(|line| line == text).expect(text);
        let got = u32::from_le_bytes(bytes[4 * at..][..4].try_into().unwrap());
        assert_eq!(format!("{got:08x}"), format!("{word:08x}"), "{text}");
    }
    let name = |line: &str| line.split(' ').next().unwrap().to_owned();
    let missing = lines.iter().find(|line| !known.iter().any(|(text, _)| name(text) == name(line)));
    assert_eq!(missing, None);
    harness::write("encoded.s", &(lines.join("\n") + "\n"));
    harness::write("encoded.bin", &bytes);
}

/// Write the cases for the emulator. On aarch64 this test also runs them.
#[test]
fn operations_agree_with_rust() {
    let mut cases = harness::Cases::default();
    for form in forms() {
        for trial in trials::<Assembler>(form, 2_000, 3) {
            #[cfg(target_arch = "aarch64")]
            {
                use super::super::{memory::Code, trials::Memory};
                let (mut frame, constants) = (Memory(trial.frame), Memory(trial.constants));
                // SAFETY: the code is for this processor, and both memories contain all slots that it accesses.
                unsafe { Code::new(&trial.code).unwrap().run(frame.0.as_mut_ptr(), constants.0.as_ptr(), std::ptr::null(), 1) };
                trial.check(&frame.0);
            }
            cases.add(&trial.code, &trial.frame, &trial.constants, (&[], 1), &trial.expected);
        }
    }
    assert_eq!(cases.len(), 4_000);
    harness::write("operations.s", &cases.finish());
}
