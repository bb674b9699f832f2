//! Tests of the encoder against the decoder and the encoder of iced-x86.

use super::super::checks::{BINARIES, ORDERS, PRODUCTS};
use super::*;
use iced_x86::{Decoder, DecoderOptions, Encoder, Instruction, OpKind, Register};

const SETS: [Set; 3] = [Set::Sse2, Set::Avx2, Set::Avx512];
/// Displacements near the limits of one byte, in units of bytes and of operands.
const OFFSETS: [i32; 26] = [
    0,
    8,
    64,
    120,
    127,
    128,
    129,
    136,
    1016,
    1024,
    2032,
    4064,
    4096,
    8128,
    8192,
    -8,
    -128,
    -129,
    -136,
    -1024,
    -1032,
    -8192,
    -8256,
    1_000_000,
    -1_000_000,
    i32::MAX - 7,
];

fn forms() -> impl Iterator<Item = Form> {
    SETS.into_iter().flat_map(|set| [true, false].map(|packed| Form { set, packed }))
}

/// Registers near every limit of the encodings.
fn registers(form: Form) -> Vec<u8> {
    let all = [0, 5, 7, 8, 14, 15, 16, 23, 24, 31];
    all.into_iter().filter(|&r| (r as usize) < form.registers()).collect()
}

fn slots() -> impl Iterator<Item = Source> {
    [Base::Frame, Base::Constants].into_iter().flat_map(|base| OFFSETS.map(|offset| Source::Slot(base, offset)))
}

fn spread(source: Source) -> Source {
    if let Source::Slot(base, offset) = source { Source::Spread(base, offset) } else { source }
}

/// All operands: registers, slots, and broadcast numbers if the form has them.
fn sources(form: Form) -> Vec<Source> {
    let spreads = if form.set == Set::Avx512 || !form.packed { slots().map(spread).collect() } else { Vec::new() };
    registers(form).into_iter().map(Source::Register).chain(slots()).chain(spreads).collect()
}

fn assembled(form: Form, fill: impl FnOnce(&mut Assembler)) -> Vec<u8> {
    let mut code = Assembler::new(form);
    fill(&mut code);
    code.finish()
}

fn decoded(code: &[u8]) -> Vec<Instruction> {
    Decoder::new(64, code, DecoderOptions::NONE).into_iter().collect()
}

/// An instruction as text: `vaddpd zmm0,zmm1,[rdi+64]:64`. The word `to` marks a broadcast number.
fn text(instruction: &Instruction) -> String {
    let operand = |i| match instruction.op_kind(i) {
        OpKind::Register => format!("{:?}", instruction.op_register(i)),
        OpKind::Memory => {
            assert_eq!(instruction.memory_index(), Register::None);
            let (base, offset) = (instruction.memory_base(), instruction.memory_displacement64() as i64);
            let to = if instruction.is_broadcast() { "to" } else { "" };
            format!("[{base:?}{offset:+}]:{}{to}", instruction.memory_size().size())
        }
        OpKind::Immediate8 => format!("{}", instruction.immediate8()),
        OpKind::Immediate32to64 => format!("{}", instruction.immediate32to64()),
        kind => panic!("{kind:?}"),
    };
    let operands: Vec<String> = (0..instruction.op_count()).map(operand).collect();
    let mask = if instruction.op_mask() == Register::None { String::new() } else { format!("{{{:?}}}", instruction.op_mask()) };
    format!("{:?}{mask} {}", instruction.mnemonic(), operands.join(",")).trim_end().to_lowercase()
}

/// Check that the decoder reads the expected instructions, and that the encoder of iced-x86 writes the same bytes.
fn check(form: Form, fill: impl FnOnce(&mut Assembler), expected: &[String]) {
    let code = assembled(form, fill);
    let instructions = decoded(&code);
    assert_eq!(instructions.iter().map(text).collect::<Vec<_>>(), expected, "{form:?} {code:02x?}");
    let mut encoder = Encoder::new(64);
    for mut instruction in instructions {
        // A displacement size of zero or one requests the shortest displacement.
        let none = instruction.memory_displacement64() == 0;
        instruction.set_memory_displ_size(u32::from(instruction.memory_base() != Register::None && !none));
        encoder.encode(&instruction, instruction.ip()).unwrap();
    }
    assert_eq!(encoder.take_buffer(), code, "{form:?} {expected:?}");
}

/// Writes the operands of an instruction as assembler text, for one form of code.
struct Names(Form);

impl Names {
    fn register(&self, register: u8) -> String {
        let packed = match self.0.set {
            Set::Sse2 => "xmm",
            Set::Avx2 => "ymm",
            _ => "zmm",
        };
        format!("{}{register}", if self.0.packed { packed } else { "xmm" })
    }

    fn source(&self, source: Source) -> String {
        let (base, offset, to) = match source {
            Source::Register(register) => return self.register(register),
            Source::Slot(base, offset) => (base, offset, false),
            Source::Spread(base, offset) => (base, offset, self.0.packed),
        };
        let base = if base == Base::Frame { "rdi" } else { "rsi" };
        format!("[{base}{offset:+}]:{}{}", if to { 8 } else { self.0.width() }, if to { "to" } else { "" })
    }

