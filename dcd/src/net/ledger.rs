//! Records an authority's joins durably: which tokens were used, and which ids were given.

use std::collections::BTreeMap;

use super::journal::Journal;
use super::token::NONCE_BYTES;
use super::{JoinRole, NetError, PeerName};
use crate::space::{ClientId, NodeId};

type Nonce = [u8; NONCE_BYTES];

/// The record of joins: one line of the journal each, kept before the joiner gets its answer. Minting tokens needs no ledger.
pub(super) struct Ledger {
    journal: Box<dyn Journal>,
    /// Nonces of used tokens, each until its token would have expired anyway.
    used_until_s: BTreeMap<Nonce, u64>,
    last_node: u32,
    last_client: u32,
}

impl Ledger {
    /// Reads the record back, and forgets tokens that have expired.
    pub(super) fn open(mut journal: Box<dyn Journal>, now_s: u64) -> Result<Self, NetError> {
        let content = journal.read()?;
        let mut used_until_s = BTreeMap::new();
        let (mut last_node, mut last_client) = (0, 0);
        // A last line without its end was cut by a crash; its joiner never got an answer.
        let whole = &content[..content.rfind('\n').map_or(0, |end| end + 1)];
        for line in whole.lines() {
            let (nonce, until_s, node, client) = parse_line(line).ok_or_else(|| NetError::Damaged {
                path: journal.place(),
                what: format!("the line `{line}`"),
            })?;
            last_node = last_node.max(node);
            last_client = last_client.max(client);
            if until_s >= now_s {
                used_until_s.insert(nonce, until_s);
            }
        }
        let mut compact = format_line(&[0; NONCE_BYTES], 0, last_node, last_client);
        for (nonce, until_s) in &used_until_s {
            compact.push_str(&format_line(nonce, *until_s, 0, 0));
        }
        journal.replace(&compact)?;
        Ok(Self { journal, used_until_s, last_node, last_client })
    }

    pub(super) fn is_used(&self, nonce: &Nonce) -> bool {
        self.used_until_s.contains_key(nonce)
    }

    pub(super) fn has_named(&self, node: NodeId) -> bool {
        (1..=self.last_node).contains(&node.0)
    }

    /// Marks a token as used and gives ids for `role`, or those of `resumed`. Kept when this returns.
    pub(super) fn record(
        &mut self,
        nonce: Nonce,
        until_s: u64,
        role: JoinRole,
        resumed: Option<PeerName>,
        now_s: u64,
    ) -> Result<PeerName, NetError> {
        let who = resumed.unwrap_or_else(|| {
            let (node, client) = (NodeId(self.last_node + 1), ClientId(self.last_client + 1));
            match role {
                JoinRole::Server => PeerName::Server,
                JoinRole::Node => PeerName::Node(node),
                JoinRole::Client => PeerName::Client(client),
                JoinRole::Participant => PeerName::Participant(node, client),
            }
        });
        let (node, client) = (who.node().unwrap_or_default().0, who.client().unwrap_or_default().0);
        self.journal.append(&format_line(&nonce, until_s, node, client))?;
        self.used_until_s.retain(|_, until_s| *until_s >= now_s);
        self.used_until_s.insert(nonce, until_s);
        self.last_node = self.last_node.max(node);
        self.last_client = self.last_client.max(client);
        Ok(who)
    }
}

fn format_line(nonce: &Nonce, until_s: u64, node: u32, client: u32) -> String {
    format!("{:032x} {until_s} {node} {client}\n", u128::from_be_bytes(*nonce))
}

fn parse_line(line: &str) -> Option<(Nonce, u64, u32, u32)> {
    let mut words = line.split(' ');
    let nonce = u128::from_str_radix(words.next()?, 16).ok()?.to_be_bytes();
    let (until_s, node) = (words.next()?.parse().ok()?, words.next()?.parse().ok()?);
    let client = words.next()?.parse().ok()?;
    words.next().is_none().then_some((nonce, until_s, node, client))
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
        let first = ledger.record([1; 16], 100, JoinRole::Node, None, 0).unwrap();
        let second = ledger.record([2; 16], 200, JoinRole::Participant, None, 0).unwrap();
        assert_eq!(first, PeerName::Node(NodeId(1)));
        assert_eq!(second, PeerName::Participant(NodeId(2), ClientId(1)));
        drop(ledger);

        let mut ledger = open(folder.path(), 150).unwrap();
        assert!(!ledger.is_used(&[1; 16]), "its token has expired, which is reason enough to refuse it");
        assert!(ledger.is_used(&[2; 16]));
        let third = ledger.record([3; 16], 300, JoinRole::Node, None, 150).unwrap();
        assert_eq!(third, PeerName::Node(NodeId(3)));
    }

    #[test]
    fn a_line_cut_by_a_crash_is_forgotten_and_a_damaged_one_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("joins.log");
        fs::write(&path, format!("{}{}", format_line(&[1; 16], 100, 1, 0), "0202")).unwrap();
        let ledger = open(folder.path(), 0).unwrap();
        assert!(ledger.is_used(&[1; 16]));
        assert_eq!(ledger.used_until_s.len(), 1);
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
