//! Builds cars with trailers in a row, on a plane without end.

use rapier3d::prelude::*;

use super::{SceneInfo, count, number};
use crate::protocol::WorldPose;
use crate::scene::params::Values;
use crate::scene::{Scene, SceneError, SceneJoint};
use crate::space::Bounds;

pub(super) const CONVOY: SceneInfo = SceneInfo {
    name: "convoy",
    summary: "cars with trailers (8 bodies and 7 joints each) driving along x; cut it across x, however long the road",
    params: &[
        count("cars", "8", 1, 10_000, "cars, one behind the other"),
        number("speed", "30", [0.0, 150.0], "m/s", "what their motors keep"),
        number("start", "0", [-1e6, 1e6], "m", "where along x the first car starts"),
        number(
            "road",
            "1000",
            [100.0, 1e6],
            "m",
            "where along x the world ends; it begins at 0 or behind the last car",
        ),
    ],
    build: convoy,
};

/// Distance from car to car.
const GAP_M: f64 = 12.0;
const RADIUS_M: f32 = 0.4;

fn convoy(values: &Values) -> Result<Scene, SceneError> {
    let mut scene = Scene::empty("convoy");
    let up = SharedShape::halfspace(Vector::Y);
    scene.push(WorldPose::default(), RigidBodyBuilder::fixed(), ColliderBuilder::new(up).friction(1.0));
    let (speed_m_s, start_m) = (values.number("speed"), f64::from(values.number("start")));
    for car in 0..values.count("cars") {
        let x = start_m - car as f64 * GAP_M;
        self::car(&mut scene, [x, 0.0], speed_m_s);
    }
    let road_m = f64::from(values.number("road"));
    // The last cars start before the road does.
    let tail_m = start_m - values.count("cars") as f64 * GAP_M;
    scene.bounds = Bounds::new([tail_m.min(0.0), 0.0, -20.0], [road_m, 8.0, 20.0]);
    Ok(scene)
}

/// Adds a car with its trailer at a place on the ground, driving along x.
pub(super) fn car(scene: &mut Scene, [x, z]: [f64; 2], speed_m_s: f32) {
    let car = chassis(scene, [x, z], 1.2, 400.0, speed_m_s);
    let trailer = chassis(scene, [x - 4.0, z], 0.8, 100.0, speed_m_s);
    for (x, drive) in [(0.9, true), (-0.9, true)] {
        axle(scene, car, x, speed_m_s, drive);
    }
    axle(scene, trailer, -0.2, speed_m_s, false);
    let hitch = SphericalJointBuilder::new()
        .local_anchor1(Vector::new(-2.0, -0.1, 0.0))
        .local_anchor2(Vector::new(2.0, -0.1, 0.0));
    scene.joints.push(SceneJoint { a: car, b: trailer, joint: hitch.into(), multibody: None });
}

fn chassis(scene: &mut Scene, [x, z]: [f64; 2], half_m: f32, mass_kg: f32, speed_m_s: f32) -> usize {
    // The body is kept in its lane: by itself a car of Rapier's strays a metre to the side in every five.
    let lane =
        LockedAxes::TRANSLATION_LOCKED_Z | LockedAxes::ROTATION_LOCKED_X | LockedAxes::ROTATION_LOCKED_Y;
    let body = RigidBodyBuilder::dynamic().linvel(Vector::X * speed_m_s).locked_axes(lane).can_sleep(false);
    let collider = ColliderBuilder::cuboid(half_m, 0.3, 0.5).mass(mass_kg);
    scene.push(WorldPose::at([x, 0.6, z]), body, collider)
}

/// Adds two wheels that roll at the speed of the chassis.
fn axle(scene: &mut Scene, chassis: usize, x: f32, speed_m_s: f32, drive: bool) {
    for z in [-0.95, 0.95] {
        let anchor = Vector::new(x, RADIUS_M - 0.6, z);
        let [from_x, from_y, from_z] = scene.bodies[chassis].pose.translation;
        let place = [from_x + f64::from(x), from_y + f64::from(anchor.y), from_z + f64::from(z)];
        let spin = -speed_m_s / RADIUS_M;
        // Rapier would brake bodies that turn as fast as this.
        let body = RigidBodyBuilder::dynamic()
            .linvel(Vector::X * speed_m_s)
            .angvel(Vector::Z * spin)
            .allow_fast_rotation(true)
            .can_sleep(false);
        let collider = ColliderBuilder::ball(RADIUS_M).mass(20.0).friction(1.0);
        let wheel = scene.push(WorldPose::at(place), body, collider);
        let mut joint = RevoluteJointBuilder::new(Vector::Z).local_anchor1(anchor).contacts_enabled(false);
        if drive {
            joint = joint.motor_velocity(spin, 20.0).motor_model(MotorModel::ForceBased);
        }
        scene.joints.push(SceneJoint { a: chassis, b: wheel, joint: joint.into(), multibody: None });
    }
}
