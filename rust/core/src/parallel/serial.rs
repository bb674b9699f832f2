//! The functions of `pool` without rayon: one worker does all parts in order, with the same results.

use super::on_worker;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Run `work(stop)` on one worker thread. `poll` is called every 20 ms, and its result is passed on as the request to stop.
pub fn run<R: Send>(_: usize, _: usize, poll: &mut dyn FnMut() -> bool, work: impl FnOnce(&Arc<AtomicBool>) -> R + Send) -> R {
    on_worker(poll, work)
}

/// Run `work` on each part. The results are in order.
pub(super) fn map<P, R, C: FromIterator<R>>(parts: Vec<P>, work: impl Fn(P) -> R) -> C {
    parts.into_iter().map(work).collect()
}

/// Run `work(i, part)` on each part. The result is true if any of them returned true.
pub fn any<P>(parts: &mut [P], work: impl Fn(usize, &mut P) -> bool) -> bool {
    parts.iter_mut().enumerate().fold(false, |any, (i, part)| any | work(i, part))
}

/// Run `work` on each part with one state.
pub fn each_with<P, L>(parts: Vec<P>, state: impl Fn() -> L, work: impl Fn(&mut L, P)) {
    let mut state = state();
    parts.into_iter().for_each(|part| work(&mut state, part));
}
