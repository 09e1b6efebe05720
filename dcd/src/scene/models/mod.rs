//! Loads scenes from MJCF and URDF files, through Rapier's loaders. What the loaders get wrong is corrected
//! here. What a dcd world cannot have is refused or warned of by name: `dcd/scenes/models/README.md` has the
//! table, checked by a test.
//!
//! [`mjcf`] and [`urdf`] read a file into a [`Model`]. [`weights`] gives mass to bodies to which the formats
//! give none. [`placing`] makes a scene of copies of the model.

mod collada;
mod files;
mod mass;
mod mesh;
mod mjcf;
mod model;
mod placing;
mod source;
mod urdf;
mod warnings;
mod weights;

use std::path::Path;

use super::params::{ParamInfo, Values, count, number};
use super::{Params, Scene, SceneError};
use files::Files;
use model::Model;
use source::{Fault, Source};

/// The parameters of any model file.
pub static MODEL_PARAMS: [ParamInfo; 11] = [
    count("copies", "1", 1, 100_000, "how often the model is placed, in a square grid"),
    number("spacing", "0", [0.0, 1e4], "m", "from one copy to the next; 0: its own size and a fifth"),
    number("height", "0", [0.0, 1e4], "m", "how far the model is lifted"),
    count("ground", "0", 0, 1, "1: adds a ground at z = 0, or where the model is lowest if that is below"),
    count(
        "fixed",
        "0",
        0,
        1,
        "1: what could fly away (a URDF root, an MJCF free joint) is fixed where it is",
    ),
    count("key", "0", 0, 10_000, "MJCF: starts in the n-th keyframe, with its controls"),
    count("sleep", "1", 0, 1, "1: bodies at rest may fall asleep; 0: they never do"),
    count(
        "iterations",
        "8",
        1,
        1000,
        "the solver's iterations a step; chains of joints hold better with more",
    ),
    count(
        "multibody",
        "0",
        0,
        1,
        "1: joints of the tree of bodies are a multibody's, which cannot come apart; 0: impulses hold them",
    ),
    count("outside", "0", 0, 1, "1: the model may open files that lie outside of its folder"),
    number("dt", "0", [0.0, 1.0], "s", "seconds a step; 0: what the file says, else 1/60"),
];

/// The values of the parameters.
struct ModelParams {
    copies: usize,
    spacing_m: f64,
    height_m: f64,
    ground: bool,
    fixed: bool,
    key: usize,
    sleep: bool,
    iterations: usize,
    multibody: bool,
    dt_s: f32,
    outside: bool,
}

/// Returns whether the path's extension names a format of this module.
pub(super) fn handles(path: &Path) -> bool {
    kind(path).is_some()
}

/// Reads the file and places it.
pub(super) fn load(path: &Path, params: &Params) -> Result<Scene, SceneError> {
    let values = Values::parse("model file", &MODEL_PARAMS, params)?;
    let params = ModelParams {
        copies: values.count("copies"),
        spacing_m: values.number("spacing").into(),
        height_m: values.number("height").into(),
        ground: values.count("ground") == 1,
        fixed: values.count("fixed") == 1,
        key: values.count("key"),
        sleep: values.count("sleep") == 1,
        iterations: values.count("iterations"),
        multibody: values.count("multibody") == 1,
        dt_s: values.number("dt"),
        outside: values.count("outside") == 1,
    };
    let (source, files) = (Source::read(path)?, Files::of(path, params.outside));
    let mut model = match kind(path) {
        Some(Kind::Urdf) if params.key > 0 => {
            let message = format!("`key={}`: a URDF has no keyframes", params.key);
            return Err(source.fault(Fault::new(message, "leave it out, or take an MJCF file")));
        }
        Some(Kind::Urdf) => urdf::read(&source, &params, &files)?,
        _ => mjcf::read(&source, &params, &files)?,
    };
    weights::settle(&mut model).map_err(|fault| source.fault(fault))?;
    let scene = placing::place(model, &params);
    if let Some((what, value, range)) = scene.step_settings().fault() {
        let what = what.strip_suffix("_s").unwrap_or(what);
        return Err(
            source.fault(Fault::new(format!("{what} = {value} is out of range"), format!("give {range}")))
        );
    }
    for warning in &scene.warnings {
        tracing::warn!("{}: {warning}", path.display());
    }
    Ok(scene)
}

enum Kind {
    Mjcf,
    Urdf,
}

fn kind(path: &Path) -> Option<Kind> {
    match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
        "xml" | "mjcf" => Some(Kind::Mjcf),
        "urdf" => Some(Kind::Urdf),
        _ => None,
    }
}
