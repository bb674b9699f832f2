//! The files of an export to C: a header, a source file with the routines, and a CMake file.

use super::comment::comment;
use super::routine::{Printed, Routine};
use super::sines::{multiply_add, sin_cos};
use crate::error::{Error, Result};
use crate::scalar::hex::hex;
use std::collections::HashSet;
use std::fmt::Write;

/// The maximum length of the prefix, in characters.
const LONGEST_PREFIX: usize = 40;

/// Words that are not allowed as a prefix: reserved words of C and C++, and the names of included headers.
const RESERVED_WORDS: &str = concat!(
    " auto break case char const continue default do double else enum extern float for goto if inline ",
    "int long register restrict return short signed sizeof static struct switch typedef union unsigned void volatile while ",
    "bool class delete new private public this throw try catch template namespace operator using virtual true false ",
    "asm math string ",
);

/// Target names that CMake reserves, and the library that the target links.
const RESERVED_TARGETS: &str = " all ALL_BUILD help install INSTALL preinstall clean edit_cache rebuild_cache list_install_components depend ZERO_CHECK test RUN_TESTS \
package PACKAGE package_source m ";

/// A file of an export.
#[derive(Clone, Debug, PartialEq)]
pub struct CFile {
    /// The name of the file in its folder.
    pub name: String,
    /// The content of the file.
    pub text: String,
}

/// Options of the C code.
#[derive(Clone, Debug, PartialEq)]
pub struct COptions {
    /// The prefix of all names and files.
    pub prefix: String,
    /// Whether the code calls `fma` for multiply-add operations. If false, each product is rounded before it is added.
    pub fused: bool,
}

impl COptions {
    /// Return options with this prefix. `fused` is true if this processor fuses multiply-add operations.
    pub fn new(prefix: impl Into<String>) -> Self {
        COptions { prefix: prefix.into(), fused: crate::scalar::fuses() }
    }

    /// Check the prefix. Errors: `Input` if it is too long, not an identifier of C, reserved, or not allowed as the name of a CMake target.
    pub fn validate(&self) -> Result<()> {
        let prefix = self.prefix.as_str();
        if is_identifier(prefix) && prefix.len() <= LONGEST_PREFIX && !RESERVED_WORDS.contains(&format!(" {prefix} ")) {
            if RESERVED_TARGETS.contains(&format!(" {prefix} ")) {
                let expected = "a name that is neither a target that CMake makes nor the library m";
                return Err(Error::input("prefix", format!("is no name for a target of CMake: expected {expected}, got {prefix:?}")));
            }
            return Ok(());
        }
        let expected = format!("a letter, then letters, digits and _, at most {LONGEST_PREFIX}, no word of C");
        Err(Error::input("prefix", format!("is no name in C: expected {expected}, got {prefix:?}")))
    }
}

/// Number of values on a line of an array.
const NUMBERS_PER_LINE: usize = 6;

/// Print a constant array of hexadecimal numbers.
pub fn array(name: &str, values: &[f64]) -> String {
    let lines: Vec<String> =
        values.chunks(NUMBERS_PER_LINE).map(|row| row.iter().map(|&x| hex(x)).collect::<Vec<_>>().join(", ")).collect();
    format!("    static const double {name}[{}] = {{\n        {}\n    }};\n", values.len(), lines.join(",\n        "))
}

/// Names of functions that a source file defines for internal use. In the file, the prefix and `_` precede each name. The functions of the
/// caller must have other names.
const OWN_NAMES: [&str; 4] = ["finite", "refuse", "answer", "sin_cos"];

/// Whether the name consists of a letter, followed by letters, digits and `_`.
fn is_identifier(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// Check names of functions. Errors: `Input` if a name is not an identifier of C, is repeated, or is one of `OWN_NAMES`. Also
/// `Input` if a name is another name with `_` and a number, because the parts of a long function have such names.
pub fn require_names<'a>(argument: &str, names: impl Iterator<Item = &'a str>) -> Result<()> {
    let names: Vec<&str> = names.collect();
    let mut earlier = HashSet::new();
    for (i, &name) in names.iter().enumerate() {
        let refused = |problem: &str| Err(Error::input(format!("{argument}[{i}].name"), format!("{problem}, got {name:?}")));
        if !is_identifier(name) {
            return refused("is no name in C: expected a letter, then letters, digits and _");
        }
        if OWN_NAMES.contains(&name) {
            return refused("is a name that the file has for itself: expected another one");
        }
        let whole = name.trim_end_matches(|c: char| c.is_ascii_digit()).strip_suffix('_').filter(|whole| names.contains(whole));
        if whole.is_some() || !earlier.insert(name) {
            return refused("is a name that is there already: expected another one");
        }
    }
    Ok(())
}

