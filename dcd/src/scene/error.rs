//! Defines the errors of scenes.

use std::path::PathBuf;

use thiserror::Error;

/// The reason why a scene could not be made. Each message names the cause and the remedy.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SceneError {
    /// No scene of the library has this name.
    #[error(
        "there is no scene `{name}`{}; the library has {known}; a scene file's path ends in `.toml`, `.xml`, `.mjcf` or `.urdf`",
        hint(nearest)
    )]
    UnknownScene {
        /// What was asked for.
        name: String,
        /// The name most like it, when one is like it.
        nearest: Option<&'static str>,
        /// All names.
        known: String,
    },
    /// The scene has no such parameter.
    #[error("scene `{scene}` has no parameter `{name}`{}; it has:\n{known}", hint(nearest))]
    UnknownParam {
        /// The scene.
        scene: String,
        /// What was given.
        name: String,
        /// The name most like it, when one is like it.
        nearest: Option<&'static str>,
        /// All parameters with defaults and ranges.
        known: String,
    },
    /// A parameter's value does not fit.
    #[error("scene `{scene}`: `{name}={value}` is not {expected}; the parameters are:\n{known}")]
    BadParam {
        /// The scene.
        scene: String,
        /// The parameter.
        name: String,
        /// What was given.
        value: String,
        /// What would fit.
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
        /// What the system says.
        source: std::io::Error,
    },
    /// The file's content is wrong.
    #[error("{}{}: {cause}; {remedy}", path.display(), at(line))]
    File {
        /// The file.
        path: PathBuf,
        /// Counted from 1, when known.
        line: Option<usize>,
        /// What is wrong.
        cause: String,
        /// What to do about it.
        remedy: String,
    },
}

fn hint(nearest: &Option<&'static str>) -> String {
    nearest.map(|name| format!(" (did you mean `{name}`?)")).unwrap_or_default()
}

fn at(line: &Option<usize>) -> String {
    line.map(|line| format!(":{line}")).unwrap_or_default()
}

/// Returns the name most like the given one, unless none is like it.
pub(crate) fn nearest<'a>(name: &str, known: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let (distance, best) = known.map(|other| (edit_distance(name, other), other)).min()?;
    (distance <= best.len().max(name.len()) / 2).then_some(best)
}

/// Returns Levenshtein's distance: insertions, deletions and replacements of characters.
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
