//! Reads a model file as text, and adds path and line to errors.

use std::path::{Path, PathBuf};

use roxmltree::{Document, Node};

use crate::scene::SceneError;
use crate::scene::bounded::read_text;

/// The most elements that may lie in one another. Readers of models recurse once per level, and a robot has
/// some tens.
const MAX_LEVELS: usize = 256;

/// A model file as text.
pub(super) struct Source {
    pub(super) path: PathBuf,
    pub(super) text: String,
    /// Says whether the lines of the text are those of the file. They are not if it includes others.
    pub(super) own_lines: bool,
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
    pub(super) fn at(node: Node<'_, '_>, cause: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self::new(cause, remedy).at_line_of(node)
    }

    pub(super) fn at_line_of(self, node: Node<'_, '_>) -> Self {
        Self { line: Some(line_of(node)), ..self }
    }
}

impl Source {
    pub(super) fn read(path: &Path) -> Result<Self, SceneError> {
        let text = read_text(path).map_err(|source| SceneError::unreadable(path, source))?;
        Ok(Self { path: path.to_owned(), text: without_declaration(text), own_lines: true })
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
        SceneError::File { path: self.path.clone(), line: line.filter(|_| self.own_lines), cause, remedy }
    }

    /// Returns the element's name, or its kind and line.
    pub(super) fn named(&self, node: Node<'_, '_>) -> String {
        let kind = node.tag_name().name();
        match node.attribute("name") {
            Some(name) => name.to_owned(),
            None if self.own_lines => format!("<{kind}> at line {}", line_of(node)),
            None => format!("a <{kind}>"),
        }
    }

    /// Returns the document, whatever its root.
    pub(super) fn parsed(&self) -> Result<Document<'_>, SceneError> {
        parsed(&self.text).map_err(|fault| self.fault(fault))
    }

    /// Returns the document, whose root must have this name.
    pub(super) fn document(&self, root: &str) -> Result<Document<'_>, SceneError> {
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

/// Parses a document, whatever its root.
pub(super) fn parsed(text: &str) -> Result<Document<'_>, Fault> {
    let document = Document::parse(text).map_err(|error| {
        let line = Some(error.pos().row as usize);
        Fault { line, ..Fault::new(format!("this is not XML: {error}"), "correct this line") }
    })?;
    if let Some(node) = too_deep(&document) {
        let cause = format!("more than {MAX_LEVELS} elements lie in one another");
        return Err(Fault::at(node, cause, "nest them less"));
    }
    Ok(document)
}

/// Returns the children that are elements.
pub(super) fn elements<'a, 'd>(node: Node<'a, 'd>) -> impl Iterator<Item = Node<'a, 'd>> {
    node.children().filter(Node::is_element)
}

/// Returns the first child that is an element of this name.
pub(super) fn child<'a, 'd>(node: Node<'a, 'd>, name: &str) -> Option<Node<'a, 'd>> {
    elements(node).find(|child| child.has_tag_name(name))
}

/// Returns the value of an attribute that an element must have.
pub(super) fn required<'a>(node: Node<'a, '_>, attribute: &str) -> Result<&'a str, Fault> {
    node.attribute(attribute).ok_or_else(|| {
        let cause = format!("<{}> without {attribute}", node.tag_name().name());
        Fault::at(node, cause, format!("give it {attribute}=\"..\""))
    })
}

fn line_of(node: Node<'_, '_>) -> usize {
    node.document().text_pos_at(node.range().start).row as usize
}

/// Removes the XML declaration, and zeros and white space at the end. Many files have something before the
/// declaration or end with zeros. XML forbids both, but the readers of such files allow them.
fn without_declaration(mut text: String) -> String {
    text.truncate(text.trim_end_matches(['\0', ' ', '\r', '\n', '\t']).len());
    if let Some(start) = text.find("<?xml")
        && let Some(length) = text[start..].find("?>")
    {
        text.replace_range(start..start + length + 2, "");
    }
    text
}

/// Returns the first element that lies too deep in others.
fn too_deep<'a, 'input>(document: &'a Document<'input>) -> Option<Node<'a, 'input>> {
    // By node; a parent comes before its children.
    let mut levels = Vec::new();
    document.descendants().find(|node| {
        let level = node.parent().map_or(0, |parent: Node<'_, '_>| levels[parent.id().get_usize()] + 1);
        levels.push(level);
        level > MAX_LEVELS
    })
}
