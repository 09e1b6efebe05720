//! Implements `dcd replay`: computes a recorded world again, finds where it parts from its recording, and shows it.

mod seen;
mod told;

use std::collections::BTreeSet;
use std::fs;
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use indicatif::ProgressBar;

use super::common::{Common, print};
use super::draft::place_of;
use super::failure::Failure;
use super::film::FilmArgs;
use super::interrupt::Interrupt;
use super::values::address;
use super::view::ANY_PORT;
use crate::recording::{Cut, Flip, Maker, RecordingError, Replay as Worlds, Who};
use crate::runtime::open_recording;
use crate::sim::StandIn;
use crate::space::{BodyId, ClientId, Tick};

/// The file extension of recordings.
pub(super) const RECORDING: &str = "dcdr";

/// Computes a recorded world again, bit for bit, and finds where it parts from its recording
///
/// Examples:
///   dcd run pile --set n=500 --regions 4 --record pile.dcdr
///   dcd replay pile.dcdr --check
///   dcd replay pile.dcdr --dump 120 > bodies.csv
///   dcd replay pile.dcdr --view
///   dcd replay pile.dcdr --gltf fall.glb --gltf-seconds 0..5
///   dcd node --token $(dcd token --role node) --record node.dcdr
///   dcd replay FOLDER --check --json     (all *.dcdr of a folder: the members of one cluster)
///
/// One process gives each node again what it was given, with its times, as fast as it can. After each tick
/// the digest of each region is compared with the recorded one. Where a single bit of a body differs, body
/// and field are found too.
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_long_help = "--json prints the keys ticks matches mismatch{node,tick,region,body,field,recorded,replayed}, where mismatch is null if all\n\
        digests were as recorded; what a digest cannot tell is null too: of a server all but the tick. ticks counts the ticks that were replayed.\n\
        matches counts digests: one for each region and tick, and those of a server, of all that it has sent and stored."
)]
pub(super) struct Replay {
    /// Recordings of one world, or folders of such (*.dcdr)
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Stop at the first difference, and exit with 1
    #[arg(long)]
    check: bool,
    /// Stop after this tick
    #[arg(long, value_name = "TICK", value_parser = clap::value_parser!(u64).range(1..))]
    until: Option<u64>,
    /// Print the bodies as they are after this tick, as CSV: body, node, region, and the fields of the state, positions relative to the
    /// region
    #[arg(long, value_name = "TICK", conflicts_with_all = ["until", "json"], value_parser = clap::value_parser!(u64).range(1..))]
    dump: Option<u64>,
    /// Flip a bit of a body after a tick on purpose, as 120:7 or 120:c2/b1: the lowest of linvel.x or, with
    /// :BIT, another. Bits 0, 64 and 128 are the lowest of x, y and z, 192 that of the rotation
    #[arg(long, value_name = "TICK:BODY", value_parser = flip)]
    flip: Option<Flip>,
    /// Threads that step a world [default: all cores]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Show the world in the browser: serve a page at this address, or at any free port of this machine if
    /// none is given, and print its URL on standard error. The page steps, pauses, and goes to any tick,
    /// backwards too; with --check it pauses at the first difference
    #[arg(long, value_name = "ADDR", num_args = 0..=1, default_missing_value = ANY_PORT, value_parser = address, conflicts_with_all = ["dump", "json", "gltf"])]
    view: Option<SocketAddr>,
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    film: FilmArgs,
}

