//! Saves and restores worlds of the command line as snapshots.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::cli::common::Common;
use crate::cli::draft::place_of;
use crate::cli::failure::Failure;
use crate::runtime::{LocalWorld, SnapshotError};

/// The path of a snapshot, beside which a file could be written before the run began, so that a wrong path
/// does not cost a long run.
pub(super) struct Target {
    path: PathBuf,
}

impl Target {
    pub(super) fn check(path: PathBuf) -> Result<Self, Failure> {
        let target = Self { path };
        check_place(&target.path).map_err(|cause| Failure::usage(target.refused(&cause)))?;
        Ok(target)
    }

    pub(super) fn write(&self, world: &LocalWorld, common: &Common) -> Result<(), Failure> {
        let start = Instant::now();
        world.save_file(&self.path).map_err(|error| Failure::run(self.refused(&error)))?;
        say(&self.path, "saved", start, common);
        Ok(())
    }

    fn refused(&self, cause: &dyn std::fmt::Display) -> String {
        format!(
            "cannot save to {}: {cause}; give --save a file in a folder that exists and that you may write to",
            self.path.display()
        )
    }
}

/// Checks that a snapshot can be written to a path; otherwise it returns the cause.
pub(in crate::cli) fn check_place(path: &Path) -> Result<(), String> {
    if path.is_dir() {
        return Err("it is a folder".to_owned());
    }
    if path.exists() && !path.is_file() {
        return Err("it is a device or a pipe, not a regular file".to_owned());
    }
    let mut part = place_of(path).into_os_string();
    part.push(format!(".{}.part", std::process::id()));
    File::create_new(&part).and_then(|_| fs::remove_file(&part)).map_err(|error| error.to_string())
}

/// Returns whether this path is that of a snapshot, by its extension or its content.
pub(in crate::cli) fn is_one(path: &str) -> bool {
    path.ends_with(".dcd") || begins_as_one(Path::new(path)).unwrap_or(false)
}

fn begins_as_one(path: &Path) -> io::Result<bool> {
    // Nobody may ever write to a pipe.
    if !path.metadata()?.is_file() {
        return Ok(false);
    }
    let mut beginning = Vec::new();
    File::open(path)?.take(8).read_to_end(&mut beginning)?;
    Ok(LocalWorld::is_snapshot(&beginning))
}

pub(in crate::cli) fn restore(path: &str, threads: usize, common: &Common) -> Result<LocalWorld, Failure> {
    let start = Instant::now();
    let restored =
        LocalWorld::open_snapshot(path.as_ref()).and_then(|file| LocalWorld::restore(file, threads));
    let world = restored.map_err(|error| {
        let said = format!("cannot go on with {path}: {error}");
        if matches!(error, SnapshotError::Threads(_)) { Failure::run(said) } else { Failure::usage(said) }
    })?;
    say(Path::new(path), "restored", start, common);
    Ok(world)
}

fn say(path: &Path, done: &str, start: Instant, common: &Common) {
    let megabytes = path.metadata().map_or(0.0, |metadata| metadata.len() as f64 / 1e6);
    let seconds = start.elapsed().as_secs_f64();
    common.say(&format!("{done} {}: {megabytes:.1} MB in {seconds:.2} s", path.display()));
}
