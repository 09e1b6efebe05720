//! Renews certificates: a process asks its server for a new one long before its own expires, and new links use it from then on.
//!
//! Whoever holds the key of a certificate of this authority gets a new one for the same name, also when the old one has expired: a
//! machine that slept, or whose clock was set, is who it was.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use rustls::pki_types::CertificateDer;

use super::calls::Shared;
use super::endpoint::{client_config, server_config};
use super::fields::{Fields, put_counted};
use super::join::{decode_reply, exchange_here};
use super::key::{Key, PublicKey};
use super::verify::fingerprint;
use super::{Identity, JoinRefusal, NetError, PROTOCOL_VERSION};

/// How often the wall clock is looked at, which may be set, or stand still in a machine that sleeps.
const LOOK: Duration = Duration::from_secs(10);
/// How long the server may take to answer.
const PATIENCE: Duration = Duration::from_secs(10);
/// The share of its life after which a certificate is renewed.
const RENEW_AFTER: f64 = 2.0 / 3.0;
/// Identifies a request whatever its version.
const MAGIC: [u8; 4] = *b"renw";

/// A request for a new certificate.
pub(super) struct RenewalRequest {
    /// The one to be renewed, which names the process.
    pub(super) certificate: CertificateDer<'static>,
    /// The key that the new one is for.
    pub(super) key: PublicKey,
    /// The key, signed by that of the certificate.
    pub(super) proof: Vec<u8>,
}

impl RenewalRequest {
    /// Returns whether these bytes are meant as one.
    pub(super) fn is_one(bytes: &[u8]) -> bool {
        bytes.starts_with(&MAGIC)
    }

    fn of(identity: &Identity) -> Result<Self, NetError> {
        let key = Key::from_der(&identity.key)
            .ok_or_else(|| NetError::Tls("the identity's key is none of dcd's".to_owned()))?;
        Ok(Self { certificate: identity.certificate.clone(), key: key.public(), proof: key.prove_renewal() })
    }

    fn encode(&self) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend(PROTOCOL_VERSION.to_be_bytes());
        put_counted(&mut bytes, &self.certificate);
        bytes.extend(self.key.0);
        put_counted(&mut bytes, &self.proof);
        bytes
    }

    pub(super) fn decode(bytes: &[u8]) -> Result<Self, JoinRefusal> {
        let mut fields = Fields(bytes);
        let _ = fields.take::<4>();
        let joiner = u32::from_be_bytes(fields.take().ok_or(JoinRefusal::Malformed("its version"))?);
        if joiner != PROTOCOL_VERSION {
            return Err(JoinRefusal::Version { server: PROTOCOL_VERSION, joiner });
        }
        let mut read = || {
            let certificate = CertificateDer::from(fields.take_counted()?.to_vec());
            let key = PublicKey(fields.take()?);
            let proof = fields.take_counted()?.to_vec();
            fields.end()?;
            Some(Self { certificate, key, proof })
        };
        read().ok_or(JoinRefusal::Malformed("its fields"))
    }
}

/// Renews the identity of a process at its server, for as long as the process runs.
pub(super) async fn renew_in_time(shared: Arc<Shared>, mut identity: Identity, server: SocketAddr) {
    let left = |identity: &Identity, now| identity.expires().duration_since(now).unwrap_or_default();
    let due_of = |identity: &Identity| {
        let now = SystemTime::now();
        now + left(identity, now).mul_f64(RENEW_AFTER)
    };
    let mut due = due_of(&identity);
    let mut is_expiry_told = false;
    loop {
        if SystemTime::now() >= due {
            match renewed(&shared, &identity, server).await {
                Ok(fresh) => {
                    identity = fresh;
                    due = due_of(&identity);
                    is_expiry_told = false;
                    let hours = left(&identity, SystemTime::now()).as_secs() / 3600;
                    tracing::info!(who = %identity.who, hours, "the certificate is renewed");
                }
                Err(error) if identity.expires() <= SystemTime::now() && !is_expiry_told => {
                    is_expiry_told = true;
                    tracing::warn!(
                        who = %identity.who, %error,
                        "the certificate has expired, and others refuse new links with this process; the server is asked \
                         for a new one again and again"
                    );
                }
                Err(error) => {
                    tracing::info!(who = %identity.who, %error, "the certificate is not renewed yet")
                }
            }
        }
        tokio::time::sleep(LOOK).await;
    }
}

/// Returns the identity with a new certificate, which new links use from here on.
async fn renewed(shared: &Shared, identity: &Identity, server: SocketAddr) -> Result<Identity, NetError> {
    let request = RenewalRequest::of(identity)?.encode();
    let reply = exchange_here(server, fingerprint(&identity.authority), &request, PATIENCE).await?;
    let broken = |detail: &str| NetError::Broken { addr: server, detail: detail.to_owned() };
    let admission = match decode_reply(&reply).ok_or_else(|| broken("its answer cannot be read"))? {
        Ok(admission) => admission,
        Err(refused) => return Err(refused.by(server)),
    };
    if admission.who != identity.who {
        return Err(broken("its answer names another process"));
    }
    let fresh = Identity {
        who: identity.who,
        key: identity.key.clone_key(),
        certificate: CertificateDer::from(admission.certificate),
        authority: identity.authority.clone(),
        expires_unix_s: admission.expires_unix_s,
        resume: identity.resume.clone(),
    };
    let answer = server_config(&fresh, false, &shared.limits)?;
    shared.set_dial(client_config(&fresh, &shared.limits)?);
    shared.endpoint.set_server_config(Some(answer));
    shared.set_expiry(fresh.expires());
    Ok(fresh)
}
