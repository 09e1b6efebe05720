//! Reads files of scenes up to a limited size, whatever their paths lead to.

use std::fs::{File, metadata};
use std::io::{self, Error, ErrorKind, Read};
use std::path::Path;

/// The most bytes of one file. Scanned meshes have some tens of megabytes.
pub(super) const MAX_BYTES: usize = 256 << 20;

/// Reads a regular file of a limited size. Devices and pipes are refused before they are opened: some never
/// end.
pub(super) fn read_bounded(path: &Path) -> io::Result<Vec<u8>> {
    if !metadata(path)?.is_file() {
        return Err(Error::new(ErrorKind::InvalidInput, "it is not a regular file"));
    }
    let mut bytes = Vec::new();
    File::open(path)?.take(MAX_BYTES as u64 + 1).read_to_end(&mut bytes)?;
    if bytes.len() > MAX_BYTES {
        return Err(Error::new(ErrorKind::FileTooLarge, "it has more than 256 MiB"));
    }
    Ok(bytes)
}

/// Reads a regular file of a limited size that is text in UTF-8.
pub(super) fn read_text(path: &Path) -> io::Result<String> {
    String::from_utf8(read_bounded(path)?)
        .map_err(|error| Error::new(ErrorKind::InvalidData, error.utf8_error()))
}