    /// The name of an instruction on numbers, `{v}name{pd|sd}`.
    fn number(&self, name: &str) -> String {
        format!("{}{name}{}", if self.0.set == Set::Sse2 { "" } else { "v" }, if self.0.packed { "pd" } else { "sd" })
    }

    /// The name of an instruction on bits. Legacy code uses the shorter instruction for single precision.
    fn bits(&self, name: &str) -> String {
        if self.0.set == Set::Sse2 { format!("{name}ps") } else { format!("v{name}pd") }
    }

    fn three(&self, name: &str, dst: u8, a: u8, b: Source) -> String {
        let a = if self.0.set == Set::Sse2 { String::new() } else { format!("{},", self.register(a)) };
        format!("{name} {},{a}{}", self.register(dst), self.source(b))
    }

    fn load(&self, dst: u8, from: Source) -> Vec<String> {
        let (to, from) = (self.register(dst), (from, self.source(from)));
        let v = if self.0.set == Set::Sse2 { "" } else { "v" };
        match from {
            (Source::Register(_), from) => vec![format!("{} {to},{from}", self.bits("mova"))],
            (_, from) if !self.0.packed => vec![format!("{v}movsd {to},{from}")],
            (Source::Slot(..), from) => vec![format!("{} {to},{from}", self.bits("mova"))],
            (_, from) if self.0.set == Set::Sse2 => {
                vec![format!("movsd {to},{}", from.replace("to", "")), format!("unpcklpd {to},{to}")]
            }
            (_, from) => vec![format!("vbroadcastsd {to},{}", from.replace("to", ""))],
        }
    }
}

/// Every pair `dst, a` that the form allows for an operation with three operands.
fn pairs(form: Form) -> impl Iterator<Item = (u8, u8)> {
    let all = registers(form).into_iter().flat_map(move |dst| registers(form).into_iter().map(move |a| (dst, a)));
    all.filter(move |(dst, a)| form.set != Set::Sse2 || dst == a)
}

/// Operands `dst, a, b`: all pairs with `b` in a register, and some pairs with `b` in memory.
fn operands(form: Form) -> impl Iterator<Item = (u8, u8, Source)> {
    let few = move |r: u8| r.is_multiple_of(8) || r + 1 == form.registers() as u8;
    let chosen = move |dst, a, b| matches!(b, Source::Register(_)) || few(dst) && few(a);
    let all = pairs(form).flat_map(move |(dst, a)| sources(form).into_iter().map(move |b| (dst, a, b)));
    all.filter(move |&(dst, a, b)| chosen(dst, a, b))
}

#[test]
fn encodes_binary() {
    for form in forms() {
        let names = Names(form);
        for op in BINARIES {
            let name = format!("{op:?}").to_lowercase().replace("andnot", "andn");
            for (dst, a, b) in operands(form) {
                let memory = !matches!(b, Source::Register(_));
                let expected = if !op.is_logic() {
                    vec![names.three(&names.number(&name), dst, a, b)]
                } else if form.packed || !memory {
                    vec![names.three(&names.bits(&name), dst, a, b)]
                } else if form.set == Set::Sse2 || dst != a {
                    let by = if form.set == Set::Sse2 { 15 } else { dst };
                    [names.load(by, b), vec![names.three(&names.bits(&name), dst, a, Source::Register(by))]].concat()
                } else {
                    continue;
                };
                check(form, |code| code.binary(op, dst, a, b), &expected);
            }
        }
    }
}

#[test]
fn encodes_fused() {
    for form in forms().filter(|form| form.set != Set::Sse2) {
        let names = Names(form);
        for product in PRODUCTS {
            let name = ["fmadd", "fmsub", "fnmadd", "fnmsub"][product as usize];
            for order in ORDERS {
                let name = names.number(&format!("{name}{}", &format!("{order:?}")[1..]));
                for (dst, a, b) in operands(form) {
                    check(form, |code| code.fused(product, order, dst, a, b), &[names.three(&name, dst, a, b)]);
                }
            }
        }
    }
}

#[test]
fn encodes_sqrt_load_store() {
    for form in forms() {
        let names = Names(form);
        for dst in registers(form) {
            for a in sources(form) {
                let second = if let Source::Register(a) = a { a } else { dst };
                let name = names.number("sqrt");
                let packed = form.packed || form.set == Set::Sse2;
                let root = format!("{name} {},{}", names.register(dst), names.source(a));
                let root = if packed { root } else { names.three(&name, dst, second, a) };
                check(form, |code| code.sqrt(dst, a), &[root]);
            }
            for from in sources(form).into_iter().chain(slots().map(spread)) {
                check(form, |code| code.load(dst, from), &names.load(dst, from));
            }
            for slot in slots() {
                let Source::Slot(base, offset) = slot else { unreachable!() };
                let name = if form.packed { names.bits("mova") } else { names.number("mov") };
                let expected = format!("{name} {},{}", names.source(slot), names.register(dst));
                check(form, |code| code.store(base, offset, dst), &[expected]);
            }
        }
    }
}

