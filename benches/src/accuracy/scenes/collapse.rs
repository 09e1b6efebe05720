//! Defines the experiments of structures that fall sooner or later, or are meant to fall: card house, arch,
//! planks, dominoes.

use dcd::protocol::WorldPose;
use dcd::rapier3d::prelude::*;
use dcd::scene::Scene;
use dcd::space::{Axis, Bounds};

use super::super::reading::worst;
use super::super::scene::{Case, Cut, Experiment, Size, corner, planes};
use super::super::trace::{Look, Trace, distance};

/// A house of cards, an arch of wedges, a tower of crossed planks.
pub(super) const CARD_HOUSE: Experiment = Experiment {
    number: 14,
    name: "card_house",
    metric: "how much sooner than R1 it collapses (a body 0.2 m from its place), as a share of R1's time",
    cases: buildings,
    more_regions: &[],
    finer: false,
};

/// Rows of dominoes that sleep until they are struck.
pub(super) const DOMINO: Experiment = Experiment {
    number: 22,
    name: "domino",
    metric: "share that stands at the end; time until half have fallen against R1's without sleep, s",
    cases: dominoes,
    more_regions: &[],
    finer: false,
};

fn buildings(size: Size) -> Vec<Case> {
    let seconds = size.pick(5.0, 20.0);
    let case = |label: &str, scene: Scene, axes: [Axis; 3], point: [f64; 3]| {
        let case = Case::new(label, scene, seconds, corner(axes, point), |trace, r1| {
            (1.0 - collapse_s(trace) / collapse_s(r1)).max(0.0)
        });
        case.in_unit("", 1e-4).within(0.1).every_step()
    };
    let (xyz, yxz) = ([Axis::X, Axis::Y, Axis::Z], [Axis::Y, Axis::X, Axis::Z]);
    vec![
        case("card house", card_house(), xyz, [0.0, 1.0, 0.0]),
        case("arch", arch(), xyz, [0.0, 1.5, 0.0]),
        case("planks", planks(), yxz, [0.0, 0.8, 0.0]),
    ]
}

/// Returns the time when the first body is 0.2 m from its place; the end of the run if none is.
fn collapse_s(trace: &Trace) -> f64 {
    const FAR_M: f64 = 0.2;
    let first = trace.first();
    let fell = |look: &&Look| {
        worst(first.moving().map(|body| distance(look.place(body), first.place(body)))) > FAR_M
    };
    trace.looks.iter().find(fell).unwrap_or(trace.last()).t_s
}

/// Returns a scene with a floor whose top is y = 0.
fn floor(name: &str, half_m: f32, bounds: Bounds) -> Scene {
    let mut scene = Scene::empty(name);
    scene.push_fixed_box([0.0, -1.0, 0.0], [half_m, 1.0, half_m], &ColliderBuilder::ball(1.0).friction(0.8));
    scene.bounds = bounds;
    scene
}

fn push(scene: &mut Scene, place: [f64; 3], turn: Rotation, collider: ColliderBuilder) {
    let pose = WorldPose { translation: place, rotation: turn.to_array() };
    scene.push(pose, RigidBodyBuilder::dynamic().can_sleep(false), collider.friction(0.8));
}

/// Builds three storeys of leaning pairs, with cards laid between them.
fn card_house() -> Scene {
    const STOREYS: usize = 3;
    /// The distance from one pair to the next; the feet of a pair stand 0.66 m apart.
    const PITCH_M: f64 = 0.7;
    const LENGTH_M: f64 = 1.0;
    const THICK_M: f64 = 0.02;
    const WIDE_M: f32 = 0.6;
    let lean = 18f64.to_radians();
    let (sin, cos) = lean.sin_cos();
    let storey_m = LENGTH_M * cos + THICK_M * sin;
    let card = ColliderBuilder::cuboid(0.5 * THICK_M as f32, 0.5 * LENGTH_M as f32, 0.5 * WIDE_M);
    let laid = ColliderBuilder::cuboid(0.5 * PITCH_M as f32 - 0.002, 0.5 * THICK_M as f32, 0.5 * WIDE_M);
    let mut scene = floor("card_house", 10.0, Bounds::new([-2.0, 0.0, -1.0], [2.0, 4.0, 1.0]));
    for storey in 0..STOREYS {
        let pairs = STOREYS - storey;
        let base_m = storey as f64 * (storey_m + THICK_M);
        for pair in 0..pairs {
            let apex = (pair as f64 - 0.5 * (pairs - 1) as f64) * PITCH_M;
            // The inner upper edges of a pair meet.
            let off = 0.5 * (LENGTH_M * sin + THICK_M * cos);
            for side in [-1.0, 1.0] {
                let turn = Rotation::from_rotation_z((side * lean) as f32);
                push(&mut scene, [apex + side * off, base_m + 0.5 * storey_m, 0.0], turn, card.clone());
            }
            if pair + 1 < pairs {
                let place = [apex + 0.5 * PITCH_M, base_m + storey_m + 0.5 * THICK_M, 0.0];
                push(&mut scene, place, Rotation::IDENTITY, laid.clone());
            }
        }
    }
    scene
}

