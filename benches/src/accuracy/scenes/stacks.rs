//! Defines the experiments of stacks of boxes with the border across, between and up through them.

use dcd::scene::{Params, Scene};
use dcd::space::Axis;

use super::super::reading::worst;
use super::super::scene::{Case, Cut, Experiment, Size, corner, planes};
use super::super::trace::{Trace, distance};

/// Ten unit boxes; the top one has 1, 10 or 100 times the mass of the others.
pub(super) const TOWER: Experiment = Experiment {
    number: 10,
    name: "tower",
    metric: "largest displacement of a box from where it was put, mean of the last second, m",
    cases: tower,
    more_regions: &[],
    finer: true,
};

/// The same towers, cut four times.
pub(super) const TOWER_5: Experiment = Experiment {
    number: 11,
    name: "tower_5",
    metric: "largest displacement of a box from where it was put, mean of the last second, m",
    cases: tower_5,
    more_regions: &[5],
    finer: false,
};

/// Flat pyramids of unit boxes.
pub(super) const PYRAMID: Experiment = Experiment {
    number: 12,
    name: "pyramid",
    metric: "base 20: largest distance of a box from where R1 has it after 1,000 steps; larger: largest displacement, m",
    cases: pyramid,
    more_regions: &[],
    finer: false,
};

/// A wall in running bond.
pub(super) const WALL: Experiment = Experiment {
    number: 13,
    name: "wall",
    metric: "largest displacement of a brick from where it was put, mean of the last second, m",
    cases: wall,
    more_regions: &[],
    finer: false,
};

fn wall(size: Size) -> Vec<Case> {
    let (width, height, seconds) = size.pick((10, 6, 20.0), (20, 8, 600.0));
    let params = Params::new().with("width", width).with("height", height).with("sleep", 0);
    let scene = Scene::named("wall", &params).expect("the library has walls");
    // Borders between bricks of one course and through those of the next; between courses; through more
    // bricks.
    let cuts = |regions: usize| -> Vec<Cut> {
        match regions {
            2 => vec![(Axis::X, 0.0)],
            4 => vec![(Axis::X, 0.0), (Axis::Y, 1.5)],
            _ => vec![(Axis::X, 0.0), (Axis::Y, 1.5), (Axis::X, -2.25), (Axis::X, 2.5)],
        }
    };
    let label = format!("{width} bricks x {height} courses");
    vec![Case::new(label, scene, seconds, cuts, |trace, _| displacement(trace)).resting()]
}

fn tower(size: Size) -> Vec<Case> {
    let mut cases = Vec::new();
    for ratio in [1, 10, 100] {
        let case = |label: &str, cuts: Box<dyn Fn(usize) -> Vec<Cut> + Send + Sync>| {
            let scene = tower_of(ratio);
            let label = format!("{ratio}:1 {label}");
            Case::new(label, scene, size.pick(10.0, 60.0), cuts, |trace, _| displacement(trace)).resting()
        };
        cases.push(case("centre", Box::new(planes(Axis::Y, [4.5, 2.5, 6.5, 8.5, 1.5, 5.5, 9.5]))));
        cases.push(case("between", Box::new(planes(Axis::Y, [5.0, 3.0, 7.0, 1.0, 9.0, 4.0, 8.0]))));
        cases.push(case("upright", Box::new(corner([Axis::X, Axis::Z, Axis::Y], [0.0, 5.0, 0.0]))));
    }
    cases
}

fn tower_5(size: Size) -> Vec<Case> {
    let case = |ratio| {
        let cuts = planes(Axis::Y, [4.0, 2.0, 6.0, 8.0, 1.0, 9.0, 3.0]);
        Case::new(format!("{ratio}:1"), tower_of(ratio), size.pick(10.0, 60.0), cuts, |trace, _| {
            displacement(trace)
        })
    };
    [1, 10, 100].map(|ratio| case(ratio).resting()).into()
}

fn tower_of(ratio: u32) -> Scene {
    let params = Params::new().with("top_mass_ratio", ratio).with("sleep", 0);
    Scene::named("tower", &params).expect("the library has towers")
}

fn pyramid(size: Size) -> Vec<Case> {
    let scene = |base: u32| {
        let params = Params::new().with("base", base).with("sleep", 0);
        Scene::named("pyramid", &params).expect("the library has pyramids")
    };
    let steps_s = |steps: u32| f64::from(steps) / 60.0;
    let cuts = |height: f64| {
        move |regions: usize| -> Vec<Cut> {
            match regions {
                2 => vec![(Axis::X, 0.0)],
                4 => vec![(Axis::X, 0.0), (Axis::Y, height)],
                _ => vec![(Axis::X, 0.0), (Axis::Y, height), (Axis::X, -4.0), (Axis::X, 4.0)],
            }
        }
    };
    let layers = planes(Axis::Y, [5.0, 2.0, 9.0, 4.0, 7.0, 12.0, 1.0]);
    let large = size.pick(40, 100);
    let large_s = steps_s(size.pick(200, 1000));
    let mut upright = Case::new("base 20 crossed", scene(20), steps_s(1000), cuts(4.5), deviation);
    let mut across = Case::new("base 20 layers", scene(20), steps_s(1000), layers, deviation);
    (upright.threshold, across.threshold) = (Some(0.01), Some(0.01));
    let whole =
        Case::new(format!("base {large}"), scene(large), large_s, cuts(5.0), |trace, _| displacement(trace));
    vec![upright.resting(), across.resting(), whole.resting()]
}

/// Returns the largest distance of a body from its first place, mean of the last second.
pub(super) fn displacement(trace: &Trace) -> f64 {
    let first = trace.first();
    let (count, sum) = trace.tail(1.0).fold((0, 0.0), |(count, sum), look| {
        (count + 1, sum + worst(first.moving().map(|body| distance(look.place(body), first.place(body)))))
    });
    sum / f64::from(count)
}

/// Returns the largest distance of a body from where one bare world has it at the end.
pub(super) fn deviation(trace: &Trace, r1: &Trace) -> f64 {
    let (own, reference) = (trace.last(), r1.last());
    worst(reference.moving().map(|body| distance(own.place(body), reference.place(body))))
}
