//! Lists the scenes of the chart, and what is swept in each.

use dcd::physics::{Coupling, Preset};

use super::setting::Setting;
use crate::accuracy::{Bare, Case, Measure, Reading, Size, experiments};

/// One case of the suite.
pub(super) struct Panel {
    /// Name of the experiment.
    pub(super) scene: &'static str,
    /// The label of its case begins like this.
    label: &'static str,
    size: Size,
    /// Into how many regions it is cut.
    regions: &'static [usize],
}

/// Scenes that run for minutes in the suite are charted in their quick form: there are some fifty settings.
pub(super) const PANELS: &[Panel] = &[
    Panel::new("tower", "1:1 centre", Size::Quick),
    Panel::new("tower", "10:1 between", Size::Quick),
    Panel::new("tower", "100:1 between", Size::Quick),
    Panel::new("pyramid", "base 20 layers", Size::Full),
    Panel::new("wall", "", Size::Quick),
    Panel::new("border_pair", "e 1 1:10", Size::Full),
    Panel::new("cradle", "1 m/s", Size::Full),
    Panel::new("slide_to_roll", "", Size::Full),
    Panel::new("slope", "", Size::Full),
    Panel::new("rolling_box", "", Size::Full),
    Panel::new("chain", "", Size::Full),
    Panel::new("joint_grid", "joints", Size::Quick),
    Panel::new("elastic_666", "", Size::Quick),
    Panel::new("gas", "", Size::Quick),
    Panel { regions: &[1, 2, 8], ..Panel::new("pile", "1000 boxes", Size::Full) },
];

pub(super) const QUICK_PANELS: &[Panel] = &[
    Panel { regions: &[1, 2], ..Panel::new("tower", "10:1 between", Size::Quick) },
    Panel { regions: &[1, 2], ..Panel::new("border_pair", "e 1 1:10", Size::Quick) },
    Panel { regions: &[1, 2], ..Panel::new("chain", "", Size::Quick) },
    Panel { regions: &[1, 2, 4], ..Panel::new("pile", "", Size::Quick) },
];

impl Panel {
    const fn new(scene: &'static str, label: &'static str, size: Size) -> Self {
        Self { scene, label, size, regions: &[1, 2, 4, 8] }
    }

    /// Whether a row belongs to it.
    pub(super) fn is(&self, scene: &str, case: &str) -> bool {
        scene == self.scene && case.starts_with(self.label)
    }

    /// The case, made anew.
    pub(super) fn case(&self) -> Result<Case, String> {
        let experiment = experiments().into_iter().find(|experiment| experiment.name == self.scene);
        let cases = experiment.map_or(Vec::new(), |experiment| (experiment.cases)(self.size));
        let found = cases.into_iter().find(|case| case.label.starts_with(self.label));
        found.ok_or_else(|| {
            format!("the suite has no case `{} {}`; change the chart's list", self.scene, self.label)
        })
    }

    /// All settings; the first is one bare world as the scene asks for it.
    pub(super) fn settings(&self, quick: bool, dt_s: f32) -> Vec<Setting> {
        let mut settings =
            vec![Setting::Bare { sweep: "dt", bare: Bare { dt_s: Some(dt_s), ..Bare::default() } }];
        let finer: &[f32] = if quick { &[4.0] } else { &[0.5, 2.0, 4.0, 8.0] };
        settings.extend(finer.iter().map(|times| Setting::Bare {
            sweep: "dt",
            bare: Bare { dt_s: Some(dt_s / times), ..Bare::default() },
        }));
        let iterations: &[usize] = if quick { &[1, 16] } else { &[1, 2, 4, 8, 16] };
        settings.extend(iterations.iter().map(|&iterations| Setting::Bare {
            sweep: "iterations",
            bare: Bare { iterations: Some(iterations), ..Bare::default() },
        }));
        for &regions in self.regions {
            // In one region nothing is coupled: all methods are one.
            if regions > 1 {
                let fixed = Coupling::ALL.into_iter().filter(|&method| method != Coupling::Auto);
                settings.extend(fixed.flat_map(|method| {
                    [1, 2, 4].map(|exchanges| Setting::Fixed { method, regions, exchanges })
                }));
            }
            settings.extend(Preset::ALL.map(|preset| Setting::Auto { preset, regions }));
        }
        settings
    }

    /// Threads for as many regions: ten bodies are not worth waking a thread for.
    pub(super) fn threads(&self, case: &Case) -> usize {
        if case.scenes[0].bodies.len() < 200 { 1 } else { 2 }
    }
}

/// Which differences of the error mean nothing: a tenth, what rounding may add, and for statistics the spread of one
/// world's own runs.
pub(super) fn noise(case: &Case, reading: &Reading) -> f64 {
    let spread = if matches!(case.measure, Measure::Statistics(_)) { reading.r1_error } else { 0.0 };
    0.1 * reading.error + case.floor + spread
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_panel_is_a_case_of_the_suite() {
        for panel in PANELS.iter().chain(QUICK_PANELS) {
            assert!(panel.case().is_ok(), "{} {}", panel.scene, panel.label);
        }
    }
}
