//! Records an authority's joins durably: how often tokens were used, and which ids were given.

use std::collections::BTreeMap;
use std::fmt;

use super::journal::Journal;
use super::token::NONCE_BYTES;
use super::{JoinRole, NetError, PeerName};
use crate::space::{ClientId, NodeId};

type Nonce = [u8; NONCE_BYTES];

/// The record of joins: one line of the journal per join, kept before the joiner gets its answer. Minting
/// tokens needs no ledger.
pub(super) struct Ledger {
    journal: Box<dyn Journal>,
    /// The used tokens by nonce. Each is kept until some time after it has expired.
    used: BTreeMap<Nonce, Used>,
    last_node: u32,
    last_client: u32,
}

/// A token that was used.
#[derive(Clone, Copy)]
struct Used {
    until_s: u64,
    times: u32,
    last: Option<Given>,
}

/// The ids that were given last for a token, and the mark of the key that they were given to.
#[derive(Clone, Copy)]
struct Given {
    key: u64,
    node: u32,
    client: u32,
}

/// Returns the name of a process by its role and ids.
fn name_of(role: JoinRole, node: u32, client: u32) -> PeerName {
    let (node, client) = (NodeId(node), ClientId(client));
    match role {
        JoinRole::Server => PeerName::Server,
        JoinRole::Node => PeerName::Node(node),
        JoinRole::Client => PeerName::Client(client),
        JoinRole::Participant => PeerName::Participant(node, client),
        JoinRole::Builder => PeerName::Builder(client),
    }
}

/// Returns whether a used token is still remembered: until a week after it has expired, since a clock that is
/// ahead may be set right.
fn is_kept(until_s: u64, now_s: u64) -> bool {
    const WEEK_S: u64 = 7 * 24 * 3600;
    until_s.saturating_add(WEEK_S) >= now_s
}

/// A line of the record: how often a token was used, and the ids that were given for it; 0 is none. The lines
/// of a compact record have no ids there, and the last ones in `last`.
struct Line {
    nonce: Nonce,
    until_s: u64,
    node: u32,
    client: u32,
    times: u32,
    last: Option<Given>,
}

impl Ledger {
    /// The number of ids by which a copy is ahead, so that a server that goes on with the copy does not give
    /// ids again that were given after the copy was made. A client that asks for the world's status is given
    /// an id too: at one per second the number lasts twelve days.
    #[cfg(feature = "physics")]
    const AHEAD: u32 = 1 << 20;

    /// Reads the record back, without tokens that have long expired.
    pub(super) fn open(mut journal: Box<dyn Journal>, now_s: u64) -> Result<Self, NetError> {
        let content = journal.read()?;
        let mut used: BTreeMap<Nonce, Used> = BTreeMap::new();
        let (mut last_node, mut last_client) = (0, 0);
        // A last line without its end was cut by a crash. Its joiner never got an answer.
        let whole = &content[..content.rfind('\n').map_or(0, |end| end + 1)];
        for line in whole.lines() {
            let damaged = || NetError::Damaged {
                path: journal.place(),
                what: format!("the line `{line}`"),
                remedy: "restore it from a copy: it says which tokens were used, and which names were given",
            };
            let Line { nonce, until_s, node, client, times, last } = Line::parse(line).ok_or_else(damaged)?;
            last_node = last_node.max(node);
            last_client = last_client.max(client);
            if is_kept(until_s, now_s) {
                let used = used.entry(nonce).or_insert(Used { until_s, times: 0, last: None });
                used.last = last.or(used.last);
                // A line without ids is of a compact record and says the total. The lines that it replaces
                // may still be there before it.
                used.times = if (node, client) == (0, 0) { times } else { used.times + times };
            }
        }
        let mut ledger = Self { journal, used, last_node, last_client };
        let compact = ledger.compact(0);
        ledger.journal.replace(&compact)?;
        Ok(ledger)
    }

