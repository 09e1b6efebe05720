//! Tests which shapes a client forgets, and that what it builds again brings those that the world has
//! forgotten.

use super::*;

#[test]
fn shapes_are_forgotten_that_the_server_says_are_gone_or_does_not_tell_again_but_those_of_bodies() {
    let mut client = Client::new(ClientId(1), None, None);
    let [part, gone, lost] = [0.1, 0.2, 0.3].map(ShapeRecord::Ball);
    let pair = ShapeRecord::Compound(vec![(sim_collider(&part).pose, part.hash())]);
    let mut body = sim_body(BodyId::persistent(0), [0.0; 3]);
    std::sync::Arc::make_mut(&mut body.traits).colliders.push(sim_collider(&pair));
    let inserted = |shapes| ToClient::Inserted { body: body.clone(), shapes, joints: Vec::new() };
    tell(&mut client, inserted(vec![part.clone(), pair.clone(), gone.clone(), lost.clone()]));
    let names = |shapes: &[&ShapeRecord]| shapes.iter().map(|shape| shape.hash()).collect::<BTreeSet<_>>();
    let known = |client: &Client| client.shapes().keys().copied().collect::<BTreeSet<_>>();
    tell(&mut client, ToClient::ShapesGone(names(&[&part, &pair, &gone]).into_iter().collect()));
    assert_eq!(known(&client), names(&[&part, &pair, &lost]), "a body has the pair");
    // The client's link broke, and what was said meanwhile is lost.
    let welcome = ToClient::Welcome {
        incarnation: 1,
        id: ClientId(1),
        world: sim_world(1),
        logical_time: 1,
        next_built: (0, 0),
    };
    tell(&mut client, welcome);
    tell(&mut client, ToClient::Chunk(Chunk::Shapes(vec![part.clone(), pair.clone(), gone.clone()])));
    tell(&mut client, ToClient::Chunk(Chunk::Bodies(vec![body.clone()])));
    assert!(known(&client).contains(&lost.hash()), "not all is told yet");
    tell(&mut client, ToClient::WorldEnd);
    assert_eq!(known(&client), names(&[&part, &pair, &gone]));
}

/// Returns a polyline that takes most of a message.
fn line(number: u32) -> ShapeRecord {
    ShapeRecord::Polyline((0..3_400).map(|i| [i as f32, number as f32, 0.0]).collect(), Vec::new())
}

fn built_of(index: u32, shape: &ShapeRecord) -> BodyRecord {
    let mut body = built_body(index);
    std::sync::Arc::make_mut(&mut body.traits).colliders = vec![sim_collider(shape)];
    body
}

#[test]
fn what_is_built_again_brings_shapes_that_the_world_has_forgotten_meanwhile() {
    let at = Duration::ZERO;
    let mut client = Client::new(ClientId(1), None, None);
    joins(&mut client, Vec::new());
    let part = ShapeRecord::Ball(0.1);
    let pair = ShapeRecord::Compound(vec![(sim_collider(&part).pose, part.hash())]);
    let [kept, heard, untold] = [0, 1, 2].map(line);
    let all = [&kept, &part, &pair, &heard, &untold].map(Clone::clone);
    tell(&mut client, ToClient::Chunk(Chunk::Shapes(all.to_vec())));
    let bodies = [&kept, &pair, &heard, &untold].into_iter().zip(0..);
    let bodies: Vec<_> = bodies.map(|(shape, index)| built_of(index, shape)).collect();
    client.handle(at, ClientEvent::Build(vec![inserted(bodies.clone()), BuildOp::Remove(bodies[0].id)]));
    assert_eq!(built(&mut client).len(), 1, "they are known, and short");
    // The ends of a compound and its part may be told one after the other, and the last one not at all.
    for gone in [&pair, &part, &heard] {
        tell(&mut client, ToClient::ShapesGone(vec![gone.hash()]));
        assert!(!client.shapes().contains_key(&gone.hash()), "what is made with it now brings it");
    }
    client.handle(at, ClientEvent::Disconnected(Peer::Server));
    client.handle(at, ClientEvent::Connected(Peer::Server));
    let world = sim_world(2);
    tell(
        &mut client,
        ToClient::Welcome { incarnation: 1, id: ClientId(1), logical_time: 1, next_built: (0, 0), world },
    );
    tell(&mut client, ToClient::Chunk(Chunk::Shapes(vec![kept.clone()])));
    tell(&mut client, ToClient::WorldEnd);
    let again = built(&mut client);
    let numbers: Vec<_> = again.iter().map(|(number, _)| *number).collect();
    let ops: Vec<_> = again.into_iter().flat_map(|(_, ops)| ops).collect();
    assert!(numbers.len() > 1 && numbers.is_sorted(), "one message has no room for two lines");
    assert_eq!(ops.last(), Some(&BuildOp::Remove(bodies[0].id)));
    let mut brought = BTreeMap::new();
    for op in &ops {
        let BuildOp::Insert { bodies, shapes, .. } = op else { continue };
        brought.extend(bodies.iter().map(|body| (body.id, shapes.clone())));
    }
    assert!(brought.keys().copied().eq(bodies.iter().map(|body| body.id)));
    let has = |index: usize, shape| brought[&bodies[index].id].contains(shape);
    assert!(has(1, &part) && has(1, &pair) && has(2, &heard) && has(3, &untold));
    assert!(!brought.values().flatten().any(|shape| *shape == kept), "that is known");
    assert_eq!(client.answered_builds(), 0);
    numbers.into_iter().for_each(|number| tell(&mut client, ToClient::Built(number)));
    assert_eq!(client.answered_builds(), 1);
}
