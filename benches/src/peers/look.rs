//! Measures every engine alike: from the poses and velocities read back, with the same geometry and formulas.

use dcd::protocol::WorldPose;
use dcd::rapier3d::parry::query;
use dcd::rapier3d::parry::query::sat::{
    cuboid_cuboid_find_local_separating_edge_twoway as edges,
    cuboid_cuboid_find_local_separating_normal_oneway as faces,
};
use dcd::rapier3d::parry::shape::{Ball, Cuboid};
use dcd::rapier3d::prelude::*;
use dcd::space::Bounds;

use super::bodies::{Bodies, Body, Solid, State};

/// All bodies of a world at one moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Look {
    /// The mean depth of all pairs that overlap, metres; 0 if none does.
    pub(super) mean_depth_m: f64,
    /// The depth of the deepest pair, metres.
    pub(super) deepest_m: f64,
    /// Kinetic and potential energy, joules; heights count from y = 0.
    pub(super) energy_j: f64,
    /// The mean height of the middles of all bodies that move, metres.
    pub(super) mean_height_m: f64,
    /// The number of bodies that are not finite or outside of everything fixed.
    pub(super) lost: usize,
}

/// An observer of worlds of one scene.
pub(super) struct Looker<'a> {
    bodies: &'a Bodies,
    movers: Vec<&'a Body>,
    fixed: Vec<(Solid, WorldPose)>,
    /// The box around all that is fixed and all starts.
    room: Bounds,
}

impl<'a> Looker<'a> {
    pub(super) fn new(bodies: &'a Bodies) -> Self {
        let around = |body: &Body| {
            let reach = match body.solid {
                Solid::Box(half) if !body.moves => half.map(f64::from),
                solid => [solid.reach_m(); 3],
            };
            let at = body.start.pose.translation;
            let side = |sign: f64| std::array::from_fn(|i| at[i] + sign * reach[i]);
            Bounds::new(side(-1.0), side(1.0))
        };
        let fixed = bodies.bodies.iter().filter(|body| !body.moves);
        let mut room =
            bodies.bodies.iter().map(around).reduce(|a, b| a.union(&b)).expect("a scene is not empty");
        if bodies.gravity[1] < 0.0 {
            // What is thrown up comes down.
            room.max[1] = f64::INFINITY;
        }
        Self {
            bodies,
            movers: bodies.movers().collect(),
            fixed: fixed.map(|body| (body.solid, body.start.pose)).collect(),
            room,
        }
    }

    /// Measures the bodies that move, given their states in the order of the scene.
    pub(super) fn look(&self, states: &[State]) -> Look {
        assert_eq!(states.len(), self.movers.len(), "an engine gives every body that moves");
        let here = |state: &State| {
            let at = state.pose.translation;
            let within = (0..3).all(|i| (self.room.min[i]..=self.room.max[i]).contains(&at[i]));
            within && state.pose.rotation.iter().all(|v| v.is_finite())
        };
        let there: Vec<_> = self.movers.iter().zip(states).filter(|(_, state)| here(state)).collect();
        let solids: Vec<_> = there.iter().map(|(body, state)| (body.solid, state.pose)).collect();
        let depths = self.depths_m(&solids);
        let height = |(_, state): &(&&Body, &State)| state.pose.translation[1];
        Look {
            mean_depth_m: depths.iter().sum::<f64>() / depths.len().max(1) as f64,
            deepest_m: depths.iter().copied().fold(0.0, f64::max),
            energy_j: there.iter().map(|(body, state)| self.energy_j(body, state)).sum(),
            mean_height_m: there.iter().map(height).sum::<f64>() / there.len().max(1) as f64,
            lost: states.len() - there.len(),
        }
    }

    /// Returns the energy of a body, ½ m v² + ½ ω·Iω − m g·x.
    fn energy_j(&self, body: &Body, state: &State) -> f64 {
        let (mass, v) = (body.mass_kg(), state.velocity.linear.map(f64::from));
        let turn = Rotation::from_array(state.pose.rotation);
        let spin = (turn.inverse() * Vector::from(state.velocity.angular)).to_array().map(f64::from);
        let inertia = match body.solid {
            Solid::Ball(radius_m) => [0.4 * mass * f64::from(radius_m).powi(2); 3],
            Solid::Box(half) => {
                let [x, y, z] = half.map(|half| mass / 3.0 * f64::from(half).powi(2));
                [y + z, z + x, x + y]
            }
        };
        let sum = |of: &dyn Fn(usize) -> f64| (0..3).map(of).sum::<f64>();
        0.5 * mass * sum(&|i| v[i] * v[i]) + 0.5 * sum(&|i| inertia[i] * spin[i] * spin[i])
            - mass * sum(&|i| f64::from(self.bodies.gravity[i]) * state.pose.translation[i])
    }

