//! Implements `dcd replay`: computes a recorded world again, and finds where it parts from its recording.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use indicatif::ProgressBar;
use serde::Serialize;

use super::common::{Common, print};
use super::failure::Failure;
use super::interrupt::Interrupt;
use crate::recording::{FIELDS, Flip, Maker, Mismatch, RecordingError, Replay as Worlds};
use crate::runtime::open_recording;
use crate::space::{BodyId, ClientId, Tick};

/// The ending of recordings' names.
pub(super) const RECORDING: &str = "dcdr";

/// Computes a recorded world again, bit for bit, and finds where it parts from its recording
///
/// Examples:
///   dcd run pile --set n=500 --regions 4 --record pile.dcdr
///   dcd replay pile.dcdr --check
///   dcd replay pile.dcdr --dump 120 > bodies.csv
///   dcd node --token $(dcd token --role node) --record node.dcdr
///   dcd replay FOLDER --check --json     (all *.dcdr of a folder: the members of one cluster)
///
/// Nodes are given what they were given, with its times, by one process as fast as it can. After each tick the digest of each region is
/// compared with the recorded one: where a single bit of a body is otherwise, body and field are found too.
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_long_help = "--json prints the keys ticks matches mismatch{node,tick,region,body,field,recorded,replayed}, where mismatch is null if all\n\
        digests were as recorded; what a digest cannot tell is null too. matches counts digests: one for each region and tick."
)]
pub(super) struct Replay {
    /// Recordings of one world, or folders of such (*.dcdr)
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
    /// Stop at the first difference, and exit with 1
    #[arg(long)]
    check: bool,
    /// Stop after this tick
    #[arg(long, value_name = "TICK")]
    until: Option<u64>,
    /// Print the bodies as they are after this tick, as CSV: body, node, region, and the fields of the state, positions relative to the
    /// region
    #[arg(long, value_name = "TICK", conflicts_with_all = ["until", "json"], value_parser = clap::value_parser!(u64).range(1..))]
    dump: Option<u64>,
    /// Flip a bit of a body after a tick on purpose, as 120:7 or 120:c2/b1, with :BIT for another than the lowest of linvel.x: 0, 64 and 128 are the lowest of x, y and z, 192 that of the rotation
    #[arg(long, value_name = "TICK:BODY", value_parser = flip)]
    flip: Option<Flip>,
    /// Threads that step a world [default: all cores]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
}

impl Replay {
    pub(super) fn execute(self, common: &Common) -> Result<ExitCode, Failure> {
        let interrupt = Interrupt::listen()?;
        let mut replay = open(&self.files, self.threads, common)?;
        self.flip.into_iter().for_each(|flip| replay.flip(flip));
        let until = Tick(self.dump.or(self.until).unwrap_or(u64::MAX));
        let bar = ticks(common, self.json);
        let mut failed = Ok(());
        while !(interrupt.asked() || self.check && replay.mismatch().is_some()) {
            match replay.advance(until) {
                Ok(true) => bar.set_position(replay.ticks()),
                Ok(false) => break,
                Err(error) => {
                    failed = Err(Failure::run(error.to_string()));
                    break;
                }
            }
        }
        bar.finish_and_clear();
        if replay.members().any(|member| member.was_cut_off()) {
            common.say("a recording has no end, as that of a process that was killed: it is replayed as far as it goes");
        }
        if self.dump.is_some() {
            std::mem::replace(&mut failed, Ok(()))?;
            if let Some(found) = replay.mismatch() {
                common.say(&format!("it parted from the recording after tick {}", found.tick.0));
            }
        }
        if let Some(tick) = self.dump {
            if replay.ticks() < tick {
                let last = replay.ticks();
                return Err(Failure::usage(format!(
                    "the recording ends after tick {last}; dump one up to that"
                )));
            }
            print(&csv(&replay))?;
        } else if self.json {
            let told = Told {
                ticks: replay.ticks(),
                matches: replay.matches(),
                mismatch: replay.mismatch().map(ToldMismatch::new),
            };
            print(&serde_json::to_string(&told).expect("numbers and text are JSON"))?;
        } else {
            print(&words(&replay))?;
        }
        failed?;
        if let Some(Flip { tick, body, .. }) = self.flip
            && !replay.members().any(|member| member.has_flipped())
        {
            return Err(Failure::usage(format!(
                "nothing was flipped: body {body} is not owned by anybody after tick {}, or its state has no such bit",
                tick.0
            )));
        }
        if self.check && replay.matches() == 0 && replay.mismatch().is_none() {
            return Err(Failure::run("nothing was compared: no tick is on record"));
        }
        let parts = self.check && replay.mismatch().is_some();
        Ok(if parts { ExitCode::FAILURE } else { interrupt.exit_code() })
    }
}

