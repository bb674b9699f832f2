//! Tests that no method allocates after its construction: in steps, dense output and events.

use crate::counting::counted;
use crate::integrate_support::*;
use armlet_core::integrate::events::{Event, Watch};
use armlet_core::integrate::*;

#[test]
fn adaptive_steps_do_not_allocate() {
    for (name, _) in ADAPTIVE {
        let mut system = twin::<Oscillator>();
        let mut method = adaptive::<Oscillator>(name, 1e-6, 1e-8);
        let mut watch = Watch::new(vec![Event::default()], Oscillator::start());
        let mut out = Oscillator::start();
        let mut g = |_: usize, _: f64, x: &[f64]| x[0];
        method.begin(&mut system, 0.0, 1.0, 1.0).unwrap();
        watch.begin(&mut g, 0.0, method.x()).unwrap();
        let (found, count) = counted(|| {
            let mut found = 0;
            for segment in 0..3 {
                if segment > 0 {
                    let t = 1.0 + 20.0 * (segment - 1) as f64;
                    method.begin(&mut system, t, t + 20.0, t + 20.0).unwrap();
                }
                loop {
                    let done = method.step(&mut system).unwrap();
                    watch.scan(&mut system, &mut *method, &mut g).unwrap();
                    found += watch.crossings.len();
                    let middle = 0.5 * (method.t() + method.t_old());
                    method.interpolate(&mut system, middle, &mut out);
                    if done {
                        break;
                    }
                }
            }
            found
        });
        assert_eq!(count, 0, "{name}");
        assert_eq!(found, 13, "{name}");
        assert!(method.work().steps > 20);
    }
}

#[test]
fn fixed_steps_do_not_allocate() {
    for name in ["euler", "semi_implicit", "rk4", "ros2"] {
        let (mut system, mut method, mut x) = (twin::<Oscillator>(), fixed::<Oscillator>(name), Oscillator::start());
        let ((), count) = counted(|| {
            for k in 0..100 {
                method.step(&mut system, k as f64 * 0.01, 0.01, (k + 1) as f64 * 0.01, &mut x);
            }
        });
        assert_eq!(count, 0, "{name}");
    }
}