/// Builds a half circle of 13 wedges.
fn arch() -> Scene {
    const WEDGES: usize = 13;
    const INNER_M: f64 = 2.0;
    const OUTER_M: f64 = 2.6;
    const HALF_DEEP_M: f32 = 0.3;
    /// Half of the gap between wedges: of hulls that touch exactly, Parry may take any face for the deepest.
    const GAP_M: f64 = 5e-4;
    let mut scene = floor("arch", 20.0, Bounds::new([-4.0, 0.0, -1.0], [4.0, 4.0, 1.0]));
    let half_angle = 0.5 * std::f64::consts::PI / WEDGES as f64;
    let middle_m = 0.5 * (INNER_M + OUTER_M);
    // In the frame of the keystone: radii lie along y.
    let corners: Vec<_> = [INNER_M, OUTER_M]
        .into_iter()
        .flat_map(|radius| {
            [-half_angle, half_angle].map(|angle| (radius, angle - angle.signum() * GAP_M / radius))
        })
        .flat_map(|(radius, angle)| {
            let (x, y) = ((radius * angle.sin()) as f32, (radius * angle.cos() - middle_m) as f32);
            [-HALF_DEEP_M, HALF_DEEP_M].map(|z| Vector::new(x, y, z))
        })
        .collect();
    let wedge = ColliderBuilder::convex_hull(&corners).expect("eight corners have a hull");
    for i in 0..WEDGES {
        // From the left springer, clockwise.
        let angle = std::f64::consts::FRAC_PI_2 - (2 * i + 1) as f64 * half_angle;
        let (sin, cos) = angle.sin_cos();
        let turn = Rotation::from_rotation_z(angle as f32);
        push(&mut scene, [-middle_m * sin, middle_m * cos, 0.0], turn, wedge.clone());
    }
    scene
}

/// Builds twenty layers of two planks each; every other layer lies crosswise.
fn planks() -> Scene {
    const LAYERS: usize = 20;
    let half_m = [0.6, 0.04, 0.12];
    let mut scene = floor("planks", 10.0, Bounds::new([-2.0, 0.0, -2.0], [2.0, 3.0, 2.0]));
    let plank = ColliderBuilder::cuboid(half_m[0] as f32, half_m[1] as f32, half_m[2] as f32);
    for layer in 0..LAYERS {
        let y = (2 * layer + 1) as f64 * half_m[1];
        for side in [-0.45, 0.45] {
            let (place, angle) = match layer % 2 {
                0 => ([0.0, y, side], 0.0),
                _ => ([side, y, 0.0], std::f32::consts::FRAC_PI_2),
            };
            push(&mut scene, place, Rotation::from_rotation_y(angle), plank.clone());
        }
    }
    scene
}

fn dominoes(size: Size) -> Vec<Case> {
    let (rows, row) = size.pick((4, 32), (40, 100));
    // Measured: the wave runs at some 3 m/s.
    let seconds = 3.0 + row as f64 * DOMINO_PITCH_M / 2.0;
    let standing =
        Case::new("all fall", field_of_dominoes(rows, row, true), seconds, at_dominoes(row), |trace, _| {
            let last = trace.last();
            last.moving().filter(|&body| !has_fallen(last, body)).count() as f64
                / last.moving().count() as f64
        });
    let asleep =
        Case::new("sleep", field_of_dominoes(rows, row, true), seconds, at_dominoes(row), |trace, r1| {
            (half_fallen_s(trace) - half_fallen_s(r1)).abs()
        });
    let looked_at_s = 0.05;
    let asleep = Case {
        reference_scenes: Some(vec![field_of_dominoes(rows, row, false)]),
        look_s: looked_at_s,
        ..asleep.in_unit("s", looked_at_s)
    };
    vec![standing.in_unit("", 1e-4), asleep]
}

