//! Completes the poses of geoms. MuJoCo takes a geom's position from its class if it has none of its own, and
//! its orientation likewise. Rapier's reader takes both as one, so that a geom with its own position loses
//! the orientation of its class.

use std::ops::Range;

use roxmltree::{Attribute, Document, Node};

use super::classes::{Classes, attribute};
use crate::scene::models::source::elements;

const POSITION: [&str; 1] = ["pos"];
const ORIENTATION: [&str; 5] = ["quat", "axisangle", "euler", "xyaxes", "zaxis"];

/// Returns the text of the document changed for the reader. Geoms with one of position and orientation get
/// the other from their class, bodies have no `sleep`, and every `<compiler>` stands before the first
/// `<default>`.
pub(super) fn complete(document: &Document<'_>) -> String {
    let text = document.input_text();
    let inherit = missing(document).into_iter().map(|(geom, attribute)| {
        let start = geom.range().start;
        let name = start + text[start..].find([' ', '\t', '\r', '\n', '/', '>']).unwrap_or_default();
        (name..name, format!(" {}", &text[attribute.range()]))
    });
    let mut edits: Vec<(Range<usize>, String)> = inherit.collect();
    edits.extend(sleepers(document).map(|(_, attribute)| (attribute.range(), String::new())));
    let late = late_compilers(document);
    if let Some(default) = elements(document.root_element()).find(|node| node.has_tag_name("default")) {
        let start = default.range().start;
        edits.push((start..start, late.iter().map(|compiler| &text[compiler.range()]).collect()));
    }
    edits.extend(late.iter().map(|compiler| (compiler.range(), String::new())));
    edits.sort_by_key(|(range, _)| range.start);
    let mut whole = String::with_capacity(text.len());
    let mut done = 0;
    for (range, new) in edits {
        whole.push_str(&text[done..range.start]);
        whole.push_str(&new);
        done = range.end;
    }
    whole.push_str(&text[done..]);
    whole
}

/// Returns the bodies with `sleep`, whose values the reader does not know, each with that attribute.
pub(super) fn sleepers<'a, 'd>(
    document: &'a Document<'d>,
) -> impl Iterator<Item = (Node<'a, 'd>, Attribute<'a, 'd>)> {
    let bodies = document.descendants().filter(|node| node.has_tag_name("body"));
    bodies.filter_map(|body| Some((body, attribute(body, &["sleep"])?)))
}

/// Returns each `<compiler>` behind a `<default>`. MuJoCo reads it first wherever it stands, the reader in
/// document order.
pub(super) fn late_compilers<'a, 'd>(document: &'a Document<'d>) -> Vec<Node<'a, 'd>> {
    let sections = elements(document.root_element()).skip_while(|node| !node.has_tag_name("default"));
    sections.filter(|node| node.has_tag_name("compiler")).collect()
}

/// Returns the geoms with only one of position and orientation whose class gives the other, each with that
/// attribute, in the order of the document.
pub(super) fn missing<'a, 'd>(document: &'a Document<'d>) -> Vec<(Node<'a, 'd>, Attribute<'a, 'd>)> {
    let classes = Classes::of(document, "geom");
    let geoms = document.descendants().filter(|node| node.has_tag_name("geom"));
    let missing = geoms.filter_map(|geom| {
        let inherited = match (attribute(geom, &POSITION), attribute(geom, &ORIENTATION)) {
            (Some(_), None) => classes.inherited(geom, &ORIENTATION),
            (None, Some(_)) => classes.inherited(geom, &POSITION),
            _ => None,
        };
        Some((geom, inherited?))
    });
    missing.collect()
}
