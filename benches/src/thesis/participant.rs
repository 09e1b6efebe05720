//! Runs a participant of the thesis's test application, which computes a region of the world and steers its
//! one avatar. It runs as a process of its own, and says at the end what a tick cost it.

use std::error::Error;
use std::net::SocketAddr;
use std::time::{Duration, Instant};

use clap::Args;
use dcd::protocol::{Area, Velocity, WorldPose};
use dcd::rapier3d::prelude::*;
use dcd::runtime::{ClientWorld, JoinConfig};
use serde::{Deserialize, Serialize};

use crate::timing::cpu_ms;

/// Ticks before the measurement begins: by then avatars and links are there.
const WARM_UP: u64 = 60;
const LIMIT: Duration = Duration::from_secs(120);

/// Joins a server's world as a participant: started by `thesis`.
#[derive(Args)]
pub(crate) struct ThesisParticipant {
    #[arg(long)]
    server: SocketAddr,
    #[arg(long)]
    token: String,
    /// The place where its avatar begins, metres.
    #[arg(long, num_args = 3, allow_negative_numbers = true)]
    at: Vec<f64>,
}

/// The report of a participant when the world has ended.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Report {
    pub(super) node: u32,
    pub(super) ticks: u64,
    /// Milliseconds per tick: processor time of all threads, and wall time.
    pub(super) cpu_ms: f64,
    pub(super) wall_ms: f64,
    /// Messages and bytes sent per tick.
    pub(super) messages: f64,
    pub(super) bytes: f64,
    /// Copies of other regions' bodies, and exchanges, means per tick.
    pub(super) ghosts: f64,
    pub(super) exchanges: f64,
    /// The largest disagreement of copies, m/s.
    pub(super) disagreement_m_s: f32,
}

/// The processor time and traffic used up to a tick.
#[derive(Clone, Copy)]
struct Reading {
    tick: u64,
    cpu_ms: f64,
    at: Instant,
    messages: u64,
    bytes: u64,
}

impl Reading {
    fn now(world: &ClientWorld) -> Self {
        let traffic = world.traffic();
        Self {
            tick: world.tick().0,
            cpu_ms: cpu_ms(),
            at: Instant::now(),
            messages: traffic.frames_out + traffic.datagrams_out,
            bytes: traffic.bytes_out,
        }
    }
}

impl ThesisParticipant {
    pub(crate) fn run(self) -> Result<(), Box<dyn Error>> {
        let config = JoinConfig { timeout: LIMIT, ..JoinConfig::new(self.server, self.token) };
        let mut world = ClientWorld::participate(&config)?;
        let place = [self.at[0], self.at[1], self.at[2]];
        // It shows what is around its avatar.
        world.turn_to(Some(Area::around_avatar(place)))?;
        let body = RigidBodyBuilder::dynamic().gravity_scale(0.0).build();
        let cube = ColliderBuilder::cuboid(0.5, 0.5, 0.5).restitution(1.0).friction(0.0);
        let avatar = world.spawn(WorldPose::at(place), &body, &[cube])?;
        let (mut first, mut last) = (None, Reading::now(&world));
        let mut seen = world.updates();
        while world.check().is_ok() {
            if !world.wait_update(seen, LIMIT) {
                break;
            }
            seen = world.updates();
            let turn = world.tick().0 as f32 / 60.0;
            let velocity = Velocity { linear: [turn.cos(), 0.0, turn.sin()], ..Velocity::default() };
            world.send_input(avatar, velocity, None)?;
            let now = Reading::now(&world);
            if now.tick >= WARM_UP {
                first.get_or_insert(now);
                last = now;
            }
        }
        let node = world.node().ok_or("a participant is a node")?.0;
        let summary = world.summary();
        let first = first.ok_or("the world ended before it had begun")?;
        let ticks = last.tick.saturating_sub(first.tick).max(1);
        let per_tick = |value: f64| value / ticks as f64;
        let report = Report {
            node,
            ticks,
            cpu_ms: per_tick(last.cpu_ms - first.cpu_ms),
            wall_ms: per_tick((last.at - first.at).as_secs_f64() * 1e3),
            messages: per_tick((last.messages - first.messages) as f64),
            bytes: per_tick((last.bytes - first.bytes) as f64),
            ghosts: summary.ghosts_sum as f64 / summary.tick.0.max(1) as f64,
            exchanges: summary.exchanges_sum as f64 / summary.tick.0.max(1) as f64,
            disagreement_m_s: summary.disagreement_max_m_s,
        };
        println!("{}", serde_json::to_string(&report)?);
        Ok(())
    }
}
