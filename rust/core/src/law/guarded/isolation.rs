//! Find the touched link from the residual `r` of a momentum observer, an estimate of the external joint torques. A force on a link does
//! not load the joints beyond that link.

use crate::dynamics::Model;

/// The parent joint of each joint; `None` at the base.
pub fn parents(model: &Model) -> Vec<Option<usize>> {
    match model {
        Model::Tree(arm) => arm.parents(),
        Model::PlanarPr(_) => vec![None, Some(0)],
    }
}

/// The outermost joint whose `|r_i|` exceeds its threshold; `None` if no joint exceeds its threshold. With several branches, the joint with
/// the largest ratio of `|r_i|` to its threshold is returned.
pub fn touched(model: &Model, thresholds: &[f64], r: &[f64]) -> Option<usize> {
    let n = r.len();
    let parents = parents(model);
    let above = |i: usize| r[i].abs() > thresholds[i];
    // A force on a link also loads all joints between that link and the base, so these joints are not outermost.
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
