//! The sine and cosine of `scalar::trig` as C code, with the same operations in the same order.

use crate::scalar::hex::hex;
use crate::scalar::trig::{COS, PIO2, ROUND, SIN, TWO_OVER_PI};

/// Return the expression `a b + c`.
pub fn multiply_add(fused: bool, a: &str, b: &str, c: &str) -> String {
    if fused { format!("fma({a}, {b}, {c})") } else { format!("{a} * {b} + {c}") }
}

/// Return the function `name`: sine and cosine of an angle whose magnitude is below `REDUCTION_LIMIT`. `fused`: whether it calls `fma`.
pub fn sin_cos(name: &str, fused: bool) -> String {
    let fma = |a: &str, b: &str, c: &str| multiply_add(fused, a, b, c);
    let fnma = |a: &str, b: &str, c: &str| if fused { format!("fma(-{a}, {b}, {c})") } else { format!("{c} - {a} * {b}") };
    let number = |x: f64| if x < 0.0 { format!("({})", hex(x)) } else { hex(x) };
    let mut lines = vec![format!("const double rounded = {};", fma("x", &number(TWO_OVER_PI), &number(ROUND)))];
    lines.push(format!("const double turns = rounded - {};", number(ROUND)));
    for (k, part) in PIO2.into_iter().enumerate() {
        let before = if k == 0 { "x".into() } else { format!("r{k}") };
        lines.push(format!("const double r{} = {};", k + 1, fnma("turns", &number(part), &before)));
    }
    lines.push("const double z = r3 * r3;".into());
    lines.push("const double zz = z * z;".into());
    for (letter, a) in [("s", SIN), ("c", COS)] {
        for k in [0, 2, 4] {
            lines.push(format!("const double {letter}{k} = {};", fma(&number(a[k]), "z", &number(a[k + 1]))));
        }
        lines.push(format!("const double {letter}6 = {};", fma(&format!("{letter}0"), "zz", &format!("{letter}2"))));
        lines.push(format!("const double {letter}7 = {};", fma(&format!("{letter}6"), "zz", &format!("{letter}4"))));
    }
    lines.push("const double rz = r3 * z;".into());
    lines.push(format!("const double sine = {};", fma("rz", "s7", "r3")));
    lines.push(format!("const double near_one = {};", fma(&number(-0.5), "z", "1.0")));
    lines.push(format!("const double cosine = {};", fma("zz", "c7", "near_one")));
    // Bit 0 of the quadrant exchanges sine and cosine. Bit 1 changes the sign of the sine. Bit 0 xor bit 1 changes the sign of the cosine.
    let bits = "    unsigned long long quadrant, s, c, swap, up, down;
    memcpy(&quadrant, &rounded, sizeof quadrant);
    memcpy(&s, &sine, sizeof s);
    memcpy(&c, &cosine, sizeof c);
    swap = 0ULL - (quadrant & 1ULL);
    up = ((s & ~swap) | (c & swap)) ^ ((quadrant & 2ULL) << 62);
    down = ((c & ~swap) | (s & swap)) ^ (((quadrant + 1ULL) & 2ULL) << 62);
    memcpy(sin_x, &up, sizeof up);
    memcpy(cos_x, &down, sizeof down);
";
    let lines: String = lines.into_iter().map(|line| format!("    {line}\n")).collect();
    format!("static void {name}(double x, double *sin_x, double *cos_x)\n{{\n{lines}{bits}}}\n\n")
}
