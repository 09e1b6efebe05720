//! Measures what it costs to compute loads out of proportion finer, and what that is worth: a tower under a
//! load of 100:1 and a chain with a bob of 1000:1 among ordinary bodies, beside one bare Rapier world.

use std::error::Error;

use dcd::physics::{Measured as _, View};
use dcd::runtime::WorldConfig;
use dcd::runtime::measure::{Plan, StepTimes, Subject};
use dcd::scene::{Params, Scene, SceneJoint};
use dcd::space::BodyId;
use dcd::{Axis, Fidelity};
use serde::{Deserialize, Serialize};

use crate::output::Shown;
use crate::page;
use crate::results::{Measured, short};
use crate::timing;

pub(super) const FINE: Shown<Row> = Shown { name: "fidelity-fine", table, picture: None };

/// The goals: `auto` sags and stretches by at most this part of one bare world, and takes at most so many
/// times its time.
const GOAL_SHARE: f64 = 0.25;
const GOAL_TIMES: f64 = 1.2;
/// The distance between the parts of the scene, metres: no body reaches another part.
const GAP_M: f64 = 10.0;
/// The height from which the chain hangs, metres: its bob does not come down to the ground.
const HANGS_FROM_M: f64 = 40.0;

/// One cut by one setting, on one thread. All of the world is looked at.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(super) struct Row {
    bodies: usize,
    /// `apart`: tower, chain and each half of the others have a region of their own; or `together`.
    cut: String,
    /// The number of regions; 0: one bare Rapier world.
    regions: usize,
    /// `bare`, `full` or `auto`.
    setting: String,
    /// Mean and 99th percentile of the run whose steps took least, milliseconds.
    step_ms: f64,
    p99_ms: f64,
    /// The time over that of one bare world: below 1 is faster.
    over_bare: f64,
    /// How far the top of the tower sank, and the bob, metres: the most in the steps after the timed ones,
    /// since the bob swings up and down.
    sag_m: f64,
    stretch_m: f64,
    /// The share of all movable bodies that sleep after the timed steps.
    asleep_percent: f64,
}

/// The outcome of a run.
struct Outcome {
    times: StepTimes,
    regions: usize,
    sag_m: f64,
    stretch_m: f64,
    asleep_percent: f64,
}

/// The scene, with the bodies by which its loads are judged.
struct Loads {
    scene: Scene,
    /// The cuts that put each part by itself.
    apart: Vec<(Axis, f64)>,
    top: BodyId,
    bob: BodyId,
}

/// Runs all cuts and settings in turn, several times over. Of each, the run with the smallest mean step
/// counts.
pub(super) fn measure(ordinary: usize, ticks: usize, repeats: usize) -> Result<Vec<Row>, Box<dyn Error>> {
    let loads = Loads::among(ordinary)?;
    let settings = [
        ("together", "bare", None),
        ("together", "full", Some(Fidelity::Off)),
        ("together", "auto", Some(Fidelity::AUTO)),
        ("apart", "full", Some(Fidelity::Off)),
        ("apart", "auto", Some(Fidelity::AUTO)),
    ];
    let mut best: Vec<Option<Outcome>> = settings.iter().map(|_| None).collect();
    for round in 1..=repeats {
        for (&(cut, setting, fidelity), best) in settings.iter().zip(&mut best) {
            eprintln!("loads, {ordinary} ordinary bodies: round {round} of {repeats}, {cut}, {setting}");
            let outcome =
                loads.run(fidelity.map(|fidelity| loads.config(cut == "apart", fidelity)), ticks)?;
            if best.as_ref().is_none_or(|best| outcome.mean_ms() < best.mean_ms()) {
                *best = Some(outcome);
            }
        }
    }
    let outcomes: Vec<_> = best.into_iter().flatten().collect();
    let bare_ms = outcomes.first().map_or(f64::NAN, Outcome::mean_ms);
    let rows = settings.into_iter().zip(&outcomes).map(|((cut, setting, _), outcome)| Row {
        bodies: loads.scene.bodies.iter().filter(|body| !body.body.build().is_fixed()).count(),
        cut: cut.to_owned(),
        regions: outcome.regions,
        setting: setting.to_owned(),
        step_ms: outcome.mean_ms(),
        p99_ms: outcome.times.p99.unwrap_or(f64::NAN),
        over_bare: outcome.mean_ms() / bare_ms,
        sag_m: outcome.sag_m,
        stretch_m: outcome.stretch_m,
        asleep_percent: outcome.asleep_percent,
    });
    Ok(rows.collect())
}

