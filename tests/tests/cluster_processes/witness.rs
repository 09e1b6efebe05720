//! A client that sees how the world advances.

use std::time::{Duration, Instant};

use dcd::protocol::{Velocity, WorldPose};
use dcd::runtime::{ClientWorld, JoinConfig};
use dcd::space::BodyId;
use rapier3d::prelude::*;

use crate::process::LIMIT;

/// Its avatar is told of after every third tick, and goes sideways.
pub(crate) struct Witness {
    pub(crate) world: ClientWorld,
    pub(crate) avatar: BodyId,
}

impl Witness {
    pub(crate) fn join(server: &str, token: String) -> Self {
        let config = JoinConfig { timeout: LIMIT, ..JoinConfig::new(server.parse().unwrap(), token) };
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

    pub(crate) fn tick(&self) -> u64 {
        self.world.body(self.avatar).expect("the avatar stays in the world").tick.0
    }

    /// Watches so many ticks, and says how long the world stood still at most: a tick needs every region.
    pub(crate) fn advance(&self, ticks: u64) -> Duration {
        let goal = self.tick() + ticks;
        self.watch(|tick, _| tick >= goal)
    }

    /// Watches for so long, and says how long the world stood still at most.
    pub(crate) fn watch_for(&self, time: Duration) -> Duration {
        self.watch(|_, since| since >= time)
    }

    fn watch(&self, enough: impl Fn(u64, Duration) -> bool) -> Duration {
        let (start, mut since, mut longest) = (Instant::now(), Instant::now(), Duration::ZERO);
        let mut tick = self.tick();
        while !enough(tick, start.elapsed()) {
            let seen = self.world.updates();
            self.world.wait_update(seen, Duration::from_millis(100));
            self.world.check().unwrap();
            let now = self.tick();
            if now > tick {
                longest = longest.max(since.elapsed());
                (tick, since) = (now, Instant::now());
            }
            assert!(since.elapsed() < LIMIT, "the world stands still at tick {tick}");
        }
        longest.max(since.elapsed())
    }
}
