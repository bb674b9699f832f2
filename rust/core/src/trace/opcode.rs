//! The opcodes of x86-64 instructions, for the legacy, VEX and EVEX encodings.

/// The mandatory prefix byte of an opcode: none, 66, F3 or F2. VEX and EVEX contain its index.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Prefix {
    None,
    P66,
    F3,
    F2,
}

/// The opcode map: 0F, 0F 38 or 0F 3A.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Map {
    M0F = 1,
    M0F38 = 2,
    M0F3A = 3,
}

/// An opcode with its encoding options.
#[derive(Clone, Copy)]
pub struct Opcode {
    pub prefix: Prefix,
    pub map: Map,
    pub byte: u8,
    /// The W bit in VEX. In EVEX this bit is always one, because elements have 64 bits.
    pub wide: bool,
    /// The condition for EVEX: `Some(true)` means always, `Some(false)` means never, and `None` means if EVEX is required or shorter.
    pub evex: Option<bool>,
    /// Whether mask register k1 selects the lanes.
    pub blend: bool,
    /// Whether the instruction always broadcasts one number to all lanes.
    pub broadcast: bool,
    /// The immediate byte after the displacement.
    pub immediate: Option<u8>,
}

/// The operand in the `rm` field.
#[derive(Clone, Copy)]
pub enum Operand {
    Register(u8),
    /// A memory operand: base register, displacement in bytes, and whether one number is broadcast to all lanes.
    Memory(u8, i32, bool),
}

pub const fn opcode(prefix: Prefix, map: Map, byte: u8) -> Opcode {
    Opcode { prefix, map, byte, wide: false, evex: None, blend: false, broadcast: false, immediate: None }
}

impl Opcode {
    pub fn with(self, immediate: u8) -> Self {
        Opcode { immediate: Some(immediate), ..self }
    }

    /// An opcode of map 0F38 that exists only in AVX-512.
    pub const fn masked(prefix: Prefix, byte: u8) -> Self {
        Opcode { evex: Some(true), ..opcode(prefix, Map::M0F38, byte) }
    }
}