#[test]
fn encodes_less() {
    for form in forms() {
        let names = Names(form);
        for (dst, a, b) in operands(form) {
            let high = [dst, a, if let Source::Register(b) = b { b } else { 0 }].iter().any(|&r| r >= 16);
            let three = names.three(&names.number("cmp"), dst, a, b);
            let expected = if form.set == Set::Sse2 {
                vec![format!("{three},1")]
            } else if form.set == Set::Avx2 || !form.packed && !high {
                vec![format!("{three},17")]
            } else {
                let three = three.replacen(&format!(" {},", names.register(dst)), " k1,", 1);
                vec![format!("{three},17"), format!("vpmovm2q {},k1", names.register(dst))]
            };
            check(form, |code| code.less(dst, a, b), &expected);
        }
    }
}

#[test]
fn encodes_select() {
    for form in forms().filter(|form| form.set != Set::Sse2) {
        let names = Names(form);
        let all = registers(form);
        for (dst, mask) in pairs(form) {
            for &yes in &all {
                for &no in &all {
                    let high = [dst, mask, yes, no].iter().any(|&r| r >= 16);
                    let [d, m, y, n] = [dst, mask, yes, no].map(|r| names.register(r));
                    let expected = if form.set == Set::Avx2 || !form.packed && !high {
                        vec![format!("vblendvpd {d},{n},{y},{m}")]
                    } else {
                        vec![format!("vpmovq2m k1,{m}"), format!("vblendmpd{{k1}} {d},{n},{y}")]
                    };
                    check(form, |code| code.select(dst, mask, yes, no), &expected);
                }
            }
        }
    }
}

#[test]
fn encodes_masks_and_shifts() {
    for form in forms() {
        let names = Names(form);
        for &dst in &registers(form) {
            for &a in &registers(form) {
                let (d, s) = (names.register(dst), names.register(a));
                if form.set == Set::Sse2 {
                    check(form, |code| code.sign_mask(dst, a), &[format!("pshufd {d},{s},245"), format!("psrad {d},31")]);
                } else {
                    let expected = if dst == a { Vec::new() } else { names.load(dst, Source::Register(a)) };
                    check(form, |code| code.sign_mask(dst, a), &expected);
                }
                for bits in [1, 52, 63] {
                    let expected = if form.set != Set::Sse2 {
                        format!("vpsllq {d},{s},{bits}")
                    } else if dst == a {
                        format!("psllq {d},{bits}")
                    } else {
                        continue;
                    };
                    check(form, |code| code.shift_left(dst, a, bits), &[expected]);
                }
            }
        }
    }
}

#[test]
fn saves_registers_for_win64() {
    for form in forms() {
        let name = if form.set == Set::Sse2 { "movaps" } else { "vmovapd" };
        let start = ["push rdi", "push rsi", "mov rdi,rcx", "mov rsi,rdx", "mov rdx,r8", "mov rcx,r9", "sub rsp,168"].map(String::from);
        let end = ["add rsp,168", "pop rsi", "pop rdi"].map(String::from);
        let stores = (0..10).map(|i| format!("{name} [rsp{:+}]:16,xmm{}", 16 * i, 6 + i));
        let loads = (0..10).map(|i| format!("{name} xmm{},[rsp{:+}]:16", 6 + i, 16 * i));
        let text = |code: Vec<u8>| decoded(&code).iter().map(text).collect::<Vec<_>>();
        assert_eq!(text(assembled(form, |code| code.enter(CallingConvention::Win64))), start.into_iter().chain(stores).collect::<Vec<_>>());
        assert_eq!(text(assembled(form, |code| code.leave(CallingConvention::Win64))), loads.chain(end).collect::<Vec<_>>());
        assert!(assembled(form, |code| (code.enter(CallingConvention::SystemV), code.leave(CallingConvention::SystemV)).0).is_empty());
        let wide = form.packed && form.set != Set::Sse2;
        assert_eq!(text(assembled(form, Assemble::ret)), if wide { vec!["vzeroupper", "ret"] } else { vec!["ret"] });
    }
}

/// Scalar AVX-512 code uses VEX if it is at most as long as EVEX.
#[test]
fn takes_the_shorter_encoding() {
    let form = Form { set: Set::Avx512, packed: false };
    let lengths = |offset| {
        let source = Source::Slot(Base::Frame, offset);
        [|c: &mut Assembler, b| c.binary(Binary::Add, 1, 2, b), |c: &mut Assembler, b| c.fused(Product::Add, Order::P231, 1, 2, b)]
            .map(|fill: fn(&mut Assembler, Source)| assembled(form, |code| fill(code, source)).len())
    };
    // VEX: a prefix of 2 or 3 bytes, an opcode, a ModRM byte, and a displacement of 0, 1 or 4 bytes. EVEX: a prefix of 4 bytes.
    assert_eq!(lengths(0), [4, 5]);
    assert_eq!(lengths(120), [5, 6]);
    assert_eq!(lengths(128), [7, 7]);
    assert_eq!(lengths(1024), [8, 9]);
    assert_eq!(lengths(129), [8, 9]);
}
