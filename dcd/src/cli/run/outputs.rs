//! Refuses a run whose files would overwrite each other, or the scene.

use std::path::{Path, PathBuf};

use super::snapshot;
use crate::cli::failure::Failure;

/// Checks that the files that options name are not one file, nor that of the scene. A snapshot may be replaced
/// by the one that a run saves which goes on with it. Devices and pipes are passed over: they hold nothing
/// that could be lost.
pub(super) fn check<'a>(
    scene: &str,
    named: impl IntoIterator<Item = (&'static str, Option<&'a Path>)>,
) -> Result<(), Failure> {
    let of_scene = Path::new(scene).is_file().then(|| without_links(Path::new(scene)));
    let mut places: Vec<(&str, PathBuf)> = Vec::new();
    for (option, path) in named {
        let Some(path) = path.filter(|path| path.is_file() || !path.exists()) else { continue };
        let place = without_links(path);
        let goes_on = option == "--save" && snapshot::is_one(scene);
        if of_scene.as_ref() == Some(&place) && !goes_on {
            return Err(Failure::usage(format!(
                "{option} {} is the file of the scene, which would be overwritten; give {option} another file",
                path.display()
            )));
        }
        if let Some((other, _)) = places.iter().find(|(_, known)| *known == place) {
            return Err(Failure::usage(format!(
                "{other} and {option} both name {}, of which one would overwrite the other; give each a file of its own",
                path.display()
            )));
        }
        places.push((option, place));
    }
    Ok(())
}

/// Returns a path by which a file is recognised that need not be there yet: without links.
fn without_links(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    path.canonicalize().unwrap_or_else(|_| match (folder.canonicalize(), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path.to_owned(),
    })
}