    /// Returns the record for a copy of the world, with ids that are ahead by [`Self::AHEAD`].
    #[cfg(feature = "physics")]
    pub(super) fn copy(&self) -> String {
        self.compact(Self::AHEAD)
    }

    /// Returns the whole record in as few lines as possible.
    fn compact(&self, ahead: u32) -> String {
        let (node, client) = (self.last_node.saturating_add(ahead), self.last_client.saturating_add(ahead));
        let ids = Line { nonce: [0; NONCE_BYTES], until_s: 0, node, client, times: 1, last: None };
        let mut text = ids.to_string();
        for (&nonce, &Used { until_s, times, last }) in &self.used {
            text.push_str(&Line { nonce, until_s, node: 0, client: 0, times, last }.to_string());
        }
        text
    }

    /// Returns how often a token was used.
    pub(super) fn uses(&self, nonce: &Nonce) -> u32 {
        self.used.get(nonce).map_or(0, |used| used.times)
    }

    /// Gives no name up to these any more, durably. Returns whether the record did not know all of them: then
    /// it is not the one of the world that has these names.
    #[cfg(feature = "physics")]
    pub(super) fn keep_names(&mut self, node: NodeId, client: ClientId) -> Result<bool, NetError> {
        if node.0 <= self.last_node && client.0 <= self.last_client {
            return Ok(false);
        }
        self.last_node = self.last_node.max(node.0);
        self.last_client = self.last_client.max(client.0);
        let (node, client) = (self.last_node, self.last_client);
        let ids = Line { nonce: [0; NONCE_BYTES], until_s: 0, node, client, times: 1, last: None };
        self.journal.append(&ids.to_string())?;
        Ok(true)
    }

    /// Returns whether a node has ever been given this name.
    #[cfg(feature = "physics")]
    pub(super) fn has_named(&self, node: NodeId) -> bool {
        (1..=self.last_node).contains(&node.0)
    }

    /// Returns the name that was given last for this token, if it was given to this key. The joiner may never
    /// have got that answer.
    pub(super) fn given(&self, nonce: &Nonce, key: u64, role: JoinRole) -> Option<PeerName> {
        let last = self.used.get(nonce)?.last.filter(|last| last.key == key)?;
        Some(name_of(role, last.node, last.client))
    }

    /// Counts the use of a token by the holder of this key, and gives ids for `role`, or those of `resumed`.
    /// The record is durable when this returns.
    pub(super) fn record(
        &mut self,
        nonce: Nonce,
        until_s: u64,
        role: JoinRole,
        resumed: Option<PeerName>,
        key: u64,
        now_s: u64,
    ) -> Result<PeerName, NetError> {
        let who = resumed.unwrap_or_else(|| name_of(role, self.last_node + 1, self.last_client + 1));
        let (node, client) = (who.node().unwrap_or_default().0, who.client().unwrap_or_default().0);
        let last = Some(Given { key, node, client });
        self.journal.append(&Line { nonce, until_s, node, client, times: 1, last }.to_string())?;
        self.used.retain(|_, used| is_kept(used.until_s, now_s));
        let used = self.used.entry(nonce).or_insert(Used { until_s, times: 0, last });
        (used.times, used.last) = (used.times + 1, last);
        self.last_node = self.last_node.max(node);
        self.last_client = self.last_client.max(client);
        Ok(who)
    }
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { nonce, until_s, node, client, times, last } = self;
        write!(f, "{:032x} {until_s} {node} {client}", u128::from_be_bytes(*nonce))?;
        match (times, last) {
            (1, None) => writeln!(f),
            (times, None) => writeln!(f, " {times}"),
            (times, Some(Given { key, node, client })) => writeln!(f, " {times} {key:016x} {node} {client}"),
        }
    }
}

