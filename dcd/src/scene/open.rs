//! Opens scenes by name or path: those of the library by name, others from files.

use std::path::Path;

use super::{Params, Scene, SceneError, file, library};

/// File extensions of MJCF and URDF.
const MODEL_EXTENSIONS: [&str; 3] = ["xml", "mjcf", "urdf"];

impl Scene {
    /// Builds a scene of the [`library`](super::library()). Returns an error if there is no such scene or
    /// parameter, or a value is out of range.
    pub fn named(name: &str, params: &Params) -> Result<Self, SceneError> {
        library::build(name, params)
    }

    /// Loads a scene file: MJCF (`.xml`, `.mjcf`) or URDF (`.urdf`) with the feature `models`, TOML
    /// otherwise. A TOML file that starts from a scene of the library takes that scene's parameters. All
    /// model files take the same parameters.
    pub fn load(path: impl AsRef<Path>, params: &Params) -> Result<Self, SceneError> {
        let path = path.as_ref();
        #[cfg(feature = "models")]
        if super::models::handles(path) {
            return super::models::load(path, params);
        }
        #[cfg(not(feature = "models"))]
        if MODEL_EXTENSIONS.iter().any(|known| has_extension(path, known)) {
            return Err(SceneError::File {
                path: path.to_owned(),
                line: None,
                cause: "this build reads no MJCF and URDF".to_owned(),
                remedy: "build dcd with its feature `models`".to_owned(),
            });
        }
        file::load(path, params)
    }

    /// Opens a scene: a file if the text ends like the name of a scene file or such a file exists, otherwise
    /// a scene of the library.
    pub fn open(name_or_path: &str, params: &Params) -> Result<Self, SceneError> {
        let path = Path::new(name_or_path);
        let is_scene = MODEL_EXTENSIONS.iter().chain(&["toml"]).any(|known| has_extension(path, known));
        if is_scene || path.is_file() { Self::load(path, params) } else { Self::named(name_or_path, params) }
    }
}

fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
}
