//! Measures how a budget is kept in a town to which as many bodies come at once as it has.

use std::error::Error;
use std::time::Instant;

use dcd::Fidelity;
use dcd::physics::Region;
use dcd::prelude::*;
use dcd::protocol::WorldPose;
use dcd::runtime::LocalWorld;
use dcd::scene::Scene;
use serde::{Deserialize, Serialize};

use super::{Case, WARM_UP, full_step_ms, mean, scene_of, world};
use crate::output::Shown;
use crate::page;
use crate::results::{Measured, short};

pub(super) const DOUBLING: Shown<Row> = Shown { name: "fidelity-doubling", table, picture: None };

/// The goal: the largest share of the ticks after the first second that may be above the budget, percent.
const GOAL_PERCENT: f64 = 1.0;
/// The first second after the load has doubled.
const FIRST_TICKS: usize = 60;
/// Boxes fall this far from the borders of a region, so that they tie no regions together.
const MARGIN_M: f64 = 4.0;
/// The sides of the boxes, the distance between their centres, and the most layers of them.
const SIDE_M: f64 = 0.5;
const APART_M: f64 = 1.0;
const LAYERS: usize = 12;

/// One budget, on one thread.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Row {
    bodies: usize,
    /// The bodies that come at once where nobody looks.
    come: usize,
    /// The mean step of all in full before and after, milliseconds.
    full_ms: f64,
    doubled_ms: f64,
    budget_ms: f64,
    /// The mean step with the budget, and the longest, after the first second.
    step_ms: f64,
    longest_ms: f64,
    /// Ticks above the budget, percent: in the first second after the load has doubled, and afterwards.
    first_percent: f64,
    over_percent: f64,
    /// The same as `over_percent`, where of each tick the fastest of all runs with the same paces counts: it is
    /// without what the machine did meanwhile.
    repeated_percent: f64,
}

/// Doubles the bodies of a town where nobody looks, with budgets of so many times what a step took before. Each
/// budget has `repeats` runs, which have the paces that the first of them chooses.
pub(super) fn measure(case: Case, ticks: usize, repeats: usize) -> Result<Vec<Row>, Box<dyn Error>> {
    let scene = scene_of(case, 1)?;
    let full_ms = full_step_ms(&scene)?;
    let budgets = [1.25, 1.5, 1.75].map(|times| times * full_ms);
    let settings = budgets.map(|tick_ms| Fidelity::Budget { tick_ms: tick_ms as f32 });
    let mut full = world(&scene, Fidelity::Off)?;
    let bodies = full.stats().bodies;
    let mut all_ms = Vec::new();
    let mut runs = Vec::new();
    for fidelity in settings {
        let worlds: Result<Vec<_>, _> = (0..repeats).map(|_| world(&scene, fidelity)).collect();
        runs.push((worlds?, Vec::new()));
    }
    let mut come = 0;
    for step in 0..2 * WARM_UP + ticks {
        if step == 2 * WARM_UP {
            come = rain(&scene, &mut full, bodies)?;
            for world in runs.iter_mut().flat_map(|(worlds, _)| worlds) {
                rain(&scene, world, bodies)?;
            }
        }
        all_ms.push(timed(&mut full)?);
        for (worlds, took_ms) in &mut runs {
            let (first, others) = worlds.split_first_mut().ok_or("no world")?;
            let first_ms = timed(first)?;
            let mut least_ms = first_ms;
            for other in others {
                other.repeat_paces(first.timed_paces());
                least_ms = least_ms.min(timed(other)?);
            }
            took_ms.push([first_ms, least_ms]);
        }
    }
    let over = |of: &[[f64; 2]], budget_ms: f64, which: usize| {
        100.0 * mean(of.iter().map(|ms| f64::from(ms[which] > budget_ms)))
    };
    let doubled_ms = mean(all_ms[2 * WARM_UP + FIRST_TICKS..].iter().copied());
    let rows = budgets.into_iter().zip(&runs).map(|(budget_ms, (_, took_ms))| {
        let (first, later) = took_ms[2 * WARM_UP..].split_at(FIRST_TICKS);
        Row {
            bodies,
            come,
            full_ms,
            doubled_ms,
            budget_ms,
            step_ms: mean(later.iter().map(|[ms, _]| *ms)),
            longest_ms: later.iter().map(|[ms, _]| *ms).fold(0.0, f64::max),
            first_percent: over(first, budget_ms, 0),
            over_percent: over(later, budget_ms, 0),
            repeated_percent: over(later, budget_ms, 1),
        }
    });
    Ok(rows.collect())
}

/// Steps a world. Returns how long that took, milliseconds.
fn timed(world: &mut LocalWorld) -> Result<f64, Box<dyn Error>> {
    let start = Instant::now();
    world.step()?;
    Ok(start.elapsed().as_secs_f64() * 1e3)
}

/// Drops `count` boxes into the regions that nobody looks at, or as many as there is room for. Returns their
/// number.
fn rain(scene: &Scene, world: &mut LocalWorld, count: usize) -> Result<usize, Box<dyn Error>> {
    let is_seen = |region: &&Region| scene.viewpoints.iter().any(|view| view.gap_m(region.cell()) <= 0.0);
    let cells: Vec<_> =
        world.regions().filter(|region| !is_seen(region)).map(|region| *region.cell()).collect();
    let mut places = Vec::new();
    for cell in &cells {
        let along = |axis: usize| {
            let [from, to] =
                [cell.min[axis].max(scene.bounds.min[axis]), cell.max[axis].min(scene.bounds.max[axis])];
            let room = ((to - from - 2.0 * MARGIN_M) / APART_M).max(0.0) as usize;
            (0..room).map(move |i| from + MARGIN_M + i as f64 * APART_M)
        };
        let of_cell = (0..LAYERS).flat_map(|layer| {
            along(0).flat_map(move |x| along(2).map(move |z| [x, 12.0 + layer as f64 * APART_M, z]))
        });
        places.extend(of_cell.take(count / cells.len()));
    }
    for &place in &places {
        let half_m = 0.5 * SIDE_M as f32;
        let body = RigidBodyBuilder::dynamic().can_sleep(false);
        world.insert_at(WorldPose::at(place), body, [ColliderBuilder::cuboid(half_m, half_m, half_m)])?;
    }
    Ok(places.len())
}

fn table(rows: &[Measured<Row>]) -> String {
    let head = [
        "bodies",
        "come",
        "full, ms",
        "full after, ms",
        "budget, ms",
        "step after, ms",
        "longest",
        "over budget in the first second, %",
        "afterwards, %",
        "fastest of three, %",
    ];
    page::table(&head, rows.iter().map(|row| row.row.cells()))
}

impl Row {
    fn cells(&self) -> Vec<String> {
        vec![
            self.bodies.to_string(),
            self.come.to_string(),
            short(self.full_ms),
            short(self.doubled_ms),
            short(self.budget_ms),
            short(self.step_ms),
            short(self.longest_ms),
            format!("{:.0}", self.first_percent),
            format!("{:.1}", self.over_percent),
            page::bold_unless(format!("{:.1}", self.repeated_percent), self.repeated_percent <= GOAL_PERCENT),
        ]
    }
}
