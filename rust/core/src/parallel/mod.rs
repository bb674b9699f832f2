//! Worker threads. A pool of threads is created at first use, and again in a forked child process. The calling thread can check for a stop
//! request during the work. The division of rows into chunks does not depend on the number of threads.
//!
//! `pool` contains the threads. Without the feature `parallel`, `serial` replaces it: one worker, with the same results.

#[cfg(feature = "parallel")]
mod pool;
#[cfg(not(feature = "parallel"))]
#[path = "serial.rs"]
mod pool;
mod threads;

pub use pool::{any, each_with, run};
pub use threads::{MOST_THREADS, default_threads, on_worker, require_threads};

use crate::interrupt::{Interrupted, Watch, interruptible};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Fill the rows of `out`, which have `length` numbers each, with `work(first, last, rows)`. Each call has `chunk` rows, and the last call
/// has the remaining rows. Return the results in the order of the chunks. Errors: `Interrupted` after `poll` returned true.
pub fn rows<R: Send>(
    threads: usize,
    poll: &mut dyn FnMut() -> bool,
    (length, chunk): (usize, usize),
    out: &mut [f64],
    work: impl Fn(usize, usize, &mut [f64]) -> R + Sync,
) -> std::result::Result<Vec<R>, Interrupted> {
    let chunk = chunk.max(1);
    let parts = out.chunks_mut((length * chunk).max(1)).enumerate().collect();
    pieces(threads, poll, parts, |(i, rows): (usize, &mut [f64])| work(i * chunk, i * chunk + rows.len() / length.max(1), rows))
}

/// Run `work` on each of the parts, and return the results in the same order. Errors: `Interrupted` after `poll` returned true.
pub fn pieces<P: Send, R: Send>(
    threads: usize,
    poll: &mut dyn FnMut() -> bool,
    parts: Vec<P>,
    work: impl Fn(P) -> R + Sync,
) -> std::result::Result<Vec<R>, Interrupted> {
    let one = |stop: &Arc<AtomicBool>, part: P| {
        if stop.load(Ordering::Relaxed) {
            return Err(Interrupted);
        }
        interruptible(Watch::Flag(stop.clone()), || work(part))
    };
    if threads == 1 {
        return on_worker(poll, |stop| parts.into_iter().map(|part| one(stop, part)).collect());
    }
    run(threads, parts.len(), poll, |stop| pool::map(parts, |part| one(stop, part)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn rows_are_filled_in_order_by_any_number_of_threads_and_stop_when_asked() {
        for (threads, chunk) in [(1, 3), (2, 1), (3, 4), (2, 100)] {
            let mut out = vec![0.0; 2 * 11];
            let fill = |first: usize, last: usize, rows: &mut [f64]| {
                for (i, row) in (first..last).zip(rows.chunks_exact_mut(2)) {
                    row.fill(i as f64);
                }
                (first, last)
            };
            let chunk_results = rows(threads, &mut || false, (2, chunk), &mut out, fill).expect("no request to stop");
            assert!(out.chunks(2).enumerate().all(|(i, row)| row == [i as f64; 2]), "{out:?}");
            assert_eq!(
                (chunk_results[0].0, chunk_results[chunk_results.len() - 1].1, chunk_results.len()),
                (0, 11, 11usize.div_ceil(chunk))
            );
        }
        let slow = |_: usize, _: usize, _: &mut [f64]| std::thread::sleep(Duration::from_millis(2));
        assert!(rows(2, &mut || true, (1, 1), &mut [0.0; 1000], slow).is_err());
    }
}
