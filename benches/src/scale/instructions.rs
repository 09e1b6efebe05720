//! Measures cost without noise: instructions per step on one thread, counted by callgrind of valgrind. The
//! program runs itself as a child.

use std::error::Error;
use std::process::{Command, Stdio};

use clap::Args;
use dcd::runtime::measure::{Plan, Subject};

use super::case::{CASES, Case};
use super::setting::Setting;

/// The number of steps. The count of the first one is subtracted: what it takes to make a world is no step.
const TICKS: u64 = 60;

/// What two regions with the default coupling may execute at most, over one bare world: a twentieth above
/// what was counted in a dev build with CARGO_INCREMENTAL=0. (An incremental build has more units, and
/// executes up to a tenth more.) In a dev build our own code is optimised less than Rapier's, which is
/// compiled in one unit. Small scenes have a third of their bodies at the border.
pub(super) const HELD: [(&str, f64); 6] =
    [("rubble", 2.56), ("dve", 2.79), ("gas", 3.43), ("pour", 3.67), ("pyramid", 1.47), ("wall", 2.36)];

/// Returns the scenes that are counted: those asked for, or all in `HELD`.
pub(super) fn counted(asked: &[String]) -> Result<Vec<&'static Case>, String> {
    let is_held = |case: &&Case| HELD.iter().any(|(name, _)| *name == case.name);
    match asked {
        [] => Ok(CASES.iter().filter(is_held).collect()),
        asked => asked.iter().map(|name| Case::named(name)).collect(),
    }
}

/// Counts what two regions with the default coupling execute, over one bare world.
pub(super) fn over_bare(case: &Case) -> Result<f64, Box<dyn Error>> {
    Ok(count(case, Setting::Auto(2))? as f64 / count(case, Setting::Bare)? as f64)
}

/// Returns why this ratio of a scene is too much, if it is.
pub(super) fn above(scene: &str, over_bare: f64) -> Option<String> {
    let (_, held) = HELD.into_iter().find(|(name, _)| *name == scene)?;
    let text =
        || format!("{scene}: {over_bare:.2} times the instructions of one bare world; {held} were held");
    (over_bare > held).then(text)
}

/// Steps a scene and nothing else: started by `scale` under valgrind, or by hand for a profiler.
#[derive(Args)]
pub(crate) struct ScaleWorker {
    #[arg(long)]
    scene: String,
    #[arg(long)]
    setting: String,
    #[arg(long)]
    regions: usize,
    #[arg(long)]
    ticks: u64,
    /// Runs the scene in its full size, for a profiler.
    #[arg(long)]
    full: bool,
}

impl ScaleWorker {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        let scene = Case::named(&self.scene)?.scene(!self.full)?;
        let config = Setting::named(&self.setting, self.regions)?.config(&scene, 1);
        let plan = Plan { config, ticks: self.ticks };
        let mut subject = plan.subject(&scene)?;
        for _ in 0..plan.ticks {
            match &mut subject {
                Subject::Bare(world) => world.step(),
                Subject::Regions(world) => world.step()?,
            }
        }
        Ok(())
    }
}

/// Returns whether valgrind is there.
pub(super) fn can_count() -> bool {
    let version =
        Command::new("valgrind").arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    version.is_ok_and(|status| status.success())
}

/// Counts the instructions of all steps but the first.
fn count(case: &Case, setting: Setting) -> Result<u64, Box<dyn Error>> {
    let of = |ticks: u64| -> Result<u64, Box<dyn Error>> {
        let regions = setting.asked_regions().ok_or("instructions are counted where regions are given")?;
        let output = Command::new("valgrind")
            .args(["--tool=callgrind", "--callgrind-out-file=/dev/null"])
            .arg(std::env::current_exe()?)
            .args(["scale-worker", "--scene", case.name, "--setting", setting.name()])
            .args(["--regions", &regions.to_string(), "--ticks", &ticks.to_string()])
            .output()
            .map_err(|error| format!("cannot run valgrind: {error}"))?;
        let said = String::from_utf8_lossy(&output.stderr);
        match collected(&said) {
            Some(count) if output.status.success() => Ok(count),
            _ => Err(format!("{} under valgrind failed: {said}", case.name).into()),
        }
    };
    Ok(of(TICKS)?.saturating_sub(of(1)?))
}

/// Reads the count from valgrind's last words.
fn collected(said: &str) -> Option<u64> {
    let line = said.lines().rev().find_map(|line| line.split_once("Collected :"))?;
    line.1.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_takes_more_than_was_held_is_named() {
        assert_eq!(above("pyramid", 1.4), None);
        assert!(above("pyramid", 1.6).unwrap().contains("pyramid: 1.60 times"));
        assert_eq!(above("net", 9.0), None, "nothing is held");
    }

    #[test]
    fn every_scene_that_is_held_is_counted_unless_others_are_asked_for() {
        let names = |asked: &[String]| -> Vec<_> {
            counted(asked).unwrap().into_iter().map(|case| case.name).collect()
        };
        let all = names(&[]);
        assert_eq!(all.len(), HELD.len(), "{all:?}");
        assert!(HELD.iter().all(|(name, _)| all.contains(name)), "{all:?}");
        assert_eq!(names(&["net".to_owned()]), ["net"]);
    }

    #[test]
    fn the_count_is_read_from_valgrinds_last_words() {
        let said =
            "==7== Events    : Ir\n==7== Collected : 1234567\n==7== \n==7== I   refs:      1,234,567\n";
        assert_eq!(collected(said), Some(1_234_567));
        assert_eq!(collected("valgrind: not a program"), None);
    }
}
