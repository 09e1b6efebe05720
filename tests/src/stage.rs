//! Serves a world that one node computes, and has a client see it through a bad network.

use std::time::{Duration, Instant};

use dcd::MovableBody;
use dcd::network::{JoinConfig, JoinRole, ServeConfig};
use dcd::prelude::*;

use crate::proxy::{Proxy, Weather, free_address};
use crate::truth::{Frame, Seen};

/// How long to wait for what must come.
pub const PATIENCE: Duration = Duration::from_secs(30);

/// A served world that one node computes, and a client that hears of it through a proxy.
pub struct Stage {
    /// The client's world.
    pub client: World,
    /// The server's world.
    pub server: World,
    /// The node's world.
    pub node: World,
    /// The network between the client and the node.
    pub proxy: Proxy,
    /// The world as it began.
    pub local: World,
    _data: tempfile::TempDir,
}

impl Stage {
    /// Serves a copy of a world over this network.
    pub fn of(local: World, weather: Weather) -> Self {
        let data = tempfile::tempdir().unwrap();
        let server = local.serve_copy(ServeConfig::new(data.path())).unwrap();
        let join = |role| crate::served::join(&server, role);
        let (proxy, address) = (Proxy::start(5), free_address());
        let advertise = Some(proxy.front(address));
        let at = JoinConfig { listen: Some(address), advertise, ..join(JoinRole::Node) };
        let node = World::join_as_node(&at).unwrap();
        proxy.set(weather);
        let client = World::connect(&join(JoinRole::Client)).unwrap();
        Self { client, server, node, proxy, local, _data: data }
    }

    /// Waits until the client has heard of this many ticks.
    pub fn wait_ticks(&mut self, ticks: u64) {
        let (first, deadline) = (self.client.tick().0, Instant::now() + PATIENCE);
        while self.client.tick().0 < first + ticks {
            assert!(Instant::now() < deadline, "no {ticks} ticks came");
            self.client.view_time();
            self.client.poll(Duration::from_millis(5));
            self.client.step().unwrap();
        }
    }

    /// Shows this many frames, one per 16 ms.
    pub fn show(&mut self, count: usize) -> Vec<Frame> {
        let mut next = Instant::now();
        (0..count)
            .map(|_| {
                next += Duration::from_millis(16);
                while let Some(left) =
                    next.checked_duration_since(Instant::now()).filter(|left| !left.is_zero())
                {
                    self.client.poll(left);
                    self.client.step().unwrap();
                }
                let time = self.client.view_time();
                let shown = self.client.movable_bodies_at(&time);
                let seen = |body: MovableBody| Seen {
                    id: body.id,
                    told: self.client.pose(body.id).unwrap(),
                    shown: body.pose,
                };
                Frame { at: Instant::now(), time, bodies: shown.map(seen).collect() }
            })
            .collect()
    }
}

/// Returns a network with this delay and jitter each way, milliseconds, and this share of lost packets.
pub fn ms(delay: u64, jitter: u64, loss: f64) -> Weather {
    let ms = Duration::from_millis;
    Weather { delay: ms(delay), jitter: ms(jitter), loss, ..Weather::default() }
}
