//! Checks the models that a file attaches. Rapier's reader opens them itself, whatever they are. What it
//! cannot read it leaves out, with a line in a log. So each model is read here first, within bounds, and
//! refused by name.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use rapier3d_mjcf::mjcf_rs as mjcf;
use roxmltree::{Document, Node};

use super::scan::{self, Flags};
use super::{fault, poses};
use crate::scene::SceneError;
use crate::scene::models::files::{Files, canonical};
use crate::scene::models::source::{Fault, Source, required};
use crate::scene::models::warnings::Warnings;

/// The most bytes of a model with all that it attaches, each counted as often as it is attached.
const MAX_TEXT: usize = 16 << 20;
/// The most models in a chain in which each is attached by the one before.
const MAX_CHAIN: usize = 64;

/// The chain of files that are being read, each attached by the one before, and the files that may be opened.
struct Open<'a> {
    files: &'a Files,
    chain: Vec<PathBuf>,
}

/// A model that a file attaches.
struct Attachable {
    file: mjcf::Model,
    flags: Flags,
    /// The bytes of its text, with all that it attaches.
    bytes: usize,
}

/// Checks the models that the file attaches, and those that they attach, and adds their flags to the file's.
pub(super) fn check(
    source: &Source,
    document: &Document<'_>,
    files: &Files,
    flags: &mut Flags,
    warnings: &mut Warnings,
) -> Result<(), SceneError> {
    let mut open = Open { files, chain: vec![canonical(&source.path)] };
    attached(source, document, flags, warnings, &mut open).map(drop)
}

/// Checks the models that a file attaches, and returns the bytes of the file with all that it attaches.
fn attached(
    source: &Source,
    document: &Document<'_>,
    flags: &mut Flags,
    warnings: &mut Warnings,
    open: &mut Open<'_>,
) -> Result<usize, SceneError> {
    let mut bytes = source.text.len();
    let mut grow = |node: Node<'_, '_>, by: usize| {
        bytes += by;
        let cause = "the file and what it attaches have more than 16 MiB";
        let fault = || source.fault(Fault::at(node, cause, "attach less, or less often"));
        if bytes > MAX_TEXT { Err(fault()) } else { Ok(()) }
    };
    let mut models = BTreeMap::new();
    for node in document.descendants().filter(is_model) {
        let attribute = |name| required(node, name).map_err(|fault| source.fault(fault));
        let (name, file) = (attribute("name")?, attribute("file")?);
        let path = source.folder().join(file);
        let own = canonical(&path);
        if open.chain.contains(&own) {
            let fault = Fault::at(node, format!("{file} attaches itself"), "drop one of the two <model>s");
            return Err(source.fault(fault));
        }
        if open.chain.len() > MAX_CHAIN {
            let cause = format!("more than {MAX_CHAIN} files attach one another in a chain");
            return Err(source.fault(Fault::at(node, cause, "attach less deep")));
        }
        open.files.check(&path, None).map_err(|fault| source.fault(fault.at_line_of(node)))?;
        open.chain.push(own);
        let model = read(&path, warnings, open)?;
        open.chain.pop();
        grow(node, model.bytes)?;
        models.insert(name, model);
    }
    for node in document.descendants().filter(|node| node.has_tag_name("attach")) {
        let attribute = |name| required(node, name).map_err(|fault| source.fault(fault));
        let (name, body) = (attribute("model")?, attribute("body")?);
        let Some(model) = models.get(name) else {
            let cause = format!("<attach> of model `{name}`, which <asset> does not have");
            return Err(source.fault(Fault::at(
                node,
                cause,
                "add the model to <asset>, or correct its name",
            )));
        };
        if model.file.body_id_by_name(body).is_none() {
            let cause = format!("<attach> of body `{body}`, which model `{name}` does not have");
            return Err(source.fault(Fault::at(node, cause, "correct the name of the body")));
        }
        grow(node, model.bytes)?;
        let prefix = node.attribute("prefix").unwrap_or_default();
        let here = |name: &String| format!("{prefix}{name}");
        flags.convex.extend(model.flags.convex.iter().map(here));
        let bodies = model.file.bodies.iter().filter_map(|entry| entry.body.name.as_ref());
        flags.attached.extend(bodies.chain(&model.flags.attached).map(here));
    }
    Ok(bytes)
}

/// Reads a model that is to be attached. Rapier's reader will read the same text: it cannot be changed
/// before.
fn read(path: &Path, warnings: &mut Warnings, open: &mut Open<'_>) -> Result<Attachable, SceneError> {
    let source = Source::read(path)?;
    let document = source.document("mujoco")?;
    if let Some(node) = document.descendants().find(|node| node.has_tag_name("include")) {
        let cause = "<include> in a model that is attached cannot be read";
        return Err(source.fault(Fault::at(node, cause, "write the content of the file in its place")));
    }
    let mut flags = scan::check(&source, &document, warnings).map_err(|fault| source.fault(fault))?;
    if let Some((geom, attribute)) = poses::missing(&document).first() {
        let cause = format!("{} of a geom's class, in a model that is attached, is lost", attribute.name());
        let remedy = format!("write {}=\"{}\" into the geom", attribute.name(), attribute.value());
        return Err(source.fault(Fault::at(*geom, cause, remedy)));
    }
    // In the file itself the text is changed for these; in a model that it attaches it cannot be.
    if let Some((body, _)) = poses::sleepers(&document).next() {
        let cause = "`sleep` of a body, in a model that is attached, cannot be read";
        return Err(source.fault(Fault::at(body, cause, "take it out")));
    }
    if let Some(compiler) = poses::late_compilers(&document).first() {
        let cause = "<compiler> behind <default>, in a model that is attached, comes too late";
        return Err(source.fault(Fault::at(*compiler, cause, "write it first")));
    }
    let bytes = attached(&source, &document, &mut flags, warnings, open)?;
    let file = mjcf::Model::from_file(path).map_err(|error| source.fault(fault(&error)))?;
    Ok(Attachable { file, flags, bytes })
}

fn is_model(node: &Node<'_, '_>) -> bool {
    node.has_tag_name("model") && node.parent().is_some_and(|parent| parent.has_tag_name("asset"))
}
