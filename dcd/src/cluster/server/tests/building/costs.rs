//! Tests how much clients may build at most, and how fast.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::*;

#[test]
fn what_a_builder_may_bring_is_bounded_and_what_it_may_ask_for() {
    let mut server = built_in();
    let iterations = with(body(0), |traits| traits.extra_solver_iterations = 9);
    assert_eq!(refusal(&mut server, insert(iterations)), Some(Refusal::Costly(Costs::Iterations)));
    let huge = |body: BodyRecord| {
        let ball = ShapeRecord::Ball(101.0);
        let body = with(body, |traits| traits.colliders.push(collider(&ball)));
        BuildOp::Insert { bodies: vec![body], shapes: vec![ball], joints: Vec::new() }
    };
    assert_eq!(refusal(&mut server, huge(body(0))), Some(Refusal::Costly(Costs::Size)));
    assert_eq!(refusal(&mut server, huge(with(body(0), |traits| traits.kind = BodyKind::Fixed))), None);

    let ball = ShapeRecord::Ball(0.5);
    let round = |index: u32, at: [f64; 3]| {
        let body = sim_body(BodyId::built(BUILDER, index), at);
        let body = with(body, |traits| traits.colliders.push(collider(&ball)));
        BuildOp::Insert { bodies: vec![body], shapes: vec![ball.clone()], joints: Vec::new() }
    };
    let came = (100..200).take_while(|&i| refusal(&mut server, round(i, [0.0; 3])).is_none()).count();
    assert_eq!(came, 65);
    assert_eq!(refusal(&mut server, round(199, [0.0; 3])), Some(Refusal::Costly(Costs::Overlaps)));
    server.common.now += Duration::from_secs(10);

    let ties = |count: u32| {
        let new = body(900);
        let joints = (0..count).map(|index| tied(index, new.id, body(0).id)).collect();
        BuildOp::Insert { bodies: vec![new], shapes: Vec::new(), joints }
    };
    assert_eq!(refusal(&mut server, ties(MAX_BUILT as u32 + 1)), Some(Refusal::TooMany), "joints count too");
    server.common.now += Duration::from_secs(10);
    assert_eq!(refusal(&mut server, ties(MAX_BUILT as u32)), None);
    server.common.now += Duration::from_secs(10);

    let many = |from: u32, count: u32| BuildOp::Insert {
        bodies: (from..from + count).map(body).collect(),
        shapes: Vec::new(),
        joints: Vec::new(),
    };
    let there = server.record().built(BUILDER).count();
    let room = (MAX_BUILT - there) as u32;
    assert_eq!(refusal(&mut server, many(1_000, room)), None);
    assert_eq!(refusal(&mut server, many(9_000, 1)), Some(Refusal::TooMany), "all that it may have built");
    assert_eq!(refusal(&mut server, BuildOp::Remove(body(1_000).id)), None);

    // A flood of allowed operations is refused beyond the rate, and a client that goes on is cut off.
    server.common.now += Duration::from_secs(100);
    let moves = || (0..512).map(|_| go(BodyId::persistent(0), 1.0)).collect::<Vec<_>>();
    let mut done = 0;
    let cut_off = (0..400).position(|_| {
        let outputs = asks(&mut server, Peer::Client(BUILDER), BUILDER, 1, moves());
        done += 512 - refusals(&outputs).len();
        is_closed(&outputs, BUILDER)
    });
    assert_eq!(done, 24_576, "all at once");
    let cut_off = cut_off.expect("it is cut off");
    assert!((60..120).contains(&cut_off), "after {cut_off}");
    assert!(server.record().body(body(1_001).id).is_some(), "what it has built stays");
}

