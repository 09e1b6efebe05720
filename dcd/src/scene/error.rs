//! Defines the error of scenes.

use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// The error of a scene that cannot be made. Each message names the cause and the remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SceneError {
    /// The library has no scene of this name.
    #[error(
        "there is no scene `{name}`{}; the library has {known}; a scene file's path ends in `.toml`, `.xml`, `.mjcf` or `.urdf`",
        hint(nearest)
    )]
    UnknownScene {
        /// The name asked for.
        name: String,
        /// The most similar name, if one is similar.
        nearest: Option<&'static str>,
        /// All names of the library.
        known: String,
    },
    /// The scene has no such parameter.
    #[error("scene `{scene}` has no parameter `{name}`{}; it has:\n{known}", hint(nearest))]
    UnknownParam {
        /// The scene.
        scene: String,
        /// The name of the parameter.
        name: String,
        /// The most similar name, if one is similar.
        nearest: Option<&'static str>,
        /// All parameters with defaults and ranges.
        known: String,
    },
    /// A parameter's value is out of range.
    #[error("scene `{scene}`: `{name}={value}` is not {expected}; the parameters are:\n{known}")]
    BadParam {
        /// The scene.
        scene: String,
        /// The parameter.
        name: String,
        /// The value.
        value: String,
        /// The values that are allowed.
        expected: String,
        /// All parameters with defaults and ranges.
        known: String,
    },
    /// A parameter was not written `name=value`.
    #[error("`{0}` is not a parameter; write `name=value`, for example `n=100`")]
    NotKeyValue(String),
    /// The file cannot be read.
    #[error("cannot read scene file {}: {source}; check the path and its permissions", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The file's content is not a valid scene.
    #[error("{}{}: {cause}; {remedy}", path.display(), at(line))]
    File {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1, if it is known.
        line: Option<usize>,
        /// What is wrong.
        cause: String,
        /// The remedy.
        remedy: String,
    },
}

impl SceneError {
    /// Returns the error of a file that could not be read as text.
    pub(super) fn unreadable(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        if source.kind() != io::ErrorKind::InvalidData {
            return Self::Read { path, source };
        }
        let remedy = "give a scene file; a snapshot is gone on with by `dcd run` or dcd_snapshot_load_file, a recording is replayed \
                      by `dcd replay`";
        Self::File { path, line: None, cause: "it is no text in UTF-8".to_owned(), remedy: remedy.to_owned() }
    }
}

fn hint(nearest: &Option<&'static str>) -> String {
    nearest.map(|name| format!(" (did you mean `{name}`?)")).unwrap_or_default()
}

fn at(line: &Option<usize>) -> String {
    line.map(|line| format!(":{line}")).unwrap_or_default()
}

/// Returns the known name that is most like the given one; `None` if none is like it.
pub(crate) fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let (distance, best) = known.map(|other| (edit_distance(name, other), other)).min()?;
    (distance <= best.len().max(name.len()) / 2).then_some(best)
}

/// Returns Levenshtein's distance of two texts: insertions, deletions and replacements of characters.
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_name_is_found_and_nonsense_has_none() {
        let known = || ["tower", "pile", "gas"].into_iter();
        assert_eq!(nearest("towr", known()), Some("tower"));
        assert_eq!(nearest("pyle", known()), Some("pile"));
        assert_eq!(nearest("xxxxxxxxxx", known()), None);
        assert_eq!(edit_distance("kitten", "sitting"), 3);
    }
}
