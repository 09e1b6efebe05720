//! Measures how often the true error lay in the stated interval, on scenes and seeds that were not used to
//! make it.

use std::error::Error;

use dcd::scene::Scene;
use dcd::{Axis, Bounds, Fidelity, Viewpoint};
use serde::{Deserialize, Serialize};

use super::{Case, scene_of, world};
use crate::output::Shown;
use crate::page;
use crate::results::{Measured, short};

pub(super) const COVERAGE: Shown<Cover> = Shown { name: "fidelity-coverage", table, picture: None };

/// The part of the time that audits take where stated errors are compared with true ones. These worlds are
/// small: in a hundredth of the time few islands would be audited.
const AUDITED: f64 = 0.1;

/// How often the true error lay in the stated interval, for one scene and setting.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Cover {
    pub(super) scene: String,
    pub(super) setting: String,
    pub(super) runs: usize,
    pub(super) within: usize,
    pub(super) stated_m_s: f64,
    pub(super) true_m_s: f64,
}

/// Compares stated errors with the true ones, on scenes and seeds of their own. The true ones come from an
/// audit of every island in every tick.
pub(super) fn measure(seeds: i64) -> Result<Vec<Cover>, Box<dyn Error>> {
    let cases: [Case; 4] = [
        ("heap", "n", 150, true),
        ("gas", "n", 300, true),
        ("ragdolls", "count", 20, true),
        ("dve", "n", 400, true),
    ];
    let mut covers = Vec::new();
    for case in cases {
        // No run is another one's twin where both settings choose the same rates.
        for (setting, fidelity, first_seed) in
            [("auto", Fidelity::AUTO, 100), ("lowest rate", Fidelity::Tolerance { m_s: 1e6 }, 200)]
        {
            let (mut within, mut stated_sum, mut true_sum) = (0, 0.0, 0.0);
            for seed in 0..seeds {
                let scene = unseen(scene_of(case, first_seed + seed)?);
                let mut world = world(&scene, fidelity)?;
                world.set_audited(AUDITED);
                world.audit_all();
                (0..240).try_for_each(|_| world.step())?;
                let stated = world.fidelity_report().unwrap_or_default();
                let truth = world.host().true_error_m_s().unwrap_or_default();
                within += usize::from(
                    f64::from(stated.low95_m_s) <= truth && truth <= f64::from(stated.high95_m_s),
                );
                stated_sum += f64::from(stated.error_m_s);
                true_sum += truth;
            }
            eprintln!("{} {setting}: {within} of {seeds}", case.0);
            covers.push(Cover {
                scene: case.0.to_owned(),
                setting: setting.to_owned(),
                runs: seeds as usize,
                within,
                stated_m_s: stated_sum / seeds as f64,
                true_m_s: true_sum / seeds as f64,
            });
        }
    }
    Ok(covers)
}

/// Returns a scene in four regions that is looked at from empty ones beside it, and from nowhere else.
fn unseen(scene: Scene) -> Scene {
    let [min, max] = [scene.bounds.min, scene.bounds.max];
    let middle = |axis: usize| 0.5 * (min[axis] + max[axis]);
    Scene {
        bounds: Bounds::new([min[0] - 200.0, min[1], min[2]], max),
        cuts: vec![(Axis::X, min[0] - 100.0), (Axis::X, middle(0)), (Axis::Z, middle(2))],
        viewpoints: vec![Viewpoint { at: [min[0] - 150.0, 0.0, 0.0], radius_m: 1.0 }],
        ..scene
    }
}

impl Cover {
    fn cells(&self) -> Vec<String> {
        vec![
            self.scene.clone(),
            self.setting.clone(),
            self.runs.to_string(),
            self.within.to_string(),
            short(self.stated_m_s),
            short(self.true_m_s),
        ]
    }
}

fn table(covers: &[Measured<Cover>]) -> String {
    let head =
        ["scene", "setting", "runs", "true error within the stated interval", "stated, m/s", "true, m/s"];
    page::table(&head, covers.iter().map(|cover| cover.row.cells()))
}
