//! Tests that measured quantities agree with closed forms, in one world and in a world cut in two.

use super::*;
use crate::physics::settings::WHOLE;
use crate::physics::{Coupling, StepSettings};
use crate::runtime::{LocalWorld, Partitioning, WorldConfig};
use crate::scene::{Params, Scene};
use crate::space::{Axis, Bounds};

const STEPS: usize = 240;
const SAMPLED: usize = 60;

/// Returns the mean ratio of the force on the ground to the weight over the last second.
fn mean_ratio(steps: usize, mut step: impl FnMut() -> ContactSample) -> f64 {
    let ratios: Vec<_> = (0..steps).map(|_| step().ground_force_ratio().expect("there is gravity")).collect();
    ratios[steps - SAMPLED..].iter().sum::<f64>() / SAMPLED as f64
}

fn bare_ratio(world: &mut PhysicsWorld) -> f64 {
    mean_ratio(STEPS, || {
        world.step();
        world.contacts()
    })
}

/// Returns a world with a unit box on a rough floor that leans by this angle about z.
fn box_on_slope(degrees: f32) -> PhysicsWorld {
    box_on_slope_of(degrees, 2.0)
}

fn box_on_slope_of(degrees: f32, friction: f32) -> PhysicsWorld {
    let mut world = PhysicsWorld::new();
    world.gravity = Vector::new(0.0, -9.81, 0.0);
    let turn = Rotation::from_rotation_z(degrees.to_radians());
    let rough = |collider: ColliderBuilder| collider.friction(friction);
    world.insert(
        RigidBodyBuilder::fixed().pose(Pose::from_parts(turn * Vector::new(0.0, -0.5, 0.0), turn)),
        rough(ColliderBuilder::cuboid(20.0, 0.5, 20.0)),
    );
    world.insert(
        RigidBodyBuilder::dynamic()
            .can_sleep(false)
            .pose(Pose::from_parts(turn * Vector::new(0.0, 0.5, 0.0), turn)),
        rough(ColliderBuilder::cuboid(0.5, 0.5, 0.5)),
    );
    world
}

fn tower(cut: Option<(Axis, f64)>) -> LocalWorld {
    let scene = Scene::named("tower", &Params::new()).unwrap();
    let partitioning = cut.map_or(Partitioning::Regions(1), |cut| Partitioning::Cuts(vec![cut]));
    LocalWorld::from_scene(&scene, WorldConfig { partitioning, ..WorldConfig::for_scene(&scene) }).unwrap()
}

#[test]
fn a_box_at_rest_presses_on_the_floor_with_its_weight() {
    let ratio = bare_ratio(&mut box_on_slope(0.0));
    assert!((ratio - 1.0).abs() < 0.001, "{ratio}");
}

#[test]
fn every_pair_that_touches_has_one_depth_in_one_world_and_across_a_border() {
    let depths_m = |world: &dyn Measured| {
        let mut depths_m = world.penetrations_m();
        depths_m.sort_by(f64::total_cmp);
        depths_m
    };
    let mut bare = Scene::named("tower", &Params::new()).unwrap().bare_world();
    let mut cut = tower(Some((Axis::Y, 4.5)));
    for _ in 0..STEPS {
        bare.step();
        cut.step().unwrap();
    }
    for world in [&bare as &dyn Measured, &cut] {
        let depths_m = depths_m(world);
        assert_eq!(depths_m.len(), 10);
        assert!((depths_m[9] - world.contacts().max_penetration_m).abs() < 1e-3, "{depths_m:?}");
        assert!(depths_m[0] >= 0.0 && depths_m[9] > depths_m[0], "what lies lower bears more: {depths_m:?}");
    }
}

#[test]
fn on_a_slope_friction_carries_its_part_of_the_weight() {
    for friction_model in [FrictionModel::Simplified, FrictionModel::Coulomb] {
        let mut world = box_on_slope(10.0);
        world.integration_parameters.friction_model = friction_model;
        let ratio = bare_ratio(&mut world);
        assert!((ratio - 1.0).abs() < 0.005, "{friction_model:?}: {ratio}, normals alone would give 0.970");
    }
}

