//! Writes and checks the header of a snapshot, which is the same in every format: magic, format number,
//! length of the maker's name, that name, and the hash of all these.

use std::io::{self, Read, Write};

use super::SnapshotError;
use super::blocks::{Hash, read_all};

pub(super) const MAGIC: [u8; 8] = *b"\x89dcdsnap";

/// Writes the header, and returns its hash, to which the first block is chained.
pub(super) fn write(format: u32, to: &mut dyn Write) -> io::Result<Hash> {
    let name = maker();
    let length = u16::try_from(name.len()).expect("our own name is short");
    let header = [&MAGIC[..], &format.to_le_bytes(), &length.to_le_bytes(), name.as_bytes()].concat();
    let hash = *blake3::hash(&header).as_bytes();
    to.write_all(&header)?;
    to.write_all(&hash)?;
    Ok(hash)
}

/// Reads the header. Returns its hash and its length in bytes if the snapshot is of this format and this
/// build.
pub(super) fn read(format: u32, from: &mut dyn Read) -> Result<(Hash, u64), SnapshotError> {
    let mut header = vec![0; MAGIC.len()];
    if read_all(from, &mut header)? < MAGIC.len() || header != MAGIC {
        return Err(SnapshotError::Foreign);
    }
    let mut take = |header: &mut Vec<u8>, count: usize| {
        let begin = header.len();
        header.resize(begin + count, 0);
        let read = read_all(from, &mut header[begin..])?;
        if read == count { Ok(()) } else { Err(SnapshotError::Truncated((begin + read) as u64)) }
    };
    take(&mut header, 6)?;
    let theirs = u32::from_le_bytes([header[8], header[9], header[10], header[11]]);
    let length = u16::from_le_bytes([header[12], header[13]]);
    take(&mut header, length.into())?;
    let hash = *blake3::hash(&header).as_bytes();
    let end = header.len();
    take(&mut header, hash.len())?;
    if header[end..] != hash {
        return Err(SnapshotError::Damaged(0));
    }
    let name = String::from_utf8_lossy(&header[14..end]);
    if theirs != format || name != maker() {
        let made_by = format!("format {theirs}, {name}");
        return Err(SnapshotError::Unlike { made_by, this: format!("format {format}, {}", maker()) });
    }
    Ok((hash, header.len() as u64))
}

/// Returns the name of the build: all that must be equal for a restored world to go on to the same bits.
fn maker() -> String {
    let determinism = if cfg!(feature = "enhanced-determinism") { ", enhanced-determinism" } else { "" };
    format!(
        "dcd {} with Rapier {}, f{}{determinism}",
        env!("CARGO_PKG_VERSION"),
        rapier3d::VERSION,
        8 * size_of::<rapier3d::math::Real>()
    )
}
