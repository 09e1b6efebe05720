//! Tests how models are placed: copies, ground, and which bodies pass through each other.

use std::fs;

use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::scene::{Params, Scene};
use dcd::space::{Axis, BodyId, Bounds};
use rapier3d::prelude::*;

use crate::compare::{regions, scene};
use crate::list::shipped;

fn of_text(text: &str, params: &str) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.xml");
    fs::write(&path, text).unwrap();
    scene(&path, params)
}

#[test]
fn a_hundred_copies_stand_apart_on_one_floor() {
    let one = scene(&shipped().join("gymnasium/ant.xml"), "");
    let many = scene(&shipped().join("gymnasium/ant.xml"), "copies=100");
    let moving = one.bodies.len() - 1;
    assert_eq!(many.bodies.len(), 1 + 100 * moving);
    assert_eq!(many.joints.len(), 100 * one.joints.len());
    let floors = many.bodies.iter().flat_map(|body| &body.colliders);
    assert_eq!(floors.filter(|collider| collider.shape.as_halfspace().is_some()).count(), 1);
    let copies: Vec<Bounds> = many.bodies[1..]
        .chunks(moving)
        .map(|copy| copy.iter().map(|body| body.bounds()).reduce(|a, b| a.union(&b)).unwrap())
        .collect();
    assert!(many.bounds.max[0] - many.bounds.min[0] < 40.0, "{:?}", many.bounds);
    for (index, a) in copies.iter().enumerate() {
        for b in &copies[index + 1..] {
            let meet = (0..3).all(|i| a.min[i] < b.max[i] && b.min[i] < a.max[i]);
            assert!(!meet, "{a:?} and {b:?}");
        }
        assert!((0..3).all(|i| many.bounds.min[i] <= a.min[i] && a.max[i] <= many.bounds.max[i]));
    }
}

#[test]
fn copies_in_eight_regions_lose_nobody_and_bear_their_weight() {
    let scene = scene(&shipped().join("bullet/quadruped.urdf"), "copies=16 ground=1 sleep=0");
    let run = regions(&scene, 8, false, 4.0);
    assert!((run.mass_kg - 16.0 * 6.0).abs() < 1e-2, "{run:?}");
    assert!((run.ground.unwrap() - 1.0).abs() < 0.05, "{run:?}");
    assert!(run.quarantined.is_empty());
}

#[test]
fn copies_tied_to_the_world_are_tied_to_a_world_of_their_own() {
    let text = r#"<mujoco><worldbody><geom type="plane" size="1 1 1"/>
        <body pos="0 0 1"><joint type="slide" axis="1 0 0"/><geom size=".1"/></body></worldbody></mujoco>"#;
    let scene = of_text(text, "copies=4 spacing=3");
    assert_eq!(scene.bodies.len(), 8);
    let ends: Vec<_> = scene.joints.iter().map(|joint| (joint.a, joint.b)).collect();
    assert_eq!(ends, [(0, 1), (2, 3), (4, 5), (6, 7)]);
    assert_eq!(scene.bodies[6].pose.translation, [3.0, 3.0, 0.0]);
    assert!(scene.bodies[2].colliders.is_empty() && scene.bodies[0].colliders.len() == 1);
}

#[test]
fn the_ground_lies_under_what_would_be_in_it_and_a_lifted_model_leaves_its_floor() {
    let robot = scene(&shipped().join("bullet/quadruped.urdf"), "ground=1");
    let ground = robot.bodies.last().unwrap();
    let lowest = robot
        .bodies
        .iter()
        .map(|body| body.bounds().min[2])
        .filter(|z| z.is_finite())
        .fold(f64::MAX, f64::min);
    assert_eq!(ground.pose.translation[2], lowest.min(0.0));
    let lifted = scene(&shipped().join("gymnasium/ant.xml"), "height=2");
    let down = scene(&shipped().join("gymnasium/ant.xml"), "");
    let floor = |scene: &Scene| {
        scene.bodies[0].pose.translation[2] as f32 + scene.bodies[0].colliders[0].position.translation.z
    };
    assert_eq!((floor(&lifted), floor(&down)), (0.0, 0.0));
    assert_eq!(lifted.bodies[1].pose.translation[2], down.bodies[1].pose.translation[2] + 2.0);
}

