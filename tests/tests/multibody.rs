//! Tests multibody joints in a partitioned world: one region has all of a multibody, which moves on in one
//! piece.

use dcd::physics::{Coupling, LinkSettings, StepSettings};
use dcd::protocol::{Velocity, WorldPose};
use dcd::rapier3d::prelude::*;
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::scene::{Scene, SceneJoint};
use dcd::space::{Axis, Balance, BodyId, Bounds, JointId};

/// Adds to a scene a cart with an arm of this many links. Returns the index of the cart's body.
fn cart(scene: &mut Scene, at: [f64; 3], links: usize) -> usize {
    let upright = LockedAxes::ROTATION_LOCKED_X | LockedAxes::ROTATION_LOCKED_Y;
    let body = RigidBodyBuilder::dynamic().locked_axes(upright).can_sleep(false);
    let first = scene.push(WorldPose::at(at), body, ColliderBuilder::cuboid(0.5, 0.25, 0.5).friction(0.0));
    let (mut below, mut anchor) = (first, Vector::Y * 0.25);
    for link in 0..links {
        let place = [at[0], at[1] + 0.5 + 0.5 * link as f64, at[2]];
        let body = RigidBodyBuilder::dynamic().can_sleep(false);
        let arm = scene.push(WorldPose::at(place), body, ColliderBuilder::capsule_y(0.15, 0.08).mass(0.5));
        let joint: GenericJoint = if link % 2 == 0 {
            let hinge = RevoluteJointBuilder::new(Vector::Z).motor_position(0.3, 40.0, 6.0);
            hinge.local_anchor1(anchor).local_anchor2(Vector::Y * -0.25).contacts_enabled(false).into()
        } else {
            let ball = SphericalJointBuilder::new().local_anchor1(anchor).local_anchor2(Vector::Y * -0.25);
            ball.contacts_enabled(false).into()
        };
        scene.joints.push(SceneJoint { a: below, b: arm, joint, multibody: Some(LinkSettings::default()) });
        (below, anchor) = (arm, Vector::Y * 0.25);
    }
    first
}

fn flat(name: &str) -> Scene {
    let mut scene = Scene::empty(name);
    scene.push_fixed_box([0.0, -0.5, 0.0], [60.0, 0.5, 20.0], &ColliderBuilder::ball(1.0).friction(0.0));
    scene.bounds = Bounds::around([0.0, 2.0, 0.0], [16.0, 4.0, 8.0]);
    scene
}

fn world_of(scene: &Scene, cuts: &[f64], coupling: Coupling) -> LocalWorld {
    let cuts: Vec<_> = cuts.iter().map(|&at| (Axis::X, at)).collect();
    let config = WorldConfig {
        partitioning: if cuts.is_empty() { Partitioning::Regions(1) } else { Partitioning::Cuts(cuts) },
        step: StepSettings { gravity: scene.gravity, ..StepSettings::default().with_coupling(coupling) },
        ..WorldConfig::for_scene(scene)
    };
    LocalWorld::from_scene(scene, config).unwrap()
}

/// Returns the largest distance between the two anchors of a joint, metres.
fn apart(scene: &Scene, pose: impl Fn(usize) -> Pose) -> f32 {
    let gap = |joint: &SceneJoint| {
        let end = |body, frame: &Pose| (pose(body) * *frame).translation;
        (end(joint.a, &joint.joint.local_frame1) - end(joint.b, &joint.joint.local_frame2)).length()
    };
    scene.joints.iter().map(gap).fold(0.0, f32::max)
}

fn pose_in(world: &LocalWorld, body: usize) -> Pose {
    let pose = world.pose(BodyId::persistent(body as u32)).unwrap();
    Pose::from_parts(Vector::from(pose.translation.map(|v| v as f32)), Rotation::from_array(pose.rotation))
}

