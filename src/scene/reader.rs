//! From RON text to a scene, and back.

use std::fmt;

use ron::Options;
use ron::error::SpannedError;
use ron::extensions::Extensions;
use ron::ser::PrettyConfig;
use serde::de::{DeserializeSeed, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};

use super::description::MassSpringScene;
use super::error::{Position, SceneError, SceneErrorReason};
use super::validate::{Path, Step};

impl MassSpringScene {
    /// Reads a scene from RON text and checks every value of it.
    ///
    /// # Errors
    /// The first fault: its line and column, its field, and what was expected.
    pub fn from_ron(text: &str) -> Result<Self, SceneError> {
        let scene = parse(text)?;
        scene
            .first_fault()
            .map_err(|fault| SceneError { position: locate(text, &fault.path), ..fault.reason.into() })?;
        Ok(scene)
    }

    /// Reads a scene from a file and checks every value of it.
    ///
    /// # Errors
    /// If the file cannot be read; else as [`from_ron`](Self::from_ron), with the file's name.
    pub fn read(path: impl AsRef<std::path::Path>) -> Result<Self, SceneError> {
        let path = path.as_ref();
        std::fs::read(path)
            .map_err(|error| SceneErrorReason::Unreadable(error).into())
            .and_then(|bytes| Self::from_bytes(&bytes))
            .map_err(|error| error.in_file(path.display().to_string()))
    }

    pub(super) fn from_bytes(bytes: &[u8]) -> Result<Self, SceneError> {
        let text = std::str::from_utf8(bytes).map_err(|error| {
            let valid = String::from_utf8_lossy(&bytes[..error.valid_up_to()]);
            SceneError { position: Some(end_of(&valid)), ..SceneErrorReason::NotText.into() }
        })?;
        Self::from_ron(text)
    }

    /// Writes the scene as RON text, which [`from_ron`](Self::from_ron) reads back to the same scene.
    pub fn to_ron(&self) -> String {
        options()
            .to_string_pretty(self, PrettyConfig::new().depth_limit(2))
            .expect("numbers, lists and structs are always written")
    }
}

/// `rest_length: 0.1` is read without a `Some(..)` around it.
fn options() -> Options {
    Options::default().with_default_extension(Extensions::IMPLICIT_SOME)
}

fn parse(text: &str) -> Result<MassSpringScene, SceneError> {
    let malformed = |error: SpannedError, path: String| {
        // What serde_path_to_error prints for the root, and where the name of a field was not read.
        let path = path.trim_end_matches("?").trim_end_matches('.').to_owned();
        let SpannedError { code, span } = error;
        let position = Position { line: span.end.line, column: span.end.col };
        let message = match code {
            ron::Error::IntegerOutOfBounds => "Expected a whole number from 0 to 4294967295".to_owned(),
            code => code.to_string(),
        };
        let reason = SceneErrorReason::Malformed { path, message };
        SceneError { file: None, position: Some(position), reason }
    };
    let mut deserializer = ron::Deserializer::from_str_with_options(text, &options())
        .map_err(|error| malformed(error, String::new()))?;
    let scene = serde_path_to_error::deserialize(&mut deserializer).map_err(|error| {
        let path = error.path().to_string();
        malformed(deserializer.span_error(error.into_inner()), path)
    })?;
    deserializer.end().map_err(|error| malformed(deserializer.span_error(error), String::new()))?;
    Ok(scene)
}

/// The place where the value at `path` begins in `text`, which has been parsed before; for a field
/// that is not written there, the place where its parent begins.
///
/// Serde returns values without their positions, so the text is read a second time, up to the value in
/// question: the error of a RON reader contains the position where it stopped.
fn locate(text: &str, path: &Path) -> Option<Position> {
    (0..=path.0.len()).rev().find_map(|depth| {
        let stopped = options().from_str_seed(text, Stop { path: &path.0[..depth] }).err()?;
        let reached = stopped.code == ron::Error::custom(Stop::REACHED);
        reached.then_some(Position { line: stopped.span.end.line, column: stopped.span.end.col })
    })
}

/// Reads along a path, ignoring all other values, and fails at the end of the path.
#[derive(Clone, Copy)]
struct Stop<'path> {
    path: &'path [Step],
}

impl Stop<'_> {
    const REACHED: &'static str = "reached";
}

impl<'de> DeserializeSeed<'de> for Stop<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        if self.path.is_empty() {
            return Err(D::Error::custom(Self::REACHED));
        }
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Stop<'_> {
    type Value = ();

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "a struct or a list")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        while let Some(FieldName(name)) = map.next_key()? {
            if self.path.first().is_some_and(|step| matches!(step, Step::Field(field) if *field == name)) {
                map.next_value_seed(Stop { path: &self.path[1..] })?;
            } else {
                map.next_value::<IgnoredAny>()?;
            }
        }
        Ok(())
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut sequence: A) -> Result<(), A::Error> {
        if let Some(&Step::Index(index)) = self.path.first() {
            for _ in 0..index {
                sequence.next_element::<IgnoredAny>()?;
            }
            sequence.next_element_seed(Stop { path: &self.path[1..] })?;
        }
        while sequence.next_element::<IgnoredAny>()?.is_some() {}
        Ok(())
    }
}

/// The name of a field. RON reads it only where an identifier is asked for.
struct FieldName(String);

impl<'de> Deserialize<'de> for FieldName {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct NameVisitor;

        impl Visitor<'_> for NameVisitor {
            type Value = FieldName;

            fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(formatter, "the name of a field")
            }

            fn visit_str<E: Error>(self, name: &str) -> Result<FieldName, E> {
                Ok(FieldName(name.to_owned()))
            }
        }

        deserializer.deserialize_identifier(NameVisitor)
    }
}

fn end_of(text: &str) -> Position {
    let last_line = text.rsplit('\n').next().unwrap_or_default();
    Position { line: 1 + text.matches('\n').count(), column: 1 + last_line.chars().count() }
}
