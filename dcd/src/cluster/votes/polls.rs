//! Holds the votes of all groups on the server: decides which may be held, collects the ballots and closes
//! the polls (thesis 3.3.9, 4.3.1.5).

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::time::Duration;

use bincode::{Decode, Encode};

use super::{Ballot, Tally, VoteError};
use crate::protocol::Motion;
use crate::space::NodeId;

/// The rules on how often votes may be held. The thesis names these means without figures; the figures are
/// ours.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct PollRules {
    /// The largest number of nodes in a group. A server replaces it by that of its
    /// [`Grouping`](crate::cluster::Grouping).
    #[doc(hidden)]
    pub max_size: usize,
    /// The time for which a poll waits for ballots. A voter that has not voted by then abstains.
    pub deadline: Duration,
    /// The time within which a second member must call for the same rejection for a vote to be held. This
    /// applies to groups of three or more.
    pub second_within: Duration,
    /// The shortest time between two votes that one node calls, and between two votes on one node.
    pub rest: Duration,
    /// The most votes within `window`, of all groups together.
    pub max_votes: usize,
    /// The time to which `max_votes` applies.
    pub window: Duration,
    /// The time that a node stays in its group before it may be voted elsewhere.
    pub min_stay: Duration,
    /// The time that a node stays out of groups after an eviction. Each further eviction triples it, until
    /// evictions are forgotten.
    pub return_after: Duration,
    /// The time without another eviction after which evictions are forgotten.
    pub forgiven_after: Duration,
}

impl Default for PollRules {
    /// Returns rules by which a node is voted to and fro at most five times in its first hour, however its
    /// delay moves. The times are: out after 1 min, in after 6, out after 7, in after 22, out after 23, and
    /// in again after 68.
    fn default() -> Self {
        Self {
            max_size: 32,
            deadline: Duration::from_secs(2),
            second_within: Duration::from_secs(300),
            rest: Duration::from_secs(30),
            max_votes: 60,
            window: Duration::from_secs(60),
            min_stay: Duration::from_secs(60),
            return_after: Duration::from_secs(300),
            forgiven_after: Duration::from_secs(3_600),
        }
    }
}

impl PollRules {
    /// Returns the rules, if they can be followed.
    #[doc(hidden)]
    pub fn checked(self) -> Result<Self, VoteError> {
        let Self { max_votes, window, .. } = self;
        if max_votes == 0 || window.is_zero() {
            Err(VoteError::NoVotes { max_votes, window })
        } else {
            Ok(self)
        }
    }
}

/// A node's call for a vote, with what the server knows of the groups concerned.
#[derive(Clone, Copy, Debug)]
pub struct Call<'a> {
    /// The node that calls.
    pub caller: NodeId,
    /// The motion that it calls for.
    pub motion: Motion,
    /// Members of the caller's group, the caller included.
    pub group: &'a [NodeId],
    /// Members of the candidate's present group, the candidate included.
    pub present: &'a [NodeId],
    /// Says whether the membership of either group is changing.
    pub changing: bool,
}

/// The reason why a vote is not held.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum VoteRefusal {
    /// The caller, the candidate and their groups do not go with the motion.
    #[error("the caller, the candidate and their groups do not go with the motion")]
    Mistaken,
    /// The candidate's present group is larger than the caller's. Without this rule groups would poach each
    /// other's nodes in turn (thesis 3.3.9).
    #[error("the candidate's present group is larger than the group that wants it")]
    Smaller,
    /// The group has as many members as it may have.
    #[error("the group has as many members as it may have")]
    Full,
    /// Nobody else in the group has called for the rejection yet. By the thesis's sum alone, one member of a
    /// group of three could have another evicted, even because of its own lag.
    #[error("nobody else in the group has called for it yet")]
    Unseconded,
    /// The membership of a group concerned is being changed.
    #[error("the membership of a group concerned is being changed")]
    Changing,
    /// Another vote concerns some of the same nodes.
    #[error("another vote concerns some of the same nodes")]
    Voting,
    /// The caller has called a vote, or the candidate has been voted on, a short time ago.
    #[error("the caller has called a vote, or the candidate has been voted on, a short time ago")]
    Resting,
    /// The candidate has to stay where it is for a while.
    #[error("the candidate stays where it is for a while")]
    Staying,
    /// There were as many votes as there may be in the window.
    #[error("there were as many votes as there may be in such a time")]
    TooMany,
}

/// The outcome of a vote that is over.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// The number of the vote.
    pub poll: u64,
    /// The motion that was voted on.
    pub motion: Motion,
    /// The caller's group.
    pub group: Vec<NodeId>,
    /// The counts of the ballots.
    pub tally: Tally,
    /// Says whether the candidate moves: into `group`, or out of it into a group of its own.
    pub passed: bool,
}

