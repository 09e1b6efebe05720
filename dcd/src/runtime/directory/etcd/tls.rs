//! Reads the files by which etcd and this server prove themselves to each other over TLS, and explains
//! failures.

use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;

use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::sign::CertifiedKey;
use rustls::{AlertDescription, CertificateError, RootCertStore};
use ureq::tls::{Certificate, ClientCert, PrivateKey, RootCerts, TlsConfig};

use super::address::TlsFiles;
use crate::cluster::directory::DirectoryError;

/// Reads the files. `place` names their world, for people to read.
pub(super) fn config(files: &TlsFiles, place: &str) -> Result<TlsConfig, DirectoryError> {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let cacert = File { path: &files.cacert, option: "cacert", place };
    let authorities = cacert.certificates()?;
    let mut roots = RootCertStore::empty();
    for authority in &authorities {
        roots
            .add(authority.clone())
            .map_err(|error| cacert.wrong(format!("a certificate in it is none ({error})")))?;
    }
    let client = match &files.client {
        None => None,
        Some((cert, key)) => {
            let cert = File { path: cert, option: "cert", place };
            let key = File { path: key, option: "key", place };
            let (chain, pem) = (cert.certificates()?, key.read()?);
            let private = PrivateKeyDer::from_pem_slice(&pem).map_err(|_| {
                key.wrong("it holds no private key in PEM, or one with a passphrase: write it without (openssl pkey)")
            })?;
            CertifiedKey::from_der(chain.clone(), private, &provider).map_err(|error| {
                key.wrong(format!(
                    "it is not the private key of the certificate in {} ({error})",
                    cert.path.display()
                ))
            })?;
            let private = PrivateKey::from_pem(&pem).map_err(|error| key.wrong(error.to_string()))?;
            Some(ClientCert::new_with_certs(&owned(&chain), private))
        }
    };
    Ok(TlsConfig::builder()
        .root_certs(RootCerts::new_with_certs(&owned(&authorities)))
        .client_cert(client)
        .unversioned_rustls_crypto_provider(provider)
        .build())
}

fn owned(certificates: &[CertificateDer<'_>]) -> Vec<Certificate<'static>> {
    certificates.iter().map(|certificate| Certificate::from_der(certificate).to_owned()).collect()
}

/// A file that an option of an address names.
struct File<'a> {
    path: &'a Path,
    option: &'static str,
    place: &'a str,
}

impl File<'_> {
    fn read(&self) -> Result<Vec<u8>, DirectoryError> {
        std::fs::read(self.path).map_err(|error| self.wrong(error.to_string()))
    }

    fn certificates(&self) -> Result<Vec<CertificateDer<'static>>, DirectoryError> {
        let pem = self.read()?;
        let found: Result<Vec<_>, _> = CertificateDer::pem_slice_iter(&pem).collect();
        match found {
            Ok(found) if !found.is_empty() => Ok(found),
            _ => Err(self.wrong("it holds no certificate in PEM (-----BEGIN CERTIFICATE-----)")),
        }
    }

    fn wrong(&self, cause: impl Into<String>) -> DirectoryError {
        unusable(self.path.display(), self.option, self.place, cause)
    }
}

/// Returns the error that what an option of an address names cannot be used.
pub(super) fn unusable(
    what: impl std::fmt::Display,
    option: &str,
    place: &str,
    cause: impl Into<String>,
) -> DirectoryError {
    DirectoryError::Unreadable { place: format!("{what} ({option} of {place})"), cause: cause.into() }
}

/// Returns why a member does not answer, in words, with a remedy where TLS is the cause.
pub(super) fn explained(error: &ureq::Error, is_tls: bool) -> String {
    let fault = match error {
        ureq::Error::Rustls(fault) => Some(fault),
        ureq::Error::Io(error) => error.get_ref().and_then(|inner| inner.downcast_ref::<rustls::Error>()),
        _ => None,
    };
    let remedy = match fault {
        Some(rustls::Error::InvalidCertificate(fault)) => of_certificate(fault),
        Some(rustls::Error::AlertReceived(alert)) if is_about_certificate(*alert) => Some(
            "it lets in only who has a certificate of its authority (--client-cert-auth): see to cert and key",
        ),
        Some(rustls::Error::InvalidMessage(_)) => {
            Some("it speaks no TLS: write etcd://, or start it with --cert-file")
        }
        Some(_) => None,
        None => match error {
            ureq::Error::Io(error) if is_broken_off(error.kind()) => Some(match is_tls {
                true => {
                    "it broke the link off: it is just stopping, or speaks no TLS (write etcd:// then), or does not accept this server's \
                     certificate (cert and key)"
                }
                false => "it broke the link off: it is just stopping, or speaks TLS (write etcds:// then)",
            }),
            _ => None,
        },
    };
    match remedy {
        Some(remedy) => format!("{error}; {remedy}"),
        None => error.to_string(),
    }
}

/// Returns whether this alert means that a member does not accept this server's certificate, or requires one.
fn is_about_certificate(alert: AlertDescription) -> bool {
    use AlertDescription::{
        AccessDenied, BadCertificate, CertificateExpired, CertificateRequired, CertificateRevoked,
        CertificateUnknown, NoCertificate, UnknownCA, UnsupportedCertificate,
    };
    matches!(
        alert,
        AccessDenied
            | BadCertificate
            | CertificateExpired
            | CertificateRequired
            | CertificateRevoked
            | CertificateUnknown
            | NoCertificate
            | UnknownCA
            | UnsupportedCertificate
    )
}

fn of_certificate(fault: &CertificateError) -> Option<&'static str> {
    Some(match fault {
        CertificateError::UnknownIssuer | CertificateError::BadSignature => {
            "its certificate is not of the authority in cacert: name the one that issued it"
        }
        CertificateError::NotValidForName | CertificateError::NotValidForNameContext { .. } => {
            "its certificate lacks the host as it is written here: write one that it names, or renew it with this among its subject \
             alternative names"
        }
        CertificateError::Expired | CertificateError::ExpiredContext { .. } => {
            "its certificate has expired: renew it, or set this machine's clock"
        }
        CertificateError::NotValidYet | CertificateError::NotValidYetContext { .. } => {
            "its certificate is not valid yet: set this machine's clock"
        }
        _ => return None,
    })
}

fn is_broken_off(kind: ErrorKind) -> bool {
    use ErrorKind::{BrokenPipe, ConnectionAborted, ConnectionReset, UnexpectedEof};
    matches!(kind, UnexpectedEof | ConnectionReset | ConnectionAborted | BrokenPipe)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_a_member_says_of_the_certificate_is_said_to_be_its_fault() {
        let said = |alert| explained(&ureq::Error::Rustls(rustls::Error::AlertReceived(alert)), true);
        for alert in [AlertDescription::CertificateRequired, AlertDescription::UnknownCA] {
            assert!(said(alert).contains("cert and key"), "{}", said(alert));
        }
        for alert in [AlertDescription::ProtocolVersion, AlertDescription::InternalError] {
            assert!(!said(alert).contains("cert and key"), "{}", said(alert));
        }
    }
}