#[test]
fn one_region_computes_a_multibody_to_the_bits_of_bare_rapier() {
    let mut scene = flat("carts");
    cart(&mut scene, [0.0, 0.25, 0.0], 4);
    cart(&mut scene, [3.0, 0.25, 0.0], 3);
    let (mut bare, mut world) = (scene.bare_world(), world_of(&scene, &[], Coupling::Auto));
    for _ in 0..240 {
        bare.step();
        world.step().unwrap();
    }
    for (index, (_, body)) in bare.rigid_bodies().enumerate() {
        assert_eq!(pose_in(&world, index), *body.position(), "body {index}");
    }
}

/// Returns two balls, 2 m apart, of which the second is a link of the first, along x and thrown.
fn thrown(joint: GenericJoint, velocities: [[f32; 3]; 2]) -> Scene {
    let mut scene = Scene { bounds: Bounds::around([0.0; 3], [40.0; 3]), ..Scene::empty("thrown") };
    for (index, velocity) in velocities.into_iter().enumerate() {
        let body = RigidBodyBuilder::dynamic().linvel(Vector::from(velocity));
        scene.push(WorldPose::at([2.0 * index as f64, 0.0, 0.0]), body, ColliderBuilder::ball(0.5));
    }
    scene.joints.push(SceneJoint { a: 0, b: 1, joint, multibody: Some(LinkSettings::default()) });
    scene
}

#[test]
fn links_start_with_the_velocities_of_their_bodies() {
    let fixed = FixedJointBuilder::new().local_anchor1(Vector::X * 2.0).build();
    let hinge = RevoluteJointBuilder::new(Vector::Z).local_anchor1(Vector::X * 2.0).build();
    let rail = PrismaticJointBuilder::new(Vector::X).local_anchor1(Vector::X * 2.0).build();
    for (joint, velocities) in [
        (fixed.into(), [[5.0, 1.0, 0.0]; 2]),
        (GenericJoint::from(hinge), [[5.0, 1.0, 0.0]; 2]),
        (rail.into(), [[1.0, 0.0, 3.0], [2.0, 0.0, 3.0]]),
    ] {
        let scene = Scene { gravity: [0.0; 3], ..thrown(joint, velocities) };
        for cuts in [&[][..], &[1.0]] {
            let mut world = world_of(&scene, cuts, Coupling::Auto);
            (0..60).for_each(|_| world.step().unwrap());
            for (index, (id, _, pose, velocity)) in world.states().enumerate() {
                let of = velocities[index];
                let way = (0..3).map(|i| (velocity.linear[i] - of[i]).abs()).fold(0.0, f32::max);
                let x = 2.0 * index as f64 + f64::from(of[0]);
                assert!(way < 0.01 && (pose.translation[0] - x).abs() < 0.02, "{id}: {pose:?} {velocity:?}");
            }
        }
    }
}

#[test]
fn a_multibody_is_no_faster_than_the_speed_limit() {
    let fixed = FixedJointBuilder::new().local_anchor1(Vector::X * 2.0).build();
    let scene = Scene { speed_limit_m_s: 5.0, ..thrown(fixed.into(), [[0.0; 3]; 2]) };
    let step = scene.step_settings();
    let mut world =
        LocalWorld::from_scene(&scene, WorldConfig { step, ..WorldConfig::for_scene(&scene) }).unwrap();
    for _ in 0..120 {
        world.step().unwrap();
        let speed = |velocity: Velocity| Vector::from(velocity.linear).length();
        assert!(world.states().all(|(.., velocity)| speed(velocity) < 5.001));
    }
    let fallen = -world.states().next().unwrap().2.translation[1];
    assert!((8.5..9.5).contains(&fallen), "it falls as fast as is allowed: {fallen}");
}

