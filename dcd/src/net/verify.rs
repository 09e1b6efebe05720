//! Configures TLS for all dcd processes: version 1.3, ring, our own authority, no resumption and no early
//! data.

use std::any::Any;
use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::client::{Resumption, WebPkiServerVerifier};
use rustls::crypto::ring::{cipher_suite, kx_group};
use rustls::crypto::{CryptoProvider, GetRandomFailed, SecureRandom, WebPkiSupportedAlgorithms};
use rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use rustls::server::{NoServerSessionStorage, WebPkiClientVerifier};
use rustls::version::TLS13;
use rustls::{ClientConfig, DigitallySignedStruct, RootCertStore, ServerConfig, SignatureScheme};

use super::key::Keys;
use super::{Identity, NetError, PeerName};

const ALPN: &[u8] = b"dcd";

/// Returns the SHA-256 by which tokens name an authority.
pub(super) fn fingerprint(certificate: &CertificateDer<'_>) -> [u8; 32] {
    let hash = ring::digest::digest(&ring::digest::SHA256, certificate);
    hash.as_ref().try_into().expect("SHA-256 has 32 bytes")
}

/// Returns random bytes that nobody can predict.
pub(crate) fn random<const N: usize>() -> Result<[u8; N], NetError> {
    let mut bytes = [0; N];
    let filled = System.fill(&mut bytes);
    filled.map(|()| bytes).map_err(|_| NetError::Tls("the system gives no random bytes".to_owned()))
}

/// Returns the role and ids that a certificate names; `None` for one that is not dcd's.
pub(super) fn names_of(certificate: &CertificateDer<'_>) -> Option<PeerName> {
    let certificate = webpki::EndEntityCert::try_from(certificate).ok()?;
    PeerName::from_dns_names(certificate.valid_dns_names())
}

/// Returns the name in a certificate of this authority, even if the certificate has expired.
pub(super) fn owner_of(
    certificate: &CertificateDer<'_>,
    authority: &CertificateDer<'_>,
    now: SystemTime,
) -> Option<PeerName> {
    let parsed = webpki::EndEntityCert::try_from(certificate).ok()?;
    let anchor = webpki::anchor_from_trusted_cert(authority).ok()?;
    let verified = |time| {
        let usage = webpki::KeyUsage::client_auth();
        parsed
            .verify_for_usage(SIGNATURES.all, std::slice::from_ref(&anchor), &[], time, usage, None, None)
            .map(drop)
    };
    let now = UnixTime::since_unix_epoch(now.duration_since(UNIX_EPOCH).ok()?);
    match verified(now) {
        Err(webpki::Error::CertExpired { not_after, .. }) => verified(not_after).ok()?,
        verified => verified.ok()?,
    }
    names_of(certificate)
}

/// Returns whether a signature was made with the key of this certificate.
pub(super) fn is_signed_by(certificate: &CertificateDer<'_>, message: &[u8], signature: &[u8]) -> bool {
    webpki::EndEntityCert::try_from(certificate)
        .is_ok_and(|parsed| parsed.verify_signature(webpki::ring::ED25519, message, signature).is_ok())
}

/// Returns the name that the other side of a connection has proved; `None` for an anonymous one.
pub(super) fn names_of_peer(peer_identity: Option<Box<dyn Any>>) -> Option<PeerName> {
    let chain = peer_identity?.downcast::<Vec<CertificateDer<'static>>>().ok()?;
    names_of(chain.first()?)
}

/// Configures the answering side: every caller proves its name, except that a server lets anonymous ones
/// join.
pub(super) fn answering(identity: &Identity, anonymous_may_join: bool) -> Result<ServerConfig, NetError> {
    let roots = Arc::new(roots(&identity.authority)?);
    let mut clients = WebPkiClientVerifier::builder_with_provider(roots, provider());
    if anonymous_may_join {
        clients = clients.allow_unauthenticated();
    }
    let clients = clients.build().map_err(tls)?;
    let mut config = ServerConfig::builder_with_provider(provider())
        .with_protocol_versions(&[&TLS13])
        .map_err(tls)?
        .with_client_cert_verifier(clients)
        .with_single_cert(identity.chain(), identity.private_key())
        .map_err(tls)?;
    config.alpn_protocols = vec![ALPN.to_vec()];
    // A resumed session would outlive the certificate that it began with.
    config.session_storage = Arc::new(NoServerSessionStorage {});
    config.send_tls13_tickets = 0;
    Ok(config)
}

