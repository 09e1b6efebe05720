//! Monitors a node's delays to all others and decides when to call for a vote on inclusion or rejection
//! (thesis 3.3.9, 4.3.2.7).

use std::collections::BTreeMap;
use std::time::Duration;

use super::{VoteError, VoteThresholds};
use crate::protocol::Motion;
use crate::space::NodeId;

/// The rules of a [`DelayMonitor`]: how many bad samples it takes to call for a vote.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DelayRules {
    /// The number of consecutive bad samples after which a vote is called.
    pub strikes: u32,
    /// The time after a peer's last strike at which one strike is forgotten; after as long again another is,
    /// and so on. It should exceed the longest interval of pings.
    pub strike_life: Duration,
}

impl Default for DelayRules {
    /// Returns three strikes (thesis 3.3.9), kept for ten minutes.
    fn default() -> Self {
        Self { strikes: 3, strike_life: Duration::from_secs(600) }
    }
}

impl DelayRules {
    /// Returns the rules, if they can be followed.
    pub fn checked(self) -> Result<Self, VoteError> {
        if self.strikes == 0 { Err(VoteError::NoStrikes) } else { Ok(self) }
    }
}

#[derive(Clone, Copy, Debug)]
struct Strikes {
    same_group: bool,
    count: u32,
    last: Duration,
}

/// Monitors the delays from one node to all others. It keeps one entry per peer: [`Self::forget`] those that
/// are gone.
#[derive(Clone, Debug)]
pub struct DelayMonitor {
    thresholds: VoteThresholds,
    rules: DelayRules,
    peers: BTreeMap<NodeId, Strikes>,
}

impl DelayMonitor {
    /// Returns a monitor without samples.
    ///
    /// # Panics
    /// When `thresholds` or `rules` have not been checked.
    pub fn new(thresholds: VoteThresholds, rules: DelayRules) -> Self {
        assert_eq!(thresholds.checked(), Ok(thresholds), "thresholds are checked before they are followed");
        assert_eq!(rules.checked(), Ok(rules), "rules are checked before they are followed");
        Self { thresholds, rules, peers: BTreeMap::new() }
    }

    /// Takes in a new round trip to a peer: the average (or median) of the last ones, and the latest itself,
    /// in milliseconds (infinite: no answer). Returns the vote to call, if any. Strikes then begin anew, so
    /// that a call that is refused is made again after as many more.
    pub fn observe(
        &mut self,
        now: Duration,
        peer: NodeId,
        same_group: bool,
        average_ms: f64,
        latest_ms: f64,
    ) -> Option<Motion> {
        let VoteThresholds { inclusion_ms, rejection_ms, deviation_ms } = self.thresholds;
        let (cause, motion) = if same_group {
            let late = average_ms > rejection_ms || latest_ms > rejection_ms + deviation_ms;
            (late, Motion::Reject(peer))
        } else {
            (average_ms < inclusion_ms, Motion::Include(peer))
        };
        let kept = self.peers.remove(&peer).filter(|strikes| strikes.same_group == same_group);
        if !cause {
            return None; // Only consecutive strikes count.
        }
        let count = 1 + kept.map_or(0, |strikes| strikes.left(now, self.rules.strike_life));
        if count >= self.rules.strikes {
            return Some(motion);
        }
        self.peers.insert(peer, Strikes { same_group, count, last: now });
        None
    }

    /// Forgets a peer's strikes, as it is gone, or went from one other group to another.
    pub fn forget(&mut self, peer: NodeId) {
        self.peers.remove(&peer);
    }
}

impl Strikes {
    fn left(&self, now: Duration, life: Duration) -> u32 {
        let age = now.saturating_sub(self.last);
        let lost = age.as_nanos().checked_div(life.as_nanos()).unwrap_or(u128::MAX);
        self.count.saturating_sub(lost.try_into().unwrap_or(u32::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PEER: NodeId = NodeId(7);

    fn watch() -> DelayMonitor {
        let thresholds = VoteThresholds { inclusion_ms: 20.0, rejection_ms: 40.0, deviation_ms: 30.0 };
        DelayMonitor::new(thresholds, DelayRules::default())
    }

    /// Returns the votes called on samples of (average, latest), five seconds apart.
    fn calls(same_group: bool, samples: &[(f64, f64)]) -> Vec<Option<Motion>> {
        let mut watch = watch();
        let observe = |(at, &(average_ms, latest_ms)): (usize, &(f64, f64))| {
            watch.observe(Duration::from_secs(5 * at as u64), PEER, same_group, average_ms, latest_ms)
        };
        samples.iter().enumerate().map(observe).collect()
    }

    #[test]
    fn the_third_strike_calls_for_a_vote_and_three_more_for_another() {
        let reject = Some(Motion::Reject(PEER));
        assert_eq!(calls(true, &[(41.0, 41.0); 6]), [None, None, reject, None, None, reject]);
        let include = Some(Motion::Include(PEER));
        assert_eq!(calls(false, &[(19.0, 99.0); 4]), [None, None, include, None]);
    }

    #[test]
    fn the_latest_round_trip_counts_beyond_the_tolerated_deviation() {
        assert_eq!(calls(true, &[(10.0, 71.0); 3])[2], Some(Motion::Reject(PEER)));
        assert_eq!(calls(true, &[(10.0, 70.0); 3])[2], None);
        assert_eq!(calls(true, &[(10.0, f64::INFINITY); 3])[2], Some(Motion::Reject(PEER)));
    }

    #[test]
    fn between_the_thresholds_and_at_them_there_is_no_cause() {
        for ms in [20.0, 30.0, 40.0, f64::NAN] {
            assert_eq!(calls(true, &[(ms, ms); 4]), [None; 4]);
            assert_eq!(calls(false, &[(ms, ms); 4]), [None; 4]);
        }
    }

    #[test]
    fn a_good_sample_takes_all_strikes_back() {
        let [bad, good] = [(50.0, 50.0), (30.0, 30.0)];
        assert_eq!(calls(true, &[bad, bad, good, bad, bad]), [None; 5]);
    }

    #[test]
    fn strikes_are_forgotten_with_time() {
        let strike =
            |watch: &mut DelayMonitor, at| watch.observe(Duration::from_secs(at), PEER, true, 50.0, 50.0);
        let mut seldom = watch();
        assert!([0, 599, 1_198].map(|at| strike(&mut seldom, at)).iter().any(Option::is_some));
        let mut too_seldom = watch();
        assert!([0, 600, 1_200, 1_800].map(|at| strike(&mut too_seldom, at)).iter().all(Option::is_none));
    }

    #[test]
    fn strikes_are_forgotten_when_the_peer_changes_its_group() {
        let mut watch = watch();
        let mut sample = |same_group, ms| watch.observe(Duration::ZERO, PEER, same_group, ms, ms);
        assert_eq!([sample(true, 50.0), sample(true, 50.0)], [None; 2]);
        assert_eq!(sample(false, 10.0), None, "two strikes of the old group are none of the new");
        assert_eq!([sample(true, 50.0), sample(true, 50.0)], [None; 2]);
        watch.forget(PEER);
        assert_eq!(watch.observe(Duration::ZERO, PEER, true, 50.0, 50.0), None);
    }
}
