//! Tests of a sampled controller's measurements: the moments of the noise, and the resolution of encoders.

use armlet_core::simulate::Sampling;

#[test]
fn noise_has_its_moments_and_no_memory() {
    let mut sampling = Sampling::every(1e-3);
    sampling.noise[3] = 1.0;
    let n = 200_000;
    let draws: Vec<f64> = (0..n).map(|k| sampling.measure(7, k, 3, 0, 0.0)).collect();
    let mean = draws.iter().sum::<f64>() / n as f64;
    let second = draws.iter().map(|x| x * x).sum::<f64>() / n as f64;
    let lag = draws.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / n as f64;
    // The tolerances are five standard errors: 1/sqrt(n) for the mean and the correlation at lag one, and sqrt(2/n) for the variance.
    let error = 5.0 / (n as f64).sqrt();
    assert!(mean.abs() < error && lag.abs() < error && (second - 1.0).abs() < 1.5 * error, "{mean} {second} {lag}");
    assert_ne!(sampling.measure(7, 1, 3, 0, 0.0), sampling.measure(8, 1, 3, 0, 0.0));
    assert_ne!(sampling.measure(7, 1, 3, 0, 0.0), sampling.measure(7, 1, 3, 1, 0.0));
}

#[test]
fn resolution_rounds_to_steps() {
    let mut sampling = Sampling::every(1e-3);
    assert!(sampling.is_plain());
    sampling.resolution[0] = 0.1;
    assert!(!sampling.is_plain());
    assert!((sampling.measure(0, 0, 0, 0, 0.234) - 0.2).abs() < 1e-16);
    assert_eq!(sampling.measure(0, 0, 1, 0, 0.234), 0.234);
    sampling.jitter = 1e-3;
    assert!(sampling.validate().is_err());
}