#[test]
fn who_is_somewhat_too_fast_is_refused_and_not_cut_off() {
    let mut server = built_in();
    let moves = |count: usize| vec![go(BodyId::persistent(0), 1.0); count];
    for _ in 0..24 {
        asks(&mut server, Peer::Client(BUILDER), BUILDER, 1, moves(1_024));
    }
    let refused = |server: &mut Server, count: usize| {
        let outputs = asks(server, Peer::Client(BUILDER), BUILDER, 1, moves(count));
        assert!(!is_closed(&outputs, BUILDER));
        refusals(&outputs).len()
    };
    assert_eq!(refused(&mut server, 1), 1, "it has asked for all that it may");
    for _ in 0..200 {
        assert_eq!(refused(&mut server, 60), 60, "little at a time");
        server.common.now += Duration::from_millis(125);
        assert!((65..125).contains(&refused(&mut server, 250)), "and less than half of much");
    }
}

#[test]
fn shapes_to_build_with_are_bounded_too() {
    let mut server = built_in();
    // Some 100 kB each, and no two equal.
    let terrain = |n: u32| {
        let heights = (0..160 * 160).map(|i| n as f32 / 4.0 + (i % 97) as f32 / 97.0).collect();
        ShapeRecord::HeightField(heights, 160, 160, [1.0; 3], 0, Vec::new())
    };
    let brings = |server: &mut Server, n: u32| {
        let fixed = with(body(n), |traits| {
            traits.kind = BodyKind::Fixed;
            traits.colliders.push(collider(&terrain(n)));
        });
        server.common.now += Duration::from_secs(1);
        refusal(server, BuildOp::Insert { bodies: vec![fixed], shapes: vec![terrain(n)], joints: Vec::new() })
    };
    let came = (0..400).take_while(|&n| brings(&mut server, n).is_none()).count();
    assert!((120..300).contains(&came), "{came} came within 16 MiB");
}

#[test]
fn all_that_a_builder_builds_has_so_many_corners_at_most() {
    let mut server = built_in();
    let point = |i: usize| [1.0 / (i + 1) as f32, (i % 7) as f32, (i % 5) as f32];
    let hull = ShapeRecord::ConvexPolyhedron((0..2_000).map(point).collect(), Vec::new());
    let mut came = 0;
    let refused = loop {
        let at = [f64::from(came) * 50.0, 0.0, 0.0];
        let body = sim_body(BodyId::built(BUILDER, came), at);
        let body = with(body, |traits| {
            traits.kind = if came % 2 == 0 { BodyKind::Fixed } else { BodyKind::Dynamic };
            traits.colliders.push(collider(&hull));
        });
        let op = BuildOp::Insert { bodies: vec![body], shapes: vec![hull.clone()], joints: Vec::new() };
        match refusal(&mut server, op) {
            None => came += 1,
            Some(refused) => break refused,
        }
    };
    assert_eq!((came, refused), (100, Refusal::Costly(Costs::BuiltCorners)));
}

/// Returns the insertion of a body with so many colliders of the last of these shapes.
fn shaped(body: BodyRecord, kind: BodyKind, shapes: &[ShapeRecord], colliders: usize) -> BuildOp {
    let body = with(body, |traits| {
        traits.kind = kind;
        traits.colliders = vec![collider(shapes.last().expect("it has a shape")); colliders];
    });
    BuildOp::Insert { bodies: vec![body], shapes: shapes.to_vec(), joints: Vec::new() }
}

fn at(index: u32, place: [f64; 3]) -> BodyRecord {
    sim_body(BodyId::built(BUILDER, index), place)
}

