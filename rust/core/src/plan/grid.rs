//! The turning points that a search for a swing looks at, several at once.

use super::search::BackSwings;

/// Turning points whose margins are found together.
pub(super) const AHEAD: usize = 8;

/// The turning point after another one: the scales of the problem are unknown, but none is smaller than the first one.
pub(super) fn next(e: f64) -> f64 {
    if e < 0.4 { 1.6 * e } else { e + 0.2 }
}

/// The same where T may change fast.
pub(super) fn next_weak(e: f64) -> f64 {
    if e < 0.4 { 1.05 * e } else { e + 0.02 }
}

/// Turning points from the first one to the last one, with their margins.
pub(super) struct Grid<'a, B> {
    /// Whose margins are found; infinite ones if none's.
    swings: Option<&'a B>,
    following: fn(f64) -> f64,
    last: f64,
    /// Where a margin is at most that, any number up to that is given.
    least: f64,
    next: f64,
    e: [f64; AHEAD],
    margins: [f64; AHEAD],
    at: usize,
    count: usize,
}

impl<'a, B: BackSwings> Grid<'a, B> {
    pub fn new(swings: Option<&'a B>, following: fn(f64) -> f64, first: f64, last: f64, least: f64) -> Self {
        let margins = [f64::INFINITY; AHEAD];
        Grid { swings, following, last, least, next: first, e: [0.0; AHEAD], margins, at: 0, count: 0 }
    }

    fn look_ahead(&mut self) {
        (self.at, self.count) = (0, 0);
        while self.count < AHEAD && self.next <= self.last {
            self.e[self.count] = self.next;
            self.next = (self.following)(self.next);
            self.count += 1;
        }
        if let Some(swings) = self.swings.filter(|_| self.count > 0) {
            self.margins = swings.margins(&self.e[..self.count], self.least);
        }
    }
}

/// Turning point and margin.
impl<B: BackSwings> Iterator for Grid<'_, B> {
    type Item = (f64, f64);
    #[inline]
    fn next(&mut self) -> Option<(f64, f64)> {
        if self.at == self.count {
            self.look_ahead();
        }
        let at = self.at;
        (at < self.count).then(|| {
            self.at += 1;
            (self.e[at], self.margins[at])
        })
    }
}
