//! Tests that rarely used shapes cross borders too.

use rapier3d::math::IVector;
use rapier3d::parry::shape::{HeightField, HeightFieldCellStatus, HeightFieldFlags};
use rapier3d::parry::utils::Array2;

use super::bare::{Setup, as_in_bare_rapier};
use super::*;

/// Returns shapes of bodies that slide over a floor with a border in the middle, by name.
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
            let mut world = LocalWorld::new(halves(coupling)).unwrap();
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
            let mut world = LocalWorld::new(halves(coupling)).unwrap();
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

/// Returns a triangle mesh that is not convex: two arms at a right angle, standing on one of them.
fn angle() -> (Vec<Vector>, Vec<[u32; 3]>) {
    let mut outline = vec![[-0.5, -0.5], [0.5, -0.5], [0.5, -0.2], [-0.2, -0.2], [-0.2, 0.5], [-0.5, 0.5]];
    outline.reverse();
    let at = |z: f32| outline.clone().into_iter().map(move |[x, y]| Vector::new(x, y, z));
    let points = at(-0.4).chain(at(0.4)).collect();
    let n = outline.len() as u32;
    // From the inner corner, fans of triangles cover each face.
    let fan = |from: u32| {
        (0..n).filter_map(move |i| {
            let (corner, a, b) = (2, (i + 2) % n, (i + 3) % n);
            (a != corner && b != corner).then_some([from + corner, from + a, from + b])
        })
    };
    let mut triangles: Vec<_> = fan(0).collect();
    triangles.extend(fan(n).map(|[a, b, c]| [a, c, b]));
    for i in 0..n {
        let j = (i + 1) % n;
        triangles.extend([[i, i + n, j], [j, i + n, j + n]]);
    }
    (points, triangles)
}

#[test]
fn solids_of_every_kind_slide_over_a_border_as_in_one_world() {
    let (points, triangles) = angle();
    let part = |x: f32| (Pose::from_translation(Vector::X * x), SharedShape::cuboid(0.2, 0.5, 0.5));
    let lying = |shape: SharedShape| {
        SharedShape::compound(vec![(Pose::rotation(Vector::X * std::f32::consts::FRAC_PI_2), shape)])
    };
    let decomposed = SharedShape::convex_decomposition(&points, &triangles);
    assert!(decomposed.as_compound().unwrap().shapes().len() > 1, "the decomposition has parts");
    let solids = [
        ("ball", SharedShape::ball(0.5)),
        ("cuboid", SharedShape::cuboid(0.5, 0.5, 0.5)),
        ("capsule", SharedShape::capsule_z(0.4, 0.5)),
        ("cylinder", SharedShape::cylinder(0.5, 0.5)),
        ("lying cylinder", lying(SharedShape::cylinder(0.5, 0.5))),
        ("cone", SharedShape::cone(0.5, 0.5)),
        ("round cuboid", SharedShape::round_cuboid(0.4, 0.4, 0.4, 0.1)),
        ("round cylinder", SharedShape::round_cylinder(0.4, 0.4, 0.1)),
        ("round cone", SharedShape::round_cone(0.4, 0.4, 0.1)),
        ("compound", SharedShape::compound(vec![part(-0.3), part(0.3)])),
        ("decomposition", decomposed),
        ("round decomposition", SharedShape::round_convex_decomposition(&points, &triangles, 0.02)),
        ("mesh", SharedShape::trimesh(points.clone(), triangles.clone()).unwrap()),
    ];
    for (name, shape) in solids {
        let slide = |linvel: Vector| {
            let mut setup = Setup::on_floor(75);
            let body = body_at(-1.5, 0.55, 0.0).linvel(linvel).can_sleep(false);
            let collider = ColliderBuilder::new(shape.clone()).friction(0.1);
            let given = MassProperties::new(Vector::Y * -0.2, 1.0, Vector::splat(0.2));
            setup.push(body, collider.mass_properties(given));
            // The box that it hits at the border.
            setup.push(body_at(0.6, 0.5, 0.2).can_sleep(false), cube().friction(0.1));
            setup
        };
        let gate_m = if name.contains("decomposition") { 0.12 } else { 0.06 };
        as_in_bare_rapier(name, gate_m, &slide(Vector::X * 3.0), &slide(Vector::ZERO));
    }
}

#[test]
fn ground_of_every_kind_carries_over_a_border_as_in_one_world() {
    let corners = [[-8.0, 0.0, -8.0], [8.0, 0.0, -8.0], [8.0, 0.0, 8.0], [-8.0, 0.0, 8.0]].map(Vector::from);
    let grid = |i: u32| Vector::new((i / 5) as f32 * 4.0 - 8.0, 0.0, (i % 5) as f32 * 4.0 - 8.0);
    let vertices = (0..25).map(grid).collect();
    let cell = |i: u32| [[i, i + 1, i + 5], [i + 1, i + 6, i + 5]];
    let cells = (0..20u32).filter(|i| i % 5 < 4).flat_map(cell).collect();
    let rail = |z: f32| {
        SharedShape::polyline((0..9).map(|i| Vector::new(i as f32 * 2.0 - 8.0, 0.0, z)).collect(), None)
    };
    let edge = |z: f32| SharedShape::segment(Vector::new(-8.0, 0.0, z), Vector::new(8.0, 0.0, z));
    // Without this flag, Rapier's boxes trip over inner edges sooner or later.
    let smooth = HeightFieldFlags::FIX_INTERNAL_EDGES;
    let heights = Array2::new(9, 9, vec![0.0; 81]);
    let field = HeightField::with_flags(heights, Vector::new(16.0, 1.0, 16.0), smooth);
    let [a, b, c, d] = corners;
    let grounds = [
        ("half-space", vec![SharedShape::halfspace(Vector::Y)]),
        (
            "mesh",
            vec![SharedShape::trimesh_with_flags(vertices, cells, TriMeshFlags::FIX_INTERNAL_EDGES).unwrap()],
        ),
        ("height field", vec![SharedShape::new(field)]),
        ("triangles", vec![SharedShape::triangle(a, c, b), SharedShape::triangle(a, d, c)]),
        (
            "round triangles",
            vec![SharedShape::round_triangle(a, c, b, 0.05), SharedShape::round_triangle(a, d, c, 0.05)],
        ),
        ("polylines", vec![rail(-0.3), rail(0.3)]),
        ("segments", vec![edge(-0.3), edge(0.3)]),
    ];
    for (name, shapes) in grounds {
        let mut with = Setup::weightless(75);
        with.gravity = Vector::Y * -9.81;
        let colliders = shapes.into_iter().map(|shape| ColliderBuilder::new(shape).friction(0.1)).collect();
        with.bodies.push((RigidBodyBuilder::fixed(), colliders));
        let body = body_at(-1.5, 0.56, 0.0).linvel(Vector::X * 3.0).can_sleep(false);
        with.push(body, cube().friction(0.1));
        let mut without = with.clone();
        without.bodies[0].1 = vec![ColliderBuilder::ball(0.1).translation(Vector::Y * -50.0)];
        as_in_bare_rapier(name, 0.05, &with, &without);
    }
}
