//! The numbers, words and placements of elements, with errors that name the line.

use super::declaration::is_xacro;
use super::element::Reader;
use super::plausible::{ANGLE, Bound, LENGTH};
use super::source::XACRO;
use crate::error::Result;
use crate::spatial::{Matrix3, Placement};
use roxmltree::Node;

impl Reader<'_> {
    pub fn required<'n>(&self, node: Node<'n, '_>, attribute: &str) -> Result<&'n str> {
        match node.attribute(attribute).map(str::trim) {
            Some(text) if left_over(text) => Err(self.error(node, format!("{attribute} holds {}{XACRO}", shortened(text)))),
            Some(text) if !text.is_empty() => Ok(text),
            _ => Err(self.error(node, format!("{} has no {attribute}", node.tag_name().name()))),
        }
    }

    pub fn numbers<const N: usize>(&self, node: Node, attribute: &str, text: &str) -> Result<[f64; N]> {
        let label = || format!("{attribute} of {}", node.tag_name().name());
        let mut out = [0.0; N];
        let mut count = 0;
        for word in text.split_whitespace() {
            let Ok(x) = word.parse::<f64>() else {
                let hint = if left_over(word) { XACRO } else { "" };
                return Err(self.error(node, format!("{} is not a number: got {}{hint}", label(), shortened(word))));
            };
            if !x.is_finite() {
                return Err(self.error(node, format!("{} is not finite: got {}", label(), shortened(word))));
            }
            if count < N {
                out[count] = x;
            }
            count += 1;
        }
        if count != N {
            return Err(self.error(node, format!("{} has the wrong length: expected {N} numbers, got {count}", label())));
        }
        Ok(out)
    }

    pub fn number(&self, node: Node, attribute: &str) -> Result<Option<f64>> {
        node.attribute(attribute).map(|text| self.numbers::<1>(node, attribute, text).map(|x| x[0])).transpose()
    }

    pub fn vector(&self, node: Node, attribute: &str) -> Result<Option<[f64; 3]>> {
        node.attribute(attribute).map(|text| self.numbers(node, attribute, text)).transpose()
    }

    /// Refuse values beyond their limit. `what` is their name in the message.
    pub fn plausible(&self, node: Node, what: impl FnOnce() -> String, bound: Bound, values: &[f64]) -> Result<()> {
        bound.problem(values).map_or(Ok(()), |problem| Err(self.error(node, format!("{} {problem}", what()))))
    }

    pub fn placement(&mut self, node: Option<Node>) -> Result<Placement> {
        let Some(node) = node else { return Ok(Placement::IDENTITY) };
        let rpy = self.vector(node, "rpy")?.unwrap_or_default();
        let xyz = self.vector(node, "xyz")?.unwrap_or_default();
        self.plausible(node, || "rpy of origin".into(), ANGLE, &rpy)?;
        self.plausible(node, || "xyz of origin".into(), LENGTH, &xyz)?;
        let mut placement = Placement::from_rpy(rpy, xyz);
        let rounded: [f64; 9] = std::array::from_fn(|k| placement.rotation[(k / 3, k % 3)]);
        if let Some(r) = self.exact(node, "rotation", rounded, [1.0; 9], "rpy")? {
            placement.rotation = Matrix3::from_row_slice(&r);
        }
        Ok(placement)
    }

    /// Read the exact numbers that armlet's writer adds to a file, because the standard numbers of URDF are rounded. The exact numbers are
    /// used if they agree with the rounded numbers, relative to `scales`. The tolerance of 1e-9 covers the rounding error of the angles of
    /// a rotation at a pitch of 90 degrees.
    pub fn exact<const N: usize>(
        &mut self,
        node: Node,
        attribute: &str,
        rounded: [f64; N],
        scales: [f64; N],
        standard: &str,
    ) -> Result<Option<[f64; N]>> {
        let Some(text) = node.attribute(attribute) else { return Ok(None) };
        let given = self.numbers::<N>(node, attribute, text)?;
        if (0..N).all(|k| (given[k] - rounded[k]).abs() <= 1e-9 * scales[k]) {
            return Ok(Some(given));
        }
        self.warn(node, format!("{attribute} of {} differs from its {standard}: ignored", node.tag_name().name()));
        Ok(None)
    }

    /// Return the children of a node with these names. Each name may occur once. Other children are counted as ignored.
    pub fn children<'a, 'i, const N: usize>(&mut self, node: Node<'a, 'i>, names: [&str; N]) -> Result<[Option<Node<'a, 'i>>; N]> {
        let mut found = [None; N];
        for child in node.children().filter(Node::is_element) {
            match names.iter().position(|name| *name == child.tag_name().name()) {
                _ if is_xacro(child) => self.drop_xacro(child),
                None => self.drop(child),
                Some(k) if found[k].is_some() => {
                    return Err(self.error(child, format!("{} has a second {}", node.tag_name().name(), names[k])));
                }
                Some(k) => found[k] = Some(child),
            }
        }
        Ok(found)
    }
}

/// Whether a text contains an expression that xacro should have replaced.
pub fn left_over(text: &str) -> bool {
    text.contains("${") || text.contains("$(")
}

/// Return a word of the file, shortened for a message.
pub fn shortened(word: &str) -> String {
    let cut: String = word.chars().take(40).collect();
    if cut.len() < word.len() { format!("{cut}...") } else { cut }
}
