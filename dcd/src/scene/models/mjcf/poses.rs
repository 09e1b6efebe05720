//! Completes the poses of geoms. MuJoCo takes a geom's position from its class if it has none of its own, and its orientation
//! likewise; to Rapier's reader both are one, so that a geom with its own position loses the orientation of its class.

use std::collections::BTreeMap;

use roxmltree::{Attribute, Document, Node};

use crate::scene::models::source::elements;

const POSITION: [&str; 1] = ["pos"];
const ORIENTATION: [&str; 5] = ["quat", "axisangle", "euler", "xyaxes", "zaxis"];

/// Returns the text of the document, in which geoms with one of position and orientation have the other one too.
pub(super) fn complete(document: &Document<'_>) -> String {
    let text = document.input_text();
    let mut whole = String::with_capacity(text.len());
    let mut done = 0;
    for (geom, attribute) in missing(document) {
        let start = geom.range().start;
        let name = text[start..].find([' ', '\t', '\r', '\n', '/', '>']).unwrap_or_default();
        whole.push_str(&text[done..start + name]);
        whole.push(' ');
        whole.push_str(&text[attribute.range()]);
        done = start + name;
    }
    whole.push_str(&text[done..]);
    whole
}

/// Returns geoms that have one of position and orientation, with the attribute of their class that is the other, in the order of
/// the document.
pub(super) fn missing<'a, 'd>(document: &'a Document<'d>) -> Vec<(Node<'a, 'd>, Attribute<'a, 'd>)> {
    let classes = Classes::of(document);
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

fn attribute<'a, 'd>(geom: Node<'a, 'd>, names: &[&str]) -> Option<Attribute<'a, 'd>> {
    geom.attributes().find(|attribute| names.contains(&attribute.name()))
}

/// The classes of `<default>`, by name.
struct Classes<'a, 'd> {
    geoms: BTreeMap<&'a str, Vec<Node<'a, 'd>>>,
    /// The class that each lies in.
    parents: BTreeMap<&'a str, &'a str>,
}

impl<'a, 'd> Classes<'a, 'd> {
    fn of(document: &'a Document<'d>) -> Self {
        let mut classes = Self { geoms: BTreeMap::new(), parents: BTreeMap::new() };
        for default in document.descendants().filter(is_default) {
            let name = name_of(default);
            if let Some(parent) = default.parent().filter(is_default) {
                classes.parents.insert(name, name_of(parent));
            }
            let geoms = elements(default).filter(|node| node.has_tag_name("geom"));
            classes.geoms.entry(name).or_default().extend(geoms);
        }
        classes
    }

    /// Returns the attribute that another geom gives to this one: the last of its class that has it, or of the nearest class around.
    fn inherited(&self, geom: Node<'a, 'd>, names: &[&str]) -> Option<Attribute<'a, 'd>> {
        let mut seen = Vec::new();
        let mut next = Some(class_of(geom));
        while let Some(class) = next.filter(|class| !seen.contains(class)) {
            let mut geoms = self.geoms.get(class).into_iter().flatten().rev().filter(|other| **other != geom);
            if let Some(found) = geoms.find_map(|other| attribute(*other, names)) {
                return Some(found);
            }
            seen.push(class);
            next = self.parents.get(class).copied().or(Some("main"));
        }
        None
    }
}

fn is_default(node: &Node<'_, '_>) -> bool {
    node.has_tag_name("default")
}

/// Returns the name of the class that a `<default>` describes.
fn name_of<'a>(default: Node<'a, '_>) -> &'a str {
    default.ancestors().filter(is_default).find_map(|node| node.attribute("class")).unwrap_or("main")
}

/// Returns the class of a geom: that of the `<default>` that it stands in, its own, or that of the nearest body or frame around.
fn class_of<'a>(geom: Node<'a, '_>) -> &'a str {
    if let Some(default) = geom.parent().filter(is_default) {
        return name_of(default);
    }
    let around = || geom.ancestors().find_map(|node| node.attribute("childclass"));
    geom.attribute("class").or_else(around).unwrap_or("main")
}