#[test]
fn a_sliding_box_presses_with_less_than_its_weight() {
    const FRICTION: f64 = 0.2;
    let (sin, cos) = 20f64.to_radians().sin_cos();
    let exact = cos * (cos + FRICTION * sin);
    for friction_model in [FrictionModel::Simplified, FrictionModel::Coulomb] {
        let mut world = box_on_slope_of(20.0, FRICTION as f32);
        world.integration_parameters.friction_model = friction_model;
        let ratio = mean_ratio(90, || {
            world.step();
            world.contacts()
        });
        assert!((ratio - exact).abs() < 0.005, "{friction_model:?}: {ratio} instead of {exact}");
    }
}

#[test]
fn extra_iterations_of_a_body_change_nothing_of_its_weight() {
    let mut world = box_on_slope(10.0);
    let leaning = world.rigid_bodies().nth(1).unwrap().0;
    world.bodies[leaning].set_additional_solver_iterations(12);
    let ratio = bare_ratio(&mut world);
    assert!((ratio - 1.0).abs() < 0.005, "{ratio}");
}

#[test]
fn on_many_triangles_no_contact_is_counted_twice() {
    for clustering in [true, false] {
        let mut world = PhysicsWorld { gravity: Vector::new(0.0, -9.81, 0.0), ..PhysicsWorld::new() };
        world.integration_parameters.contact_clustering = clustering;
        let flat = Array2::new(33, 33, vec![0.0; 33 * 33]);
        let floor = ColliderBuilder::heightfield(flat, Vector::new(8.0, 1.0, 8.0));
        world.insert(RigidBodyBuilder::fixed(), floor);
        let body = RigidBodyBuilder::dynamic().can_sleep(false).translation(Vector::new(0.1, 0.5, 0.1));
        world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5));
        let ratio = bare_ratio(&mut world);
        assert!((ratio - 1.0).abs() < 0.005, "clustering {clustering}: {ratio}");
        assert_eq!(world.contacts().pairs, 1);
    }
}

#[test]
fn a_tower_presses_with_its_weight_also_when_a_border_runs_up_through_it() {
    for cut in [None, Some((Axis::X, 0.0)), Some((Axis::Z, 0.2))] {
        let mut world = tower(cut);
        let ratio = mean_ratio(STEPS, || {
            world.step().unwrap();
            world.host().contacts()
        });
        assert!((ratio - 1.0).abs() < 0.01, "{cut:?}: {ratio}");
        let sample = world.host().contacts();
        assert_eq!(sample.pairs, 10, "{cut:?}");
        assert!((0.0005..0.02).contains(&sample.max_penetration_m), "{cut:?}: {sample:?}");
    }
}

/// Builds two towers of six boxes on one floor, cut by these planes. The second tower falls asleep only if
/// `both_sleep`. Islands are never moved whole, and regions that share anything take `exchanges` substeps.
fn two_towers(cuts: &[(Axis, f64)], exchanges: usize, both_sleep: bool) -> LocalWorld {
    let mut scene = Scene::empty("two towers");
    scene.push_fixed_box([0.0, -0.5, 0.0], [20.0, 0.5, 20.0], &ColliderBuilder::ball(1.0).friction(0.7));
    for (x, may_sleep) in [(0.0, true), (8.0, both_sleep)] {
        for level in 0..6 {
            let pose = WorldPose::at([x, f64::from(level) + 0.5, 0.0]);
            let body = RigidBodyBuilder::dynamic().can_sleep(may_sleep);
            scene.push(pose, body, ColliderBuilder::cuboid(0.5, 0.5, 0.5).mass(1.0).friction(0.7));
        }
    }
    scene.bounds = Bounds::new([-4.0, -1.0, -4.0], [12.0, 8.0, 4.0]);
    let config = WorldConfig::for_scene(&scene);
    let step = StepSettings { exchanges, ..config.step.with_coupling(Coupling::Overlap) };
    let partitioning = Partitioning::Cuts(cuts.to_vec());
    LocalWorld::from_scene(&scene, WorldConfig { partitioning, step, ..config }).unwrap()
}

