//! Computes one rigid-body world by many [Rapier](https://rapier.rs) worlds: one per region of space, on the cores of one machine
//! or on many machines. Every movable body has exactly one owner; contacts and joints hold across the borders of regions.
//!
//! ```
//! use dcd::prelude::*;
//!
//! # fn main() -> Result<(), Error> {
//! let mut world = World::new(WorldConfig { partitioning: Partitioning::Regions(4), ..WorldConfig::default() })?;
//! world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(50.0, 0.5, 50.0))?;
//! let ball = world.insert(
//!     RigidBodyBuilder::dynamic().translation(Vector::new(0.0, 5.0, 0.0)),
//!     ColliderBuilder::ball(0.5),
//! )?;
//! for _ in 0..180 {
//!     world.step()?;
//! }
//! assert!((world.pose(ball).unwrap().translation[1] - 1.0).abs() < 0.01);
//! # Ok(())
//! # }
//! ```
//!
//! - [`World`] is the interface for every role of a process: a local world, or a client, builder,
//!   participant, server or node of a served one.
//! - [`manual`] explains concepts, how to choose a coupling, serving, and limits. The crate's `examples/` are
//!   programs to start from.
//! - [`query`] holds ray casts, shape casts, projections and overlaps. [`network`] holds what a process needs
//!   to join and serve worlds. [`error`] holds the error types that [`Error`] wraps.
//!
//! | feature | gives | by default |
//! |---|---|---|
//! | `physics` | [`World`], scenes | yes |
//! | `parallel` | Rapier's parallel solver inside a region: one region uses all threads, with bit-identical results | yes |
//! | `net` | served worlds: QUIC, TLS, join tokens | yes |
//! | `models` | scenes from MJCF and URDF files | no |
//! | `view` | the viewer in the browser, `Viewer` | no |
//! | `cli` | the program `dcd`; implies all features above and `sim` | no |
//! | `etcd` | standby servers, with the world kept in an etcd cluster | no |
//! | `sim` | a simulator that runs whole clusters in one thread from one seed, to test protocols under faults | no |
//! | `validate` | panics where `World::validate` finds something after any tick; for tests | no |
//! | `profiler` | the times of Rapier's phases, in [`World::profile`] | no |
//! | `enhanced-determinism` | equal bits on unlike machines; costs 3 to 10 % of the speed | no |
#![forbid(unsafe_code)]

/// The version of Rapier that computes the regions. Use this re-export, so that the types of your builders
/// match.
#[cfg(feature = "physics")]
pub use rapier3d;

#[cfg(feature = "physics")]
mod drawing;
pub mod manual;
#[cfg(feature = "physics")]
pub mod prelude;
#[cfg(feature = "view")]
mod view;
#[cfg(feature = "physics")]
mod world;

// Internal modules, without any promise of stability. They are public for the tests, the benches and the C
// API of this workspace.
#[doc(hidden)]
pub mod cluster;
#[doc(hidden)]
pub mod delta;
#[doc(hidden)]
pub mod fidelity;
#[doc(hidden)]
pub mod playback;
#[doc(hidden)]
pub mod protocol;
#[doc(hidden)]
pub mod recording;
#[doc(hidden)]
pub mod space;

#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
#[cfg(all(feature = "net", feature = "physics"))]
mod http;
#[cfg(all(feature = "net", feature = "physics"))]
mod metrics;
#[cfg(feature = "net")]
#[doc(hidden)]
pub mod net;
#[cfg(feature = "physics")]
#[doc(hidden)]
pub mod physics;
#[cfg(all(feature = "net", feature = "physics"))]
mod prediction;
#[cfg(feature = "net")]
mod priority;
#[cfg(feature = "physics")]
#[doc(hidden)]
pub mod runtime;
#[cfg(feature = "physics")]
#[doc(hidden)]
pub mod scene;
#[cfg(any(test, feature = "sim"))]
#[doc(hidden)]
pub mod sim;