    /// Returns the overlaps of all pairs that have one, pairs with fixed bodies included, in metres.
    fn depths_m(&self, movers: &[(Solid, WorldPose)]) -> Vec<f64> {
        let mut depths: Vec<_> =
            near_pairs(movers).filter_map(|(a, b)| depth_m(&movers[a], &movers[b])).collect();
        for mover in movers {
            depths.extend(self.fixed.iter().filter_map(|fixed| depth_m(fixed, mover)));
        }
        depths
    }
}

/// Returns the pairs whose spheres may meet, each pair once, by a grid whose cells are as wide as the largest
/// sphere.
fn near_pairs(solids: &[(Solid, WorldPose)]) -> impl Iterator<Item = (usize, usize)> + '_ {
    type Cell = [i64; 3];
    let reach_m = solids.iter().map(|(solid, _)| solid.reach_m()).fold(0.0, f64::max);
    let cell = move |at: [f64; 3]| -> Cell { at.map(|v| (v / (2.0 * reach_m)).floor() as i64) };
    let mut cells: Vec<(Cell, usize)> =
        solids.iter().enumerate().map(|(i, (_, pose))| (cell(pose.translation), i)).collect();
    cells.sort_unstable();
    (0..cells.len()).flat_map(move |at| {
        let ([x, y, z], a) = cells[at];
        let mut near = Vec::new();
        // In the order of cells, the cells of a row along z lie beside one another.
        for (dx, dy) in [(-1, -1), (-1, 0), (-1, 1), (0, -1), (0, 0), (0, 1), (1, -1), (1, 0), (1, 1)] {
            let from = cells.partition_point(|(cell, _)| *cell < [x + dx, y + dy, z - 1]);
            let row = cells[from..].iter().take_while(|(cell, _)| *cell <= [x + dx, y + dy, z + 1]);
            near.extend(row.map(|(_, b)| *b).filter(|b| a < *b));
        }
        near.into_iter().map(move |b| (a, b))
    })
}

/// Returns by how much two solids overlap, along the axis along which they overlap least; `None` if they do
/// not.
fn depth_m((a, at_a): &(Solid, WorldPose), (b, at_b): &(Solid, WorldPose)) -> Option<f64> {
    let apart: [f64; 3] = std::array::from_fn(|i| at_b.translation[i] - at_a.translation[i]);
    let turn = |pose: &WorldPose| Rotation::from_array(pose.rotation).normalize();
    // Places are f64, seen from the first solid: f32 keeps micrometres only near its zero.
    let back = turn(at_a).inverse();
    let b_from_a = Pose::from_parts(back * Vector::from(apart.map(|v| v as f32)), back * turn(at_b));
    let gap_m = match (*a, *b) {
        (Solid::Box(half_a), Solid::Box(half_b)) => {
            let (a, b) = (Cuboid::new(half_a.into()), Cuboid::new(half_b.into()));
            let of_faces = faces(&a, &b, &b_from_a).0.max(faces(&b, &a, &b_from_a.inverse()).0);
            if of_faces > 0.0 { of_faces } else { of_faces.max(edges(&a, &b, &b_from_a).0) }
        }
        (Solid::Ball(a), Solid::Ball(b)) => b_from_a.translation.length() - a - b,
        (Solid::Box(half), Solid::Ball(radius)) => gap_to_ball_m(half, radius, &b_from_a),
        (Solid::Ball(radius), Solid::Box(half)) => gap_to_ball_m(half, radius, &b_from_a.inverse()),
    };
    (gap_m < 0.0).then_some(f64::from(-gap_m))
}

fn gap_to_ball_m(half: [f32; 3], radius: f32, ball_from_box: &Pose) -> f32 {
    let (cuboid, ball) = (Cuboid::new(half.into()), Ball::new(radius));
    let contact = query::contact(&Pose::IDENTITY, &cuboid, ball_from_box, &ball, 0.0);
    contact.ok().flatten().map_or(f32::INFINITY, |contact| contact.dist)
}

#[cfg(test)]
mod tests {
    use std::f32::consts::{FRAC_1_SQRT_2, FRAC_PI_4};