#[test]
fn what_sleeps_presses_with_its_weight_whatever_substeps_were_taken_then_and_are_now() {
    let cuts = [(Axis::Y, 3.0), (Axis::X, 0.1), (Axis::Y, 1.5)];
    for (count, exchanges) in [(0, 1), (1, 1), (1, 2), (1, 4), (2, 2), (2, 4), (3, 4)] {
        for both_sleep in [true, false] {
            let case = format!("{count} cuts, {exchanges} exchanges, both sleep: {both_sleep}");
            let mut world = two_towers(&cuts[..count], exchanges, both_sleep);
            let asleep = |world: &LocalWorld| {
                (1..=6).all(|id| world.body(BodyId::persistent(id)).is_some_and(RigidBody::is_sleeping))
            };
            let (mut most, mut since, mut ratios) = (0, 0, Vec::new());
            for _ in 0..600 {
                world.step().unwrap();
                if !asleep(&world) {
                    most = most.max(world.host().rounds());
                    (since, ratios) = (0, Vec::new());
                    continue;
                }
                since += 1;
                ratios.push(world.host().contacts().ground_force_ratio().unwrap());
            }
            assert!(since > 200, "{case}: it fell asleep {since} ticks ago");
            assert_eq!(most, if count == 0 { 1 } else { exchanges }, "{case}");
            let all: Vec<_> = ratios.iter().filter(|ratio| (*ratio - 1.0).abs() > 0.03).collect();
            assert!(all.is_empty(), "{case}: {all:?} in {since} ticks");
        }
    }
}

/// The coupling decides whether the two sides of a horizontal border agree on the force between them. The
/// measure must hold in any case: the ground carries what the lower region lets its topmost body carry, and
/// that region's own weight.
#[test]
fn across_a_border_each_contact_is_counted_once_and_forces_add_up() {
    let mut world = tower(Some((Axis::Y, 5.0)));
    for _ in 0..STEPS {
        world.step().unwrap();
    }
    let lower = world.regions().next().unwrap();
    let up_on = |below: u32| {
        let pair_of = |pair: &&ContactPair| {
            let named = |c: ColliderHandle| {
                View::Region(lower).name(lower.physics().colliders[c].parent().unwrap()).unwrap()
            };
            [pair.collider1, pair.collider2].map(named) == [below, below + 1].map(BodyId::persistent)
        };
        let world = lower.physics();
        let pair = world.contact_pairs().find(pair_of).unwrap();
        contacts::force_over_n(world, pair, world.integration_parameters.dt)[1]
    };
    let sample = world.host().contacts();
    assert_eq!(sample.pairs, 10);
    assert!((sample.weight_n - 98.1).abs() < 1e-3);
    assert!((sample.ground_force_n - up_on(0)).abs() < 1e-9);
    // Under this coupling the tower is not quite at rest: its lower half decelerates by up to 0.1 m/s².
    assert!((up_on(0) - up_on(5) - 5.0 * 9.81).abs() < 0.5, "{} {}", up_on(0), up_on(5));
}

#[test]
fn penetration_is_that_of_the_bodies_now() {
    let mut world = box_on_slope(0.0);
    for _ in 0..STEPS {
        world.step();
        let lowest = world.rigid_bodies().map(|(_, body)| body.translation().y).fold(0.0, f32::max) - 0.5;
        let depth_m = world.contacts().max_penetration_m;
        assert!((depth_m - f64::from(-lowest).max(0.0)).abs() < 1e-4, "{depth_m} m at {lowest} m");
    }
}

#[test]
fn a_kinematic_platform_is_no_ground() {
    let mut world = box_on_slope(0.0);
    let floor = world.rigid_bodies().next().unwrap().0;
    world.bodies[floor].set_body_type(RigidBodyType::KinematicPositionBased, true);
    world.step();
    assert_eq!(bare_ratio(&mut world), 0.0);
    assert_eq!(world.contacts().pairs, 1);
}

