//! Joins a client that observes how the world advances.

use std::time::{Duration, Instant};

use dcd::cluster::BodyView;
use dcd::protocol::{Velocity, WorldPose};
use dcd::runtime::{ClientWorld, JoinConfig};
use dcd::space::BodyId;
use rapier3d::prelude::*;

use crate::process::LIMIT;

/// What joins the server at one of these addresses, which are separated by commas.
pub(crate) fn joining(servers: &str, token: String) -> JoinConfig {
    let mut addresses = servers.split(',').map(|address| address.parse().unwrap());
    let first = JoinConfig::new(addresses.next().unwrap(), token);
    JoinConfig { standbys: addresses.collect(), timeout: LIMIT, ..first }
}

/// Its avatar is in the first region, is told of after every third tick, and goes sideways.
pub(crate) struct Witness {
    pub(crate) world: ClientWorld,
    pub(crate) avatar: BodyId,
}

impl Witness {
    pub(crate) fn join(servers: &str, token: String) -> Self {
        // A node waits without end, and who watches one waits with it.
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

    /// Takes its avatar out of the world, and goes. Who only goes says so once, and a server that is just back may not know yet who that is:
    /// then the avatar stays until it expires.
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

    /// The newest tick that counts: speculative ones do not.
    pub(crate) fn tick(&self) -> u64 {
        self.view().settled_tick().0
    }

    fn view(&self) -> BodyView {
        self.world.body(self.avatar).expect("the avatar stays in the world")
    }

    /// Watches so many ticks, and says how long the world stood still at most: a tick needs every region.
    pub(crate) fn advance(&self, ticks: u64) -> Duration {
        let goal = self.tick() + ticks;
        self.watch(|tick, _| tick >= goal).stood
    }

    /// Watches until this tick.
    pub(crate) fn reach(&self, goal: u64) {
        self.watch(|tick, _| tick >= goal);
    }

    /// Watches for so long, and says how long the world stood still at most.
    pub(crate) fn watch_for(&self, time: Duration) -> Duration {
        self.see_for(time).stood
    }

    /// Watches until something is done, and says how long the world stood still at most.
    pub(crate) fn watch_until(&self, mut is_done: impl FnMut() -> bool) -> Duration {
        self.watch(|_, _| is_done()).stood
    }

    /// Watches for so long.
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
    /// How old the newest tick that counts was at most in 99 % of the time, since it came.
    pub(crate) stale_p99: Duration,
    /// The longest time between two pictures, speculative ones too.
    pub(crate) frozen: Duration,
    /// Speculative pictures.
    pub(crate) guesses: u64,
    /// How far the avatar was put back at most when a guess was over, metres: it goes half a metre a second.
    pub(crate) back_m: f64,
    /// How often it was shown a tick that counts and is older than one that it had been shown.
    pub(crate) older: u64,
}

/// The times without something.
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

    /// How long it had lasted, at any moment but for this share of the time.
    fn age_but_for(&self, share: f64) -> Duration {
        let mut gaps: Vec<_> = self.gaps.iter().chain([&self.lasts()]).map(Duration::as_secs_f64).collect();
        gaps.sort_by(f64::total_cmp);
        let allowed = share * gaps.iter().sum::<f64>();
        // Of each gap that is longer than an age, what is beyond it counts.
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
