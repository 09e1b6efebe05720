//! Expands `<include>`: MuJoCo puts the children of the included file's root where the element stands, whatever it stands in.
//! Rapier's reader knows it at the top of a file only.

use std::path::{Path, PathBuf};

use crate::scene::SceneError;
use crate::scene::models::source::{Fault, Source};

/// Returns the file with everything that it includes; its lines are its own if it includes nothing.
pub(super) fn flatten(source: &Source) -> Result<Source, SceneError> {
    let mut open = vec![source.path.clone()];
    let text = expanded(source, source.folder(), &mut open)?;
    Ok(Source { path: source.path.clone(), text })
}

fn expanded(source: &Source, main: &Path, open: &mut Vec<PathBuf>) -> Result<String, SceneError> {
    let document = roxmltree::Document::parse(&source.text).map_err(|error| {
        let line = Some(error.pos().row as usize);
        let cause = format!("this is not XML: {error}");
        source.fault(Fault { line, cause, remedy: "correct this line".into() })
    })?;
    let mut text = String::with_capacity(source.text.len());
    let mut done = 0;
    for node in document.descendants().filter(|node| node.has_tag_name("include")) {
        let Some(file) = node.attribute("file") else {
            let fault = Fault::at(node, "<include> without a file", "give it file=\"..\"");
            return Err(source.fault(fault));
        };
        // Relative to the main file as MuJoCo has it, or to the including file as many have it.
        let path = [main, source.folder()].map(|folder| folder.join(file));
        let path = path.iter().find(|path| path.is_file()).unwrap_or(&path[0]);
        if open.contains(path) {
            let fault = Fault::at(node, format!("{file} includes itself"), "drop one of the two <include>s");
            return Err(source.fault(fault));
        }
        let inner = Source::read(path)?;
        open.push(path.clone());
        let inner = expanded(&inner, main, open)?;
        open.pop();
        text.push_str(&source.text[done..node.range().start]);
        text.push_str(&content(&inner));
        done = node.range().end;
    }
    text.push_str(&source.text[done..]);
    Ok(text)
}

/// Returns the text between the root's tags.
fn content(text: &str) -> String {
    let document = roxmltree::Document::parse(text).expect("it was parsed before it was expanded");
    let root = document.root_element();
    let start = root.first_child().map(|child| child.range().start);
    let end = root.last_child().map(|child| child.range().end);
    start.zip(end).map_or(String::new(), |(start, end)| text[start..end].to_owned())
}
