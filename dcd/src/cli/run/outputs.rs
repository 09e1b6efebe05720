//! Refuses a run whose files would overwrite each other, or the scene.

use std::path::{Path, PathBuf};

use super::snapshot;
use crate::cli::draft::place_of;
use crate::cli::failure::Failure;

/// Checks that the files that options name are not one file, nor that of the scene. A snapshot may be replaced
/// by the one that a run saves which goes on with it. Devices and pipes are passed over: they hold nothing
/// that could be lost.
pub(super) fn check<'a>(
    scene: &str,
    named: impl IntoIterator<Item = (&'static str, Option<&'a Path>)>,
) -> Result<(), Failure> {
    let of_scene = Path::new(scene).is_file().then(|| place_of(Path::new(scene)));
    let mut places: Vec<(&str, PathBuf)> = Vec::new();
    for (option, path) in named {
        let Some(path) = path.filter(|path| path.is_file() || !path.exists()) else { continue };
        let place = place_of(path);
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
