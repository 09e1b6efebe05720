//! Tests that shapes keep their names, and which are refused.

use super::*;
use rapier3d::prelude::Pose;

fn rebuilt(shape: &SharedShape) -> (ShapeHash, ShapeHash) {
    let mut here = ShapeLibrary::default();
    let hash = here.intern(shape).unwrap();
    let mut there = ShapeLibrary::default();
    for record in here.records() {
        there.add(record).unwrap();
    }
    (hash, there.intern(&there.shape(hash).unwrap()).unwrap())
}

#[test]
fn a_compound_of_compounds_is_refused() {
    let mut library = ShapeLibrary::default();
    let ball = library.add(ShapeRecord::Ball(1.0)).unwrap();
    let mut of =
        |part| library.add(ShapeRecord::Compound(vec![(convert::pose_record(&Pose::IDENTITY), part)]));
    let inner = of(ball).unwrap();
    assert!(matches!(of(inner), Err(ShapeError::Broken { what: "compound", .. })));
}

#[test]
fn a_mesh_without_area_and_a_hull_below_the_least_size_are_refused_for_what_they_are() {
    let line = vec![Vector::ZERO, Vector::X, Vector::X * 2.0];
    let mesh = SharedShape::trimesh(line, vec![[0, 1, 2], [0, 1, 1]]).unwrap();
    let refused = |shape: &SharedShape| ShapeLibrary::default().intern(shape).unwrap_err();
    assert_eq!(refused(&mesh), ShapeError::Flat("triangle mesh"));
    let corners = [Vector::ZERO, Vector::X, Vector::Y, Vector::Z];
    let hull = |size: f32| SharedShape::convex_hull(&corners.map(|corner| corner * size)).unwrap();
    assert_eq!(refused(&hull(0.9e-4)), ShapeError::Size("convex polyhedron"));
    assert!(ShapeLibrary::default().intern(&hull(1.1e-4)).is_ok());
}

#[test]
fn a_hull_of_triangles_that_do_not_close_is_refused() {
    let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    let closed = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let built = |triangles: &[[u32; 3]]| {
        ShapeLibrary::default().add(ShapeRecord::ConvexPolyhedron(corners.clone(), triangles.to_vec()))
    };
    assert!(built(&closed).is_ok());
    let mut turned = closed.clone();
    turned[3].swap(0, 1);
    for broken in [&closed[..3], &turned, &[&closed[..], &closed[..]].concat(), &[[0, 0, 0]]] {
        assert!(matches!(built(broken), Err(ShapeError::Broken { .. })), "{broken:?}");
    }
}

#[test]
fn a_compound_is_made_of_neither_meshes_nor_terrain() {
    let pose = convert::pose_record(&Pose::IDENTITY);
    let mut library = ShapeLibrary::default();
    let corners = vec![Vector::ZERO, Vector::X, Vector::Z];
    let voxels = SharedShape::voxels(Vector::splat(0.5), &[IVector::ZERO]);
    let terrain = SharedShape::heightfield(Array2::new(2, 2, vec![0.0; 4]), Vector::ONE);
    let mesh = SharedShape::trimesh(corners.clone(), vec![[0, 1, 2]]).unwrap();
    for part in [voxels, terrain, mesh, SharedShape::polyline(corners, None)] {
        let part = library.intern(&part).unwrap();
        let made = library.add(ShapeRecord::Compound(vec![(pose, part)]));
        assert!(matches!(made, Err(ShapeError::Broken { what: "compound", .. })), "{made:?}");
    }
}

