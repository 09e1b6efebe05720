//! Locates errors in a scene file: adds path and line to them.

use std::ops::Range;
use std::path::Path;

use toml::Spanned;

use crate::scene::SceneError;

/// A scene file's text and its name for errors.
pub(super) struct Source<'a> {
    pub(super) path: &'a Path,
    pub(super) text: &'a str,
}

/// An error in a part of a file, before its line is known.
#[derive(Debug)]
pub(super) enum Fault {
    /// Found here.
    Wrong { cause: String, remedy: String },
    /// Reported by the library that the file starts from.
    Scene(Box<SceneError>),
}

impl Fault {
    pub(super) fn new(cause: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Wrong { cause: cause.into(), remedy: remedy.into() }
    }
}

impl Source<'_> {
    /// Returns the file's name without `.toml`.
    pub(super) fn stem(&self) -> String {
        self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    /// Reads a part, and adds its line to an error.
    pub(super) fn locate<T, U>(
        &self,
        part: &Spanned<T>,
        read: impl FnOnce(&T) -> Result<U, Fault>,
    ) -> Result<U, SceneError> {
        read(part.get_ref()).map_err(|fault| self.error(Some(part.span()), fault))
    }

    pub(super) fn error(&self, span: Option<Range<usize>>, fault: Fault) -> SceneError {
        let (cause, remedy) = match fault {
            Fault::Wrong { cause, remedy } => (cause, remedy),
            Fault::Scene(error) => {
                (error.to_string(), "correct the [library] table or the parameters".to_owned())
            }
        };
        SceneError::File {
            path: self.path.to_owned(),
            line: span.map(|span| self.line(span.start)),
            cause,
            remedy,
        }
    }

    /// Converts an error of the TOML reader: its messages name unknown keys and the known ones.
    pub(super) fn syntax(&self, error: &toml::de::Error) -> SceneError {
        let cause = error.message().trim().replace('\n', ", ");
        let remedy = if cause.starts_with("unknown field") {
            "correct the key (all keys stand in dcd/scenes/README.md)"
        } else {
            "correct this line (the format stands in dcd/scenes/README.md)"
        };
        self.error(error.span(), Fault::new(cause, remedy))
    }

    fn line(&self, offset: usize) -> usize {
        self.text.as_bytes()[..offset.min(self.text.len())].iter().filter(|byte| **byte == b'\n').count() + 1
    }
}
