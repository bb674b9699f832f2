//! The functions of `pool` without rayon: one worker computes all parts in order, with the same results.

use super::threads::on_worker;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Run `work(stop)` on one worker thread. `poll` is called every 20 ms. If its result is true, `stop` is set.
pub fn run<R: Send>(_: usize, _: usize, poll: &mut dyn FnMut() -> bool, work: impl FnOnce(&Arc<AtomicBool>) -> R + Send) -> R {
    on_worker(poll, work)
}

/// Run `work` on each part, and collect the results in order.
pub(super) fn map<P, R, C: FromIterator<R>>(parts: Vec<P>, work: impl Fn(P) -> R) -> C {
    parts.into_iter().map(work).collect()
}

/// Run `work(i, part)` on each part. Return true if any result is true.
pub fn any<P>(parts: &mut [P], work: impl Fn(usize, &mut P) -> bool) -> bool {
    parts.iter_mut().enumerate().fold(false, |any, (i, part)| any | work(i, part))
}

/// Run `work` on each part with one state for all parts.
pub fn each_with<P, L>(parts: Vec<P>, state: impl Fn() -> L, work: impl Fn(&mut L, P)) {
    let mut state = state();
    parts.into_iter().for_each(|part| work(&mut state, part));
}
