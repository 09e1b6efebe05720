//! Defines the request by which a process asks its server for a new certificate.

use rustls::pki_types::CertificateDer;

use super::fields::{Fields, put_counted};
use super::key::{Key, PublicKey};
use super::{Identity, JoinRefusal, NetError, PROTOCOL_VERSION};

/// The first bytes of a request for a new certificate, of any version.
const MAGIC: [u8; 4] = *b"renw";

/// A request for a new certificate.
pub(super) struct RenewalRequest {
    /// The certificate to be renewed, which names the process.
    pub(super) certificate: CertificateDer<'static>,
    /// The key that the new certificate is for.
    pub(super) key: PublicKey,
    /// The signature of `key` by the key of `certificate`.
    pub(super) proof: Vec<u8>,
}

impl RenewalRequest {
    /// Returns whether these bytes begin as a renewal request.
    pub(super) fn is_one(bytes: &[u8]) -> bool {
        bytes.starts_with(&MAGIC)
    }

    pub(super) fn of(identity: &Identity) -> Result<Self, NetError> {
        let key = Key::from_der(&identity.key)
            .ok_or_else(|| NetError::Tls("the identity's key is none of dcd's".to_owned()))?;
        Ok(Self { certificate: identity.certificate.clone(), key: key.public(), proof: key.prove_renewal() })
    }

    pub(super) fn encode(&self) -> Vec<u8> {
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
