//! Formats what a replay has found, for people and for programs.

use serde::Serialize;

use crate::recording::{FIELDS, Mismatch, Replay as Worlds, Who};

/// Returns what a replay has found, as text for people.
pub(super) fn words(replay: &Worlds) -> String {
    let (ticks, matches) = (replay.tick_count(), replay.matches());
    let Some(found) = replay.mismatch() else {
        return format!("{ticks} ticks replayed; all {matches} digests of regions are as recorded");
    };
    let node = found.who;
    let place = match (found.region, found.body) {
        _ if node == Who::Server => format!("{node} sends or stores something else"),
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

/// Returns the state of each body, as lines of CSV.
pub(super) fn csv(replay: &Worlds) -> String {
    let mut lines = vec!["body,node,region,".to_owned() + &FIELDS.map(|(name, ..)| name).join(",")];
    for (body, (node, region, bits)) in replay.bodies() {
        let node = node.map_or(String::new(), |node| node.to_string());
        let values: Vec<_> = (0..FIELDS.len()).map(|field| format!("{:?}", bits.value(field))).collect();
        lines.push(format!("{body},{node},{region},{}", values.join(",")));
    }
    lines.join("\n")
}

/// Returns what a replay has found, as JSON.
pub(super) fn json(replay: &Worlds) -> String {
    let (ticks, matches) = (replay.tick_count(), replay.matches());
    let told = Told { ticks, matches, mismatch: replay.mismatch().map(ToldMismatch::new) };
    serde_json::to_string(&told).expect("numbers and text are JSON")
}

/// The result of a replay, for programs.
#[derive(Serialize)]
struct Told {
    ticks: u64,
    matches: u64,
    mismatch: Option<ToldMismatch>,
}

/// The place where a replay parts from its recording.
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
            node: found.who.node().map(|node| node.0),
            tick: found.tick.0,
            region: found.region.map(|region| region.0),
            body: found.body.map(|body| body.to_string()),
            field: found.field,
            recorded: found.recorded,
            replayed: found.replayed,
        }
    }
}
