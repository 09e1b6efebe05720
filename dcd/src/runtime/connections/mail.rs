//! Queues the messages of the programs at both ends of a link, with flow control: what waits to be sent, how
//! much room is left at the other end, and what has come.
//!
//! **A program that takes nothing** holds back those who write to it, and nobody else. At most
//! [`PROGRAM_WINDOW_BYTES`] of messages are on their way or untaken. As much again waits at the sender;
//! beyond that sending fails. Of datagrams the newest are dropped, and counted. Nothing that the world needs
//! waits for either.

use std::collections::VecDeque;

use super::{ConnectionError, Delivery};
use crate::protocol::link::PROGRAM_WINDOW_BYTES;
use crate::protocol::{self, Message, PROGRAM_DATAGRAM_BYTES, PROGRAM_MESSAGE_BYTES, Program};

/// The most bytes of datagrams that wait to be sent, or to be taken.
const DATAGRAMS_BYTES: usize = 64 << 10;
/// The other end is told of room each time this much more of it is free. The rest is enough for any message.
const TELL_BYTES: usize = PROGRAM_WINDOW_BYTES / 4;

/// Returns the weight of a message, which is what it takes of the window: its bytes and the overhead of
/// keeping it.
pub(super) fn weight(bytes: &[u8]) -> usize {
    const OVERHEAD_BYTES: usize = 64;
    bytes.len() + OVERHEAD_BYTES
}

/// The outcome of sending a frame.
pub(in crate::runtime) enum Sent {
    /// The frame is on its way, or was lost with its link.
    Done,
    /// There is no room for the frame now.
    Waits,
    /// There was no room for the frame, and it must not wait.
    Dropped,
}

/// The mail of both directions of one link.
#[derive(Default)]
pub(super) struct Mail {
    /// Frames to be sent, each with the weight of its message.
    messages: VecDeque<(Vec<u8>, usize)>,
    messages_weight: usize,
    datagrams: VecDeque<Vec<u8>>,
    datagrams_weight: usize,
    /// Weight of all messages sent, and of those that the other program has taken.
    sent: u64,
    taken_there: u64,
    /// Weight of all messages that came, of those that our program has taken, and of those that the other end
    /// knows to be taken.
    came: u64,
    taken: u64,
    told: u64,
    /// Weight of datagrams that came and are not taken yet.
    untaken_datagrams: usize,
    /// Datagrams dropped here, in both directions.
    pub(super) dropped: u64,
}

impl Mail {
    /// Queues a message for sending.
    pub(super) fn post(&mut self, bytes: &[u8], delivery: Delivery) -> Result<(), ConnectionError> {
        let limit = match delivery {
            Delivery::Message => PROGRAM_MESSAGE_BYTES,
            Delivery::Datagram => PROGRAM_DATAGRAM_BYTES,
        };
        if bytes.len() > limit {
            return Err(ConnectionError::TooLong { bytes: bytes.len(), limit });
        }
        let weight = weight(bytes);
        let (waiting, most, program) = match delivery {
            Delivery::Message => {
                (&mut self.messages_weight, PROGRAM_WINDOW_BYTES, Program::Message(bytes.to_vec()))
            }
            Delivery::Datagram => {
                (&mut self.datagrams_weight, DATAGRAMS_BYTES, Program::Datagram(bytes.to_vec()))
            }
        };
        if *waiting + weight > most {
            return Err(ConnectionError::Full);
        }
        *waiting += weight;
        let frame = protocol::encode(&Message::Program(program));
        match delivery {
            Delivery::Message => self.messages.push_back((frame, weight)),
            Delivery::Datagram => self.datagrams.push_back(frame),
        }
        Ok(())
    }

