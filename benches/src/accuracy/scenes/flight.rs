//! Defines the experiments of bodies in flight: shot through several regions per step, tumbling where eight
//! regions meet, or shot against a thin wall.

use dcd::protocol::WorldPose;
use dcd::rapier3d::prelude::*;
use dcd::scene::Scene;
use dcd::space::{Axis, Bounds};
use nalgebra::Vector3;

use super::super::reading::worst;
use super::super::scene::{Case, Experiment, Size, corner, planes};
use super::super::trace::{Look, distance, norm};

/// A ball shot through planes that lie so close that it crosses three or more regions in one step.
pub(super) const PROJECTILE: Experiment = Experiment {
    number: 1,
    name: "projectile",
    metric: "max over all steps |x − (v t, −½ g h² n (n + 1))|, n solver iterations of h seconds, m",
    cases: projectile,
    more_regions: &[],
    finer: false,
};

/// A box of 1 x 2 x 3 m tumbling about its middle axis on the corner of eight regions.
pub(super) const DZHANIBEKOV: Experiment = Experiment {
    number: 7,
    name: "dzhanibekov",
    metric: "size: max ||L| / |L₀| − 1|; direction: max 1 − cos(L, L₀)",
    cases: dzhanibekov,
    more_regions: &[],
    finer: true,
};

/// A ball shot at a wall of 2 cm right behind the border.
pub(super) const BULLET: Experiment = Experiment {
    number: 17,
    name: "bullet",
    metric: "how far the ball's centre comes beyond the middle of the wall, m",
    cases: bullet,
    more_regions: &[],
    finer: false,
};

fn projectile(_: Size) -> Vec<Case> {
    // Rapier limits speeds to 400 m/s, falling included.
    [50.0, 150.0, 300.0, 399.0].map(shot).into()
}

fn shot(speed_m_s: f64) -> Case {
    const SECONDS: f64 = 0.5;
    const GRAVITY_M_S2: f64 = 9.81;
    let mut scene = Scene::empty("projectile");
    let body = RigidBodyBuilder::dynamic().linvel(Vector::new(speed_m_s as f32, 0.0, 0.0)).can_sleep(false);
    scene.push(WorldPose::default(), body, ColliderBuilder::ball(0.1));
    scene.bounds = Bounds::new([0.0, -2.0, -1.0], [speed_m_s * SECONDS, 1.0, 1.0]);
    let step_m = speed_m_s / 60.0;
    let borders: Vec<_> =
        (0..7).map(|i| (0.25 + 1.0 / 240.0) * speed_m_s + f64::from(i) * step_m / 3.5).collect();
    let case =
        Case::new(format!("{speed_m_s} m/s"), scene, SECONDS, planes(Axis::X, borders), move |trace, _| {
            worst(trace.looks.iter().map(|look| {
                let n = (look.t_s / trace.substep_s).round();
                let fallen_m = 0.5 * GRAVITY_M_S2 * trace.substep_s.powi(2) * n * (n + 1.0);
                distance(look.place(0), [speed_m_s * look.t_s, -fallen_m, 0.0])
            }))
        });
    case.every_step()
}

/// The edges of the tumbling box, metres.
const EDGES_M: [f32; 3] = [1.0, 2.0, 3.0];

fn dzhanibekov(size: Size) -> Vec<Case> {
    let seconds = size.pick(10.0, 60.0);
    let corner = || corner(Axis::ALL, [0.0; 3]);
    let scene = || {
        let mut scene = Scene::empty("dzhanibekov");
        scene.gravity = [0.0; 3];
        let body = RigidBodyBuilder::dynamic().angvel(Vector::new(0.02, 3.0, 0.01)).can_sleep(false);
        let [x, y, z] = EDGES_M.map(|edge| 0.5 * edge);
        scene.push(WorldPose::default(), body, ColliderBuilder::cuboid(x, y, z));
        scene.bounds = Bounds::around([0.0; 3], [4.0; 3]);
        scene
    };
    let size_of = Case::new("size", scene(), seconds, corner(), |trace, _| {
        let start = norm(spin_momentum(trace.first()));
        worst(trace.looks.iter().map(|look| (norm(spin_momentum(look)) / start - 1.0).abs()))
    });
    let direction = Case::new("direction", scene(), seconds, corner(), |trace, _| {
        let start = spin_momentum(trace.first());
        worst(trace.looks.iter().map(|look| 1.0 - cosine(spin_momentum(look), start)))
    });
    vec![size_of.in_unit("", 1e-4).within(0.02).free(), direction.in_unit("", 1e-4).within(1e-3).free()]
}

