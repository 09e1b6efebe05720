//! Repeats messages that a tick waits for over links that lose packets: once more in a datagram, a little
//! later.
//!
//! In a stream of a few packets per tick QUIC notices a loss only by its probes, after several round trips,
//! and waits twice as long for each further probe. Only messages that may overtake others are repeated:
//! border messages, dispatches and inputs. They name their tick, and a receiver that has heard of that tick,
//! or of none before it, drops them. A member's `Done` must not overtake its reports and earlier ones, and is
//! not repeated.

use std::collections::{BTreeMap, VecDeque};
use std::time::{Duration, Instant};

use crate::cluster::Peer;
use crate::net::PeerStats;
use crate::protocol::{DATAGRAM_BYTES, FromClient, Message};
use crate::space::Tick;

/// How long after the first sending a message is repeated: in a packet of its own, and not in the same burst
/// of losses.
const LATER: Duration = Duration::from_millis(4);
/// The share of lost packets above which messages over a link are repeated.
const LOSSY: f64 = 0.005;
/// The weight of a new count in the smoothed share of losses.
const NEWS: f64 = 0.1;

/// The packets of a link at the last count, and the recent share of lost ones.
#[derive(Clone, Copy, Debug, Default)]
struct Losses {
    sent: u64,
    lost: u64,
    share: f64,
}

/// The messages to be repeated, and the losses of links.
#[derive(Debug, Default)]
pub(super) struct Repeats {
    links: BTreeMap<Peer, Losses>,
    waiting: VecDeque<(Instant, Peer, Vec<u8>)>,
}

impl Repeats {
    /// Takes in how many packets a link has sent and lost so far.
    pub(super) fn count(&mut self, link: Peer, stats: &PeerStats) {
        let losses = self.links.entry(link).or_default();
        // The counters of a link that was made anew begin anew.
        let sent = stats.packets_out.saturating_sub(losses.sent);
        let lost = stats.packets_lost.saturating_sub(losses.lost);
        if sent > 0 {
            losses.share += NEWS * (lost as f64 / sent as f64 - losses.share);
        }
        (losses.sent, losses.lost) = (stats.packets_out, stats.packets_lost);
    }

    /// Keeps a message that is sent now, if a tick waits for it, the link loses packets, and it fits into one
    /// packet.
    pub(super) fn sent(&mut self, now: Instant, link: Peer, message: &Message, bytes: &[u8]) {
        let is_lossy = self.links.get(&link).is_some_and(|losses| losses.share > LOSSY);
        if is_awaited(message) && is_lossy && bytes.len() <= DATAGRAM_BYTES {
            self.waiting.push_back((now + LATER, link, bytes.to_vec()));
        }
    }

    /// Returns the next message that is due to be repeated.
    pub(super) fn due(&mut self, now: Instant) -> Option<(Peer, Vec<u8>)> {
        self.waiting.front().filter(|(at, ..)| *at <= now)?;
        self.waiting.pop_front().map(|(_, link, bytes)| (link, bytes))
    }

    /// Returns whether any message is to be repeated.
    pub(super) fn is_waiting(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Forgets all links but those that are up.
    pub(super) fn retain(&mut self, is_up: impl Fn(&Peer) -> bool) {
        self.links.retain(|link, _| is_up(link));
    }
}

/// Returns whether a tick waits for a message that may overtake others.
pub(super) fn is_awaited(message: &Message) -> bool {
    match message {
        Message::Border(_) | Message::Dispatch(_) => true,
        Message::FromClient(_, FromClient::Input(input)) => input.tick != Tick(0),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Dispatch, ViewNumber};
    use crate::space::NodeId;

    fn stats(packets_out: u64, packets_lost: u64) -> PeerStats {
        PeerStats { packets_out, packets_lost, ..PeerStats::default() }
    }

    #[test]
    fn what_a_tick_waits_for_is_said_again_over_links_that_lose_packets() {
        let (good, bad, now) = (Peer::Node(NodeId(1)), Peer::Node(NodeId(2)), Instant::now());
        let dispatch = Dispatch { view: ViewNumber(1), tick: Tick(1), rounds: 1, ops: Vec::new() };
        let (awaited, other) = (Message::Dispatch(dispatch), Message::Waiting(ViewNumber(1)));
        let mut repeats = Repeats::default();
        for second in 1..=10 {
            repeats.count(good, &stats(100 * second, 0));
            repeats.count(bad, &stats(100 * second, 5 * second));
        }
        for link in [good, bad] {
            repeats.sent(now, link, &awaited, &[7]);
            repeats.sent(now, link, &other, &[8]);
            repeats.sent(now, link, &awaited, &[9; DATAGRAM_BYTES + 1]);
        }
        assert_eq!(repeats.due(now), None, "not in the same burst");
        assert_eq!(repeats.due(now + LATER), Some((bad, vec![7])));
        assert_eq!(repeats.due(now + LATER), None);
        assert!(!repeats.is_waiting());
        // Repetition ends when the losses do.
        for second in 11..=60 {
            repeats.count(bad, &stats(100 * second, 50));
        }
        repeats.sent(now, bad, &awaited, &[7]);
        assert!(!repeats.is_waiting());
    }
}
