//! Provides the library: named scenes with parameters, all deterministic.

mod chain;
mod convoy;
mod dominoes;
mod drops;
mod floating;
mod machines;
mod net;
mod ragdolls;
mod stacks;
mod town;
mod vault;

use super::error::nearest;
use super::params::{Values, count, number};
use super::{ParamInfo, Params, Scene, SceneError};

/// The description of a library scene, for help texts.
pub struct SceneInfo {
    /// The name by which it is asked for.
    pub name: &'static str,
    /// One line of description.
    pub summary: &'static str,
    /// Its parameters.
    pub params: &'static [ParamInfo],
    build: fn(&Values) -> Result<Scene, SceneError>,
}

static LIBRARY: [SceneInfo; 18] = [
    stacks::TOWER,
    stacks::PYRAMID,
    stacks::WALL,
    stacks::PILE,
    drops::HEAP,
    drops::TERRAIN,
    floating::GAS,
    floating::DVE,
    chain::CHAIN,
    convoy::CONVOY,
    ragdolls::RAGDOLLS,
    vault::VAULT,
    machines::CONVEYOR,
    machines::DRUM,
    machines::SWEEP,
    net::NET,
    dominoes::DOMINO_RING,
    town::TOWN,
];

/// Returns the descriptions of all scenes of the library.
pub fn library() -> &'static [SceneInfo] {
    &LIBRARY
}

/// Builds a scene of the library.
pub(super) fn build(name: &str, params: &Params) -> Result<Scene, SceneError> {
    let Some(info) = LIBRARY.iter().find(|info| info.name == name) else {
        let names = || LIBRARY.iter().map(|info| info.name);
        return Err(SceneError::UnknownScene {
            name: name.to_owned(),
            nearest: nearest(name, names()),
            known: names().collect::<Vec<_>>().join(", "),
        });
    };
    let values = Values::parse(info.name, info.params, params)?;
    let mut scene = (info.build)(&values)?;
    if info.params.iter().any(|param| param.name == SLEEP.name) {
        for body in &mut scene.bodies {
            body.body.can_sleep = values.count(SLEEP.name) == 1;
        }
    }
    Ok(scene)
}

/// The most bodies of a scene: what fits the memory of a large machine, not a limit of the engine.
const MOST: u64 = 2_000_000;

/// Parameter: the seed.
const SEED: ParamInfo = count("seed", "1", 0, u64::MAX, "source of all random numbers");

/// Parameter: whether bodies may sleep.
const SLEEP: ParamInfo = count("sleep", "1", 0, 1, "1: bodies at rest may fall asleep; 0: they never do");

/// Parameter: whether bodies may sleep, for scenes made for timing steps.
const NO_SLEEP: ParamInfo = ParamInfo {
    default: "0",
    what: "1: bodies at rest may fall asleep; 0: they never do, for what sleeps costs nothing and measures nothing",
    ..SLEEP
};

#[cfg(test)]
mod tests;