#[test]
fn energy_counts_spin_and_height_before_and_after_the_first_step() {
    let mut world = PhysicsWorld::new();
    world.gravity = Vector::new(0.0, -10.0, 0.0);
    let (spinning, _) = world.insert(
        RigidBodyBuilder::dynamic()
            .translation(Vector::new(0.0, 3.0, 0.0))
            .linvel(Vector::new(2.0, 0.0, 0.0))
            .angvel(Vector::new(0.0, 0.0, 4.0)),
        ColliderBuilder::cuboid(0.5, 1.0, 1.5).mass(6.0),
    );
    // ½·6·2² + ½·(6/12)(1² + 2²)·4² + 6·10·3
    let exact_j = 12.0 + 20.0 + 180.0;
    assert!((world.energy_j() - exact_j).abs() < 1e-4, "{}", world.energy_j());
    assert_eq!(world.momentum_kgms(), [12.0, 0.0, 0.0]);
    world.gravity = Vector::ZERO;
    world.step();
    assert!((world.energy_j() - 32.0).abs() < 1e-4, "{}", world.energy_j());
    world.bodies[spinning].set_enabled(false);
    assert_eq!(world.energy_j(), 0.0);
}

#[test]
fn a_free_fall_keeps_its_energy_however_the_world_is_cut() {
    let config = |partitioning| WorldConfig { partitioning, ..WorldConfig::default() };
    for partitioning in [Partitioning::Regions(1), Partitioning::Cuts(vec![(Axis::Y, 5.0)])] {
        let mut world = LocalWorld::new(config(partitioning)).unwrap();
        let ball = RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 10.0, 0.0));
        world.insert(ball, ColliderBuilder::ball(0.5).mass(2.0)).unwrap();
        let start_j = world.host().energy_j();
        assert!((start_j - 2.0 * 9.81 * 10.0).abs() < 1e-3);
        for _ in 0..60 {
            world.step().unwrap();
        }
        // Semi-implicit Euler loses ½ m g² dt t, 1.6 J here.
        let lost_j = start_j - world.host().energy_j();
        assert!(lost_j.abs() < 1.0 * 9.81 * 9.81 / 60.0 * 1.01 + 0.01, "{lost_j} J");
        assert_eq!(world.host().census().lost(&[BodyId::persistent(0), BodyId::persistent(1)]), 1);
    }
}

#[test]
fn a_world_of_one_region_hashes_as_the_bare_world_does() {
    let scene = Scene::named("tower", &Params::new()).unwrap();
    let (mut bare, mut one) = (scene.bare_world(), tower(None));
    for _ in 0..120 {
        bare.step();
        one.step().unwrap();
    }
    assert_eq!(bare.state_hash(), one.state_hash());
    assert_eq!(bare.state_hash(), one.host().state_hash());
    assert_eq!(bare.states().len(), 10);
}

#[test]
fn a_body_that_is_not_finite_is_named() {
    let mut world = box_on_slope(0.0);
    world.step();
    let fallen = world.rigid_bodies().nth(1).unwrap().0;
    world.bodies[fallen].add_force(Vector::NAN, true);
    world.step();
    assert_eq!(world.quarantined(), [BodyId::persistent(1)]);
    world.step();
    assert_eq!(world.quarantined(), []);
}

/// One region computes all of a heap, or many regions a part of it each. The lowest boxes press on the ground in
/// their owner's world, also where the boxes that lie on them are not owned there.
#[test]
fn a_heap_presses_on_the_ground_with_its_weight_whoever_owns_the_boxes_below() {
    let owners_of = |island_limit| {
        let scene = Scene::named("heap", &Params::new().with("n", 500).with("seed", 3)).unwrap();
        let cuts = vec![(Axis::X, 0.0), (Axis::Z, 0.0), (Axis::Y, 3.0)];
        let mut config =
            WorldConfig { partitioning: Partitioning::Cuts(cuts), ..WorldConfig::for_scene(&scene) };
        config.step.island_limit = island_limit;
        let mut world = LocalWorld::from_scene(&scene, config).unwrap();
        let ratio = mean_ratio(450, || {
            world.step().unwrap();
            world.host().contacts()
        });
        assert!((ratio - 1.0).abs() < 1e-3, "islands of up to {island_limit}: {ratio}");
        world.regions().filter(|region| region.owned_count() > 1).count()
    };
    assert_eq!([WHOLE, 0].map(owners_of), [1, 8]);
}
