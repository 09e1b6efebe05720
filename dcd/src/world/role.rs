//! Defines the roles of a process in a world, and the error for what a role does not support.

use std::fmt;

/// The role of a process in a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Role {
    /// The process computes the whole world.
    Local,
    /// The process takes part in a world that others compute, with avatars of its own.
    Client,
    /// The process is a client that may also change what is the world's own, as the server's program may.
    Builder,
    /// The process is a client that also computes regions of the world.
    Participant,
    /// The process serves a world: it decides which node computes which region, and admits processes.
    Server,
    /// The process computes regions of a world for others.
    Node,
}

impl fmt::Display for Role {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str(match self {
            Self::Local => "local world",
            Self::Client => "client",
            Self::Builder => "builder",
            Self::Participant => "participant",
            Self::Server => "server",
            Self::Node => "node",
        })
    }
}

/// The error that the role of a process does not support a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a {role} cannot {what}: {instead}")]
pub struct Unsupported {
    /// The role of the process.
    pub role: Role,
    /// What the role cannot do, as a phrase that follows "cannot".
    pub what: &'static str,
    /// The remedy.
    pub instead: Instead,
}

/// The remedy for a call that a role does not support. Its text names methods of [`World`](super::World); the
/// C API names its own functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Instead {
    /// Compute the world in one process.
    ComputeAlone,
    /// Join as a client, since a server or a node shows nothing of its world.
    JoinAsClient,
    /// Serve the local world.
    Serve,
    /// Make the local world anew that is to be copied.
    MakeSourceAnew,
    /// Move avatars.
    DriveAvatars,
    /// Make the character walk, or insert another one.
    Walk,
    /// Push by avatars.
    PushByAvatars,
    /// Push what a submitted query finds.
    PushFound,
    /// Use this process's own avatars.
    MakeAvatars,
    /// Give an avatar its colliders on insertion, and other bodies theirs in the scene.
    ShapeAtBirth,
    /// Leave the thresholds of sleep at Rapier's defaults.
    UsualSleep,
    /// Put the fixed body into the scene, make a kinematic one, or join as a builder.
    FixedInScene,
    /// Make a velocity-based kinematic avatar.
    KinematicByVelocity,
    /// Put the joints into the scene, or have the server's program or a builder make them.
    JointsInScene,
    /// Tie bodies in the step in which they are inserted.
    TieAtBirth,
    /// Set the velocity, since forces move dynamic bodies only.
    SetVelocity,
    /// Remove the body and insert it as and where it is to be.
    InsertAnew,
    /// Move the body by `set_pose`, `set_velocity` or `push`.
    MoveByName,
    /// Rely on the server's data folder.
    ServerKeeps,
    /// Record the nodes, each from its beginning.
    RecordNodes,
    /// Compare local worlds.
    CompareLocal,
    /// Read contact events.
    HearTouches,
    /// Give the settings to the server when it is made.
    SettingsAtBirth,
    /// Ask a local world of the same cut and coupling.
    LookLocal,
    /// Submit the query.
    SubmitQuery,
    /// Ask the operator of the server for a token.
    AskServer,
    /// Ask a server or a node.
    AskListener,
    /// Set an area of interest.
    SayInterest,
}

impl fmt::Display for Instead {
    fn fmt(&self, to: &mut fmt::Formatter<'_>) -> fmt::Result {
        to.write_str(match self {
            Self::ComputeAlone => "this is for worlds that one process computes alone (World::new)",
            Self::JoinAsClient => {
                "it works for others; join the world as a client (World::connect) to see it and play in it"
            }
            Self::Serve => "it has no network; serve it (World::serve)",
            Self::MakeSourceAnew => "make the world anew with World::new",
            Self::DriveAvatars => "it drives its own avatars by set_velocity and set_pose",
            Self::Walk => {
                "a character obeys set_velocity and goes where it can walk; to have one elsewhere, remove it and insert another"
            }
            Self::PushByAvatars => "it drives its own avatars, which push what they meet (set_velocity)",
            Self::PushFound => "push what a query finds (World::submit, World::push)",
            Self::MakeAvatars => "it has its own avatars (own_avatars) to meet them with",
            Self::ShapeAtBirth => {
                "give an avatar its colliders on insertion, and other bodies theirs in the scene"
            }
            Self::UsualSleep => "leave the thresholds of sleep as Rapier has them",
            Self::FixedInScene => {
                "give the scene the fixed body, make a kinematic one, or join by a token that lets it build (JoinRole::Builder)"
            }
            Self::KinematicByVelocity => "make a velocity-based kinematic one and give it velocities",
            Self::JointsInScene => {
                "joints belong to the scene that the server was given, its program, and who joins by a token that lets it build \
                 (JoinRole::Builder)"
            }
            Self::TieAtBirth => {
                "insert both bodies, or one beside a fixed one, and tie them before the next step"
            }
            Self::SetVelocity => "forces move dynamic bodies only; set its velocity",
            Self::InsertAnew => "remove it and insert it as and where it is to be",
            Self::MoveByName => "set_pose, set_velocity and push do so",
            Self::ServerKeeps => "the server keeps the world in its data folder",
            Self::RecordNodes => {
                "a server, node or participant is recorded from its beginning (ServeConfig::record, JoinConfig::record, --record)"
            }
            Self::CompareLocal => {
                "it hears of bodies at different ticks; compare hashes of local worlds (World::new)"
            }
            Self::HearTouches => "it hears when contacts begin and end (World::events)",
            Self::SettingsAtBirth => "a served world keeps the settings with which its server was made",
            Self::LookLocal => "ask a local world of the same cut and coupling",
            Self::SubmitQuery => {
                "it hears where bodies are and computes nothing; submit what you ask (World::submit)"
            }
            Self::AskServer => {
                "whoever runs the server can: its program by World::token, or `dcd token` beside it"
            }
            Self::AskListener => "a server or a node can",
            Self::SayInterest => "it is seen where its area of interest is (World::set_interest)",
        })
    }
}
