//! Writes and reads chunks of bytes, each with a hash chained to the chunk before, and hands them to a thread
//! that writes a file, so that a slow disk delays nobody.
//!
//! A file consists of a magic number, the format (u32, little endian), and chunks. A chunk consists of:
//!
//! - its length (u32),
//! - the first 4 bytes of BLAKE3 of the hash before and the length,
//! - its hash: the first 8 bytes of BLAKE3 of the hash before, the length and the bytes,
//! - the bytes.
//!
//! An empty chunk ends the recording. A recording without it was cut off.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Write};
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use super::RecordingError;

/// The format, which grows with every change of what is recorded. Changes of messages count in the protocol's
/// version, which the maker names.
const FORMAT: u32 = 16;
const MAGIC: [u8; 8] = *b"\x89dcdrec\n";
/// The most bytes of a chunk: an entry is never divided, and a message has at most 16 MiB.
const MOST: usize = 40 << 20;
/// The most bytes that may wait for the disk.
const WAITING: usize = 64 << 20;
/// The time without a chunk taken after which a disk hangs.
const HANGS: Duration = Duration::from_secs(30);

type Hash = [u8; 8];

/// Writes the head of a file: magic number and format.
pub(super) fn begin(to: &mut impl Write) -> io::Result<()> {
    to.write_all(&[&MAGIC[..], &FORMAT.to_le_bytes()].concat())
}

/// Writes a chunk by one call, and returns the hash that the next one is chained to. The last chunk is empty.
pub(super) fn write_chunk(to: &mut impl Write, before: Hash, bytes: &[u8]) -> io::Result<Hash> {
    if bytes.len() > MOST {
        return Err(io::Error::other("an entry has more than 40 MiB"));
    }
    let length = (bytes.len() as u32).to_le_bytes();
    let hash = chained(before, length, bytes);
    to.write_all(&[&length[..], &chained(before, length, &[])[..4], &hash, bytes].concat())?;
    Ok(hash)
}

fn chained(before: Hash, length: [u8; 4], bytes: &[u8]) -> Hash {
    let mut hasher = blake3::Hasher::new();
    hasher.update(&before).update(&length).update(bytes);
    let mut hash = Hash::default();
    hash.copy_from_slice(&hasher.finalize().as_bytes()[..size_of::<Hash>()]);
    hash
}

/// A reader of the chunks of a recording, up to its end or to where it was cut off.
pub struct Reader<R> {
    from: R,
    before: Hash,
    taken: u64,
    /// Says whether the last chunk has been read.
    ended: bool,
    cut: Option<Cut>,
}

/// The place where a recording ends that has no last chunk.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cut {
    /// After a chunk: the process was killed, or what followed is missing. Nothing tells these apart.
    AfterChunk,
    /// Within a chunk: what followed is missing, or the process was killed or the disk full while it wrote.
    WithinChunk,
}

impl Reader<io::BufReader<File>> {
    /// Opens the file of a recording.
    pub fn open(path: &Path) -> Result<Self, RecordingError> {
        Self::new(io::BufReader::with_capacity(1 << 18, File::open(path)?))
    }
}

impl<R: Read> Reader<R> {
    /// Reads the head of a recording, and checks it.
    pub fn new(mut from: R) -> Result<Self, RecordingError> {
        const HEAD: usize = MAGIC.len() + size_of::<u32>();
        let head = read_up_to(&mut from, HEAD)?;
        if head.len() < HEAD || head[..MAGIC.len()] != MAGIC {
            return Err(RecordingError::Foreign);
        }
        let format = u32::from_le_bytes([head[8], head[9], head[10], head[11]]);
        if format != FORMAT {
            return Err(RecordingError::Format { theirs: format, ours: FORMAT });
        }
        Ok(Self { from, before: Hash::default(), taken: head.len() as u64, ended: false, cut: None })
    }

