//! Expands `<include>`. MuJoCo puts the children of the included file's root where the element stands,
//! whatever it stands in. Rapier's reader knows `<include>` at the top of a file only.

use std::path::{Path, PathBuf};

use crate::scene::SceneError;
use crate::scene::models::files::Files;
use crate::scene::models::source::{Fault, Source, required};

/// The most bytes of a model's text with all that it includes, and the most files that it includes, each
/// counted as often as it is included.
const MAX_TEXT: usize = 16 << 20;
const MAX_INCLUDED: usize = 4096;
/// The most files in a chain in which each is included by the one before.
const MAX_CHAIN: usize = 64;

/// The files that may be opened, those being expanded, each included by the one before, and how many have
/// been included.
struct Open<'a> {
    files: &'a Files,
    paths: Vec<PathBuf>,
    included: usize,
}

/// Returns the file with everything that it includes.
pub(super) fn flatten(source: &Source, files: &Files) -> Result<Source, SceneError> {
    let mut open = Open { files, paths: vec![source.path.clone()], included: 0 };
    let text = expanded(source, source.folder(), &mut open)?;
    Ok(Source { path: source.path.clone(), text, own_lines: open.included == 0 })
}

fn expanded(source: &Source, main: &Path, open: &mut Open<'_>) -> Result<String, SceneError> {
    let document = source.parsed()?;
    let mut text = String::with_capacity(source.text.len());
    let mut done = 0;
    for node in document.descendants().filter(|node| node.has_tag_name("include")) {
        if node.range().start < done {
            // The file replaces the <include> with all that lies in it.
            continue;
        }
        let file = required(node, "file").map_err(|fault| source.fault(fault))?;
        // MuJoCo takes the path relative to the main file; many models mean the including file.
        let path = [main, source.folder()].map(|folder| folder.join(file));
        let path = path.iter().find(|path| path.is_file()).unwrap_or(&path[0]);
        if open.paths.contains(path) {
            let fault = Fault::at(node, format!("{file} includes itself"), "drop one of the two <include>s");
            return Err(source.fault(fault));
        }
        open.included += 1;
        if open.paths.len() > MAX_CHAIN {
            let cause = format!("more than {MAX_CHAIN} files include one another in a chain");
            return Err(source.fault(Fault::at(node, cause, "include less deep")));
        }
        if open.included > MAX_INCLUDED {
            let cause = format!("more than {MAX_INCLUDED} files are included");
            return Err(source.fault(Fault::at(node, cause, "include less, or less often")));
        }
        open.files.check(path, None).map_err(|fault| source.fault(fault.at_line_of(node)))?;
        let inner = Source::read(path)?;
        open.paths.push(path.clone());
        let inner = expanded(&inner, main, open)?;
        open.paths.pop();
        text.push_str(&source.text[done..node.range().start]);
        text.push_str(content(&inner).map_err(|error| {
            let cause = format!("{file} cannot be put here: {error}");
            source.fault(Fault::at(node, cause, "give it one root, without namespaces"))
        })?);
        if text.len() > MAX_TEXT {
            let cause = "the file and what it includes have more than 16 MiB";
            return Err(source.fault(Fault::at(node, cause, "include less, or less often")));
        }
        done = node.range().end;
    }
    text.push_str(&source.text[done..]);
    Ok(text)
}

/// Returns the text between the root's tags, checked to be valid in another document.
fn content(text: &str) -> Result<&str, roxmltree::Error> {
    let document = roxmltree::Document::parse(text)?;
    let root = document.root_element();
    let ends = root.first_child().zip(root.last_child());
    let content = ends.map_or("", |(first, last)| &text[first.range().start..last.range().end]);
    // The text must be valid without what the root declares.
    roxmltree::Document::parse(&format!("<mujoco>{content}</mujoco>"))?;
    Ok(content)
}
