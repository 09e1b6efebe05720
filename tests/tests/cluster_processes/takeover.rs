//! kill -9 of nodes: what the others do, and how long the world stands still.

use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use dcd::protocol::{Velocity, WorldPose};
use dcd::runtime::{ClientWorld, JoinConfig};
use dcd::space::BodyId;
use rapier3d::prelude::*;

use crate::process::{LIMIT, Server};

/// Times are measured one after the other.
static CLOCK: Mutex<()> = Mutex::new(());

/// The issue's bound.
const TAKEOVER: Duration = Duration::from_secs(3);

/// A client that sees how the world advances: its avatar is told of after every third tick.
struct Witness {
    world: ClientWorld,
    avatar: BodyId,
}

impl Witness {
    fn join(server: &Server) -> Self {
        let config = JoinConfig::new(server.address.parse().unwrap(), server.token("client"));
        let mut world = ClientWorld::connect(&config).unwrap();
        let body = RigidBodyBuilder::kinematic_velocity_based();
        let avatar =
            world.spawn(WorldPose::at([0.0, 20.0, 0.0]), &body, &[ColliderBuilder::ball(0.5)]).unwrap();
        let witness = Self { world, avatar };
        assert!(witness.world.wait_body(avatar, LIMIT));
        let sideways = Velocity { linear: [0.0, 0.0, 0.5], angular: [0.0; 3] };
        witness.world.drive(avatar, sideways, None).unwrap();
        witness.advance(30);
        witness
    }

    fn tick(&self) -> u64 {
        self.world.body(self.avatar).expect("the avatar stays in the world").tick.0
    }

    /// Watches so many ticks, and says how long the world stood still at most: a tick needs every region.
    fn advance(&self, ticks: u64) -> Duration {
        let goal = self.tick() + ticks;
        let (start, mut since, mut longest) = (Instant::now(), Instant::now(), Duration::ZERO);
        let mut tick = self.tick();
        while tick < goal {
            let seen = self.world.updates();
            self.world.wait_update(seen, Duration::from_secs(1));
            self.world.check().unwrap();
            let now = self.tick();
            if now > tick {
                longest = longest.max(since.elapsed());
                (tick, since) = (now, Instant::now());
            }
            assert!(start.elapsed() < LIMIT, "the world stands still at tick {tick}");
        }
        longest
    }
}

#[test]
fn a_killed_node_is_taken_over_within_three_seconds_and_nothing_is_lost() {
    let _alone = CLOCK.lock().unwrap_or_else(PoisonError::into_inner);
    for victim in ["n1", "n2"] {
        let mut server = Server::playground("2");
        let mut nodes = [server.node(), server.node()];
        assert!(server.view().contains("n1 r1, n2 r2; n1 leads"));
        let witness = Witness::join(&server);
        let (_, node) = nodes.iter_mut().find(|(name, _)| name == victim).unwrap();
        node.kill();
        let stood = witness.advance(60);
        let survivor = if victim == "n1" { "n2" } else { "n1" };
        let view = server.view();
        assert!(view.contains(&format!("{survivor} r1 r2; {survivor} leads")), "{view}");
        println!("{victim} killed: the world stood still for {:.2} s", stood.as_secs_f64());
        assert!(stood < TAKEOVER, "{victim}: {stood:?}");
        // The avatar is where it would be had nothing happened, less what the world stood still.
        assert!(witness.world.body(witness.avatar).is_some());
        drop(witness);
        let served = server.stop();
        assert_eq!((&served["views"], &served["nodes"]), (&2.into(), &1.into()));
    }
}

#[test]
fn a_new_node_shares_the_world_again_after_a_death() {
    let _alone = CLOCK.lock().unwrap_or_else(PoisonError::into_inner);
    let mut server = Server::playground("2");
    let (_first, mut second) = (server.node(), server.node());
    server.view();
    let witness = Witness::join(&server);
    second.1.kill();
    witness.advance(30);
    assert!(server.view().contains("r1 r2"));
    let third = server.node();
    let view = server.view();
    assert!(!view.contains("r1 r2") && view.contains(&format!("{} r", third.0)), "{view}");
    let stood = witness.advance(60);
    println!("a node joined: the world stood still for {:.2} s", stood.as_secs_f64());
    assert!(stood < Duration::from_secs(1), "{stood:?}");
    drop(witness);
    server.stop();
}

#[test]
fn the_server_holds_the_world_when_all_nodes_die_and_the_next_node_goes_on() {
    let _alone = CLOCK.lock().unwrap_or_else(PoisonError::into_inner);
    let mut server = Server::playground("2");
    let mut nodes = [server.node(), server.node()];
    server.view();
    let witness = Witness::join(&server);
    let tick = witness.tick();
    nodes.iter_mut().for_each(|(_, node)| node.kill());
    while !server.view().starts_with("none") {}
    let _next = server.node();
    assert!(server.view().contains("r1 r2"));
    witness.advance(60);
    assert!(witness.tick() > tick);
    drop(witness);
    server.stop();
}
