//! Draws the progress of `dcd run` for a person who looks on while it runs.

use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::cli::common::Common;
use crate::runtime::LocalWorld;
use crate::runtime::measure::Subject;

/// The time between two drawings.
const PERIOD: Duration = Duration::from_millis(250);
/// The most regions that have a line of their own.
const MOST_LINES: usize = 12;

/// A progress bar with a table below it; hidden unless a person looks on.
pub(super) struct Live {
    bar: ProgressBar,
    /// The time at which it was drawn last; the first step is shown at once.
    drawn: Option<Instant>,
    /// Steps since then.
    steps: u32,
    spent: Duration,
    /// Time spent in each region.
    spent_by: Vec<Duration>,
}

impl Live {
    pub(super) fn new(common: &Common, ticks: u64, json: bool) -> Self {
        let bar = common.progress(ticks, "ticks", json);
        if !bar.is_hidden() {
            let template = "{bar:30} {pos}/{len} ticks, {per_sec}, {eta} left\n{msg}";
            bar.set_style(
                ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar()),
            );
        }
        Self { bar, drawn: None, steps: 0, spent: Duration::ZERO, spent_by: Vec::new() }
    }

    /// Counts a step, outside the time that is measured, and draws now and then.
    pub(super) fn tell(&mut self, tick: u64, subject: &Subject) {
        if self.bar.is_hidden() {
            return;
        }
        if let Subject::Regions(world) = subject {
            self.steps += 1;
            self.spent += world.last_step();
            self.spent_by.resize(world.regions().len(), Duration::ZERO);
            for (sum, region) in self.spent_by.iter_mut().zip(world.regions()) {
                *sum += region.last_step();
            }
        }
        if self.drawn.is_some_and(|drawn| drawn.elapsed() < PERIOD) {
            return;
        }
        if let Subject::Regions(world) = subject {
            self.bar.set_message(self.look(world).to_string());
            (self.steps, self.spent) = (0, Duration::ZERO);
            self.spent_by.fill(Duration::ZERO);
        }
        self.bar.set_position(tick);
        self.drawn = Some(Instant::now());
    }

    pub(super) fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn look(&self, world: &LocalWorld) -> Look {
        let ms = |spent: Duration| spent.as_secs_f64() * 1e3 / f64::from(self.steps.max(1));
        let stats = world.stats();
        let regions = world.regions().zip(&self.spent_by).map(|(region, &spent)| Row {
            name: region.id().to_string(),
            bodies: region.owned_count(),
            awake: region.awake_count(),
            ghosts: region.ghost_count(),
            ms: ms(spent),
        });
        Look {
            ms: ms(self.spent),
            transfers: stats.transfers,
            exchanges: stats.exchanges,
            regions: regions.collect(),
        }
    }
}

/// The numbers of one drawing.
struct Look {
    /// The time of the whole world per step, milliseconds.
    ms: f64,
    transfers: u64,
    exchanges: usize,
    regions: Vec<Row>,
}

/// One region, or several together.
#[derive(Clone, Default)]
struct Row {
    name: String,
    bodies: usize,
    awake: usize,
    ghosts: usize,
    /// The time per step, milliseconds.
    ms: f64,
}

impl Row {
    fn sum<'a>(name: String, rows: impl IntoIterator<Item = &'a Self>) -> Self {
        rows.into_iter().fold(Self { name, ..Self::default() }, |sum, row| Self {
            bodies: sum.bodies + row.bodies,
            awake: sum.awake + row.awake,
            ghosts: sum.ghosts + row.ghosts,
            ms: sum.ms + row.ms,
            ..sum
        })
    }
}

impl std::fmt::Display for Row {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { name, bodies, awake, ghosts, ms } = self;
        write!(f, "{name:<12}{bodies:>8} {awake:>8} {ghosts:>9} {ms:>10.3}")
    }
}

/// The busiest regions first, the others summed up.
impl std::fmt::Display for Look {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let all = Row::sum(String::new(), &self.regions);
        let count = self.regions.len();
        write!(
            f,
            "{} bodies ({} awake), {count} region{}, {:.3} ms a step; {} ghosts, {} transfers, {} exchanges a tick\n\
             {:<12}{:>8} {:>8} {:>9} {:>10}",
            all.bodies,
            all.awake,
            if count == 1 { "" } else { "s" },
            self.ms,
            all.ghosts,
            self.transfers,
            self.exchanges,
            "region",
            "bodies",
            "awake",
            "ghosts",
            "ms a step"
        )?;
        let mut busiest: Vec<_> = self.regions.iter().collect();
        busiest.sort_by(|a, b| b.ms.total_cmp(&a.ms));
        let (shown, others) = busiest.split_at(count.min(MOST_LINES));
        for row in shown {
            write!(f, "\n{row}")?;
        }
        if !others.is_empty() {
            let name = format!("{} others", others.len());
            write!(f, "\n{}", Row::sum(name, others.iter().copied()))?;
        }
        if count > 1 {
            write!(f, "\n{}", Row { name: "all".to_owned(), ..all })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn look(count: usize) -> String {
        let row = |i: usize| Row {
            name: format!("r{i}"),
            bodies: 10 + i,
            awake: i,
            ghosts: 2,
            ms: if i.is_multiple_of(2) { 1.0 } else { i as f64 },
        };
        Look { ms: 4.25, transfers: 7, exchanges: 2, regions: (0..count).map(row).collect() }.to_string()
    }

    #[test]
    fn one_region_has_one_line() {
        assert_eq!(
            look(1),
            "10 bodies (0 awake), 1 region, 4.250 ms a step; 2 ghosts, 7 transfers, 2 exchanges a tick\n\
             region        bodies    awake    ghosts  ms a step\n\
             r0                10        0         2      1.000"
        );
    }

    #[test]
    fn the_busiest_come_first_and_all_are_summed_up() {
        let text = look(3);
        let names: Vec<_> =
            text.lines().skip(2).map(|line| line.split_whitespace().next().unwrap()).collect();
        assert_eq!(names, ["r0", "r1", "r2", "all"], "equals stay in their order");
        let all: Vec<_> = text.lines().last().unwrap().split_whitespace().collect();
        assert_eq!(all, ["all", "33", "3", "6", "3.000"]);
    }

    #[test]
    fn many_regions_have_twelve_lines_and_a_sum_of_the_others() {
        let text = look(30);
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines.len(), 2 + 12 + 2);
        assert!(lines[2].starts_with("r29 ") && lines[13].starts_with("r7 "), "{text}");
        let others: Vec<_> = lines[14].split_whitespace().collect();
        assert_eq!(others[..3], ["18", "others", "399"]);
    }
}
