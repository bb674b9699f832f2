//! Single calls of an arm's functions. The first calls evaluate directly, later calls by a program.
//!
//! A short program is made after [`CALLS`] calls. A longer one takes milliseconds to make, so it is made when the direct calls have taken
//! as long as that. It is used only if it is faster than the direct evaluation, because a very long program does not fit in the caches.
//! Functions whose program would take longer than some 30 ms to make are always evaluated directly.

use super::Query;
use super::evaluate::Evaluator;
use super::recorded::ArmCall;
use crate::arm::Arm;
use crate::error::Result;
use crate::trace::function::CALLS;
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// Largest number of operations of a program that is made without a comparison of times. It takes at most some 3 ms to make.
const SHORT: f64 = 20_000.0;

/// Largest number of operations of a program. Of mass matrices, Coriolis matrices and regressors of 40 to 150 joints, those with fewer
/// operations take 2 to 28 ms to make.
const LONGEST: f64 = 120_000.0;

/// Time to make a program, s per operation. The functions above take 0.12 to 0.24 us.
const MAKING: f64 = 0.2e-6;

/// Number of calls of a new program, the fastest of which is compared with the direct evaluation.
const TRIALS: usize = 3;

/// Number of queries of one arm whose programs are kept.
const KEPT_QUERIES: usize = 64;

/// A query, and its program for one configuration.
struct CachedQuery {
    query: Query,
    /// Approximate number of operations.
    operations: f64,
    /// Number of calls without the program.
    calls: usize,
    /// The time of all direct calls, and of the fastest one. Only measured before a program of more than `SHORT` operations is made.
    spent: Duration,
    fastest: Duration,
    /// Whether the choice between direct evaluation and program is made.
    decided: bool,
    program: Option<ArmCall>,
}

impl CachedQuery {
    fn new(arm: &Arm, query: &Query) -> Self {
        let operations = query.operations(arm.size(), arm.pairs());
        let (spent, fastest) = (Duration::ZERO, Duration::MAX);
        CachedQuery { query: *query, operations, calls: 0, spent, fastest, decided: operations > LONGEST, program: None }
    }

    /// Whether it repays to make the program now.
    fn is_due(&self) -> bool {
        let repaid = if self.operations <= SHORT { self.calls == CALLS } else { self.spent.as_secs_f64() >= MAKING * self.operations };
        repaid && !self.decided
    }

    /// Make the program, and keep it if it is short or faster than the direct evaluation of these inputs. Return whether `out` has the
    /// result.
    #[cold]
    fn decide(&mut self, arm: &Arm, inputs: &[&[f64]], out: &mut [f64]) -> Result<bool> {
        self.decided = true;
        let mut program = ArmCall::new(arm, &self.query)?;
        let (mut fastest, mut valid) = (Duration::MAX, true);
        let short = self.operations <= SHORT;
        for _ in 0..if short { 1 } else { TRIALS } {
            let start = Instant::now();
            valid &= program.answer(inputs, out);
            fastest = fastest.min(start.elapsed());
        }
        if short || !valid || fastest < self.fastest {
            self.program = Some(program);
        }
        Ok(valid)
    }

    /// Evaluate directly, and count the call.
    fn direct(&mut self, evaluator: &mut Evaluator, inputs: &[&[f64]], out: &mut [f64]) -> Result<bool> {
        self.calls = self.calls.saturating_add(1);
        if self.decided || self.operations <= SHORT {
            return evaluator.one(&self.query, inputs, out);
        }
        let start = Instant::now();
        let answer = evaluator.one(&self.query, inputs, out)?;
        let took = start.elapsed();
        self.spent += took;
        self.fastest = self.fastest.min(took);
        Ok(answer)
    }
}

/// The evaluator and the programs for single calls.
pub(super) struct Single {
    /// The evaluator; `None` for an arm of very many joints before its first call.
    evaluator: Option<Evaluator>,
    cached: Vec<CachedQuery>,
}

