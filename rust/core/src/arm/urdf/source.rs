//! The name and the lines of a text, for errors.

use crate::error::Error;

/// A hint for a xacro file, at the end of an error.
pub const XACRO: &str = "; this is a xacro file: load_urdf expands *.xacro, or run `xacro robot.xacro > robot.urdf`";

/// The file name and line starts of a text, for errors.
pub struct Source<'a> {
    file: &'a str,
    starts: Vec<usize>,
}

impl<'a> Source<'a> {
    pub fn new(file: &'a str, text: &str) -> Self {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n').map(|(i, _)| i + 1);
        Source { file, starts: std::iter::once(0).chain(ends).collect() }
    }
    /// Return the line of a byte offset, counted from 1.
    pub fn line(&self, at: usize) -> u32 {
        self.starts.partition_point(|start| *start <= at) as u32
    }
    pub fn error(&self, line: u32, problem: impl Into<String>) -> Error {
        Error::Model { file: self.file.into(), line, problem: problem.into() }
    }
}
