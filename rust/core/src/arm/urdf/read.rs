//! The parser of URDF. It checks size, encoding and nesting. Then it reads XML, the elements (`element`) and the arm
//! (`assemble`).
//!
//! Reading time is linear in the size of the file. The code recurses only for undeclared prefixes, at most eight times. Before parsing, a
//! scan of the text refuses texts that slow the XML parser: many attributes in one tag, many namespaces, deep nesting.

use super::options::UrdfOptions;
use super::source::Source;
use super::{assemble, declaration, element};
use crate::arm::Arm;
use crate::error::{Error, Result};
use crate::interrupt;
use crate::memory;
use std::io::Read;
use std::path::Path;

/// The maximum size of a text, in bytes.
pub const MAX_BYTES: usize = 16 << 20;
/// The maximum nesting depth of elements.
pub const MAX_DEPTH: usize = 100;
/// The approximate memory of an element in bytes: in the document, in the model read from it, and in the arm.
const BYTES_PER_ELEMENT: usize = 1 << 10;
const MAX_ATTRIBUTES: usize = 64;
const MAX_NAMESPACES: usize = 64;
const MAX_NODES: u32 = 1_000_000;
/// The number of undeclared prefixes that a text may use.
const MAX_UNDECLARED: usize = 8;

/// Read a URDF text. The report has no line about the mass matrix: [`Arm::read_urdf`] adds it.
pub(crate) fn read_text(text: &str, file: &str, options: &UrdfOptions) -> Result<Arm> {
    crate::error::finite("gravity", options.gravity.as_ref().map_or(&[], |gravity| &gravity[..]))?;
    let (source, robot) = elements(text, file)?;
    assemble::arm(&source, robot, options)
}

/// Read the URDF file `path` like [`read_text`].
pub(crate) fn read_file(path: &Path, options: &UrdfOptions) -> Result<Arm> {
    let name = path.display().to_string();
    let cannot =
        |e: std::io::Error| Error::input("path_or_xml", format!("cannot be read: expected a URDF file or its text, got {name} ({e})"));
    let mut bytes = Vec::new();
    // Opening a pipe waits for its writer, and a device may have no end.
    if !std::fs::metadata(path).map_err(cannot)?.is_file() {
        return Err(Error::input("path_or_xml", format!("is no regular file: expected a URDF file or its text, got {name}")));
    }
    let file = std::fs::File::open(path).map_err(cannot)?;
    file.take(MAX_BYTES as u64 + 1).read_to_end(&mut bytes).map_err(cannot)?;
    let text = match std::str::from_utf8(&bytes) {
        Ok(text) => text,
        // A character may be cut at the size limit. The error is then about the size, not about the encoding.
        Err(_) if bytes.len() > MAX_BYTES => return Err(Source::new(&name, "").error(1, too_large())),
        Err(e) => {
            let line = 1 + bytes[..e.valid_up_to()].iter().filter(|b| **b == b'\n').count() as u32;
            return Err(Source::new(&name, "").error(line, "is not UTF-8 text: expected a URDF file"));
        }
    };
    read_text(text, &name, options)
}

/// Return the name, the parent link and the child link of each joint of a URDF text. A name that the text does not state is empty. `file`:
/// name for errors. Errors: `Model`, `Memory`.
///
/// ```
/// use armlet_core::arm::{example_urdf, urdf_joints};
///
/// let joints = urdf_joints(example_urdf("planar_2r")?, "planar_2r")?;
/// assert_eq!(joints[0], ("joint1".to_string(), "base".to_string(), "link1".to_string()));
/// # Ok::<(), armlet_core::error::Error>(())
/// ```
pub fn urdf_joints(text: &str, file: &str) -> Result<Vec<(String, String, String)>> {
    let (_, robot) = elements(text, file)?;
    Ok(robot.joints.into_iter().map(|joint| (joint.name, joint.parent, joint.child)).collect())
}