#[test]
fn what_is_fixed_costs_too() {
    let costly = |what| Some(Refusal::Costly(what));
    let mut server = built_in();
    let wall = [ShapeRecord::Cuboid([10.0, 2.0, 0.1])];
    // Long walls side by side do not overlap.
    for index in 0..70 {
        let wall = shaped(at(index, [0.0, 2.0, f64::from(index) * 0.25]), BodyKind::Fixed, &wall, 1);
        assert_eq!(refusal(&mut server, wall), None, "wall {index}");
    }
    let mut across = at(99, [0.0, 2.0, 8.5]);
    across.state.pose.rotation = [0.0, 0.5f32.sqrt(), 0.0, 0.5f32.sqrt()];
    let across = shaped(across, BodyKind::Fixed, &wall, 1);
    assert_eq!(refusal(&mut server, across), costly(Costs::Overlaps), "it goes through all of them");
    let ball = [ShapeRecord::Ball(0.5)];
    let fixed = |index| shaped(at(index, [500.0; 3]), BodyKind::Fixed, &ball, 1);
    let came = (100..200).take_while(|&index| refusal(&mut server, fixed(index)).is_none()).count();
    assert_eq!(came, 65);
    assert_eq!(refusal(&mut server, fixed(200)), costly(Costs::Overlaps));
    let moves = shaped(at(200, [500.0; 3]), BodyKind::Dynamic, &ball, 1);
    assert_eq!(refusal(&mut server, moves), None, "it lies on what is fixed");

    let mut server = built_in();
    let large = |index: u32, place: [f64; 3]| shaped(at(index, place), BodyKind::Fixed, &ball, 400);
    let came = (0..9).take_while(|&index| refusal(&mut server, large(index, [0.0; 3])).is_none()).count();
    assert_eq!(came, 3, "each compares with at most 1,024 colliders");
    server.common.now += Duration::from_secs(100);
    let apart = |index: u32| large(index, [f64::from(index) * 2.0 + 10.0, 0.0, 0.0]);
    let came = (3..99).take_while(|&index| refusal(&mut server, apart(index)).is_none()).count();
    assert_eq!(3 + came, 16_384 / 400);
    assert_eq!(refusal(&mut server, apart(99)), costly(Costs::Colliders));
    assert_eq!(refusal(&mut server, BuildOp::Remove(BodyId::built(BUILDER, 0))), None);
    server.common.now += Duration::from_secs(100);
    assert_eq!(refusal(&mut server, apart(99)), None, "what is gone costs nothing");

    let at_origin = Pose { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };
    let many = ShapeRecord::Compound(vec![(at_origin, ball[0].hash()); 1_000]);
    let compounds = shaped(at(300, [0.0, 99.0, 0.0]), BodyKind::Dynamic, &[ball[0].clone(), many], 17);
    assert_eq!(refusal(&mut server, compounds), costly(Costs::Colliders), "parts count");
}

#[test]
fn fixed_bodies_that_meet_each_other_and_what_looks_far_around_are_refused() {
    use rapier3d::prelude::ActiveCollisionTypes;
    let mut server = built_in();
    let ball = [ShapeRecord::Ball(0.5)];
    let changed = |kind, change: &dyn Fn(&mut BodyTraits)| {
        let BuildOp::Insert { mut bodies, shapes, joints } = shaped(body(0), kind, &ball, 1) else {
            unreachable!()
        };
        change(Arc::make_mut(&mut bodies[0].traits));
        BuildOp::Insert { bodies, shapes, joints }
    };
    let meets = |traits: &mut BodyTraits| {
        traits.colliders[0].collision_types = ActiveCollisionTypes::all().bits();
    };
    let skin = |traits: &mut BodyTraits| traits.colliders[0].contact_skin_m = 120.0;
    let ahead = |traits: &mut BodyTraits| traits.soft_ccd_m = 120.0;
    type Case<'a> = (BodyKind, &'a dyn Fn(&mut BodyTraits), Costs);
    let cases: [Case<'_>; 3] = [
        (BodyKind::Fixed, &meets, Costs::FixedPairs),
        (BodyKind::Dynamic, &skin, Costs::Size),
        (BodyKind::Dynamic, &ahead, Costs::Size),
    ];
    for (kind, change, what) in cases {
        assert_eq!(refusal(&mut server, changed(kind, change)), Some(Refusal::Costly(what)));
    }
    assert_eq!(refusal(&mut server, changed(BodyKind::Dynamic, &|_| ())), None);
    let known = server.record().body(body(0).id).expect("it came").clone();
    for (kind, change, what) in cases {
        let traits = with(known.clone(), change).traits;
        let alter = BuildOp::Alter(Alteration::Body { body: known.id, traits, user_data: 0, wakes: false });
        let expected = (kind == BodyKind::Dynamic).then_some(Refusal::Costly(what));
        assert_eq!(
            refusal(&mut server, alter),
            expected,
            "altered; that it meets what is fixed moves nothing"
        );
    }
}