#[cfg(feature = "net")]
#[test]
fn what_can_be_built_depends_on_what_is_known() {
    let ball = ShapeRecord::Ball(1.0);
    let pose = convert::pose_record(&Pose::IDENTITY);
    let pair = ShapeRecord::Compound(vec![(pose, ball.hash()), (pose, ball.hash())]);
    let known = BTreeMap::from([(ball.hash(), ball.clone())]);
    assert!(can_build(&known, std::slice::from_ref(&pair)));
    assert!(!can_build(&BTreeMap::new(), std::slice::from_ref(&pair)));
    assert!(can_build(&BTreeMap::new(), &[ball.clone(), pair.clone()]));
    assert!(!can_build(&known, &[pair, ShapeRecord::Ball(f32::NAN)]));
    let flat = ShapeRecord::Triangle([[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]);
    assert!(!can_build(&known, &[flat]));
}

#[test]
fn a_shape_out_of_the_range_of_parry_is_refused() {
    let built = |record| ShapeLibrary::default().add(record);
    for size in [SHAPE_LEAST_M, SHAPE_REACH_M] {
        assert!(built(ShapeRecord::Ball(size)).is_ok());
    }
    for size in [0.0, SHAPE_LEAST_M / 2.0, SHAPE_REACH_M * 2.0, f32::INFINITY] {
        assert_eq!(built(ShapeRecord::Ball(size)), Err(ShapeError::Size("ball")));
    }
    let far = [SHAPE_REACH_M * 2.0, 0.0, 0.0];
    assert_eq!(built(ShapeRecord::Segment([[0.0; 3], far])), Err(ShapeError::Size("segment")));
}

#[test]
fn every_shape_keeps_its_name_through_its_record() {
    let hull: Vec<_> = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]].map(convert::vector).to_vec();
    let mut holed = HeightField::new(Array2::new(3, 4, vec![0.5; 12]), Vector::ONE);
    holed.set_cell_status(1, 2, HeightFieldCellStatus::CELL_REMOVED);
    holed.set_cell_status(0, 1, HeightFieldCellStatus::ZIGZAG_SUBDIVISION);
    let shapes = [
        SharedShape::ball(0.5),
        SharedShape::cuboid(0.5, 1.0, 2.0),
        SharedShape::capsule_y(0.5, 0.25),
        SharedShape::cylinder(1.0, 0.5),
        SharedShape::cone(1.0, 0.5),
        SharedShape::round_cuboid(0.5, 0.5, 0.5, 0.1),
        SharedShape::round_cylinder(0.5, 0.5, 0.1),
        SharedShape::round_cone(0.5, 0.5, 0.1),
        SharedShape::halfspace(Vector::Y),
        SharedShape::segment(Vector::ZERO, Vector::X),
        SharedShape::triangle(Vector::ZERO, Vector::X, Vector::Y),
        SharedShape::polyline(vec![Vector::ZERO, Vector::X, Vector::Y], None),
        SharedShape::convex_hull(&hull).unwrap(),
        SharedShape::round_convex_hull(&hull, 0.1).unwrap(),
        SharedShape::round_triangle(Vector::ZERO, Vector::X, Vector::Y, 0.1),
        SharedShape::voxels(
            Vector::splat(0.25),
            &[[0, 0, 0], [1, 0, 0], [-9, 3, 70]].map(IVector::from_array),
        ),
        SharedShape::trimesh(hull.clone(), vec![[0, 1, 2], [0, 2, 3]]).unwrap(),
        SharedShape::new(holed),
        SharedShape::heightfield(Array2::new(2, 3, vec![0., 1., 2., 3., 4., 5.]), Vector::ONE),
        SharedShape::compound(vec![
            (Pose::IDENTITY, SharedShape::ball(1.0)),
            (Pose::from_translation(Vector::X), SharedShape::cuboid(1.0, 1.0, 1.0)),
        ]),
    ];
    for shape in &shapes {
        let (sent, received) = rebuilt(shape);
        assert_eq!(sent, received, "{:?}", shape.shape_type());
    }
}

#[test]
fn equal_shapes_are_one_object() {
    let mut library = ShapeLibrary::default();
    let a = library.intern(&SharedShape::ball(0.5)).unwrap();
    let b = library.intern(&SharedShape::ball(0.5)).unwrap();
    let c = library.intern(&SharedShape::ball(0.25)).unwrap();
    assert_eq!(a, b);
    assert_ne!(a, c);
    assert_eq!(library.records().len(), 2);
}

