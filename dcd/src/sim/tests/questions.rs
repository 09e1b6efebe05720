//! Clients that ask those who own the bodies.

use super::*;
use crate::protocol::{Question, RayAnswer, RayQuestion};

fn ray(origin: [f64; 3], direction: [f32; 3]) -> RayQuestion {
    RayQuestion { origin, direction, max_m: f64::INFINITY, solid: true, mask: u32::MAX, exclude: None }
}

/// Through the middle of the world along x, across all its regions, and out of it.
fn question(number: u64) -> Question {
    let rays = vec![ray([-1.0, 4.0, 4.0], [1.0, 0.0, 0.0]), ray([-5.0, 4.0, 4.0], [-1.0, 0.0, 0.0])];
    Question { number, flags: 0, groups: 0, exclude: Vec::new(), rays }
}

fn answer(sim: &mut Sim, client: ClientId, number: u64) -> Vec<Option<RayAnswer>> {
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

/// A client or participant that has joined, and a body at rest on the way of the first ray.
fn asking(seed: u64, participates: bool) -> (Sim, ClientId, BodyId) {
    let mut sim = Sim::new(SimConfig { bodies: 0, ..config(seed, 3) });
    sim.run_to(Tick(5)).unwrap();
    let client = if participates { sim.start_participant(None).1 } else { sim.start_client(None) };
    sim.run_until(|sim| sim.client(client).is_joined()).unwrap();
    for (index, x) in [12.5, 6.5].into_iter().enumerate() {
        let body = sim_body(BodyId::avatar(client, index as u32), [x, 4.0, 4.0]);
        sim.wish(client, ClientEvent::Spawn { body, shapes: Vec::new() });
    }
    sim.run_until(|sim| sim.states().len() == 2).unwrap();
    (sim, client, BodyId::avatar(client, 1))
}

#[test]
fn the_nearest_of_all_regions_bodies_answers() {
    for seed in 0..6 {
        let (mut sim, client, body) = asking(seed, seed % 2 == 1);
        sim.wish(client, ClientEvent::Ask(question(1)));
        let hits = answer(&mut sim, client, 1);
        assert_eq!(hits.len(), 2);
        assert_eq!(hits[0].map(|hit| (hit.body, hit.distance_m)), Some((body, 7.5)), "seed {seed}");
        assert_eq!(hits[1], None, "nothing is out there");
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
        sim.wish(client, ClientEvent::Ask(question(1)));
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
        sim.wish(client, ClientEvent::Ask(question(2)));
        for number in [1, 2] {
            let hits = answer(&mut sim, client, number);
            assert_eq!(hits[0].map(|hit| hit.body), Some(body), "seed {seed}");
        }
    }
}