#[test]
fn a_multibody_rides_over_borders_as_in_one_world_with_every_coupling() {
    let mut scene = flat("rider");
    scene.gravity = [1.6, 0.0, 0.0];
    let first = cart(&mut scene, [-12.0, 0.3, 0.0], 4);
    let mut bare = scene.bare_world();
    (0..300).for_each(|_| bare.step());
    for coupling in Coupling::ALL {
        let mut world = world_of(&scene, &[-8.0, -2.0, 1.0, 5.0], coupling);
        let mut owners = std::collections::BTreeSet::new();
        for tick in 0..300 {
            world.step().unwrap();
            owners.insert(world.owner_of(BodyId::persistent(first as u32)).unwrap());
            let owner = |link: usize| world.owner_of(BodyId::persistent((first + link) as u32));
            assert!((0..=4).all(|link| owner(link) == owner(0)), "{coupling:?}: in pieces at tick {tick}");
        }
        assert_eq!(owners.len(), 5, "{coupling:?}");
        for (index, (_, body)) in bare.rigid_bodies().enumerate().skip(1) {
            let (here, there) = (pose_in(&world, index), body.position());
            let off = (here.translation - there.translation).length();
            assert!(off < 2e-3, "{coupling:?}: body {index} is {off} m off");
        }
        assert!(apart(&scene, |body| pose_in(&world, body)) < 1e-3, "{coupling:?}");
    }
}

#[test]
fn multibodies_that_fall_on_boxes_at_a_border_stay_in_one_piece() {
    let mut scene = flat("heap");
    for row in 0..5 {
        for column in 0..5 {
            let place = [1.1 * f64::from(column) - 2.2, 0.5, 1.1 * f64::from(row) - 2.2];
            scene.push(
                WorldPose::at(place),
                RigidBodyBuilder::dynamic(),
                ColliderBuilder::cuboid(0.5, 0.5, 0.5),
            );
        }
    }
    for index in 0..4 {
        cart(&mut scene, [1.4 * f64::from(index) - 2.1, 2.5, 0.3 * f64::from(index)], 3);
    }
    for coupling in [Coupling::Auto, Coupling::Island, Coupling::Overlap, Coupling::Owner] {
        let mut world = world_of(&scene, &[-1.0, 0.1, 1.0], coupling);
        for tick in 0..300 {
            world.step().unwrap();
            assert_eq!(world.stats().quarantined, 0, "{coupling:?} at tick {tick}");
        }
        let gap = apart(&scene, |body| pose_in(&world, body));
        assert!(gap < 1e-3, "{coupling:?}: {gap} m apart");
        let lowest = world.states().map(|(_, _, pose, _)| pose.translation[1]).fold(f64::INFINITY, f64::min);
        assert!(lowest > 0.05, "{coupling:?}: something sank to {lowest}");
    }
}

/// Rapier's multibodies ignore initial velocities: one cart falls sideways, the other stands.
#[test]
fn carts_of_different_regions_do_not_drive_through_one_another() {
    let mut scene = flat("carts");
    scene.gravity = [3.0, 0.0, 0.0];
    let falls = cart(&mut scene, [-3.0, 0.3, 0.0], 3);
    let stands = cart(&mut scene, [0.6, 0.3, 0.0], 3);
    for body in &mut scene.bodies[stands..] {
        body.body = body.body.clone().gravity_scale(0.0);
    }
    for coupling in [Coupling::Auto, Coupling::Island, Coupling::Overlap, Coupling::Owner] {
        let mut world = world_of(&scene, &[0.0], coupling);
        let mut nearest = f32::INFINITY;
        // Later they fall over, in one world too.
        for tick in 0..100 {
            world.step().unwrap();
            let gap = pose_in(&world, stands).translation.x - pose_in(&world, falls).translation.x;
            assert!(gap > 0.93, "{coupling:?}: {gap:.2} m apart after {tick} ticks");
            nearest = nearest.min(gap);
        }
        assert!(nearest < 1.1, "{coupling:?}: they never met, at {nearest:.2} m");
    }
}

