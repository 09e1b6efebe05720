//! Tests the queries of a server's program: rays and shapes.

use dcd::query::{Query, QueryResult, RayQuery};

use super::*;

/// Waits for the answer to a query.
fn answered(world: &mut World, number: u64) -> QueryResult {
    let deadline = Instant::now() + LIMIT;
    loop {
        if let Some(answer) = world.answer(number).unwrap() {
            return answer;
        }
        assert!(Instant::now() < deadline, "the query is not answered within {LIMIT:?}");
        world.poll(Duration::from_millis(5));
        world.step().unwrap();
    }
}

/// Inserts walls on both sides of the border. Returns queries about them: rays, and an overlap with a ball.
fn walls_and_queries(world: &mut World) -> Vec<Query> {
    for x in [-6.0, 4.0, 9.0] {
        let wall = RigidBodyBuilder::fixed().translation(Vector::new(x, 2.0, 0.0));
        world.insert(wall, ColliderBuilder::cuboid(0.5, 2.0, 3.0)).unwrap();
    }
    let ray = |x: f64, towards: f32| RayQuery::new([x, 1.0, 0.0], [towards, 0.0, 0.0]).up_to(50.0);
    let reach = Query::intersect_shape(&SharedShape::ball(5.5), WorldPose::at([-1.0, 2.0, 0.0])).unwrap();
    vec![Query::rays([ray(0.0, 1.0), ray(0.0, -1.0), ray(20.0, -1.0), ray(20.0, 1.0)]), reach]
}

#[test]
fn a_servers_program_asks_by_rays_and_shapes_and_is_answered_as_by_a_local_world() {
    let mut local = World::new(cut()).unwrap();
    let queries = walls_and_queries(&mut local);
    local.step().unwrap();
    let mut ask = |query| {
        let number = local.submit(query).unwrap();
        answered(&mut local, number)
    };
    let expected: Vec<_> = queries.into_iter().map(&mut ask).collect();
    let QueryResult::Rays(hits) = &expected[0] else { panic!("rays were asked for") };
    assert_eq!(hits.iter().filter(|hit| hit.is_some()).count(), 3);

    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig { nodes: 2, ..ServeConfig::new(folder.path()) });
    // Nobody computes the world yet. Bodies made before a query are there for those who answer it.
    let queries = walls_and_queries(&mut server);
    let early: Vec<_> = queries.iter().map(|query| server.submit(query.clone()).unwrap()).collect();
    let gone = server.submit(queries[0].clone()).unwrap();
    server.forget(gone);
    let mut first = node(&server);
    let _second = node(&server);
    let answers = |server: &mut World, numbers: Vec<u64>| {
        numbers.into_iter().map(|number| answered(server, number)).collect::<Vec<_>>()
    };
    assert_eq!(answers(&mut server, early.clone()), expected);
    assert_eq!(server.answer(early[0]).unwrap(), None, "an answer is given once");
    let block = RigidBodyBuilder::fixed().translation(Vector::new(2.0, 1.0, 0.0));
    let block = server.insert(block, ColliderBuilder::ball(0.5)).unwrap();
    let number = server.submit(queries[0].clone()).unwrap();
    let QueryResult::Rays(hits) = answered(&mut server, number) else { panic!("rays were asked for") };
    assert_eq!(hits[0].map(|hit| hit.body), Some(block), "what was inserted before it is there");
    // The leader answers. The first node to join leads, and leaves.
    first.step().unwrap();
    drop(first);
    server.remove(block).unwrap();
    server.step().unwrap();
    let again: Vec<_> = queries.into_iter().map(|query| server.submit(query).unwrap()).collect();
    assert_eq!(answers(&mut server, again), expected);
    assert_eq!(server.answer(gone).unwrap(), None, "it was cancelled");
}

#[test]
fn bodies_can_be_tied_whatever_was_asked_between_them() {
    let folder = tempfile::tempdir().unwrap();
    let mut server = serve(ServeConfig::new(folder.path()));
    let ball = |x: f32| RigidBodyBuilder::dynamic().translation(Vector::new(x, 2.0, 0.0)).gravity_scale(0.0);
    let below = || Query::rays([RayQuery::new([5.0, 9.0, 0.0], [0.0, -1.0, 0.0]).up_to(9.0)]);
    let a = server.insert(ball(5.0), ColliderBuilder::ball(0.5)).unwrap();
    let (asked, gone) = (server.submit(below()).unwrap(), server.submit(below()).unwrap());
    server.forget(gone);
    let b = server.insert(ball(7.0), ColliderBuilder::ball(0.5)).unwrap();
    let bar = SphericalJointBuilder::new().local_anchor2(Vector::X * -2.0);
    let joint = server.insert_joint(a, b, bar).unwrap();
    server.step().unwrap();
    assert!(server.joint(joint).is_some());
    let _node = node(&server);
    let QueryResult::Rays(hits) = answered(&mut server, asked) else { panic!("rays were asked for") };
    assert_eq!(hits[0].map(|hit| hit.body), Some(a), "what was made before the question is there for it");
    assert_eq!(server.answer(gone).unwrap(), None, "it was cancelled");
    // If nothing was done since, a query does not wait for a step.
    let again = server.submit(below()).unwrap();
    let deadline = Instant::now() + LIMIT;
    while server.answer(again).unwrap().is_none() {
        assert!(Instant::now() < deadline, "the query is not answered within {LIMIT:?}");
        server.poll(Duration::from_millis(5));
    }
}
