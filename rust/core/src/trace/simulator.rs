//! An interpreter of the x86-64 instructions that the encoder emits. Its results have the same bits as on a processor.
//!
//! It runs AVX-512 code on processors without AVX-512. It has the calling convention of programs. Register rdi points to the frame (the
//! memory of the program), and rsi to the constants. Register rdx points to the stream (the inputs of a program that repeats). The number
//! of iterations is in rcx. The interpreter accesses no other memory, and panics on any other instruction. The result of an operation on
//! NaN follows Intel's manual, volume 1, section 4.8.3.5: the first operand that is NaN, made quiet.

use super::instruction::Base;
use iced_x86::{Decoder, DecoderOptions, Instruction, Mnemonic, OpKind, Register};

const LANES: usize = 8;
type Lanes = [u64; LANES];

struct SimulatedMachine<'a> {
    registers: [Lanes; 32],
    /// The mask register k1, one bit per lane.
    k1: u8,
    frame: &'a mut [f64],
    constants: &'a [f64],
    /// The part of the stream that the code has not read yet.
    stream: &'a [f64],
    /// The number of remaining iterations.
    turns: usize,
}

/// Run the machine code of a program until it returns.
///
/// # Panics
/// Panics on an instruction that the encoder does not emit, and at the end of code without a return. Also panics on a slot that is not
/// aligned, or that is outside of frame, constants and stream.
pub fn simulate(code: &[u8], frame: &mut [f64], constants: &[f64], stream: &[f64], turns: usize) {
    // At the start, registers have arbitrary contents.
    let registers = std::array::from_fn(|r| [0x7FF4_DEAD_0000_0000 + r as u64; LANES]);
    let mut machine = SimulatedMachine { registers, k1: 0x5A, frame, constants, stream, turns };
    let mut decoder = Decoder::new(64, code, DecoderOptions::NONE);
    while decoder.can_decode() {
        let instruction = decoder.decode();
        match (instruction.mnemonic(), instruction.op_register(0)) {
            (Mnemonic::Ret, _) => return,
            (Mnemonic::Add, Register::RDX) => {
                let bytes = instruction.immediate(1) as usize;
                assert_eq!(bytes % 8, 0);
                machine.stream = &machine.stream[(bytes / 8).min(machine.stream.len())..];
            }
            (Mnemonic::Dec, Register::RCX) => machine.turns -= 1,
            (Mnemonic::Jne, _) if machine.turns == 0 => {}
            (Mnemonic::Jne, _) => {
                let to = instruction.near_branch64();
                decoder.set_position(to as usize).unwrap();
                decoder.set_ip(to);
            }
            _ => machine.run(&instruction),
        }
    }
    panic!("the code does not return");
}

