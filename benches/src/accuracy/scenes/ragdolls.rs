//! Defines the experiment of ragdolls that tumble down stairs, across borders.

use dcd::rapier3d::prelude::*;
use dcd::scene::{Params, Scene, SceneJoint};
use dcd::space::Axis;

use super::super::reading::BROKEN;
use super::super::scene::{Case, Cut, Experiment, Measure, Size};
use super::super::trace::{Look, Trace};

/// How far the joints of ragdolls come apart.
pub(super) const RAGDOLLS: Experiment = Experiment {
    number: 27,
    name: "ragdolls",
    metric: "distance between the two anchors of a joint at all looks: the largest, and that of one in 1000, m",
    cases: ragdolls,
    more_regions: &[],
    finer: false,
};

fn ragdolls(size: Size) -> Vec<Case> {
    let case = |label: &str, count: usize, multibody: u32, part: f64| {
        // The largest gap of few ragdolls is a matter of chance, hence several seeds.
        let scenes: Vec<_> = (1..=size.pick(3, 1)).map(|seed| scene(count, seed, multibody)).collect();
        let (joints, cuts) = (scenes[0].joints.clone(), through(&scenes[0]));
        let measure = Measure::Formula(Box::new(move |trace, _| gap_m(trace, &joints, part)));
        Case { look_s: 1.0 / 30.0, ..Case::of(label, scenes, 5.0, cuts, measure) }
    };
    let (few, many) = (size.pick(30, 100), size.pick(60, 1000));
    vec![
        case("largest", many, 0, 1.0),
        case("one in 1000", many, 0, 0.999),
        case("multibodies: one in 1000", few, 1, 0.999),
    ]
}

fn scene(count: usize, seed: u64, multibody: u32) -> Scene {
    let params = Params::new().with("count", count).with("seed", seed).with("multibody", multibody);
    Scene::named("ragdolls", &params.with("sleep", 0)).expect("the library has ragdolls")
}

/// Returns borders across the stairs and the floor at their foot, and along them through a column of
/// ragdolls.
fn through(scene: &Scene) -> impl Fn(usize) -> Vec<Cut> + use<> {
    let [length_m, ..] = scene.bounds.size();
    let (across, along) = (move |quarter: f64| (Axis::X, 0.25 * quarter * length_m), (Axis::Z, 1.1));
    move |regions| match regions {
        2 => vec![across(2.0)],
        4 => vec![across(2.0), along],
        _ => vec![across(2.0), along, across(1.0), across(3.0)],
    }
}

/// Returns the gap that this part of the joints of all looks does not exceed.
fn gap_m(trace: &Trace, joints: &[SceneJoint], part: f64) -> f64 {
    let mut gaps: Vec<_> =
        trace.looks.iter().flat_map(|look| joints.iter().map(|joint| gap_of(look, joint))).collect();
    let place = ((gaps.len() - 1) as f64 * part) as usize;
    *gaps.select_nth_unstable_by(place, f64::total_cmp).1
}

/// Returns how far apart the two bodies of a joint hold the point that should be one; the worst error if one
/// is lost.
fn gap_of(look: &Look, joint: &SceneJoint) -> f64 {
    let anchor = |body: usize, frame: &Pose| {
        let (pose, _) = look.bodies[body]?;
        let [x, y, z] = frame.translation.to_array().map(f64::from);
        Some(pose.isometry() * nalgebra::Point3::new(x, y, z))
    };
    let ends = anchor(joint.a, &joint.joint.local_frame1).zip(anchor(joint.b, &joint.joint.local_frame2));
    let gap = ends.map_or(BROKEN, |(a, b)| (a - b).norm());
    if gap.is_finite() { gap } else { BROKEN }
}

#[cfg(test)]
mod tests {
    use dcd::protocol::{Velocity, WorldPose};

    use super::*;

    #[test]
    fn the_gap_is_that_of_the_joints_that_are_farthest_apart() {
        let scene = scene(1, 1, 0);
        let mut look = Look {
            bodies: scene.bodies.iter().map(|body| Some((body.pose, Velocity::default()))).collect(),
            ..Look::default()
        };
        let of = |look: &Look, part| {
            gap_m(&Trace { looks: vec![look.clone()], ..Trace::default() }, &scene.joints, part)
        };
        assert!(of(&look, 1.0) < 1e-6);
        // A shin is the last body of a ragdoll, and hangs on one joint of ten.
        let last = scene.bodies.len() - 1;
        let [x, y, z] = scene.bodies[last].pose.translation;
        look.bodies[last] = Some((
            WorldPose { translation: [x, y + 0.1, z], ..scene.bodies[last].pose },
            Velocity::default(),
        ));
        assert!((of(&look, 1.0) - 0.1).abs() < 1e-6);
        assert!(of(&look, 0.8) < 1e-6);
        look.bodies[last] = None;
        assert_eq!(of(&look, 1.0), BROKEN);
    }
}