/// The counts of votes, and of how they ended.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PollCounts {
    /// The number of votes opened. Those that neither passed nor failed are open, or were cancelled.
    pub opened: u64,
    /// The number of votes that passed.
    pub passed: u64,
    /// The number of votes that failed.
    pub failed: u64,
}

#[derive(Clone, Debug)]
struct Poll {
    motion: Motion,
    group: Vec<NodeId>,
    /// The members of both groups.
    concerned: BTreeSet<NodeId>,
    ballots: BTreeMap<NodeId, Option<Ballot>>,
    deadline: Duration,
}

/// A node's history in votes.
#[derive(Clone, Debug, Default)]
struct Standing {
    /// The time since which the node has been in its group.
    since: Option<Duration>,
    /// How often the node was evicted, and when for the last time.
    evictions: u32,
    evicted: Duration,
    /// The times from which on the node may call a vote again, and may be voted on again.
    may_call: Duration,
    may_be_voted_on: Duration,
    /// The nodes that have called for its rejection, and when each did last.
    accusers: BTreeMap<NodeId, Duration>,
}

/// The votes of all groups. It holds one entry per node, one time per vote of the window, and at most one
/// open poll per group.
#[derive(Clone, Debug)]
pub struct Polls {
    rules: PollRules,
    last: u64,
    counts: PollCounts,
    open: BTreeMap<u64, Poll>,
    /// The times at which the votes of the window were opened.
    opened: VecDeque<Duration>,
    nodes: BTreeMap<NodeId, Standing>,
}

impl Polls {
    /// Returns polls without any votes.
    ///
    /// # Panics
    /// When `rules` have not been checked.
    pub fn new(rules: PollRules) -> Self {
        assert_eq!(rules.checked(), Ok(rules), "rules are checked before they are followed");
        Self {
            rules,
            last: 0,
            counts: PollCounts::default(),
            open: BTreeMap::new(),
            opened: VecDeque::new(),
            nodes: BTreeMap::new(),
        }
    }

    /// Records that a node is in another group from now on, other than by a vote. Its stay there begins.
    pub fn placed(&mut self, now: Duration, node: NodeId) {
        self.nodes.entry(node).or_default().since = Some(now);
    }

    /// Cancels the votes that concern these nodes, since the membership of their groups changes.
    pub fn group_changes(&mut self, members: &[NodeId]) {
        self.open.retain(|_, poll| !members.iter().any(|member| poll.concerned.contains(member)));
    }

    /// Forgets a node that is gone for good, and cancels the votes that concern it.
    pub fn forget(&mut self, node: NodeId) {
        self.group_changes(&[node]);
        self.nodes.remove(&node);
    }

    /// Opens a vote and returns its number and the voters. The candidate is not one of them.
    pub fn call(&mut self, now: Duration, call: &Call<'_>) -> Result<(u64, Vec<NodeId>), VoteRefusal> {
        let Call { caller, motion, group, present, .. } = *call;
        let candidate = motion.candidate();
        call.in_itself(&self.rules)?;
        if let Motion::Reject(_) = motion {
            self.nodes.entry(candidate).or_default().accuse(caller, &self.rules, now);
        }
        while self.opened.front().is_some_and(|&at| at + self.rules.window <= now) {
            self.opened.pop_front();
        }
        self.in_time(now, call)?;
        self.opened.push_back(now);
        self.nodes.entry(caller).or_default().may_call = now + self.rules.rest;
        self.nodes.entry(candidate).or_default().may_be_voted_on = now + self.rules.rest;
        self.last += 1;
        self.counts.opened += 1;
        let voters: Vec<_> = group.iter().copied().filter(|&voter| voter != candidate).collect();
        let poll = Poll {
            motion,
            group: group.to_vec(),
            concerned: group.iter().chain(present).copied().collect(),
            ballots: voters.iter().map(|&voter| (voter, None)).collect(),
            deadline: now + self.rules.deadline,
        };
        self.open.insert(self.last, poll);
        Ok((self.last, voters))
    }

    /// Checks whether a vote that could be held may be held now.
    fn in_time(&self, now: Duration, call: &Call<'_>) -> Result<(), VoteRefusal> {
        let Call { caller, motion, group, present, changing } = *call;
        let candidate = motion.candidate();
        let new = Standing::default();
        let standing = |node| self.nodes.get(&node).unwrap_or(&new);
        let rules = &self.rules;
        // When a node that is alone wants another, the vote moves the caller just as much.
        let moved = [Some(candidate), (group.len() == 1).then_some(caller)];
        let stays = |node| standing(node).stays_until(motion, rules, now) > now;
        let voting = |poll: &Poll| group.iter().chain(present).any(|node| poll.concerned.contains(node));
        if group.len() > 2 && matches!(motion, Motion::Reject(_)) && standing(candidate).accusers(group) < 2 {
            Err(VoteRefusal::Unseconded)
        } else if changing {
            Err(VoteRefusal::Changing)
        } else if self.open.values().any(voting) {
            Err(VoteRefusal::Voting)
        } else if now < standing(caller).may_call || now < standing(candidate).may_be_voted_on {
            Err(VoteRefusal::Resting)
        } else if moved.into_iter().flatten().any(stays) {
            Err(VoteRefusal::Staying)
        } else if self.opened.len() >= rules.max_votes {
            Err(VoteRefusal::TooMany)
        } else {
            Ok(())
        }
    }