#[test]
fn a_cart_stops_at_a_heap_that_its_region_does_not_own() {
    let mut scene = flat("heap and cart");
    scene.gravity = [3.0, 0.0, 0.0];
    for i in 0..343 {
        let (x, y, z) = (f64::from(i % 7), f64::from(i / 7 % 7), f64::from(i / 49));
        let body = RigidBodyBuilder::dynamic().can_sleep(false).gravity_scale(0.0);
        scene.push(WorldPose::at([x + 0.6, y + 0.5, z - 3.0]), body, ColliderBuilder::cuboid(0.5, 0.5, 0.5));
    }
    let cart = cart(&mut scene, [-2.0, 0.3, 0.0], 3);
    for coupling in [Coupling::Auto, Coupling::Island, Coupling::Overlap] {
        let mut world = world_of(&scene, &[0.05], coupling);
        let at = |world: &LocalWorld, body| pose_in(world, body).translation.x;
        for _ in 0..90 {
            world.step().unwrap();
        }
        // It pushes the boxes that it meets, and does not enter them.
        let (cart, met) = (at(&world, cart), (0..343).map(|body| at(&world, body + 1)));
        let first = met.fold(f32::INFINITY, f32::min);
        assert!(cart < first - 0.9, "{coupling:?}: {cart:.2} m, and the first box at {first:.2} m");
    }
}

/// A kinematic body tied to a multibody is in one region alone, as the multibody is.
#[test]
fn a_platform_with_an_arm_carries_boxes_of_both_regions_and_pushes_those_in_its_way() {
    let mut scene = flat("platform");
    let platform = RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::X);
    let plate = ColliderBuilder::cuboid(4.0, 0.1, 2.0);
    let platform = scene.push(WorldPose::at([-2.0, 1.0, 0.0]), platform, plate);
    let dynamic = || RigidBodyBuilder::dynamic().can_sleep(false);
    let base = scene.push(WorldPose::at([-4.0, 1.2, 0.0]), dynamic(), ColliderBuilder::cuboid(0.2, 0.1, 0.2));
    let arm = scene.push(WorldPose::at([-4.0, 1.8, 0.0]), dynamic(), ColliderBuilder::capsule_y(0.3, 0.1));
    let on_plate = Vector::new(-2.0, 0.1, 0.0);
    let held = FixedJointBuilder::new().local_anchor1(on_plate).local_anchor2(Vector::Y * -0.1);
    let held: GenericJoint = held.contacts_enabled(false).into();
    scene.joints.push(SceneJoint { a: platform, b: base, joint: held, multibody: None });
    let hinge =
        RevoluteJointBuilder::new(Vector::Z).local_anchor1(Vector::Y * 0.1).local_anchor2(Vector::Y * -0.5);
    let hinge: GenericJoint = hinge.contacts_enabled(false).into();
    scene.joints.push(SceneJoint { a: base, b: arm, joint: hinge, multibody: Some(LinkSettings::default()) });
    let starts = [-3.0, -1.0, 0.7, 1.5];
    let cube = || ColliderBuilder::cuboid(0.25, 0.25, 0.25);
    let carried = starts.map(|x| scene.push(WorldPose::at([x, 1.4, 1.0]), dynamic(), cube()));
    let tall = || ColliderBuilder::cuboid(0.25, 0.75, 0.25).friction(0.1);
    let pushed = [2.6, 3.5].map(|x| scene.push(WorldPose::at([x, 0.75, -1.0]), dynamic(), tall()));
    for coupling in [Coupling::Overlap, Coupling::Island, Coupling::Auto] {
        for cuts in [&[][..], &[0.0]] {
            let mut world = world_of(&scene, cuts, coupling);
            (0..150).for_each(|_| world.step().unwrap());
            let front = pose_in(&world, platform).translation.x + 4.0;
            for (body, from) in carried.into_iter().zip(starts) {
                let at = pose_in(&world, body).translation;
                let is_on = (at.y - 1.35).abs() < 0.06 && (f64::from(at.x) - from - 2.4).abs() < 0.2;
                assert!(is_on, "{coupling:?}, {cuts:?}: {at} from {from}");
            }
            for body in pushed {
                let at = pose_in(&world, body).translation;
                assert!(at.x > front, "{coupling:?}, {cuts:?}: {at} is behind {front}");
            }
        }
    }
}

