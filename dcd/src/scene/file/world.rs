//! Reads the tables `[world]`, `[avatar]` and `[library]` of scene files.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use rapier3d::prelude::Rotation;
use serde::Deserialize;

use super::numbers::{Coordinate, Finite, NonNegative, Place, Positive, Quaternion};
use super::source::Fault;
use crate::physics::{Coupling, CouplingChoice, Method, Preset};
use crate::scene::model::world_pose;
use crate::scene::{AvatarHint, Params, Scene, SceneBody};
use crate::space::{Axis, Balance, Bounds, MAX_REGIONS, Viewpoint};

/// The margin around the bodies if the file gives no bounds.
const MARGIN_M: f64 = 1.0;

/// The settings of the world. Those that are not given come from the library scene, or are the defaults.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct WorldDef {
    name: Option<String>,
    gravity: Option<[Finite; 3]>,
    dt: Option<Positive>,
    bounds: Option<BoundsDef>,
    solver_iterations: Option<usize>,
    speed_limit: Option<Positive>,
    regions: Option<usize>,
    cuts: Option<Vec<CutDef>>,
    balance: Option<Balance>,
    fidelity: Option<String>,
    viewpoints: Option<Vec<ViewpointDef>>,
    coupling: Option<Coupling>,
    preset: Option<Preset>,
    exchanges: Option<usize>,
    depth: Option<usize>,
    island_limit: Option<usize>,
    tolerance: Option<Positive>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ViewpointDef {
    at: Place,
    radius: NonNegative,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct BoundsDef {
    min: Place,
    max: Place,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CutDef {
    axis: Axis,
    at: Coordinate,
}

/// The avatar of a client: its start, box, mass and velocity.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct AvatarDef {
    position: Place,
    rotation: Option<Quaternion>,
    half_size: Option<[Positive; 3]>,
    mass: Option<Positive>,
    drive: Option<[Finite; 3]>,
}

/// The library scene that the file starts from.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct LibraryDef {
    scene: String,
    #[serde(default)]
    params: BTreeMap<String, toml::Value>,
}

impl WorldDef {
    /// Applies the settings that the file gives. The first `inherited` bodies are the library's; without
    /// bounds in the file the library's bounds stay, extended by the other bodies.
    pub(super) fn apply(&self, scene: &mut Scene, inherited: Option<usize>) -> Result<(), Fault> {
        if let Some(name) = &self.name {
            scene.name.clone_from(name);
        }
        if let Some(gravity) = self.gravity {
            scene.gravity = gravity.map(|v| v.0);
        }
        if let Some(dt) = self.dt {
            scene.dt_s = dt.0;
        }
        scene.solver_iterations = self.solver_iterations.unwrap_or(scene.solver_iterations);
        scene.speed_limit_m_s = self.speed_limit.map_or(scene.speed_limit_m_s, |limit| limit.0);
        scene.regions = within("regions", self.regions, 1..=MAX_REGIONS)?.or(scene.regions);
        if let Some(cuts) = &self.cuts {
            scene.cuts = cuts.iter().map(|cut| (cut.axis, cut.at.0)).collect();
        } else if self.regions.is_some() {
            // Cuts take precedence over a number of regions, so the library's cuts are dropped.
            scene.cuts.clear();
        }
        if let Some(balance) = self.balance {
            if let Some((what, value, range)) = balance.fault() {
                return Err(Fault::new(
                    format!("[world] balance: {what} = {value} is out of range"),
                    format!("give {range}"),
                ));
            }
            scene.balance = Some(balance);
        }
        if let Some(fidelity) = &self.fidelity {
            scene.fidelity = fidelity.parse().map_err(|error| {
                Fault::new(
                    format!("[world] fidelity: {error}"),
                    "write off, auto, tolerance=M_S or budget=MS",
                )
            })?;
        }
        if let Some(viewpoints) = &self.viewpoints {
            let view = |def: &ViewpointDef| Viewpoint { at: def.at.0, radius_m: f64::from(def.radius.0) };
            scene.viewpoints = viewpoints.iter().map(view).collect();
        }
        scene.coupling = self.choice()?;
        if let Some((what, value, range)) = scene.step_settings().fault() {
            // A file says `dt` and `tolerance`, without their units.
            let what = what.strip_suffix("_s").unwrap_or(what);
            let what = what.strip_suffix("_m").unwrap_or(what);
            return Err(Fault::new(
                format!("[world] {what} = {value} is out of range"),
                format!("give {range}"),
            ));
        }
        scene.bounds = match (&self.bounds, inherited) {
            (Some(bounds), _) => bounds.build()?,
            (None, Some(inherited)) => grown(scene.bounds, &scene.bodies[inherited..]),
            (None, None) => match scene.tight_bounds() {
                Some(bounds) => bounds.grown(MARGIN_M),
                None => {
                    return Err(Fault::new(
                        "the world has no finite body to take its bounds from",
                        "add a [[body]], or give bounds = { min = [..], max = [..] } in [world]",
                    ));
                }
            },
        };
        if self.cuts.is_none() {
            let Bounds { min, max } = scene.bounds;
            scene.cuts.retain(|&(axis, at)| min[axis.index()] < at && at < max[axis.index()]);
        }
        Ok(())
    }
}

