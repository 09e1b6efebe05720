//! Tests that the methods of others, owner and proxy, still fail where they are known to. Otherwise the suite
//! would no longer detect failures.

use dcd::physics::Coupling;

use super::gate::{Verdict, judge};
use super::scene::{Case, Size};
use super::{Reference, Setup, experiments, method, read, use_method};

/// Returns the error and the verdict of one case of an experiment.
fn verdict(experiment: &str, case: &str, coupling: Coupling, regions: usize) -> (f64, Verdict) {
    let case = case_of(experiment, case);
    let reference = Reference::of(&case).unwrap();
    let adjust = |config: &mut _| use_method(config, coupling);
    let reading = read(&case, &Setup::Cut { regions, adjust: &adjust }, &reference).unwrap();
    (reading.error, judge(&case, &reading, &reference.r1))
}

fn case_of(experiment: &str, label: &str) -> Case {
    let all = experiments();
    let experiment = all.iter().find(|one| one.name == experiment).unwrap();
    (experiment.cases)(Size::Quick).into_iter().find(|case| case.label.starts_with(label)).unwrap()
}

#[test]
fn one_region_passes_by_every_method() {
    for coupling in Coupling::ALL {
        let (_, verdict) = verdict("tower", "10:1 centre", coupling, 1);
        assert!(verdict.pass(), "{}: {:?}", coupling.name(), verdict.failures);
    }
}

#[test]
fn owner_loses_momentum_in_a_cradle() {
    let (_, verdict) = verdict("cradle", "5 m/s", method("owner").unwrap(), 4);
    assert!(verdict.failures.iter().any(|failure| failure.contains("momentum")), "{verdict:?}");
}

#[test]
fn owner_fells_a_tower() {
    let (error_m, verdict) = verdict("tower", "1:1 centre", method("owner").unwrap(), 2);
    assert!(error_m > 1.0, "{verdict:?}");
}

#[test]
fn proxy_heats_a_gas() {
    let (error, verdict) = verdict("gas", "216 balls", method("proxy").unwrap(), 4);
    assert!(error > 1.0, "energy grows by {error} of itself: {verdict:?}");
}

#[test]
fn proxy_fells_a_tower() {
    let (error_m, verdict) = verdict("tower", "1:1 centre", method("proxy").unwrap(), 2);
    assert!(error_m > 1.0, "{verdict:?}");
}
