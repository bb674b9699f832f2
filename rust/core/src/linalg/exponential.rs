//! `exp(A)` by scaling and squaring of a Taylor series (Moler and Van Loan 2003): for the exact map over a sample.

/// `exp(A)` of a row-major `(n, n)` matrix.
pub fn exponential(a: &[f64], n: usize) -> Vec<f64> {
    // With a norm below 1/4 twenty terms leave (1/4)^21 / 21! < 1e-32.
    const TERMS: u32 = 20;
    let norm = (0..n).map(|i| a[i * n..(i + 1) * n].iter().map(|x| x.abs()).sum::<f64>()).fold(0.0, f64::max);
    let halvings = if norm > 0.25 && norm.is_finite() { (norm.log2() + 2.0).ceil() as i32 } else { 0 };
    let scaled: Vec<f64> = a.iter().map(|x| x * 2f64.powi(-halvings)).collect();
    let times =
        |x: &[f64], y: &[f64]| -> Vec<f64> { (0..n * n).map(|at| (0..n).map(|k| x[at / n * n + k] * y[k * n + at % n]).sum()).collect() };
    let mut sum: Vec<f64> = (0..n * n).map(|at| if at / n == at % n { 1.0 } else { 0.0 }).collect();
    let mut term = sum.clone();
    for k in 1..=TERMS {
        term = times(&term, &scaled);
        for (sum, term) in sum.iter_mut().zip(&mut term) {
            *term /= f64::from(k);
            *sum += *term;
        }
    }
    for _ in 0..halvings {
        sum = times(&sum, &sum);
    }
    sum
}

#[cfg(test)]
mod tests {
    #[test]
    fn turns() {
        let angle = 7.0;
        let got = super::exponential(&[0.0, angle, -angle, 0.0], 2);
        let want = [angle.cos(), angle.sin(), -angle.sin(), angle.cos()];
        for (got, want) in got.iter().zip(want) {
            assert!((got - want).abs() < 2e-14, "five squarings double a rounding each");
        }
    }
}
