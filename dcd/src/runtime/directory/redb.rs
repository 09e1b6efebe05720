//! Stores a server's directory (world, groups, bodies, shapes, joints) in a redb file in its data folder, for
//! one server per folder.

use std::fs::{File, OpenOptions};
use std::io::ErrorKind;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use redb::{
    Builder, Database, DatabaseError, Durability, ReadableDatabase, ReadableTable, StorageError,
    TableDefinition, TableError,
};

use super::lock::{FolderLock, cause};
use crate::cluster::directory::{Batch, Condition, Directory, DirectoryError, Entry, Key, Revision, Tenure};
use crate::net::{draft_of, open_private};

/// The directory entries of a world in `world.redb`. A process that has it open is its only holder: the
/// operating system's lock on `world.lock` ensures that, and ends with the process, however that ends.
///
/// A batch that is not durable is made durable by the next durable batch, or by the first batch a second or
/// more after the last durable one. So a file that is written all the time is at most a second and a batch
/// behind after a crash.
pub struct RedbDirectory {
    /// Dropped before the lock.
    database: Database,
    path: PathBuf,
    synced_at: Instant,
    _lock: FolderLock,
}

/// The format of keys and values in the file. A file of another format is refused.
const FORMAT: u64 = 8;
/// Maps a key to its revision (8 bytes, big-endian) and value.
const ENTRIES: TableDefinition<'_, &[u8], &[u8]> = TableDefinition::new("dcd entries");
/// The format of the file, and its last revision.
const ABOUT: TableDefinition<'_, &str, u64> = TableDefinition::new("dcd directory");
const FORMAT_ROW: &str = "format";
const REVISION_ROW: &str = "revision";
const REVISION_BYTES: usize = 8;

/// A batch that is not durable is made durable all the same if the last durable one is this old.
const UNSYNCED: Duration = Duration::from_secs(1);
/// The size of the page cache. redb's default of 1 GiB is meant for files that do not fit into the cache.
const CACHE_BYTES: usize = 64 << 20;

impl RedbDirectory {
    /// Opens the world in this folder, or an empty one if there is none yet.
    pub fn open(folder: &Path) -> Result<Self, DirectoryError> {
        let path = folder.join("world.redb");
        std::fs::create_dir_all(folder).map_err(|error| unreadable(folder, &error))?;
        let lock = FolderLock::take(folder, &path)?;
        // redb reports most damage as errors and panics on the rest. Such a panic must not end the server
        // without naming the file.
        let database = catch_unwind(AssertUnwindSafe(|| {
            match path.try_exists().map_err(|error| unreadable(&path, &error))? {
                true => opened(&path),
                false => created(&path),
            }
        }))
        .unwrap_or_else(|_| Err(damaged(&path, "redb cannot make sense of it")))?;
        lock.note(false).map_err(|error| unwritable(folder, &error))?;
        Ok(Self { database, path, synced_at: Instant::now(), _lock: lock })
    }

    /// Opens the world in this folder for a server that begins anew. A file that is damaged, or of another
    /// format, is replaced by an empty one.
    pub fn open_or_replace(folder: &Path) -> Result<Self, DirectoryError> {
        match Self::open(folder) {
            Err(DirectoryError::Damaged { .. } | DirectoryError::Format { .. }) => {}
            opened => return opened,
        }
        let path = folder.join("world.redb");
        let lock = FolderLock::take(folder, &path)?;
        std::fs::remove_file(&path).map_err(|error| unreadable(&path, &error))?;
        lock.note(false).map_err(|error| unwritable(folder, &error))?;
        Ok(Self { database: created(&path)?, path, synced_at: Instant::now(), _lock: lock })
    }

    fn read(&self) -> Result<Vec<Entry>, redb::Error> {
        let entries = self.database.begin_read()?.open_table(ENTRIES)?;
        let mut read = Vec::new();
        for entry in entries.iter()? {
            let (key, value) = entry?;
            let (revision, value) = split(value.value()).ok_or_else(|| corrupted("a value"))?;
            let key = Key::from_bytes(key.value()).ok_or_else(|| corrupted("a key"))?;
            read.push(Entry { key, revision, value: value.to_vec() });
        }
        Ok(read)
    }

    fn write(&self, batch: &Batch, conditions: &[Condition], durable: bool) -> Result<Written, redb::Error> {
        let mut transaction = self.database.begin_write()?;
        transaction.set_durability(if durable { Durability::Immediate } else { Durability::None })?;
        let revision;
        {
            let mut entries = transaction.open_table(ENTRIES)?;
            for &Condition { key, at } in conditions {
                let found = match entries.get(key.to_bytes().as_slice())? {
                    Some(stored) => Some(split(stored.value()).ok_or_else(|| corrupted("a value"))?.0),
                    None => None,
                };
                if found != at {
                    return Ok(Err(DirectoryError::Changed { key, expected: at, found }));
                }
            }
            let mut about = transaction.open_table(ABOUT)?;
            let last = about.get(REVISION_ROW)?.ok_or_else(|| corrupted("the last revision"))?.value();
            revision = Revision(last + 1);
            about.insert(REVISION_ROW, revision.0)?;
            let mut stored = Vec::new();
            for (key, value) in &batch.writes {
                let key = key.to_bytes();
                match value {
                    Some(value) => {
                        stored.clear();
                        stored.extend(revision.0.to_be_bytes());
                        stored.extend(value);
                        entries.insert(key.as_slice(), stored.as_slice())?;
                    }
                    None => {
                        entries.remove(key.as_slice())?;
                    }
                }
            }
        }
        transaction.commit()?;
        Ok(Ok(revision))
    }
}