impl Loads {
    /// Builds the scene. Along x, beside one another, stand towers of boxes that may sleep, as many that may
    /// not, the loaded tower and the chain.
    fn among(ordinary: usize) -> Result<Self, Box<dyn Error>> {
        let pile = |sleep: i64| {
            let params = Params::new().with("n", (ordinary / 2) as i64).with("height", 5);
            Scene::named("pile", &params.with("jitter", 0.2).with("sleep", sleep))
        };
        let tower = Scene::named("tower", &Params::new().with("top_mass_ratio", 100).with("sleep", 0))?;
        let mut chain = Scene::named("chain", &Params::new().with("bob_mass_ratio", 1_000))?;
        chain.bodies.iter_mut().for_each(|body| body.pose.translation[1] += HANGS_FROM_M);
        chain.bounds = chain.tight_bounds().ok_or("a chain has bodies")?;
        let mut scene = Scene::empty("loads");
        let (mut apart, mut lasts, mut right_m) = (Vec::new(), Vec::new(), 0.0);
        for part in [pile(1)?, pile(0)?, tower, chain] {
            let (first, shift_m) = (scene.bodies.len(), right_m - part.bounds.min[0]);
            let mut bounds = part.bounds;
            bounds.min[0] += shift_m;
            bounds.max[0] += shift_m;
            scene.bounds = if first == 0 { bounds } else { scene.bounds.union(&bounds) };
            scene.bodies.extend(part.bodies.into_iter().map(|mut body| {
                body.pose.translation[0] += shift_m;
                body
            }));
            let tied = |joint: &SceneJoint| SceneJoint { a: joint.a + first, b: joint.b + first, ..*joint };
            scene.joints.extend(part.joints.iter().map(tied));
            lasts.push(BodyId::persistent(scene.bodies.len() as u32 - 1));
            apart.push((Axis::X, bounds.max[0] + 0.5 * GAP_M));
            right_m = bounds.max[0] + GAP_M;
        }
        apart.pop();
        scene.regions = Some(1);
        Ok(Self { scene, apart, top: lasts[2], bob: lasts[3] })
    }

    fn config(&self, is_apart: bool, fidelity: Fidelity) -> WorldConfig {
        let cuts = if is_apart { self.apart.clone() } else { Vec::new() };
        WorldConfig { fidelity, ..WorldConfig::for_scene(&Scene { cuts, ..self.scene.clone() }) }
    }

    /// Runs the scene once; without a configuration as one bare Rapier world.
    fn run(&self, config: Option<WorldConfig>, ticks: usize) -> Result<Outcome, Box<dyn Error>> {
        let regions = usize::from(config.is_some());
        let mut subject = Plan { config, ticks: ticks as u64 }.subject(&self.scene)?;
        let before = self.heights_m(&subject);
        let times = StepTimes::of(&timing::steps(&mut subject, ticks)?);
        let (mut asleep, mut all) = (0, 0);
        for (_, body) in subject.views().into_iter().flat_map(View::owned) {
            asleep += usize::from(body.is_sleeping());
            all += 1;
        }
        let mut sunk_m = [0.0f64; 2];
        for _ in 0..ticks / 2 {
            timing::step(&mut subject)?;
            let now = self.heights_m(&subject);
            sunk_m = std::array::from_fn(|i| sunk_m[i].max(before[i] - now[i]));
        }
        let [sag_m, stretch_m] = sunk_m;
        Ok(Outcome {
            times,
            regions: regions * subject.views().len(),
            sag_m,
            stretch_m,
            asleep_percent: 100.0 * asleep as f64 / all as f64,
        })
    }