#[test]
fn a_multibody_is_carried_by_planes_that_move_and_by_snapshots() {
    let mut scene = flat("carried");
    for index in 0..12 {
        cart(&mut scene, [2.0 * f64::from(index) - 11.0, 0.25, 0.0], 3);
    }
    let mut world = world_of(&scene, &[-12.0, -11.5], Coupling::Auto);
    world.set_balance(Some(Balance { every_ticks: 5, ..Balance::keeping(3) })).unwrap();
    (0..120).for_each(|_| world.step().unwrap());
    let mut saved = Vec::new();
    world.save(&mut saved).unwrap();
    let mut again = LocalWorld::restore(&saved[..], 1).unwrap();
    for world in [&mut world, &mut again] {
        (0..120).for_each(|_| world.step().unwrap());
    }
    assert_eq!(world.state_hash(), again.state_hash());
    assert!(world.stats().transfers >= 16, "{} transfers", world.stats().transfers);
    assert!(apart(&scene, |body| pose_in(&world, body)) < 1e-3);
}

#[test]
fn what_rapier_cannot_have_in_a_multibody_is_refused_by_name_and_nothing_is_lost() {
    let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
    let mut insert = |body| world.insert(body, ColliderBuilder::ball(0.2)).unwrap();
    let fixed = insert(RigidBodyBuilder::fixed());
    let bodies: Vec<_> =
        (1..5).map(|x| insert(RigidBodyBuilder::dynamic().translation(Vector::X * x as f32))).collect();
    let ball = || SphericalJointBuilder::new().local_anchor1(Vector::X);
    let lift = insert(RigidBodyBuilder::kinematic_velocity_based().translation(Vector::Y * 3.0));
    let mut tie = |a, b| world.insert_multibody_joint(a, b, ball(), LinkSettings::default());
    tie(fixed, bodies[0]).unwrap();
    tie(bodies[0], bodies[1]).unwrap();
    tie(bodies[1], bodies[2]).unwrap();
    let refused = |result: Result<_, dcd::runtime::WorldError>| result.map(drop).unwrap_err().to_string();
    assert!(refused(tie(bodies[3], bodies[2])).contains("link of a multibody already"));
    assert!(refused(tie(bodies[2], fixed)).contains("only a dynamic body"));
    tie(bodies[3], bodies[3]).unwrap_err();
    assert!(refused(tie(lift, bodies[3])).contains("its first body is kinematic"));
    let universal = GenericJointBuilder::new(JointAxesMask::LIN_AXES | JointAxesMask::ANG_X);
    let error =
        refused(world.insert_multibody_joint(bodies[2], bodies[3], universal, LinkSettings::default()));
    assert!(error.contains("two axes"), "{error}");
    let carries = |body: &mut RigidBody| body.set_body_type(RigidBodyType::KinematicVelocityBased, true);
    let error = world.update(fixed, carries).unwrap_err().to_string();
    assert!(error.contains("its first body is kinematic"), "{error}");
    (0..60).for_each(|_| world.step().unwrap());
    assert_eq!(world.stats().bodies, 5);
    assert!(bodies.iter().all(|&id| world.pose(id).unwrap().is_valid()));
}

