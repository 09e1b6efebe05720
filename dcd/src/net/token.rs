//! Encodes and checks the texts that admit a process: a join token, good for one join or several, and a
//! resume key, which gives the same ids again.

use std::fmt;
use std::str::FromStr;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use super::base32::{self, Undecodable};
use super::fields::Fields;
use super::{JoinRole, PeerName, TokenError};
use crate::space::{ClientId, NodeId};

/// A join token, as one line of text: it lets one process or several join, in one role, until it expires.
///
/// The joiner reads two things in it: the role, and the fingerprint by which it knows the server's authority.
/// Only the server can check that the authority minted it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Token {
    pub(super) role: JoinRole,
    pub(super) nonce: [u8; NONCE_BYTES],
    pub(super) expires_unix_s: u64,
    /// The number of joins that it is good for.
    pub(super) uses: u32,
    /// SHA-256 of the authority's certificate.
    pub(super) fingerprint: [u8; 32],
    pub(super) seal: [u8; SEAL_BYTES],
}

/// A resume key: proof that the authority gave these ids to the bearer before. With it and a fresh token the
/// bearer gets them again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ResumeKey {
    pub(super) who: PeerName,
    pub(super) seal: [u8; SEAL_BYTES],
}

/// The secret that seals tokens and resume keys, known to the authority only.
pub(super) struct Secret(pub(super) [u8; 32]);

pub(super) const NONCE_BYTES: usize = 16;
const SEAL_BYTES: usize = 16;
const TOKEN_PREFIX: &str = "dcd1-";
const RESUME_PREFIX: &str = "dcdr1-";
const OTHER_LENGTH: TokenError = TokenError::Malformed("its length is another");

impl Token {
    /// Returns the role in which the bearer joins.
    pub fn role(&self) -> JoinRole {
        self.role
    }

    /// Returns how many processes it lets join.
    pub fn uses(&self) -> u32 {
        self.uses
    }

    /// Checks, without the server, that the token is for this role.
    pub fn require(&self, wanted: JoinRole) -> Result<(), TokenError> {
        if self.role.admits(wanted) {
            Ok(())
        } else {
            Err(TokenError::WrongRole { found: self.role, wanted })
        }
    }

    pub(super) fn mint(
        secret: &Secret,
        role: JoinRole,
        nonce: [u8; NONCE_BYTES],
        expires_unix_s: u64,
        uses: u32,
        fingerprint: [u8; 32],
    ) -> Self {
        let mut token = Self { role, nonce, expires_unix_s, uses, fingerprint, seal: [0; SEAL_BYTES] };
        token.seal = secret.seal(b"token", &token.content());
        token
    }

    pub(super) fn is_sealed_by(&self, secret: &Secret) -> bool {
        secret.has_sealed(b"token", &self.content(), &self.seal)
    }

    fn content(&self) -> Vec<u8> {
        let mut bytes = vec![self.role.code()];
        bytes.extend(self.nonce);
        bytes.extend(self.expires_unix_s.to_be_bytes());
        bytes.extend(self.fingerprint);
        // Tokens for one join keep the format of before there were tokens for several.
        if self.uses != 1 {
            bytes.extend(self.uses.to_be_bytes());
        }
        bytes
    }
}

impl fmt::Display for Token {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut bytes = self.content();
        bytes.extend(self.seal);
        write!(f, "{TOKEN_PREFIX}{}", base32::encode(&bytes))
    }
}

impl FromStr for Token {
    type Err = TokenError;

    fn from_str(text: &str) -> Result<Self, TokenError> {
        let bytes = parse(text, TOKEN_PREFIX)?;
        let mut fields = Fields(&bytes);
        let mut read = || {
            let role = fields.take::<1>()?[0];
            let (nonce, expires) = (fields.take()?, fields.take()?);
            let fingerprint = fields.take()?;
            let uses = if fields.0.len() > SEAL_BYTES { u32::from_be_bytes(fields.take()?) } else { 1 };
            let seal = fields.take()?;
            fields.end()?;
            Some((role, nonce, u64::from_be_bytes(expires), uses, fingerprint, seal))
        };
        let (role, nonce, expires_unix_s, uses, fingerprint, seal) = read().ok_or(OTHER_LENGTH)?;
        let role = JoinRole::from_code(role).ok_or(TokenError::Malformed("it names no known role"))?;
        Ok(Self { role, nonce, expires_unix_s, uses, fingerprint, seal })
    }
}

impl ResumeKey {
    pub(super) fn mint(secret: &Secret, who: PeerName) -> Self {
        let mut key = Self { who, seal: [0; SEAL_BYTES] };
        key.seal = secret.seal(b"resume", &key.content());
        key
    }

    /// Returns the key by which a process recognises links of its predecessor and proves to their peers that
    /// those links are over.
    pub(super) fn reset_key(&self) -> [u8; 64] {
        reset_key(&self.seal)
    }

    pub(super) fn is_sealed_by(&self, secret: &Secret) -> bool {
        secret.has_sealed(b"resume", &self.content(), &self.seal)
    }

    fn content(&self) -> Vec<u8> {
        let mut bytes = vec![self.who.role().code()];
        bytes.extend(self.who.node().unwrap_or_default().0.to_be_bytes());
        bytes.extend(self.who.client().unwrap_or_default().0.to_be_bytes());
        bytes
    }
}

impl fmt::Display for ResumeKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut bytes = self.content();
        bytes.extend(self.seal);
        write!(f, "{RESUME_PREFIX}{}", base32::encode(&bytes))
    }
}

impl FromStr for ResumeKey {
    type Err = TokenError;

