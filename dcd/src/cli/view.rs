//! Opens the viewer of a subcommand and prints its URL; shows a served world as a client of it.

use std::net::{IpAddr, Ipv4Addr, SocketAddr};

use super::common::Common;
use super::failure::Failure;
use crate::Viewer;
use crate::runtime::{ClientWorld, JoinConfig};

/// The address of `--view` where none is given: any free port of this machine.
pub(super) const ANY_PORT: &str = "127.0.0.1:0";

/// Opens a viewer, and prints its URL on standard error, even with `--quiet`: nobody could open the page
/// otherwise.
pub(super) fn open(address: SocketAddr, name: &str, common: &Common) -> Result<Viewer, Failure> {
    let viewer = Viewer::open(address, name).map_err(|error| Failure::usage(error.to_string()))?;
    common.tell(&format!("view {}", viewer.url()));
    Ok(viewer)
}

/// A client without avatars, whose world a viewer shows.
pub(super) struct Onlooker {
    viewer: Viewer,
    world: ClientWorld,
}

impl Onlooker {
    /// Joins the world of a server of this process. `token` is for this client alone.
    pub(super) fn join(
        view: SocketAddr,
        server: SocketAddr,
        token: String,
        common: &Common,
    ) -> Result<Self, Failure> {
        let viewer = open(view, &format!("the world of {server}"), common)?;
        let ip = if server.ip().is_unspecified() { IpAddr::V4(Ipv4Addr::LOCALHOST) } else { server.ip() };
        let join = JoinConfig::new(SocketAddr::new(ip, server.port()), token);
        Ok(Self { viewer, world: ClientWorld::connect(&join)? })
    }

    /// Shows the world as the client knows it now.
    pub(super) fn look(&mut self) {
        let events = self.world.take_events();
        self.viewer.show_client(&mut self.world, &events.handovers);
    }
}