/// The statuses in every header: name, code, meaning.
pub const STATUSES: [(&str, u32, &str); 6] = [
    ("OK", 0, "the answer is right"),
    ("NOT_FINITE", 1, "an argument is infinite or not a number"),
    ("ANGLE", 2, "an angle has a magnitude of 1e6 rad or more"),
    (
        "UNDECIDED",
        3,
        "the tasks are close to a singularity, where ranks have to be decided, or a search for active bounds reached its limit",
    ),
    ("RESULT", 4, "a number of the answer is infinite or not a number"),
    ("TIME", 5, "the time is before that of the last call"),
];

/// A header and a source file during their construction.
pub struct CSource {
    options: COptions,
    upper: String,
    declarations: String,
    body: String,
    statements: usize,
}

impl CSource {
    /// Start with empty files. Errors: as for [`COptions::validate`].
    pub fn new(options: &COptions) -> Result<Self> {
        options.validate()?;
        let upper = options.prefix.to_ascii_uppercase();
        Ok(CSource { options: options.clone(), upper, declarations: String::new(), body: String::new(), statements: 0 })
    }

    /// The prefix of all names.
    pub fn prefix(&self) -> &str {
        &self.options.prefix
    }

    /// The prefix of constants.
    pub fn upper(&self) -> &str {
        &self.upper
    }

    /// Whether multiply-add operations are fused.
    pub fn fused(&self) -> bool {
        self.options.fused
    }

    /// Return the expression `a b + c`.
    pub fn multiply_add(&self, a: &str, b: &str, c: &str) -> String {
        multiply_add(self.options.fused, a, b, c)
    }

    /// Add a constant to the header.
    pub fn define(&mut self, name: &str, value: impl std::fmt::Display, comment: &str) {
        let upper = &self.upper;
        self.declare(&format!(
            "#define {upper}_{name} {value}{}\n",
            if comment.is_empty() { String::new() } else { format!(" /* {comment} */") }
        ));
    }

    /// Add text to the header.
    pub fn declare(&mut self, text: &str) {
        self.declarations += text;
    }

    /// Add text to the source file.
    pub fn write(&mut self, text: &str) {
        self.body += text;
    }

    /// Add the functions of a routine. Return the lines of code that call them, and the size of the array `w`.
    pub fn routine(&mut self, routine: &Routine, name: &str) -> (String, usize) {
        let prefix = self.options.prefix.clone();
        self.routine_with_sines(routine, name, &prefix)
    }

    /// Add the functions of a routine as in [`CSource::routine`]. The function for sines and cosines has the name `sines` and `_sin_cos`.
    pub fn routine_with_sines(&mut self, routine: &Routine, name: &str, sines: &str) -> (String, usize) {
        let Printed { functions, calls, slots, statements } = routine.print(&format!("{}_{name}", self.options.prefix), sines);
        self.body += &functions;
        self.statements += statements;
        (calls.into_iter().map(|call| format!("    sound &= {call};\n")).collect(), slots)
    }

    /// Return the files. The first comment of the header contains the text `about`.
    pub fn files(self, about: &str) -> Vec<CFile> {
        let CSource { options, upper, declarations, body, statements } = self;
        let COptions { prefix, fused } = options;
        let version = env!("CARGO_PKG_VERSION");
        let stamp = format!("Made by armlet {version}");
        let about = about.lines().map(comment).collect::<Vec<_>>().join("\n");
        let rounding = if fused {
            "Only fma() fuses a product with a sum: compile with -ffp-contract=off, on x86-64 also with -mfma."
        } else {
            "Every product is rounded before it is added: compile with -ffp-contract=off."
        };
        let mut statuses = String::new();
        for (name, code, meaning) in STATUSES {
            // Writing to a string does not fail.
            let _ = writeln!(statuses, "    {upper}_{name} = {code}{} /* {meaning} */", if code == 5 { "" } else { "," });
        }
        let header = format!(
            "/* {stamp}: do not edit.\n\n{about}\n\n{rounding}\nMatrices are row-major. Arguments must not overlap. */\n\
#ifndef {upper}_H\n#define {upper}_H\n\n#ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n#define {upper}_ARMLET_VERSION \"{version}\"\n\n\
/* What functions return. */\nenum {{\n{statuses}}};\n\n{declarations}\n#ifdef __cplusplus\n}}\n#endif\n\n#endif\n"
        );
        let name = format!("{prefix}_sin_cos");
        let shared = if body.contains(&format!("{name}(")) { sin_cos(&name, fused) } else { String::new() };
        let source = format!("/* {stamp}: do not edit. {statements} statements. {rounding} */\n{}{shared}{body}", prologue(&prefix));
        vec![
            CFile { name: format!("{prefix}.h"), text: header },
            CFile { name: format!("{prefix}.c"), text: source.trim_end().to_string() + "\n" },
            CFile { name: "CMakeLists.txt".into(), text: cmake(&stamp, &prefix, fused) },
        ]
    }
}

