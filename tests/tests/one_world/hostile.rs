//! Tests queries that no honest program sends: whatever a client may send is answered, and the answer may be
//! sent. An owner that stopped, or whose answer broke a rule, would be lost to the world.

use std::ops::Range;

use dcd::physics::{Coupling, ShapeLibrary};
use dcd::protocol::{
    CastQuery, Check, FilterRecord, FromClient, OverlapQuery, PartFilter, Place, Pose, Query, QueryParts,
    RayQuery, ShapeRecord, WorldPose,
};
use dcd::space::Bounds;
use proptest::prelude::*;
use rapier3d::prelude::{ActiveEvents, ColliderBuilder, RigidBodyBuilder};

use super::scenery::{place, scene, things, world};

/// From numbers whose square underflows to the largest that a world may reach, and now and then numbers that
/// no message may have.
fn number() -> impl Strategy<Value = f32> {
    let size = prop_oneof![
        4 => Just(0.0f32),
        12 => 0.0f32..20.0,
        8 => (-45i32..7).prop_map(|power| 10.0f32.powi(power)),
        1 => (7i32..39).prop_map(|power| 10.0f32.powi(power)),
        1 => Just(f32::MAX),
    ];
    (size, any::<bool>()).prop_map(|(size, negative)| if negative { -size } else { size })
}

fn size() -> impl Strategy<Value = f32> {
    prop_oneof![2 => 0.1f32..20.0, 2 => (-4i32..7).prop_map(|power| 10.0f32.powi(power)), 1 => number().prop_map(f32::abs)]
}

fn vector() -> impl Strategy<Value = [f32; 3]> {
    prop_oneof![3 => place(), 2 => prop::array::uniform3(number())]
}

fn pose() -> impl Strategy<Value = WorldPose> {
    let far = prop::array::uniform3(number()).prop_map(|at| at.map(f64::from));
    let at = prop_oneof![4 => place().prop_map(|at| at.map(f64::from)), 1 => far];
    (at, turn()).prop_map(|(translation, rotation)| WorldPose { translation, rotation })
}

fn turn() -> impl Strategy<Value = [f32; 4]> {
    prop::array::uniform4(-1.0f32..1.0).prop_map(|turn| {
        let norm = turn.iter().map(|v| v * v).sum::<f32>().sqrt();
        if norm > 0.1 { turn.map(|v| v / norm) } else { [0.0, 0.0, 0.0, 1.0] }
    })
}

fn numbers(count: Range<usize>) -> impl Strategy<Value = Vec<[f32; 3]>> {
    prop::collection::vec(vector(), count)
}

fn shape() -> impl Strategy<Value = ShapeRecord> {
    let triangles = || prop::collection::vec(prop::array::uniform3(0u32..6), 1..12);
    prop_oneof![
        size().prop_map(ShapeRecord::Ball),
        prop::array::uniform3(size()).prop_map(ShapeRecord::Cuboid),
        (vector(), vector(), size()).prop_map(|(a, b, radius)| ShapeRecord::Capsule(a, b, radius)),
        (size(), size()).prop_map(|(a, b)| ShapeRecord::Cylinder(a, b)),
        (size(), size()).prop_map(|(a, b)| ShapeRecord::Cone(a, b)),
        prop::array::uniform2(vector()).prop_map(ShapeRecord::Segment),
        prop::array::uniform3(vector()).prop_map(ShapeRecord::Triangle),
        Just(ShapeRecord::HalfSpace([0.0, 1.0, 0.0])),
        (numbers(6..7), triangles()).prop_map(|(points, faces)| ShapeRecord::ConvexPolyhedron(points, faces)),
        (prop::array::uniform3(size()), size())
            .prop_map(|(half, border)| ShapeRecord::RoundCuboid(half, border)),
        (size(), size(), size()).prop_map(|(a, b, border)| ShapeRecord::RoundCylinder(a, b, border)),
        (size(), size(), size()).prop_map(|(a, b, border)| ShapeRecord::RoundCone(a, b, border)),
        (prop::array::uniform3(vector()), size())
            .prop_map(|(points, border)| ShapeRecord::RoundTriangle(points, border)),
        (numbers(6..7), triangles(), size())
            .prop_map(|(points, faces, border)| ShapeRecord::RoundConvexPolyhedron(points, faces, border)),
        (prop::array::uniform3(size()), prop::collection::btree_set(prop::array::uniform3(-9i32..9), 1..9))
            .prop_map(|(size, voxels)| ShapeRecord::Voxels(size, voxels.into_iter().collect())),
    ]
}

/// One shape, or a compound of two of it.
fn shapes() -> impl Strategy<Value = Vec<ShapeRecord>> {
    (shape(), prop::option::weighted(0.2, (vector(), turn()))).prop_map(|(shape, twin)| {
        let part = shape.hash();
        let twin = twin.map(|(translation, rotation)| {
            ShapeRecord::Compound(vec![
                (Pose { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] }, part),
                (Pose { translation, rotation }, part),
            ])
        });
        [shape].into_iter().chain(twin).collect()
    })
}

