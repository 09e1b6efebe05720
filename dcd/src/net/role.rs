//! Defines the roles of processes and the names that their certificates prove.

use std::fmt;
use std::str::FromStr;

use crate::space::{ClientId, NodeId};

/// The role of a process in a served world.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum JoinRole {
    /// Keeps the directory and the record of the world, and decides on membership.
    Server,
    /// Computes regions.
    Node,
    /// Hosts avatars.
    Client,
    /// Is node and client in one process (thesis: the usual case).
    Participant,
    /// Hosts avatars, and may also build: insert, change and remove what is the world's own, as the server's
    /// program does.
    Builder,
}

impl JoinRole {
    const ALL: [Self; 5] = [Self::Server, Self::Node, Self::Client, Self::Participant, Self::Builder];

    /// Returns whether a token for this role admits a process that wants to join as `wanted`. A builder's
    /// token admits clients too.
    pub(super) fn admits(self, wanted: Self) -> bool {
        self == wanted || (self, wanted) == (Self::Builder, Self::Client)
    }

    pub(super) fn code(self) -> u8 {
        match self {
            Self::Server => 0,
            Self::Node => 1,
            Self::Client => 2,
            Self::Participant => 3,
            Self::Builder => 4,
        }
    }

    pub(super) fn from_code(code: u8) -> Option<Self> {
        Self::ALL.into_iter().find(|role| role.code() == code)
    }
}

impl fmt::Display for JoinRole {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Server => "server",
            Self::Node => "node",
            Self::Client => "client",
            Self::Participant => "participant",
            Self::Builder => "builder",
        })
    }
}

impl FromStr for JoinRole {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL
            .into_iter()
            .find(|role| role.to_string() == text)
            .ok_or_else(|| format!("`{text}` is no role; say server, node, client, participant or builder"))
    }
}

/// The name of a process that its certificate proves: its role and the ids that the server gave it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum PeerName {
    /// The server, `server.dcd`.
    Server,
    /// A node, as `node-3.dcd`.
    Node(NodeId),
    /// A client, as `client-7.dcd`.
    Client(ClientId),
    /// A participant, as `node-3.dcd` and `client-7.dcd`.
    Participant(NodeId, ClientId),
    /// A builder, as `builder-7.dcd`. The name states the right to build, so that whoever issued it need not
    /// remember.
    Builder(ClientId),
}

impl PeerName {
    /// Returns the role that the name implies.
    pub fn role(self) -> JoinRole {
        match self {
            Self::Server => JoinRole::Server,
            Self::Node(_) => JoinRole::Node,
            Self::Client(_) => JoinRole::Client,
            Self::Participant(..) => JoinRole::Participant,
            Self::Builder(_) => JoinRole::Builder,
        }
    }

    /// Returns the id as a node; `None` if the process is none.
    pub fn node(self) -> Option<NodeId> {
        match self {
            Self::Node(node) | Self::Participant(node, _) => Some(node),
            Self::Server | Self::Client(_) | Self::Builder(_) => None,
        }
    }

    /// Returns the id as a client; `None` if the process is none.
    pub fn client(self) -> Option<ClientId> {
        match self {
            Self::Client(client) | Self::Participant(_, client) | Self::Builder(client) => Some(client),
            Self::Server | Self::Node(_) => None,
        }
    }

    /// Returns whether the process computes no regions: it is a client or a builder.
    pub(crate) fn is_client_only(self) -> bool {
        matches!(self, Self::Client(_) | Self::Builder(_))
    }

    /// Returns whether a process that proved to be `self` is the one that was dialled. A participant also
    /// answers to its names as node and as client.
    pub fn answers_to(self, expected: PeerName) -> bool {
        match expected {
            Self::Server | Self::Participant(..) | Self::Builder(_) => self == expected,
            Self::Node(node) => self.node() == Some(node),
            Self::Client(client) => self.client() == Some(client),
        }
    }

