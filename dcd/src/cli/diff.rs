//! Implements `dcd diff`: finds where two recordings differ first.

use std::path::PathBuf;
use std::process::ExitCode;
use std::slice::from_ref;

use serde::Serialize;

use super::common::{Common, print};
use super::failure::Failure;
use super::replay::{check_bodies, open, tell_cuts, ticks};
use crate::recording::{Difference, difference};
use crate::space::Tick;

/// Finds where two recordings differ first: at which tick, in which body and field
///
/// Examples:
///   dcd run pile --set n=500 --record a.dcdr
///   dcd run pile --set n=500 --regions 4 --record b.dcdr
///   dcd diff a.dcdr b.dcdr
///
/// Both are replayed side by side on this machine, so the result shows what they were given, not what another
/// processor made of it. A folder (*.dcdr) is one recording: that of the members of a cluster. A server's own
/// file has no bodies to compare. Exits with 1 if they differ.
#[derive(clap::Args)]
#[command(
    verbatim_doc_comment,
    after_long_help = "--json prints the keys ticks difference{tick,body,bodies,field,a{node,region,value},b{node,region,value}}, where difference\n\
        is null if they are alike in all ticks that both have."
)]
pub(super) struct Diff {
    /// A recording, or a folder of those of one cluster
    a: PathBuf,
    /// Another one
    b: PathBuf,
    /// Stop after this tick
    #[arg(long, value_name = "TICK", value_parser = clap::value_parser!(u64).range(1..))]
    until: Option<u64>,
    /// Threads that step a world [default: all cores]
    #[arg(long, value_name = "T", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
    /// Print the result as one JSON object
    #[arg(long)]
    json: bool,
}

impl Diff {
    pub(super) fn execute(self, common: &Common) -> Result<ExitCode, Failure> {
        let open = |path| open(from_ref(path), self.threads, None, common);
        let [mut a, mut b] = [open(&self.a)?, open(&self.b)?];
        for (replay, path) in [(&a, &self.a), (&b, &self.b)] {
            check_bodies(replay, path, "compare")?;
        }
        let bar = ticks(common, self.json);
        let until = Tick(self.until.unwrap_or(u64::MAX));
        let (tick, found) = difference([&mut a, &mut b], until, |tick| bar.set_position(tick.0))
            .map_err(|error| Failure::run(error.to_string()))?;
        bar.finish_and_clear();
        [&a, &b].into_iter().for_each(|replay| tell_cuts(replay, common));
        if self.json {
            let told = Told { ticks: tick.0, difference: found.as_ref().map(ToldDifference::new) };
            print(&serde_json::to_string(&told).expect("numbers and text are JSON"))?;
        } else if tick > Tick(0) {
            let alike = || format!("alike in all ticks that both have, up to tick {}", tick.0);
            print(&found.as_ref().map_or_else(alike, words))?;
        }
        if tick == Tick(0) {
            return Err(Failure::run("nothing was compared: they have no tick in common"));
        }
        Ok(if found.is_some() { ExitCode::FAILURE } else { ExitCode::SUCCESS })
    }
}

fn words(found: &Difference) -> String {
    let place = |side: usize| {
        let Some((node, region)) = found.places[side] else { return "not there".to_owned() };
        let node = node.map_or(String::new(), |node| format!("{node}, "));
        let value = found.values[side].map_or("there".to_owned(), |value| format!("{value:?}"));
        format!("{value} ({node}{region})")
    };
    let others = match found.bodies {
        1 => String::new(),
        bodies => format!(" ({bodies} bodies differ)"),
    };
    let field = found.field.map_or(String::new(), |field| format!(", {field}"));
    let mut text = format!(
        "they differ from tick {}{others}: body {}{field}: {} in the first, {} in the second",
        found.tick.0,
        found.body,
        place(0),
        place(1)
    );
    for (name, acts) in ["first", "second"].into_iter().zip(&found.acted) {
        text.extend(acts.iter().map(|act| format!("\n  {name}: {act}")));
    }
    text
}

/// The result, for programs.
#[derive(Serialize)]
struct Told {
    ticks: u64,
    difference: Option<ToldDifference>,
}

#[derive(Serialize)]
struct ToldDifference {
    tick: u64,
    body: String,
    bodies: usize,
    field: Option<&'static str>,
    a: Side,
    b: Side,
}

#[derive(Serialize)]
struct Side {
    node: Option<u32>,
    region: Option<u32>,
    value: Option<f64>,
}

impl ToldDifference {
    fn new(found: &Difference) -> Self {
        let side = |side: usize| Side {
            node: found.places[side].and_then(|(node, _)| node).map(|node| node.0),
            region: found.places[side].map(|(_, region)| region.0),
            value: found.values[side],
        };
        let (tick, body) = (found.tick.0, found.body.to_string());
        Self { tick, body, bodies: found.bodies, field: found.field, a: side(0), b: side(1) }
    }
}