type Written = Result<Revision, DirectoryError>;

impl Directory for RedbDirectory {
    fn load(&mut self) -> Result<Vec<Entry>, DirectoryError> {
        self.read().map_err(|error| match error {
            redb::Error::Corrupted(what) => damaged(&self.path, &what),
            other => unreadable(&self.path, &other),
        })
    }

    fn commit(&mut self, batch: &Batch, conditions: &[Condition]) -> Result<Revision, DirectoryError> {
        let durable = batch.durable || self.synced_at.elapsed() >= UNSYNCED;
        let written = self.write(batch, conditions, durable).map_err(|error| match error {
            redb::Error::Corrupted(what) => damaged(&self.path, &what),
            other => DirectoryError::Unwritable { place: place(&self.path), cause: other.to_string() },
        })?;
        if durable && written.is_ok() {
            self.synced_at = Instant::now();
        }
        written
    }

    fn renew(&mut self) -> Result<Tenure, DirectoryError> {
        Ok(Tenure::WhileOpen)
    }
}

fn builder() -> Builder {
    let mut builder = Database::builder();
    builder.set_cache_size(CACHE_BYTES);
    builder
}

/// Creates the file whole or not at all, so that an empty file is an error and not a new world.
fn created(path: &Path) -> Result<Database, DirectoryError> {
    let draft = draft_of(path);
    match std::fs::remove_file(&draft) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(unreadable(&draft, &error)),
        _ => {}
    }
    let unwritable =
        |error: redb::Error| DirectoryError::Unwritable { place: place(&draft), cause: error.to_string() };
    let file = open_private(&draft, OpenOptions::new().read(true).write(true).create_new(true))
        .map_err(|error| DirectoryError::Unwritable { place: place(&draft), cause: cause(&error) })?;
    let database = builder().create_file(file).map_err(|error| unwritable(error.into()))?;
    begin(&database).map_err(unwritable)?;
    // The database is closed and opened again: renaming an open database works on Unix only.
    drop(database);
    std::fs::rename(&draft, path).map_err(|error| unreadable(path, &error))?;
    #[cfg(unix)]
    if let Some(folder) = path.parent() {
        // The rename is durable only when the folder is.
        File::open(folder)
            .and_then(|folder| folder.sync_all())
            .map_err(|error| unreadable(folder, &error))?;
    }
    opened(path)
}

fn begin(database: &Database) -> Result<(), redb::Error> {
    let transaction = database.begin_write()?;
    {
        let mut about = transaction.open_table(ABOUT)?;
        about.insert(FORMAT_ROW, FORMAT)?;
        about.insert(REVISION_ROW, 0)?;
        transaction.open_table(ENTRIES)?;
    }
    transaction.commit()?;
    Ok(())
}

fn opened(path: &Path) -> Result<Database, DirectoryError> {
    let mut database = builder().open(path).map_err(|error| refused(path, error))?;
    check_format(path, &database)?;
    // Unless asked, redb reads checksums only after a crash.
    match database.check_integrity() {
        Ok(true) => Ok(database),
        Ok(false) => Err(damaged(path, "and mended as far as that goes: a second start takes what is left")),
        Err(error) => Err(refused(path, error)),
    }
}

fn check_format(path: &Path, database: &Database) -> Result<(), DirectoryError> {
    let format = || -> Result<Option<u64>, redb::Error> {
        let about = match database.begin_read()?.open_table(ABOUT) {
            Err(TableError::TableDoesNotExist(_) | TableError::TableTypeMismatch { .. }) => return Ok(None),
            about => about?,
        };
        Ok(about.get(FORMAT_ROW)?.map(|format| format.value()))
    };
    match format() {
        Ok(Some(FORMAT)) => Ok(()),
        Ok(Some(found)) => Err(DirectoryError::Format { place: place(path), found, known: FORMAT }),
        Ok(None) => Err(DirectoryError::Foreign { place: place(path) }),
        Err(error) => Err(damaged(path, &error.to_string())),
    }
}

fn refused(path: &Path, error: DatabaseError) -> DirectoryError {
    match error {
        DatabaseError::DatabaseAlreadyOpen => DirectoryError::Taken { place: place(path) },
        DatabaseError::Storage(StorageError::Io(error)) if error.kind() == ErrorKind::InvalidData => {
            DirectoryError::Foreign { place: place(path) }
        }
        DatabaseError::Storage(StorageError::Io(error)) if error.kind() != ErrorKind::UnexpectedEof => {
            unreadable(path, &error)
        }
        other => damaged(path, &other.to_string()),
    }
}

fn split(stored: &[u8]) -> Option<(Revision, &[u8])> {
    let (revision, value) = stored.split_first_chunk::<REVISION_BYTES>()?;
    Some((Revision(u64::from_be_bytes(*revision)), value))
}

fn corrupted(what: &str) -> redb::Error {
    redb::Error::Corrupted(format!("{what} is not one of dcd's"))
}

fn damaged(path: &Path, what: &str) -> DirectoryError {
    DirectoryError::Damaged { place: place(path), what: what.to_owned() }
}

fn unwritable(path: &Path, error: &dyn std::error::Error) -> DirectoryError {
    DirectoryError::Unwritable { place: place(path), cause: error.to_string() }
}

fn unreadable(path: &Path, error: &dyn std::error::Error) -> DirectoryError {
    DirectoryError::Unreadable { place: place(path), cause: error.to_string() }
}

fn place(path: &Path) -> String {
    path.display().to_string()
}

#[cfg(test)]
mod tests;
