//! The touched link, from the external torque: a force on a link loads no joint beyond that link.

use crate::dynamics::Model;

/// The joint that bears each joint; `None` at the base.
pub fn parents(model: &Model) -> Vec<Option<usize>> {
    match model {
        Model::Tree(arm) => arm.parents(),
        Model::PlanarPr(_) => vec![None, Some(0)],
    }
}

/// The outermost joint with `|r_i|` above its threshold; `None` without one. Of several branches, the one furthest above counts.
pub fn touched(model: &Model, thresholds: &[f64], r: &[f64]) -> Option<usize> {
    let n = r.len();
    let parents = parents(model);
    let above = |i: usize| r[i].abs() > thresholds[i];
    // A joint inwards of another joint above its threshold carries the same force.
    let mut inner = vec![false; n];
    for i in (0..n).filter(|&i| above(i)) {
        let mut next = parents[i];
        while let Some(k) = next.filter(|&k| !inner[k]) {
            inner[k] = true;
            next = parents[k];
        }
    }
    let outermost = (0..n).filter(|&i| above(i) && !inner[i]);
    outermost.max_by(|&a, &b| (r[a].abs() / thresholds[a]).total_cmp(&(r[b].abs() / thresholds[b])))
}
