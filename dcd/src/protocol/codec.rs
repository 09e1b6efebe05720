//! Encodes messages to bytes and decodes them. Only this module knows bincode's settings (`=2.0.1`,
//! RUSTSEC-2025-0141).
//!
//! Bytes come from strangers, so four rules hold: the length is checked first; a claimed length never
//! allocates more than [`MAX_MESSAGE_BYTES`]; all bytes must be consumed; every value must pass [`Check`].

#[cfg(feature = "physics")]
use std::io::{Read, Write};

use bincode::{
    Decode, Encode,
    config::{Configuration, Limit, LittleEndian, Varint},
    enc::{EncoderImpl, write::SizeWriter},
    error::{DecodeError, EncodeError},
};
#[cfg(feature = "physics")]
use serde::{Serialize, de::DeserializeOwned};

use super::{Check, Chunk, Invalid, Message};
use crate::protocol::SharedState;
#[cfg(all(feature = "net", feature = "physics"))]
use crate::space::ClientId;

/// The version of the protocol. It grows with every change of the message set. Peers of different versions
/// refuse each other.
pub const VERSION: u32 = 41;

/// The longest message in bytes. A single shape (a height field of 2,000 × 2,000) needs most. A longer
/// message is refused before it is sent (`ShapeRecord::can_travel`).
pub const MAX_MESSAGE_BYTES: usize = 16 << 20;

/// The target size of one chunk of a world in bytes: small enough not to hold up other traffic of its link.
pub const CHUNK_BYTES: usize = 256 << 10;

/// The longest datagram in bytes: below the smallest path MTU in common use, with QUIC's own overhead.
pub const DATAGRAM_BYTES: usize = 1_100;

const CONFIG: Configuration<LittleEndian, Varint, Limit<MAX_MESSAGE_BYTES>> =
    bincode::config::standard().with_limit::<MAX_MESSAGE_BYTES>();

/// The reason why bytes are not a message.
#[derive(Debug, thiserror::Error)]
pub enum CodecError {
    /// The length alone is refused.
    #[error(
        "a message of {0} bytes is over the limit of {MAX_MESSAGE_BYTES}: the peer is not a dcd of this version"
    )]
    TooLong(usize),
    /// The bytes are not in the format.
    #[error(
        "not a dcd message ({0}): the peer is broken or of another version; install the same dcd on both"
    )]
    Malformed(#[from] DecodeError),
    /// The first message is that of a peer of another version, in that version's format.
    #[error("it speaks protocol version {theirs}, and this side {ours}: install the same dcd on both")]
    Version {
        /// The peer's version.
        theirs: u32,
        /// The version of this side.
        ours: u32,
    },
    /// There are more bytes than the message has.
    #[error(
        "{0} bytes follow the message: the peer is broken or of another version; install the same dcd on both"
    )]
    Trailing(usize),
    /// The states cannot be unpacked.
    #[error(
        "states for clients cannot be unpacked: the peer is broken or of another version; install the same dcd on both"
    )]
    Compact,
    /// The message is well-formed, but a value in it is not allowed.
    #[error("refused a message: {0}")]
    Invalid(#[from] Invalid),
}

/// Encodes a message.
///
/// # Panics
/// When the message is longer than [`MAX_MESSAGE_BYTES`]: senders split what may grow with [`chunks`].
pub fn encode(message: &Message) -> Vec<u8> {
    let bytes = bincode::encode_to_vec(message, CONFIG).expect("plain values in memory encode");
    assert!(bytes.len() <= MAX_MESSAGE_BYTES, "a message of {} bytes was not split", bytes.len());
    bytes
}

/// Decodes a message and checks it.
pub fn decode(bytes: &[u8]) -> Result<Message, CodecError> {
    if bytes.len() > MAX_MESSAGE_BYTES {
        return Err(CodecError::TooLong(bytes.len()));
    }
    let message = decode_value::<Message>(bytes);
    match (message, foreign_version(bytes)) {
        (Err(_), Some(theirs)) => Err(CodecError::Version { theirs, ours: VERSION }),
        (message, _) => message,
    }
}

/// Returns the version of a greeting's sender, if it differs from ours: greetings of all versions begin
/// alike.
fn foreign_version(bytes: &[u8]) -> Option<u32> {
    const HELLO: u32 = 0;
    let ((kind, version), _): ((u32, u32), _) = bincode::decode_from_slice(bytes, CONFIG).ok()?;
    (kind == HELLO && version != VERSION).then_some(version)
}

