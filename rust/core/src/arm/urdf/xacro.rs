//! Elements of xacro that remain in a file.
//!
//! A directive of xacro shows that xacro has not run. The file is then refused, with the advice to run xacro. Any other element is the call
//! of a macro that the file does not define. xacro cannot expand it either. It is ignored where it cannot change a link or a joint that
//! the file states.

use super::declaration::{UNDECLARED, is_xacro, xacro_name};
use super::element::Reader;
use super::source::XACRO;
use crate::error::Result;
use roxmltree::Node;

/// The directives of xacro.
const DIRECTIVES: [&str; 11] =
    ["arg", "attribute", "call", "element", "if", "include", "insert_block", "macro", "once", "property", "unless"];

impl Reader<'_> {
    /// Handle an element of xacro among the links and joints of a robot.
    pub fn leftover(&mut self, node: Node) -> Result<()> {
        if DIRECTIVES.contains(&xacro_name(node)) {
            return Err(self.error(node, format!("holds the xacro element {}{XACRO}", xacro_name(node))));
        }
        self.drop_xacro(node);
        Ok(())
    }

    /// Refuse elements and attributes of xacro in a link or joint, where armlet reads the element around them.
    pub fn leftovers(&self, node: Node) -> Result<()> {
        for inner in node.descendants() {
            if let Some(attribute) = inner.attributes().find(|attribute| attribute.name().starts_with(UNDECLARED)) {
                return Err(self.error(inner, format!("holds the xacro attribute {}{XACRO}", &attribute.name()[UNDECLARED.len()..])));
            }
            if !is_xacro(inner) || inner.ancestors().skip(1).take_while(|outer| *outer != node).any(is_unread) || is_extra(inner, node) {
                continue;
            }
            let advice = if DIRECTIVES.contains(&xacro_name(inner)) {
                XACRO
            } else {
                "; xacro did not expand it: remove it, or replace it by what it stands for"
            };
            return Err(self.error(inner, format!("holds the xacro element {}{advice}", xacro_name(inner))));
        }
        Ok(())
    }
}

/// Whether armlet ignores an element and everything inside it.
fn is_unread(node: Node) -> bool {
    !["inertial", "origin", "mass", "inertia", "parent", "child", "axis", "limit", "dynamics", "mimic"].contains(&node.tag_name().name())
}

/// Whether an element of xacro is the call of an unknown macro in a link that has its inertia.
fn is_extra(node: Node, link: Node) -> bool {
    let has_inertia = link.tag_name().name() == "link" && link.children().any(|child| child.has_tag_name("inertial"));
    has_inertia && node.parent() == Some(link) && !DIRECTIVES.contains(&xacro_name(node))
}
