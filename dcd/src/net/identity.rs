//! Defines, saves and loads the identity of a process: the key and certificate that prove its name.

use std::fmt;
use std::path::Path;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, PrivatePkcs8KeyDer};

#[cfg(feature = "physics")]
use super::Token;
#[cfg(feature = "physics")]
use super::files::check_replaceable;
use super::files::{at, replace_private};
#[cfg(feature = "physics")]
use super::verify::fingerprint;
use super::verify::names_of;
use super::{JoinRole, NetError, PeerName, ResumeKey};
use crate::space::{ClientId, NodeId};

/// A private key, the certificate for it that names role and ids, and the authority that issued the
/// certificate.
pub struct Identity {
    pub(super) who: PeerName,
    pub(super) key: PrivatePkcs8KeyDer<'static>,
    pub(super) certificate: CertificateDer<'static>,
    pub(super) authority: CertificateDer<'static>,
    pub(super) expires_unix_s: u64,
    pub(super) resume: Option<ResumeKey>,
}

impl Identity {
    /// Returns the name: role and ids together.
    pub fn who(&self) -> PeerName {
        self.who
    }

    /// Returns the role of the process.
    pub fn role(&self) -> JoinRole {
        self.who.role()
    }

    /// Returns the id as a node, if the process is one.
    pub fn node(&self) -> Option<NodeId> {
        self.who.node()
    }

    /// Returns the id as a client, if the process is one.
    pub fn client(&self) -> Option<ClientId> {
        self.who.client()
    }

    /// Returns whether the server that issued this identity also issued this token.
    #[cfg(feature = "physics")]
    pub(crate) fn is_of_server_of(&self, token: &Token) -> bool {
        fingerprint(&self.authority) == token.fingerprint
    }

    /// Returns the resume key. With it and a fresh token the process gets the same ids again. A server has
    /// none.
    pub fn resume(&self) -> Option<&ResumeKey> {
        self.resume.as_ref()
    }

    /// Returns the time until which the certificate proves the name. Existing connections outlive it. New
    /// ones need a fresh identity: join again with the resume key.
    pub fn expires(&self) -> SystemTime {
        UNIX_EPOCH + Duration::from_secs(self.expires_unix_s)
    }

    /// Writes the whole identity to one file that only its owner may read.
    pub fn save(&self, path: &Path) -> Result<(), NetError> {
        let mut text = format!("expires {}\n", self.expires_unix_s);
        if let Some(resume) = &self.resume {
            text.push_str(&format!("resume {resume}\n"));
        }
        text.push_str(&pem_section("PRIVATE KEY", self.key.secret_pkcs8_der()));
        text.push_str(&pem_section("CERTIFICATE", &self.certificate));
        text.push_str(&pem_section("CERTIFICATE", &self.authority));
        replace_private(path, text.as_bytes())
    }

    /// Checks that an identity can be saved there.
    #[cfg(feature = "physics")]
    pub(crate) fn check_place(path: &Path) -> Result<(), NetError> {
        check_replaceable(path)
    }

    /// Reads what [`Identity::save`] wrote.
    pub fn load(path: &Path) -> Result<Self, NetError> {
        let text = std::fs::read_to_string(path).map_err(at(path))?;
        let remedy = "restore it from a copy, or remove it and join anew with a token";
        let damaged = |what: &str| NetError::Damaged { path: path.to_owned(), what: what.to_owned(), remedy };
        let resume = text.lines().find_map(|line| line.strip_prefix("resume "));
        let resume = resume.map(str::parse).transpose().map_err(|_| damaged("its resume key"))?;
        let expires = text.lines().find_map(|line| line.strip_prefix("expires ")?.parse().ok());
        let expires_unix_s = expires.ok_or_else(|| damaged("no date of expiry"))?;
        let key =
            PrivatePkcs8KeyDer::from_pem_slice(text.as_bytes()).map_err(|_| damaged("no private key"))?;
        let certificates: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(text.as_bytes()).collect();
        let certificates = certificates.map_err(|_| damaged("a certificate"))?;
        let [certificate, authority] = <[_; 2]>::try_from(certificates)
            .map_err(|_| damaged("not its own certificate and the authority's"))?;
        let who = names_of(&certificate).ok_or_else(|| damaged("its certificate names no dcd process"))?;
        Ok(Self { who, key, certificate, authority, expires_unix_s, resume })
    }

    pub(super) fn chain(&self) -> Vec<CertificateDer<'static>> {
        vec![self.certificate.clone(), self.authority.clone()]
    }

    pub(super) fn private_key(&self) -> PrivateKeyDer<'static> {
        PrivateKeyDer::Pkcs8(self.key.clone_key())
    }
}

impl fmt::Debug for Identity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The key stays out of logs.
        f.debug_struct("Identity").field("who", &self.who).finish_non_exhaustive()
    }
}

/// Returns one section of a PEM file.
pub(super) fn pem_section(label: &str, der: &[u8]) -> String {
    const ALPHABET: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = format!("-----BEGIN {label}-----\n");
    for line in der.chunks(48) {
        for triple in line.chunks(3) {
            let bits = (0..3).fold(0u32, |bits, at| bits << 8 | u32::from(*triple.get(at).unwrap_or(&0)));
            for digit in 0..4 {
                let letter = ALPHABET[(bits >> (18 - 6 * digit) & 63) as usize];
                text.push(if digit <= triple.len() { char::from(letter) } else { '=' });
            }
        }
        text.push('\n');
    }
    text.push_str(&format!("-----END {label}-----\n"));
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pem_section_of_every_length_is_read_back() {
        for length in 1..100u8 {
            let der: Vec<u8> = (0..length).map(|at| at.wrapping_mul(91)).collect();
            let pem = pem_section("CERTIFICATE", &der);
            assert_eq!(CertificateDer::from_pem_slice(pem.as_bytes()).unwrap().as_ref(), der);
        }
    }
}
