//! Prints the results: a table as it grows, then JSON with the worst case of each row. Makes a record of
//! every case.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::gate::Verdict;
use super::limits;
use super::reading::Reading;
use super::record::Record;
use super::scene::{Case, Experiment};

/// One case by one method at one number of regions.
pub(crate) struct Line {
    /// Label of the case.
    pub case: String,
    /// Unit of the errors.
    pub unit: &'static str,
    /// The outcome of the case.
    pub reading: Reading,
    /// The gate's verdict; `None` for the bare worlds themselves.
    pub verdict: Option<Verdict>,
}

/// An experiment by one method at one number of regions; the worst of its cases stands for it.
pub(crate) struct Row {
    number: u8,
    name: &'static str,
    /// Name of the coupling, or R1, R2, R3.
    method: &'static str,
    /// The number of regions; 0 is a bare world.
    regions: usize,
    lines: Vec<Line>,
}

impl Line {
    /// Makes the line of a case from its reading and verdict.
    pub(crate) fn new(case: &Case, reading: Reading, verdict: Option<Verdict>) -> Self {
        Self { case: case.label.clone(), unit: case.unit, reading, verdict }
    }

    fn pass(&self) -> bool {
        self.verdict.as_ref().is_none_or(Verdict::pass)
    }

    fn limit(&self) -> f64 {
        self.verdict.as_ref().map_or(f64::NAN, |verdict| verdict.limit)
    }

    /// Returns the cause, if this case of an experiment is off by no more than is known of the method.
    fn known_limit(&self, experiment: &str, method: &str) -> Option<&'static str> {
        let verdict = self.verdict.as_ref().filter(|verdict| !verdict.broken)?;
        limits::cause(experiment, &self.case, method, self.reading.error / verdict.limit)
    }

    /// Returns the sort key: failures first, then the error over its limit.
    fn badness(&self) -> (bool, f64) {
        (!self.pass(), self.reading.error / self.limit())
    }
}

impl Row {
    /// Puts the cases of an experiment together.
    pub(crate) fn new(
        experiment: &Experiment,
        method: &'static str,
        regions: usize,
        lines: Vec<Line>,
    ) -> Self {
        Self { number: experiment.number, name: experiment.name, method, regions, lines }
    }

    /// Returns whether it is one of the bare worlds, of which nothing is asked.
    pub(crate) fn is_bare(&self) -> bool {
        self.regions == 0
    }

    /// Returns whether all cases pass.
    pub(crate) fn pass(&self) -> bool {
        self.lines.iter().all(Line::pass)
    }

    /// Returns the cause, if every case that fails has a known one.
    pub(crate) fn known_limit(&self) -> Option<&'static str> {
        let failing = self.lines.iter().filter(|line| !line.pass());
        let causes: Option<Vec<_>> = failing.map(|line| line.known_limit(self.name, self.method)).collect();
        causes?.first().copied()
    }

    /// Returns the case that stands for the experiment.
    fn worst(&self) -> &Line {
        let worse = |a: &&Line, b: &&Line| {
            let ((a_fails, a), (b_fails, b)) = (a.badness(), b.badness());
            a_fails.cmp(&b_fails).then(a.total_cmp(&b))
        };
        self.lines.iter().max_by(worse).expect("an experiment has cases")
    }

    /// The heading of the table.
    pub(crate) const HEAD: &str =
        " #  scene           method   regions        error     R1 error        limit unit     worst case";

    /// Returns a line of the table, and one for every case that fails.
    pub(crate) fn table(&self) -> String {
        let worst = self.worst();
        let Self { number, name, method, regions, .. } = self;
        let verdict = match (self.pass(), self.known_limit()) {
            _ if self.is_bare() => "reference".to_owned(),
            (true, _) => "ok".to_owned(),
            (false, Some(cause)) => format!("known limit: {cause}"),
            (false, None) => "FAILS".to_owned(),
        };
        let mut text = format!(
            "{number:2}  {name:15} {method:8} {regions:7} {:12.4e} {:12.4e} {:12.4e} {:8} {}: {verdict}",
            worst.reading.error,
            worst.reading.r1_error,
            worst.limit(),
            worst.unit,
            worst.case,
        );
        for line in self.lines.iter().filter(|line| !line.pass()) {
            let failures = line.verdict.iter().flat_map(|verdict| &verdict.failures);
            let failures = failures.map(String::as_str).collect::<Vec<_>>().join("; ");
            write!(text, "\n      {}: {failures}", line.case).expect("a string takes all");
        }
        text
    }

    /// Returns the row as an entry of the JSON's list.
    pub(crate) fn json(&self) -> Value {
        let worst = self.worst();
        json!({
            "scene": self.number,
            "name": self.name,
            "method": self.method,
            "regions": self.regions,
            "error": worst.reading.error,
            "r1_error": worst.reading.r1_error,
            "unit": worst.unit,
            "threshold": worst.limit(),
            "pass": self.pass(),
            "known_limit": self.known_limit(),
        })
    }

    /// Returns one record per case.
    pub(crate) fn records(&self) -> impl Iterator<Item = Record> + '_ {
        self.lines.iter().map(|line| {
            let Line { case, unit, reading, verdict } = line;
            Record {
                scene: self.number,
                name: self.name.to_owned(),
                case: case.clone(),
                method: self.method.to_owned(),
                regions: self.regions,
                error: reading.error,
                r1_error: reading.r1_error,
                unit: (*unit).to_owned(),
                threshold: verdict.as_ref().map(|verdict| verdict.limit).filter(|limit| limit.is_finite()),
                pass: line.pass(),
                momentum_error: reading.momentum_error,
                ground_error: reading.ground_error,
                lost: reading.lost,
                doubled: reading.doubled,
                quarantined: reading.quarantined,
                transfers: reading.transfers,
                ghosts_mean: reading.ghosts_mean,
                rtf: reading.rtf,
                p50_ms: reading.step_ms.p50,
                p99_ms: reading.step_ms.p99,
                max_ms: reading.step_ms.max,
            }
        })
    }
}

