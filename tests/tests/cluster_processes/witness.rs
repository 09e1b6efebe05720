//! Joins a client that observes how the world advances.

use std::time::{Duration, Instant};

use dcd::cluster::BodyView;
use dcd::protocol::{Velocity, WorldPose};
use dcd::runtime::{ClientWorld, JoinConfig};
use dcd::space::BodyId;
use rapier3d::prelude::*;

use crate::process::LIMIT;

/// Returns the configuration to join the server at one of these addresses, separated by commas.
pub(crate) fn joining(servers: &str, token: String) -> JoinConfig {
    let mut addresses = servers.split(',').map(|address| address.parse().unwrap());
    let first = JoinConfig::new(addresses.next().unwrap(), token);
    JoinConfig { standbys: addresses.collect(), timeout: LIMIT, ..first }
}

/// A client that watches. Its avatar begins in the first region and moves sideways; states of it come after
/// every third tick.
pub(crate) struct Witness {
    pub(crate) world: ClientWorld,
    pub(crate) avatar: BodyId,
}

impl Witness {
    pub(crate) fn join(servers: &str, token: String) -> Self {
        // Nodes wait for the server without end, and so must a client that watches them.
        let config = JoinConfig { give_up: Some(Duration::from_secs(3600)), ..joining(servers, token) };
        let mut world = ClientWorld::connect(&config).unwrap();
        let body = RigidBodyBuilder::kinematic_velocity_based();
        let avatar = world
            .spawn(WorldPose::at([-4.0, 20.0, 0.0]), &body.build(), &[ColliderBuilder::ball(0.5)])
            .unwrap();
        let mut witness = Self { world, avatar };
        assert!(witness.world.wait_body(avatar, LIMIT));
        let sideways = Velocity { linear: [0.0, 0.0, 0.5], angular: [0.0; 3] };
        witness.world.send_input(avatar, sideways, None).unwrap();
        witness.advance(30);
        witness
    }

    /// Removes its avatar from the world, and leaves. A client that only leaves says so once, and a server
    /// that has just come back may not know the client yet; the avatar would then stay until it expires.
    pub(crate) fn leave(self) {
        self.world.despawn(self.avatar).unwrap();
        let start = Instant::now();
        while self.world.body(self.avatar).is_some() {
            let seen = self.world.updates();
            self.world.wait_update(seen, Duration::from_millis(100));
            self.world.check().unwrap();
            assert!(start.elapsed() < LIMIT, "the avatar is still there");
        }
    }

    /// Returns the newest tick that counts: speculative ones do not.
    pub(crate) fn tick(&self) -> u64 {
        self.view().settled_tick().0
    }

    fn view(&self) -> BodyView {
        self.world.body(self.avatar).expect("the avatar stays in the world")
    }

    /// Watches this many ticks, and returns the longest time that the world stood still: a tick needs every
    /// region.
    pub(crate) fn advance(&self, ticks: u64) -> Duration {
        let goal = self.tick() + ticks;
        self.watch(|tick, _| tick >= goal).stood
    }

    /// Watches until this tick.
    pub(crate) fn reach(&self, goal: u64) {
        self.watch(|tick, _| tick >= goal);
    }

    /// Watches for this long, and returns the longest time that the world stood still.
    pub(crate) fn watch_for(&self, time: Duration) -> Duration {
        self.see_for(time).stood
    }

    /// Watches until something is done, and returns the longest time that the world stood still.
    pub(crate) fn watch_until(&self, mut is_done: impl FnMut() -> bool) -> Duration {
        self.watch(|_, _| is_done()).stood
    }

    /// Watches for this long, and returns what it saw.
    pub(crate) fn see_for(&self, time: Duration) -> Sight {
        self.watch(|_, since| since >= time)
    }

    fn watch(&self, mut enough: impl FnMut(u64, Duration) -> bool) -> Sight {
        let start = Instant::now();
        let (mut stood, mut frozen) = (Longest::since(start), Longest::since(start));
        let (mut tick, mut shown, mut guesses) = (self.tick(), self.view(), 0);
        let (mut back_m, mut older) = (0.0_f64, 0);
        while !enough(tick, start.elapsed()) {
            let seen = self.world.updates();
            self.world.wait_update(seen, Duration::from_millis(100));
            self.world.check().unwrap();
            let view = self.view();
            if view.settled_tick().0 > tick {
                tick = view.settled_tick().0;
                stood.moved();
            }
            older += u64::from(view.settled_tick().0 < tick);
            if view.tick != shown.tick {
                let way = |view: &BodyView| view.body.state.pose.translation[2];
                back_m = back_m.max(way(&shown) - way(&view));
                guesses += u64::from(view.speculative);
                shown = view;
                frozen.moved();
            }
            assert!(stood.lasts() < LIMIT, "the world stands still at tick {tick}");
        }
        let stale_p99 = stood.age_but_for(0.01);
        Sight { stood: stood.longest(), stale_p99, frozen: frozen.longest(), guesses, back_m, older }
    }
}

/// What a witness saw.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sight {
    /// The longest time between two ticks that count.
    pub(crate) stood: Duration,
    /// The greatest age of the newest tick that counts, since it came, in 99 % of the time.
    pub(crate) stale_p99: Duration,
    /// The longest time between two pictures, speculative ones included.
    pub(crate) frozen: Duration,
    /// The number of speculative pictures.
    pub(crate) guesses: u64,
    /// The longest way that the avatar was put back after a speculative picture, metres. The avatar moves at
    /// 0.5 m/s.
    pub(crate) back_m: f64,
    /// How often it was shown a tick that counts and is older than one shown before.
    pub(crate) older: u64,
}

/// The gaps between events.
struct Longest {
    since: Instant,
    longest: Duration,
    gaps: Vec<Duration>,
}

impl Longest {
    fn since(since: Instant) -> Self {
        Self { since, longest: Duration::ZERO, gaps: Vec::new() }
    }

    fn lasts(&self) -> Duration {
        self.since.elapsed()
    }

    fn moved(&mut self) {
        self.gaps.push(self.lasts());
        self.longest = self.longest();
        self.since = Instant::now();
    }

    /// Returns the age that the current gap had not reached at any moment, except for this share of the time.
    fn age_but_for(&self, share: f64) -> Duration {
        let mut gaps: Vec<_> = self.gaps.iter().chain([&self.lasts()]).map(Duration::as_secs_f64).collect();
        gaps.sort_by(f64::total_cmp);
        let allowed = share * gaps.iter().sum::<f64>();
        // Of each gap that is longer than an age, the time beyond that age counts.
        let beyond = |age: f64| gaps.iter().map(|gap| (gap - age).max(0.0)).sum::<f64>();
        let (mut below, mut above) = (0.0, gaps.last().copied().unwrap_or(0.0));
        for _ in 0..40 {
            let middle = 0.5 * (below + above);
            if beyond(middle) > allowed { below = middle } else { above = middle }
        }
        Duration::from_secs_f64(above)
    }

    fn longest(&self) -> Duration {
        self.longest.max(self.lasts())
    }
}
