//! Defines the messages by which what participants compute is computed once more by a dedicated leader, and compared.

use bincode::{Decode, Encode};

use super::ViewNumber;
use super::group::Border;
use crate::protocol::encode_value;
use crate::space::{BodyId, NodeId, RegionId, Tick};

/// A participant whose regions the leader computes once more.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Verified {
    /// Which.
    pub node: NodeId,
    /// Whether it begins with the view: it has kept nothing of any before.
    pub anew: bool,
    /// The bodies that it is told to let go of. To the leader alone.
    pub drop: Vec<BodyId>,
}

/// What a member has taken in from others in one tick.
#[derive(Clone, Debug, PartialEq, Eq, Encode, Decode)]
pub struct Testimony {
    /// In which view.
    pub view: ViewNumber,
    /// In which tick.
    pub tick: Tick,
    /// What it took in, in order of rounds.
    pub heard: Vec<HeardBorder>,
}

/// A border message that a member has taken in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub struct HeardBorder {
    /// In which exchange of the tick, from 0.
    pub round: u32,
    /// Whose it was.
    pub from: NodeId,
    /// [`Border::digest`] of it.
    pub digest: u64,
}

/// What the leader has found out about a participant whose regions it computes once more.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum Finding {
    /// It computed this region otherwise, or says otherwise than dedicated nodes what they told one another.
    Deviates(RegionId),
    /// It and another participant contradict each other about what one told the other: one of them lies. It is verified on, as long as
    /// what it was told is known.
    Contradicts(NodeId),
    /// It cannot be verified any longer.
    GivenUp(Hindrance),
}

/// Why a participant cannot be verified any longer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Encode, Decode)]
pub enum Hindrance {
    /// What others told it is not known.
    Unknown,
    /// It is too much for the leader to compute: it was too far behind the world.
    Behind,
    /// No dedicated node leads any more.
    Unled,
}

impl Border {
    /// Returns the first 64 bits of BLAKE3 over all that it says: nobody finds another message with the same.
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