#[test]
fn a_builder_has_neither_voxels_nor_half_spaces() {
    let mut server = built_in();
    let voxels = ShapeRecord::Voxels([1.0; 3], vec![[0; 3]]);
    let at_origin = Pose { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };
    let compound = ShapeRecord::Compound(vec![(at_origin, voxels.hash())]);
    let half_space = ShapeRecord::HalfSpace([0.0, 1.0, 0.0]);
    for shapes in [vec![voxels.clone()], vec![voxels, compound], vec![half_space]] {
        let op = shaped(body(0), BodyKind::Fixed, &shapes, 1);
        assert_eq!(refusal(&mut server, op), Some(Refusal::Shape), "{shapes:?}");
    }
    let words = Refusal::Shape.to_string();
    assert!(words.contains("neither voxels nor half-spaces"), "{words}");
}

#[test]
fn shapes_are_built_once_and_only_where_all_else_is_fine() {
    static BUILT: AtomicUsize = AtomicUsize::new(0);
    let mut server = built_in();
    server.common.config.can_build = |_, shapes| {
        BUILT.fetch_add(shapes.len(), Ordering::Relaxed);
        true
    };
    let ball = [ShapeRecord::Ball(0.5)];
    let crowd = shaped(body(0), BodyKind::Fixed, &ball, 16_500);
    assert_eq!(refusal(&mut server, crowd), Some(Refusal::Costly(Costs::Colliders)));
    assert_eq!(BUILT.load(Ordering::Relaxed), 0);
    for index in 0..2 {
        assert_eq!(refusal(&mut server, shaped(body(index), BodyKind::Fixed, &ball, 1)), None);
        assert_eq!(BUILT.load(Ordering::Relaxed), 1, "it is on record then");
    }
}

#[test]
fn what_a_change_counts_grows_with_what_others_are_told() {
    let mut server = built_in();
    let ball = [ShapeRecord::Ball(0.5)];
    assert_eq!(refusal(&mut server, shaped(body(0), BodyKind::Dynamic, &ball, 400)), None);
    let traits = server.record().body(body(0).id).expect("it came").traits.clone();
    let alter = || {
        BuildOp::Alter(Alteration::Body {
            body: body(0).id,
            traits: traits.clone(),
            user_data: 0,
            wakes: false,
        })
    };
    let told = crate::protocol::encoded_len(&alter());
    let came = (0..1_000).take_while(|_| refusal(&mut server, alter()).is_none()).count();
    assert!((5 << 20..6 << 20).contains(&(came * told)), "{came} of {told} bytes");
}

#[test]
fn shapes_that_nothing_has_and_compounds_of_what_no_compound_can_have_are_refused_before_they_are_built() {
    let mut server = built_in();
    let ball = ShapeRecord::Ball(0.5);
    let unused = BuildOp::Insert { bodies: Vec::new(), shapes: vec![ball.clone()], joints: Vec::new() };
    assert_eq!(refusal(&mut server, unused), Some(Refusal::NotToBeBuilt));
    let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
    let mesh = ShapeRecord::TriMesh(corners, vec![[0, 1, 2]], 0);
    let at_origin = Pose { translation: [0.0; 3], rotation: [0.0, 0.0, 0.0, 1.0] };
    let of_mesh = ShapeRecord::Compound(vec![(at_origin, mesh.hash())]);
    let known = BTreeMap::from([(mesh.hash(), mesh.clone())]);
    assert!(!crate::physics::can_build(&known, std::slice::from_ref(&of_mesh)));
    let of_ball = ShapeRecord::Compound(vec![(at_origin, ball.hash()); 3]);
    let known = BTreeMap::from([(ball.hash(), ball)]);
    assert!(crate::physics::can_build(&known, &[of_ball]));
}
