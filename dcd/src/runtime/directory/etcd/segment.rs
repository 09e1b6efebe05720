//! Encodes batches of entries as segments of a log: each entry with its key, its revision and its value.
//!
//! A segment begins with its length, since it is stored in several parts, as large as etcd takes.

use crate::cluster::directory::{Key, Revision};

/// An entry at a revision; one without a value is removed.
pub(super) type Record<'a> = (Key, Revision, Option<&'a [u8]>);

const REMOVED: u8 = 0;
const WRITTEN: u8 = 1;

/// Encodes entries as a segment.
pub(super) fn encode<'a>(records: impl Iterator<Item = Record<'a>>) -> Vec<u8> {
    let mut bytes = vec![0; 8];
    for (key, revision, value) in records {
        put_counted(&mut bytes, &key.to_bytes());
        bytes.extend(revision.0.to_be_bytes());
        bytes.push(if value.is_some() { WRITTEN } else { REMOVED });
        if let Some(value) = value {
            put_counted(&mut bytes, value);
        }
    }
    let length = bytes.len() as u64;
    bytes[..8].copy_from_slice(&length.to_be_bytes());
    bytes
}

/// Decodes a segment; `None` if the bytes are not a whole segment.
pub(super) fn decode(bytes: &[u8]) -> Option<Vec<Record<'_>>> {
    let (length, mut rest) = bytes.split_first_chunk()?;
    if u64::from_be_bytes(*length) != bytes.len() as u64 {
        return None;
    }
    let mut records = Vec::new();
    while !rest.is_empty() {
        let key = Key::from_bytes(take_counted(&mut rest)?)?;
        let revision = Revision(u64::from_be_bytes(*take(&mut rest)?));
        let value = match take::<1>(&mut rest)? {
            [REMOVED] => None,
            [WRITTEN] => Some(take_counted(&mut rest)?),
            _ => return None,
        };
        records.push((key, revision, value));
    }
    Some(records)
}

fn put_counted(bytes: &mut Vec<u8>, field: &[u8]) {
    let length = u32::try_from(field.len()).expect("no value of a world is nearly as long");
    bytes.extend(length.to_be_bytes());
    bytes.extend(field);
}

fn take<'a, const N: usize>(rest: &mut &'a [u8]) -> Option<&'a [u8; N]> {
    let (taken, after) = rest.split_first_chunk()?;
    *rest = after;
    Some(taken)
}

fn take_counted<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let length = u32::from_be_bytes(*take(rest)?) as usize;
    let (taken, after) = rest.split_at_checked(length)?;
    *rest = after;
    Some(taken)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::space::BodyId;

    #[test]
    fn a_segment_is_read_back_and_a_part_of_one_is_none() {
        let body = |index| Key::Body(BodyId::persistent(index));
        let records: [Record<'_>; 4] = [
            (Key::World, Revision(7), Some(&[1, 2, 3])),
            (body(1), Revision(u64::MAX), None),
            (body(2), Revision(0), Some(&[])),
            (body(3), Revision(1), Some(&[9; 300])),
        ];
        let bytes = encode(records.into_iter());
        assert_eq!(decode(&bytes).unwrap(), records);
        for cut in 0..bytes.len() {
            assert_eq!(decode(&bytes[..cut]), None, "{cut}");
        }
        assert_eq!(decode(&encode(std::iter::empty())), Some(vec![]));
    }

    proptest::proptest! {
        #[test]
        fn what_is_no_segment_is_none(mut bytes in proptest::collection::vec(0u8..6, 8..64)) {
            let length = bytes.len() as u64;
            bytes[..8].copy_from_slice(&length.to_be_bytes());
            if let Some(records) = decode(&bytes) {
                proptest::prop_assert_eq!(encode(records.into_iter()), bytes);
            }
        }
    }
}
