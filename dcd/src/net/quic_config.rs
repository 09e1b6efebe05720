//! Configures QUIC for a process with an identity: for links that it dials, and for those that others dial.

use std::sync::Arc;
use std::time::Duration;

use quinn::crypto::rustls::{QuicClientConfig, QuicServerConfig};
use quinn::{ClientConfig, EndpointConfig, ServerConfig};
use quinn_proto::HashedConnectionIdGenerator;
use ring::hmac::{HMAC_SHA256, Key};

use super::verify::{answering, dialling};
use super::{Authority, Identity, Limits, NetError};

/// The least time between two stateless resets: a server that is back tells some thousand peers within their
/// keep-alives.
const RESET_APART: Duration = Duration::from_millis(1);

/// Returns the settings of the endpoint. A process that is started again with its authority or identity
/// recognises the links of its predecessor. It ends each by a stateless reset when something arrives over it
/// (RFC 9000, 10.3), long before the peer would time out.
pub(super) fn endpoint_config(authority: Option<&Authority>, identity: &Identity) -> EndpointConfig {
    let resume = || Some(identity.resume()?.reset_key());
    let Some(key) = authority.map(Authority::reset_key).or_else(resume) else {
        return EndpointConfig::default();
    };
    let ids = u64::from_le_bytes(key[..8].try_into().expect("eight of 64 bytes"));
    let mut config = EndpointConfig::new(Arc::new(Key::new(HMAC_SHA256, &key[8..])));
    config.cid_generator(move || Box::new(HashedConnectionIdGenerator::from_key(ids)));
    config.min_reset_interval(RESET_APART);
    config
}

/// Returns the settings for links that others dial.
pub(super) fn server_config(
    identity: &Identity,
    anonymous_may_join: bool,
    limits: &Limits,
) -> Result<ServerConfig, NetError> {
    let crypto = QuicServerConfig::try_from(answering(identity, anonymous_may_join)?)
        .map_err(|error| NetError::Tls(error.to_string()))?;
    let mut config = ServerConfig::with_crypto(Arc::new(crypto));
    // Packets that arrive before a handshake is accepted wait in memory: a few packets of a few callers.
    config.max_incoming(256).incoming_buffer_size(16 << 10).incoming_buffer_size_total(4 << 20);
    // One bidirectional stream for a join, or none where joins are not answered.
    config.transport_config(limits.answering(u8::from(anonymous_may_join)));
    Ok(config)
}

/// Returns the settings for links that this process dials.
pub(super) fn client_config(identity: &Identity, limits: &Limits) -> Result<ClientConfig, NetError> {
    let crypto =
        QuicClientConfig::try_from(dialling(identity)?).map_err(|error| NetError::Tls(error.to_string()))?;
    let mut config = ClientConfig::new(Arc::new(crypto));
    config.transport_config(limits.dialling(identity.who()));
    Ok(config)
}