/// Returns the client whose acknowledgement of states the bytes are, if they begin as one. So no other
/// message need be decoded to know that it is none.
#[cfg(all(feature = "net", feature = "physics"))]
pub(crate) fn begins_as_heard(bytes: &[u8]) -> Option<ClientId> {
    /// The tags of [`Message::FromClient`] and [`FromClient::Heard`](super::FromClient::Heard), as they are
    /// encoded.
    const KINDS: (u32, u32) = (8, 7);
    let ((from_client, client, heard), _): ((u32, ClientId, u32), _) =
        bincode::decode_from_slice(bytes, CONFIG).ok()?;
    ((from_client, heard) == KINDS).then_some(client)
}

/// Encodes any value of the protocol, for our own files and tests. [`encode`] is for the wire.
pub fn encode_value<T: Encode>(value: &T) -> Vec<u8> {
    bincode::encode_to_vec(value, CONFIG).expect("plain values in memory encode")
}

/// Decodes a value that [`encode_value`] encoded, and checks it.
pub fn decode_value<T: Decode<()> + Check>(bytes: &[u8]) -> Result<T, CodecError> {
    if bytes.len() > MAX_MESSAGE_BYTES {
        return Err(CodecError::TooLong(bytes.len()));
    }
    let (value, read): (T, usize) = bincode::decode_from_slice(bytes, CONFIG)?;
    if read != bytes.len() {
        return Err(CodecError::Trailing(bytes.len() - read));
    }
    value.check()?;
    Ok(value)
}

/// Writes a value of our own of any length with serde, as the content of a snapshot.
#[cfg(feature = "physics")]
pub(crate) fn write_state(value: &impl Serialize, to: &mut impl Write) -> Result<(), EncodeError> {
    bincode::serde::encode_into_std_write(value, to, bincode::config::standard())?;
    Ok(())
}

/// Reads a value that [`write_state`] wrote. Nothing in it is checked, so it is only for bytes that have
/// proved to be ours.
#[cfg(feature = "physics")]
pub(crate) fn read_state<T: DeserializeOwned>(from: &mut impl Read) -> Result<T, DecodeError> {
    bincode::serde::decode_from_std_read(from, bincode::config::standard())
}

/// Returns the encoded length of a value in bytes.
pub fn encoded_len<T: Encode>(value: &T) -> usize {
    let measure = || -> Result<usize, EncodeError> {
        let mut encoder = EncoderImpl::new(SizeWriter::default(), CONFIG);
        value.encode(&mut encoder)?;
        Ok(encoder.into_writer().bytes_written)
    };
    measure().expect("plain values in memory encode")
}

/// Returns the most items of type `T` that a list in a message may have. The reader counts items by their
/// size in memory, before it reads them.
pub(crate) const fn most_items<T>() -> usize {
    MAX_MESSAGE_BYTES / 2 / if size_of::<T>() == 0 { 1 } else { size_of::<T>() }
}

/// Splits items, in order, into parts of at most `limit` encoded bytes that can be read again. An item that
/// is longer is a part of its own.
pub fn split<T: Encode>(items: impl IntoIterator<Item = T>, limit: usize) -> Vec<Vec<T>> {
    let mut parts: Vec<Vec<T>> = Vec::new();
    let mut room = 0;
    for item in items {
        let len = encoded_len(&item);
        match parts.last_mut() {
            Some(part) if len <= room && part.len() < most_items::<T>() => part.push(item),
            _ => {
                parts.push(vec![item]);
                room = limit;
            }
        }
        room = room.saturating_sub(len);
    }
    parts
}

/// Splits a list of any length into chunks of a world.
pub fn chunks<T: Encode>(items: impl IntoIterator<Item = T>, chunk: fn(Vec<T>) -> Chunk) -> Vec<Chunk> {
    split(items, CHUNK_BYTES).into_iter().map(chunk).collect()
}

/// The longest envelope of a datagram of states, in bytes: two tags, client id, group, three times, a flag,
/// three counters and a length.
const ENVELOPE_BYTES: usize = 2 + 5 + 5 + 3 * 9 + 1 + 1 + 3 * 5 + 3;

/// The most bytes of [`Part::states`](super::Part::states) in a datagram.
pub const STATES_BYTES: usize = DATAGRAM_BYTES - ENVELOPE_BYTES;