impl Replay {
    pub(super) fn execute(self, common: &Common) -> Result<ExitCode, Failure> {
        self.check_film()?;
        let interrupt = Interrupt::listen()?;
        let again = || open(&self.files, self.threads, self.flip, common);
        let mut replay = again()?;
        if self.dump.is_some() {
            check_bodies(&replay, &self.files[0], "print")?;
        }
        let until = Tick(self.dump.or(self.until).unwrap_or(u64::MAX));
        if let Some(at) = self.view {
            let shown = seen::Shown { files: files(&self.files, |_| ())?, until, check: self.check };
            shown.show(at, replay, again, interrupt, common)?;
            return Ok(interrupt.exit_code());
        }
        let mut film = seen::Film::begin(self.film.open()?, &replay);
        let bar = ticks(common, self.json);
        let mut failed = Ok(());
        while let Some(next) = replay.next_tick().filter(|next| *next <= until) {
            if interrupt.asked() || self.check && replay.mismatch().is_some() {
                break;
            }
            if let Err(error) = step(&mut replay, next) {
                failed = Err(Failure::run(error.to_string()));
                break;
            }
            bar.set_position(replay.tick_count());
            film.look(&replay);
        }
        bar.finish_and_clear();
        // The JSON object is the last line.
        let is_whole = failed.is_ok() && !interrupt.asked() && !(self.check && replay.mismatch().is_some());
        let filmed = film.finish(&replay, is_whole, common);
        tell_cuts(&replay, common);
        let is_answered = self.dump.is_none_or(|tick| replay.ticks() >= tick)
            && (self.flip.is_none() || replay.members().any(|member| member.has_flipped()))
            && (!self.check || replay.matches() > 0 || replay.mismatch().is_some());
        if interrupt.asked() && !is_answered {
            return Err(Failure::interrupted());
        }
        if self.dump.is_some() {
            std::mem::replace(&mut failed, Ok(()))?;
            if let Some(found) = replay.mismatch() {
                common.say(&format!("it parted from the recording after tick {}", found.tick.0));
            }
        }
        if let Some(tick) = self.dump {
            if replay.ticks() < tick {
                return Err(Failure::usage(extent(&replay)));
            }
            print(&told::csv(&replay))?;
        } else if self.json {
            print(&told::json(&replay))?;
        } else {
            print(&told::words(&replay))?;
        }
        failed?;
        filmed?;
        if let Some(Flip { tick, body, .. }) = self.flip
            && !replay.members().any(|member| member.has_flipped())
        {
            let tick = tick.0;
            return Err(Failure::usage(if replay.ticks() == 0 {
                format!("nothing was flipped: {}", extent(&replay))
            } else {
                format!(
                    "nothing was flipped: body {body} is not owned by anybody after tick {tick}, or its state has no such bit"
                )
            }));
        }
        let is_empty = replay.ticks() == 0 && !interrupt.asked();
        if (self.check || is_empty) && replay.matches() == 0 && replay.mismatch().is_none() {
            let why = if replay.ticks() == 0 { extent(&replay) } else { "no tick is on record".to_owned() };
            return Err(Failure::run(format!("nothing was compared: {why}")));
        }
        let parts = self.check && replay.mismatch().is_some();
        Ok(if parts { ExitCode::FAILURE } else { interrupt.exit_code() })
    }

    /// Checks that the film is written over none of the recordings.
    fn check_film(&self) -> Result<(), Failure> {
        let Some(film) = self.film.path() else { return Ok(()) };
        match files(&self.files, |_| ())?.iter().any(|file| place_of(file) == place_of(film)) {
            true => Err(Failure::usage(format!(
                "--gltf {} is a recording that is to be replayed, which would be overwritten; give --gltf another file",
                film.display()
            ))),
            false => Ok(()),
        }
    }
}

/// Checks that a replay has bodies to do this with: a server's recording alone has none.
pub(super) fn check_bodies(replay: &Worlds, path: &Path, what: &str) -> Result<(), Failure> {
    if replay.members().any(|member| member.who() != Who::Server) {
        return Ok(());
    }
    let path = path.display();
    Err(Failure::run(format!(
        "{path} is the recording of a server, which has no bodies to {what}: give the folder that has those of its nodes too; \
         dcd replay --check checks what the server sent and stored"
    )))
}

/// Returns which ticks are on record, for a user who asked for others.
fn extent(replay: &Worlds) -> String {
    match replay.next_tick().filter(|_| replay.ticks() == 0) {
        Some(first) => format!("the recording begins with tick {}; name one from that on", first.0),
        None if replay.ticks() == 0 => {
            "no tick is on record: it was cut off, or ended, before the first".to_owned()
        }
        None => {
            let again = if replay.tick_count() > replay.ticks() {
                format!(" ({} were replayed, as the world went back)", replay.tick_count())
            } else {
                String::new()
            };
            format!("the recording ends after tick {}{again}; name one up to that", replay.ticks())
        }
    }
}

/// Says which recordings have no end. What is surely missing is said even with `--quiet`.
pub(super) fn tell_cuts(replay: &Worlds, common: &Common) {
    for (name, tick, cut) in replay.cuts() {
        let place = match tick {
            Tick(0) => "before its first tick".to_owned(),
            Tick(tick) => format!("after tick {tick}"),
        };
        match cut {
            Cut::AfterChunk => common.say(&format!(
                "{name} has no end, as that of a process that was killed: it is replayed as far as it goes, and stops {place}"
            )),
            Cut::WithinChunk => common.tell(&format!(
                "{name} is cut off {place}: the rest of the file is missing, or its disk was full or its process killed while it \
                 wrote"
            )),
        }
    }
}

/// Has all members complete a tick.
fn step(replay: &mut Worlds, tick: Tick) -> Result<(), RecordingError> {
    while replay.advance(tick)? {}
    Ok(())
}

