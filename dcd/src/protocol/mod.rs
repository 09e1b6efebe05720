//! Defines everything that is sent: bodies, shapes, joints and border messages as plain values, and their
//! encoding. Pure; no Rapier.

mod alteration;
pub(crate) mod assembly;
mod body;
mod border;
mod character;
mod codec;
mod contacts;
mod controller;
mod hash;
mod hook_answer;
mod joint;
pub mod link;
mod messages;
mod shape;
mod step;
mod validate;
mod vehicle;

pub use alteration::Alteration;
pub use body::{
    BodyKind, BodyRecord, BodyState, BodyTraits, ColliderMass, ColliderRecord, CombineRule, ContactOffset,
    ExtraMass, Groups, Impulse, MassRecord, Pose, Velocity, WorldPose,
};
pub use border::{
    BIG_ISLAND, BorderMessage, ContactForce, ContactKey, ContactPose, CopyState, Handover, IslandPart,
    Membership, NearbyBodies, NearbyBody, RegionEvents, SharedState, Strike, Touch, Transfer,
};
pub use character::{Character, Gait};
#[cfg(all(feature = "net", feature = "physics"))]
pub(crate) use codec::begins_as_heard;
pub(crate) use codec::most_items;
pub use codec::{
    CHUNK_BYTES, CodecError, DATAGRAM_BYTES, MAX_MESSAGE_BYTES, STATES_BYTES, VERSION, chunks, datagrams,
    decode, decode_value, encode, encode_value, encoded_len, split,
};
#[cfg(feature = "physics")]
pub(crate) use codec::{read_state, write_state};
pub use contacts::{ContactLedger, WorldEvents};
pub use controller::Controller;
pub use hash::StateHasher;
pub use hook_answer::{HookAnswer, HookCall, HookQuestion};
pub use joint::{JointLimit, JointMotor, JointRecord, LinkMotion, LinkRecord};
pub(crate) use messages::BUILD_BYTES;
pub use messages::{
    Answer, Area, BodyCheckpoint, Border, BuildOp, CastAnswer, CastQuery, Chunk, Claim, Costs, Delay,
    DelayThresholds, Dispatch, Done, EnvironmentProperties, Farewell, FilterRecord, Finding, FromClient,
    GroupStatus, Heard, HeardBorder, Hello, Hindrance, Input, JoinAs, Lane, LoadReport, MAX_BUILD_OPS,
    MAX_COST, MAX_FOUND, MAX_HEARD, MAX_INTRODUCED, MAX_OPEN_COST, MAX_OPEN_QUERIES, MAX_QUERY_BYTES,
    MAX_TURN, MAX_TURNING_M, Member, Message, Motion, NodeStatus, OVERLAPS_COST, Overlap, OverlapQuery, Pace,
    Part, PartFilter, Ping, Place, Placed, Pong, Program, Push, Query, QueryParts, QueryResult, RayAnswer,
    RayQuery, Refusal, RegionLoad, RegionStatus, RelayNews, Repartition, Report, SHAPE_COST, Stamp, Stance,
    Status, Subject, SyncProtocol, Testimony, Thresholds, ToClient, ToNode, ToRelay, ToServer, Verified,
    View, ViewNumber, Watch, WorldOp,
};
#[cfg(feature = "physics")]
pub(crate) use shape::voxels_fit;
pub use shape::{ShapeHash, ShapeRecord};
pub use step::{Coupling, SettingFault, StepRecord};
pub use validate::{
    Check, Invalid, MAX_COLLIDERS, MAX_DEPTH, MAX_LAG, MAX_ROUNDS, MAX_STATE_TICKS, PROGRAM_DATAGRAM_BYTES,
    PROGRAM_MESSAGE_BYTES, SHAPE_LEAST_M, SHAPE_REACH_M, WORLD_REACH_M,
};
pub use vehicle::{Drive, MAX_WHEELS, Vehicle, Wheel};
