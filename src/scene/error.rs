//! Why a scene is refused, and where in the file the fault stands.

use std::fmt;
use std::io;

use crate::nets::NetError;

/// A scene that is refused: where and why.
///
/// Prints as `chain.scene.ron:12:40: particles[3].mass is -1.0, expected a finite number > 0`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub struct SceneError {
    /// The file, if the scene was read from one.
    pub file: Option<String>,
    /// The place in the text, if it is known.
    pub position: Option<Position>,
    /// What is wrong there.
    #[source]
    pub reason: SceneErrorReason,
}

/// A place in a text. Prints as `line:column`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Position {
    /// The line, from 1.
    pub line: usize,
    /// The column in characters, from 1.
    pub column: usize,
}

/// What is wrong with a scene.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneErrorReason {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Unreadable(#[source] io::Error),
    /// The file is not text.
    #[error("expected UTF-8 text")]
    NotText,
    /// The text is not the RON of a scene: a missing comma, an unknown field, a wrong type.
    #[error("{}{message}", prefix(path))]
    Malformed {
        /// The field that was being read, such as `particles[3].mass`; empty at the root.
        path: String,
        /// What was expected.
        message: String,
    },
    /// A value is outside its range.
    #[error("{field} is {value}, expected {expected}")]
    OutOfRange {
        /// The field, such as `particles[3].mass`.
        field: String,
        /// The value that was refused, printed.
        value: String,
        /// What would have been accepted.
        expected: String,
    },
    /// Each value of a net is in its range, but together they make no net.
    #[error("{field} cannot be laid out: {source}")]
    Net {
        /// The net, such as `nets[3]`.
        field: String,
        /// Why.
        #[source]
        source: Box<NetError>,
    },
}

impl SceneError {
    /// The same error, with the name of the file it was found in.
    pub fn in_file(mut self, file: impl Into<String>) -> Self {
        self.file = Some(file.into());
        self
    }
}

impl From<SceneErrorReason> for SceneError {
    fn from(reason: SceneErrorReason) -> Self {
        Self { file: None, position: None, reason }
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (&self.file, self.position) {
            (Some(file), Some(position)) => write!(formatter, "{file}:{position}: ")?,
            (Some(file), None) => write!(formatter, "{file}: ")?,
            (None, Some(Position { line, column })) => {
                write!(formatter, "line {line}, column {column}: ")?;
            }
            (None, None) => {}
        }
        write!(formatter, "{}", self.reason)
    }
}

impl fmt::Display for Position {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:{}", self.line, self.column)
    }
}

fn prefix(path: &str) -> String {
    if path.is_empty() { String::new() } else { format!("{path}: ") }
}
