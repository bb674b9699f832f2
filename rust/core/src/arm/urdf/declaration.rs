//! An XML declaration after a blank line or a comment: not well-formed, written by hand, and taken by other readers of URDF.

use std::borrow::Cow;

/// The text with such a declaration turned into blanks, which keeps every line and column.
pub fn forgiven(text: &str) -> Cow<'_, str> {
    let Some(start) = late(text) else { return Cow::Borrowed(text) };
    let Some(length) = text[start..].find("?>") else { return Cow::Borrowed(text) };
    let end = start + length + 2;
    let blank: String = text[start..end].chars().map(|c| if c == '\n' { '\n' } else { ' ' }).collect();
    Cow::Owned([&text[..start], &blank, &text[end..]].concat())
}

/// The position of a declaration with only blanks or comments before it.
fn late(text: &str) -> Option<usize> {
    let mut rest = text.trim_start_matches('\u{feff}');
    let first = text.len() - rest.len();
    loop {
        rest = rest.trim_start();
        let at = text.len() - rest.len();
        if let Some(comment) = rest.strip_prefix("<!--") {
            rest = &comment[comment.find("-->")? + 3..];
        } else {
            let declares = rest.strip_prefix("<?xml").is_some_and(|after| after.starts_with(char::is_whitespace));
            return (declares && at > first).then_some(at);
        }
    }
}
