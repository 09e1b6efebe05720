//! Implements votes on the membership of groups while the world runs: inclusion and rejection by delay
//! (thesis 3.3.9, 4.3.1.5, 4.3.2.7).
//!
//! Every node monitors its delays to the others ([`DelayMonitor`]) and calls for a vote. The server opens a
//! poll or refuses ([`Polls`]). Members answer by the delay that they measure ([`VoteThresholds::ballot`]),
//! and the motion passes or not ([`Motion::passes`]). A node that is voted out becomes a group of one.
//!
//! Several rules prevent flapping. At the nodes they are the gap between the thresholds, and three strikes
//! before a vote. On the server they are one vote at a time for all nodes concerned, rests, a cap, and a stay
//! that grows with each eviction.

mod delay_monitor;
#[cfg(test)]
mod flapping;
mod polls;
#[cfg(test)]
mod tests;

use crate::protocol::{DelayThresholds, Motion};
use crate::space::NodeId;

pub use self::delay_monitor::{DelayMonitor, DelayRules};
pub use self::polls::{Call, Outcome, PollCounts, PollRules, Polls, VoteRefusal};

/// The delay thresholds of votes: round trips in milliseconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoteThresholds {
    /// The average delay below which a node belongs in the group.
    pub inclusion_ms: f64,
    /// The average delay above which a node does not belong in the group.
    pub rejection_ms: f64,
    /// How far the latest round trip may exceed `rejection_ms` while the average is good.
    pub deviation_ms: f64,
}

/// An error in the settings of votes: they cannot be followed.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum VoteError {
    /// The thresholds are not positive and finite, or inclusion is not below rejection.
    #[error(
        "inclusion below {inclusion_ms} ms and rejection above {rejection_ms} ms: inclusion must be positive and \
         less than rejection, or nodes come and go for ever"
    )]
    Thresholds {
        /// The given `inclusion_ms`.
        inclusion_ms: f64,
        /// The given `rejection_ms`.
        rejection_ms: f64,
    },
    /// The tolerated deviation is not a finite number of at least 0. It holds the given one, in milliseconds.
    #[error("a tolerated deviation of {0} ms: give 0 or more")]
    Deviation(f64),
    /// The number of strikes is 0.
    #[error("a vote after 0 strikes: let there be at least 1")]
    NoStrikes,
    /// The cap allows no votes, or its window is empty.
    #[error("at most {max_votes} votes in {window:?}: both must be more than nothing")]
    NoVotes {
        /// The given `max_votes`.
        max_votes: usize,
        /// The given `window`.
        window: std::time::Duration,
    },
}

/// A node's measured delay to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PeerDelay {
    /// Nothing has been measured yet.
    Unknown,
    /// The average of the last round trips, in milliseconds.
    AverageMs(f64),
    /// The other node does not answer.
    Unreachable,
}

/// A member's vote on a candidate, for both kinds of motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Ballot {
    /// The candidate shall be in the group: yes to inclusion, no to rejection.
    Include,
    /// The member is undecided.
    Abstain,
    /// The candidate shall not be in the group: no to inclusion, yes to rejection.
    Reject,
}

/// The counts of the ballots of a vote.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// The number of ballots to include; I in the thesis.
    pub include: u32,
    /// The number of abstentions; A in the thesis.
    pub abstain: u32,
    /// The number of ballots to reject; R in the thesis.
    pub reject: u32,
}

impl From<DelayThresholds> for VoteThresholds {
    fn from(thresholds: DelayThresholds) -> Self {
        let DelayThresholds { inclusion_ms, rejection_ms, deviation_ms } = thresholds;
        let [inclusion_ms, rejection_ms, deviation_ms] =
            [inclusion_ms, rejection_ms, deviation_ms].map(f64::from);
        Self { inclusion_ms, rejection_ms, deviation_ms }
    }
}

impl VoteThresholds {
    /// Returns the thresholds, if they can be followed.
    pub fn checked(self) -> Result<Self, VoteError> {
        let Self { inclusion_ms, rejection_ms, deviation_ms } = self;
        if !(inclusion_ms > 0.0 && inclusion_ms < rejection_ms && rejection_ms.is_finite()) {
            return Err(VoteError::Thresholds { inclusion_ms, rejection_ms });
        }
        if !(deviation_ms >= 0.0 && deviation_ms.is_finite()) {
            return Err(VoteError::Deviation(deviation_ms));
        }
        Ok(self)
    }

    /// Returns the ballot of a member that measures this delay to a candidate (thesis 4.3.1.5).
    pub fn ballot(&self, delay: PeerDelay) -> Ballot {
        match delay {
            PeerDelay::AverageMs(ms) if ms < self.inclusion_ms => Ballot::Include,
            PeerDelay::AverageMs(ms) if ms > self.rejection_ms => Ballot::Reject,
            PeerDelay::Unreachable => Ballot::Reject,
            PeerDelay::AverageMs(_) | PeerDelay::Unknown => Ballot::Abstain,
        }
    }
}

impl Motion {
    /// Returns the node that the motion is about.
    pub const fn candidate(self) -> NodeId {
        match self {
            Self::Include(node) | Self::Reject(node) => node,
        }
    }

    /// Returns whether these ballots carry the motion (thesis 4.3.1.5). Inclusion passes if nobody is against
    /// it and somebody is for it. Rejection passes if I + 0.5A − 2R < 0.
    pub const fn passes(self, tally: Tally) -> bool {
        let Tally { include, abstain, reject } = tally;
        match self {
            Self::Include(_) => reject == 0 && include > 0,
            // Twice the thesis's sum, in whole numbers.
            Self::Reject(_) => 2 * include as u64 + (abstain as u64) < 4 * reject as u64,
        }
    }
}

impl Tally {
    /// Counts one ballot.
    pub const fn count(&mut self, ballot: Ballot) {
        match ballot {
            Ballot::Include => self.include += 1,
            Ballot::Abstain => self.abstain += 1,
            Ballot::Reject => self.reject += 1,
        }
    }
}