/// Opens recordings of one world, whose replay is disturbed by a flip, if one is given.
pub(super) fn open(
    paths: &[PathBuf],
    threads: Option<u16>,
    flip: Option<Flip>,
    common: &Common,
) -> Result<Worlds, Failure> {
    let threads =
        threads.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from);
    let here = Maker::here();
    let (mut members, mut known) = (Vec::new(), BTreeSet::new());
    let say = |empty: &Path| common.say(&format!("{} is empty and left out", empty.display()));
    for file in files(paths, say)? {
        if !known.insert(file.canonicalize().unwrap_or_else(|_| file.clone())) {
            return Err(Failure::usage(format!("{} is given twice", file.display())));
        }
        let fails = |error: RecordingError| Failure::usage(format!("{}: {error}", file.display()));
        let mut member = open_recording(&file, threads, Some(|| Box::<StandIn>::default())).map_err(fails)?;
        // `Worlds::new` already computes the first tick, after which the flip may be due.
        flip.into_iter().for_each(|flip| member.flip(flip));
        if let Some(unlike) = member.maker().unlike(&here) {
            common.say(&format!("{}: {unlike}", file.display()));
        }
        members.push((file.display().to_string(), member));
    }
    if members.len() > 1 && members.iter().any(|(_, member)| member.who() == Who::Local) {
        return Err(Failure::usage("a local world has one recording: give it alone"));
    }
    Worlds::new(members).map_err(|error| match error {
        RecordingError::Unsuitable(_) => Failure::usage(error.to_string()),
        _ => Failure::run(error.to_string()),
    })
}

/// Returns the files, with those of folders in place of the folders. Empty files of folders are left out: those
/// of processes that never began. Calls `left_out` for each.
fn files(paths: &[PathBuf], mut left_out: impl FnMut(&Path)) -> Result<Vec<PathBuf>, Failure> {
    let fails = |path: &Path, error: std::io::Error| {
        Failure::usage(format!("cannot read {}: {error}; check the path", path.display()))
    };
    let mut files = Vec::new();
    for path in paths {
        if !path.is_dir() {
            files.push(path.clone());
            continue;
        }
        let before = files.len();
        for entry in fs::read_dir(path).map_err(|error| fails(path, error))? {
            let file = entry.map_err(|error| fails(path, error))?.path();
            if file.extension().is_none_or(|ending| ending != RECORDING) {
                continue;
            }
            if file.metadata().is_ok_and(|file| file.is_file() && file.len() == 0) {
                left_out(&file);
            } else {
                files.push(file);
            }
        }
        if files.len() == before {
            let why = format!("{} has no *.{RECORDING} that is not empty: give recordings", path.display());
            return Err(Failure::usage(why));
        }
        files[before..].sort();
    }
    Ok(files)
}

/// Returns a counter of ticks on standard error, without an end: nobody knows how many ticks there are.
pub(super) fn ticks(common: &Common, json: bool) -> ProgressBar {
    let bar = common.progress(0, "ticks", json);
    if bar.is_hidden() {
        return bar;
    }
    let style = indicatif::ProgressStyle::with_template("{pos} ticks, {per_sec}");
    bar.with_style(style.unwrap_or_else(|_| indicatif::ProgressStyle::default_spinner()))
}

/// Parses TICK:BODY or TICK:BODY:BIT.
fn flip(text: &str) -> Result<Flip, String> {
    let wrong = || "write tick, body and perhaps bit, as 120:7, 120:c2/b1 or 120:7:43".to_owned();
    let mut parts = text.split(':');
    let tick = parts.next().and_then(|tick| tick.parse().ok()).ok_or_else(wrong)?;
    let body = parts.next().and_then(body).ok_or_else(wrong)?;
    // The lowest bit of linvel.x.
    let bit = parts.next().map_or(Some(32 * 10), |bit| bit.parse().ok()).filter(|bit| *bit < 512);
    match (bit, parts.next()) {
        (Some(bit), None) => Ok(Flip { tick: Tick(tick), body, bit }),
        _ => Err(wrong()),
    }
}

/// Parses 7, b7 or c2/b7.
fn body(text: &str) -> Option<BodyId> {
    let index = |text: &str| text.strip_prefix('b').unwrap_or(text).parse().ok();
    match text.split_once('/') {
        None => index(text).map(BodyId::persistent),
        Some((client, body)) => {
            let client = ClientId(client.strip_prefix('c')?.parse().ok()?);
            index(body).map(|index| BodyId::avatar(client, index))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_and_bits_are_given_as_they_are_printed() {
        let avatar = BodyId::avatar(ClientId(2), 1);
        for (text, body, bit) in [
            ("120:7", BodyId::persistent(7), 320),
            ("120:b7:43", BodyId::persistent(7), 43),
            ("120:c2/b1", avatar, 320),
        ] {
            assert_eq!(flip(text), Ok(Flip { tick: Tick(120), body, bit }));
        }
        for text in ["120", "x:7", "120:", "120:7:512", "120:7:1:1", "120:2/b1"] {
            assert!(flip(text).is_err(), "{text}");
        }
    }
}