impl SimulatedMachine<'_> {
    fn run(&mut self, i: &Instruction) {
        use Mnemonic::{Add, Mov, Pop, Push, Sub};
        if matches!(i.mnemonic(), Push | Pop | Mov | Add | Sub) || i.memory_base() == Register::RSP {
            // These instructions only save the caller's registers and adjust the stack. In the interpreter, no caller exists.
            return;
        }
        let name = format!("{:?}", i.mnemonic()).to_lowercase();
        if name == "vzeroupper" {
            return self.registers[..16].iter_mut().for_each(|r| r[2..].fill(0));
        }
        let (vex, name) = name.strip_prefix('v').map_or((false, name.as_str()), |name| (true, name));
        let scalar = name.ends_with("sd") && name != "broadcastsd";
        let operands = i.op_count() - u32::from(i.op_kind(i.op_count() - 1) == OpKind::Immediate8);
        let first = i.op_register(0);
        // If the first operand is k1 or memory, the second operand determines the width.
        let wide = if first == Register::None || first == Register::K1 { i.op_register(1) } else { first };
        let lanes = if scalar { 1 } else { wide.size() / 8 };
        if first == Register::None {
            assert!(matches!(name, "movaps" | "movapd" | "movsd"), "{name}");
            return self.store(i, lanes);
        }
        let a = if operands < 2 { [0; LANES] } else { self.read(i, operands - 2, lanes) };
        let b = self.read(i, operands - 1, lanes);
        let stem = name.strip_suffix(if scalar { "sd" } else { "pd" }).unwrap_or(name);
        let value: Lanes = match stem {
            "add" | "sub" | "mul" | "div" | "min" | "max" => zip(a, b, |a, b| arithmetic(stem, a, b)),
            "sqrt" => b.map(|b| chosen(f64::from_bits(b).sqrt(), &[b])),
            "and" | "andps" => zip(a, b, |a, b| a & b),
            "andn" | "andnps" => zip(a, b, |a, b| !a & b),
            "or" | "orps" => zip(a, b, |a, b| a | b),
            "xor" | "xorps" => zip(a, b, |a, b| a ^ b),
            "mova" | "movaps" | "mov" | "broadcastsd" => b,
            "cmp" => {
                assert_eq!(i.immediate8(), if vex { 0x11 } else { 0x01 });
                let less = zip(a, b, |a, b| if f64::from_bits(a) < f64::from_bits(b) { u64::MAX } else { 0 });
                if first == Register::K1 {
                    self.k1 = (0..lanes).map(|lane| ((less[lane] & 1) as u8) << lane).sum();
                    return;
                }
                less
            }
            "pmovm2q" => std::array::from_fn(|lane| if self.k1 >> lane & 1 == 1 { u64::MAX } else { 0 }),
            "pmovq2m" => {
                self.k1 = (0..lanes).map(|lane| ((b[lane] >> 63) as u8) << lane).sum();
                return;
            }
            "blendm" => {
                assert_eq!(i.op_mask(), Register::K1);
                std::array::from_fn(|lane| if self.k1 >> lane & 1 == 1 { b[lane] } else { a[lane] })
            }
            "blendv" => {
                let no = self.read(i, 1, lanes);
                std::array::from_fn(|lane| if b[lane] >> 63 == 1 { a[lane] } else { no[lane] })
            }
            "unpckl" => [a[0], b[0], 0, 0, 0, 0, 0, 0],
            "pshufd" => b.map(|b| quads(b, i.immediate8())),
            "psrad" => {
                let shift = |half: u64| u64::from((half as u32 as i32 >> i.immediate8()) as u32);
                self.read(i, 0, lanes).map(|a| shift(a >> 32) << 32 | shift(a))
            }
            "psllq" => b.map(|b| b << i.immediate8()),
            _ if stem.starts_with('f') => {
                let d = self.read(i, 0, lanes);
                std::array::from_fn(|lane| fused(stem, d[lane], a[lane], b[lane]))
            }
            _ => panic!("{name} is not simulated"),
        };
        self.write(i, first, vex, scalar, lanes, value);
    }

    /// Return the lanes of an operand. Lanes beyond an operand in memory are zero. The mask register k1 returns zeros, because its bits are
    /// in the field `k1`.
    fn read(&self, i: &Instruction, operand: u32, lanes: usize) -> Lanes {
        if i.op_kind(operand) == OpKind::Register && i.op_register(operand) == Register::K1 {
            return [0; LANES];
        }
        if i.op_kind(operand) == OpKind::Register {
            return self.registers[number(i.op_register(operand))];
        }
        let one = i.is_broadcast() || i.mnemonic() == Mnemonic::Vbroadcastsd;
        let (base, at) = place(i, if one { 1 } else { lanes });
        let from: &[f64] = match base {
            Base::Frame => self.frame,
            Base::Constants => self.constants,
            Base::Stream => self.stream,
        };
        if one {
            return [from[at].to_bits(); LANES];
        }
        let from = &from[at..at + lanes];
        std::array::from_fn(|lane| from.get(lane).map_or(0, |x| x.to_bits()))
    }

    fn store(&mut self, i: &Instruction, lanes: usize) {
        let (base, at) = place(i, lanes);
        assert_eq!(base, Base::Frame, "a store elsewhere than to the frame");
        let from = self.registers[number(i.op_register(1))];
        let to = &mut self.frame[at..at + lanes];
        to.iter_mut().zip(from).for_each(|(to, from)| *to = f64::from_bits(from));
    }

    /// Write the result to a register. Legacy code preserves the rest of the register, and AVX code clears the part beyond its width. A
    /// scalar load clears the second number. Other scalar instructions keep it in legacy code, and copy it from their first source operand
    /// in AVX code.
    fn write(&mut self, i: &Instruction, to: Register, vex: bool, scalar: bool, lanes: usize, value: Lanes) {
        let second = self.registers[number(if vex && i.op_count() > 2 { i.op_register(1) } else { to })][1];
        let register = &mut self.registers[number(to)];
        if vex {
            register.fill(0);
        }
        register[..lanes].copy_from_slice(&value[..lanes]);
        if scalar {
            let load = matches!(i.mnemonic(), Mnemonic::Movsd | Mnemonic::Vmovsd);
            register[1] = if load { 0 } else { second };
        }
    }
}