impl Line {
    fn parse(line: &str) -> Option<Self> {
        let mut words = line.split(' ');
        let nonce = u128::from_str_radix(words.next()?, 16).ok()?.to_be_bytes();
        let (until_s, node) = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
        let client = words.next()?.parse().ok()?;
        let times = words.next().map_or(Some(1), |times| times.parse().ok())?;
        let last = match words.next() {
            None => None,
            Some(key) => Some(Given {
                key: u64::from_str_radix(key, 16).ok()?,
                node: words.next()?.parse().ok()?,
                client: words.next()?.parse().ok()?,
            }),
        };
        words.next().is_none().then_some(Self { nonce, until_s, node, client, times, last })
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;

    use super::*;
    use crate::net::journal::FileJournal;

    fn open(folder: &Path, now_s: u64) -> Result<Ledger, NetError> {
        Ledger::open(Box::new(FileJournal::open(folder)?), now_s)
    }

    #[test]
    fn nonces_and_ids_survive_reopening_until_they_expire() {
        let folder = tempfile::tempdir().unwrap();
        let mut ledger = open(folder.path(), 0).unwrap();
        let first = ledger.record([1; 16], 100, JoinRole::Node, None, 7, 0).unwrap();
        let second = ledger.record([2; 16], 200, JoinRole::Participant, None, 7, 0).unwrap();
        assert_eq!(first, PeerName::Node(NodeId(1)));
        assert_eq!(second, PeerName::Participant(NodeId(2), ClientId(1)));
        drop(ledger);

        // The clock was two days ahead, and is set right.
        drop(open(folder.path(), 2 * 24 * 3600).unwrap());
        assert_eq!(open(folder.path(), 50).unwrap().uses(&[1; 16]), 1, "it is not good again");

        let later = 150 + 7 * 24 * 3600;
        let mut ledger = open(folder.path(), later).unwrap();
        assert_eq!(ledger.uses(&[1; 16]), 0, "its token has expired, which is reason enough to refuse it");
        assert_eq!(ledger.uses(&[2; 16]), 1);
        let third = ledger.record([3; 16], later + 100, JoinRole::Node, None, 7, later).unwrap();
        assert_eq!(third, PeerName::Node(NodeId(3)));
    }

    #[test]
    fn uses_of_a_token_are_counted_over_restarts() {
        let folder = tempfile::tempdir().unwrap();
        for restart in 0..4 {
            let mut ledger = open(folder.path(), 0).unwrap();
            assert_eq!(ledger.uses(&[1; 16]), 2 * restart);
            for _ in 0..2 {
                ledger.record([1; 16], 100, JoinRole::Node, None, 7, 0).unwrap();
            }
        }
        assert_eq!(open(folder.path(), 0).unwrap().last_node, 8);
    }

    #[test]
    fn who_was_given_a_name_for_a_token_is_known_by_its_key_over_restarts() {
        let folder = tempfile::tempdir().unwrap();
        let mut ledger = open(folder.path(), 0).unwrap();
        let first = ledger.record([1; 16], 100, JoinRole::Participant, None, 7, 0).unwrap();
        let second = ledger.record([2; 16], 100, JoinRole::Node, None, 8, 0).unwrap();
        drop(ledger);
        for _ in 0..3 {
            let ledger = open(folder.path(), 0).unwrap();
            assert_eq!(ledger.given(&[1; 16], 7, JoinRole::Participant), Some(first));
            assert_eq!(ledger.given(&[2; 16], 8, JoinRole::Node), Some(second));
            assert_eq!(ledger.given(&[1; 16], 8, JoinRole::Participant), None, "another's");
            assert_eq!((ledger.uses(&[1; 16]), ledger.uses(&[2; 16])), (1, 1));
        }
        let mut ledger = open(folder.path(), 0).unwrap();
        let third = ledger.record([1; 16], 100, JoinRole::Participant, None, 9, 0).unwrap();
        assert_eq!(ledger.given(&[1; 16], 9, JoinRole::Participant), Some(third));
        assert_eq!(ledger.given(&[1; 16], 7, JoinRole::Participant), None, "of each token the last one");
    }

    #[test]
    fn uses_are_counted_once_where_a_crash_left_lines_that_a_compact_record_is_to_replace() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("joins.log");
        let mut ledger = open(folder.path(), 0).unwrap();
        for _ in 0..2 {
            ledger.record([1; 16], 100, JoinRole::Node, None, 7, 0).unwrap();
        }
        ledger.record([2; 16], 100, JoinRole::Node, None, 7, 0).unwrap();
        drop(ledger);
        let former = fs::read_to_string(&path).unwrap();
        drop(open(folder.path(), 0).unwrap());
        let compact = fs::read_to_string(&path).unwrap();
        assert_ne!(former, compact);
        fs::write(&path, former + &compact).unwrap();
        let mut ledger = open(folder.path(), 0).unwrap();
        assert_eq!((ledger.uses(&[1; 16]), ledger.uses(&[2; 16])), (2, 1));
        ledger.record([1; 16], 100, JoinRole::Node, None, 7, 0).unwrap();
        drop(ledger);
        assert_eq!(open(folder.path(), 0).unwrap().uses(&[1; 16]), 3);
    }

