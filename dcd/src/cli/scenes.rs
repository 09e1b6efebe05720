//! Implements `dcd scenes`: lists the scenes of the library.

use std::fmt::Write;
use std::path::Path;
use std::process::ExitCode;

use super::common::{Common, print};
use super::failure::Failure;
use crate::scene::{MODEL_PARAMS, Params, Scene, SceneError, SceneInfo, library};

/// Lists the scenes of the library with their parameters
#[derive(clap::Args)]
pub(super) struct Scenes {
    /// Only this scene
    scene: Option<String>,
    /// Print what files of scenes may say, in Markdown: TOML, or MJCF and URDF (models)
    #[arg(long, value_name = "OF", num_args = 0..=1, default_missing_value = "toml", conflicts_with = "scene")]
    format: Option<Format>,
}

/// The formats of scene files.
#[derive(Clone, Copy, clap::ValueEnum)]
enum Format {
    Toml,
    Models,
}

impl Format {
    /// Returns its page.
    fn page(self) -> &'static str {
        match self {
            Self::Toml => include_str!("../../scenes/README.md"),
            Self::Models => include_str!("../../scenes/models/README.md"),
        }
    }
}

impl Scenes {
    pub(super) fn execute(self, _common: &Common) -> Result<ExitCode, Failure> {
        let Some(name) = self.scene else {
            print(&self.format.map_or_else(overview, |format| format.page().trim_end().to_owned()))?;
            return Ok(ExitCode::SUCCESS);
        };
        match (library().iter().find(|info| info.name == name), shipped(&name)) {
            (Some(info), _) => print(&describe(info))?,
            (None, Some(path)) => print(&format!("  {name}: the scene file {path}"))?,
            // Its error says which scenes there are.
            (None, None) => drop(Scene::named(&name, &Params::new())?),
        }
        Ok(ExitCode::SUCCESS)
    }
}

/// Opens a scene as users name it: by a path, as a scene of the library, or by the bare name of a scene file
/// that the sources ship.
pub(super) fn open(name: &str, params: &Params) -> Result<Scene, SceneError> {
    match Scene::open(name, params) {
        Err(error @ SceneError::UnknownScene { .. }) => match shipped(name) {
            Some(path) => Scene::open(&path, params),
            None => Err(error),
        },
        opened => opened,
    }
}

/// Returns the path of a file in dcd/scenes/, if the sources are still where this binary was built.
fn shipped(name: &str) -> Option<String> {
    let is_bare = name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == '-');
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(format!("{name}.toml"));
    (is_bare && path.is_file()).then(|| path.to_string_lossy().into_owned())
}

/// Lists every scene of the library, for help texts.
pub(super) fn overview() -> String {
    let scenes: Vec<_> = library().iter().map(describe).collect();
    format!(
        "Scenes of the library, with their parameters and defaults (--set name=value):\n\n{}\n\n\
         A scene may also be a TOML file (`dcd scenes --format` prints what it may say): the sources ship some in dcd/scenes/;\n\
         these go by their bare names too, as playground.\n\n\
         Or an MJCF or URDF file (`dcd scenes --format models` prints what of these is read):\n{}",
        scenes.join("\n\n"),
        MODEL_PARAMS.map(|param| format!("    {param}")).join("\n")
    )
}

fn describe(info: &SceneInfo) -> String {
    let mut text = format!("  {}: {}", info.name, info.summary);
    for param in info.params {
        write!(text, "\n    {param}").expect("a string takes all text");
    }
    text
}
