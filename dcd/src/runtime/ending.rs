//! Defines why a link or a connection ended: a close code for the program at the other end, a cause for this
//! process's user, and a text for people.

use std::time::Duration;

use super::ProcessError;
use crate::net::CloseCode;
use crate::protocol::Farewell;

/// The time that a client waits for a broken link by default. A server that is started again is back by then, and
/// without the client the world goes on.
pub(super) const GIVE_UP: Duration = Duration::from_secs(30);

/// The reason for which a link is ended on purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    /// A node leaves at its own user's request.
    Left,
    /// The server's user disconnects the process.
    SentAway,
    /// The server cannot accept the process in its world.
    Refused,
    /// The world has ended.
    WorldEnded,
    /// The peer takes in too little; it may dial again.
    TooSlow,
    /// The peer dialled again before its former link was found dead, or two processes use its identity.
    Superseded,
    /// The node is not in the other node's group any more.
    NotAMember,
    /// The node does not lead the client's group any more.
    NotTheLeader,
    /// The peer sent what it must not send.
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

    /// Returns the close code that is sent to the other end.
    pub(super) fn code(self) -> CloseCode {
        CloseCode(CloseCode::FIRST_FREE + self as u32)
    }

    /// Returns the ending that a close code stands for, if it is one of these.
    pub(super) fn of(code: CloseCode) -> Option<Self> {
        Self::ALL.into_iter().find(|ending| ending.code() == code)
    }

    /// Returns the cause that is reported to the user of the connection.
    pub(super) fn cause(self) -> Cause {
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

    /// Returns a text for people, for an ending that needs no further explanation.
    pub(super) fn words(self) -> &'static str {
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

    /// Returns cause and text together.
    pub(super) fn reason(self) -> Reason {
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

/// The reason for which a connection is lost or gone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Reason {
    /// The cause, for programs.
    pub cause: Cause,
    /// The text, for people.
    pub text: String,
}

/// The reason as one word, for programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The process at the other end left at its own user's request, or this process did.
    Left,
    /// The server's user disconnected the process at the other end, or this process.
    SentAway,
    /// Nothing is received from the other end.
    Broken,
    /// One of the two ends broke a rule of the protocol, or is not the process that the other expects.
    Refused,
    /// The world has ended.
    WorldEnded,
    /// A newer link, or another process with the same identity, took the connection's place.
    Replaced,
    /// The other end reads too slowly.
    Slow,
    /// The connection is no longer needed: the node left the group, or does not lead it any more.
    Unneeded,
    /// A fault ended this process's part in the world.
    Failed,
}

impl Reason {
    pub(super) fn new(cause: Cause, text: impl Into<String>) -> Self {
        Self { cause, text: text.into() }
    }

    /// Returns the reason that the end of this process's loop gives for the end of its connections.
    pub(super) fn of_end(end: &Result<(), ProcessError>) -> Self {
        let cause = match end {
            Ok(()) => return Self::new(Cause::Left, "this process has left"),
            Err(ProcessError::ServerGone { .. }) => Cause::Refused,
            Err(ProcessError::GivenUp { .. } | ProcessError::LeaderUnreachable { .. }) => Cause::Broken,
            Err(ProcessError::Superseded { .. }) => Cause::Replaced,
            Err(ProcessError::Evicted { .. } | ProcessError::SentAway { .. }) => Cause::SentAway,
            Err(ProcessError::NotReleased { .. }) => Cause::Left,
            Err(_) => Cause::Failed,
        };
        Self::new(cause, end.as_ref().err().map_or(String::new(), ToString::to_string))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_calls_again_is_told_by_the_network_what_a_link_would_have_told() {
        assert_eq!(Ending::SentAway.code(), CloseCode::SENT_AWAY);
        assert_eq!(Ending::ALL.map(|ending| Ending::of(ending.code())), Ending::ALL.map(Some));
    }
}
