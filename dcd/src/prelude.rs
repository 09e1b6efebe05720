//! Re-exports what a program needs to make, step and read a world, with Rapier's own prelude: `use dcd::prelude::*;`.

#[doc(no_inline)]
pub use rapier3d::prelude::*;

#[cfg(feature = "net")]
#[doc(no_inline)]
pub use crate::network::{JoinConfig, JoinRole, ServeConfig};
#[doc(no_inline)]
pub use crate::query::{BodyFilter, WorldRay};
#[doc(no_inline)]
pub use crate::{
    BodyChange, BodyId, BodyKind, Bounds, Character, CharacterMove, ContactHooks, Coupling, Drive, Error,
    HookedPair, JointId, LinkSettings, Params, Partitioning, Role, Scene, Vehicle, VehicleController,
    Velocity, Wheel, World, WorldConfig, WorldPose,
};
