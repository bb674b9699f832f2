//! Tests of motions: derivatives compared with differences, constant ends, and a table that is exact at its knots.

use super::*;
use crate::error::Error;

fn at(m: &Motion, t: f64) -> Vec<f64> {
    let mut out = vec![0.0; 3 * m.dof()];
    m.sample(t, &mut out);
    out
}

fn motions() -> Vec<Motion> {
    let sinusoid = Sinusoid::new(vec![0.1, -0.2], 2, vec![0.5, 0.2, 0.8, 0.3], vec![1.0, 2.3, 1.7, 0.6], vec![0.0, 0.4, 0.0, 1.0]).unwrap();
    let sinusoid = Motion::Sinusoid(sinusoid);
    let rows: Vec<f64> = (0..41).flat_map(|k| at(&sinusoid, 0.1 * k as f64)).collect();
    vec![
        Motion::hold(vec![0.3, -1.0]).unwrap(),
        sinusoid,
        Motion::Quintic(Quintic::new(vec![0.0, 1.0], vec![1.0, -2.5], 3.0).unwrap()),
        Motion::BangBang(BangBang::new(vec![0.0, 1.0], vec![1.0, -2.5], 3.0).unwrap()),
        Motion::Table(Table::new(0.0, 0.1, 2, rows).unwrap()),
    ]
}

#[test]
fn rates_are_derivatives() {
    let h = 1e-5;
    for m in motions() {
        for t in [0.35, 0.8123, 1.2, 2.2, 2.9] {
            let (before, now, after) = (at(&m, t - h), at(&m, t), at(&m, t + h));
            for i in 0..4 {
                let slope = (after[i] - before[i]) / (2.0 * h);
                // The error of central differences: h^2 times third derivatives below 20, and rounding 1e-16 / h.
                assert!((slope - now[i + 2]).abs() < 5e-9, "{m:?} {t} {i}: {slope} {}", now[i + 2]);
            }
        }
    }
}

