//! Measures how well a client predicts its own avatars, over good and bad networks, and what that costs it. A
//! player's course is run for each kind of avatar, and that of the pusher beside 20,000 bodies too.

use std::error::Error;

use clap::Args;
use dcd_tests::course::{Course, Played, play};
use dcd_tests::proxy::Weather;
use dcd_tests::stage::{Stage, ms};
use dcd_tests::truth::Quantiles;
use serde::{Deserialize, Serialize};

use crate::output::{Output, Sheet, Shown};
use crate::page::table as markdown;
use crate::results::{Measured, short};

const SHOWN: Shown<Row> = Shown { name: "prediction", table, picture: None };

/// The settings of a run: how long it takes, and where its results go.
#[derive(Args)]
pub(crate) struct Predictions {
    #[command(flatten)]
    output: Output,
    /// Seconds that are played of each course.
    #[arg(long, default_value_t = 18, conflicts_with = "quick")]
    seconds: u32,
}

/// A course that was played over one network.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    course: String,
    network: String,
    bodies: usize,
    predicted_bodies: usize,
    /// How far own avatars are shown ahead of what is shown of others, milliseconds.
    ahead_ms: f64,
    ticks: u64,
    replays: u64,
    /// Replays that moved what is shown by more than 2 cm, per 100 ticks.
    corrected_percent: f64,
    largest_correction_mm: f64,
    /// The distance that a body moves from one frame to the next beyond what its speed says, of bodies that
    /// move.
    jump_p99_mm: f64,
    jump_max_mm: f64,
    frame_p50_us: f64,
    frame_p99_us: f64,
    frame_max_us: f64,
}

fn networks() -> [(&'static str, Weather); 5] {
    [
        ("this machine", ms(0, 0, 0.0)),
        ("50 ± 10 ms", ms(50, 10, 0.0)),
        ("100 ms", ms(100, 0, 0.0)),
        ("100 ± 20 ms, 5 % lost", ms(100, 20, 0.05)),
        ("100 ± 50 ms, 5 % lost", ms(100, 50, 0.05)),
    ]
}

impl Predictions {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        self.output.fill(&SHOWN, |rows| self.measure(rows)).map(drop)
    }

    fn measure(&self, rows: &mut Sheet<Row>) -> Result<(), Box<dyn Error>> {
        let frames = 60 * if self.output.quick { 2 } else { self.seconds };
        let courses = Course::ALL.into_iter().map(|course| (course, 0)).chain([(Course::Pusher, 20_000)]);
        for (course, others) in courses.take(if self.output.quick { 1 } else { 9 }) {
            for (network, weather) in networks().into_iter().take(if self.output.quick { 2 } else { 9 }) {
                let mut stage = Stage::of(course.world(others), weather);
                let row = row(course, others, network, &play(&mut stage, course, frames));
                eprintln!("{}, {network}: {} % corrected", row.course, short(row.corrected_percent));
                rows.push(row)?;
            }
        }
        Ok(())
    }
}

fn row(course: Course, others: u32, network: &str, played: &Played) -> Row {
    let frames = &played.frames;
    let ahead = frames.iter().map(|frame| frame.time.predicted - frame.time.shown).sum::<f64>();
    let jumps = Quantiles::from(played.jumps_m());
    let times =
        Quantiles::from(frames.iter().map(|frame| 1e6 * frame.predicting.as_secs_f64()).collect::<Vec<_>>());
    let name = course.name();
    Row {
        course: if others == 0 { name.to_owned() } else { format!("{name} beside {others} bodies") },
        network: network.to_owned(),
        bodies: frames.last().map_or(0, |frame| frame.bodies.len()),
        predicted_bodies: played.prediction.bodies,
        ahead_ms: 1e3 / 60.0 * ahead / frames.len() as f64,
        ticks: played.prediction.ticks,
        replays: played.prediction.replays,
        corrected_percent: 100.0 * played.corrected(),
        largest_correction_mm: 1e3 * played.prediction.largest_correction_m,
        jump_p99_mm: 1e3 * jumps.at(0.99),
        jump_max_mm: 1e3 * jumps.at(1.0),
        frame_p50_us: times.at(0.5),
        frame_p99_us: times.at(0.99),
        frame_max_us: times.at(1.0),
    }
}

fn table(rows: &[Measured<Row>]) -> String {
    let head = [
        "course",
        "network",
        "bodies, predicted of all",
        "ahead of what is shown of others, ms",
        "replays of ticks",
        "corrections above 2 cm, % of ticks",
        "largest, mm",
        "jumps per frame, p99 / max mm",
        "predicting, p50 / p99 / max µs per frame",
    ];
    let list = |numbers: &[f64]| numbers.iter().map(|&n| short(n)).collect::<Vec<_>>().join(" / ");
    let cells = |Measured { row, .. }: &Measured<Row>| {
        vec![
            row.course.clone(),
            row.network.clone(),
            format!("{} of {}", row.predicted_bodies, row.bodies),
            short(row.ahead_ms),
            format!("{} of {}", row.replays, row.ticks),
            short(row.corrected_percent),
            short(row.largest_correction_mm),
            list(&[row.jump_p99_mm, row.jump_max_mm]),
            list(&[row.frame_p50_us, row.frame_p99_us, row.frame_max_us]),
        ]
    };
    markdown(&head, rows.iter().map(cells))
}
