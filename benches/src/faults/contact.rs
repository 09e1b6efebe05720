//! Fills the fault table over Rapier: every kind of faults for each scene whose bodies touch across borders.

use std::error::Error;
use std::ops::Range;

use dcd::sim::{self, ContactScene, FaultProfile, Quantity, TrialConfig};
use serde::{Deserialize, Serialize};

use crate::output::{Sheet, Shown};
use crate::page;
use crate::results::Measured;

pub(super) const SHOWN: Shown<Row> = Shown { name: "faults-contact", table, picture: None };

/// All seeds of one scene under one kind of faults. The quantities are in parts of their gates.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Row {
    faults: String,
    scene: String,
    seeds: u64,
    violations: u64,
    /// The violations by what bodies did.
    strained: u64,
    worst_recovery_ms: u64,
    transfers: u64,
    evictions: u64,
    elections: u64,
    overlap: f64,
    stray: f64,
    gap: f64,
    gain: f64,
    push: f64,
    leap: f64,
    drift: f64,
}

impl Row {
    fn of(scene: ContactScene, row: &sim::Row) -> Self {
        let share = |quantity| row.strain.of(quantity);
        Self {
            faults: row.profile.name().to_owned(),
            scene: scene.name().to_owned(),
            seeds: row.seeds,
            violations: row.violations,
            strained: row.strained,
            worst_recovery_ms: row.worst_recovery.as_millis() as u64,
            transfers: row.tally.transfers,
            evictions: row.tally.evictions,
            elections: row.tally.elections,
            overlap: share(Quantity::Overlap),
            stray: share(Quantity::Stray),
            gap: share(Quantity::Gap),
            gain: share(Quantity::Gain),
            push: share(Quantity::Push),
            leap: share(Quantity::Leap),
            drift: share(Quantity::Drift),
        }
    }

    /// Returns whether nothing was violated.
    pub(super) fn holds(&self) -> bool {
        self.violations == 0
    }

    /// Returns the quantity that came nearest to its gate, or farthest beyond it, as text.
    fn worst(&self) -> String {
        let worst = self.shares().into_iter().max_by(|(a, _), (b, _)| a.total_cmp(b));
        let (share, name) = worst.unwrap_or_default();
        format!("{:.0} % ({name})", 100.0 * share)
    }

    fn shares(&self) -> [(f64, &'static str); Quantity::ALL.len()] {
        let Self { overlap, stray, gap, gain, push, leap, drift, .. } = *self;
        [
            (overlap, "overlap"),
            (stray, "stray"),
            (gap, "gap"),
            (gain, "gain"),
            (push, "push"),
            (leap, "leap"),
            (drift, "drift"),
        ]
    }
}

/// Runs the scenes, and writes each row when it is done.
pub(super) fn measure(
    rows: &mut Sheet<Row>,
    profiles: &[FaultProfile],
    seeds: Range<u64>,
) -> Result<(), Box<dyn Error>> {
    let bar = super::bar((profiles.len() * ContactScene::ALL.len()) as u64 * (seeds.end - seeds.start))?;
    for &profile in profiles {
        for scene in ContactScene::ALL {
            bar.set_message(format!("{} of a {scene}", profile.name()));
            let config = TrialConfig { begin: scene.begin(), ..TrialConfig::default() };
            let row = Row::of(scene, &super::measure(&config, profile, seeds.clone(), &bar));
            let row = rows.measured(row);
            rows.replace(|old| old.faults == profile.name() && old.scene == scene.name(), [row])?;
        }
    }
    bar.finish_and_clear();
    Ok(())
}

/// Returns the table, with a line per kind of faults.
fn table(rows: &[Measured<Row>]) -> String {
    let scenes = ContactScene::ALL.map(|scene| format!("{scene}: worst of gate"));
    let head: Vec<_> =
        ["faults", "seeds", "violations"].into_iter().chain(scenes.iter().map(String::as_str)).collect();
    let lines = rows.chunk_by(|a, b| a.row.faults == b.row.faults).map(|of| {
        let sum = |count: fn(&Row) -> u64| of.iter().map(|row| count(&row.row)).sum::<u64>().to_string();
        let worst = |scene: ContactScene| {
            let row = of.iter().find(|row| row.row.scene == scene.name());
            row.map_or("–".to_owned(), |row| row.row.worst())
        };
        let mut cells = vec![of[0].row.faults.clone(), sum(|row| row.seeds), sum(|row| row.violations)];
        cells.extend(ContactScene::ALL.map(worst));
        cells
    });
    page::table(&head, lines)
}
