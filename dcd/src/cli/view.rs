//! Opens the viewer of a subcommand, and says where.

use std::net::SocketAddr;

use super::common::Common;
use super::failure::Failure;
use crate::Viewer;

/// Where `--view` without an address shows the world.
pub(super) const ANY_PORT: &str = "127.0.0.1:0";

/// Opens a viewer whose page may pause the world and step it.
pub(super) fn open(address: SocketAddr, name: &str, common: &Common) -> Result<Viewer, Failure> {
    Ok(look_on(address, name, common)?.with_controls())
}

/// Opens a viewer of a world that goes its own pace.
pub(super) fn look_on(address: SocketAddr, name: &str, common: &Common) -> Result<Viewer, Failure> {
    let viewer = Viewer::open(address, name).map_err(|error| Failure::usage(error.to_string()))?;
    common.say(&format!("view {}", viewer.url()));
    Ok(viewer)
}