/// Read the elements of a text, after checks of its size and nesting.
fn elements<'a>(text: &str, file: &'a str) -> Result<(Source<'a>, element::Robot)> {
    if text.len() > MAX_BYTES {
        return Err(Source::new(file, "").error(1, too_large()));
    }
    memory::require(text.bytes().filter(|&byte| byte == b'<').count().saturating_mul(BYTES_PER_ELEMENT))?;
    let source = Source::new(file, text);
    scan(&source, text)?;
    let robot = robot(&source, &declaration::forgiven(text), MAX_UNDECLARED)?;
    Ok((source, robot))
}

/// Read the elements of a text. `undeclared`: the number of undeclared prefixes that are still allowed.
fn robot(source: &Source, text: &str, undeclared: usize) -> Result<element::Robot> {
    let parsing = roxmltree::ParsingOptions { nodes_limit: MAX_NODES, ..Default::default() };
    match roxmltree::Document::parse_with_options(text, parsing) {
        Ok(document) => element::read(source, &document),
        Err(roxmltree::Error::UnknownNamespace(prefix, _)) if undeclared > 0 => {
            robot(source, &declaration::without_prefix(text, &prefix), undeclared - 1)
        }
        Err(e) => Err(source.error(e.pos().row, format!("is not well-formed XML: {e}"))),
    }
}

fn too_large() -> String {
    format!("is too large: expected at most {MAX_BYTES} bytes")
}

/// Refuse texts that slow the parser: too many namespaces, attributes in one tag, or nested elements. The scan skips comments and quoted
/// text, except when it counts `xmlns`. The parser reports malformed text.
fn scan(source: &Source, text: &str) -> Result<()> {
    if let Some((at, _)) = text.match_indices("xmlns").nth(MAX_NAMESPACES) {
        return Err(source.error(source.line(at), format!("declares too many namespaces: expected at most {MAX_NAMESPACES}")));
    }
    let bytes = text.as_bytes();
    let (mut i, mut depth) = (0, 0usize);
    while let Some(open) = find(bytes, i, b'<') {
        interrupt::check();
        let markup = &text[open..];
        let skip_to = |end: &str, from: usize| markup[from..].find(end).map_or(bytes.len(), |k| open + from + k + end.len());
        if markup.starts_with("<!--") {
            i = skip_to("-->", 4);
            continue;
        }
        if markup.starts_with("<![CDATA[") {
            i = skip_to("]]>", 9);
            continue;
        }
        if markup.starts_with("<?") {
            i = skip_to("?>", 2);
            continue;
        }
        let (close, attributes) = tag(bytes, open);
        if attributes > MAX_ATTRIBUTES {
            return Err(source.error(source.line(open), format!("has too many attributes: expected at most {MAX_ATTRIBUTES} in one tag")));
        }
        if markup.starts_with("</") {
            depth = depth.saturating_sub(1);
        } else if !markup.starts_with("<!") && bytes.get(close.wrapping_sub(1)) != Some(&b'/') {
            depth += 1;
            if depth > MAX_DEPTH {
                return Err(source.error(source.line(open), format!("is nested too deeply: expected at most {MAX_DEPTH} levels")));
            }
        }
        i = close + 1;
    }
    Ok(())
}

fn find(bytes: &[u8], from: usize, what: u8) -> Option<usize> {
    bytes.get(from..)?.iter().position(|b| *b == what).map(|k| from + k)
}

/// Return the position of the closing bracket of the tag at `open`, and the number of the tag's attributes.
fn tag(bytes: &[u8], open: usize) -> (usize, usize) {
    let (mut quote, mut attributes) = (None, 0);
    for (k, &b) in bytes.iter().enumerate().skip(open + 1) {
        match (quote, b) {
            (None, b'"' | b'\'') => quote = Some(b),
            (None, b'=') => attributes += 1,
            (None, b'>') => return (k, attributes),
            (Some(q), b) if q == b => quote = None,
            _ => {}
        }
    }
    (bytes.len(), attributes)
}
