//! The active-set method of stacks with bounds as C code of fixed size, for exported laws.

use crate::priority::method::{DEFAULT_EPS, PriorityMethod};
use crate::scalar::hex::hex;

const SOURCE: &str = concat!(
    include_str!("vectors.c"),
    include_str!("faces.c"),
    include_str!("search.c"),
    include_str!("vertices.c"),
    include_str!("levels.c")
);

/// Print the solver for the sizes of `StackFormula::of` as a C function with the name `name`. It has no metric.
pub(super) fn stack_in_c(sizes: &[usize], name: &str) -> String {
    let &[n, method, has_eps, _, has_bounds, limit_levels, levels, ref others @ ..] = sizes else { return String::new() };
    let (rows, intervals) = others.split_at(levels);
    let method = match PriorityMethod::ALL[method] {
        PriorityMethod::Clamp => 1,
        PriorityMethod::Damped => 2,
        _ => 0,
    };
    let limits = has_bounds * n;
    let mut first = vec![0, limits];
    rows.iter().for_each(|rows| first.push(first[first.len() - 1] + rows));
    let flags: Vec<usize> = std::iter::once(0).chain((0..levels).map(|level| intervals.get(level).copied().unwrap_or(0))).collect();
    let list = |numbers: &[usize]| numbers.iter().map(usize::to_string).collect::<Vec<_>>().join(", ");
    let head = format!(
        "enum {{ @_N = {n}, @_METHOD = {method}, @_HAS_EPS = {has_eps}, @_UNDAMPED = {limit_levels}, @_LIMITS = {limits}, @_ROWS = {}, \
@_INTERVALS = {} }};\nstatic const double @_EPS = {};\nstatic const int @_first[{}] = {{{}}};\nstatic const int @_interval[{}] = {{{}}};\n",
        first[first.len() - 1],
        usize::from(!intervals.is_empty()),
        hex(DEFAULT_EPS),
        first.len(),
        list(&first),
        flags.len(),
        list(&flags)
    );
    let (comment, code) = SOURCE.split_once("*/\n").unwrap_or_default();
    format!("{comment}*/\n{head}{code}").replace("@_", &format!("{name}_")).replace("@(", &format!("{name}("))
}