fn number(register: Register) -> usize {
    assert!(register.is_vector_register(), "{register:?}");
    register.number()
}

/// Return the base of an operand in memory, and its index relative to this base.
fn place(i: &Instruction, lanes: usize) -> (Base, usize) {
    let base = match i.memory_base() {
        Register::RDI => Base::Frame,
        Register::RSI => Base::Constants,
        Register::RDX => Base::Stream,
        base => panic!("an address relative to {base:?}"),
    };
    assert_eq!((i.memory_index(), i.memory_size().size()), (Register::None, 8 * lanes), "{:?}", i.mnemonic());
    let offset = i.memory_displacement64() as i64;
    assert!(offset >= 0 && offset % (8 * lanes as i64) == 0, "{:?}: no slot at {offset}", i.mnemonic());
    (base, offset as usize / 8)
}

fn zip(a: Lanes, b: Lanes, f: impl Fn(u64, u64) -> u64) -> Lanes {
    std::array::from_fn(|lane| f(a[lane], b[lane]))
}

/// The bits of a result. If the result is NaN, it is the first operand that is NaN, made quiet. Without such an operand, it is the standard
/// NaN of x86-64, whose sign bit is set.
fn chosen(result: f64, operands: &[u64]) -> u64 {
    const QUIET: u64 = 1 << 51;
    match operands.iter().find(|&&x| f64::from_bits(x).is_nan()) {
        _ if !result.is_nan() => result.to_bits(),
        Some(x) => x | QUIET,
        None => 0xFFF8_0000_0000_0000,
    }
}

fn arithmetic(name: &str, x: u64, y: u64) -> u64 {
    let (a, b) = (f64::from_bits(x), f64::from_bits(y));
    match name {
        "min" => return if a < b { x } else { y },
        "max" => return if a > b { x } else { y },
        _ => {}
    }
    let result = match name {
        "add" => a + b,
        "sub" => a - b,
        "mul" => a * b,
        _ => a / b,
    };
    chosen(result, &[x, y])
}

/// Compute a fused multiply-add. `name`: for example `fnmadd213`. Its digits select the two factors and the addend among the operands.
fn fused(name: &str, d: u64, a: u64, b: u64) -> u64 {
    let digits = &name[name.len() - 3..];
    let [x, y, z] = match digits {
        "132" => [d, b, a],
        "213" => [a, d, b],
        "231" => [a, b, d],
        _ => panic!("{name}"),
    };
    let [fx, fy, fz] = [x, y, z].map(f64::from_bits);
    let result = match &name[..name.len() - 3] {
        "fmadd" => fx.mul_add(fy, fz),
        "fmsub" => fx.mul_add(fy, -fz),
        "fnmadd" => (-fx).mul_add(fy, fz),
        "fnmsub" => (-fx).mul_add(fy, -fz),
        _ => panic!("{name}"),
    };
    chosen(result, &[x, y, z])
}

/// PSHUFD permutes the 32-bit quarters of 128 bits. Here it copies the upper half of each number to its lower half.
fn quads(number: u64, order: u8) -> u64 {
    assert_eq!(order, 0xF5);
    number >> 32 << 32 | number >> 32
}
