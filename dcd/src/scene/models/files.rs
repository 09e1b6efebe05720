//! Restricts a model to the files of its own folder: a model from elsewhere could name any other file.

use std::path::{Path, PathBuf};

use super::source::Fault;

/// The files that a model may open.
pub(super) struct Files {
    /// The folder in which all of them lie, its path without links; `None` if they may lie anywhere.
    folder: Option<PathBuf>,
}

impl Files {
    /// Returns the files of a model: those of its folder, or of the ROS package to which the folder belongs.
    /// With `outside` they may lie anywhere.
    pub(super) fn of(model: &Path, outside: bool) -> Self {
        let own = || {
            let whole = canonical(model);
            let own = whole.parent().unwrap_or(&whole);
            let package = own.ancestors().find(|folder| is_package(folder));
            package.unwrap_or(own).to_owned()
        };
        Self { folder: (!outside).then(own) }
    }

    /// Refuses a file outside of the folder, unless it lies in `package` and that is a ROS package. A missing
    /// file is refused by its reader.
    pub(super) fn check(&self, path: &Path, package: Option<&Path>) -> Result<(), Fault> {
        let Some(folder) = &self.folder else { return Ok(()) };
        let file = canonical(path);
        let is_in_package = package.is_some_and(|at| is_package(at) && file.starts_with(canonical(at)));
        if file.starts_with(folder) || is_in_package {
            return Ok(());
        }
        let cause = format!("{} lies outside of {}", path.display(), folder.display());
        Err(Fault::new(cause, "put it there, or allow the model all files: `outside=1`"))
    }
}

fn is_package(folder: &Path) -> bool {
    folder.join("package.xml").is_file()
}

/// Returns a path without links, by which a file is recognised.
pub(super) fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().or_else(|_| std::path::absolute(path)).unwrap_or_else(|_| path.to_owned())
}
