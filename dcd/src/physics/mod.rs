//! Computes a world as many Rapier worlds, one per region: bodies and their ghosts, coupling across borders, contacts, queries.

mod alter;
mod articulation;
mod audit;
mod choice;
mod collider_id;
mod contact_listener;
mod control;
mod convert;
mod coupling;
mod dispatcher;
mod extent;
mod forces;
mod hits;
mod hook_tape;
mod hooks;
mod host;
mod impulse;
mod joints;
mod measure;
mod outbox;
mod outline;
mod owner_index;
mod partition;
mod placement;
mod query;
mod rank_remap;
mod record;
mod region;
mod settings;
mod shapes;
mod small_world;
mod spread;
mod statics;
#[cfg(feature = "net")]
mod trial;

pub use crate::protocol::Handover;
pub use articulation::LinkSettings;
#[cfg(feature = "models")]
pub(crate) use articulation::link_fault;
#[cfg(feature = "net")]
pub(crate) use articulation::set_motions;
pub(crate) use articulation::{equip_link, insert_link, motion_of};
pub use choice::{CouplingChoice, Method};
pub use collider_id::ColliderId;
pub use control::{
    CharacterHit, CharacterMove, CharacterState, ControlError, Ground, VehicleController, WheelState,
};
pub use extent::BodyExtent;
pub use forces::{Explosion, Fluid};
pub(crate) use hits::Hits;
pub(crate) use hook_tape::{NotedHooks, RepeatedHooks};
pub use hooks::{ContactHooks, HookedPair};
pub(crate) use host::Checkpoint;
pub use host::{BorderView, HostError, Inconsistency, RegionHost, Tasks};
pub use joints::joint_record;
pub(crate) use measure::drawn_force_n;
pub use measure::{Census, ContactPoint, ContactSample, Measured, View};
pub use partition::Partition;
pub use query::{BodyFilter, PointHit, Queries, QueryError, RayHit, ShapeHit, WorldMotion, WorldRay};
#[cfg(feature = "net")]
pub(crate) use record::hangs;
pub use region::{Ownership, Profile, Region};
pub use settings::{Coupling, Preset, StepSettings};
pub(crate) use shapes::can_build;
pub use shapes::{ShapeError, ShapeLibrary, convex_hull};
#[cfg(feature = "net")]
pub(crate) use trial::{try_on_body, try_on_collider, try_on_joint};