const DOMINO_PITCH_M: f64 = 0.6;

/// Builds rows of dominoes along x; the first domino of each row is tipping over.
fn field_of_dominoes(rows: usize, row: usize, sleep: bool) -> Scene {
    const HALF_M: [f32; 3] = [0.08, 0.6, 0.3];
    const ROW_PITCH_M: f64 = 1.5;
    let half = [0.5 * row as f64 * DOMINO_PITCH_M, 0.5 * rows as f64 * ROW_PITCH_M];
    let bounds = Bounds::new([-half[0] - 2.0, 0.0, -half[1]], [half[0] + 2.0, 2.0, half[1]]);
    let mut scene = floor("domino", half[0].max(half[1]) as f32 + 10.0, bounds);
    let domino = ColliderBuilder::cuboid(HALF_M[0], HALF_M[1], HALF_M[2]).friction(0.3);
    for z in 0..rows {
        for x in 0..row {
            let place = [
                (x as f64 - 0.5 * (row - 1) as f64) * DOMINO_PITCH_M,
                f64::from(HALF_M[1]),
                (z as f64 - 0.5 * (rows - 1) as f64) * ROW_PITCH_M,
            ];
            let body = RigidBodyBuilder::dynamic().can_sleep(sleep);
            let body = match x {
                // It turns about its foot.
                0 => body.angvel(Vector::new(0.0, 0.0, -2.0)).linvel(Vector::new(2.0 * HALF_M[1], 0.0, 0.0)),
                _ => body,
            };
            scene.push(WorldPose::at(place), body, domino.clone());
        }
    }
    scene
}

/// Returns borders through the middle of dominoes.
fn at_dominoes(row: usize) -> impl Fn(usize) -> Vec<Cut> {
    let at = |eighths: usize| ((eighths * row / 8) as f64 - 0.5 * (row - 1) as f64) * DOMINO_PITCH_M;
    planes(Axis::X, [4, 2, 6, 1, 3, 5, 7].map(at))
}

/// Returns whether the long side of a domino leans by more than 45°.
fn has_fallen(look: &Look, body: usize) -> bool {
    look.bodies[body].is_some_and(|(pose, _)| {
        let [x, _, z, _] = pose.rotation.map(f64::from);
        // The y component of the turned y axis.
        1.0 - 2.0 * (x * x + z * z) < std::f64::consts::FRAC_1_SQRT_2
    })
}

fn half_fallen_s(trace: &Trace) -> f64 {
    let half = |look: &&Look| {
        2 * look.moving().filter(|&body| has_fallen(look, body)).count() >= look.moving().count()
    };
    trace.looks.iter().find(half).unwrap_or(trace.last()).t_s
}

#[cfg(test)]
mod tests {
    use dcd::protocol::Velocity;

    use super::*;

    fn leaning(degrees: f32) -> Look {
        let turn = Rotation::from_rotation_z(degrees.to_radians());
        let pose = WorldPose { rotation: turn.to_array(), ..WorldPose::default() };
        Look { bodies: vec![Some((pose, Velocity::default()))], ..Look::default() }
    }

    #[test]
    fn a_domino_has_fallen_beyond_45_degrees() {
        assert!(!has_fallen(&leaning(44.0), 0));
        assert!(has_fallen(&leaning(46.0), 0));
        assert!(has_fallen(&leaning(-90.0), 0));
    }

    #[test]
    fn a_collapse_is_when_the_first_body_is_far_from_its_place() {
        let look = |t_s, x| {
            let pose = WorldPose::at([x, 0.0, 0.0]);
            Look { t_s, bodies: vec![Some((pose, Velocity::default()))], ..Look::default() }
        };
        let trace = |xs: [f64; 3]| Trace {
            looks: xs.iter().enumerate().map(|(i, &x)| look(i as f64, x)).collect(),
            ..Trace::default()
        };
        assert_eq!(collapse_s(&trace([0.0, 0.3, 0.5])), 1.0);
        assert_eq!(collapse_s(&trace([0.0, 0.1, 0.1])), 2.0);
    }

    #[test]
    fn nothing_overlaps_in_a_building_before_it_is_let_go() {
        for scene in [card_house(), arch(), planks()] {
            let mut world = scene.bare_world();
            world.gravity = Vector::ZERO;
            world.step();
            let depth_m = dcd::physics::Measured::contacts(&world).max_penetration_m;
            assert!(depth_m < 1e-3, "{}: {depth_m} m", scene.name);
        }
    }
}