/// The beginning of a source file: checks that the compiler rounds each operation to double, and the test for finite numbers.
fn prologue(prefix: &str) -> String {
    format!(
        "#include \"{prefix}.h\"\n#include <math.h>\n#include <string.h>\n\n\
#if defined(__FAST_MATH__) || (defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0)\n\
#error \"every operation has to be rounded to double: no -ffast-math, on x86 -mfpmath=sse\"\n#endif\n\
#if defined(__clang__) || !defined(__GNUC__)\n#pragma STDC FP_CONTRACT OFF\n#endif\n\n\
static int {prefix}_finite(const double *x, int count)\n{{\n    int finite = 1, k;\n    for (k = 0; k < count; k++)\n        \
finite &= fabs(x[k]) <= 0x1.fffffffffffffp+1023;\n    return finite;\n}}\n\n"
    )
}

/// Return the CMake file of the library.
fn cmake(stamp: &str, prefix: &str, fused: bool) -> String {
    let upper = prefix.to_ascii_uppercase();
    let fma = format!(
        "if(CMAKE_SYSTEM_PROCESSOR MATCHES \"x86_64|AMD64|amd64\" AND NOT MSVC)\n  # Without it every fma() is a call, with the same result.\n  \
target_compile_options({prefix} PRIVATE -mfma)\nendif()\n"
    );
    format!(
        "# {stamp}: do not edit.\ncmake_minimum_required(VERSION 3.10)\nproject({prefix} C)\n\nadd_library({prefix} {prefix}.c {prefix}.h)\n\
option({upper}_NATIVE \"compile for the processor of this machine alone\" OFF)\n\
set_target_properties({prefix} PROPERTIES C_STANDARD 99 C_STANDARD_REQUIRED ON C_EXTENSIONS OFF POSITION_INDEPENDENT_CODE ON)\n\
target_include_directories({prefix} PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}})\nif(MSVC)\n  target_compile_options({prefix} PRIVATE /fp:precise)\nelse()\n  \
target_compile_options({prefix} PRIVATE -O3 -ffp-contract=off -fno-math-errno)\n  target_link_libraries({prefix} PUBLIC m)\n  if({upper}_NATIVE)\n    target_compile_options({prefix} PRIVATE -march=native)\n  \
endif()\nendif()\n{}",
        if fused { fma } else { String::new() }
    )
}

#[cfg(test)]
mod tests {
    use super::{COptions, require_names};

    #[test]
    fn a_prefix_is_a_name_of_c() {
        for good in ["law", "arm7_left", "L"] {
            assert!(COptions::new(good).validate().is_ok(), "{good}");
        }
        for bad in ["", "7axis", "a-b", "double", "x y", "_x", "é", "test", "install", "m", &"a".repeat(41)] {
            assert!(COptions::new(bad).validate().is_err(), "{bad}");
        }
    }

    #[test]
    fn names_of_functions_are_refused_that_are_none_in_c() {
        let checked_names = |names: &[&str]| require_names("functions", names.iter().copied()).map_err(|error| error.to_string());
        assert_eq!(checked_names(&["gravity", "M2", "gravity_1x"]), Ok(()));
        for bad in ["", "2m", "a-b", "a b", "x(void); int y", "é", "a\n", "_a"] {
            let expected = format!("functions[1].name is no name in C: expected a letter, then letters, digits and _, got {bad:?}");
            assert_eq!(checked_names(&["gravity", bad]), Err(expected));
        }
        for (first, second) in [("gravity", "gravity"), ("gravity", "gravity_1"), ("gravity", "gravity_23")] {
            let expected = format!("functions[1].name is a name that is there already: expected another one, got {second:?}");
            assert_eq!(checked_names(&[first, second]), Err(expected));
        }
        // `gravity_1` may be the name of a part of `gravity`, also of a later one.
        let expected = "functions[0].name is a name that is there already: expected another one, got \"gravity_1\"";
        assert_eq!(checked_names(&["gravity_1", "gravity"]), Err(expected.into()));
        assert!(checked_names(&["answer"]).is_err_and(|text| text.contains("that the file has for itself")));
    }
}
