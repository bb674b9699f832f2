//! Residuals of balances over recorded runs. They detect runs that are wrong although all numbers are finite.
//!
//! The balance `E(t) - E(0) - int P dt = 0` is exact for the differential equation of every loop, where `E` is the energy and `P` the
//! supplied power. So its residual is the error of the integration method.
//!
//! The balance `V1(0) - V1(t) - int D dt = 0` of the Lyapunov function `V1` is exact for a continuous adaptive law whose model has the
//! structure of the plant. `D = s'Kd s` without the options of the law that change `dV1/dt`, and otherwise includes their terms. Here `s`
//! is the sliding variable, `Kd` its gain and `'` the transpose. A projection makes the balance positive, so its residual is then not an
//! error. With a sample time, or with effects of the plant that the model does not have, the residual also contains their contributions.

/// The names of the residuals, in the order of `Run::balances`.
pub const NAMES: [&str; 4] = ["energy_error", "energy_missing", "lyapunov_rise", "lyapunov_error"];

/// Return four residuals, in the order of [`NAMES`]:
///
/// - the largest absolute `energy_balance`, divided by the largest energy stored or exchanged
/// - the largest absolute `energy_balance`, J
/// - the largest Lyapunov function, divided by its first value, or zero if this value is zero
/// - the largest absolute Lyapunov balance, divided by the largest Lyapunov function
///
/// `series(name)` returns the values of a monitor, one value per record. A residual is NaN if the result is `None` for its monitor.
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
        // If the Lyapunov function starts at zero, the ratio to its first value is not defined.
        found[2] = if *first > 0.0 { most / first } else { 0.0 };
        found[3] = largest(balance.len(), |i| balance[i].abs()) / most;
    }
    found
}

/// Return the largest of `count` numbers, at least zero. NaN is ignored.
#[inline(always)]
fn largest(count: usize, number: impl Fn(usize) -> f64) -> f64 {
    // Eight independent maxima are faster than one chain of comparisons.
    let mut most = [0.0f64; 8];
    let in_blocks = count / 8 * 8;
    let increase = |most: &mut f64, x: f64| *most = if *most < x { x } else { *most };
    for i in (0..in_blocks).step_by(8) {
        most.iter_mut().enumerate().for_each(|(k, most)| increase(most, number(i + k)));
    }
    (in_blocks..count).for_each(|i| increase(&mut most[i - in_blocks], number(i)));
    most.into_iter().fold(0.0, f64::max)
}
