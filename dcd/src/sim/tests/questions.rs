//! Tests clients' queries, which the owners of bodies answer.

use super::*;
use crate::protocol::{
    CastQuery, FilterRecord, OverlapQuery, PartFilter, Place, Query, QueryParts, QueryResult, RayQuery,
    ShapeRecord, WorldPose,
};
use crate::space::Bounds;

fn asking_for(number: u64, parts: QueryParts) -> Query {
    let shapes = vec![ShapeRecord::Ball(0.5)];
    Query { number, filter: FilterRecord::default(), shapes, parts }
}

/// Returns a query with two rays: along x through the middle of the world, across all its regions, and out of
/// the world.
fn question(number: u64) -> Query {
    let ray = |origin: [f64; 3], direction: [f32; 3]| RayQuery {
        origin,
        direction,
        max_m: f64::INFINITY,
        solid: true,
        filter: PartFilter::default(),
    };
    let rays = vec![ray([-1.0, 4.0, 4.0], [1.0, 0.0, 0.0]), ray([-5.0, 4.0, 4.0], [-1.0, 0.0, 0.0])];
    asking_for(number, QueryParts::Rays(rays))
}

fn answer(sim: &mut Sim, client: ClientId, number: u64) -> QueryResult {
    let mut answer = None;
    for _ in 0..1_000 {
        answer = sim.clients.get_mut(&client).unwrap().take_answer(number);
        if answer.is_some() {
            break;
        }
        sim.run_for(Duration::from_millis(10)).unwrap();
    }
    answer.expect("an answer within ten seconds")
}

/// Returns the body that the first of two rays met, and how far away. The second meets nothing.
fn met(found: QueryResult) -> Option<(BodyId, f64)> {
    let QueryResult::Rays(hits) = found else { panic!("{found:?}") };
    assert_eq!((hits.len(), hits[1]), (2, None), "nothing is out there");
    hits[0].map(|hit| (hit.body, hit.distance_m))
}

/// Starts a client or participant that has joined, and a body at rest on the way of the first ray.
fn asking(seed: u64, participates: bool) -> (Sim, ClientId, BodyId) {
    let mut sim = Sim::new(SimConfig { bodies: 0, ..config(seed, 3) });
    sim.run_to(Tick(5)).unwrap();
    let client = if participates { sim.start_participant(None).1 } else { sim.start_client(None) };
    sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
    for (index, x) in [12.5, 6.5].into_iter().enumerate() {
        let body = sim_body(BodyId::avatar(client, index as u32), [x, 4.0, 4.0]);
        sim.submit(client, ClientEvent::Spawn { body, shapes: Vec::new() });
    }
    sim.run_until(|sim| sim.states().len() == 2).unwrap();
    (sim, client, BodyId::avatar(client, 1))
}

#[test]
fn the_nearest_of_all_regions_bodies_answers() {
    for seed in 0..6 {
        let (mut sim, client, body) = asking(seed, seed % 2 == 1);
        sim.submit(client, ClientEvent::Ask(question(1)));
        assert_eq!(met(answer(&mut sim, client, 1)), Some((body, 7.5)), "seed {seed}");
        sim.run_for(Duration::from_secs(1)).unwrap();
        assert_eq!(sim.clients.get_mut(&client).unwrap().take_answer(1), None, "it is given once");
    }
}

#[test]
fn a_question_outlives_leaders_links_and_servers() {
    for seed in 0..24 {
        let (mut sim, client, body) = asking(seed, seed % 2 == 1);
        let leader = sim.server().view().unwrap().leader;
        sim.run_events(seed).unwrap();
        sim.submit(client, ClientEvent::Ask(question(1)));
        match seed % 4 {
            0 => sim.crash(Peer::Node(leader)),
            1 => sim.break_link(Peer::Node(NodeId(4)), Peer::Node(leader)),
            2 => sim.break_link(Peer::Client(client), Peer::Node(leader)),
            _ => {
                sim.crash(Peer::Server);
                sim.run_for(Duration::from_secs(1)).unwrap();
                sim.restart_server();
            }
        }
        sim.submit(client, ClientEvent::Ask(question(2)));
        for number in [1, 2] {
            let met = met(answer(&mut sim, client, number));
            assert_eq!(met.map(|(body, _)| body), Some(body), "seed {seed}");
        }
    }
}

#[test]
fn shapes_on_their_way_and_places_are_asked_about_in_all_regions() {
    for seed in 0..6 {
        let (mut sim, client, near) = asking(seed, seed % 2 == 1);
        let (far, filter) = (BodyId::avatar(client, 0), PartFilter::default());
        let shape = ShapeRecord::Ball(0.5).hash();
        let cast = |x: f64, motion: f32| CastQuery {
            shape,
            pose: WorldPose::at([x, 4.0, 4.0]),
            motion: [motion, 0.0, 0.0],
            turn: [0.0; 3],
            margin_m: 0.0,
            leaves: false,
            filter,
        };
        let casts = vec![cast(2.5, 8.0), cast(10.5, 8.0), cast(2.5, 1.0)];
        let all = Bounds { min: [f64::NEG_INFINITY; 3], max: [f64::INFINITY; 3] };
        let places =
            [Place::Box(all), Place::Point([6.5, 4.0, 4.5]), Place::Shape(shape, WorldPose::default())];
        let overlaps = places.map(|place| OverlapQuery { place, filter }).to_vec();
        sim.submit(client, ClientEvent::Ask(asking_for(1, QueryParts::Casts(casts))));
        sim.submit(client, ClientEvent::Ask(asking_for(2, QueryParts::Overlaps(overlaps))));

        let QueryResult::Casts(hits) = answer(&mut sim, client, 1) else { panic!() };
        let hits: Vec<_> = hits.iter().map(|hit| hit.map(|hit| (hit.body, hit.fraction))).collect();
        assert_eq!(hits, [Some((near, 0.5)), Some((far, 0.25)), None], "seed {seed}");
        let QueryResult::Overlaps(lists) = answer(&mut sim, client, 2) else { panic!() };
        let bodies =
            |list: &[crate::protocol::Overlap]| list.iter().map(|found| found.body).collect::<Vec<_>>();
        let lists: Vec<_> = lists.iter().map(|list| bodies(list)).collect();
        assert_eq!(lists, [vec![far, near], vec![near], vec![]], "seed {seed}");
    }
}
