//! What travels: bodies, shapes, joints and border messages as plain values, and their encoding. Pure; no Rapier.

mod body;
mod border;
mod contacts;
mod hash;
mod joint;
mod shape;

pub use body::{
    BodyKind, BodyRecord, BodyState, BodyTraits, ColliderMass, ColliderRecord, CombineRule, ExtraMass,
    Groups, MassRecord, Pose, Velocity, WorldPose,
};
pub use border::{BorderMessage, ContactForce, ContactKey, RegionEvents, SharedState, Touch, Transfer};
pub use contacts::{ContactLedger, WorldEvents};
pub use hash::StateHasher;
pub use joint::{JointLimit, JointMotor, JointRecord};
pub use shape::{ShapeHash, ShapeRecord};