    /// Returns the name with this role and these ids, if they are exactly the ids that the role has.
    pub(super) fn from_parts(role: JoinRole, node: Option<NodeId>, client: Option<ClientId>) -> Option<Self> {
        match (role, node, client) {
            (JoinRole::Server, None, None) => Some(Self::Server),
            (JoinRole::Node, Some(node), None) => Some(Self::Node(node)),
            (JoinRole::Client, None, Some(client)) => Some(Self::Client(client)),
            (JoinRole::Participant, Some(node), Some(client)) => Some(Self::Participant(node, client)),
            (JoinRole::Builder, None, Some(client)) => Some(Self::Builder(client)),
            _ => None,
        }
    }

    /// Returns the DNS names of the certificate.
    pub(super) fn dns_names(self) -> Vec<String> {
        let mut names = Vec::new();
        if self == Self::Server {
            names.push("server.dcd".to_owned());
        }
        names.extend(self.node().map(|node| format!("node-{}.dcd", node.0)));
        let as_client = if let Self::Builder(_) = self { "builder" } else { "client" };
        names.extend(self.client().map(|client| format!("{as_client}-{}.dcd", client.0)));
        names
    }

    /// Returns the name that a certificate with exactly these DNS names proves.
    pub(super) fn from_dns_names<'a>(names: impl Iterator<Item = &'a str>) -> Option<Self> {
        let (mut server, mut builds, mut node, mut client) = (false, false, None, None);
        for name in names {
            let label = name.strip_suffix(".dcd")?;
            if label == "server" && !server {
                server = true;
            } else if let (Some(number), None) = (label.strip_prefix("node-"), node) {
                node = Some(NodeId(number.parse().ok()?));
            } else if let (Some(number), None) = (label.strip_prefix("client-"), client) {
                client = Some(ClientId(number.parse().ok()?));
            } else if let (Some(number), None) = (label.strip_prefix("builder-"), client) {
                (builds, client) = (true, Some(ClientId(number.parse().ok()?)));
            } else {
                return None;
            }
        }
        let role = match (server, node.is_some(), client.is_some()) {
            (true, ..) => JoinRole::Server,
            (false, false, true) if builds => JoinRole::Builder,
            // No process is both node and builder.
            (false, true, true) if builds => return None,
            (false, true, true) => JoinRole::Participant,
            (false, true, false) => JoinRole::Node,
            (false, false, _) => JoinRole::Client,
        };
        Self::from_parts(role, node, client)
    }
}

impl fmt::Display for PeerName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.dns_names().join("+"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [PeerName; 5] = [
        PeerName::Server,
        PeerName::Node(NodeId(3)),
        PeerName::Client(ClientId(7)),
        PeerName::Participant(NodeId(3), ClientId(7)),
        PeerName::Builder(ClientId(7)),
    ];

    #[test]
    fn every_name_survives_its_certificate() {
        for name in NAMES {
            assert_eq!(PeerName::from_dns_names(name.dns_names().iter().map(String::as_str)), Some(name));
        }
    }

    #[test]
    fn names_that_mix_or_repeat_roles_are_none() {
        for names in [
            vec![],
            vec!["server.dcd", "node-1.dcd"],
            vec!["node-1.dcd", "node-2.dcd"],
            vec!["node-1.dcd", "builder-1.dcd"],
            vec!["client-1.dcd", "builder-1.dcd"],
            vec!["node-x.dcd"],
            vec!["node-1.example"],
            vec!["leader.dcd"],
        ] {
            assert_eq!(PeerName::from_dns_names(names.iter().copied()), None, "{names:?}");
        }
    }

    #[test]
    fn a_participant_answers_as_node_and_as_client_but_not_as_another() {
        let both = NAMES[3];
        assert!(both.answers_to(PeerName::Node(NodeId(3))));
        assert!(both.answers_to(PeerName::Client(ClientId(7))));
        assert!(!both.answers_to(PeerName::Node(NodeId(4))));
        assert!(!PeerName::Client(ClientId(3)).answers_to(PeerName::Node(NodeId(3))));
    }

    #[test]
    fn a_builder_is_a_client_and_a_client_no_builder() {
        assert!(NAMES[4].answers_to(PeerName::Client(ClientId(7))));
        assert!(!NAMES[2].answers_to(NAMES[4]));
        assert!(JoinRole::Builder.admits(JoinRole::Client) && !JoinRole::Client.admits(JoinRole::Builder));
        assert!(!JoinRole::Builder.admits(JoinRole::Participant));
    }
}
