//! Carries byte frames between processes over QUIC, with an authority of our own, join tokens and mutual TLS.
//!
//! A server makes its own [`Authority`] on first start. The authority mints a [`Token`], which a new process
//! trades for an [`Identity`] with `join`. With an identity the process starts its [`Net`] and dials others;
//! each side proves its name.
//!
//! Frames are opaque here: this module knows neither messages nor physics. The interface is synchronous, with
//! a small tokio runtime inside, so that a role's loop is a plain thread that reads [`NetEvents`].

mod authority;
mod base32;
mod calls;
mod congestion;
#[cfg(feature = "physics")]
mod datagrams;
mod endpoint;
mod error;
mod events;
mod fields;
mod files;
mod first;
mod identity;
mod join;
mod journal;
mod key;
mod lanes;
mod ledger;
mod limits;
mod pace;
mod peer;
mod quic_config;
mod renewal;
mod renewal_request;
mod role;
mod seldom;
mod source;
mod stats;
#[cfg(test)]
mod tests;
mod token;
mod unasked;
mod verify;

pub use authority::Authority;
#[cfg(feature = "physics")]
pub(crate) use datagrams::Datagrams;
#[cfg(feature = "physics")]
pub(crate) use endpoint::check_address;
pub use endpoint::{Net, NetConfig};
pub use error::{JoinRefusal, NetError, SendError, TokenError};
#[cfg(feature = "physics")]
pub(crate) use events::HeldEvent;
pub use events::{CloseCause, CloseCode, NetEvent, NetEvents, PeerKey};
#[cfg(feature = "physics")]
pub(crate) use files::{draft_of, open_private};
pub use identity::Identity;
pub use join::join;
#[doc(hidden)]
pub use join::read_joining;
#[cfg(feature = "etcd")]
pub(crate) use journal::Journal;
pub use lanes::Lane;
pub use limits::{Limits, MAX_DATAGRAM_BYTES};
pub use renewal::renew;
pub use role::{JoinRole, PeerName};
pub use stats::{NetTotals, PeerStats};
pub use token::{ResumeKey, Token};
#[cfg(feature = "etcd")]
pub(crate) use verify::random;

/// The version of dcd's whole network protocol. Processes of different versions refuse each other.
pub const PROTOCOL_VERSION: u32 = 4;
