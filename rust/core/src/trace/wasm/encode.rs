//! The encoding of WebAssembly: integers in LEB128, names, sections, and the opcodes that programs use (WebAssembly Core Specification,
//! chapter 5).

pub const IF: u8 = 0x04;
pub const END: u8 = 0x0b;
pub const CALL: u8 = 0x10;
pub const SELECT: u8 = 0x1b;
pub const LOCAL_GET: u8 = 0x20;
pub const LOCAL_SET: u8 = 0x21;
pub const I64_LOAD: u8 = 0x29;
pub const F64_LOAD: u8 = 0x2b;
pub const F64_STORE: u8 = 0x39;
pub const I32_CONST: u8 = 0x41;
pub const I64_CONST: u8 = 0x42;
pub const F64_CONST: u8 = 0x44;
pub const I64_LESS: u8 = 0x53;
pub const F64_NOT_EQUAL: u8 = 0x62;
pub const F64_LESS: u8 = 0x63;
pub const I64_AND: u8 = 0x83;
pub const I64_XOR: u8 = 0x85;
pub const I64_SHIFT_LEFT: u8 = 0x86;
pub const I64_SHIFT_RIGHT: u8 = 0x87;
pub const F64_ABS: u8 = 0x99;
pub const F64_NEG: u8 = 0x9a;
pub const F64_SQRT: u8 = 0x9f;
pub const F64_ADD: u8 = 0xa0;
pub const F64_SUB: u8 = 0xa1;
pub const F64_MUL: u8 = 0xa2;
pub const F64_DIV: u8 = 0xa3;
pub const I64_FROM_I32: u8 = 0xad;
pub const I64_FROM_BITS: u8 = 0xbd;
pub const F64_FROM_BITS: u8 = 0xbf;

/// The type of a block without results.
pub const EMPTY: u8 = 0x40;

/// Append an unsigned integer.
pub fn unsigned(bytes: &mut Vec<u8>, mut x: u64) {
    while x >= 0x80 {
        bytes.push(x as u8 | 0x80);
        x >>= 7;
    }
    bytes.push(x as u8);
}

/// Append a signed integer.
pub fn signed(bytes: &mut Vec<u8>, mut x: i64) {
    while !(-0x40..0x40).contains(&x) {
        bytes.push(x as u8 | 0x80);
        x >>= 7;
    }
    bytes.push(x as u8 & 0x7f);
}

/// Append a load or a store of slot `slot`. The address before it is zero.
pub fn access(bytes: &mut Vec<u8>, opcode: u8, slot: usize) {
    // The alignment is 2^3 bytes.
    bytes.extend([opcode, 3]);
    unsigned(bytes, 8 * slot as u64);
}

/// Append a name.
pub fn name(bytes: &mut Vec<u8>, name: &str) {
    unsigned(bytes, name.len() as u64);
    bytes.extend_from_slice(name.as_bytes());
}

/// Append section number `id`.
pub fn section(bytes: &mut Vec<u8>, id: u8, content: &[u8]) {
    bytes.push(id);
    unsigned(bytes, content.len() as u64);
    bytes.extend_from_slice(content);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_have_seven_bits_per_byte() {
        let of = |encode: &dyn Fn(&mut Vec<u8>)| {
            let mut bytes = Vec::new();
            encode(&mut bytes);
            bytes
        };
        for (x, bytes) in [(0, vec![0]), (127, vec![0x7f]), (128, vec![0x80, 1]), (624_485, vec![0xe5, 0x8e, 0x26])] {
            assert_eq!(of(&|to| unsigned(to, x)), bytes);
        }
        for (x, bytes) in
            [(0, vec![0]), (63, vec![0x3f]), (64, vec![0xc0, 0]), (-1, vec![0x7f]), (-64, vec![0x40]), (-65, vec![0xbf, 0x7f])]
        {
            assert_eq!(of(&|to| signed(to, x)), bytes);
        }
        assert_eq!(of(&|to| signed(to, i64::MIN)).len(), 10);
        assert_eq!(of(&|to| access(to, F64_LOAD, 16)), [0x2b, 3, 0x80, 1]);
    }
}