    /// Returns the heights of the top of the tower and of the bob.
    fn heights_m(&self, subject: &Subject) -> [f64; 2] {
        let states = subject.states();
        [self.top, self.bob].map(|id| {
            let at = states.binary_search_by_key(&id, |state| state.0).expect("no body is lost");
            states[at].2.translation[1]
        })
    }
}

impl Outcome {
    fn mean_ms(&self) -> f64 {
        self.times.mean.unwrap_or(f64::NAN)
    }
}

/// Returns the table; bold where `auto` misses its goal.
fn table(rows: &[Measured<Row>]) -> String {
    let head = [
        "cut",
        "regions",
        "bodies",
        "setting",
        "step, ms",
        "p99",
        "over bare",
        "sag, m",
        "stretch, m",
        "asleep at the end, %",
    ];
    let bare = rows.iter().map(|row| &row.row).find(|row| row.setting == "bare");
    let cells = |Measured { row, .. }: &Measured<Row>| {
        let judged = |text: String, value: f64, most: Option<f64>| {
            let is_missed = row.setting == "auto" && most.is_some_and(|most| value > most);
            if is_missed { format!("**{text}**") } else { text }
        };
        let part = |of: fn(&Row) -> f64| bare.map(|bare| GOAL_SHARE * of(bare));
        vec![
            row.cut.clone(),
            row.regions.to_string(),
            row.bodies.to_string(),
            row.setting.clone(),
            short(row.step_ms),
            short(row.p99_ms),
            judged(format!("{:.2}×", row.over_bare), row.over_bare, Some(GOAL_TIMES)),
            judged(format!("{:.3}", row.sag_m), row.sag_m, part(|row| row.sag_m)),
            judged(format!("{:.3}", row.stretch_m), row.stretch_m, part(|row| row.stretch_m)),
            format!("{:.0}", row.asleep_percent),
        ]
    };
    page::table(&head, rows.iter().map(cells))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Machine;

    #[test]
    fn in_one_region_all_in_full_is_bare_rapier_to_the_bit_and_auto_bears_the_loads() {
        let rows = measure(40, 120, 1).unwrap();
        let [bare, full, auto, apart, apart_auto] = &rows[..] else { panic!("{rows:?}") };
        let of = |row: &Row| (row.bodies, row.sag_m, row.stretch_m, row.asleep_percent);
        assert_eq!(of(bare), of(full));
        assert_eq!(rows.iter().map(|row| row.regions).collect::<Vec<_>>(), [0, 1, 1, 4, 4]);
        assert_eq!(bare.bodies, 40 + 10 + 17);
        for (row, plain) in [(auto, bare), (apart_auto, apart)] {
            let parts = [row.sag_m / plain.sag_m, row.stretch_m / plain.stretch_m];
            assert!(parts.into_iter().all(|part| (0.0..0.5).contains(&part)), "{rows:?}");
        }
    }

    #[test]
    fn what_misses_the_goal_is_bold() {
        let machine = Machine { cpu: "a".into(), cores: 2, date: "2026-11-28".into(), commit: "b".into() };
        let row = |setting: &str, over_bare, sag_m, stretch_m| Measured {
            row: Row { setting: setting.into(), over_bare, sag_m, stretch_m, ..Row::default() },
            machine: machine.clone(),
        };
        let text =
            table(&[row("bare", 1.0, 0.4, 4.0), row("full", 1.3, 0.4, 4.0), row("auto", 1.3, 0.2, 0.9)]);
        let bold: Vec<_> = text.split("**").skip(1).step_by(2).collect();
        assert_eq!(bold, ["1.30×", "0.200"], "{text}");
    }
}