    /// Sends what there is room for. Returns whether anything waits for room on the link. What waits for the
    /// other program does not count: that program reports room by itself.
    pub(super) fn send(&mut self, mut send: impl FnMut(&[u8], Delivery) -> Sent) -> bool {
        self.datagrams_weight = 0;
        for frame in self.datagrams.drain(..) {
            if !matches!(send(&frame, Delivery::Datagram), Sent::Done) {
                self.dropped += 1;
            }
        }
        if self.is_to_tell() {
            let taken = protocol::encode(&Message::Program(Program::Taken(self.taken)));
            if matches!(send(&taken, Delivery::Message), Sent::Waits) {
                return true;
            }
            self.told = self.taken;
        }
        while let Some((frame, weight)) = self.messages.front() {
            if self.sent - self.taken_there + *weight as u64 > PROGRAM_WINDOW_BYTES as u64 {
                return false;
            }
            if matches!(send(frame, Delivery::Message), Sent::Waits) {
                return true;
            }
            self.sent += *weight as u64;
            self.messages_weight -= weight;
            self.messages.pop_front();
        }
        false
    }

    /// Takes in a frame of the other end, and returns the bytes for our program, if any. An error names the
    /// rule that the frame broke.
    pub(super) fn hear(&mut self, program: Program) -> Result<Option<(Vec<u8>, Delivery)>, &'static str> {
        match program {
            Program::Message(bytes) => {
                self.came += weight(&bytes) as u64;
                if self.came - self.taken > PROGRAM_WINDOW_BYTES as u64 {
                    return Err("more messages than there was room for");
                }
                Ok(Some((bytes, Delivery::Message)))
            }
            Program::Datagram(bytes) => {
                if self.untaken_datagrams + weight(&bytes) > DATAGRAMS_BYTES {
                    self.dropped += 1;
                    return Ok(None);
                }
                self.untaken_datagrams += weight(&bytes);
                Ok(Some((bytes, Delivery::Datagram)))
            }
            Program::Taken(taken) if (self.taken_there..=self.sent).contains(&taken) => {
                self.taken_there = taken;
                Ok(None)
            }
            Program::Taken(_) => Err("more messages taken than were sent"),
        }
    }

    /// Records that our program took a message.
    pub(super) fn take(&mut self, bytes: &[u8], delivery: Delivery) {
        match delivery {
            Delivery::Message => self.taken += weight(bytes) as u64,
            Delivery::Datagram => self.untaken_datagrams -= weight(bytes),
        }
    }

    /// Returns whether the other end should be told that there is more room.
    pub(super) fn is_to_tell(&self) -> bool {
        self.taken - self.told >= TELL_BYTES as u64
    }

    /// Returns the weight of what came and is not taken yet.
    pub(super) fn untaken(&self) -> u64 {
        self.came - self.taken + self.untaken_datagrams as u64
    }

    /// Resets the mail when its link is gone, and drops what waited to be sent.
    pub(super) fn end(&mut self) {
        // Dropped datagrams are counted. Messages are not, since their sender learns of the loss.
        let dropped = self.dropped + self.datagrams.len() as u64;
        *self = Self { dropped, ..Self::default() };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns all that would be sent over a link with room for it, decoded.
    fn sent(mail: &mut Mail) -> Vec<Program> {
        let mut programs = Vec::new();
        mail.send(|frame, _| {
            let Ok(Message::Program(program)) = protocol::decode(frame) else { panic!() };
            programs.push(program);
            Sent::Done
        });
        programs
    }

    /// Posts messages until there is no more room; returns how many were posted.
    fn fill(mail: &mut Mail, bytes: &[u8], delivery: Delivery) -> usize {
        let mut count = 0;
        while mail.post(bytes, delivery) != Err(ConnectionError::Full) {
            count += 1;
        }
        count
    }

    #[test]
    fn a_program_that_takes_nothing_stops_its_writer_and_one_that_takes_lets_it_go_on() {
        let (mut here, mut there) = (Mail::default(), Mail::default());
        let bytes = [7; 1_000];
        let window = PROGRAM_WINDOW_BYTES / weight(&bytes);
        assert_eq!(fill(&mut here, &bytes, Delivery::Message), window);
        let mut came = sent(&mut here);
        assert_eq!(came.len(), window);
        assert_eq!(fill(&mut here, &bytes, Delivery::Message), window, "as much again waits here");
        assert_eq!(sent(&mut here), []);
        for program in came.drain(..) {
            assert_eq!(there.hear(program), Ok(Some((bytes.to_vec(), Delivery::Message))));
        }
        let mut told = Vec::new();
        for _ in 0..window {
            there.take(&bytes, Delivery::Message);
            told.extend(sent(&mut there));
        }
        assert!((3..=4).contains(&told.len()), "now and then: {told:?}");
        for taken in told {
            assert_eq!(here.hear(taken), Ok(None));
        }
        assert!(sent(&mut here).len() > window * 3 / 4 - 1);
        assert_ne!(here.post(&bytes, Delivery::Message), Err(ConnectionError::Full));
    }

    #[test]
    fn the_longest_message_always_finds_room_once_all_is_taken() {
        let (mut here, mut there) = (Mail::default(), Mail::default());
        let longest = [0; PROGRAM_MESSAGE_BYTES];
        let short = [0; TELL_BYTES - 65];
        for bytes in [&short[..], &longest, &longest, &longest, &short, &longest] {
            here.post(bytes, Delivery::Message).unwrap();
            let [program] = <[_; 1]>::try_from(sent(&mut here)).expect("there is room");
            there.hear(program).unwrap();
            there.take(bytes, Delivery::Message);
            sent(&mut there).into_iter().for_each(|taken| drop(here.hear(taken).unwrap()));
        }
        let long = vec![0; PROGRAM_MESSAGE_BYTES + 1];
        let limit = PROGRAM_MESSAGE_BYTES;
        let too_long = ConnectionError::TooLong { bytes: limit + 1, limit };
        assert_eq!(here.post(&long, Delivery::Message), Err(too_long));
    }

    #[test]
    fn a_link_without_room_keeps_messages_and_drops_datagrams() {
        let mut mail = Mail::default();
        mail.post(b"kept", Delivery::Message).unwrap();
        mail.post(b"dropped", Delivery::Datagram).unwrap();
        let full = |_: &[u8], delivery| match delivery {
            Delivery::Message => Sent::Waits,
            Delivery::Datagram => Sent::Dropped,
        };
        assert!(mail.send(full), "it is to be tried again");
        assert_eq!((sent(&mut mail), mail.dropped), (vec![Program::Message(b"kept".to_vec())], 1));
    }

    #[test]
    fn datagrams_that_nobody_takes_are_dropped_and_those_taken_make_room() {
        let (mut mail, bytes) = (Mail::default(), [1; PROGRAM_DATAGRAM_BYTES]);
        let most = DATAGRAMS_BYTES / weight(&bytes);
        let hear = |mail: &mut Mail| mail.hear(Program::Datagram(bytes.to_vec())).unwrap().is_some();
        assert!((0..most).all(|_| hear(&mut mail)));
        assert!(!hear(&mut mail) && mail.dropped == 1);
        mail.take(&bytes, Delivery::Datagram);
        assert!(hear(&mut mail));
        assert_eq!(fill(&mut mail, &bytes, Delivery::Datagram), most, "to be sent, too");
    }

    #[test]
    fn who_sends_more_than_there_is_room_for_breaks_a_rule() {
        let mut mail = Mail::default();
        let bytes = vec![0; PROGRAM_MESSAGE_BYTES];
        let fits = PROGRAM_WINDOW_BYTES / weight(&bytes);
        assert!((0..fits).all(|_| mail.hear(Program::Message(bytes.clone())).is_ok()));
        assert!(mail.hear(Program::Message(bytes)).is_err());
        assert!(mail.hear(Program::Taken(1)).is_err(), "nothing was sent");
    }
}
