//! Files for `make test-aarch64`. They contain machine code, and its memory before and after a run. A C program runs this code.

use std::fmt::Write;

/// Write a file to the folder in the environment variable `ARMLET_HARNESS`. If the variable is not set, write nothing.
pub fn write(name: &str, content: &(impl AsRef<[u8]> + ?Sized)) {
    if let Some(folder) = std::env::var_os("ARMLET_HARNESS") {
        std::fs::write(std::path::Path::new(&folder).join(name), content).unwrap();
    }
}

/// Test cases as assembler text: functions in `.text`, numbers in `.data`, and a table `cases` with their addresses.
#[derive(Default)]
pub struct Cases {
    code: String,
    data: String,
    table: String,
    len: usize,
}

impl Cases {
    pub fn len(&self) -> usize {
        self.len
    }

    /// Add a case: a function, its memory, its stream with `turns` iterations, and the expected numbers at the start of its memory
    /// (`frame`). The bits must be equal, except that any NaN equals any other NaN.
    pub fn add(&mut self, code: &[u8], frame: &[f64], constants: &[f64], (stream, turns): (&[f64], usize), expected: &[f64]) {
        assert!(code.len().is_multiple_of(4) && expected.len() <= frame.len());
        let i = self.len;
        self.len += 1;
        writeln!(self.code, "code{i}:").unwrap();
        for word in code.chunks(4) {
            writeln!(self.code, ".word 0x{:08x}", u32::from_le_bytes(word.try_into().unwrap())).unwrap();
        }
        for (name, numbers) in [("frame", frame), ("constants", constants), ("stream", stream), ("expected", expected)] {
            writeln!(self.data, ".balign 64\n{name}{i}:").unwrap();
            for number in numbers {
                writeln!(self.data, ".quad 0x{:x}", number.to_bits()).unwrap();
            }
        }
        writeln!(self.table, ".quad code{i}, frame{i}, constants{i}, stream{i}, {turns}, expected{i}, {}", expected.len()).unwrap();
    }

    pub fn finish(self) -> String {
        let Cases { code, data, table, len } = self;
        format!(".text\n{code}.data\n{data}.global cases, count\n.balign 8\ncases:\n{table}count: .quad {len}\n")
    }
}
