//! What travels: bodies, shapes, joints and border messages as plain values, and their encoding. Pure; no Rapier.

mod body;
mod border;
mod joint;
mod shape;

pub use body::{
    BodyKind, BodyRecord, BodyState, BodyTraits, ColliderMass, ColliderRecord, CombineRule, ExtraMass,
    Groups, MassRecord, Pose, Velocity, WorldPose,
};
pub use border::{
    BorderMessage, ContactForce, ContactKey, RegionEvents, Replica, SharedState, Touch, Transfer,
};
pub use joint::{JointLimit, JointMotor, JointRecord};
pub use shape::{ShapeHash, ShapeRecord};
