//! Hands what clients acknowledge straight to the thread that tells them (`fan_out`). This runs on the
//! network's thread: each client acknowledges each batch of states, which would otherwise wake the loop that
//! computes the world, or another thread, several times per tick.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use super::bandwidth::Received;
use super::fan_out::Ear;
use crate::net::{NetEvent, PeerKey, PeerName};
use crate::protocol::{self, FromClient, Message};
use crate::space::ClientId;

/// The acknowledgements of clients that have a link of their own. The loop checks those that a node passes on
/// for its user.
pub(super) struct Acknowledgements {
    clients: BTreeMap<PeerKey, ClientId>,
    ear: Ear,
    /// Counts the acknowledgements taken.
    received: Arc<Mutex<Received>>,
}

impl Acknowledgements {
    pub(super) fn new(ear: Ear, received: Arc<Mutex<Received>>) -> Self {
        Self { clients: BTreeMap::new(), ear, received }
    }

    /// Takes an event that is a client's acknowledgement of its own, and returns whether it was one. All else
    /// is left to the loop, and so is what breaks a rule.
    pub(super) fn take(&mut self, event: &NetEvent) -> bool {
        match event {
            NetEvent::Connected {
                peer, who: PeerName::Client(client) | PeerName::Builder(client), ..
            } => {
                // A message over the client's former link is about what it was told there.
                self.clients.retain(|_, other| other != client);
                self.clients.insert(*peer, *client);
                false
            }
            NetEvent::Closed { peer, .. } => {
                self.clients.remove(peer);
                false
            }
            NetEvent::Datagram { peer, bytes } => self.clients.get(peer).is_some_and(|&client| {
                // The loop decodes its own messages.
                if protocol::begins_as_heard(bytes) != Some(client) {
                    return false;
                }
                let Ok(message) = protocol::decode(bytes) else { return false };
                let subject = message.subject();
                match message {
                    Message::FromClient(_, FromClient::Heard(heard)) => {
                        let mut received = self.received.lock().unwrap_or_else(PoisonError::into_inner);
                        received.count(subject, bytes.len());
                        drop(received);
                        self.ear.hear(client, heard);
                        true
                    }
                    _ => false,
                }
            }),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Heard, Ping, encode};
    use crate::space::NodeId;

    const CLIENT: ClientId = ClientId(7);

    fn heard(client: ClientId) -> Vec<u8> {
        let heard = Heard { series: 9, datagrams: vec![(1, 1)], lost: false, bytes_per_s: 0 };
        encode(&Message::FromClient(client, FromClient::Heard(heard)))
    }

    #[test]
    fn what_clients_acknowledge_goes_past_the_loop_and_nothing_else() {
        let (ear, counted) = (Ear::of_leader(), Arc::default());
        let mut acknowledgements = Acknowledgements::new(ear.clone(), Arc::clone(&counted));
        let connected = |key, who| NetEvent::Connected {
            peer: PeerKey::numbered(key),
            who,
            addr: ([127, 0, 0, 1], 1).into(),
        };
        let said =
            |key, bytes: &[u8]| NetEvent::Datagram { peer: PeerKey::numbered(key), bytes: bytes.to_vec() };
        let (own, other) = (heard(CLIENT), heard(ClientId(8)));
        assert!(!acknowledgements.take(&said(1, &own)), "nobody is known to be there");
        assert!(!acknowledgements.take(&connected(1, PeerName::Client(CLIENT))), "the loop is told of links");
        assert!(!acknowledgements.take(&connected(2, PeerName::Participant(NodeId(3), ClientId(8)))));
        assert!(acknowledgements.take(&said(1, &own)));
        assert_eq!(ear.waiting(), 1);
        let ping = encode(&Message::Ping(Ping { sent_us: 7 }));
        for (key, bytes) in [(1, &other[..]), (2, &other), (2, &own), (1, &ping), (1, &own[1..]), (1, &[])] {
            assert!(!acknowledgements.take(&said(key, bytes)), "{key}: {bytes:?}");
        }
        let count = counted.lock().unwrap().iter().map(|(_, count)| count.messages).sum::<u64>();
        assert_eq!((ear.waiting(), count), (1, 1));
        // A client with a new link is heard neither over its former link nor over one that has ended.
        assert!(!acknowledgements.take(&connected(3, PeerName::Builder(CLIENT))));
        assert!(!acknowledgements.take(&said(1, &own)) && acknowledgements.take(&said(3, &own)));
        let closed = NetEvent::Closed {
            peer: PeerKey::numbered(3),
            who: PeerName::Builder(CLIENT),
            cause: crate::net::CloseCause::TimedOut,
            reason: String::new(),
        };
        assert!(!acknowledgements.take(&closed) && !acknowledgements.take(&said(3, &own)));
    }
}
