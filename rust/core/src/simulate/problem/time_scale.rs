//! The time scale of a function of time, which limits the steps of a run.
//!
//! A method evaluates a function `F(t)` only at the stages of its steps. At rest the steps of an adaptive method grow, and a step can pass
//! over a pulse of `F`. So `F` is evaluated on a grid before the run, with two results:
//!
//! 1. Jumps. In a grid cell where `F` changes much, bisection keeps the half with the larger change. A smooth change decreases with the
//!    interval, and a jump does not. A jump ends a segment of the run, as a jump of a piecewise constant force does.
//! 2. Blocks. The time between two jumps is halved until each block is smooth. In a smooth block, the parabola through the values at the
//!    start, the middle and the end predicts all values. Its error is at most `ROUGH` of their range. A step is not longer than the block in
//!    which it starts.
//!
//! The grid has `CELLS` cells, which are a little longer than `t_end / CELLS`. If the period of a function divides `t_end`, its values
//! would repeat on cells of exactly this length.

/// The number of cells of the grid.
const CELLS: usize = 4096;
/// The length of the last cell, as a fraction of the length of the other cells.
const LAST_CELL: f64 = 0.618;
/// The largest error of the parabola of a block, as a fraction of the range of the function.
const ROUGH: f64 = 0.01;
/// A cell is searched for a jump if the function changes there by at least this fraction of its range.
const NOTICED: f64 = 0.01;
/// A bisection continues while it keeps at least this fraction of the change over the cell.
const REMAINS: f64 = 0.5;
/// The largest number of evaluations of all bisections together.
const MOST_BISECTIONS: usize = CELLS;
/// A bisection ends at this fraction of the grid's span, or at two adjacent numbers.
const RESOLVED: f64 = 1e-3 * f64::EPSILON;
/// A range below this fraction of the largest magnitude of the function is rounding error.
const ROUNDING: f64 = 1e-12;

/// The jumps and the blocks of a function of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TimeScale {
    /// The times at which the function jumps, s, increasing. The function has its new value at the time itself.
    pub jumps: Vec<f64>,
    /// The ends of the blocks, s, increasing. The first block starts at zero.
    ends: Vec<f64>,
}

/// The values of a function on the grid.
struct Grid<'a, F> {
    function: &'a mut F,
    width: usize,
    times: Vec<f64>,
    /// The values, one row per time.
    values: Vec<f64>,
    /// The range of each component, or infinity for a component without a range.
    ranges: Vec<f64>,
}

impl<F: FnMut(f64, &mut [f64]) -> bool> Grid<'_, F> {
    fn row(&self, i: usize) -> &[f64] {
        &self.values[i * self.width..(i + 1) * self.width]
    }

    /// The largest change between two values, as a fraction of the range of the component.
    fn change(&self, a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).zip(&self.ranges).map(|((a, b), range)| (a - b).abs() / range).fold(0.0, f64::max)
    }

    /// Return the time of the jump in cell `i`; `None` if the function is smooth there or is not known. `left` counts evaluations down.
    fn jump(&mut self, i: usize, left: &mut usize) -> Option<f64> {
        let (mut from, mut to) = (self.times[i], self.times[i + 1]);
        let (mut low, mut high) = (self.row(i).to_vec(), self.row(i + 1).to_vec());
        let (first, resolved) = (self.change(&low, &high), RESOLVED * self.times[self.times.len() - 1]);
        let mut middle = vec![0.0; self.width];
        while to > from.next_up() && to - from > resolved {
            let t = 0.5 * (from + to);
            *left = left.checked_sub(1)?;
            if !(self.function)(t, &mut middle) {
                return None;
            }
            let (before, after) = (self.change(&low, &middle), self.change(&middle, &high));
            if before > after {
                (to, high) = (t, middle.clone());
            } else {
                (from, low) = (t, middle.clone());
            }
            // Written so that a change that is not a number ends the search.
            if !(before.max(after) >= REMAINS * first) {
                return None;
            }
        }
        Some(to)
    }

    /// Whether the parabola through the values at `i`, at the middle and at `j` predicts all values from `i` to `j`.
    fn smooth(&self, i: usize, j: usize) -> bool {
        let m = usize::midpoint(i, j);
        let [a, b, c] = [i, m, j].map(|k| self.times[k]);
        (i..=j).all(|k| {
            let t = self.times[k];
            let weights =
                [(t - b) * (t - c) / ((a - b) * (a - c)), (t - a) * (t - c) / ((b - a) * (b - c)), (t - a) * (t - b) / ((c - a) * (c - b))];
            (0..self.width).all(|w| {
                let [at, x, y, z] = [k, i, m, j].map(|k| self.values[k * self.width + w]);
                let error = weights[0] * x + weights[1] * y + weights[2] * z - at;
                error.abs() <= ROUGH * self.ranges[w]
            })
        })
    }

    /// Append the ends of the blocks between the times `i` and `j` of the grid, without the last end.
    fn divide(&self, i: usize, j: usize, ends: &mut Vec<f64>) {
        if j <= i + 2 || self.smooth(i, j) {
            return;
        }
        let m = usize::midpoint(i, j);
        self.divide(i, m, ends);
        ends.push(self.times[m]);
        self.divide(m, j, ends);
    }
}