    use dcd::scene::{Params, Scene};

    use super::*;

    const UNIT: Solid = Solid::Box([0.5; 3]);

    fn turned(at: [f64; 3], turn: Rotation) -> WorldPose {
        WorldPose { translation: at, rotation: turn.to_array() }
    }

    #[test]
    fn two_boxes_overlap_as_far_as_they_were_put_into_one_another() {
        // Far from the origin, where f32 would see steps of a millimetre.
        let far = 10_000.0;
        for (b, at, expected) in [
            (UNIT, WorldPose::at([far + 0.99, 0.2, 0.1]), Some(0.01)),
            (UNIT, WorldPose::at([far + 1.01, 0.0, 0.0]), None),
            // An edge of one box, turned by 45°, in a face of the other.
            (
                UNIT,
                turned([far + 1.2, 0.0, 0.0], Rotation::from_rotation_z(FRAC_PI_4)),
                Some(0.5 + f64::from(FRAC_1_SQRT_2) - 1.2),
            ),
            (Solid::Box([20.0, 1.0, 20.0]), WorldPose::at([far, -1.495, 3.0]), Some(0.005)),
            (Solid::Ball(0.5), WorldPose::at([far, 0.98, 0.0]), Some(0.02)),
        ] {
            let a = (UNIT, WorldPose::at([far, 0.0, 0.0]));
            let depths = [depth_m(&a, &(b, at)), depth_m(&(b, at), &a)];
            match expected {
                None => assert_eq!(depths, [None; 2]),
                Some(expected) => {
                    assert!(
                        depths.iter().all(|depth| (depth.unwrap() - expected).abs() < 1e-6),
                        "{depths:?} {expected}"
                    );
                }
            }
        }
    }

    #[test]
    fn two_edges_that_cross_overlap_along_the_line_between_them() {
        let (a, b) = (Rotation::from_rotation_z(FRAC_PI_4), Rotation::from_rotation_x(FRAC_PI_4));
        let apart = 2.0 * f64::from(FRAC_1_SQRT_2) - 0.03;
        let depth = depth_m(&(UNIT, turned([0.0; 3], a)), &(UNIT, turned([0.0, apart, 0.0], b)));
        assert!((depth.unwrap() - 0.03).abs() < 1e-6, "{depth:?}");
    }

    #[test]
    fn the_grid_finds_every_pair_that_overlaps() {
        let scene = Scene::named("heap", &Params::new().with("n", 300)).unwrap();
        let bodies = Bodies::of(&scene).unwrap();
        // Squeezed, so that most overlap.
        let solids: Vec<_> = bodies
            .movers()
            .map(|body| {
                let at = body.start.pose.translation.map(|v| 0.7 * v);
                (body.solid, WorldPose { translation: at, ..body.start.pose })
            })
            .collect();
        let overlap = |(a, b): &(usize, usize)| depth_m(&solids[*a], &solids[*b]).is_some();
        let mut by_grid: Vec<_> = near_pairs(&solids).filter(overlap).collect();
        by_grid.sort_unstable();
        let all = (0..300).flat_map(|a| (a + 1..300).map(move |b| (a, b)));
        assert_eq!(by_grid, all.filter(overlap).collect::<Vec<_>>());
        assert!(by_grid.len() > 300, "{}", by_grid.len());
    }

    #[test]
    fn a_tower_has_the_energy_of_its_heights_and_a_body_that_fell_out_is_lost() {
        let scene = Scene::named("tower", &Params::from_args(["n=3", "sleep=0"]).unwrap()).unwrap();
        let bodies = Bodies::of(&scene).unwrap();
        let looker = Looker::new(&bodies);
        let mut states: Vec<_> = bodies.movers().map(|body| body.start).collect();
        states[0].velocity.angular = [0.0, 3.0, 0.0];
        states[1].velocity.linear = [2.0, 0.0, 0.0];
        let look = looker.look(&states);
        // ½ · ⅙ · 3² + ½ · 2² + 9.81 · (0.5 + 1.5 + 2.5)
        assert!((look.energy_j - (0.75 + 2.0 + 9.81 * 4.5)).abs() < 1e-4, "{look:?}");
        assert_eq!((look.mean_height_m, look.lost), (1.5, 0));
        states[0].pose.translation[1] = -5.0;
        states[1].pose.translation[1] = f64::NAN;
        let look = looker.look(&states);
        assert_eq!((look.mean_height_m, look.lost), (2.5, 2));
    }
}
