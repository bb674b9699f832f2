//! Corrections of files that are not well-formed, but that other URDF readers accept. In some files, an XML declaration follows a blank
//! line or a comment. In others, a name has an undeclared prefix, such as `drake:acceleration` or `xacro:sensor`.

use roxmltree::Node;
use std::borrow::Cow;

/// The undeclared prefix of xacro, after [`without_prefix`].
pub const UNDECLARED: &str = "xacro.";

/// Whether an element has the prefix of xacro, declared or not.
pub fn is_xacro(node: Node) -> bool {
    node.tag_name().namespace().is_some_and(|namespace| namespace.contains("xacro")) || node.tag_name().name().starts_with(UNDECLARED)
}

/// The name of an element of xacro, without its prefix.
pub fn xacro_name<'a>(node: Node<'a, '_>) -> &'a str {
    let name = node.tag_name().name();
    name.strip_prefix(UNDECLARED).unwrap_or(name)
}

/// Return the text. If an XML declaration follows blanks or comments, replace it by blanks. Lines and columns do not change.
pub fn forgiven(text: &str) -> Cow<'_, str> {
    let Some(start) = late(text) else { return Cow::Borrowed(text) };
    let Some(length) = text[start..].find("?>") else { return Cow::Borrowed(text) };
    let end = start + length + 2;
    let blank: String = text[start..end].chars().map(|c| if c == '\n' { '\n' } else { ' ' }).collect();
    Cow::Owned([&text[..start], &blank, &text[end..]].concat())
}

/// Return the position of an XML declaration that follows blanks or comments.
fn late(text: &str) -> Option<usize> {
    let mut remaining = text.trim_start_matches('\u{feff}');
    let first = text.len() - remaining.len();
    loop {
        remaining = remaining.trim_start();
        let at = text.len() - remaining.len();
        if let Some(comment) = remaining.strip_prefix("<!--") {
            remaining = &comment[comment.find("-->")? + 3..];
        } else {
            let declares = remaining.strip_prefix("<?xml").is_some_and(|after| after.starts_with(char::is_whitespace));
            return (declares && at > first).then_some(at);
        }
    }
}

/// Return the text with `.` instead of `:` in the names of elements and attributes with this prefix. URDF has no names with a dot, so the
/// reader ignores these elements and attributes. Lines and columns do not change.
pub fn without_prefix(text: &str, prefix: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut remaining = text;
    while let Some(start) = remaining.find('<') {
        let (before, markup) = remaining.split_at(start);
        plain.push_str(before);
        let skipped = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")].into_iter().find(|(from, _)| markup.starts_with(from));
        if let Some((_, end)) = skipped {
            let length = markup.find(end).map_or(markup.len(), |at| at + end.len());
            plain.push_str(&markup[..length]);
            remaining = &markup[length..];
            continue;
        }
        remaining = &markup[tag(markup, prefix, &mut plain)..];
    }
    plain.push_str(remaining);
    plain
}

/// Append one tag to `plain`, with `.` instead of `:` after `prefix` in its names, and return the length of the tag.
fn tag(markup: &str, prefix: &str, plain: &mut String) -> usize {
    let (mut quote, mut name, mut colon) = (None, false, usize::MAX);
    for (at, c) in markup.char_indices() {
        // A name begins after `<`, `/` or a blank.
        if name && quote.is_none() && markup[at..].strip_prefix(prefix).is_some_and(|after| after.starts_with(':')) {
            colon = at + prefix.len();
        }
        plain.push(if at == colon { '.' } else { c });
        match quote {
            Some(open) if c == open => quote = None,
            Some(_) => {}
            None if c == '"' || c == '\'' => quote = Some(c),
            None if c == '>' => return at + 1,
            None => {}
        }
        name = c == '<' || c == '/' || c.is_whitespace();
    }
    markup.len()
}