    /// Returns the next chunk; `None` at the end, or where the file was cut off.
    pub(super) fn next_chunk(&mut self) -> Result<Option<Vec<u8>>, RecordingError> {
        if self.ended || self.cut.is_some() {
            return Ok(None);
        }
        let begin = self.taken;
        const HEAD: usize = 2 * size_of::<u32>() + size_of::<Hash>();
        let head = read_up_to(&mut self.from, HEAD)?;
        if head.len() < HEAD {
            self.cut = Some(if head.is_empty() { Cut::AfterChunk } else { Cut::WithinChunk });
            return Ok(None);
        }
        let length_bytes = [head[0], head[1], head[2], head[3]];
        let length = u32::from_le_bytes(length_bytes) as usize;
        if length > MOST || head[4..8] != chained(self.before, length_bytes, &[])[..4] {
            return Err(RecordingError::Damaged(begin));
        }
        let bytes = read_up_to(&mut self.from, length)?;
        if bytes.len() < length {
            self.cut = Some(Cut::WithinChunk);
            return Ok(None);
        }
        let hash = chained(self.before, length_bytes, &bytes);
        if head[8..] != hash {
            return Err(RecordingError::Damaged(begin));
        }
        if length == 0 {
            self.ended = true;
            let end = self.taken + head.len() as u64;
            // Nothing is written after the last chunk.
            return if read_up_to(&mut self.from, 1)?.is_empty() {
                Ok(None)
            } else {
                Err(RecordingError::Damaged(end))
            };
        }
        self.before = hash;
        self.taken += (head.len() + length) as u64;
        Ok(Some(bytes))
    }

    /// Returns where the file ended, once it has ended without its last chunk.
    pub fn cut(&self) -> Option<Cut> {
        self.cut
    }

    /// Returns the hash of all chunks so far.
    pub(super) fn hash(&self) -> [u8; 8] {
        self.before
    }
}

/// Reads so many bytes, or fewer where the input ends.
fn read_up_to(from: &mut impl Read, count: usize) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    from.take(count as u64).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// A file that a thread of its own writes.
///
/// [`Write::write`] takes all bytes. It fails when the disk has failed, or when more than 64 MiB wait for the
/// disk: then nobody waits for the disk any more, and what waits is dropped. [`Write::flush`] waits until all
/// is written, as long as the disk takes anything, and closes the file.
pub struct Background {
    chunks: Option<Sender<Vec<u8>>>,
    waiting: Arc<AtomicUsize>,
    is_given_up: Arc<AtomicBool>,
    /// Tells once how the writing ended.
    done: Option<Mutex<Receiver<io::Result<()>>>>,
}

/// A file that is locked for as long as it is open here: a child process that is just being started has it open, too,
/// for a moment.
struct Locked(File);

impl Write for Locked {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.flush()
    }
}

impl Drop for Locked {
    fn drop(&mut self) {
        let _ = self.0.unlock();
    }
}

impl Background {
    /// Checks that a file can be written, and leaves none behind if there was none. Fails if it is not empty:
    /// it may be a recording that somebody needs.
    pub fn check(path: &Path) -> io::Result<()> {
        if File::create_new(path).is_ok() {
            return fs::remove_file(path);
        }
        let file = OpenOptions::new().append(true).create(true).open(path)?;
        match file.metadata()?.len() {
            0 => Ok(()),
            _ => Err(io::Error::new(
                io::ErrorKind::AlreadyExists,
                "it is there already, perhaps the recording of what went wrong: move it, or record to another file",
            )),
        }
    }

    /// Creates a file, or empties it. Fails if another recording is being written to it: each would spoil the
    /// other.
    pub fn create(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().write(true).create(true).truncate(false).open(path)?;
        // Devices, such as `/dev/null`, have nothing to spoil and nothing to empty.
        if file.metadata()?.is_file() {
            // Some file systems know no locks: there the user must see to it.
            if let Err(TryLockError::WouldBlock) = file.try_lock() {
                return Err(io::Error::new(
                    io::ErrorKind::ResourceBusy,
                    "another recording is being written to it: end that one first",
                ));
            }
            file.set_len(0)?;
        }
        Self::begin(Locked(file))
    }

    fn begin(mut file: impl Write + Send + 'static) -> io::Result<Self> {
        let (chunks, inbox) = mpsc::channel::<Vec<u8>>();
        let waiting = Arc::new(AtomicUsize::new(0));
        let is_given_up = Arc::new(AtomicBool::new(false));
        let (left, ends) = (waiting.clone(), is_given_up.clone());
        let (end, done) = mpsc::channel();
        let mut write = move || {
            for chunk in inbox.iter() {
                if ends.load(Ordering::Relaxed) {
                    break;
                }
                file.write_all(&chunk)?;
                left.fetch_sub(chunk.len(), Ordering::Relaxed);
            }
            Ok(())
        };
        let run = move || {
            let ended = write();
            // The file is closed before anybody hears of it.
            drop(write);
            let _ = end.send(ended);
        };
        std::thread::Builder::new().name("dcd-record".into()).spawn(run)?;
        Ok(Self { chunks: Some(chunks), waiting, is_given_up, done: Some(Mutex::new(done)) })
    }

    fn end(&mut self) -> io::Result<()> {
        self.end_within(HANGS)
    }