#[test]
fn motors_springs_and_damping_of_links_act_and_travel() {
    let turned = |settings: LinkSettings, cuts: &[f64]| {
        let mut scene = flat("spring");
        scene.gravity = [1.6, 0.0, 0.0];
        let mut world = world_of(&scene, cuts, Coupling::Auto);
        let base = RigidBodyBuilder::dynamic().translation(Vector::new(-4.0, 2.0, 0.0));
        let base = world
            .insert(base.can_sleep(false), ColliderBuilder::cuboid(0.5, 0.5, 0.5).density(100.0))
            .unwrap();
        let arm = RigidBodyBuilder::dynamic().translation(Vector::new(-4.0, 3.0, 0.0));
        let arm = world.insert(arm.can_sleep(false), ColliderBuilder::capsule_y(0.3, 0.1)).unwrap();
        let hinge = RevoluteJointBuilder::new(Vector::Z).local_anchor1(Vector::Y * 0.6);
        let hinge = hinge.local_anchor2(Vector::Y * -0.4).contacts_enabled(false);
        let joint = world.insert_multibody_joint(base, arm, hinge, LinkSettings::default()).unwrap();
        world.update_link(joint, &settings).unwrap();
        (0..180).for_each(|_| world.step().unwrap());
        let of = |id| Rotation::from_array(world.pose(id).unwrap().rotation);
        (of(base).inverse() * of(arm)).to_scaled_axis().z
    };
    let mut springs = [[0.0; 2]; 6];
    springs[3] = [40.0, 0.5];
    let settings = LinkSettings { springs, damping: Some([6.0; 6]), ..LinkSettings::default() };
    let (one, four) = (turned(settings, &[]), turned(settings, &[-3.0, -1.0, 0.5]));
    assert!((one.abs() - 0.5).abs() < 0.05, "the spring rests at half a radian: {one}");
    assert!((one - four).abs() < 2e-3, "{one} against {four}");
    assert!(turned(LinkSettings::default(), &[]).abs() < 1e-3, "nothing turns it");
}