fn asked() -> impl Strategy<Value = (Vec<ShapeRecord>, QueryParts)> {
    let ray = (vector(), vector(), number(), any::<bool>()).prop_map(|(origin, direction, max, solid)| {
        let (origin, max_m, filter) = (origin.map(f64::from), f64::from(max.abs()), PartFilter::default());
        (Vec::new(), QueryParts::Rays(vec![RayQuery { origin, direction, max_m, solid, filter }]))
    });
    let turn = prop_oneof![Just([0.0; 3]), vector()];
    let cast = (shapes(), pose(), vector(), turn, number(), any::<bool>()).prop_map(
        |(shapes, pose, motion, turn, margin, leaves)| {
            let shape = shapes.last().expect("there is one").hash();
            let (margin_m, filter) =
                (if turn == [0.0; 3] { margin.abs() } else { 0.0 }, PartFilter::default());
            let leaves = leaves && turn == [0.0; 3];
            (
                shapes,
                QueryParts::Casts(vec![CastQuery { shape, pose, motion, turn, margin_m, leaves, filter }]),
            )
        },
    );
    let inside = (shapes(), pose()).prop_map(|(shapes, pose)| {
        let place = Place::Shape(shapes.last().expect("there is one").hash(), pose);
        (shapes, QueryParts::Overlaps(vec![OverlapQuery { place, filter: PartFilter::default() }]))
    });
    let point = vector().prop_map(|point| {
        let place = Place::Point(point.map(f64::from));
        (Vec::new(), QueryParts::Overlaps(vec![OverlapQuery { place, filter: PartFilter::default() }]))
    });
    let bounds = (vector(), vector()).prop_map(|(a, b)| {
        let min = std::array::from_fn(|i| f64::from(a[i].min(b[i])));
        let max = std::array::from_fn(|i| f64::from(a[i].max(b[i])));
        let place = Place::Box(Bounds { min, max });
        (Vec::new(), QueryParts::Overlaps(vec![OverlapQuery { place, filter: PartFilter::default() }]))
    });
    prop_oneof![2 => ray, 5 => cast, 3 => inside, 1 => point, 1 => bounds]
}

proptest! {
    #![proptest_config(super::config(400))]

    #[test]
    fn whatever_a_client_may_ask_is_answered_by_what_it_may_be_told(
        things in things(),
        asked in prop::collection::vec(asked(), 1..24),
    ) {
        let world = world(&scene(&things), 2, Coupling::Proxy);
        for (shapes, asked) in asked {
            let question = Query { number: 1, filter: FilterRecord::default(), shapes, parts: asked };
            if FromClient::Ask(question.clone()).check().is_ok() {
                let found = world.queries().answer(&question);
                let told = found.check();
                prop_assert!(told.is_ok(), "{told:?}: {question:?} is answered by {found:?}");
            }
        }
    }

    #[test]
    fn whatever_an_avatar_is_the_world_goes_on_and_may_be_told(
        things in things(),
        shapes in shapes(),
        pose in pose(),
        (speed, spin) in (vector(), vector()),
        (density, damping, gravity) in (number(), number(), number()),
    ) {
        let mut library = ShapeLibrary::default();
        for shape in &shapes {
            prop_assume!(shape.suits_clients() && shape.check().is_ok() && library.add(shape.clone()).is_ok());
        }
        let shape = library.shape(shapes.last().expect("there is one").hash()).expect("it was added");
        let collider = ColliderBuilder::new(shape).density(density.abs()).active_events(ActiveEvents::all());
        // Faster avatars are refused.
        let speed = speed.map(|v: f32| v.clamp(-230.0, 230.0));
        let mut avatar = RigidBodyBuilder::dynamic().linvel(speed.into()).angvel(spin.into());
        avatar = avatar.linear_damping(damping.abs()).gravity_scale(gravity);
        prop_assume!(pose.check().is_ok());
        let mut world = world(&scene(&things), 2, Coupling::Proxy);
        let inserted = world.insert_at(pose, avatar, vec![collider]);
        prop_assume!(!inserted.as_ref().is_err_and(|error| error.to_string().contains("has no mass")));
        inserted.unwrap();
        for _ in 0..10 {
            world.step().unwrap();
            for (id, _, pose, velocity) in world.states() {
                let told = pose.check().and(velocity.check());
                prop_assert!(told.is_ok(), "{told:?}: {id} is at {pose:?} and moves by {velocity:?}");
            }
            let events = world.events();
            for told in events.touches.iter().map(Check::check).chain(events.forces.iter().map(Check::check)) {
                prop_assert!(told.is_ok(), "{told:?}: {events:?}");
            }
        }
    }
}
