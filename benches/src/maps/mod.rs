//! Maps where methods fail: heat maps over the quantities that make them fail, with the map of one bare
//! Rapier world beside each.

mod network;
mod picture;
mod projectile;
mod restitution;
mod tower;

use std::error::Error;
use std::path::Path;

use clap::Args;
use dcd::physics::Coupling;
use dcd::runtime::measure::Subject;
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig, WorldError};
use dcd::scene::Scene;
use dcd::space::Axis;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::output::{Output, Sheet, Shown};
use crate::results::Measured;

const SHOWN: Shown<Row> = Shown { name: "maps", table: |_| String::new(), picture: None };

/// The maps that are made.
#[derive(Args)]
pub(crate) struct Maps {
    #[command(flatten)]
    output: Output,
    /// Only this map; others stay in the file. May be given several times.
    #[arg(long, value_name = "NAME")]
    map: Vec<String>,
}

/// A kind of map.
pub(crate) struct Kind {
    /// The name by which it is asked for.
    name: &'static str,
    title: &'static str,
    /// The formula of a cell, and what is computed.
    caption: &'static str,
    x_label: &'static str,
    y_label: &'static str,
    scale_label: &'static str,
    /// The values of the best and of the worst colour.
    scale: (f64, f64),
    grid: fn(quick: bool) -> Grid,
    /// Returns the value of a cell, whose method is `None` for one bare world.
    cell: fn(&Cell, quick: bool) -> Result<f64, WorldError>,
}

/// All cells of a kind, for every method.
struct Grid {
    /// The panels, with a picture each.
    panels: Vec<&'static str>,
    x: Vec<f64>,
    y: Vec<f64>,
}

/// One computation.
#[derive(Clone, Copy, Debug)]
struct Cell {
    panel: &'static str,
    method: Option<Coupling>,
    x: f64,
    y: f64,
}

/// A cell and its value.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Row {
    map: String,
    panel: String,
    /// The name of the coupling; `bare` for one Rapier world.
    method: String,
    x: f64,
    y: f64,
    value: f64,
}

const KINDS: [&Kind; 4] = [&tower::KIND, &projectile::KIND, &restitution::KIND, &network::KIND];

const BARE: &str = "bare";

/// The value of a world that has lost a body or has a value that is no number.
const BROKEN: f64 = 1e6;

impl Maps {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        if let Some(name) = self.map.iter().find(|name| KINDS.iter().all(|kind| kind.name != **name)) {
            return Err(format!(
                "there is no map `{name}`; there are {}",
                KINDS.map(|kind| kind.name).join(", ")
            )
            .into());
        }
        let rows = self.output.fill(&SHOWN, |sheet| self.compute(sheet))?;
        let folder = self.output.folder()?;
        KINDS.iter().try_for_each(|kind| kind.publish(&folder, &rows))
    }

    fn compute(&self, sheet: &mut Sheet<Row>) -> Result<(), Box<dyn Error>> {
        sheet.recall()?;
        let wanted = |kind: &&Kind| self.map.is_empty() || self.map.iter().any(|name| name == kind.name);
        for kind in KINDS.into_iter().filter(wanted) {
            let fresh: Vec<_> =
                kind.compute(self.output.quick)?.into_iter().map(|row| sheet.measured(row)).collect();
            sheet.replace(|old| old.map == kind.name, fresh)?;
        }
        Ok(())
    }
}

impl Kind {
    fn compute(&self, quick: bool) -> Result<Vec<Row>, WorldError> {
        let Grid { panels, x, y } = (self.grid)(quick);
        let methods: Vec<_> = std::iter::once(None).chain(Coupling::ALL.map(Some)).collect();
        let mut cells = Vec::new();
        for &panel in &panels {
            for &method in &methods {
                cells.extend(y.iter().flat_map(|&y| x.iter().map(move |&x| Cell { panel, method, x, y })));
            }
        }
        let style = ProgressStyle::with_template("{prefix} {bar:30} {pos}/{len} {elapsed}").expect("fixed");
        let bar = ProgressBar::new(cells.len() as u64).with_style(style).with_prefix(self.name);
        let row = |cell: &Cell| {
            let value = (self.cell)(cell, quick)?;
            bar.inc(1);
            Ok(Row {
                map: self.name.to_owned(),
                panel: cell.panel.to_owned(),
                method: cell.method.map_or(BARE, Coupling::name).to_owned(),
                x: cell.x,
                y: cell.y,
                value: if value.is_finite() { value.min(BROKEN) } else { BROKEN },
            })
        };
        let rows = cells.par_iter().map(row).collect();
        bar.finish();
        rows
    }

    fn publish(&self, folder: &Path, rows: &[Measured<Row>]) -> Result<(), Box<dyn Error>> {
        for panel in (self.grid)(false).panels {
            if let Some(picture) = picture::picture(self, panel, rows) {
                crate::draw::write(&picture, &folder.join(picture::stem(self, panel)))?;
            }
        }
        Ok(())
    }
}

/// Builds the scene as one bare world, or cut by planes and coupled by a method with its usual settings,
/// which `adjust` may change.
fn subject(
    scene: &Scene,
    method: Option<Coupling>,
    planes: Vec<(Axis, f64)>,
    adjust: impl FnOnce(&mut WorldConfig),
) -> Result<Subject, WorldError> {
    let Some(method) = method else {
        return Ok(Subject::Bare(Box::new(scene.bare_world())));
    };
    let mut config =
        WorldConfig { partitioning: Partitioning::Cuts(planes), ..WorldConfig::for_scene(scene) };
    crate::accuracy::use_method(&mut config, method);
    adjust(&mut config);
    Ok(Subject::Regions(Box::new(LocalWorld::from_scene(scene, config)?)))
}

/// Steps a world so many times.
fn step(subject: &mut Subject, ticks: usize) -> Result<(), WorldError> {
    for _ in 0..ticks {
        match subject {
            Subject::Bare(world) => world.step(),
            Subject::Regions(world) => world.step()?,
        }
    }
    Ok(())
}