#[test]
fn excluded_bodies_pass_through_each_other_in_every_region_and_others_do_not() {
    let text = |contact: &str| {
        format!(
            r#"<mujoco>{contact}<worldbody><body name="a" pos="0 0 2"><freejoint/><geom type="box" size=".2 .2 .2"/></body>
            <body name="b"><geom type="box" size="2 2 .2"/></body></worldbody></mujoco>"#
        )
    };
    let falls = |contact: &str, partitioning: Partitioning| {
        let scene = of_text(&text(contact), "");
        let config = WorldConfig { partitioning, ..WorldConfig::for_scene(&scene) };
        let mut world = LocalWorld::from_scene(&scene, config).unwrap();
        for _ in 0..500 {
            world.step().unwrap();
        }
        world.pose(BodyId::persistent(0)).unwrap().translation[2] < 0.0
    };
    let exclude = r#"<contact><exclude body1="a" body2="b"/></contact>"#;
    let halves = || Partitioning::Cuts(vec![(Axis::X, 0.05), (Axis::Z, 1.0)]);
    assert!(falls(exclude, Partitioning::Regions(1)) && falls(exclude, halves()));
    assert!(!falls("", Partitioning::Regions(1)) && !falls("", halves()));
}

#[test]
fn a_parameter_that_is_none_is_answered_with_those_there_are() {
    let params = Params::new().with("copys", 2);
    let error = Scene::load(shipped().join("gymnasium/ant.xml"), &params).unwrap_err().to_string();
    assert!(error.contains("did you mean `copies`") && error.contains("spacing=0 m"), "{error}");
}

#[test]
fn what_is_wrong_in_a_file_is_told_with_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.urdf");
    fs::write(&path, "<robot>\n<link name=\"a\"/>\n<joint name=\"j\" type=\"screw\"/>\n</robot>").unwrap();
    let error = Scene::load(&path, &Params::new()).unwrap_err().to_string();
    assert!(error.contains("model.urdf:3: joint `j` is of type `screw`; use revolute"), "{error}");
}

#[test]
fn a_model_starts_as_it_is_asked_to() {
    let path = shipped().join("bullet/quadruped.urdf");
    let still = scene(&path, "fixed=1 sleep=0 dt=0.002 iterations=12");
    assert_eq!(still.bodies[0].body.body_type, RigidBodyType::Fixed);
    assert!(still.bodies.iter().all(|body| !body.body.can_sleep));
    assert_eq!((still.dt_s, still.solver_iterations), (0.002, 12));
    assert_eq!(still.gravity, [0.0, 0.0, -9.81]);
}

#[test]
fn a_hinge_stops_at_a_limit_beyond_half_a_turn_and_stays_where_it_starts() {
    let text = r#"<mujoco><option timestep=".01" gravity="0 0 0"/>
        <worldbody><body><joint name="j" range="-1 215"/><geom pos=".5 0 0" size=".1"/></body></worldbody>
        <actuator><velocity joint="j" kv="5"/></actuator>
        <keyframe><key qpos="0" ctrl="1"/><key qpos="3.5"/></keyframe></mujoco>"#;
    for (params, seconds, angle) in [
        ("key=1", 3.0, 2.8),
        ("key=1", 8.0, 215f32.to_radians()),
        ("key=1 multibody=1", 8.0, 215f32.to_radians()),
        ("key=2", 2.0, 3.5),
        ("key=2 multibody=1", 2.0, 3.5),
    ] {
        let scene = of_text(text, &format!("sleep=0 {params}"));
        let mut world = LocalWorld::from_scene(&scene, WorldConfig::for_scene(&scene)).unwrap();
        for _ in 0..(seconds / scene.dt_s) as usize {
            world.step().unwrap();
        }
        let arm = Rotation::from_array(world.pose(BodyId::persistent(1)).unwrap().rotation) * Vector::X;
        let off = arm.angle_between(Vector::new(angle.cos(), angle.sin(), 0.0));
        assert!(off < 0.05, "{params}: {arm:?} after {seconds} s is {off} rad off");
    }
}
