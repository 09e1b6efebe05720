//! Defines the ids that cross borders of modules, processes and machines: of regions, nodes, clients, groups,
//! ticks, epochs, joints and bodies. Each is a newtype, so that none is taken for another.

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
    /// The id of a region: a vertex of the distribution tree. The root is 0, and the children of vertex i are
    /// 2i+1 and 2i+2 (thesis 4.3.1.3).
    RegionId(u32), "r"
);
impl RegionId {
    /// Returns the two vertices below this one, which must be a vertex of a tree.
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
    /// The id of a node, a process that computes regions. The server gives ids in joining order; the node
    /// with the lowest id of a group leads it.
    NodeId(u32), "n"
);
id!(
    /// The id of a client, a process that hosts avatars, given by the server. 0 is no client: it marks
    /// persistent bodies.
    ClientId(u32), "c"
);

impl ClientId {
    /// No client: queries of the server's program are asked under this id.
    pub(crate) const NOBODY: Self = Self(0);
}

id!(
    /// The id of a consistency group: nodes that compute the whole world together (thesis 3.3.7). Given by
    /// the server.
    GroupId(u32), "g"
);
id!(
    /// A tick: the number of steps of `dt` since the world began.
    Tick(u64), "t"
);
id!(
    /// The epoch of a body's owner: the number of changes of owner in the low 24 bits, and the number of the
    /// view in which the server last placed the body in the bits above. A body that the server places anew is
    /// thus beyond every epoch that an earlier view can reach, however long that view lives on cut off. A
    /// state with an older epoch never overwrites a newer one.
    Epoch(u64), "e"
);
id!(
    /// The id of a joint, numbered in order of insertion.
    JointId(u64), "j"
);

/// The id of a body, the same in every process: the client that hosts the body (0 for persistent bodies,
/// thesis 4.3.2.5), and its number there. Bodies that a builder inserts are persistent too, and numbered
/// separately for each builder.
///
/// It prints, by `{}` and `{:?}`, as `b7` for a persistent body, as `c2/b7` for an avatar of client 2, and as
/// `c2+b7` for a body that client 2 has built.
#[derive(
    Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Encode, Decode, Serialize, Deserialize,
)]
pub struct BodyId(u64);

/// Marks, in the bits of a client's number, a body that the client has built and that is not its own. No
/// server comes to so many clients.
const BUILT: u32 = 1 << 31;

impl JointId {
    /// Returns the id of the `index`-th joint that `client` has built. No joint that a program numbers has
    /// such an id.
    #[doc(hidden)]
    #[must_use]
    pub const fn built(client: ClientId, index: u32) -> Self {
        Self((((client.0 | BUILT) as u64) << 32) | index as u64)
    }

    /// Returns the client that has built the joint; `None` for a joint of the world's program.
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

    /// Returns the id of the `index`-th persistent body that `client` has built.
    #[doc(hidden)]
    #[must_use]
    pub const fn built(client: ClientId, index: u32) -> Self {
        Self((((client.0 | BUILT) as u64) << 32) | index as u64)
    }

    /// Returns the id from the bits that [`BodyId::bits`] returned.
    #[must_use]
    pub const fn from_bits(bits: u64) -> Self {
        Self(bits)
    }

    /// Returns the bits of the id: the client in the high 32, and the index in the low 32 bits.
    pub const fn bits(self) -> u64 {
        self.0
    }

    /// Returns the client that hosts the body; `None` for a persistent body, whoever built it.
    pub const fn client(self) -> Option<ClientId> {
        match (self.0 >> 32) as u32 {
            0 | BUILT.. => None,
            client => Some(ClientId(client)),
        }
    }

    /// Returns the client that has built this persistent body; `None` if no client has.
    #[doc(hidden)]
    pub const fn builder(self) -> Option<ClientId> {
        builder(self.0)
    }

    /// Returns the body's number among its client's avatars, among the bodies that a builder has built, or
    /// among the other persistent bodies.
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
    /// The number of bits that count the transfers within a view: enough for 60 changes of owner per second
    /// for three days.
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

    /// Returns whether a body can have this epoch after this tick, if no view has a higher number than
    /// `newest_view`. The body was placed in one of these views, and transferred at most once per tick, and
    /// once in the exchange before the first.
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
