//! Lists the experiments; each module holds a family of them.

mod borders;
mod collapse;
mod delayed;
mod drops;
mod flight;
mod impacts;
mod joints;
mod ragdolls;
mod slides;
mod stacks;
mod statistics;

pub(crate) use joints::mean_gap_m;

use super::scene::Experiment;

/// Returns all experiments, in the order in which they were first built.
pub(crate) fn experiments() -> Vec<Experiment> {
    vec![
        flight::PROJECTILE,
        slides::SLIDE_TO_ROLL,
        impacts::BORDER_PAIR,
        impacts::CRADLE,
        stacks::TOWER,
        stacks::PYRAMID,
        joints::CHAIN,
        statistics::PILE,
        statistics::GAS,
        slides::SLOPE,
        slides::ROLLING_BOX,
        flight::DZHANIBEKOV,
        drops::ELASTIC_666,
        drops::BALLS_666,
        stacks::TOWER_5,
        stacks::WALL,
        collapse::CARD_HOUSE,
        joints::JOINT_GRID,
        flight::BULLET,
        slides::SEAM,
        borders::HANDOVER,
        borders::PING_PONG,
        borders::GIANT,
        collapse::DOMINO,
        statistics::SPHERES_1000,
        delayed::DELAYED,
        ragdolls::RAGDOLLS,
    ]
}

#[cfg(test)]
mod tests {
    use dcd::runtime::{Partitioning, WorldConfig};

    use super::super::scene::Size;
    use super::*;

    #[test]
    fn every_case_is_cut_into_as_many_regions_as_asked() {
        for experiment in experiments() {
            for case in (experiment.cases)(Size::Quick) {
                for &regions in [2, 4, 8].iter().chain(experiment.more_regions) {
                    for scene in &case.scenes {
                        let mut config = WorldConfig::for_scene(scene);
                        config.partitioning = Partitioning::Cuts((case.cuts)(regions));
                        let tree = config.tree().unwrap_or_else(|error| {
                            panic!("{} {} at {regions}: {error}", experiment.name, case.label)
                        });
                        assert_eq!(tree.leaf_count(), regions, "{} {}", experiment.name, case.label);
                    }
                }
            }
        }
    }

    #[test]
    fn no_label_is_given_twice_or_breaks_a_line_of_csv() {
        for experiment in experiments() {
            for size in [Size::Quick, Size::Full] {
                let mut labels: Vec<_> =
                    (experiment.cases)(size).into_iter().map(|case| case.label).collect();
                assert!(labels.iter().all(|label| !label.contains([',', '\n', '"'])), "{labels:?}");
                let count = labels.len();
                labels.sort_unstable();
                labels.dedup();
                assert_eq!(labels.len(), count, "{labels:?}");
            }
        }
    }

    #[test]
    fn no_name_and_no_number_is_given_twice() {
        let (mut names, mut numbers): (Vec<_>, Vec<_>) =
            experiments().iter().map(|experiment| (experiment.name, experiment.number)).unzip();
        let count = names.len();
        names.sort_unstable();
        names.dedup();
        numbers.sort_unstable();
        numbers.dedup();
        assert_eq!((names.len(), numbers.len()), (count, count));
    }
}