impl Single {
    pub fn new(evaluator: Option<Evaluator>) -> Mutex<Self> {
        Mutex::new(Single { evaluator, cached: Vec::new() })
    }

    /// Compute one configuration, as [`Evaluator::one`] does, with the same errors.
    #[inline]
    pub fn one(&mut self, arm: &Arm, query: &Query, inputs: &[&[f64]], out: &mut [f64]) -> Result<bool> {
        let found = self.cached.iter().position(|cached| cached.query == *query);
        if let Some(at) = found
            && let Some(program) = &mut self.cached[at].program
            && program.answer(inputs, out)
        {
            return Ok(true);
        }
        self.direct(arm, found, query, inputs, out)
    }

    /// Evaluate without a program, or make it. `found` is the index of the query in `cached`.
    #[inline(never)]
    fn direct(&mut self, arm: &Arm, found: Option<usize>, query: &Query, inputs: &[&[f64]], out: &mut [f64]) -> Result<bool> {
        let at = found.unwrap_or_else(|| {
            if self.cached.len() == KEPT_QUERIES {
                self.cached.remove(0);
            }
            self.cached.push(CachedQuery::new(arm, query));
            self.cached.len() - 1
        });
        let cached = &mut self.cached[at];
        if cached.is_due() && cached.decide(arm, inputs, out)? {
            return Ok(true);
        }
        let evaluator = match &mut self.evaluator {
            Some(evaluator) => evaluator,
            none => none.insert(Evaluator::large(arm)?),
        };
        cached.direct(evaluator, inputs, out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::Quantity;

    /// Call a function until the choice of the engine is made, and some times more. Return the cached query.
    fn called(arm: &Arm, quantity: Quantity) -> CachedQuery {
        let query = Query::from(quantity);
        let wave = |from: f64| (0..arm.n()).map(|i| (from + 2.3 * i as f64).sin()).collect::<Vec<f64>>();
        let given = [wave(0.1), wave(0.2), wave(0.3), wave(0.4)];
        let inputs: Vec<&[f64]> = given[..query.inputs().len()].iter().map(Vec::as_slice).collect();
        let single = Single::new(Some(Evaluator::new(arm)));
        let mut single = single.lock().unwrap();
        let (mut first, mut out) = (vec![0.0; query.length(arm.size())], vec![0.0; query.length(arm.size())]);
        Evaluator::new(arm).one(&query, &inputs, &mut first).unwrap();
        for _ in 0..10_000 {
            out.fill(f64::NAN);
            assert!(single.one(arm, &query, &inputs, &mut out).unwrap());
            assert!(first.iter().zip(&out).all(|(a, b)| a == b), "{quantity:?}");
            if single.cached[0].decided && single.cached[0].calls >= CALLS {
                break;
            }
        }
        single.cached.remove(0)
    }

    #[test]
    fn a_long_program_is_made_when_it_is_repaid() {
        let arm = Arm::planar(&[0.3; 40], None, None, None, [0.0, -9.81]).unwrap();
        let cached = called(&arm, Quantity::MassMatrix);
        assert!(cached.operations > SHORT && cached.decided);
        // A single call that is interrupted can take as long as the program takes to make.
        assert!(cached.spent.as_secs_f64() >= MAKING * cached.operations && cached.fastest <= cached.spent);
        let cached = called(&arm, Quantity::Gravity);
        assert!(cached.operations <= SHORT && cached.program.is_some() && cached.calls == CALLS && cached.spent.is_zero());
    }

    #[test]
    fn the_longest_functions_have_no_program() {
        let arm = Arm::planar(&[0.3; 80], None, None, None, [0.0, -9.81]).unwrap();
        let cached = called(&arm, Quantity::CoriolisMatrix);
        assert!(cached.operations > LONGEST && cached.decided && cached.program.is_none());
    }
}
