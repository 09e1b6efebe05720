//! Tests worlds that compute less where nobody looks: no body is lost, what is in sight is as if all were
//! computed in full, time neither stands still nor runs twice, and the error is as stated.

mod audited;
mod loads;
mod noted;
mod out_of_sight;
mod program;
mod repeated;
mod seen;
mod stated;
mod unlike_rates;

use dcd::prelude::*;
use dcd::runtime::LocalWorld;
use dcd::space::{Axis, BodyId};
use dcd::{Coupling, Fidelity, Viewpoint};

/// All regions except those in sight come to be stepped in every fourth tick.
const ALL_COARSE: Fidelity = Fidelity::Tolerance { m_s: 1e6 };

fn town(cars: usize) -> Scene {
    Scene::open("town", &Params::default().with("n", 1_200).with("cars", cars)).unwrap()
}

fn world(scene: &Scene, fidelity: Fidelity, threads: usize) -> LocalWorld {
    LocalWorld::from_scene(scene, WorldConfig { fidelity, threads, ..WorldConfig::for_scene(scene) }).unwrap()
}

/// Returns an empty world of this many regions along x, 20 m each.
fn row(regions: usize, fidelity: Fidelity, gravity: [f32; 3]) -> LocalWorld {
    row_of(regions, fidelity, gravity, Coupling::Auto)
}

fn row_of(regions: usize, fidelity: Fidelity, gravity: [f32; 3], coupling: Coupling) -> LocalWorld {
    let half_m = 10.0 * regions as f64;
    let mut config = WorldConfig {
        bounds: Bounds::around([0.0; 3], [half_m, 20.0, 20.0]),
        partitioning: Partitioning::Cuts((1..regions).map(|k| (Axis::X, 20.0 * k as f64 - half_m)).collect()),
        fidelity,
        ..WorldConfig::default()
    };
    config.step = config.step.with_coupling(coupling);
    config.step.gravity = gravity;
    LocalWorld::new(config).unwrap()
}

/// Returns four regions in a row, of which the last one is seen, on a floor of half a metre.
fn unseen(fidelity: Fidelity) -> LocalWorld {
    let mut world = row(4, fidelity, [0.0, -9.81, 0.0]);
    world.set_viewpoints(&[Viewpoint { at: [35.0, 0.0, 0.0], radius_m: 1.0 }]).unwrap();
    let floor = RigidBodyBuilder::fixed().translation(Vector::Y * -0.25);
    world.insert(floor, ColliderBuilder::cuboid(80.0, 0.25, 40.0)).unwrap();
    world
}

fn run(world: &mut LocalWorld, ticks: usize) {
    for _ in 0..ticks {
        world.step().unwrap();
    }
}

fn levels(world: &LocalWorld) -> [usize; 3] {
    world.fidelity_report().unwrap().levels
}

/// Returns whether the region of a body is behind the present.
fn is_late(world: &LocalWorld, id: BodyId) -> bool {
    world.owner_of(id).is_some_and(|region| world.host().behind(region) > 0)
}

fn length(of: [f64; 3]) -> f64 {
    of.map(|v| v * v).iter().sum::<f64>().sqrt()
}