/// Opens recordings of one world.
pub(super) fn open(paths: &[PathBuf], threads: Option<u16>, common: &Common) -> Result<Worlds, Failure> {
    let threads =
        threads.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from);
    let here = Maker::here();
    let (mut members, mut names) = (Vec::new(), Vec::new());
    for file in files(paths)? {
        let fails = |error: RecordingError| Failure::usage(format!("{}: {error}", file.display()));
        let member = open_recording(&file, threads).map_err(fails)?;
        if let Some(unlike) = member.maker().unlike(&here) {
            common.say(&format!("{}: {unlike}", file.display()));
        }
        if names.contains(&member.node()) {
            return Err(Failure::usage(format!(
                "{}: another file is of the same node, which was started again: replay each with those of the others by itself",
                file.display()
            )));
        }
        names.push(member.node());
        members.push(member);
    }
    if names.len() > 1 && names.contains(&None) {
        return Err(Failure::usage("a local world has one recording: give it alone"));
    }
    Worlds::new(members).map_err(|error| Failure::run(error.to_string()))
}

/// Returns the files, those of folders too.
fn files(paths: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
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
            if file.extension().is_some_and(|ending| ending == RECORDING) {
                files.push(file);
            }
        }
        if files.len() == before {
            return Err(Failure::usage(format!("{} has no *.{RECORDING}: give recordings", path.display())));
        }
        files[before..].sort();
    }
    Ok(files)
}

/// Returns a counter of ticks on standard error: nobody knows how many there are.
pub(super) fn ticks(common: &Common, json: bool) -> ProgressBar {
    let bar = common.progress(0, "ticks", json);
    if bar.is_hidden() {
        return bar;
    }
    let style = indicatif::ProgressStyle::with_template("{pos} ticks, {per_sec}");
    bar.with_style(style.unwrap_or_else(|_| indicatif::ProgressStyle::default_spinner()))
}

fn words(replay: &Worlds) -> String {
    let (ticks, matches) = (replay.ticks(), replay.matches());
    let Some(found) = replay.mismatch() else {
        return format!("{ticks} ticks replayed; all {matches} digests of regions are as recorded");
    };
    let node = found.node.map_or("the local world".to_owned(), |node| format!("node {node}"));
    let place = match (found.region, found.body) {
        (None, _) => format!("{node}: other regions are computed than were recorded"),
        (Some(region), None) => format!("{node}, region {region}: more than one bit differs"),
        (Some(region), Some(body)) => format!("{node}, region {region}, body {body}"),
    };
    let value = |value: Option<f64>| value.map_or("not there".to_owned(), |value| format!("{value:?}"));
    let field = found.field.map_or(String::new(), |field| format!(", {field}"));
    let values = match found.body {
        Some(_) => format!(": recorded {}, replayed {}", value(found.recorded), value(found.replayed)),
        None => String::new(),
    };
    let acted: String = found.acted.iter().map(|act| format!("\n  {act}")).collect();
    format!("{matches} digests are as recorded, up to tick {}: {place}{field}{values}{acted}", found.tick.0)
}

fn csv(replay: &Worlds) -> String {
    let mut lines = vec!["body,node,region,".to_owned() + &FIELDS.map(|(name, ..)| name).join(",")];
    for (body, (node, region, bits)) in replay.bodies() {
        let node = node.map_or(String::new(), |node| node.to_string());
        let values: Vec<_> = (0..FIELDS.len()).map(|field| format!("{:?}", bits.value(field))).collect();
        lines.push(format!("{body},{node},{region},{}", values.join(",")));
    }
    lines.join("\n")
}

/// The result of a replay, for programs.
#[derive(Serialize)]
struct Told {
    ticks: u64,
    matches: u64,
    mismatch: Option<ToldMismatch>,
}

/// Where a replay parts from its recording.
#[derive(Serialize)]
struct ToldMismatch {
    node: Option<u32>,
    tick: u64,
    region: Option<u32>,
    body: Option<String>,
    field: Option<&'static str>,
    recorded: Option<f64>,
    replayed: Option<f64>,
}

impl ToldMismatch {
    fn new(found: &Mismatch) -> Self {
        Self {
            node: found.node.map(|node| node.0),
            tick: found.tick.0,
            region: found.region.map(|region| region.0),
            body: found.body.map(|body| body.to_string()),
            field: found.field,
            recorded: found.recorded,
            replayed: found.replayed,
        }
    }
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
