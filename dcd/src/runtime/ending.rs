//! Defines why a link or a connection ended: a code for the program at the other end, a cause for this one's user, words for
//! people.

use std::time::Duration;

use super::ProcessError;
use crate::net::CloseCode;
use crate::protocol::Farewell;

/// How long a client waits for a broken link, if nobody says otherwise. A server that is started again is back by then.
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
    /// The peer dialled again before the former link was found dead, or it is there twice.
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

    /// Returns the close code that is sent to the other end.
    pub(super) fn code(self) -> CloseCode {
        CloseCode(CloseCode::FIRST_FREE + self as u32)
    }

    /// Returns the ending that a close code stands for, if it is one of these.
    pub(super) fn of(code: CloseCode) -> Option<Self> {
        Self::ALL.into_iter().find(|ending| ending.code() == code)
    }

    /// Returns the cause as reported to the user of the connection.
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

    /// Returns a text for people, where there is nothing more to say.
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
    /// For programs.
    pub cause: Cause,
    /// For people.
    pub text: String,
}

/// The reason as one word, for programs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Its process left at its own user's request, or this one did.
    Left,
    /// The server's user disconnected it, or this process.
    SentAway,
    /// Nothing is received from it.
    Broken,
    /// One of the two broke a rule of the protocol, or is not who the other expects.
    Refused,
    /// The world has ended.
    WorldEnded,
    /// A newer link, or another process with the same identity, took its place.
    Replaced,
    /// It reads too slowly.
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

    /// Returns the reason that the end of this process's loop means for its connections.
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