#[cfg(feature = "physics")]
pub use drawing::{DebugDraw, DebugDrawFlags, DebugDrawSettings, DebugShape};
#[cfg(feature = "physics")]
pub use fidelity::{Fidelity, FidelityReport};
#[cfg(feature = "physics")]
pub use physics::{
    BodyExtent, BorderView, CharacterHit, CharacterMove, CharacterState, ColliderId, ContactHooks,
    ContactPoint, Coupling, Explosion, Fluid, Ground, HookedPair, Inconsistency, LinkSettings, Preset,
    Profile, StepSettings, Tasks, VehicleController, WheelState,
};
#[cfg(feature = "physics")]
pub use playback::ViewTime;
#[cfg(feature = "physics")]
pub use protocol::Area;
pub use protocol::{
    BodyKind, BodyRecord, BodyState, BodyTraits, Character, ContactForce, ContactKey, Costs, Drive, Gait,
    Handover, JointRecord, LinkMotion, Push, Refusal, Touch, Vehicle, Velocity, Wheel, WorldEvents,
    WorldPose,
};
#[cfg(feature = "physics")]
pub use runtime::{Checkpoint, Choice, JointOverload, Partitioning, Stats, Why, WorldConfig};
#[cfg(feature = "physics")]
pub use scene::{Params, Scene};
pub use space::{
    Axis, Balance, BodyId, Bounds, Cell, ClientId, Epoch, JointId, NodeId, RegionId, Tick, Viewpoint,
};
#[cfg(feature = "view")]
#[doc(hidden)]
pub use view::read_browser;
#[cfg(feature = "view")]
pub use view::{ViewError, Viewer};
#[cfg(feature = "physics")]
pub use world::{Body, BodyChange, Error, Instead, MovableBody, Owner, RegionInfo, Role, Unsupported, World};

/// Spatial queries: ray casts, shape casts, point projections and overlaps. A local world answers at once, a
/// served one some ticks later.
#[cfg(feature = "physics")]
pub mod query {
    pub use crate::physics::{BodyFilter, PointHit, Queries, RayHit, ShapeHit, WorldMotion, WorldRay};
    pub use crate::protocol::{
        CastAnswer, CastQuery, FilterRecord, Overlap, OverlapQuery, PartFilter, Place, Query, QueryParts,
        QueryResult, RayAnswer, RayQuery, ShapeHash, ShapeRecord,
    };
}

/// Settings and types to join and serve worlds, and to pass messages between programs.
#[cfg(feature = "net")]
pub mod network {
    #[cfg(feature = "physics")]
    pub use crate::cluster::{GroupPolicy, Grouping, PollRules};
    pub use crate::net::{JoinRole, PeerName, PeerStats};
    #[cfg(feature = "physics")]
    pub use crate::prediction::Prediction;
    #[cfg(feature = "physics")]
    pub use crate::protocol::{DelayThresholds, Pace, Thresholds};
    #[cfg(feature = "physics")]
    pub use crate::runtime::{
        Cause, Connection, ConnectionChange, ConnectionEvent, ConnectionId, Delivery, GroupConfig,
        JoinConfig, ProgramMessage, Reason, ServeConfig,
    };
    #[cfg(feature = "physics")]
    pub use crate::world::Arrivals;
}

/// The error types that [`Error`] wraps.
#[cfg(feature = "physics")]
pub mod error {
    pub use crate::drawing::GltfError;
    pub use crate::physics::{ControlError, HostError, QueryError, ShapeError};
    pub use crate::recording::RecordingError;
    #[cfg(feature = "net")]
    pub use crate::runtime::{ConnectionError, ProcessError};
    pub use crate::runtime::{SnapshotError, WorldError};
    pub use crate::scene::SceneError;
    pub use crate::space::TreeError;
}

/// Runs the Rust code of the README.
#[cfg(all(doctest, feature = "physics"))]
#[doc = include_str!("../../README.md")]
struct Readme;
