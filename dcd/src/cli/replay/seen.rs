//! Shows a replayed world: in the browser, where it goes to any tick, and in a glTF file.

use std::net::SocketAddr;
use std::path::PathBuf;

use super::{step, told};
use crate::cli::common::Common;
use crate::cli::failure::Failure;
use crate::cli::film::Camera;
use crate::cli::interrupt::Interrupt;
use crate::cli::view;
use crate::drawing::{Hosts, Source as _};
use crate::recording::{RecordingError, Replay};
use crate::runtime::{last_recorded_tick, replayed_regions};
use crate::space::Tick;
use crate::view::Due;

/// Returns the regions of a replay as they are now, to be drawn; `None` if nothing is computed whose bodies
/// have shapes.
fn hosts(replay: &Replay) -> Option<Hosts<'_>> {
    let members = replay.present_members();
    let regions = members.filter_map(|member| Some((member.who().node(), replayed_regions(member)?)));
    Hosts::of(replay.tick().0, regions)
}

/// A replay that is to be shown by a page.
pub(super) struct Shown {
    pub(super) files: Vec<PathBuf>,
    pub(super) until: Tick,
    /// Says whether the replay pauses where it parts from the recording.
    pub(super) check: bool,
}

impl Shown {
    /// Shows a replay until the program is to end. `again` begins the replay anew, to go back.
    pub(super) fn show(
        &self,
        at: SocketAddr,
        mut replay: Replay,
        again: impl Fn() -> Result<Replay, Failure>,
        interrupt: Interrupt,
        common: &Common,
    ) -> Result<(), Failure> {
        let fails = |error: RecordingError| Failure::run(error.to_string());
        let first =
            replay.next_tick().ok_or_else(|| Failure::run("nothing to show: no tick is on record"))?;
        let last = self.files.iter().filter_map(|file| last_recorded_tick(file).ok()).max();
        let last = last.unwrap_or(first).min(self.until).max(first);
        let name = self.files[0].file_name().map_or_else(String::new, |name| name.display().to_string());
        let mut viewer = view::open(at, &name, common)?.with_recording([first.0, last.0]);
        let (mut goal, mut told) = (None::<Tick>, false);
        step(&mut replay, first).map_err(fails)?;
        loop {
            if !told && replay.mismatch().is_some() {
                told = true;
                common.say(&told::words(&replay));
                if self.check {
                    viewer.pause();
                    goal = None;
                }
            }
            let seen = hosts(&replay).ok_or_else(|| {
                Failure::usage("nothing to show: servers have no regions, and the bodies of simulated clusters are points; leave --view out")
            })?;
            goal = goal.filter(|goal| *goal > replay.tick());
            viewer.show_replayed(&seen, goal.map(|goal| goal.0));
            let due = match goal {
                Some(_) if interrupt.asked() => None,
                Some(_) => Some(viewer.take_goal().map_or(Due::Step, Due::Goal)),
                None => viewer.wait_for(&seen, seen.dt_s(), || interrupt.asked()),
            };
            match due {
                None => return Ok(()),
                Some(Due::Goal(tick)) => {
                    if tick < replay.tick().0 {
                        replay = again()?;
                        step(&mut replay, first).map_err(fails)?;
                    }
                    goal = Some(Tick(tick));
                }
                Some(Due::Step) => match replay.next_tick().filter(|next| *next <= last) {
                    Some(next) => step(&mut replay, next).map_err(fails)?,
                    None => {
                        viewer.pause();
                        goal = None;
                    }
                },
            }
        }
    }
}

/// A film of a replay, if there is to be one.
pub(super) struct Film {
    camera: Option<Camera>,
    /// The tick before the first one.
    begin: u64,
}

impl Film {
    pub(super) fn begin(camera: Option<Camera>, replay: &Replay) -> Self {
        Self { camera, begin: replay.next_tick().map_or(0, |first| first.0.saturating_sub(1)) }
    }

    /// Takes a picture after a tick, if one is due.
    pub(super) fn look(&mut self, replay: &Replay) {
        if let Some(camera) = &mut self.camera
            && let Some(seen) = hosts(replay)
        {
            camera.look(&seen, seconds(&seen, self.begin));
        }
    }

    /// Writes the file. `is_whole` says that nothing ended the replay early.
    pub(super) fn finish(self, replay: &Replay, is_whole: bool, common: &Common) -> Result<(), Failure> {
        let Some(camera) = self.camera else { return Ok(()) };
        let seen =
            hosts(replay).ok_or_else(|| Failure::usage("there is nothing to film: leave --gltf out"))?;
        if is_whole {
            camera.check_reached(seconds(&seen, self.begin))?;
        }
        camera.finish(Some(&seen), 0.0, common)
    }
}

/// Returns the time since the end of the tick `begin`, in seconds.
fn seconds(seen: &Hosts<'_>, begin: u64) -> f64 {
    f64::from(seen.dt_s()) * seen.tick().saturating_sub(begin) as f64
}