#[test]
fn a_kinematic_link_sweeps_over_a_border_at_the_speed_that_its_user_gives() {
    let swept = |cuts: &[f64]| {
        let mut world = world_of(&flat("sweeper"), cuts, Coupling::Auto);
        let post = RigidBodyBuilder::fixed().translation(Vector::new(0.0, 0.5, 0.0));
        let post = world.insert(post, ColliderBuilder::ball(0.1)).unwrap();
        let arm = RigidBodyBuilder::dynamic().can_sleep(false);
        let arm = world.insert(arm, ColliderBuilder::cuboid(1.0, 0.1, 0.1)).unwrap();
        let hinge = RevoluteJointBuilder::new(Vector::Y).local_anchor2(Vector::X * -1.2);
        let settings = LinkSettings { kinematic: true, ..LinkSettings::default() };
        let joint = world.insert_multibody_joint(post, arm, hinge.contacts_enabled(false), settings).unwrap();
        assert_eq!(world.link_motion(joint), None, "it has not stepped");
        let ball = RigidBodyBuilder::dynamic().translation(Vector::new(0.3, 0.3, -1.5)).can_sleep(false);
        let ball = world.insert(ball, ColliderBuilder::ball(0.3).friction(0.0)).unwrap();
        world.set_link_velocity(joint, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
        for _ in 0..150 {
            world.step().unwrap();
            let owner = world.owner_of(BodyId::persistent(2));
            assert!(owner.is_some());
        }
        let motion = world.link_motion(joint).unwrap();
        assert!((motion.coordinates[3] - 2.5).abs() < 0.03, "{:?}", motion.coordinates);
        assert!((motion.velocity[0] - 1.0).abs() < 1e-3, "{:?}", motion.velocity);
        world.set_link_velocity(joint, [f32::NAN; 6]).unwrap_err();
        world.pose(ball).unwrap().translation
    };
    let (one, two) = (swept(&[]), swept(&[0.0]));
    assert!(one[0] < -0.5, "the arm takes the ball along: {one:?}");
    let off = (0..3).map(|i| (one[i] - two[i]).powi(2)).sum::<f64>().sqrt();
    assert!(off < 0.1, "{one:?} against {two:?}");
}

#[test]
fn armature_and_friction_of_links_act_and_travel() {
    let swung = |settings: LinkSettings, cuts: &[f64]| {
        let mut scene = flat("swing");
        scene.gravity = [1.6, -9.81, 0.0];
        let mut world = world_of(&scene, cuts, Coupling::Auto);
        let cart = RigidBodyBuilder::dynamic().translation(Vector::new(-4.0, 0.25, 0.0));
        let upright = cart.locked_axes(LockedAxes::ROTATION_LOCKED).can_sleep(false);
        let cart = ColliderBuilder::cuboid(0.5, 0.25, 0.5).density(100.0).friction(0.0);
        let cart = world.insert(upright, cart).unwrap();
        let arm = RigidBodyBuilder::dynamic().translation(Vector::new(-3.6, 1.5, 0.0)).can_sleep(false);
        let arm = world.insert(arm, ColliderBuilder::cuboid(0.4, 0.05, 0.05).mass(1.0)).unwrap();
        let hinge = RevoluteJointBuilder::new(Vector::Z).local_anchor1(Vector::Y * 1.25);
        let hinge = hinge.local_anchor2(Vector::X * -0.4).contacts_enabled(false);
        let joint = world.insert_multibody_joint(cart, arm, hinge, settings).unwrap();
        (0..150).for_each(|_| world.step().unwrap());
        world.link_motion(joint).unwrap().coordinates[3]
    };
    let usual = swung(LinkSettings::default(), &[]);
    let first = |value| [value, 0.0, 0.0, 0.0, 0.0, 0.0];
    let settings = [
        LinkSettings { armature: first(2.0), ..LinkSettings::default() },
        LinkSettings { friction: first(3.0), ..LinkSettings::default() },
    ];
    for settings in settings {
        let (one, four) = (swung(settings, &[]), swung(settings, &[-3.0, -1.0, 0.5]));
        assert!((one - usual).abs() > 0.1, "it matters: {one} against {usual}");
        assert!((one - four).abs() < 0.02, "{one} against {four}, {settings:?}");
    }
}

/// Inserts an arm of this many links that hangs on a fixed post. Returns its bodies and its joints, from the
/// top down.
fn hanging(world: &mut LocalWorld, links: usize) -> (Vec<BodyId>, Vec<JointId>) {
    let post = RigidBodyBuilder::fixed().translation(Vector::Y * 4.0);
    let mut bodies = vec![world.insert(post, ColliderBuilder::ball(0.05)).unwrap()];
    let mut joints = Vec::new();
    for link in 0..links {
        let body = RigidBodyBuilder::dynamic().translation(Vector::Y * (3.75 - 0.5 * link as f32));
        let body = world.insert(body.can_sleep(false), ColliderBuilder::capsule_y(0.15, 0.08)).unwrap();
        let anchor = if link == 0 { Vector::ZERO } else { Vector::Y * -0.25 };
        let hinge = RevoluteJointBuilder::new(Vector::Z).local_anchor1(anchor).contacts_enabled(false);
        let hinge = hinge.local_anchor2(Vector::Y * 0.25);
        joints
            .push(world.insert_multibody_joint(bodies[link], body, hinge, LinkSettings::default()).unwrap());
        bodies.push(body);
    }
    (bodies, joints)
}

/// Returns the distance between the lower end of a link and the upper end of the link below it, metres.
fn gap(world: &LocalWorld, above: BodyId, below: BodyId) -> f64 {
    let end = |id, y: f32| {
        let pose = world.pose(id).unwrap();
        let arm = Rotation::from_array(pose.rotation) * (Vector::Y * y);
        std::array::from_fn::<_, 3, _>(|i| pose.translation[i] + f64::from(arm.to_array()[i]))
    };
    let (a, b) = (end(above, -0.25), end(below, 0.25));
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn what_is_left_of_a_multibody_goes_on_as_one_when_its_root_or_a_link_is_removed() {
    for gone in 0..5 {
        let mut scene = flat("cart");
        let first = cart(&mut scene, [0.0, 0.25, 0.0], 4);
        let mut world = world_of(&scene, &[], Coupling::Auto);
        (0..10).for_each(|_| world.step().unwrap());
        let gone = first + gone;
        world.remove(BodyId::persistent(gone as u32)).unwrap();
        scene.joints.retain(|joint| joint.a != gone && joint.b != gone);
        assert!(scene.joints.len() >= 2, "some of it is left");
        (0..60).for_each(|_| world.step().unwrap());
        let off = apart(&scene, |body| pose_in(&world, body));
        assert!(off < 1e-3, "body {gone} is gone: {off} m apart");
        assert_eq!((world.stats().quarantined, world.stats().bodies), (0, 4));
    }
}

#[test]
fn an_arm_whose_first_joint_and_base_are_removed_at_once_falls_in_one_piece() {
    let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
    let (bodies, joints) = hanging(&mut world, 3);
    (0..10).for_each(|_| world.step().unwrap());
    world.remove_joint(joints[0]).unwrap();
    world.remove(bodies[0]).unwrap();
    (0..30).for_each(|_| world.step().unwrap());
    assert!(world.pose(bodies[1]).unwrap().translation[1] < 3.0, "it falls");
    for pair in bodies[1..].windows(2) {
        let gap = gap(&world, pair[0], pair[1]);
        assert!(gap < 1e-3, "{gap} m apart");
    }
}

#[test]
fn an_arm_goes_where_its_fixed_base_is_put() {
    let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
    let (bodies, joints) = hanging(&mut world, 3);
    (0..10).for_each(|_| world.step().unwrap());
    world.set_pose(bodies[0], WorldPose::at([2.0, 5.0, 0.0])).unwrap();
    (0..10).for_each(|_| world.step().unwrap());
    let top = world.pose(bodies[1]).unwrap().translation;
    assert!((top[0] - 2.0).abs() < 1e-3 && (top[1] - 4.75).abs() < 1e-3, "{top:?}");
    for pair in bodies[1..].windows(2) {
        let gap = gap(&world, pair[0], pair[1]);
        assert!(gap < 1e-3, "{gap} m apart");
    }
    assert!(joints.iter().all(|&joint| world.link_motion(joint).is_some()));
}

#[test]
fn links_and_roots_that_are_disabled_let_go_and_are_links_again_when_they_are_enabled() {
    for disabled in 0..4 {
        let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
        let floor = RigidBodyBuilder::fixed().translation(Vector::Y * 1.0);
        world.insert(floor, ColliderBuilder::cuboid(10.0, 0.5, 10.0)).unwrap();
        let (bodies, joints) = hanging(&mut world, 3);
        let bend = |joint: &mut GenericJoint| {
            joint.set_motor_position(JointAxis::AngX, 0.3, 40.0, 6.0);
        };
        joints.iter().for_each(|&joint| world.update_joint(joint, bend).unwrap());
        (0..30).for_each(|_| world.step().unwrap());
        let before = world.pose(bodies[disabled]).unwrap();
        world.update(bodies[disabled], |body| body.set_enabled(false)).unwrap();
        (0..60).for_each(|_| world.step().unwrap());
        assert_eq!(world.pose(bodies[disabled]).unwrap(), before, "body {disabled} waits");
        let lowest = world.pose(bodies[3]).unwrap().translation[1];
        assert_eq!(lowest < 2.0, disabled < 3, "what it let go of falls: {lowest}");
        world.update(bodies[disabled], |body| body.set_enabled(true)).unwrap();
        (0..60).for_each(|_| world.step().unwrap());
        for pair in bodies[1..].windows(2) {
            let gap = gap(&world, pair[0], pair[1]);
            assert!(gap < 1e-3, "body {disabled}: {gap} m apart");
        }
        assert!(joints.iter().all(|&joint| world.link_motion(joint).is_some()));
        assert_eq!((world.stats().quarantined, world.stats().bodies), (0, 3));
    }
}
