//! Reads scene files in TOML. The format, every key with unit and default, stands in `dcd/scenes/README.md`.

mod body;
mod collider;
mod joint;
mod numbers;
mod source;
mod world;

use crate::scene::bounded::read_text;
use std::collections::BTreeMap;
use std::path::Path;

use serde::Deserialize;
use toml::Spanned;

use self::body::{BodyDef, GridDef};
use self::joint::JointDef;
use self::source::{Fault, Source};
use self::world::{AvatarDef, LibraryDef, WorldDef};
use super::{Params, Scene, SceneError};

/// A scene file as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneFile {
    world: Option<Spanned<WorldDef>>,
    avatar: Option<AvatarDef>,
    library: Option<Spanned<LibraryDef>>,
    #[serde(default)]
    body: Vec<Spanned<BodyDef>>,
    #[serde(default)]
    grid: Vec<Spanned<GridDef>>,
    #[serde(default)]
    joint: Vec<Spanned<JointDef>>,
}

/// Reads, checks and builds a scene file.
pub(super) fn load(path: &Path, params: &Params) -> Result<Scene, SceneError> {
    let text = read_text(path).map_err(|source| SceneError::unreadable(path, source))?;
    parse(&Source { path, text: &text }, params)
}

fn parse(source: &Source<'_>, params: &Params) -> Result<Scene, SceneError> {
    let file: SceneFile = toml::from_str(source.text).map_err(|error| source.syntax(&error))?;
    let mut scene = match &file.library {
        Some(library) => source.locate(library, |def| def.start(params))?,
        None if params.is_empty() => Scene::empty(&source.stem()),
        None => {
            let given = params.iter().map(|(name, _)| format!("`{name}`")).collect::<Vec<_>>().join(", ");
            let cause = format!("the file takes no parameters, but {given} was given");
            return Err(
                source.error(None, Fault::new(cause, "drop it, or start the file from a [library] scene"))
            );
        }
    };
    let inherited = scene.bodies.len();
    let mut names = Names::default();
    for def in &file.body {
        let body =
            source.locate(def, |def| names.take(def.name.as_deref(), scene.bodies.len()).and(def.build()))?;
        scene.bodies.push(body);
    }
    for def in &file.grid {
        source.locate(def, |def| {
            def.build(|name, body| {
                names.take(name, scene.bodies.len())?;
                scene.bodies.push(body);
                Ok(())
            })
        })?;
    }
    for def in &file.joint {
        let joint = source.locate(def, |def| def.build(&scene.bodies, &names))?;
        scene.joints.push(joint);
    }
    let inherited = (inherited > 0).then_some(inherited);
    match &file.world {
        Some(world) => source.locate(world, |def| def.apply(&mut scene, inherited))?,
        None => {
            WorldDef::default().apply(&mut scene, inherited).map_err(|fault| source.error(None, fault))?;
        }
    }
    if let Some(avatar) = &file.avatar {
        scene.avatar = Some(avatar.build());
    }
    Ok(scene)
}

/// The indices of the bodies that have names.
#[derive(Default)]
struct Names(BTreeMap<String, usize>);

impl Names {
    fn take(&mut self, name: Option<&str>, index: usize) -> Result<(), Fault> {
        let Some(name) = name else { return Ok(()) };
        match self.0.insert(name.to_owned(), index) {
            None => Ok(()),
            Some(_) => Err(Fault::new(format!("two bodies are named `{name}`"), "give each its own name")),
        }
    }

    fn index(&self, name: &str) -> Option<usize> {
        self.0.get(name).copied()
    }
}

#[cfg(test)]
mod tests;