#[test]
fn ends_are_held() {
    let [_, _, quintic, bang, table] = motions().try_into().unwrap();
    for m in [quintic, bang] {
        assert_eq!(at(&m, 0.0)[..4], [0.0, 1.0, 0.0, 0.0]);
        assert_eq!(at(&m, -1.0), [0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
        for t in [3.0, 3.0 + 1e-15, 1e9] {
            assert_eq!(at(&m, t), [1.0, -2.5, 0.0, 0.0, 0.0, 0.0]);
        }
    }
    assert_eq!(at(&table, 9.0)[2..], [0.0; 4]);
    assert_eq!(at(&table, 9.0)[..2], at(&table, 4.0)[..2]);
    assert_eq!(at(&table, f64::NAN).len(), 6);
}

#[test]
fn a_table_is_its_motion() {
    let m = motions();
    for k in 0..=40 {
        let t = 0.1 * k as f64;
        assert_eq!(at(&m[4], t), at(&m[1], t));
    }
    for k in 0..400 {
        let t = 0.01 * k as f64;
        let error = (at(&m[4], t)[0] - at(&m[1], t)[0]).abs();
        // The error of quintic Hermite interpolation: dt^6 / 46080 times the sixth derivative, here below 45.
        assert!(error < 1e-9, "{t} {error}");
    }
}

#[test]
fn bad_motions_are_refused() {
    assert!(Motion::hold(vec![]).is_err() && Motion::hold(vec![f64::NAN]).is_err());
    assert!(Quintic::new(vec![0.0], vec![1.0], 0.0).is_err() && Quintic::new(vec![0.0], vec![1.0, 2.0], 1.0).is_err());
    assert!(BangBang::new(vec![0.0], vec![f64::INFINITY], 1.0).is_err());
    assert!(Sinusoid::new(vec![0.0], 2, vec![1.0], vec![1.0], vec![0.0]).is_err());
    assert!(Table::new(0.0, 0.0, 1, vec![0.0; 3]).is_err() && Table::new(0.0, 1.0, 2, vec![0.0; 3]).is_err());
}

#[test]
fn many_instants_have_the_bits_of_single_ones() {
    // The times are inside the motion, at both ends and outside, on knots and between knots.
    let times: Vec<f64> = (0..45).map(|k| 0.1 * f64::from(k) - 0.2).chain([0.77, 1e7, -1e7, 3.0, 1.5]).collect();
    for m in motions() {
        for count in [1, 2, 7, 8, 9, 50] {
            let mut rows = vec![9.5; 8 * 50];
            m.sample_each(&times[..count], 8, &mut rows);
            for (k, row) in rows.chunks_exact(8).enumerate() {
                let expected = if k < count { at(&m, times[k]) } else { vec![9.5; 6] };
                assert_eq!((&row[..6], &row[6..]), (&expected[..], &[9.5; 2][..]), "{m:?} {k} of {count}");
            }
        }
    }
}

#[test]
fn knots_in_a_row_are_found_or_there_are_none() {
    let table = Table::new(1.0, 0.5, 1, vec![0.25; 3 * 5]).unwrap();
    for (k, times) in [(0, &[1.0][..]), (1, &[1.5, 2.0 + 1e-10]), (0, &[1.0, 1.5, 2.0, 2.5, 3.0]), (4, &[3.0])] {
        assert_eq!(table.along(times), Some(3 * k));
    }
    // In this order: no time, between knots, near a knot, a skipped knot, decreasing, a repeated knot, after the last knot, before the
    // first.
    for times in [&[][..], &[1.2], &[1.0, 1.5 + 1e-8], &[1.0, 2.0], &[2.0, 1.5], &[2.0, 2.0], &[3.0, 3.5], &[0.5, 1.0]] {
        assert_eq!(table.along(times), None, "{times:?}");
    }
    for t in [-1e9, 1e15, 1e16, 1e300, f64::INFINITY, f64::NEG_INFINITY, f64::NAN] {
        assert_eq!((table.along(&[t]), table.along(&[1.0, t])), (None, None), "{t}");
    }
}

#[test]
fn paths_of_wrong_lengths_are_refused() {
    let (none, one, two, three): (&[f64], _, _, _) = (&[], &[0.0][..], &[0.0, 1.0][..], &[0.0, 1.0, 2.0][..]);
    let tables = [
        (Path::table(none, none, none, none, 1), "knots"),
        (Path::table(one, one, one, one, 1), "knots"),
        (Path::table(two, one, two, two, 1), "q"),
        (Path::table(two, two, three, two, 1), "dq"),
        (Path::table(two, two, two, none, 1), "ddq"),
        (Path::table(two, none, none, none, 0), "q"),
        (Path::table(two, two, two, two, usize::MAX), "q"),
    ];
    for (k, (table, name)) in tables.into_iter().enumerate() {
        assert!(matches!(&table, Err(Error::WrongShape { argument, .. }) if argument == name), "{k}: {table:?}");
    }
    assert!(Path::table(two, two, two, two, 1).is_ok());
}

#[test]
fn parts_of_a_path_are_finite() {
    let parts = |end: f64| Path::from_parts(vec![0.0, 1.0], vec![0.5; TERMS], vec![end]);
    for end in [f64::NAN, f64::INFINITY] {
        let refused = parts(end);
        assert!(matches!(&refused, Err(Error::Input { argument, .. }) if argument == "end"), "{refused:?}");
    }
    assert!(parts(3.0).is_ok());
}

/// The position and four derivatives of a motion.
fn derivatives(m: &Motion, t: f64) -> Vec<f64> {
    let mut out = vec![0.0; DERIVATIVES * m.dof()];
    m.write_derivatives(t, &mut out);
    out
}

/// A path that is followed with a smooth timing, and one that is followed at unit speed.
fn paths() -> [Motion; 2] {
    let waypoints = [0.0, 0.5, 1.0, 0.2, 0.4, -0.6, 1.5, 0.8];
    let (path, _) = Path::waypoints(&waypoints, 2, Some(&[0.0, 1.0, 2.0, 3.0]), Ends::Clamped).unwrap();
    let path = std::sync::Arc::new(path);
    let cubic =
        TimedPath::cubic(path.clone(), vec![0.0, 1.5, 3.0], vec![0.0, 1.5, 3.0], vec![0.0, 2.25, 0.0], vec![2.0, 0.0, -2.0]).unwrap();
    let linear = TimedPath::new(path, vec![0.0, 1.0, 2.0, 3.0], vec![0.5, 1.0, 1.5, 2.0], vec![0.0; 3]).unwrap();
    [cubic.into(), linear.into()]
}

#[test]
fn derivatives_make_a_taylor_polynomial() {
    let h = 1e-3;
    for m in motions().into_iter().chain(paths()) {
        for t in [0.351, 0.8123, 1.207, 2.231, 2.61] {
            let (now, after) = (derivatives(&m, t), derivatives(&m, t + h));
            for order in 0..DERIVATIVES {
                for i in 0..2 {
                    let at = |k: usize| now[2 * k + i];
                    let (mut taylor, mut term) = (0.0, 1.0);
                    for k in order..DERIVATIVES {
                        taylor += at(k) * term;
                        term *= h / (k + 1 - order) as f64;
                    }
                    // `term` is now the factor of the fifth derivative, which is below 400 for all these motions.
                    let error = (after[2 * order + i] - taylor).abs();
                    assert!(error < 400.0 * term + 1e-14, "{m:?} {t} {order}: {error}");
                }
            }
        }
    }
}

#[test]
fn derivatives_are_samples_and_further_derivatives() {
    let times = [-0.5, 0.0, 0.3, 1.0, 1.5, 2.0, 3.0, 4.0, 9.0];
    for m in motions().into_iter().chain(paths()) {
        for t in times {
            let all = derivatives(&m, t);
            assert_eq!(all[..6], at(&m, t), "{m:?} {t}");
            let highest = m.highest_order();
            for order in 0..=highest {
                let rows = m.derivatives(t, order).unwrap();
                assert_eq!(rows.shape(), (order + 1, 2));
                assert!((0..=order).all(|k| (0..2).all(|i| rows[(k, i)] == all[2 * k + i])));
            }
            let refused = m.derivatives(t, highest + 1);
            assert!(matches!(&refused, Err(Error::Input { argument, .. }) if argument == "order"), "{refused:?}");
        }
        for t in [f64::NAN, f64::INFINITY] {
            assert!(matches!(m.derivatives(t, 0), Err(Error::Input { argument, .. }) if argument == "t"));
        }
    }
    assert_eq!(motions().iter().chain(&paths()).map(Motion::highest_order).collect::<Vec<_>>(), [4, 4, 4, 2, 4, 4, 4]);
}

#[test]
fn jumps_have_the_value_after_them() {
    let [_, _, quintic, _, table] = motions().try_into().unwrap();
    // The jerk of a quintic jumps by 60 (q1 - q0) / T^3 at both ends, and the snap by -360 (q1 - q0) / T^4.
    let (jerk, snap) = (60.0 / 27.0, -360.0 / 81.0);
    for (got, want) in derivatives(&quintic, 0.0)[6..].iter().zip([jerk, -3.5 * jerk, snap, -3.5 * snap]) {
        assert!((got - want).abs() < 1e-14, "{got} {want}");
    }
    assert_eq!(derivatives(&quintic, 3.0)[6..], [0.0; 4]);
    let near = |a: Vec<f64>, b: Vec<f64>| a.iter().zip(b).skip(6).all(|(a, b)| (a - b).abs() < 1e-4);
    // A knot belongs to the interval after it, and the last knot to the interval before it.
    for t in [0.0, 0.1, 1.7] {
        assert!(near(derivatives(&table, t), derivatives(&table, t + 1e-8)), "{t}");
    }
    assert!(near(derivatives(&table, 4.0), derivatives(&table, 4.0 - 1e-8)));
    let one = Motion::from(Table::new(0.0, 1.0, 1, vec![0.5, 0.25, 0.125]).unwrap());
    let at_knot = one.derivatives(0.0, 4).unwrap();
    assert_eq!(at_knot.as_slice(), [0.5, 0.25, 0.125, 0.0, 0.0]);
    // The path acceleration jumps between two segments, so there is no jerk.
    let (line, _) = Path::waypoints(&[0.0, 1.0], 1, None, Ends::Natural).unwrap();
    let timed = |x: Vec<f64>| Motion::from(TimedPath::new(line.clone().into(), vec![0.0, 0.5, 1.0], x, vec![0.0; 2]).unwrap());
    assert!(timed(vec![0.0, 1.0, 0.0]).derivatives(0.3, 3).is_err());
    assert!(timed(vec![f64::NAN; 3]).derivatives(0.3, 0).is_err_and(|error| matches!(error, Error::Solve { .. })));
}

#[test]
fn an_acceleration_has_jerk_and_snap() {
    let inner = motions().into_iter().chain(paths());
    let moving = inner.filter(|m| m.highest_order() == 4);
    for m in moving {
        let acceleration = Motion::acceleration_of(&m).unwrap();
        for t in [-0.5, 0.0, 0.1, 0.3, 0.351, 1.5, 2.231, 3.0, 4.0, 9.0] {
            assert_eq!(at(&acceleration, t), derivatives(&m, t)[4..], "{m:?} {t}");
            assert_eq!(acceleration.derivatives(t, 2).unwrap().as_slice().len(), 6);
        }
        let times: Vec<f64> = (0..41).map(|k| 0.1 * k as f64).collect();
        let mut rows = vec![0.0; 6 * times.len()];
        acceleration.sample_each(&times, 6, &mut rows);
        assert!(times.iter().zip(rows.chunks(6)).all(|(&t, row)| at(&acceleration, t) == row));
        // Near itself, the motion is the same function of its numbers, up to the rounding of the polynomial.
        let mut smooth = vec![0.0; 6];
        for t in [0.05, 0.2, 4.0] {
            acceleration.sample_with(&acceleration, t, Side::Before, &mut smooth);
            assert!(smooth.iter().zip(at(&acceleration, t)).all(|(a, b)| (a - b).abs() < 1e-8 * (1.0 + b.abs())), "{m:?} {t}");
        }
        assert_eq!((acceleration.dof(), acceleration.breaks()), (2, m.breaks()));
        assert!(
            acceleration.derivatives(0.0, 3).is_err() && Motion::acceleration_of(&acceleration).is_err() || matches!(m, Motion::Hold(_))
        );
    }
    let [_, _, _, bang, table] = motions().try_into().unwrap();
    let refused = Motion::acceleration_of(&bang);
    assert!(matches!(&refused, Err(Error::Input { argument, .. }) if argument == "motion"), "{refused:?}");
    assert_eq!(Motion::acceleration_of(&table).unwrap().jumps().len(), 41);
}
