//! Configures QUIC for a process with an identity: for links that it makes, and for those that others make.

use std::sync::Arc;

use quinn::crypto::rustls::{QuicClientConfig, QuicServerConfig};
use quinn::{ClientConfig, ServerConfig};

use super::verify::{answering, dialling};
use super::{Identity, Limits, NetError};

/// Returns the settings for links that others make.
pub(super) fn server_config(
    identity: &Identity,
    anonymous_may_join: bool,
    limits: &Limits,
) -> Result<ServerConfig, NetError> {
    let crypto = QuicServerConfig::try_from(answering(identity, anonymous_may_join)?)
        .map_err(|error| NetError::Tls(error.to_string()))?;
    let mut config = ServerConfig::with_crypto(Arc::new(crypto));
    // What comes before a handshake is accepted waits in memory: few packets of few callers.
    config.max_incoming(256).incoming_buffer_size(16 << 10).incoming_buffer_size_total(4 << 20);
    // One stream for a join; it is refused where none are answered.
    config.transport_config(limits.transport(u8::from(anonymous_may_join)));
    Ok(config)
}

/// Returns the settings for links that this process makes.
pub(super) fn client_config(identity: &Identity, limits: &Limits) -> Result<ClientConfig, NetError> {
    let crypto =
        QuicClientConfig::try_from(dialling(identity)?).map_err(|error| NetError::Tls(error.to_string()))?;
    let mut config = ClientConfig::new(Arc::new(crypto));
    config.transport_config(limits.transport(0));
    Ok(config)
}