    /// Closes the file. Gives up a disk that has taken nothing for this long.
    fn end_within(&mut self, patience: Duration) -> io::Result<()> {
        self.chunks = None;
        let Some(done) = self.done.take() else { return Ok(()) };
        let done = done.into_inner().unwrap_or_else(PoisonError::into_inner);
        loop {
            let left = self.waiting.load(Ordering::Relaxed);
            match done.recv_timeout(patience) {
                Ok(ended) => return ended,
                Err(RecvTimeoutError::Disconnected) => return Err(io::Error::other("a panic")),
                Err(RecvTimeoutError::Timeout) if self.waiting.load(Ordering::Relaxed) < left => {}
                Err(RecvTimeoutError::Timeout) => {
                    self.is_given_up.store(true, Ordering::Relaxed);
                    let why = format!("the disk hangs: {left} bytes of the end are lost");
                    return Err(io::Error::other(why));
                }
            }
        }
    }
}

impl Write for Background {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let before = self.waiting.fetch_add(bytes.len(), Ordering::Relaxed);
        if before > WAITING {
            // The thread may hang in the disk for any time: the recorded process does not wait for it.
            self.is_given_up.store(true, Ordering::Relaxed);
            (self.chunks, self.done) = (None, None);
            return Err(io::Error::other("more than 64 MiB wait for the disk: record to a faster one"));
        }
        let gone = match &self.chunks {
            Some(chunks) => chunks.send(bytes.to_vec()).is_err(),
            None => true,
        };
        // The thread ends early only when writing has failed.
        if gone { self.end().and(Err(io::Error::other("the file is closed"))) } else { Ok(bytes.len()) }
    }

    fn flush(&mut self) -> io::Result<()> {
        self.end()
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        if let Err(error) = self.end() {
            tracing::warn!(%error, "the end of the recording is not written");
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    const PATIENCE: Duration = Duration::from_secs(20);

    /// A disk that takes a chunk each time it is told to.
    struct Slow {
        begun: Sender<usize>,
        told: mpsc::Receiver<()>,
    }

    impl Write for Slow {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let _ = self.begun.send(bytes.len());
            let _ = self.told.recv();
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_check_leaves_files_as_they_were() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("node.dcdr");
        Background::check(&path).unwrap();
        assert!(!path.exists(), "nothing is recorded yet");
        fs::write(&path, "").unwrap();
        Background::check(&path).unwrap();
        assert!(path.exists());
        fs::write(&path, "what went wrong").unwrap();
        assert_eq!(Background::check(&path).unwrap_err().kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(fs::read_to_string(&path).unwrap(), "what went wrong");
        assert!(Background::check(&folder.path().join("missing/node.dcdr")).is_err());
    }

    #[test]
    fn who_is_recorded_to_a_disk_that_hangs_does_not_wait_for_it() {
        let ((begun, chunks), (tell, told)) = (mpsc::channel(), mpsc::channel());
        let mut file = Background::begin(Slow { begun, told }).unwrap();
        let chunk = vec![7; 1 << 20];
        file.write_all(&chunk).unwrap();
        chunks.recv_timeout(PATIENCE).expect("the disk has the first");
        let (say, over) = mpsc::channel();
        std::thread::spawn(move || {
            let written = std::iter::from_fn(|| file.write(&chunk).ok()).count();
            drop(file);
            let _ = say.send(written);
        });
        let written = over.recv_timeout(PATIENCE).expect("it goes on while the disk hangs");
        assert!((63..=65).contains(&written), "{written}");
        tell.send(()).unwrap();
        drop(tell);
        assert_eq!(chunks.into_iter().count(), 0, "what waited is dropped");
    }

    #[test]
    fn the_end_of_a_recording_waits_for_a_slow_disk_and_not_for_one_that_hangs() {
        let ((begun, chunks), (tell, told)) = (mpsc::channel(), mpsc::channel());
        let mut file = Background::begin(Slow { begun, told }).unwrap();
        file.write_all(&[7; 9]).unwrap();
        chunks.recv_timeout(PATIENCE).expect("the disk has it");
        let error = file.end_within(Duration::from_millis(20)).unwrap_err();
        assert!(error.to_string().contains("9 bytes"), "{error}");
        drop(file);
        drop(tell);
        let ((begun, _chunks), (tell, told)) = (mpsc::channel(), mpsc::channel());
        let mut file = Background::begin(Slow { begun, told }).unwrap();
        (0..3).for_each(|_| file.write_all(&[7; 9]).unwrap());
        let disk = std::thread::spawn(move || (0..3).for_each(|_| tell.send(()).unwrap()));
        file.flush().unwrap();
        disk.join().unwrap();
    }
}
