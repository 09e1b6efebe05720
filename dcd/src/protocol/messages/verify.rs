//! Defines the messages by which a dedicated leader computes once more what participants compute, and
//! compares.

use bincode::{Decode, Encode};

use super::ViewNumber;
use super::group::Border;
use crate::protocol::encode_value;
use crate::space::{BodyId, NodeId, RegionId, Tick};

/// A participant whose regions the leader computes once more.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Verified {
    /// The participant.
    pub node: NodeId,
    /// Says whether it begins with the view, and so has kept nothing of an earlier one.
    pub anew: bool,
    /// The bodies that it is told to let go of. Sent to the leader alone.
    pub drop: Vec<BodyId>,
}

/// What a member has taken in from other members in one tick.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Testimony {
    /// The view.
    pub view: ViewNumber,
    /// The tick.
    pub tick: Tick,
    /// The border messages, in order of rounds.
    pub heard: Vec<HeardBorder>,
}

/// A border message that a member has taken in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct HeardBorder {
    /// The exchange of the tick, from 0.
    pub round: u32,
    /// The sender.
    pub from: NodeId,
    /// The [`Border::digest`] of the message.
    pub digest: u64,
}

/// What the leader has found out about a participant whose regions it computes once more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum Finding {
    /// The participant computed this region otherwise than the leader, or says otherwise than dedicated nodes
    /// what they told one another.
    Deviates(RegionId),
    /// The participant and this one contradict each other about what one told the other, so one of them lies.
    /// Verification goes on, as long as it is known what the participant was told.
    Contradicts(NodeId),
    /// The participant cannot be verified any longer.
    GivenUp(Hindrance),
}

/// The reason why a participant cannot be verified any longer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum Hindrance {
    /// It is not known what others told the participant.
    Unknown,
    /// Verification is too much for the leader to compute: it fell too far behind the world.
    Behind,
    /// No dedicated node leads any more.
    Unled,
}

impl Border {
    /// Returns the first 64 bits of BLAKE3 over the whole message. Nobody finds another message with the same
    /// digest.
    pub fn digest(&self) -> u64 {
        let mut first = [0; 8];
        first.copy_from_slice(&blake3::hash(&encode_value(self)).as_bytes()[..8]);
        u64::from_le_bytes(first)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Message, encode};

    #[test]
    fn what_a_member_has_heard_takes_eleven_bytes_a_message() {
        let heard = HeardBorder { round: 1, from: NodeId(7), digest: u64::MAX };
        let testimony = |count| Testimony { view: ViewNumber(3), tick: Tick(9), heard: vec![heard; count] };
        let bytes = |count| encode(&Message::Testimony(testimony(count))).len();
        assert_eq!([0, 1, 8].map(bytes), [4, 4 + 11, 4 + 88]);
    }

    #[test]
    fn a_border_message_that_differs_in_a_bit_has_another_digest() {
        let border = Border { view: ViewNumber(3), tick: Tick(9), round: 0, messages: Vec::new() };
        assert_eq!(border.digest(), border.clone().digest());
        assert_ne!(border.digest(), Border { round: 1, ..border }.digest());
    }
}