/// Splits states into parts that each fit a datagram with its envelope.
pub fn datagrams(states: impl IntoIterator<Item = SharedState>) -> Vec<Vec<SharedState>> {
    split(states, STATES_BYTES)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::protocol::{
        Border, Dispatch, FromClient, PROGRAM_DATAGRAM_BYTES, PROGRAM_MESSAGE_BYTES, Part, Ping, Program,
        Stamp, ToClient, ToNode, Velocity, ViewNumber, WorldOp, WorldPose,
    };
    use crate::space::{BodyId, ClientId, Epoch, RegionId, Tick};

    fn state(index: u32) -> SharedState {
        SharedState {
            id: BodyId::avatar(ClientId(7), index),
            owner: RegionId(u32::MAX),
            epoch: Epoch(1 << 63),
            pose: WorldPose::at([1e6, -2.0, 0.125]),
            velocity: Velocity { linear: [1.0, f32::MIN_POSITIVE, -0.0], angular: [0.0; 3] },
            sleeping: false,
        }
    }

    fn stamp(tick: u64) -> Stamp {
        Stamp::untimed(crate::space::GroupId(u32::MAX), Tick(tick), true)
    }

    fn sample() -> Message {
        let input = crate::protocol::Input {
            body: BodyId::avatar(ClientId(3), 1),
            logical_time: 9,
            tick: Tick(301),
            velocity: Velocity::default(),
            pose: Some(WorldPose::default()),
            drive: None,
        };
        let ops = vec![WorldOp::Remove(BodyId::persistent(4)), WorldOp::Input(input)];
        Message::Dispatch(Dispatch { view: ViewNumber(2), tick: Tick(300), rounds: 2, ops })
    }

    #[test]
    fn a_message_comes_back_equal_and_has_the_length_that_was_foretold() {
        let bytes = encode(&sample());
        assert_eq!(decode(&bytes).unwrap(), sample());
        assert_eq!(encoded_len(&sample()), bytes.len());
    }

    #[test]
    #[cfg(all(feature = "net", feature = "physics"))]
    fn an_acknowledgement_is_known_by_how_it_begins() {
        for client in [ClientId(7), ClientId(u32::MAX)] {
            let heard = crate::protocol::Heard {
                series: 1 << 20,
                datagrams: vec![(5, 3)],
                lost: true,
                bytes_per_s: 9,
            };
            let heard = encode(&Message::FromClient(client, FromClient::Heard(heard)));
            let end = heard.len() - 10;
            assert_eq!(begins_as_heard(&heard), Some(client));
            assert_eq!(begins_as_heard(&heard[..end]), Some(client), "no more is looked at");
            let others = [
                Message::FromClient(client, FromClient::Leave),
                Message::FromClient(client, FromClient::Introduce(vec![])),
                Message::FromClient(client, FromClient::Build { number: 7, ops: vec![] }),
                Message::Ping(Ping { sent_us: 7 }),
                Message::Program(Program::Datagram(vec![7; 9])),
                sample(),
            ];
            for other in others {
                assert_eq!(begins_as_heard(&encode(&other)), None, "{other:?}");
            }
        }
        assert_eq!(begins_as_heard(&[]), None);
    }

    #[test]
    fn every_truncation_and_every_extra_byte_is_refused() {
        let bytes = encode(&sample());
        for end in 0..bytes.len() {
            assert!(decode(&bytes[..end]).is_err(), "{end} of {} bytes", bytes.len());
        }
        let longer = [bytes, vec![0]].concat();
        assert!(matches!(decode(&longer), Err(CodecError::Trailing(1))));
        assert!(matches!(decode(&vec![0; MAX_MESSAGE_BYTES + 1]), Err(CodecError::TooLong(_))));
    }

    #[test]
    fn a_claim_of_four_gigabytes_is_refused_before_allocation() {
        // Claims 2^32 - 1 and then 2^63 items wherever a length may stand. If that were allocated, this test
        // would abort.
        let empty_border =
            Message::Border(Border { view: ViewNumber(1), tick: Tick(1), round: 0, messages: vec![] });
        for bytes in [encode(&empty_border), encode(&sample())] {
            for at in 0..bytes.len() {
                for claim in [&[252, 255, 255, 255, 255][..], &[253, 0, 0, 0, 0, 0, 0, 0, 128]] {
                    let forged = [&bytes[..at], claim, &bytes[at + 1..]].concat();
                    let _ = decode(&forged);
                }
            }
        }
        let forged = [&encode(&empty_border)[..4], &[252, 255, 255, 255, 255]].concat();
        assert!(matches!(decode(&forged), Err(CodecError::Malformed(DecodeError::LimitExceeded))));
    }

    fn status() -> Message {
        use crate::protocol::{GroupStatus, NodeStatus, RegionStatus, Status};
        use crate::space::{Bounds, GroupId, NodeId, RegionId};
        let bounds = Bounds::new([0.0; 3], [8.0; 3]);
        let region = RegionStatus { region: RegionId(1), owner: NodeId(1), bodies: 3, bounds };
        let group = GroupStatus {
            group: GroupId(1),
            view: ViewNumber(1),
            tick: Tick(9),
            leader: Some(NodeId(1)),
            is_changing: false,
            clients: 1,
            regions: vec![region],
            fidelity: None,
        };
        let node = NodeStatus {
            node: NodeId(1),
            address: "127.0.0.1:1".parse().unwrap(),
            client: None,
            group: Some(GroupId(1)),
            is_linked: true,
            is_loaded: true,
            is_leaving: false,
            delay_ms: Some(0.5),
            unreached: 0,
        };
        let (groups, nodes) = (vec![group], vec![node]);
        Message::Status(Status {
            tick: Tick(9),
            heard_ms: 400,
            dt_s: 0.1,
            bodies: 3,
            clients: 1,
            main: GroupId(1),
            groups,
            nodes,
        })
    }

    #[test]
    fn a_status_that_breaks_a_rule_is_refused() {
        let refused = |change: fn(&mut crate::protocol::Status)| {
            let Message::Status(mut status) = status() else { panic!() };
            change(&mut status);
            decode(&encode(&Message::Status(status))).unwrap_err().to_string()
        };
        assert!(decode(&encode(&status())).is_ok());
        assert!(refused(|status| status.dt_s = f32::NAN).contains("status.dt_s"));
        assert!(refused(|status| status.groups.push(status.groups[0].clone())).contains("status.groups"));
        assert!(refused(|status| status.nodes.push(status.nodes[0].clone())).contains("status.nodes"));
        let doubled = |status: &mut crate::protocol::Status| {
            let region = status.groups[0].regions[0].clone();
            status.groups[0].regions.push(region);
        };
        assert!(refused(doubled).contains("status.regions"));
        assert!(refused(|status| status.nodes[0].delay_ms = Some(-1.0)).contains("status.delay_ms"));
    }

    #[test]
    fn a_value_that_breaks_a_rule_is_refused_by_the_name_of_its_field() {
        let with = |change: fn(&mut SharedState)| {
            let mut state = state(0);
            change(&mut state);
            let message =
                Message::ToClient(ClientId(1), ToClient::States { stamp: stamp(1), states: vec![state] });
            decode(&encode(&message)).unwrap_err().to_string()
        };
        assert!(with(|s| s.pose.translation[1] = f64::NAN).contains("pose.translation"));
        assert!(with(|s| s.pose.rotation = [0.0; 4]).contains("pose.rotation must be a unit quaternion"));
        assert!(with(|s| s.velocity.angular[2] = f32::INFINITY).contains("velocity"));
        let nobody = Message::FromClient(ClientId(0), FromClient::Leave);
        assert!(decode(&encode(&nobody)).unwrap_err().to_string().contains("client"));
    }

    #[test]
    fn nobody_lay_far_from_where_it_is_when_its_contacts_were_found() {
        let refusal = |moved_m: [f32; 3], turned: [f32; 3]| {
            let mut body = crate::sim::sim_body(BodyId::persistent(1), [1.0; 3]);
            body.state.contact_offset = Some(crate::protocol::ContactOffset { moved_m, turned });
            let placed = crate::protocol::Placed { region: Default::default(), body };
            let chunk = crate::protocol::ToNode::Chunk(crate::protocol::Chunk::Placed(vec![placed]));
            decode(&encode(&Message::ToNode(chunk))).err().map(|error| error.to_string())
        };
        assert_eq!(refusal([0.3, -0.3, 0.0], [0.0, 0.1, 0.0]), None);
        for far in [[0.4, -0.4, 0.0], [0.0, f32::NAN, 0.0], [f32::INFINITY, 0.0, 0.0]] {
            assert!(refusal(far, [0.0; 3]).unwrap().contains("contact_offset.moved_m"), "{far:?}");
            assert!(refusal([0.0; 3], far).unwrap().contains("contact_offset.turned"), "{far:?}");
        }
    }

    #[test]
    fn ticks_views_and_epochs_from_which_nobody_could_count_on_are_refused() {
        let refusal = |message: Message| decode(&encode(&message)).unwrap_err().to_string();
        let (view, ops) = (ViewNumber(1), Vec::new());
        let dispatch = Dispatch { view, tick: Tick(u64::MAX), rounds: 1, ops };
        assert!(refusal(Message::Dispatch(dispatch)).contains("tick"));
        let (stamp, states) = (stamp(u64::MAX), Vec::new());
        let told = ToClient::States { stamp, states };
        assert!(refusal(Message::ToClient(ClientId(1), told)).contains("tick"));
        let settle = crate::protocol::ToNode::Settle { view: ViewNumber(1 << 40) };
        assert!(refusal(Message::ToNode(settle)).contains("view"));
        let last = SharedState { epoch: Epoch(u64::MAX), ..state(0) };
        let report = crate::protocol::Report { view, tick: Tick(1), states: vec![last] };
        assert!(refusal(Message::Report(report)).contains("epoch"));
    }

    #[test]
    fn a_full_part_of_states_fits_a_datagram() {
        let part =
            Part { series: u32::MAX, batch: u32::MAX, number: u32::MAX, states: vec![7; STATES_BYTES] };
        let stamp = Stamp { opened_us: u64::MAX, applied: u64::MAX, early: i8::MIN, ..stamp(u64::MAX) };
        let message = Message::ToClient(ClientId(u32::MAX), ToClient::CompactStates { stamp, part });
        assert!((DATAGRAM_BYTES - 8..=DATAGRAM_BYTES).contains(&encode(&message).len()));
    }

    #[test]
    fn what_programs_say_is_bounded_and_a_datagram_of_theirs_fits_one() {
        let message = |program| encode(&Message::Program(program));
        let longest = message(Program::Datagram(vec![0; PROGRAM_DATAGRAM_BYTES]));
        assert!(longest.len() <= DATAGRAM_BYTES, "{}", longest.len());
        assert!(decode(&longest).is_ok());
        let refusal = |bytes: Vec<u8>| decode(&bytes).unwrap_err().to_string();
        let datagram = Program::Datagram(vec![0; PROGRAM_DATAGRAM_BYTES + 1]);
        assert!(refusal(message(datagram)).contains("program.datagram"));
        let long = message(Program::Message(vec![0; PROGRAM_MESSAGE_BYTES]));
        assert!(decode(&long).is_ok() && long.len() <= super::super::link::CLIENT_FRAME_BYTES);
        let longer = Program::Message(vec![0; PROGRAM_MESSAGE_BYTES + 1]);
        assert!(refusal(message(longer)).contains("program.message"));
    }

    #[test]
    fn an_item_longer_than_a_part_stands_alone() {
        let items = vec![vec![0_u8; 10], vec![0; 200], vec![0; 10], vec![0; 10]];
        let sizes: Vec<_> = split(items, 100).iter().map(Vec::len).collect();
        assert_eq!(sizes, [1, 1, 2]);
    }

    proptest! {
        #[test]
        fn random_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..600)) {
            let _ = decode(&bytes);
        }

        #[test]
        fn changed_bytes_never_panic(at in 0_usize..4096, to in any::<u8>()) {
            let world = crate::protocol::EnvironmentProperties {
                world: 1,
                step: crate::protocol::StepRecord {
                    gravity: [0.0, -9.81, 0.0],
                    dt_s: 1.0 / 60.0,
                    solver_iterations: 4,
                    coupling: crate::protocol::Coupling::Owner,
                    exchanges: 1,
                    depth: 2,
                    island_limit: 256,
                    tolerance_m_s: 0.03,
                    speed_limit_m_s: 400.0,
                },
                tree: crate::space::DistributionTree::halved(
                    crate::space::Bounds::new([0.0; 3], [8.0; 3]), 4).unwrap(),
                balance: None,
                fidelity: crate::fidelity::Fidelity::Off,
                viewpoints: Vec::new(),
                halo_m: None,
                avatar_speed_limit: 10.0,
                protocol: crate::protocol::SyncProtocol::Synchronised,
                thresholds: Default::default(),
                pace: crate::protocol::Pace::RealTime,
                state_every: 3,
                last_tick: None,
                relays_above: None,
            };
            let welcome = Message::ToNode(ToNode::Welcome { id: crate::space::NodeId(1), incarnation: 1, world });
            for message in [sample(), welcome, Message::Ping(Ping { sent_us: 5 }), status()] {
                let mut bytes = encode(&message);
                let at = at % bytes.len();
                bytes[at] = to;
                if let Ok(message) = decode(&bytes) {
                    prop_assert_eq!(encode(&decode(&encode(&message)).unwrap()), encode(&message));
                }
            }
        }
    }
}
