//! Why a process ends a link: a code for the program at the other end, words for people.

use crate::net::CloseCode;
use crate::protocol::Farewell;
use crate::runtime::connections::{Cause, Reason};

/// Why a link is ended on purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::runtime) enum Ending {
    /// A node goes by its own wish.
    Left,
    /// The server's user does not want the process.
    SentAway,
    /// The server cannot have the process in its world.
    Refused,
    /// The world has ended.
    WorldEnded,
    /// The peer takes in too little; it may call again.
    TooSlow,
    /// The peer called again, before the former link was found dead, or it is there twice.
    Superseded,
    /// A node is not in the other's group any more.
    NotAMember,
    /// A node does not lead the client's group any more.
    NotTheLeader,
    /// The peer sent what it may not.
    BrokeRule,
}

impl Ending {
    const ALL: [Self; 9] = [
        Self::Left,
        Self::SentAway,
        Self::Refused,
        Self::WorldEnded,
        Self::TooSlow,
        Self::Superseded,
        Self::NotAMember,
        Self::NotTheLeader,
        Self::BrokeRule,
    ];

    /// What the other end is told.
    pub(in crate::runtime) fn code(self) -> CloseCode {
        CloseCode(CloseCode::FIRST_FREE + self as u32)
    }

    /// What a code says, if it is one of these.
    pub(in crate::runtime) fn of(code: CloseCode) -> Option<Self> {
        Self::ALL.into_iter().find(|ending| ending.code() == code)
    }

    /// What it means to the user of the connection.
    pub(in crate::runtime) fn cause(self) -> Cause {
        match self {
            Self::Left => Cause::Left,
            Self::SentAway => Cause::SentAway,
            Self::Refused | Self::BrokeRule => Cause::Refused,
            Self::WorldEnded => Cause::WorldEnded,
            Self::TooSlow => Cause::Slow,
            Self::Superseded => Cause::Replaced,
            Self::NotAMember | Self::NotTheLeader => Cause::Unneeded,
        }
    }

    /// The same for people, where there is nothing more to say.
    pub(in crate::runtime) fn words(self) -> &'static str {
        match self {
            Self::Left => "it has left",
            Self::SentAway => "the server sent it away",
            Self::Refused => "the server does not take it",
            Self::WorldEnded => "the world has ended",
            Self::TooSlow => "the peer reads too slowly; call again",
            Self::Superseded => "a newer link of the same peer took its place",
            Self::NotAMember => "no longer a member",
            Self::NotTheLeader => "no longer the leader",
            Self::BrokeRule => "it sent what it may not",
        }
    }

    /// Both.
    pub(in crate::runtime) fn reason(self) -> Reason {
        Reason::new(self.cause(), self.words())
    }
}

impl From<Farewell> for Ending {
    fn from(farewell: Farewell) -> Self {
        match farewell {
            Farewell::Left => Self::Left,
            Farewell::SentAway => Self::SentAway,
            Farewell::Refused => Self::Refused,
            Farewell::Ended => Self::WorldEnded,
        }
    }
}