impl WorldDef {
    fn choice(&self) -> Result<CouplingChoice, Fault> {
        let method = match (self.coupling, self.preset) {
            (Some(coupling), None) => Some(Method::Coupling(coupling)),
            (None, Some(preset)) => Some(Method::Preset(preset)),
            (None, None) => None,
            (Some(_), Some(_)) => {
                return Err(Fault::new(
                    "[world] has both `coupling` and `preset`",
                    "write one of them: a preset stands for the coupling `auto`",
                ));
            }
        };
        Ok(CouplingChoice {
            method,
            exchanges: self.exchanges,
            depth: self.depth,
            island_limit: self.island_limit,
            tolerance_m_s: self.tolerance.map(|tolerance| tolerance.0),
        })
    }
}

/// Returns the library's bounds extended by the movable bodies that the file added.
fn grown(bounds: Bounds, added: &[SceneBody]) -> Bounds {
    added
        .iter()
        .filter(|body| body.body.body_type != rapier3d::prelude::RigidBodyType::Fixed)
        .map(|body| body.bounds().grown(MARGIN_M))
        .filter(Bounds::is_finite)
        .fold(bounds, |all, body| all.union(&body))
}

impl BoundsDef {
    fn build(&self) -> Result<Bounds, Fault> {
        let (min, max) = (self.min.0, self.max.0);
        if (0..3).all(|i| min[i] < max[i]) {
            Ok(Bounds::new(min, max))
        } else {
            Err(Fault::new(
                format!("[world] bounds from {min:?} to {max:?} hold nothing"),
                "make every number of min smaller than that of max",
            ))
        }
    }
}

impl AvatarDef {
    pub(super) fn build(&self) -> AvatarHint {
        let rotation = self.rotation.map_or(Rotation::IDENTITY, |turn| turn.0);
        AvatarHint {
            pose: world_pose(self.position.0, rotation),
            half_size_m: self.half_size.map_or([0.5; 3], |half| half.map(|v| v.0)),
            mass_kg: self.mass.map_or(10.0, |mass| mass.0),
            drive_m_s: self.drive.map_or([0.0; 3], |drive| drive.map(|v| v.0)),
        }
    }
}

impl LibraryDef {
    /// Builds the library scene with the file's parameters; those given from outside take precedence.
    pub(super) fn start(&self, outside: &Params) -> Result<Scene, Fault> {
        let mut params = Params::new();
        for (name, value) in &self.params {
            match value {
                toml::Value::Integer(value) => params.set(name, value),
                toml::Value::Float(value) => params.set(name, value),
                toml::Value::String(value) => params.set(name, value),
                other => {
                    return Err(Fault::new(
                        format!("[library.params] {name} = {other} is not a number"),
                        "write a number",
                    ));
                }
            };
        }
        for (name, value) in outside.iter() {
            params.set(name, value);
        }
        Scene::named(&self.scene, &params).map_err(|error| Fault::Scene(Box::new(error)))
    }
}

fn within(name: &str, value: Option<usize>, range: RangeInclusive<usize>) -> Result<Option<usize>, Fault> {
    match value {
        Some(value) if !range.contains(&value) => Err(Fault::new(
            format!("[world] {name} = {value} is out of range"),
            format!("give a whole number from {} to {}", range.start(), range.end()),
        )),
        value => Ok(value),
    }
}
