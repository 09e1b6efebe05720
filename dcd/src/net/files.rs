//! Opens and replaces files that hold secrets. Only their owner may read them, and they are replaced as a
//! whole or not at all.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use super::NetError;

/// Turns an error of the system into one that names the file.
pub(super) fn at(path: &Path) -> impl FnOnce(io::Error) -> NetError + '_ {
    |source| NetError::File { path: path.to_owned(), source }
}

/// Opens a file with mode 0600, on systems that have modes.
pub(crate) fn open_private(path: &Path, options: &mut OpenOptions) -> Result<File, NetError> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        options.mode(0o600);
    }
    options.open(path).map_err(at(path))
}

/// Returns the path at which a file is written before it is renamed. It differs from that of any other file
/// beside it.
pub(crate) fn draft_of(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".draft");
    name.into()
}

/// The bytes that are written to see whether there is room: more than an identity has.
#[cfg(feature = "physics")]
const TRIED_BYTES: usize = 8_192;

/// Checks that [`replace_private`] can write there, as far as that can be known beforehand.
#[cfg(feature = "physics")]
pub(super) fn check_replaceable(path: &Path) -> Result<(), NetError> {
    if path.is_dir() {
        return Err(at(path)(io::ErrorKind::IsADirectory.into()));
    }
    // Nobody may ever write to a pipe, and nothing is kept there.
    if path.exists() && !path.is_file() {
        return Err(at(path)(io::Error::new(io::ErrorKind::InvalidInput, "it is not a regular file")));
    }
    let draft = draft_of(path);
    let tried = try_write(&draft, OpenOptions::new().create(true).truncate(true), &[0; TRIED_BYTES]);
    let removed = fs::remove_file(&draft).map_err(at(&draft));
    tried.and(removed)
}

/// Writes a private file so that after a crash it holds the old or the new content, never a part of it.
pub(super) fn replace_private(path: &Path, content: &[u8]) -> Result<(), NetError> {
    let draft = draft_of(path);
    // A draft that a crash left may have other permissions, so it is made anew.
    match fs::remove_file(&draft) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(at(&draft)(error)),
        _ => {}
    }
    let written = try_write(&draft, OpenOptions::new().create_new(true), content);
    if let Err(error) = written.and_then(|()| fs::rename(&draft, path).map_err(at(path))) {
        let _ = fs::remove_file(&draft);
        return Err(error);
    }
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        // The rename itself is durable only when the folder is.
        #[cfg(unix)]
        File::open(folder).and_then(|folder| folder.sync_all()).map_err(at(folder))?;
        #[cfg(not(unix))]
        let _ = folder;
    }
    Ok(())
}

fn try_write(draft: &Path, options: &mut OpenOptions, content: &[u8]) -> Result<(), NetError> {
    let mut file = open_private(draft, options.write(true))?;
    file.write_all(content).and_then(|()| file.sync_all()).map_err(at(draft))
}

#[cfg(all(test, unix))]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    #[test]
    fn a_replaced_file_is_for_its_owner_only() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("secret.pem");
        fs::write(&path, "old").unwrap();
        replace_private(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
    }

    #[test]
    #[cfg(feature = "physics")]
    fn a_device_or_a_pipe_keeps_nothing() {
        let refused = check_replaceable(Path::new("/dev/null")).unwrap_err().to_string();
        assert!(refused.contains("not a regular file"), "{refused}");
    }

    #[test]
    fn files_that_differ_after_the_last_dot_are_written_apart() {
        let folder = tempfile::tempdir().unwrap();
        let [own, other, draft] = ["who.1", "who.draft", "x.draft"].map(|name| folder.path().join(name));
        fs::write(&other, "another's").unwrap();
        fs::write(&draft, "a name like any other").unwrap();
        check_replaceable(&own).unwrap();
        replace_private(&own, b"own").unwrap();
        check_replaceable(&draft).unwrap();
        let read = |path| fs::read_to_string(path).unwrap();
        assert_eq!((read(&own), read(&other)), ("own".to_owned(), "another's".to_owned()));
        assert_eq!(read(&draft), "a name like any other");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3, "no draft is left");
    }
}
