//! Defines the roles of a process in a world, and the error for what a role cannot do.

use std::fmt;

/// The role of a process in a world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Role {
    /// It computes the whole world.
    Local,
    /// It plays in a world that others compute, with avatars of its own.
    Client,
    /// It plays in a world as a client does, and may change what is the world's own, as its server's program does.
    Builder,
    /// It plays in a world and computes regions of it.
    Participant,
    /// It serves a world: it decides which node computes which region, and admits processes.
    Server,
    /// It computes regions of a world for others.
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

/// The error that a role cannot do what was asked of it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a {role} cannot {what}: {instead}")]
pub struct Unsupported {
    /// The role that cannot do it.
    pub role: Role,
    /// What it cannot do, after "cannot".
    pub what: &'static str,
    /// What to do instead.
    pub instead: Instead,
}

/// The remedy for what a role cannot do. Its text names methods of [`World`](super::World); the C API names its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Instead {
    /// Compute the world in one process.
    ComputeAlone,
    /// Join as a client: a server or a node shows nothing of its world.
    JoinAsClient,
    /// Serve the local world.
    Serve,
    /// Make the local world to be copied anew.
    MakeSourceAnew,
    /// Move avatars.
    DriveAvatars,
    /// Push by avatars.
    PushByAvatars,
    /// Push what a submitted query finds.
    PushFound,
    /// Make avatars of one's own.
    MakeAvatars,
    /// Give an avatar its colliders at birth.
    ShapeAtBirth,
    /// Leave thresholds of sleep as they are.
    UsualSleep,
    /// Give the scene the fixed body, or make a kinematic one.
    FixedInScene,
    /// Make a velocity-based kinematic avatar.
    KinematicByVelocity,
    /// Give the scene the joints.
    JointsInScene,
    /// Tie bodies in the step in which they are inserted.
    TieAtBirth,
    /// Set the velocity of a body that forces do not move.
    SetVelocity,
    /// Insert a body anew as and where it is to be.
    InsertAnew,
    /// Move a body by the methods that do so.
    MoveByName,
    /// Rely on the server's data folder.
    ServerKeeps,
    /// Record nodes from their beginning.
    RecordNodes,
    /// Compare local worlds.
    CompareLocal,
    /// Listen to contact events.
    HearTouches,
    /// Give the server the settings with its scene.
    SettingsAtBirth,
    /// Look at a local world of the same cut and coupling.
    LookLocal,
    /// Submit the question.
    SubmitQuery,
    /// Ask who runs the server for a token.
    AskServer,
    /// Ask a server or a node.
    AskListener,
    /// Say what is of interest.
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
                "its nodes are recorded, each from its beginning (JoinConfig::record, or `dcd node --record`)"
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
