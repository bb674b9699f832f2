//! External text, such as names from files, as a safe comment in C.

/// Return the text as one line for a C comment. The text cannot end the comment, begin another comment or continue it on the next line.
///
/// A space separates the characters of `*/`, `/*` and `??`. A question mark replaces each backslash. It also replaces all characters except
/// letters, digits, ASCII signs and spaces.
pub fn comment(text: &str) -> String {
    let mut safe = String::with_capacity(text.len());
    let mut last = ' ';
    for c in text.chars() {
        let c = if c == ' ' || c.is_alphanumeric() || (c.is_ascii_graphic() && c != '\\') { c } else { '?' };
        if matches!((last, c), ('*', '/') | ('/', '*') | ('?', '?')) {
            safe.push(' ');
        }
        safe.push(c);
        last = c;
    }
    safe
}

#[cfg(test)]
mod tests {
    use super::comment;

    #[test]
    fn a_comment_keeps_names_and_parts_what_is_code() {
        for name in ["", "link1", "tool0 (left)", "arm/link-2", "Größe", "a*b?"] {
            assert_eq!(comment(name), name);
        }
        for (name, safe) in [
            ("a*/b", "a* /b"),
            ("a/*b", "a/ *b"),
            ("/*/", "/ * /"),
            ("a\\", "a?"),
            ("???/", "? ? ?/"),
            ("a\n\tb", "a? ?b"),
            ("\u{202e}\u{2028}\u{0}*/", "? ? ?* /"),
        ] {
            assert_eq!(comment(name), safe);
            assert_eq!(comment(safe), safe, "twice is as once");
        }
    }
}
