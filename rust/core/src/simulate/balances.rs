//! Balances of recorded runs that do not close. They detect wrong runs with finite numbers.
//!
//! `E(t) - E(0) - int P dt = 0` and `V1(0) - V1(t) - int s'Kd s dt = 0` hold for the loop. So their residual is the error of the
//! method.

/// Names of the balances of a run, in the order of `Run::balances`.
pub const NAMES: [&str; 4] = ["energy_error", "energy_missing", "lyapunov_rise", "lyapunov_error"];

/// The largest `energy_balance` as a fraction of the largest energy stored or exchanged, and in J. Then the largest Lyapunov function as a
/// multiple of its first value, and its largest balance as a fraction of it. NaN for monitors that `series(name)` does not have.
pub fn open<'a>(series: impl Fn(&str) -> Option<&'a [f64]>) -> [f64; 4] {
    let mut found = [f64::NAN; 4];
    if let (Some(energy @ [first, ..]), Some(balance)) = (series("energy"), series("energy_balance")) {
        let missing = largest(balance.len(), |i| balance[i].abs());
        let exchanged = largest(energy.len(), |i| (energy[i] - first - balance[i]).abs());
        let most = exchanged.max(largest(energy.len(), |i| energy[i].abs()));
        found[0] = if missing > 0.0 { missing / most } else { missing };
        found[1] = missing;
    }
    if let (Some(value @ [first, ..]), Some(balance)) = (series("lyapunov"), series("lyapunov_balance")) {
        let most = largest(value.len(), |i| value[i]);
        // A function that starts at zero does not rise by a factor.
        found[2] = if *first > 0.0 { most / first } else { 0.0 };
        found[3] = largest(balance.len(), |i| balance[i].abs()) / most;
    }
    found
}

/// The largest of `count` numbers, at least zero, without those that are NaN.
#[inline(always)]
fn largest(count: usize, number: impl Fn(usize) -> f64) -> f64 {
    // Eight independent maxima: a single one would be a chain of dependent operations.
    let mut most = [0.0f64; 8];
    let whole = count / 8 * 8;
    let keep = |most: &mut f64, x: f64| *most = if *most < x { x } else { *most };
    for i in (0..whole).step_by(8) {
        most.iter_mut().enumerate().for_each(|(k, most)| keep(most, number(i + k)));
    }
    (whole..count).for_each(|i| keep(&mut most[i - whole], number(i)));
    most.into_iter().fold(0.0, f64::max)
}
