//! Defines the experiments of joints across the border: a chain and nets.

use dcd::protocol::WorldPose;
use dcd::rapier3d::prelude::*;
use dcd::scene::{Params, Scene, SceneJoint};
use dcd::space::{Axis, Bounds};

use super::super::reading::worst;
use super::super::scene::{Case, Cut, Experiment, Size, planes};
use super::super::trace::{Look, Trace, distance, norm};

/// A chain of 16 links of 0.5 m and 1 kg with a bob of 1,000 kg, hanging down through the borders.
pub(super) const CHAIN: Experiment = Experiment {
    number: 15,
    name: "chain",
    metric: "hanging: distance of the bob from where inextensible links hold it; swinging: from where R1 has it; m",
    cases: chain,
    more_regions: &[],
    finer: true,
};

/// A net of balls tied to their neighbours, held along one edge and let go from lying flat.
pub(super) const JOINT_GRID: Experiment = Experiment {
    number: 16,
    name: "joint_grid",
    metric: "mean distance between the two anchors of a joint, last second, m; largest speed of a ball at any look, m/s",
    cases: joint_grid,
    more_regions: &[16],
    finer: false,
};

const LINKS: usize = 16;
/// The length of the links and half the bob.
const LENGTH_M: f64 = 8.3;

fn chain(size: Size) -> Vec<Case> {
    let scene = |ratio: u32, offset_m: f64| {
        let params =
            Params::new().with("links", LINKS).with("bob_mass_ratio", ratio).with("offset", offset_m);
        let mut scene = Scene::named("chain", &params).expect("the library has chains");
        scene.bodies.iter_mut().for_each(|body| body.body.can_sleep = false);
        scene
    };
    let stiff = |mut scene: Scene, iterations: usize| {
        scene.solver_iterations = iterations;
        scene
    };
    let extra = |mut scene: Scene, iterations: usize| {
        for body in &mut scene.bodies {
            body.body.additional_solver_iterations = iterations;
        }
        scene
    };
    let seconds = size.pick(3.0, 10.0);
    let hanging =
        |label: &str, scene: Scene| Case::new(label, scene, seconds, across(), |trace, _| stretch(trace));
    let swinging =
        Case::new("swinging 16 iterations", stiff(scene(1000, 2.0), 16), 1.0, across(), |trace, r1| {
            let (own, r1) = (trace.last(), r1.last());
            worst(r1.moving().map(|body| distance(own.place(body), r1.place(body))))
        });
    vec![
        hanging("hanging 4 iterations", scene(1000, 0.0)),
        hanging("hanging 16 iterations", stiff(scene(1000, 0.0), 16)),
        hanging("hanging 12 extra iterations", extra(scene(1000, 0.0), 12)),
        hanging("10:1 hanging 4 iterations", scene(10, 0.0)),
        // Half a hundredth of the chain's length.
        swinging.within(0.04),
    ]
}

fn across() -> impl Fn(usize) -> Vec<Cut> {
    planes(Axis::Y, [-4.0, -2.0, -6.0, -8.0, -1.25, -3.0, -5.25])
}

/// Returns how far the bob is from where it should hang, mean of the last second.
fn stretch(trace: &Trace) -> f64 {
    let (count, sum) = trace.tail(1.0).fold((0, 0.0), |(count, sum), look| {
        (count + 1, sum + distance(look.place(LINKS + 1), [0.0, -LENGTH_M, 0.0]))
    });
    sum / f64::from(count)
}

fn joint_grid(size: Size) -> Vec<Case> {
    let edge = size.pick(16, 100);
    let seconds = 3.0;
    let scene = net(edge);
    let joints = scene.joints.clone();
    let apart = Case::new("joints", net(edge), seconds, squares(edge), move |trace, _| {
        let (count, sum) = trace
            .tail(1.0)
            .fold((0, 0.0), |(count, sum), look| (count + 1, sum + mean_gap_m(&scene, &joints, look)));
        sum / f64::from(count)
    });
    let speed = Case::new("speed", net(edge), seconds, squares(edge), |trace, _| {
        worst(trace.looks.iter().flat_map(|look| look.moving().map(|body| norm(look.velocity(body)))))
    });
    vec![apart, speed.in_unit("m/s", 1e-4).within(100.0)]
}