    /// Takes a ballot in, and returns the outcome if it is the last. The ballot of a node that is not asked,
    /// has voted already or is too late is ignored.
    pub fn ballot(&mut self, now: Duration, poll: u64, voter: NodeId, ballot: Ballot) -> Option<Outcome> {
        let open = self.open.get_mut(&poll).filter(|open| now <= open.deadline)?;
        open.ballots.get_mut(&voter)?.get_or_insert(ballot);
        let all = open.ballots.values().all(Option::is_some);
        if all { self.close(now, poll) } else { None }
    }

    /// Returns how many votes there were.
    pub fn counts(&self) -> PollCounts {
        self.counts
    }

    /// Returns when [`Self::handle_timeout`] next has something to do.
    pub fn poll_timeout(&self) -> Option<Duration> {
        self.open.values().map(|poll| poll.deadline).min()
    }

    /// Closes the votes whose deadline has passed, and returns their outcomes.
    pub fn handle_timeout(&mut self, now: Duration) -> Vec<Outcome> {
        let over: Vec<u64> =
            self.open.iter().filter(|(_, poll)| poll.deadline <= now).map(|(&number, _)| number).collect();
        over.into_iter().filter_map(|number| self.close(now, number)).collect()
    }

    fn close(&mut self, now: Duration, number: u64) -> Option<Outcome> {
        let Poll { motion, group, ballots, .. } = self.open.remove(&number)?;
        let mut tally = Tally::default();
        ballots.into_values().for_each(|ballot| tally.count(ballot.unwrap_or(Ballot::Abstain)));
        let passed = motion.passes(tally);
        let count = if passed { &mut self.counts.passed } else { &mut self.counts.failed };
        *count += 1;
        if passed {
            self.nodes.entry(motion.candidate()).or_default().moves(motion, &self.rules, now);
        }
        Some(Outcome { poll: number, motion, group, tally, passed })
    }
}

impl Call<'_> {
    /// Checks whether the vote could be held at any time.
    fn in_itself(&self, rules: &PollRules) -> Result<(), VoteRefusal> {
        let candidate = self.motion.candidate();
        if !self.group.contains(&self.caller) || !self.present.contains(&candidate) {
            return Err(VoteRefusal::Mistaken);
        }
        let own = self.group.contains(&candidate);
        match self.motion {
            Motion::Include(_) if own => Err(VoteRefusal::Mistaken),
            Motion::Include(_) if self.present.len() > self.group.len() => Err(VoteRefusal::Smaller),
            Motion::Include(_) if self.group.len() >= rules.max_size => Err(VoteRefusal::Full),
            Motion::Reject(_) if !own || self.caller == candidate => Err(VoteRefusal::Mistaken),
            Motion::Include(_) | Motion::Reject(_) => Ok(()),
        }
    }
}

impl Standing {
    /// Records a call for the node's rejection. Calls of long ago are forgotten.
    fn accuse(&mut self, caller: NodeId, rules: &PollRules, now: Duration) {
        self.accusers.retain(|_, at| now < *at + rules.second_within);
        self.accusers.insert(caller, now);
    }

    /// Returns how many of the group have called for the node's rejection lately.
    fn accusers(&self, group: &[NodeId]) -> usize {
        group.iter().filter(|node| self.accusers.contains_key(node)).count()
    }

    /// Returns the number of evictions that still count.
    fn evictions(&self, rules: &PollRules, now: Duration) -> u32 {
        if now.saturating_sub(self.evicted) < rules.forgiven_after { self.evictions } else { 0 }
    }

    /// Returns the time until which such a motion may not move the node.
    fn stays_until(&self, motion: Motion, rules: &PollRules, now: Duration) -> Duration {
        let stay = match (motion, self.evictions(rules, now)) {
            (Motion::Reject(_), _) | (_, 0) => rules.min_stay,
            (Motion::Include(_), evictions) => {
                let times = 3_u32.saturating_pow(evictions - 1);
                rules.return_after.saturating_mul(times).max(rules.min_stay)
            }
        };
        self.since.map_or(Duration::ZERO, |since| since + stay)
    }

    fn moves(&mut self, motion: Motion, rules: &PollRules, now: Duration) {
        if let Motion::Reject(_) = motion {
            self.evictions = self.evictions(rules, now).saturating_add(1);
            self.evicted = now;
        }
        self.since = Some(now);
        self.accusers.clear();
    }
}
