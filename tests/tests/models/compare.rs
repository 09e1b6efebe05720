//! Compares a model in regions with the same model in one bare Rapier world.

use std::collections::BTreeSet;
use std::path::Path;

use dcd::physics::{Measured, View};
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::scene::{Params, Scene};
use dcd::space::BodyId;
use rapier3d::prelude::*;

/// The results of a run of some seconds.
#[derive(Clone, Debug)]
pub(crate) struct Run {
    /// The mass of all dynamic bodies, kilograms.
    pub(crate) mass_kg: f64,
    /// The force on the ground divided by the weight, mean of the last three seconds; `None` if nothing was
    /// measured.
    pub(crate) ground: Option<f64>,
    /// How far joints were apart, metres: the root mean square over joints and time.
    pub(crate) apart_m: f64,
    /// The largest distance of any joint at any time, metres.
    pub(crate) farthest_m: f64,
    /// The bodies that Rapier set aside.
    pub(crate) quarantined: BTreeSet<BodyId>,
}

/// Loads the scene of a file, with parameters as on the command line.
pub(crate) fn scene(path: &Path, params: &str) -> Scene {
    let params = Params::from_args(params.split_whitespace()).unwrap();
    Scene::load(path, &params).unwrap_or_else(|error| panic!("{error}"))
}

/// Runs a scene in one bare world.
pub(crate) fn bare(scene: &Scene, seconds: f32) -> Run {
    let mut world = scene.bare_world();
    let handles: Vec<_> = world.rigid_bodies().map(|(handle, _)| handle).collect();
    run(
        scene,
        seconds,
        &mut world,
        |world| world.step(),
        |world, index| *world.bodies[handles[index]].position(),
    )
}

/// Runs a scene in this many regions. Robots that borders cut move whole to one region, or are `shared` among
/// several.
pub(crate) fn regions(scene: &Scene, count: usize, shared: bool, seconds: f32) -> Run {
    let mut config = WorldConfig {
        partitioning: Partitioning::Regions(count),
        threads: 2,
        ..WorldConfig::for_scene(scene)
    };
    if shared {
        config.step.island_limit = 0;
    }
    let mut world = LocalWorld::from_scene(scene, config).unwrap();
    let fixed: Vec<Pose> =
        scene.bodies.iter().map(|body| pose(body.pose.translation, body.pose.rotation)).collect();
    let step = |world: &mut LocalWorld| world.step().unwrap();
    let at = |world: &LocalWorld, index: usize| {
        world
            .pose(BodyId::persistent(index as u32))
            .map_or(fixed[index], |at| pose(at.translation, at.rotation))
    };
    let run = run(scene, seconds, &mut world, step, at);
    for index in 0..scene.bodies.len() {
        let id = BodyId::persistent(index as u32);
        if scene.bodies[index].body.body_type != RigidBodyType::Fixed {
            assert_eq!(world.owners_of(id), 1, "{id} of {}", scene.name);
        }
    }
    run
}

fn pose(translation: [f64; 3], rotation: [f32; 4]) -> Pose {
    Pose::from_parts(Vector::from(translation.map(|v| v as f32)), Rotation::from_array(rotation))
}

/// Returns the mass of all dynamic bodies. The shares of one body add up to its mass.
fn mass_kg(views: &[View<'_>]) -> f64 {
    let of = |view: &View<'_>| {
        let owned =
            view.physics().bodies.iter().filter(|(handle, body)| view.owns(*handle) && body.is_dynamic());
        owned.map(|(handle, body)| f64::from(body.mass()) * view.parts(handle)).sum::<f64>()
    };
    views.iter().map(of).sum()
}

fn run<W: Measured>(
    scene: &Scene,
    seconds: f32,
    world: &mut W,
    step: impl Fn(&mut W),
    at: impl Fn(&W, usize) -> Pose,
) -> Run {
    let ticks = (seconds / scene.dt_s) as usize;
    let every = ((0.02 / scene.dt_s) as usize).max(1);
    let (mut squares, mut samples, mut farthest) = (0.0, 0, 0f64);
    let mut quarantined = BTreeSet::new();
    let mut ground = Vec::new();
    for tick in 0..ticks {
        step(world);
        quarantined.extend(world.quarantined());
        if tick % every != 0 {
            continue;
        }
        for joint in scene.joints.iter().filter(|joint| joint.joint.is_enabled()) {
            let apart = apart(&joint.joint, at(world, joint.a), at(world, joint.b));
            squares += apart * apart;
            samples += 1;
            farthest = farthest.max(apart);
        }
        if (ticks - tick) as f32 * scene.dt_s <= 3.0 {
            let sample = world.contacts();
            ground.extend(sample.ground_force_ratio());
        }
    }
    let ground_mean = ground.iter().sum::<f64>() / ground.len() as f64;
    Run {
        mass_kg: mass_kg(&world.views()),
        ground: (!ground.is_empty()).then_some(ground_mean),
        apart_m: (squares / f64::from(samples.max(1))).sqrt(),
        farthest_m: farthest,
        quarantined,
    }
}

/// Returns how far a joint's ends are apart along the axes that it locks, metres.
fn apart(joint: &GenericJoint, a: Pose, b: Pose) -> f64 {
    let (a, b) = (a * joint.local_frame1, b * joint.local_frame2);
    let between = a.rotation.inverse() * (b.translation - a.translation);
    let axes = [JointAxesMask::LIN_X, JointAxesMask::LIN_Y, JointAxesMask::LIN_Z];
    let along =
        between.to_array().into_iter().zip(axes).filter(|(_, axis)| joint.locked_axes.contains(*axis));
    along.map(|(v, _)| f64::from(v).powi(2)).sum::<f64>().sqrt()
}
