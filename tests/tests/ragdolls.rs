//! Tests that the joints of ragdolls that tumble down stairs through eight regions come apart no more than in
//! one world.

use dcd::physics::{Coupling, Measured};
use dcd::rapier3d::prelude::*;
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::scene::{Params, Scene};
use dcd::space::Axis;

/// Distances between the two anchors of joints, metres: the one that one in a thousand exceeds, and the
/// largest.
#[derive(Debug)]
struct Apart {
    one_in_1000: f64,
    largest: f64,
}

fn scene(set: &[&str]) -> Scene {
    let set: Vec<_> = set.iter().map(|&one| one.to_owned()).collect();
    Scene::named("ragdolls", &Params::from_args(&set).unwrap()).unwrap()
}

/// Returns a world in eight regions: quarters across the stairs, halves along them.
fn eight_regions(scene: &Scene, coupling: Coupling) -> LocalWorld {
    let quarter = scene.bounds.size()[0] / 4.0;
    let across = [2.0, 1.0, 3.0].map(|count| (Axis::X, count * quarter));
    let mut config = WorldConfig {
        partitioning: Partitioning::Cuts([&across[..], &[(Axis::Z, 1.1)]].concat()),
        ..WorldConfig::for_scene(scene)
    };
    (config.step.coupling, config.step.exchanges) = (coupling, coupling.usual_exchanges());
    // Ragdolls that lie on one another must not all go to one region.
    config.step.island_limit = 256;
    LocalWorld::from_scene(scene, config).unwrap()
}

/// Runs a world, and returns how far the two anchors of its joints were apart over all steps.
fn apart<W: Measured>(scene: &Scene, world: &mut W, step: impl Fn(&mut W)) -> Apart {
    const TICKS: usize = 240;
    let mut gaps = Vec::new();
    for _ in 0..TICKS {
        step(world);
        let mut poses = vec![None; scene.bodies.len()];
        for (id, _, pose, _) in world.states() {
            let place = Vector::from(pose.translation.map(|v| v as f32));
            poses[id.bits() as usize] = Some(Pose::from_parts(place, Rotation::from_array(pose.rotation)));
        }
        gaps.extend(scene.joints.iter().map(|joint| {
            let end = |body: usize, frame: &Pose| (poses[body].expect("owned") * *frame).translation;
            let (a, b) = (end(joint.a, &joint.joint.local_frame1), end(joint.b, &joint.joint.local_frame2));
            f64::from(a.distance(b))
        }));
    }
    gaps.sort_unstable_by(f64::total_cmp);
    Apart { one_in_1000: gaps[gaps.len() - gaps.len() / 1000], largest: gaps[gaps.len() - 1] }
}

fn holds(set: &[&str], couplings: &[Coupling]) {
    let scene = scene(set);
    let bare = apart(&scene, &mut scene.bare_world(), PhysicsWorld::step);
    for &coupling in couplings {
        let mut world = eight_regions(&scene, coupling);
        let cut = apart(&scene, &mut world, |world| world.step().unwrap());
        // The largest distance of one run is a matter of luck.
        for (own, most) in [(cut.one_in_1000, 1.1 * bare.one_in_1000), (cut.largest, 1.3 * bare.largest)] {
            assert!(own <= most + 1e-4, "{coupling:?}: {cut:?}, in one world {bare:?}");
        }
        // At least the bodies of two ragdolls: a body that only meets another region's stays where it is.
        assert!(world.stats().transfers > 22, "{coupling:?}: {:?}", world.stats());
    }
}

#[test]
fn ragdolls_that_tumble_through_eight_regions_come_apart_as_in_one_world() {
    holds(&["count=40", "sleep=0"], &[Coupling::Auto, Coupling::Island, Coupling::Overlap]);
}

#[test]
fn ragdolls_that_are_multibodies_come_apart_as_in_one_world() {
    holds(&["count=40", "sleep=0", "multibody=1"], &[Coupling::Auto, Coupling::Island]);
}
