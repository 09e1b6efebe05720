//! Encodes bytes as one line of text that survives terminals, shells and changes of case.
//!
//! The text is base 32 of RFC 4648 in lower case without padding, closed by a checksum, so that a mistyped
//! text is distinguished from a refused one.

use data_encoding::{BASE32_NOPAD, DecodeKind};

const CHECKSUM_BYTES: usize = 4;

/// The error for a text that does not decode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Undecodable {
    /// A character that is not of the alphabet.
    Character,
    /// The checksum does not fit.
    Checksum,
}

/// Encodes `bytes` and their checksum.
pub(super) fn encode(bytes: &[u8]) -> String {
    BASE32_NOPAD.encode(&[bytes, &checksum(bytes)].concat()).to_ascii_lowercase()
}

/// Decodes a text made by [`encode`].
pub(super) fn decode(text: &str) -> Result<Vec<u8>, Undecodable> {
    // Checked first, since a text that is not ours may have any length.
    if !text.bytes().all(|letter| matches!(letter.to_ascii_lowercase(), b'a'..=b'z' | b'2'..=b'7')) {
        return Err(Undecodable::Character);
    }
    let decoded = BASE32_NOPAD.decode(text.to_ascii_uppercase().as_bytes());
    let mut bytes = decoded.map_err(|error| match error.kind {
        DecodeKind::Symbol => Undecodable::Character,
        // The text was cut, or ends in bits that no encoder leaves. If those were accepted, one token would
        // have several texts.
        DecodeKind::Length | DecodeKind::Trailing | DecodeKind::Padding => Undecodable::Checksum,
    })?;
    let length = bytes.len().checked_sub(CHECKSUM_BYTES).ok_or(Undecodable::Checksum)?;
    let expected = bytes.split_off(length);
    if expected != checksum(&bytes) {
        return Err(Undecodable::Checksum);
    }
    Ok(bytes)
}

fn checksum(bytes: &[u8]) -> [u8; CHECKSUM_BYTES] {
    let hash = blake3::hash(bytes);
    std::array::from_fn(|at| hash.as_bytes()[at])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_length_comes_back() {
        for length in 0..80u8 {
            let bytes: Vec<u8> = (0..length).map(|at| at.wrapping_mul(37)).collect();
            assert_eq!(decode(&encode(&bytes)).as_deref(), Ok(&bytes[..]));
            assert_eq!(decode(&encode(&bytes).to_uppercase()).as_deref(), Ok(&bytes[..]));
        }
    }

    #[test]
    fn every_single_mistyped_letter_is_noticed() {
        let text = encode(b"a token of sorts");
        for at in 0..text.len() {
            let mut wrong = text.clone().into_bytes();
            wrong[at] = if wrong[at] == b'a' { b'b' } else { b'a' };
            assert_eq!(
                decode(std::str::from_utf8(&wrong).unwrap()),
                Err(Undecodable::Checksum),
                "letter {at}"
            );
            assert!(decode(&text[..at]).is_err());
        }
        for no_text in ["not base 32!", "hello!"] {
            assert_eq!(decode(no_text), Err(Undecodable::Character));
        }
    }
}
