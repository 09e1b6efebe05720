//! Holds a scene by one setting: its time and its error. Either may have been measured without the other.

use serde::{Deserialize, Serialize};

use super::case::Case;
use super::error::Reading;
use super::setting::Setting;
use super::time::Timed;
use crate::machine::Machine;

/// A scene by one setting. The machine beside it is that of the times; errors are the same on every machine.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct Row {
    pub(super) scene: String,
    pub(super) bodies: usize,
    pub(super) setting: String,
    /// The number of regions; 0: one bare Rapier world.
    pub(super) regions: usize,
    pub(super) threads: usize,
    /// Milliseconds per step, median of the fastest run.
    pub(super) ms_p50: Option<f64>,
    /// The median step over that of one bare world: below 1 is faster.
    pub(super) over_bare: Option<f64>,
    /// The same for the processor time of all threads, which others on the machine disturb less.
    pub(super) cpu_over_bare: Option<f64>,
    /// The instructions of two regions over those of one bare world.
    pub(super) instructions_over_bare: Option<f64>,
    /// The error of the statistic that is worst in relation to its gate, which `unit` names.
    pub(super) error: Option<f64>,
    /// The distance from the least to the most of one bare world's own runs.
    pub(super) r1_spread: Option<f64>,
    pub(super) unit: Option<String>,
    /// The largest error that passes.
    pub(super) gate: Option<f64>,
    pub(super) pass: Option<bool>,
    /// Day and commit of the error.
    pub(super) error_date: Option<String>,
    pub(super) error_commit: Option<String>,
}

impl Row {
    /// Makes a row of which nothing is measured yet.
    pub(super) fn new(case: &Case, bodies: usize, setting: Setting, threads: usize) -> Self {
        Self {
            scene: case.name.to_owned(),
            bodies,
            setting: setting.name().to_owned(),
            regions: setting.asked_regions().unwrap_or(1),
            threads: setting.threads(threads),
            ms_p50: None,
            over_bare: None,
            cpu_over_bare: None,
            instructions_over_bare: None,
            error: None,
            r1_spread: None,
            unit: None,
            gate: None,
            pass: None,
            error_date: None,
            error_commit: None,
        }
    }

    /// Returns whether the row is of this case in this size by this setting.
    pub(super) fn is_of(&self, case: &Case, bodies: usize, setting: Setting) -> bool {
        (&*self.scene, self.bodies, &*self.setting) == (case.name, bodies, setting.name())
            && setting.asked_regions().is_none_or(|regions| regions == self.regions)
    }

    /// Takes in the time of the setting, and that of one bare world.
    pub(super) fn set_time(&mut self, timed: Timed, bare: Timed) {
        self.regions = timed.regions;
        self.ms_p50 = Some(timed.p50_ms);
        self.over_bare = Some(timed.p50_ms / bare.p50_ms);
        self.cpu_over_bare = Some(timed.cpu_ms / bare.cpu_ms);
    }

    /// Takes in the error.
    pub(super) fn set_error(&mut self, reading: Reading, here: &Machine) {
        self.pass = Some(reading.of_gate() <= 1.0);
        let Reading { error, r1_spread, unit, gate, regions } = reading;
        if self.regions > 0 {
            self.regions = regions;
        }
        (self.error, self.r1_spread, self.gate) = (Some(error), Some(r1_spread), Some(gate));
        self.unit = Some(unit.to_owned());
        (self.error_date, self.error_commit) = (Some(here.date.clone()), Some(here.commit.clone()));
    }

    /// Returns the error in gates: 1 just passes.
    pub(super) fn of_gate(&self) -> Option<f64> {
        Some(self.error? / self.gate?)
    }

    /// Returns the setting with its number of regions, where that is part of it.
    pub(super) fn label(&self) -> String {
        match &*self.setting {
            "bare" | "parallel" | "default" => self.setting.clone(),
            name => format!("{name} {}", self.regions),
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::setting::SETTINGS;
    use super::*;

    /// Returns a row of the scene `net` with two thousand bodies; its gate is 1.
    pub(in super::super) fn row(setting: Setting, over_bare: f64, error: f64) -> Row {
        let mut row = Row::new(Case::named("net").unwrap(), 2_000, setting, 2);
        let timed = |p50_ms| Timed { p50_ms, cpu_ms: 2.0 * p50_ms, regions: row.regions };
        let (own, bare) = (timed(over_bare), timed(1.0));
        row.set_time(own, bare);
        let reading = Reading { error, r1_spread: 0.5, unit: "m", gate: 1.0, regions: row.regions };
        row.set_error(reading, &machine());
        row
    }

    pub(in super::super) fn machine() -> Machine {
        Machine { cpu: "c".into(), cores: 2, date: "2026-11-21".into(), commit: "a".into() }
    }

    #[test]
    fn a_row_has_the_keys_that_others_read() {
        let json = serde_json::to_value(row(Setting::Bare, 1.0, 0.0)).unwrap();
        let keys = "scene bodies setting regions threads ms_p50 over_bare instructions_over_bare error r1_spread unit gate pass";
        assert!(keys.split(' ').all(|key| json.get(key).is_some()), "{json}");
        assert!(json["instructions_over_bare"].is_null());
        assert_eq!((json["pass"].as_bool(), json["ms_p50"].as_f64()), (Some(true), Some(1.0)));
    }

    #[test]
    fn a_row_is_found_by_its_case_size_and_setting() {
        let case = Case::named("net").unwrap();
        for setting in SETTINGS {
            let row = row(setting, 0.5, 0.5);
            let found: Vec<_> = SETTINGS.into_iter().filter(|other| row.is_of(case, 2_000, *other)).collect();
            assert_eq!(found, [setting]);
            assert_eq!(row.label(), setting.label());
            assert!(
                !row.is_of(case, 2_001, setting) && !row.is_of(Case::named("gas").unwrap(), 2_000, setting)
            );
        }
    }

    #[test]
    fn times_stay_when_errors_are_measured_anew_and_errors_when_times_are() {
        let mut row = row(Setting::Auto(2), 0.5, 0.25);
        let reading = Reading { error: 3.0, r1_spread: 0.5, unit: "m", gate: 1.0, regions: 2 };
        row.set_error(reading, &machine());
        assert_eq!((row.over_bare, row.of_gate(), row.pass), (Some(0.5), Some(3.0), Some(false)));
        let timed = |p50_ms| Timed { p50_ms, cpu_ms: p50_ms, regions: 2 };
        row.set_time(timed(3.0), timed(4.0));
        assert_eq!((row.over_bare, row.of_gate()), (Some(0.75), Some(3.0)));
    }
}
