//! Defines the ids that cross module, process and machine borders: of regions, nodes, clients, groups, ticks, epochs, joints,
//! bodies. Each is a newtype, so that none is taken for another.

use std::fmt;

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

macro_rules! id {
    ($(#[$doc:meta])* $name:ident($inner:ty), $prefix:literal) => {
        $(#[$doc])*
        #[derive(
            Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Encode, Decode, Serialize, Deserialize,
        )]
        pub struct $name(pub $inner);

        impl fmt::Display for $name {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                write!(f, concat!($prefix, "{}"), self.0)
            }
        }
    };
}

id!(
    /// A vertex of the distribution tree, and so a sub-region: root 0, children 2i+1 and 2i+2 (thesis 4.3.1.3).
    RegionId(u32), "r"
);
impl RegionId {
    /// Returns the two vertices below this one, which must be one of a tree.
    pub(crate) const fn children(self) -> (Self, Self) {
        (Self(2 * self.0 + 1), Self(2 * self.0 + 2))
    }

    /// Returns the vertex above this one; the root has none.
    pub(crate) const fn parent(self) -> Option<Self> {
        match self.0 {
            0 => None,
            id => Some(Self((id - 1) / 2)),
        }
    }
}

id!(
    /// A process that computes regions. Given by the server in joining order; the lowest id of a group leads it.
    NodeId(u32), "n"
);
id!(
    /// A process that hosts avatars. Given by the server; 0 is nobody (it names persistent bodies).
    ClientId(u32), "c"
);

impl ClientId {
    /// Nobody: questions of the server's program are asked in this name.
    pub(crate) const NOBODY: Self = Self(0);
}

id!(
    /// A consistency group: nodes that compute the whole world together (thesis 3.3.7). Given by the server.
    GroupId(u32), "g"
);
id!(
    /// The number of steps of `dt` since the world began.
    Tick(u64), "t"
);
id!(
    /// The epoch of a body's owner: how often the owner has changed, with the number of the view in which the server last placed
    /// the body in the bits above. So a body that the server places anew is beyond every epoch that an earlier view can reach,
    /// however long that view lives on cut off. A state with an older epoch never overwrites a newer one.
    Epoch(u64), "e"
);
id!(
    /// A joint, numbered in order of insertion.
    JointId(u64), "j"
);

/// A body's id everywhere: the client that hosts it (0 for persistent bodies, thesis 4.3.2.5) and its number there. Bodies of the world
/// that a client has built are persistent too, and numbered apart by who built them.
///
/// It prints, by `{}` and `{:?}`, as `b7` for a persistent body, as `c2/b7` for an avatar of client 2, and as `c2+b7` for a body of the
/// world that client 2 has built.
#[derive(
    Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Encode, Decode, Serialize, Deserialize,
)]
pub struct BodyId(u64);

/// Marks, in the place of a client's number, what is not the client's own but built by it. No server comes to so many clients.
const BUILT: u32 = 1 << 31;

impl JointId {
    /// Returns the id of the `index`-th joint that `client` has built: none that a program numbers.
    #[doc(hidden)]
    #[must_use]
    pub const fn built(client: ClientId, index: u32) -> Self {
        Self((((client.0 | BUILT) as u64) << 32) | index as u64)
    }

    /// Returns the client that has built the joint; `None` for one of the world's program.
    pub(crate) const fn builder(self) -> Option<ClientId> {
        builder(self.0)
    }
}

impl BodyId {
    /// Returns the id of the `index`-th persistent body of the world.
    #[must_use]
    pub const fn persistent(index: u32) -> Self {
        Self(index as u64)
    }

    /// Returns the id of the `index`-th avatar of `client`.
    #[must_use]
    pub const fn avatar(client: ClientId, index: u32) -> Self {
        Self(((client.0 as u64) << 32) | index as u64)
    }

    /// Returns the id of the `index`-th body of the world that `client` has built.
    #[doc(hidden)]
    #[must_use]
    pub const fn built(client: ClientId, index: u32) -> Self {
        Self((((client.0 | BUILT) as u64) << 32) | index as u64)
    }

    /// Returns the id whose [`BodyId::bits`] these are.
    #[must_use]
    pub const fn from_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// Returns the client in the high and the index in the low 32 bits.
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// Returns the client that hosts the body; `None` for a persistent one, whoever built it.
    pub const fn client(self) -> Option<ClientId> {
        match (self.0 >> 32) as u32 {
            0 | BUILT.. => None,
            client => Some(ClientId(client)),
        }
    }

    /// Returns the client that has built this body of the world, if a client has.
    #[doc(hidden)]
    pub const fn builder(self) -> Option<ClientId> {
        builder(self.0)
    }

    /// Returns the body's number among those of its client, among those that it has built, or among the other persistent ones.
    pub const fn index(self) -> u32 {
        self.0 as u32
    }
}

impl fmt::Display for BodyId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.client(), self.builder()) {
            (Some(client), _) => write!(f, "{client}/b{}", self.index()),
            (None, Some(builder)) => write!(f, "{builder}+b{}", self.index()),
            (None, None) => write!(f, "b{}", self.index()),
        }
    }
}

const fn builder(bits: u64) -> Option<ClientId> {
    match (bits >> 32) as u32 {
        high @ BUILT.. => Some(ClientId(high & !BUILT)),
        _ => None,
    }
}

impl fmt::Debug for BodyId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl Tick {
    /// Returns the tick after this one.
    #[must_use]
    pub const fn next(self) -> Self {
        Self(self.0 + 1)
    }
}

impl Epoch {
    /// The bits that count the transfers within a view: enough for 60 changes of owner per second for three days.
    const TRANSFER_BITS: u32 = 24;

    /// Returns the first epoch of bodies that the server places in the view of this number.
    #[doc(hidden)]
    pub const fn placed_in(view: u64) -> Self {
        Self(view << Self::TRANSFER_BITS)
    }

    /// Returns how often the body has changed owner since it was placed.
    pub const fn transfers(self) -> u64 {
        self.0 & ((1 << Self::TRANSFER_BITS) - 1)
    }

    /// Returns the number of the view in which the body was placed.
    pub(crate) const fn view(self) -> u64 {
        self.0 >> Self::TRANSFER_BITS
    }

    /// Returns whether a body can have this epoch after this tick when no view has a higher number than this: it was placed in one of
    /// those, and transferred at most once per tick, and once in the exchange before the first.
    #[doc(hidden)]
    pub const fn is_possible(self, newest_view: u64, tick: Tick) -> bool {
        self.view() <= newest_view && self.transfers() <= tick.0 + 1
    }

    /// Returns the epoch after one more transfer.
    #[must_use]
    pub const fn next(self) -> Self {
        Self(self.0 + 1)
    }
}