/// Returns the angular momentum of the box about its centre, in kg m²/s for a density of 1.
fn spin_momentum(look: &Look) -> [f64; 3] {
    let Some((pose, velocity)) = look.bodies[0] else { return [f64::NAN; 3] };
    let [x, y, z] = EDGES_M.map(f64::from);
    let mass = x * y * z;
    let inertia = [y * y + z * z, x * x + z * z, x * x + y * y].map(|sum| mass * sum / 12.0);
    let rotation = pose.isometry().rotation;
    let world: Vector3<f64> = velocity.angular.map(f64::from).into();
    let own = rotation.inverse() * world;
    let momentum = rotation * Vector3::from([0, 1, 2].map(|i| inertia[i] * own[i]));
    momentum.into()
}

fn cosine(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| a[i] * b[i]).sum::<f64>() / (norm(a) * norm(b))
}

fn bullet(_: Size) -> Vec<Case> {
    let speeds = [50.0, 100.0, 200.0, 399.0];
    speeds.into_iter().flat_map(|speed| [true, false].map(|fixed| shot_at_a_wall(speed, fixed))).collect()
}

/// Shoots a ball at a wall that is fixed, or owned by the region behind the border.
fn shot_at_a_wall(speed_m_s: f32, fixed: bool) -> Case {
    const WALL_M: f64 = 0.03;
    let mut scene = Scene::empty("bullet");
    scene.gravity = [0.0; 3];
    let body = if fixed { RigidBodyBuilder::fixed() } else { RigidBodyBuilder::dynamic().can_sleep(false) };
    scene.push(WorldPose::at([WALL_M, 0.0, 0.0]), body, ColliderBuilder::cuboid(0.01, 2.0, 2.0).mass(1000.0));
    // A third of a step away from where steps would end at the wall.
    let start_m = -f64::from(speed_m_s) * (10.0 + 1.0 / 3.0) / 60.0;
    let body = RigidBodyBuilder::dynamic()
        .linvel(Vector::new(speed_m_s, 0.0, 0.0))
        .ccd_enabled(true)
        .can_sleep(false);
    let ball = ColliderBuilder::ball(0.1).mass(1.0);
    scene.push(WorldPose::at([start_m, 0.0, 0.0]), body, ball);
    scene.bounds = Bounds::new([start_m, -4.0, -4.0], [8.0, 4.0, 4.0]);
    let borders = planes(Axis::X, [0.0, -0.15, 0.15, -1.0, -0.5, 0.5, 1.0]);
    let label = format!("{speed_m_s} m/s {} wall", if fixed { "fixed" } else { "loose" });
    let beyond = Case::new(label, scene, 0.5, borders, move |trace, _| {
        let wall_m = |look: &Look| if fixed { WALL_M } else { look.place(0)[0] };
        worst(trace.looks.iter().map(|look| (look.place(1)[0] - wall_m(look)).max(0.0)))
    });
    if fixed { beyond.every_step() } else { beyond.every_step().free() }
}

#[cfg(test)]
mod tests {
    use dcd::protocol::Velocity;

    use super::*;

    fn spinning(angular: [f32; 3], turn: Rotation) -> Look {
        let pose = WorldPose { rotation: turn.to_array(), ..WorldPose::default() };
        Look { bodies: vec![Some((pose, Velocity { linear: [0.0; 3], angular }))], ..Look::default() }
    }

    #[test]
    fn angular_momentum_is_that_of_the_box_in_the_world() {
        // About its long axis: 6/12 (1² + 2²); turned, that axis lies along x.
        let along_z = spin_momentum(&spinning([0.0, 0.0, 2.0], Rotation::IDENTITY));
        assert!(distance(along_z, [0.0, 0.0, 5.0]) < 1e-6, "{along_z:?}");
        let turn = Rotation::from_rotation_y(std::f32::consts::FRAC_PI_2);
        let along_x = spin_momentum(&spinning([2.0, 0.0, 0.0], turn));
        assert!(distance(along_x, [5.0, 0.0, 0.0]) < 1e-5, "{along_x:?}");
        assert!((cosine(along_z, [0.0, 0.0, 3.0]) - 1.0).abs() < 1e-12);
    }
}
