//! Finds what elements inherit from the classes of `<default>`.

use std::collections::BTreeMap;

use roxmltree::{Attribute, Document, Node};

use crate::scene::models::source::elements;

/// Returns the first attribute of an element that has one of these names.
pub(super) fn attribute<'a, 'd>(node: Node<'a, 'd>, names: &[&str]) -> Option<Attribute<'a, 'd>> {
    node.attributes().find(|attribute| names.contains(&attribute.name()))
}

/// The classes of `<default>` by name, and what they say of one kind of element.
pub(super) struct Classes<'a, 'd> {
    known: BTreeMap<&'a str, Vec<Node<'a, 'd>>>,
    /// The class that each class lies in.
    parents: BTreeMap<&'a str, &'a str>,
}

impl<'a, 'd> Classes<'a, 'd> {
    /// Collects what classes say of elements of this tag.
    pub(super) fn of(document: &'a Document<'d>, tag: &str) -> Self {
        let mut classes = Self { known: BTreeMap::new(), parents: BTreeMap::new() };
        for default in document.descendants().filter(is_default) {
            let name = name_of(default);
            if let Some(parent) = default.parent().filter(is_default) {
                classes.parents.insert(name, name_of(parent));
            }
            let known = elements(default).filter(|node| node.has_tag_name(tag));
            classes.known.entry(name).or_default().extend(known);
        }
        classes
    }

    /// Returns the attribute that an element inherits: that of the last other element of its class that has
    /// one, else of the nearest class around.
    pub(super) fn inherited(&self, node: Node<'a, 'd>, names: &[&str]) -> Option<Attribute<'a, 'd>> {
        let mut seen = Vec::new();
        let mut next = Some(class_of(node));
        while let Some(class) = next.filter(|class| !seen.contains(class)) {
            let mut others =
                self.known.get(class).into_iter().flatten().rev().filter(|other| **other != node);
            if let Some(found) = others.find_map(|other| attribute(*other, names)) {
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

/// Returns the class of an element: that of the `<default>` in which it stands, else its own, else that of
/// the nearest body or frame around it.
fn class_of<'a>(node: Node<'a, '_>) -> &'a str {
    if let Some(default) = node.parent().filter(is_default) {
        return name_of(default);
    }
    let around = || node.ancestors().find_map(|node| node.attribute("childclass"));
    node.attribute("class").or_else(around).unwrap_or("main")
}