/// Builds the net of Rapier's `joint_ball` example: balls of 0.4 m a metre apart. Every fourth ball of the
/// first row, and its last, stays where it is.
fn net(edge: usize) -> Scene {
    let mut scene = Scene::empty("joint_grid");
    let ball = ColliderBuilder::ball(0.4);
    for row in 0..edge {
        for column in 0..edge {
            let held = row == 0 && (column % 4 == 0 || column + 1 == edge);
            let body = if held { RigidBodyBuilder::fixed() } else { RigidBodyBuilder::dynamic() };
            let place = WorldPose::at([column as f64, 0.0, row as f64]);
            let index = scene.push(place, body.can_sleep(false), ball.clone());
            let tie = |a: usize, anchor: Vector| {
                let joint = SphericalJointBuilder::new().local_anchor2(anchor);
                SceneJoint { a, b: index, joint: joint.into(), multibody: None }
            };
            let mut ties = Vec::new();
            if row > 0 {
                ties.push(tie(index - edge, -Vector::Z));
            }
            if column > 0 {
                ties.push(tie(index - 1, -Vector::X));
            }
            scene.joints.extend(ties);
        }
    }
    let end = edge as f64;
    scene.bounds = Bounds::new([-1.0, -end, -1.0], [end, 1.0, end]);
    scene
}

/// Returns borders that make up to 16 squares and run through columns and rows of balls.
fn squares(edge: usize) -> impl Fn(usize) -> Vec<Cut> {
    let at = move |quarter: usize| (quarter * edge / 4) as f64;
    let (x, z) = (move |quarter| (Axis::X, at(quarter)), move |quarter| (Axis::Z, at(quarter)));
    move |regions| match regions {
        2 => vec![x(2)],
        4 => vec![x(2), z(2)],
        8 => vec![x(2), z(2), x(1), x(3)],
        _ => vec![x(2), z(2), x(1), x(3), z(1), z(3)],
    }
}

/// Returns the mean gap of all joints: how far apart the two bodies of a joint hold the point that should be
/// one.
pub(crate) fn mean_gap_m(scene: &Scene, joints: &[SceneJoint], look: &Look) -> f64 {
    let anchor = |body: usize, local: Vector| {
        let pose = look.bodies[body].map_or(scene.bodies[body].pose, |(pose, _)| pose);
        let [x, y, z] = local.to_array().map(f64::from);
        let point = pose.isometry() * nalgebra::Point3::new(x, y, z);
        [point.x, point.y, point.z]
    };
    let gaps = joints.iter().map(|joint| {
        let (a, b) = (joint.joint.local_frame1.translation, joint.joint.local_frame2.translation);
        distance(anchor(joint.a, a), anchor(joint.b, b))
    });
    gaps.sum::<f64>() / joints.len() as f64
}

#[cfg(test)]
mod tests {
    use dcd::protocol::Velocity;

    use super::*;

    #[test]
    fn the_gap_of_a_joint_is_between_its_two_anchors() {
        let scene = net(4);
        let mut look = Look { bodies: vec![None; 16], ..Look::default() };
        assert!(mean_gap_m(&scene, &scene.joints, &look) < 1e-6);
        // A ball in the middle hangs on four of the 24 joints.
        let moved = WorldPose::at([1.0, -0.3, 1.0]);
        look.bodies[5] = Some((moved, Velocity::default()));
        assert!((mean_gap_m(&scene, &scene.joints, &look) - 4.0 * 0.3 / 24.0).abs() < 1e-6);
    }
}
