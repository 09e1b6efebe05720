//! Bytes as one line of text that survives terminals, shells and changes of case: base 32 of RFC 4648 in lower case without
//! padding, closed by a checksum, so that a mistyped text is told from a refused one.

const ALPHABET: &[u8; 32] = b"abcdefghijklmnopqrstuvwxyz234567";
const CHECKSUM_BYTES: usize = 4;

/// Why a text does not decode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Undecodable {
    /// A character that is not of the alphabet.
    Character,
    /// The checksum does not fit.
    Checksum,
}

/// `bytes` and their checksum.
pub(super) fn encode(bytes: &[u8]) -> String {
    let mut text = String::new();
    let (mut bits, mut bit_count) = (0u32, 0);
    for byte in bytes.iter().chain(&checksum(bytes)) {
        bits = bits << 8 | u32::from(*byte);
        bit_count += 8;
        while bit_count >= 5 {
            bit_count -= 5;
            text.push(char::from(ALPHABET[(bits >> bit_count & 31) as usize]));
        }
    }
    if bit_count > 0 {
        text.push(char::from(ALPHABET[(bits << (5 - bit_count) & 31) as usize]));
    }
    text
}

/// The bytes of a text made by [`encode`].
pub(super) fn decode(text: &str) -> Result<Vec<u8>, Undecodable> {
    let mut bytes = Vec::with_capacity(text.len() * 5 / 8);
    let (mut bits, mut bit_count) = (0u32, 0);
    for character in text.bytes() {
        let digit = ALPHABET.iter().position(|letter| *letter == character.to_ascii_lowercase());
        bits = bits << 5 | digit.ok_or(Undecodable::Character)? as u32;
        bit_count += 5;
        if bit_count >= 8 {
            bit_count -= 8;
            bytes.push((bits >> bit_count) as u8);
        }
    }
    // What is left over must be the padding that `encode` makes, else one token would have several texts.
    let leftover = bits & ((1 << bit_count) - 1);
    let length = bytes.len().checked_sub(CHECKSUM_BYTES).ok_or(Undecodable::Checksum)?;
    let expected = bytes.split_off(length);
    if leftover != 0 || bit_count >= 5 || expected != checksum(&bytes) {
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
        assert_eq!(decode("not base 32!"), Err(Undecodable::Character));
    }
}
