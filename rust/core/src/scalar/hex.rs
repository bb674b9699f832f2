//! Exact numbers in the notation of C99: `0x1.8p+1` is 3 (ISO 9899:1999, section 6.4.4.2).

/// Return a number as a constant of C with the same value. Numbers other than zero, infinity and NaN are hexadecimal.
pub fn hex(x: f64) -> String {
    let sign = if x.is_sign_negative() && !x.is_nan() { "-" } else { "" };
    if !x.is_finite() {
        return format!("{sign}{}", if x.is_nan() { "NAN" } else { "INFINITY" });
    }
    let bits = x.to_bits();
    let (exponent, fraction) = ((bits >> 52 & 0x7ff) as i64, bits & ((1 << 52) - 1));
    if exponent == 0 && fraction == 0 {
        return format!("{sign}0.0");
    }
    // Subnormal numbers have no leading one.
    let (lead, power) = if exponent == 0 { (0, -1022) } else { (1, exponent - 1023) };
    let digits = format!("{fraction:013x}");
    let digits = digits.trim_end_matches('0');
    let point = if digits.is_empty() { "" } else { "." };
    format!("{sign}0x{lead}{point}{digits}p{power:+}")
}

#[cfg(test)]
mod tests {
    use super::hex;

    #[test]
    fn numbers_are_written_without_rounding() {
        let all = [
            (3.0, "0x1.8p+1"),
            (-0.5, "-0x1p-1"),
            (0.1, "0x1.999999999999ap-4"),
            (0.0, "0.0"),
            (-0.0, "-0.0"),
            (f64::MAX, "0x1.fffffffffffffp+1023"),
            (f64::MIN_POSITIVE, "0x1p-1022"),
            (f64::from_bits(1), "0x0.0000000000001p-1022"),
            (f64::NEG_INFINITY, "-INFINITY"),
            (f64::NAN, "NAN"),
        ];
        for (x, text) in all {
            assert_eq!(hex(x), text);
        }
    }
}