    #[test]
    #[cfg(feature = "physics")]
    fn who_goes_on_with_a_copy_gives_no_id_again_that_was_given_since() {
        let folder = tempfile::tempdir().unwrap();
        let mut ledger = open(folder.path(), 0).unwrap();
        ledger.record([1; 16], 100, JoinRole::Participant, None, 7, 0).unwrap();
        let copy = tempfile::tempdir().unwrap();
        fs::write(copy.path().join("joins.log"), ledger.copy()).unwrap();
        let since = ledger.record([2; 16], 100, JoinRole::Participant, None, 7, 0).unwrap();
        let mut copied = open(copy.path(), 0).unwrap();
        assert_eq!(copied.uses(&[1; 16]), 1);
        let next = copied.record([3; 16], 100, JoinRole::Participant, None, 7, 0).unwrap();
        assert!(next.node() > since.node() && next.client() > since.client(), "{next} {since}");
    }

    #[test]
    #[cfg(feature = "physics")]
    fn names_of_a_world_whose_record_was_lost_are_not_given_again() {
        let folder = tempfile::tempdir().unwrap();
        let mut ledger = open(folder.path(), 0).unwrap();
        assert!(ledger.keep_names(NodeId(2), ClientId(5)).unwrap());
        assert!(!ledger.keep_names(NodeId(2), ClientId(4)).unwrap());
        drop(ledger);
        let mut ledger = open(folder.path(), 0).unwrap();
        assert!(ledger.has_named(NodeId(2)) && !ledger.has_named(NodeId(3)));
        let next = ledger.record([1; 16], 100, JoinRole::Participant, None, 7, 0).unwrap();
        assert_eq!(next, PeerName::Participant(NodeId(3), ClientId(6)));
        assert!(!ledger.keep_names(NodeId(3), ClientId(6)).unwrap());
    }

    #[test]
    fn a_line_cut_by_a_crash_is_forgotten_and_a_damaged_one_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("joins.log");
        fs::write(&path, format!("{:032x} 100 1 0\n0202", u128::from_be_bytes([1; 16]))).unwrap();
        let ledger = open(folder.path(), 0).unwrap();
        assert_eq!(ledger.uses(&[1; 16]), 1);
        assert_eq!(ledger.used.len(), 1);
        drop(ledger);
        fs::write(&path, "what is this\n").unwrap();
        assert!(matches!(open(folder.path(), 0), Err(NetError::Damaged { .. })));
    }

    #[test]
    fn two_servers_never_share_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        let _ledger = open(folder.path(), 0).unwrap();
        assert!(matches!(open(folder.path(), 0), Err(NetError::FolderTaken { .. })));
    }
}
