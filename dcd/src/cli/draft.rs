//! Writes a file of results beside its final path first: a run that fails leaves no part of it, and does not
//! destroy the former file.

use std::fs::{self, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

/// The path of a file that could be written to before the run began, so that a wrong path does not cost a
/// long run.
pub(super) struct Draft {
    path: PathBuf,
    /// The path at which the file is written first; `None` if it is written directly, as devices and pipes
    /// are.
    beside: Option<PathBuf>,
}

impl Draft {
    /// Checks that the file can be written, and leaves everything as it was.
    pub(super) fn check(path: PathBuf) -> io::Result<Self> {
        let found = fs::metadata(&path);
        if found.is_ok() {
            OpenOptions::new().append(true).open(&path)?;
        }
        let is_special = match &found {
            // `/dev/stdout`, for instance, may be a file that others have open.
            Ok(found) => !found.is_file() || ["/dev", "/proc"].iter().any(|folder| path.starts_with(folder)),
            Err(_) => path.is_symlink(),
        };
        if is_special {
            return Ok(Self { path, beside: None });
        }
        let mut beside = place_of(&path).into_os_string();
        beside.push(format!(".{}.part", std::process::id()));
        let beside = PathBuf::from(beside);
        match OpenOptions::new().write(true).create_new(true).open(&beside) {
            Ok(_) => fs::remove_file(&beside)?,
            // The folder takes no other file, but this one can be written.
            Err(_) if found.is_ok() => return Ok(Self { path, beside: None }),
            Err(error) => return Err(error),
        }
        Ok(Self { path, beside: Some(beside) })
    }

    /// Returns the final path of the file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Calls `write` with the path to write to, and moves the file to its final path once it is whole.
    pub(super) fn write<E: From<io::Error>>(
        &self,
        write: impl FnOnce(&Path) -> Result<(), E>,
    ) -> Result<(), E> {
        let Some(beside) = &self.beside else { return write(&self.path) };
        let written = write(beside).and_then(|()| Ok(self.put(beside)?));
        let _ = fs::remove_file(beside);
        written
    }

    /// Moves the written file to its final path, with the permissions of the former file.
    fn put(&self, beside: &Path) -> io::Result<()> {
        let place = place_of(&self.path);
        if let Ok(former) = fs::metadata(&place) {
            fs::set_permissions(beside, former.permissions())?;
        }
        // A file that is a mount point cannot be replaced.
        fs::rename(beside, &place).or_else(|_| fs::copy(beside, &place).map(drop))
    }
}

/// Returns where a file is or will be, without links: for a file that is not there yet, its name in the folder
/// that the path leads to.
pub(super) fn place_of(path: &Path) -> PathBuf {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::canonicalize(path).unwrap_or_else(|_| match (fs::canonicalize(folder), path.file_name()) {
        (Ok(folder), Some(name)) => folder.join(name),
        _ => path.to_owned(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_there_stays_until_all_is_written_and_a_failure_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let names = || fs::read_dir(folder.path()).unwrap().count();
        let path = folder.path().join("out.csv");
        let draft = Draft::check(path.clone()).unwrap();
        assert_eq!(names(), 0, "a check makes no file");
        draft.write(|to| fs::write(to, "one")).unwrap();
        let fails = |to: &Path| fs::write(to, "tw").and(Err(io::Error::other("the disk is full")));
        Draft::check(path.clone()).unwrap().write(fails).unwrap_err();
        assert_eq!((fs::read_to_string(&path).unwrap().as_str(), names()), ("one", 1));
        assert!(Draft::check(folder.path().join("no/out.csv")).is_err());
        assert!(Draft::check(folder.path().to_owned()).is_err(), "a folder");
    }

    #[cfg(unix)]
    #[test]
    fn who_may_read_a_file_stays_as_it_was_and_other_files_beside_it_are_left_alone() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [file, other] = ["out.csv", "out.csv.part"].map(|name| folder.path().join(name));
        fs::write(&file, "old").unwrap();
        fs::write(&other, "another's").unwrap();
        fs::set_permissions(&file, fs::Permissions::from_mode(0o600)).unwrap();
        Draft::check(file.clone()).unwrap().write(|to| fs::write(to, "new")).unwrap();
        assert_eq!(fs::metadata(&file).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(fs::read_to_string(&other).unwrap(), "another's");
        fs::write(folder.path().join("new.csv.part"), "another's").unwrap();
        assert!(Draft::check(folder.path().join("new.csv")).is_ok(), "that is no reason to refuse a new one");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_a_file_that_is_not_there_yet_stays_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link] = ["file", "link"].map(|name| folder.path().join(name));
        std::os::unix::fs::symlink(&file, &link).unwrap();
        Draft::check(link.clone()).unwrap().write(|to| fs::write(to, "new")).unwrap();
        assert_eq!(fs::read_to_string(&file).unwrap(), "new");
        assert!(link.is_symlink());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_file_that_others_have_open_by_its_number_is_written_to_as_it_is() {
        use std::os::fd::AsRawFd;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("open");
        let open = fs::File::create(&path).unwrap();
        let by_number = PathBuf::from(format!("/proc/self/fd/{}", open.as_raw_fd()));
        let draft = Draft::check(by_number.clone()).unwrap();
        draft.write(|to| (to == by_number).then_some(()).ok_or(io::Error::other("beside it"))).unwrap();
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_leads_to_the_new_file() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link] = ["file", "link"].map(|name| folder.path().join(name));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        Draft::check(link.clone()).unwrap().write(|to| fs::write(to, "new")).unwrap();
        assert_eq!(fs::read_to_string(&file).unwrap(), "new");
        assert!(link.is_symlink());
    }
}
