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
    /// Found here, in all of the part or in what lies in this range of bytes of the file.
    Wrong { cause: String, remedy: String, at: Option<Range<usize>> },
    /// Reported by the library that the file starts from.
    Scene(Box<SceneError>),
}

impl Fault {
    pub(super) fn new(cause: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::Wrong { cause: cause.into(), remedy: remedy.into(), at: None }
    }

    /// Says where in a part this was found, if that is not known more closely.
    pub(super) fn within(self, span: Range<usize>) -> Self {
        match self {
            Self::Wrong { cause, remedy, at } => Self::Wrong { cause, remedy, at: at.or(Some(span)) },
            other => other,
        }
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
        let (cause, remedy, at) = match fault {
            Fault::Wrong { cause, remedy, at } => (cause, remedy, at),
            Fault::Scene(error) => {
                (error.to_string(), "correct the [library] table or the parameters".to_owned(), None)
            }
        };
        SceneError::File {
            path: self.path.to_owned(),
            line: at.or(span).map(|span| self.line(span.start)),
            cause,
            remedy,
        }
    }

    /// Converts an error of the TOML reader: its messages name unknown keys and the known ones, and here that of a wrong value.
    pub(super) fn syntax(&self, error: &toml::de::Error) -> SceneError {
        let mut cause = error.message().trim().replace('\n', ", ");
        let is_of_a_value = cause.contains(" is not ")
            || cause.starts_with("invalid ")
            || cause.starts_with("unknown variant");
        if is_of_a_value && let Some(key) = error.span().and_then(|span| self.key_of(span.start)) {
            cause = format!("`{key}`: {cause}");
        }
        let remedy = if cause.starts_with("unknown field") {
            "correct the key (all keys stand in dcd/scenes/README.md, which `dcd scenes --format` prints)"
        } else {
            "correct this line (the format stands in dcd/scenes/README.md, which `dcd scenes --format` prints)"
        };
        self.error(error.span(), Fault::new(cause, remedy))
    }

    /// Returns the key of the value in which this byte lies.
    fn key_of(&self, offset: usize) -> Option<&str> {
        let (before, _) = self.text.get(..offset)?.rsplit_once('=')?;
        let key = before.trim_end().rsplit(|c: char| c.is_whitespace() || "{,".contains(c)).next()?;
        (!key.is_empty()).then_some(key)
    }

    fn line(&self, offset: usize) -> usize {
        self.text.as_bytes()[..offset.min(self.text.len())].iter().filter(|byte| **byte == b'\n').count() + 1
    }
}
