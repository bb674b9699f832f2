//! Files that are not well-formed, but that other readers of URDF accept. In some, an XML declaration follows a blank line or a comment. In
//! others, a name has an undeclared prefix, such as `drake:acceleration`.

use std::borrow::Cow;

/// The text with such a declaration replaced by blanks. Every line and column is kept.
pub fn forgiven(text: &str) -> Cow<'_, str> {
    let Some(start) = late(text) else { return Cow::Borrowed(text) };
    let Some(length) = text[start..].find("?>") else { return Cow::Borrowed(text) };
    let end = start + length + 2;
    let blank: String = text[start..end].chars().map(|c| if c == '\n' { '\n' } else { ' ' }).collect();
    Cow::Owned([&text[..start], &blank, &text[end..]].concat())
}

/// The position of a declaration after blanks or comments.
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

/// The text with `.` instead of `:` in the names of elements and attributes with this prefix. Every line and column is kept. Such names are
/// not part of URDF in either form.
pub fn without_prefix(text: &str, prefix: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find('<') {
        let (before, markup) = rest.split_at(start);
        plain.push_str(before);
        let skipped = [("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>")].into_iter().find(|(from, _)| markup.starts_with(from));
        if let Some((_, end)) = skipped {
            let length = markup.find(end).map_or(markup.len(), |at| at + end.len());
            plain.push_str(&markup[..length]);
            rest = &markup[length..];
            continue;
        }
        rest = &markup[tag(markup, prefix, &mut plain)..];
    }
    plain.push_str(rest);
    plain
}

/// Copy one tag; returns its length.
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