#[test]
fn triangles_without_area_are_dropped_from_meshes_of_users_and_refused_from_peers() {
    let corners = [[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [2., 0., 0.]];
    let (good, flat) = ([0, 1, 2], [0, 1, 3]);
    let mut library = ShapeLibrary::default();
    let mesh = SharedShape::trimesh(corners.map(convert::vector).to_vec(), vec![good, flat]).unwrap();
    let hash = library.intern(&mesh).unwrap();
    assert_eq!(library.shape(hash).unwrap().as_trimesh().unwrap().indices(), [good]);
    let only_flat = SharedShape::trimesh(corners.map(convert::vector).to_vec(), vec![flat]).unwrap();
    assert!(library.intern(&only_flat).is_err());
    let record = ShapeRecord::TriMesh(corners.to_vec(), vec![good, flat], 0);
    assert_eq!(library.add(record), Err(ShapeError::Flat("triangle mesh")));
    let triangle = ShapeRecord::Triangle([corners[0], corners[1], corners[3]]);
    assert_eq!(library.add(triangle), Err(ShapeError::Flat("triangle")));
}

#[test]
fn hulls_without_volume_are_refused() {
    let corners = [[0., 0., 0.], [1., 0., 0.], [0., 0., 1.], [1., 0., 1.]];
    let sheet = SharedShape::convex_hull(&corners.map(convert::vector));
    let mut library = ShapeLibrary::default();
    assert!(sheet.is_none_or(|sheet| library.intern(&sheet).is_err()));
    assert!(library.records().is_empty());
}

#[test]
fn shapes_that_cannot_travel_or_cannot_exist_are_refused() {
    let mut library = ShapeLibrary::default();
    let mut voxels = Voxels::new(Vector::ONE, &[IVector::ZERO]);
    let mut beside = Voxels::new(Vector::ONE, &[IVector::X]);
    voxels.combine_voxel_states(&mut beside, IVector::ZERO);
    let refused = library.intern(&SharedShape::new(voxels));
    assert!(matches!(refused, Err(ShapeError::Unsupported(_))), "{refused:?}");
    assert_eq!(library.add(ShapeRecord::Voxels([1.0; 3], vec![[i32::MAX; 3]])), Err(ShapeError::Voxels));
    assert!(library.add(ShapeRecord::Voxels([1.0, 0.0, 1.0], vec![[0; 3]])).is_err());
    let sheet = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    assert!(library.add(ShapeRecord::RoundConvexPolyhedron(sheet, vec![[0, 1, 2], [0, 2, 1]], 0.1)).is_err());
    let line = [[0.0; 3], [1.0; 3], [2.0; 3]];
    assert_eq!(library.add(ShapeRecord::RoundTriangle(line, 0.1)), Err(ShapeError::Flat("round triangle")));
    assert_eq!(library.add(ShapeRecord::Ball(f32::NAN)), Err(ShapeError::Size("ball")));
    assert!(library.add(ShapeRecord::TriMesh(vec![[0.0; 3]], vec![[0, 0, 7]], 0)).is_err());
    assert!(
        library.add(ShapeRecord::HeightField(vec![0.0], u32::MAX, u32::MAX, [1.0; 3], 0, vec![])).is_err()
    );
    let short = ShapeRecord::HeightField(vec![0.0; 6], 2, 3, [1.0; 3], 0, vec![0]);
    assert!(library.add(short).is_err());
    let missing = ShapeHash([7; 16]);
    let pose = convert::pose_record(&Pose::IDENTITY);
    assert_eq!(library.add(ShapeRecord::Compound(vec![(pose, missing)])), Err(ShapeError::Unknown(missing)));
}

#[test]
fn among_many_bodies_shapes_that_nobody_has_are_looked_for_seldom_and_sooner_where_they_are_large() {
    let looks = |bodies: usize, side: usize| {
        let mut library = ShapeLibrary::default();
        let kept = library.add(ShapeRecord::Ball(1.0)).unwrap();
        let mut looks = 0;
        for dug in 0..500u16 {
            let mut heights = vec![0.0; side * side];
            heights[0] = -0.01 * f32::from(dug);
            let field = Array2::new(side, side, heights);
            library.intern(&SharedShape::heightfield(field, Vector::ONE)).unwrap();
            if library.has_grown(bodies) {
                looks += 1;
                library.keep([kept].into());
            }
        }
        looks
    };
    assert!((40..100).contains(&looks(100, 2)), "{}", looks(100, 2));
    assert_eq!(looks(100_000, 2), 0);
    assert!((2..10).contains(&looks(100_000, 128)), "{}", looks(100_000, 128));
}

#[test]
fn shapes_that_bodies_or_other_shapes_have_are_not_forgotten_whoever_says_so() {
    let mut library = ShapeLibrary::default();
    let [part, held, unused, other] =
        [0.1, 0.2, 0.3, 0.4].map(|radius| library.add(ShapeRecord::Ball(radius)).unwrap());
    let pose = crate::protocol::Pose { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };
    let pair = library.add(ShapeRecord::Compound(vec![(pose, part)])).unwrap();
    library.forget(&[part, held, unused].into(), [held].into());
    assert_eq!(library.hashes().collect::<BTreeSet<_>>(), [part, held, other, pair].into());
    library.forget(&[pair, other].into(), [pair].into());
    assert_eq!(library.hashes().collect::<BTreeSet<_>>(), [part, held, pair].into());
    assert!(library.add(ShapeRecord::Ball(0.3)).is_ok(), "it comes again");
}
