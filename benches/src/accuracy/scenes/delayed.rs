//! Defines the experiment of exchanges that are skipped, late or lost.

use super::super::fleet::Fault;
use super::super::scene::{Case, Experiment, Size};
use super::stacks::displacement;

/// Tower, pyramid and gas again, with faults. With skipped exchanges they must pass the scene's own gate with
/// a quarter more. With late and lost exchanges they are only measured, and no body may be lost.
pub(super) const DELAYED: Experiment = Experiment {
    number: 26,
    name: "delayed",
    metric: "stacks: largest displacement of a box, mean of the last second, m; gas: as there",
    cases: delayed,
    more_regions: &[],
    finer: false,
};

/// The factor by which more is allowed where all holders skip every tenth exchange.
const SKIPPED: f64 = 1.25;

fn delayed(size: Size) -> Vec<Case> {
    let mut cases = Vec::new();
    for fault in [Fault::SKIPPED, Fault::LATE, Fault::LOST_ONE_WAY] {
        let scenes = [
            (super::stacks::TOWER, "1:1 centre"),
            (super::stacks::TOWER, "10:1 centre"),
            (super::stacks::PYRAMID, "base 20 crossed"),
            (super::statistics::GAS, ""),
        ];
        for (experiment, label) in scenes {
            let mut all = (experiment.cases)(size);
            let place = all.iter().position(|case| case.label.starts_with(label)).expect("the scene has it");
            let case = all.swap_remove(place);
            cases.push(with_fault(case, experiment.name, fault));
        }
    }
    cases
}

fn with_fault(mut case: Case, name: &str, fault: Fault) -> Case {
    let what = match fault {
        Fault::LATE => "always one late",
        Fault::LOST_ONE_WAY => "one in ten lost one way",
        _ => "one in ten skipped by all",
    };
    case.label = format!("{what}: {name} {}", case.label);
    case.fault = Some(fault);
    if name == "pyramid" {
        // The distance from R1 is required only where there is no fault.
        case = case.measured_by(|trace, _| displacement(trace));
        case.threshold = None;
    }
    if fault == Fault::SKIPPED {
        case.slack *= SKIPPED;
        case.threshold = case.threshold.map(|threshold| SKIPPED * threshold);
        case
    } else {
        case.charted()
    }
}
