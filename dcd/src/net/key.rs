//! Makes and uses the key pair of a dcd process: Ed25519, by ring.
//!
//! No dcd process uses another kind, so no other is accepted: code that is absent cannot be attacked.

use std::fmt;
use std::sync::Arc;

use rcgen::{PKCS_ED25519, PublicKeyData, SignatureAlgorithm};
use ring::rand::SystemRandom;
use ring::signature::{ED25519, ED25519_PUBLIC_KEY_LEN, Ed25519KeyPair, KeyPair, UnparsedPublicKey};
use rustls::crypto::KeyProvider;
use rustls::crypto::ring::sign::any_eddsa_type;
use rustls::pki_types::{PrivateKeyDer, PrivatePkcs8KeyDer};

use super::NetError;

/// The prefix of the message that a proof of possession signs. The token that the proof is for follows.
const PROOF: &[u8] = b"dcd joins with this key and the token ";
/// The prefix of the message that a request for a new certificate signs. The key that the certificate is for
/// follows.
const RENEWAL: &[u8] = b"dcd renews the certificate of the signer for this key ";

/// A private key with its public half.
pub(super) struct Key {
    pair: Ed25519KeyPair,
    der: PrivatePkcs8KeyDer<'static>,
}

/// The public half of a process's key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct PublicKey(pub(super) [u8; ED25519_PUBLIC_KEY_LEN]);

impl Key {
    /// Generates a key.
    pub(super) fn generate() -> Result<Self, NetError> {
        let made = Ed25519KeyPair::generate_pkcs8(&SystemRandom::new());
        let made = made.map_err(|_| NetError::Tls("the system gives no random bytes".to_owned()))?;
        let der = PrivatePkcs8KeyDer::from(made.as_ref().to_vec());
        Ok(Self::from_der(&der).expect("what ring has made, ring can read"))
    }

    /// Reads a key from PKCS#8; `None` if it is not one of dcd's.
    pub(super) fn from_der(der: &PrivatePkcs8KeyDer<'_>) -> Option<Self> {
        let pair = Ed25519KeyPair::from_pkcs8(der.secret_pkcs8_der()).ok()?;
        Some(Self { pair, der: der.clone_key() })
    }

    /// Returns the key as PKCS#8.
    pub(super) fn der(&self) -> &PrivatePkcs8KeyDer<'static> {
        &self.der
    }

    pub(super) fn public(&self) -> PublicKey {
        PublicKey(self.pair.public_key().as_ref().try_into().expect("it has this length"))
    }

    /// Signs the token, as proof that the joiner has the private half of this key.
    pub(super) fn prove(&self, token: &str) -> Vec<u8> {
        self.pair.sign(&[PROOF, token.as_bytes()].concat()).as_ref().to_vec()
    }
}

impl Key {
    /// Signs the public half, as proof that the owner of the certificate for this key wants it renewed.
    pub(super) fn prove_renewal(&self) -> Vec<u8> {
        self.pair.sign(&self.public().renewal()).as_ref().to_vec()
    }
}

impl PublicKey {
    /// Returns a number that identifies this key, for use where its private half was proved.
    pub(super) fn mark(&self) -> u64 {
        let [a, b, c, d, e, f, g, h, ..] = self.0;
        u64::from_be_bytes([a, b, c, d, e, f, g, h])
    }

    /// Returns the message that the owner of a certificate signs to have it renewed for this key.
    pub(super) fn renewal(&self) -> Vec<u8> {
        [RENEWAL, &self.0].concat()
    }

    /// Returns whether the proof for this token was made with the private half of this key.
    pub(super) fn is_proved(&self, token: &str, proof: &[u8]) -> bool {
        let key = UnparsedPublicKey::new(&ED25519, self.0);
        key.verify(&[PROOF, token.as_bytes()].concat(), proof).is_ok()
    }
}

impl PublicKeyData for PublicKey {
    fn der_bytes(&self) -> &[u8] {
        &self.0
    }

    fn algorithm(&self) -> &'static SignatureAlgorithm {
        &PKCS_ED25519
    }
}

impl PublicKeyData for Key {
    fn der_bytes(&self) -> &[u8] {
        self.pair.public_key().as_ref()
    }

    fn algorithm(&self) -> &'static SignatureAlgorithm {
        &PKCS_ED25519
    }
}

impl rcgen::SigningKey for Key {
    fn sign(&self, message: &[u8]) -> Result<Vec<u8>, rcgen::Error> {
        Ok(self.pair.sign(message).as_ref().to_vec())
    }
}

/// A provider that loads dcd's kind of key for TLS.
#[derive(Debug)]
pub(super) struct Keys;

impl KeyProvider for Keys {
    fn load_private_key(
        &self,
        key: PrivateKeyDer<'static>,
    ) -> Result<Arc<dyn rustls::sign::SigningKey>, rustls::Error> {
        match &key {
            PrivateKeyDer::Pkcs8(key) => any_eddsa_type(key),
            _ => Err(rustls::Error::General("keys are in PKCS#8".to_owned())),
        }
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The private half stays out of logs.
        f.debug_tuple("Key").field(&self.public()).finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_that_was_written_is_read_back() {
        let key = Key::generate().unwrap();
        assert_eq!(Key::from_der(key.der()).unwrap().public(), key.public());
        assert_ne!(Key::generate().unwrap().public(), key.public());
        assert!(Key::from_der(&PrivatePkcs8KeyDer::from(vec![0x30; 48])).is_none());
    }

    #[test]
    fn a_proof_is_of_one_key_and_one_token() {
        let (key, other) = (Key::generate().unwrap(), Key::generate().unwrap());
        let proof = key.prove("a token");
        assert!(key.public().is_proved("a token", &proof));
        assert!(!key.public().is_proved("another token", &proof));
        assert!(!other.public().is_proved("a token", &proof));
        assert!(!key.public().is_proved("a token", &[]));
    }
}
