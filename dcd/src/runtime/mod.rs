//! Combines physics, cluster protocol and network into what a program runs: a local world and, with `net`,
//! the loops of a server, a node, a client and a participant.

#[cfg(feature = "net")]
mod acknowledgements;
#[cfg(feature = "net")]
mod bandwidth;
mod choice;
#[cfg(feature = "net")]
mod client;
mod config;
#[cfg(feature = "net")]
mod connections;
mod control;
mod device;
#[cfg(feature = "net")]
mod directory;
mod durable;
#[cfg(feature = "net")]
mod end_request;
#[cfg(feature = "net")]
mod ending;
#[cfg(feature = "net")]
mod error;
#[cfg(feature = "net")]
mod fan_out;
mod hooks;
#[cfg(feature = "net")]
mod inbox;
mod joint_strength;
mod joint_watch;
#[cfg(feature = "net")]
mod links;
mod local;
#[cfg(feature = "net")]
mod log;
pub mod measure;
#[cfg(feature = "net")]
mod member;
#[cfg(feature = "net")]
mod metrics;
#[cfg(feature = "net")]
mod origin;
#[cfg(feature = "net")]
mod pulse;
mod recorded;
mod recording;
#[cfg(feature = "net")]
mod repeats;
mod replays;
#[cfg(feature = "net")]
mod saved;
#[cfg(feature = "net")]
mod serve_config;
#[cfg(feature = "net")]
mod server;
mod snapshot;
mod stats;
#[cfg(feature = "net")]
mod status;
mod tape;
#[cfg(feature = "net")]
mod waiting;

#[cfg(feature = "net")]
pub use bandwidth::{Bandwidth, Count, Received};
pub use choice::{Choice, Why};
#[cfg(feature = "net")]
pub use client::{ClientEvents, ClientWorld, JoinConfig};
#[cfg(feature = "net")]
pub(crate) use config::check_speed;
pub use config::{Partitioning, WorldConfig, WorldError};
#[cfg(feature = "net")]
pub use connections::{
    Connection, ConnectionChange, ConnectionError, ConnectionEvent, ConnectionId, Connections, Delivery,
    ProgramMessage,
};
pub use device::{DeviceError, PhysicsDevice};
#[cfg(feature = "net")]
pub use directory::RedbDirectory;
#[cfg(feature = "cli")]
pub(crate) use directory::{is_served, is_standby, is_there};
pub(crate) use durable::replace_file;
#[cfg(feature = "net")]
pub use end_request::{WorldEnd, end_world};
#[cfg(feature = "net")]
pub use ending::{Cause, Reason};
#[cfg(feature = "net")]
pub use error::ProcessError;
pub use joint_strength::JointOverload;
pub use local::LocalWorld;
#[cfg(feature = "net")]
pub use member::{Member, MemberConfig, NodeSummary, Onlooker, Presence};
#[cfg(feature = "net")]
pub(crate) use origin::Beginning;
#[cfg(feature = "net")]
pub use origin::Origin;
#[cfg(feature = "net")]
pub use pulse::Pulse;
pub use replays::{MakePhysics, last_recorded_tick, open_recording, replayed_regions};
#[cfg(feature = "net")]
pub use serve_config::{GroupConfig, ServeConfig};
#[cfg(feature = "net")]
pub(crate) use server::SUSPENDED;
#[cfg(feature = "net")]
pub use server::{ServerProcess, ServerSummary};
pub use snapshot::{Checkpoint, SnapshotError};
pub use stats::Stats;
#[cfg(feature = "net")]
pub use status::StatusLink;
#[cfg(feature = "cli")]
pub(crate) use waiting::{Waiting, is_waiting};
