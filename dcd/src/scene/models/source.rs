//! Reads a model file as text, and adds path and line to errors.

use std::path::{Path, PathBuf};

use crate::scene::SceneError;
use crate::scene::bounded::read_text;

/// How deep elements may lie in one another: readers of models call themselves for each level, and a robot has some tens.
const MAX_LEVELS: usize = 256;

/// A model file as text.
pub(super) struct Source {
    pub(super) path: PathBuf,
    pub(super) text: String,
}

/// An error in a file, before its path is added.
#[derive(Debug)]
pub(super) struct Fault {
    /// Counted from 1, when known.
    pub(super) line: Option<usize>,
    pub(super) cause: String,
    pub(super) remedy: String,
}

impl Fault {
    pub(super) fn new(cause: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self { line: None, cause: cause.into(), remedy: remedy.into() }
    }

    /// Creates an error at a node of the document.
    pub(super) fn at(
        node: roxmltree::Node<'_, '_>,
        cause: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        let line = node.document().text_pos_at(node.range().start).row as usize;
        Self { line: Some(line), ..Self::new(cause, remedy) }
    }
}

impl Source {
    pub(super) fn read(path: &Path) -> Result<Self, SceneError> {
        let text = read_text(path).map_err(|source| SceneError::Read { path: path.to_owned(), source })?;
        Ok(Self { path: path.to_owned(), text: without_declaration(text) })
    }

    pub(super) fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }

    /// Returns the file's name without its extension.
    pub(super) fn stem(&self) -> String {
        self.path.file_stem().unwrap_or_default().to_string_lossy().into_owned()
    }

    pub(super) fn fault(&self, fault: Fault) -> SceneError {
        let Fault { line, cause, remedy } = fault;
        SceneError::File { path: self.path.clone(), line, cause, remedy }
    }

    /// Returns the document, whatever its root.
    pub(super) fn parsed(&self) -> Result<roxmltree::Document<'_>, SceneError> {
        if let Some(line) = too_deep(&self.text) {
            let cause = format!("more than {MAX_LEVELS} elements lie in one another");
            return Err(self.fault(Fault { line: Some(line), cause, remedy: "nest them less".into() }));
        }
        roxmltree::Document::parse(&self.text).map_err(|error| {
            let line = Some(error.pos().row as usize);
            let cause = format!("this is not XML: {error}");
            self.fault(Fault { line, cause, remedy: "correct this line".into() })
        })
    }

    /// Returns the document, whose root must have this name.
    pub(super) fn document(&self, root: &str) -> Result<roxmltree::Document<'_>, SceneError> {
        let document = self.parsed()?;
        let found = document.root_element().tag_name().name();
        if found != root {
            let cause = format!("the file's root is <{found}>, not <{root}>");
            let remedy = "MJCF files (.xml, .mjcf) start with <mujoco>, URDF files (.urdf) with <robot>";
            return Err(self.fault(Fault::at(document.root_element(), cause, remedy)));
        }
        Ok(document)
    }
}

/// Removes the XML declaration, and zeros at the end: many files have something before the one or end with the others, which XML
/// forbids and their own readers allow.
fn without_declaration(mut text: String) -> String {
    text.truncate(text.trim_end_matches(['\0', ' ', '\r', '\n', '\t']).len());
    if let Some(start) = text.find("<?xml")
        && let Some(length) = text[start..].find("?>")
    {
        text.replace_range(start..start + length + 2, "");
    }
    text
}

/// Returns the line in which elements lie too deep in one another. It counts tags without parsing, as parsers call themselves too;
/// what looks like a tag in comments, and so counts for one, is balanced as a rule.
fn too_deep(text: &str) -> Option<usize> {
    let (mut level, mut line) = (0_usize, 1);
    let mut bytes = text.bytes().peekable();
    let mut before = b' ';
    while let Some(byte) = bytes.next() {
        match (byte, bytes.peek()) {
            (b'<', Some(b'/')) => level = level.saturating_sub(1),
            (b'<', Some(next)) if next.is_ascii_alphabetic() => {
                level += 1;
                if level > MAX_LEVELS {
                    return Some(line);
                }
            }
            (b'>', _) if before == b'/' => level = level.saturating_sub(1),
            (b'\n', _) => line += 1,
            _ => {}
        }
        before = byte;
    }
    None
}
