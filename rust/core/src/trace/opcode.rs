//! The identification of an instruction of x86-64, in legacy encoding, VEX and EVEX.

/// The prefix of an opcode in legacy code: none, 66, F3, F2. VEX and EVEX contain its index.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Prefix {
    None,
    P66,
    F3,
    F2,
}

/// The table of the opcode.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Map {
    M0F = 1,
    M0F38 = 2,
    M0F3A = 3,
}

#[derive(Clone, Copy)]
pub struct Opcode {
    pub prefix: Prefix,
    pub map: Map,
    pub byte: u8,
    /// The W bit in VEX. In EVEX it is always one, because elements have 64 bits.
    pub wide: bool,
    /// EVEX: required (true), impossible (false), or used if it is needed or shorter.
    pub evex: Option<bool>,
    /// Whether the mask register k1 selects lanes.
    pub blend: bool,
    /// Whether the instruction always reads one number for all lanes.
    pub broadcast: bool,
    /// A byte after the displacement.
    pub immediate: Option<u8>,
}

/// The operand in `rm`.
#[derive(Clone, Copy)]
pub enum Operand {
    Register(u8),
    /// Base register, displacement, and whether one number is read for all lanes.
    Memory(u8, i32, bool),
}

pub const fn opcode(prefix: Prefix, map: Map, byte: u8) -> Opcode {
    Opcode { prefix, map, byte, wide: false, evex: None, blend: false, broadcast: false, immediate: None }
}

impl Opcode {
    pub fn with(self, immediate: u8) -> Self {
        Opcode { immediate: Some(immediate), ..self }
    }

    /// An instruction that only AVX-512 has, in the table 0F38.
    pub const fn masked(prefix: Prefix, byte: u8) -> Self {
        Opcode { evex: Some(true), ..opcode(prefix, Map::M0F38, byte) }
    }
}