    fn from_str(text: &str) -> Result<Self, TokenError> {
        let bytes = parse(text, RESUME_PREFIX)?;
        let mut fields = Fields(&bytes);
        let mut read = || {
            let (role, node) = (fields.take::<1>()?[0], fields.take()?);
            let (client, seal) = (fields.take()?, fields.take()?);
            fields.end()?;
            Some((role, u32::from_be_bytes(node), u32::from_be_bytes(client), seal))
        };
        let (role, node, client, seal) = read().ok_or(OTHER_LENGTH)?;
        let node = (node > 0).then_some(NodeId(node));
        let client = (client > 0).then_some(ClientId(client));
        let who = JoinRole::from_code(role).and_then(|role| PeerName::from_parts(role, node, client));
        Ok(Self { who: who.ok_or(TokenError::Malformed("its role and ids do not fit"))?, seal })
    }
}

impl Secret {
    fn seal(&self, purpose: &[u8], content: &[u8]) -> [u8; SEAL_BYTES] {
        let mut hasher = blake3::Hasher::new_keyed(&self.0);
        let hash = hasher.update(purpose).update(content).finalize();
        std::array::from_fn(|at| hash.as_bytes()[at])
    }

    fn has_sealed(&self, purpose: &[u8], content: &[u8], seal: &[u8; SEAL_BYTES]) -> bool {
        // A second keyed hash of both makes the time of the comparison tell nothing: blake3's equality is
        // constant-time.
        let expected = self.seal(purpose, content);
        blake3::keyed_hash(&self.0, &expected) == blake3::keyed_hash(&self.0, seal)
    }
}

/// Derives the key of stateless resets from a secret that outlives the process.
pub(super) fn reset_key(secret: &[u8]) -> [u8; 64] {
    let mut key = [0; 64];
    blake3::Hasher::new_derive_key("dcd 2026 stateless resets").update(secret).finalize_xof().fill(&mut key);
    key
}

/// Returns whole seconds since 1970; 0 before that.
pub(super) fn unix_seconds(time: SystemTime) -> u64 {
    time.duration_since(UNIX_EPOCH).unwrap_or(Duration::ZERO).as_secs()
}

fn parse(text: &str, prefix: &str) -> Result<Vec<u8>, TokenError> {
    let body = text.trim().strip_prefix(prefix).ok_or(TokenError::Malformed("its beginning is another"))?;
    base32::decode(body).map_err(|error| match error {
        Undecodable::Character => TokenError::Malformed("it has characters that no token has"),
        Undecodable::Checksum => TokenError::Mistyped,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECRET: Secret = Secret([7; 32]);

    fn token() -> Token {
        Token::mint(&SECRET, JoinRole::Node, [5; NONCE_BYTES], 1_800_000_000, 1, [9; 32])
    }

    #[test]
    fn a_token_for_several_joins_comes_back_whole_and_its_count_is_sealed() {
        let several = Token::mint(&SECRET, JoinRole::Node, [5; NONCE_BYTES], 1_800_000_000, 40, [9; 32]);
        let text = several.to_string();
        assert!(text.len() < 140, "{text}");
        assert_eq!(text.parse(), Ok(several.clone()));
        assert!(several.is_sealed_by(&SECRET));
        let more = Token { uses: 41, ..several };
        assert!(!more.is_sealed_by(&SECRET));
    }

    #[test]
    fn a_token_is_one_line_and_comes_back_whole() {
        let text = token().to_string();
        assert!(text.starts_with("dcd1-") && text.len() < 140, "{text}");
        assert!(text[5..].chars().all(|letter| letter.is_ascii_alphanumeric()));
        assert_eq!(format!(" {text}\n").parse(), Ok(token()));
    }

    #[test]
    fn a_mistyped_token_is_told_from_something_that_is_no_token() {
        let mut text = token().to_string();
        let last = if text.pop() == Some('a') { 'b' } else { 'a' };
        text.push(last);
        assert_eq!(text.parse::<Token>(), Err(TokenError::Mistyped));
        assert!(matches!("hello".parse::<Token>(), Err(TokenError::Malformed(_))));
        assert!(matches!("dcd1-hello!".parse::<Token>(), Err(TokenError::Malformed(_))));
    }

    #[test]
    fn a_seal_covers_every_field_and_another_secret_has_not_sealed_it() {
        assert!(token().is_sealed_by(&SECRET));
        assert!(!token().is_sealed_by(&Secret([8; 32])));
        assert!(!Token { role: JoinRole::Client, ..token() }.is_sealed_by(&SECRET));
        assert!(!Token { expires_unix_s: u64::MAX, ..token() }.is_sealed_by(&SECRET));
        assert!(!Token { nonce: [6; NONCE_BYTES], ..token() }.is_sealed_by(&SECRET));
        assert!(!Token { fingerprint: [1; 32], ..token() }.is_sealed_by(&SECRET));
    }

    #[test]
    fn a_resume_key_comes_back_whole_and_is_sealed() {
        for who in [PeerName::Node(NodeId(2)), PeerName::Participant(NodeId(4), ClientId(9))] {
            let key = ResumeKey::mint(&SECRET, who);
            assert_eq!(key.to_string().parse(), Ok(key.clone()));
            assert!(key.is_sealed_by(&SECRET));
            assert!(!ResumeKey { who: PeerName::Node(NodeId(3)), ..key }.is_sealed_by(&SECRET));
        }
    }

    #[test]
    fn a_token_for_another_role_says_which_to_mint() {
        let error = token().require(JoinRole::Client).unwrap_err();
        assert!(error.to_string().contains("dcd token --role client"), "{error}");
    }
}
