//! Films the world of a subcommand into a glTF file: the moment at its end, or a stretch as an animation.

use std::fs::File;
use std::io::BufWriter;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::common::Common;
use super::draft::Draft;
use super::failure::Failure;
use crate::drawing::{Film, GltfError, Source};

/// The options of a subcommand that films.
#[derive(clap::Args)]
pub(super) struct FilmArgs {
    /// Write the world at the end as a binary glTF file, for Blender, engines and papers: bodies by their shapes, nodes named by their
    /// ids, in the colours of the regions that own them; an existing file is replaced
    #[arg(long, value_name = "FILE.glb")]
    gltf: Option<PathBuf>,
    /// With --gltf: write what happens from second A to second B, counted from the start, as an animation
    #[arg(long, value_name = "A..B", requires = "gltf", value_parser = stretch)]
    gltf_seconds: Option<Range<f64>>,
    /// With --gltf-seconds: poses of each body per second
    #[arg(long, value_name = "N", requires = "gltf_seconds", default_value = "30", value_parser = clap::value_parser!(u16).range(1..=1000))]
    gltf_rate: u16,
}

impl FilmArgs {
    /// Returns whether there is something to film.
    pub(super) fn is_given(&self) -> bool {
        self.gltf.is_some()
    }

    /// Returns the path of the film, if there is to be one.
    pub(super) fn path(&self) -> Option<&Path> {
        self.gltf.as_deref()
    }

    /// Refuses a stretch that begins when a run of so many seconds is over: nothing of it would be filmed.
    pub(super) fn check_begin(&self, run_s: f64) -> Result<(), Failure> {
        match &self.gltf_seconds {
            Some(Range { start, end }) if *start >= run_s => Err(Failure::usage(format!(
                "--gltf-seconds {start}..{end} begins when the run of {run_s} s is over; begin earlier, or run longer (--seconds)"
            ))),
            _ => Ok(()),
        }
    }

    /// Checks that the file can be written, so that a wrong path does not cost a long run. Its former content
    /// stays until the end.
    pub(super) fn open(self) -> Result<Option<Camera>, Failure> {
        let Some(path) = self.gltf else { return Ok(None) };
        let draft = Draft::check(path.clone());
        let draft = draft.map_err(|error| Failure::usage(refused(&path, &error.into())))?;
        let next_s = self.gltf_seconds.as_ref().map_or(0.0, |stretch| stretch.start);
        Ok(Some(Camera {
            draft,
            stretch: self.gltf_seconds,
            period_s: 1.0 / f64::from(self.gltf_rate),
            next_s,
            seen_s: 0.0,
            film: Film::default(),
            taken: 0,
            failed: None,
        }))
    }
}

/// A film in the making.
pub(super) struct Camera {
    draft: Draft,
    stretch: Option<Range<f64>>,
    period_s: f64,
    /// The time at which the next picture is due.
    next_s: f64,
    /// The time up to which there was something to film.
    seen_s: f64,
    film: Film,
    taken: usize,
    failed: Option<GltfError>,
}

impl Camera {
    /// Takes a picture, if one is due at this time since the start.
    pub(super) fn look(&mut self, world: &impl Source, seconds: f64) {
        // Ticks are not exact fractions of a second.
        const NEAR_S: f64 = 1e-6;
        self.seen_s = seconds;
        let is_in = self.stretch.as_ref().is_some_and(|stretch| seconds <= stretch.end + NEAR_S);
        if !is_in || seconds + NEAR_S < self.next_s || self.failed.is_some() {
            return;
        }
        while self.next_s <= seconds + NEAR_S {
            self.next_s += self.period_s;
        }
        self.take(world, seconds);
    }

    /// Refuses a stretch that begins when what there is to film, so many seconds, is over.
    pub(super) fn check_reached(&self, seconds: f64) -> Result<(), Failure> {
        match &self.stretch {
            Some(Range { start, end }) if self.taken == 0 && *start >= seconds => {
                Err(Failure::usage(format!(
                    "--gltf-seconds {start}..{end} begins when the replay of {seconds:.1} s is over; begin earlier"
                )))
            }
            _ => Ok(()),
        }
    }

    /// Writes the file. It has the world as it is now if no stretch was asked for, or none of it was reached,
    /// which is said then.
    pub(super) fn finish(
        mut self,
        world: Option<&impl Source>,
        seconds: f64,
        common: &Common,
    ) -> Result<(), Failure> {
        let (taken, stretch, seen_s) = (self.taken, self.stretch.clone(), self.seen_s);
        if taken == 0
            && let Some(world) = world
        {
            self.take(world, seconds);
        }
        if let Some(Range { start, end }) = stretch {
            if taken == 0 {
                common.say(&format!(
                    "nothing of --gltf-seconds {start}..{end} was reached: the film has the end alone"
                ));
            } else if seen_s + self.period_s < end {
                common.say(&format!(
                    "--gltf-seconds {start}..{end}: the film ends at {seen_s:.1} s, after which there is nothing to film"
                ));
            }
        }
        let Self { draft, film, taken, failed, .. } = self;
        let path = draft.path();
        let written =
            failed.map_or_else(|| draft.write(|path| film.write(BufWriter::new(File::create(path)?))), Err);
        written.map_err(|error| Failure::run(refused(path, &error)))?;
        let megabytes = path.metadata().map_or(0.0, |metadata| metadata.len() as f64 / 1e6);
        common.say(&format!("wrote {}: {taken} moments in {megabytes:.1} MB", path.display()));
        Ok(())
    }

    fn take(&mut self, world: &impl Source, seconds: f64) {
        self.failed = self.film.look(world, seconds).err();
        self.taken += 1;
    }
}

fn refused(path: &Path, error: &GltfError) -> String {
    format!("cannot write --gltf {}: {error}", path.display())
}

/// Parses a stretch of time: 2..5, in seconds.
fn stretch(text: &str) -> Result<Range<f64>, String> {
    let wrong = || "write two times in seconds, the lower one first, as 2..5 or 0..0.5".to_owned();
    let (from, to) = text.split_once("..").ok_or_else(wrong)?;
    let seconds = |text: &str| text.parse::<f64>().ok().filter(|v| (0.0..=1e9).contains(v)).ok_or_else(wrong);
    let (from, to) = (seconds(from)?, seconds(to)?);
    if from < to { Ok(from..to) } else { Err(wrong()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stretch_has_a_beginning_before_its_end() {
        assert_eq!(stretch("2..5"), Ok(2.0..5.0));
        assert_eq!(stretch("0..0.5"), Ok(0.0..0.5));
        for wrong in ["5", "5..2", "2..2", "-1..2", "a..b", "1..inf", "..", "NaN..2"] {
            assert!(stretch(wrong).is_err(), "{wrong}");
        }
    }
}
