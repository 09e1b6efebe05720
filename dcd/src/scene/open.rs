//! Opens scenes by name or path: those of the library by name, others from files.

use std::path::Path;

use super::{Params, Scene, SceneError, file, library};

/// File extensions of MJCF and URDF.
const MODEL_EXTENSIONS: [&str; 3] = ["xml", "mjcf", "urdf"];
/// File extensions of glTF, which is only written.
const GLTF_EXTENSIONS: [&str; 2] = ["gltf", "glb"];

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
        if GLTF_EXTENSIONS.iter().any(|known| has_extension(path, known)) {
            return Err(SceneError::File {
                path: path.to_owned(),
                line: None,
                cause: "dcd writes glTF and does not read it".to_owned(),
                remedy: "give a scene file (.toml), or a model (.xml, .mjcf or .urdf)".to_owned(),
            });
        }
        file::load(path, params)
    }

    /// Opens a scene: a file if the text ends like the name of a scene file or such a file exists, otherwise
    /// a scene of the library.
    pub fn open(name_or_path: &str, params: &Params) -> Result<Self, SceneError> {
        let path = Path::new(name_or_path);
        let mut known = MODEL_EXTENSIONS.iter().chain(&GLTF_EXTENSIONS).chain(&["toml"]);
        let is_scene = known.any(|known| has_extension(path, known));
        if is_scene || path.is_file() { Self::load(path, params) } else { Self::named(name_or_path, params) }
    }
}

fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gltf_file_is_refused_as_one_and_not_read_as_toml() {
        for name in ["world.gltf", "WORLD.GLB"] {
            let error = Scene::open(name, &Params::default()).unwrap_err().to_string();
            assert!(error.contains("glTF"), "{error}");
        }
    }
}