#[cfg(test)]
pub(super) mod tests {
    use dcd::scene::{Params, Scene};

    use super::super::gate::judge;
    use super::*;

    fn line(case: &str, error: f64, limit: f64) -> Line {
        let reading = Reading::plain(error, 0.5 * limit);
        let failures = if error > limit { vec!["too far".to_owned()] } else { Vec::new() };
        let verdict = Some(Verdict { limit, failures, broken: false });
        Line { case: case.to_owned(), unit: "m", reading, verdict }
    }

    fn row(lines: Vec<Line>) -> Row {
        Row { number: 10, name: "tower", method: "auto", regions: 4, lines }
    }

    #[test]
    fn the_case_nearest_to_its_limit_stands_for_the_row_and_a_failing_one_before_all() {
        let good = row(vec![line("a", 0.9, 1.0), line("b", 0.02, 0.1)]);
        assert_eq!((good.json()["error"].as_f64(), good.pass()), (Some(0.9), true));
        let bad = row(vec![line("a", 0.9, 1.0), line("b", 0.2, 0.1)]);
        assert_eq!((bad.json()["error"].as_f64(), bad.pass()), (Some(0.2), false));
        assert!(bad.table().contains("b: too far") && !bad.table().contains("a: too far"));
    }

    #[test]
    fn a_known_limit_excuses_an_error_but_not_a_body_that_is_lost() {
        let crowd = |reading: Reading| {
            let scene = Scene::named("tower", &Params::new()).unwrap();
            let case = Case::new("0.5 s", scene, 1.0, |_| Vec::new(), |_, _| 0.0);
            let verdict = judge(&case, &reading, &Reading::plain(0.0, 0.0));
            let lines = vec![Line::new(&case, reading, Some(verdict))];
            Row { number: 23, name: "spheres_1000", method: "overlap", regions: 2, lines }
        };
        let off = Reading::plain(0.002, 0.0);
        assert!(!crowd(off.clone()).pass());
        assert!(crowd(off.clone()).known_limit().is_some());
        assert_eq!(crowd(Reading { lost: 1, ..off.clone() }).known_limit(), None);
        assert_eq!(crowd(Reading { error: 1e9, ..off }).known_limit(), None);
    }

    #[test]
    fn a_row_of_json_has_the_fields_that_others_read() {
        let json = row(vec![line("a", 0.5, f64::INFINITY)]).json();
        let keys: Vec<_> = json.as_object().unwrap().keys().map(String::as_str).collect();
        let wanted = [
            "error",
            "known_limit",
            "method",
            "name",
            "pass",
            "r1_error",
            "regions",
            "scene",
            "threshold",
            "unit",
        ];
        assert_eq!(keys, wanted);
        assert!(json["threshold"].is_null() && json["known_limit"].is_null());
    }

    /// Returns a record of the tower, by `auto` in four regions.
    pub(in super::super) fn record(case: &str, error: f64, limit: f64) -> Record {
        row(vec![line(case, error, limit)]).records().next().unwrap()
    }

    #[test]
    fn every_case_becomes_a_record() {
        let records: Vec<_> =
            row(vec![line("a", 0.5, 1.0), line("b", 3.0, f64::INFINITY)]).records().collect();
        let seen = |record: &Record| (record.case.clone(), record.error, record.threshold, record.pass);
        assert_eq!(seen(&records[0]), ("a".into(), 0.5, Some(1.0), true));
        assert_eq!(seen(&records[1]), ("b".into(), 3.0, None, true));
        assert_eq!((records[0].scene, &*records[0].name, records[0].regions), (10, "tower", 4));
    }
}