impl TimeScale {
    /// Return the time scale of `function` from `t = 0` to `t_end`, s. `function(t, out)` writes `width` numbers to `out`. If it returns
    /// false, the result is `None`.
    pub fn of<F: FnMut(f64, &mut [f64]) -> bool>(t_end: f64, width: usize, function: &mut F) -> Option<Self> {
        let cell = t_end / (CELLS as f64 - 1.0 + LAST_CELL);
        let times: Vec<f64> = (0..CELLS).map(|i| i as f64 * cell).chain([t_end]).collect();
        let mut values = vec![0.0; times.len() * width];
        for (&t, out) in times.iter().zip(values.chunks_exact_mut(width)) {
            if !function(t, out) {
                return None;
            }
        }
        let bounds = |w: usize| {
            values.iter().skip(w).step_by(width).fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)))
        };
        let bounds: Vec<(f64, f64)> = (0..width).map(bounds).collect();
        let largest = values.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        let range = |&(low, high): &(f64, f64)| if high - low > ROUNDING * largest { high - low } else { f64::INFINITY };
        let ranges = bounds.iter().map(range).collect();
        let mut grid = Grid { function, width, times, values, ranges };
        let mut steep: Vec<(usize, f64)> =
            (0..CELLS).map(|i| (i, grid.change(grid.row(i), grid.row(i + 1)))).filter(|cell| cell.1 >= NOTICED).collect();
        steep.sort_by(|a, b| b.1.total_cmp(&a.1));
        let (mut left, mut cells) = (MOST_BISECTIONS, Vec::new());
        for (i, _) in steep {
            if let Some(t) = grid.jump(i, &mut left) {
                cells.push((i, t));
            }
        }
        cells.sort_by_key(|cell| cell.0);
        let (mut scale, mut start) = (TimeScale::default(), 0);
        for (i, t) in cells {
            grid.divide(start, i, &mut scale.ends);
            scale.ends.push(t);
            scale.jumps.push(t);
            start = i + 1;
        }
        grid.divide(start, CELLS, &mut scale.ends);
        scale.ends.push(t_end);
        Some(scale)
    }

    /// Return start and end of block `k`, s.
    fn block(&self, k: usize) -> (f64, f64) {
        (if k == 0 { 0.0 } else { self.ends[k - 1] }, self.ends[k])
    }

    /// Return the length of the longest step from time `t`, s. Such a step ends in the block of `t`, or in the next block.
    pub fn longest_step(&self, t: f64) -> f64 {
        let k = self.ends.partition_point(|&end| end <= t);
        if k + 1 >= self.ends.len() {
            return f64::INFINITY;
        }
        let ((start, end), (_, next)) = (self.block(k), self.block(k + 1));
        (end - t).max((end - start).min(next - end))
    }

    /// Return start and end of the first block with at most half of the length of a step `dt`, s.
    pub fn block_within(&self, dt: f64) -> Option<(f64, f64)> {
        (0..self.ends.len()).map(|k| self.block(k)).find(|(start, end)| 2.0 * (end - start) <= dt)
    }

    /// Whether the grid of a run up to `t_end`, s, is fine enough for a statement about fixed steps `dt`, s.
    pub fn resolves(dt: f64, t_end: f64) -> bool {
        dt * CELLS as f64 >= 4.0 * t_end
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Return the time scale of `f` over 10 s, and its number of evaluations.
    fn scale(f: impl Fn(f64) -> f64) -> (TimeScale, usize) {
        let mut calls = 0;
        let scale = TimeScale::of(10.0, 1, &mut |t, out: &mut [f64]| {
            calls += 1;
            out[0] = f(t);
            true
        });
        (scale.unwrap(), calls)
    }

    #[test]
    fn jumps_are_found_to_the_last_bit() {
        let (pulse, calls) = scale(|t| if (1.0..1.05).contains(&t) { 20.0 } else { 0.0 });
        assert_eq!(pulse, TimeScale { jumps: vec![1.0, 1.05], ends: vec![1.0, 1.05, 10.0] });
        assert!(calls < CELLS + 200);
        // A smooth change does not hide a jump, and is none.
        assert_eq!(scale(|t| (3.0 * t).sin() + f64::from(t >= 0.3)).0.jumps, [0.3]);
        assert_eq!(scale(|t| (-((t - 3.0) / 0.01).powi(2)).exp()).0.jumps, [0.0; 0]);
    }

    #[test]
    fn a_step_is_not_longer_than_the_feature_ahead() {
        let (constant, calls) = scale(|_| 4.0);
        assert_eq!((constant.longest_step(0.0), calls), (f64::INFINITY, CELLS + 1));
        // From zero on, steps of the largest length reach the bump of 30 ms, and are short there.
        let (bump, _) = scale(|t| (-((t - 3.0) / 0.03).powi(2)).exp());
        let (mut t, mut inside, mut steps) = (0.0, 0, 0);
        while t < 4.0 {
            let h = bump.longest_step(t);
            assert!(h > 0.0);
            inside += usize::from((t - 3.0f64).abs() < 0.06);
            t += h;
            steps += 1;
        }
        assert!(inside >= 4 && steps < 40, "{inside} {steps}");
        // A sine of 1 rad/s does not limit the steps of a method, which are below 1 s.
        assert!((0..90).all(|k| scale(f64::sin).0.longest_step(0.1 * f64::from(k)) > 0.05));
    }

    #[test]
    fn a_function_that_fails_has_no_time_scale() {
        assert_eq!(TimeScale::of(1.0, 1, &mut |t, _: &mut [f64]| t < 0.5), None);
        // Values that are not finite neither end the search early nor make it endless.
        assert!(scale(|t| if t > 5.0 { f64::NAN } else { t }).0.longest_step(0.0) > 0.0);
        assert!(scale(|t| 1.0 / (t - 5.0)).0.longest_step(0.0) > 0.0);
    }
}
