//! Shapes that are seldom used cross borders too.

use rapier3d::math::IVector;
use rapier3d::parry::shape::{HeightField, HeightFieldCellStatus};
use rapier3d::parry::utils::Array2;

use super::*;

/// Bodies that slide over a floor with a border in the middle, and what they are.
fn sliders() -> Vec<(&'static str, SharedShape)> {
    let corners =
        [[0.5, -0.5, 0.5], [0.5, -0.5, -0.5], [-0.5, -0.5, 0.5], [-0.5, -0.5, -0.5], [0.0, 0.5, 0.0]];
    let corners = corners.map(Vector::from);
    let stack: Vec<_> = (0..8).map(|k| IVector::new(k & 1, k >> 1 & 1, k >> 2)).collect();
    vec![
        ("voxels", SharedShape::voxels(Vector::splat(0.5), &stack)),
        ("round hull", SharedShape::round_convex_hull(&corners, 0.05).unwrap()),
        ("hull", SharedShape::convex_hull(&corners).unwrap()),
    ]
}

#[test]
fn voxels_and_round_hulls_slide_over_a_border_as_in_one_world() {
    for (name, shape) in sliders() {
        let slider = || {
            let body = body_at(-2.0, 0.6, 0.0).linvel(Vector::new(4.0, 0.0, 0.0));
            (body, ColliderBuilder::new(shape.clone()).friction(0.05).mass(1.0))
        };
        let mut bare = PhysicsWorld::new();
        bare.insert(fixed_at(-0.5), ColliderBuilder::cuboid(60.0, 0.5, 60.0));
        let (body, collider) = slider();
        let (one, _) = bare.insert(body, collider);
        for _ in 0..120 {
            bare.step();
        }
        let one = bare.bodies[one].translation();
        assert!(one.x > 0.5, "{name}: the test needs a slide: {one}");
        for coupling in SHARING {
            let mut world = DcdWorld::new(halves(coupling)).unwrap();
            insert_floor(&mut world);
            let (body, collider) = slider();
            let id = world.insert(body, collider).unwrap();
            let first = world.owner_of(id);
            steps(&mut world, 120);
            assert_ne!(world.owner_of(id), first, "{name}, {coupling:?}");
            let at = Vector::from(world.pose(id).unwrap().translation.map(|v| v as f32));
            assert!((at - one).length() < 0.05, "{name}, {coupling:?}: at {at}, in one world {one}");
        }
    }
}

#[test]
fn a_hole_in_a_height_field_and_a_gap_in_voxels_are_there_on_both_sides_of_a_border() {
    let mut field = HeightField::new(Array2::new(5, 5, vec![0.0; 25]), Vector::new(16.0, 1.0, 16.0));
    // The two cells at x from -4 to 4 around z = -2.
    for column in [1, 2] {
        field.set_cell_status(1, column, HeightFieldCellStatus::CELL_REMOVED);
    }
    let gap = |x: i32, z: i32| (-2..2).contains(&x) && (-2..0).contains(&z);
    let ground = (-4..4).flat_map(|x| (-4..4).map(move |z| (x, z)));
    let tiles: Vec<_> = ground.filter(|&(x, z)| !gap(x, z)).map(|(x, z)| IVector::new(x, -1, z)).collect();
    let floors = [
        ("height field", SharedShape::new(field)),
        ("voxels", SharedShape::voxels(Vector::new(2.0, 1.0, 2.0), &tiles)),
    ];
    for (name, floor) in floors {
        for coupling in SHARING {
            let mut world = DcdWorld::new(halves(coupling)).unwrap();
            world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::new(floor.clone())).unwrap();
            let ball = || ColliderBuilder::ball(0.4);
            let places = [(-1.0, -2.0), (1.0, -2.0), (-1.0, 4.0), (1.0, 4.0)];
            let balls = places.map(|(x, z)| world.insert(body_at(x, 1.0, z), ball()).unwrap());
            steps(&mut world, 120);
            let heights = balls.map(|id| world.pose(id).unwrap().translation[1]);
            assert!(heights[..2].iter().all(|&y| y < -3.0), "{name}, {coupling:?}: {heights:?}");
            assert!(
                heights[2..].iter().all(|&y| (y - 0.4).abs() < 0.02),
                "{name}, {coupling:?}: {heights:?}"
            );
        }
    }
}