/// Configures the dialling side, with an identity.
pub(super) fn dialling(identity: &Identity) -> Result<ClientConfig, NetError> {
    let config = ClientConfig::builder_with_provider(provider())
        .with_protocol_versions(&[&TLS13])
        .map_err(tls)?
        .with_root_certificates(roots(&identity.authority)?)
        .with_client_auth_cert(identity.chain(), identity.private_key())
        .map_err(tls)?;
    Ok(for_dcd(config))
}

/// Configures dialling a server without an identity. The server must show the authority that the token names.
pub(super) fn joining(fingerprint: [u8; 32]) -> Result<ClientConfig, NetError> {
    let verifier = PinnedAuthority { fingerprint };
    let config = ClientConfig::builder_with_provider(provider())
        .with_protocol_versions(&[&TLS13])
        .map_err(tls)?
        .dangerous()
        .with_custom_certificate_verifier(Arc::new(verifier))
        .with_no_client_auth();
    Ok(for_dcd(config))
}

fn for_dcd(mut config: ClientConfig) -> ClientConfig {
    config.alpn_protocols = vec![ALPN.to_vec()];
    config.resumption = Resumption::disabled();
    config
}

/// The signature algorithms of certificates and handshakes.
static SIGNATURES: WebPkiSupportedAlgorithms = WebPkiSupportedAlgorithms {
    all: &[webpki::ring::ED25519],
    mapping: &[(SignatureScheme::ED25519, &[webpki::ring::ED25519])],
};

/// Returns the cryptography of all links: only what our own processes use.
fn provider() -> Arc<CryptoProvider> {
    Arc::new(CryptoProvider {
        cipher_suites: vec![
            cipher_suite::TLS13_AES_256_GCM_SHA384,
            cipher_suite::TLS13_AES_128_GCM_SHA256,
            cipher_suite::TLS13_CHACHA20_POLY1305_SHA256,
        ],
        kx_groups: vec![kx_group::X25519],
        signature_verification_algorithms: SIGNATURES,
        secure_random: &System,
        key_provider: &Keys,
    })
}

/// The operating system's source of random bytes.
#[derive(Debug)]
struct System;

impl SecureRandom for System {
    fn fill(&self, bytes: &mut [u8]) -> Result<(), GetRandomFailed> {
        ring::rand::SecureRandom::fill(&ring::rand::SystemRandom::new(), bytes).map_err(|_| GetRandomFailed)
    }
}

fn roots(authority: &CertificateDer<'static>) -> Result<RootCertStore, NetError> {
    let mut roots = RootCertStore::empty();
    roots.add(authority.clone()).map_err(tls)?;
    Ok(roots)
}

fn tls(error: impl std::fmt::Display) -> NetError {
    NetError::Tls(error.to_string())
}

/// A certificate verifier that trusts the one authority with this fingerprint, and through it the server, as
/// usual.
#[derive(Debug)]
struct PinnedAuthority {
    fingerprint: [u8; 32],
}

impl ServerCertVerifier for PinnedAuthority {
    fn verify_server_cert(
        &self,
        end_entity: &CertificateDer<'_>,
        intermediates: &[CertificateDer<'_>],
        server_name: &ServerName<'_>,
        ocsp_response: &[u8],
        now: UnixTime,
    ) -> Result<ServerCertVerified, rustls::Error> {
        let general = |error: &dyn std::fmt::Display| rustls::Error::General(error.to_string());
        let authority = intermediates
            .iter()
            .find(|certificate| fingerprint(certificate) == self.fingerprint)
            .ok_or_else(|| general(&"its authority is not the one that the token names"))?;
        let roots = roots(&authority.clone().into_owned()).map_err(|error| general(&error))?;
        WebPkiServerVerifier::builder_with_provider(Arc::new(roots), provider())
            .build()
            .map_err(|error| general(&error))?
            .verify_server_cert(end_entity, intermediates, server_name, ocsp_response, now)
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        rustls::crypto::verify_tls12_signature(message, certificate, signature, &SIGNATURES)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        certificate: &CertificateDer<'_>,
        signature: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        rustls::crypto::verify_tls13_signature(message, certificate, signature, &SIGNATURES)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        SIGNATURES.supported_schemes()
    }
}
