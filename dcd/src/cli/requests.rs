//! Passes requests of `dcd save`, `dcd restore`, `dcd backup` and `dcd drain` to the `dcd serve` of a data
//! folder, and the answers back, as files in that folder.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::failure::Failure;
use crate::runtime::{LocalWorld, ProcessError, ServerProcess, is_served};
use crate::space::NodeId;

/// The most time for a server: it gives up nodes that hang within seconds, and writes large files.
const WAIT: Duration = Duration::from_secs(120);
/// The interval at which the asker looks for the answer.
const LOOK: Duration = Duration::from_millis(20);
/// The interval at which the asker looks whether the server still runs.
const LOOK_FOR_SERVER: Duration = Duration::from_secs(2);
const REQUEST: &str = "request-";
const ANSWER: &str = "answer-";

/// A request to a server, about a file or a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Verb {
    Save,
    Restore,
    Backup,
    Drain,
}

impl Verb {
    const ALL: [Self; 4] = [Self::Save, Self::Restore, Self::Backup, Self::Drain];

    const fn name(self) -> &'static str {
        match self {
            Self::Save => "save",
            Self::Restore => "restore",
            Self::Backup => "backup",
            Self::Drain => "drain",
        }
    }
}

/// Asks the server of a data folder for something about a file, as [`ask`] does.
pub(super) fn ask_about_file(data: &Path, verb: Verb, file: &Path) -> Result<String, Failure> {
    let file = std::path::absolute(file).map_err(|error| refused(file, &error))?;
    let file = file.to_str().ok_or_else(|| Failure::usage("the file's path is no UTF-8; choose another"))?;
    ask(data, verb, file)
}

/// Asks the server of a data folder, waits until the request is done, and returns what the server says.
pub(super) fn ask(data: &Path, verb: Verb, about: &str) -> Result<String, Failure> {
    let shown = data.display();
    if !is_served(data).map_err(ProcessError::from)? {
        return Err(Failure::usage(format!(
            "no server runs in {shown}; name the folder that `dcd serve` was started with (--data)"
        )));
    }
    let id = std::process::id();
    let (request, answer) = (data.join(format!("{REQUEST}{id}")), data.join(format!("{ANSWER}{id}")));
    let _ = fs::remove_file(&answer);
    write_whole(&request, &format!("{}\n{about}", verb.name())).map_err(|error| refused(&request, &error))?;
    let (deadline, mut looked) = (Instant::now() + WAIT, Instant::now());
    loop {
        if let Ok(said) = fs::read_to_string(&answer) {
            let _ = fs::remove_file(&answer);
            return match said.split_once('\n') {
                Some(("done", text)) => Ok(text.to_owned()),
                Some((_, text)) => Err(Failure::run(text)),
                None => Err(Failure::run(format!("{} is no answer of a server: {said}", answer.display()))),
            };
        }
        // Only once in a while, as this takes the lock of the folder for a moment.
        if looked.elapsed() >= LOOK_FOR_SERVER {
            looked = Instant::now();
            if is_served(data).is_ok_and(|served| !served) && !answer.exists() {
                let _ = fs::remove_file(&request);
                return Err(Failure::run(format!("the server of {shown} has stopped before it was done")));
            }
        }
        if Instant::now() >= deadline {
            let heard = !request.exists();
            let _ = fs::remove_file(&request);
            return Err(Failure::run(match heard {
                true => format!("the server of {shown} has not said that it is done; see its log"),
                false => format!(
                    "the server of {shown} does not hear: it hangs, or is no `dcd serve` (a program saves its world itself, by \
                     World::save_file or dcd_snapshot_save_file)"
                ),
            }));
        }
        std::thread::sleep(LOOK);
    }
}

/// Removes requests to a former server of this folder. If a server runs they are its own, and stay.
pub(super) fn forget(data: &Path) {
    if is_served(data).is_ok_and(|served| served) {
        return;
    }
    for path in files(data, REQUEST).into_iter().chain(files(data, ANSWER)) {
        let _ = fs::remove_file(path);
    }
}

/// Carries out the requests to the server of this folder.
pub(super) fn obey(data: &Path, server: &ServerProcess) {
    for request in files(data, REQUEST) {
        let read = fs::read_to_string(&request);
        // The asker has given up.
        if read.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::NotFound) {
            continue;
        }
        let _ = fs::remove_file(&request);
        let name = request.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        let Some(id) = name.strip_prefix(REQUEST) else { continue };
        let said = match read.as_ref().map(|text| text.split_once('\n')) {
            Ok(Some((verb, about))) => carry_out(verb, about, server),
            Ok(None) => Err("the request is no request of dcd".to_owned()),
            Err(error) => Err(format!(
                "the server cannot read the request {}: {error}; ask as the user that it runs as: runuser -u dcd -- dcd ...",
                request.display()
            )),
        };
        let said = match said {
            Ok(text) => format!("done\n{text}"),
            Err(text) => format!("failed\n{text}"),
        };
        // If this fails, the asker waits until its time is up.
        let _ = write_whole(&data.join(format!("{ANSWER}{id}")), &said);
    }
}

fn carry_out(verb: &str, about: &str, server: &ServerProcess) -> Result<String, String> {
    let file = Path::new(about);
    let shown = file.display();
    let failed = |error: &dyn std::fmt::Display| format!("{shown}: {error}");
    match Verb::ALL.into_iter().find(|known| known.name() == verb) {
        Some(Verb::Save) => {
            let world = server.save().map_err(|error| error.to_string())?;
            world.save_file(file).map_err(|error| failed(&error))?;
            let (tick, bodies) = (world.tick().0, world.stats().bodies);
            Ok(format!("saved {bodies} movable bodies after tick {tick} to {shown}"))
        }
        Some(Verb::Restore) => {
            let saved = LocalWorld::open_snapshot(file).and_then(|from| LocalWorld::restore(from, 1));
            let world = saved.map_err(|error| failed(&error))?;
            server.replace(&world).map_err(|error| failed(&error))?;
            let tick = world.tick().0;
            Ok(format!(
                "the world goes on with what {shown} holds, saved after tick {tick}, but for avatars of clients that are away"
            ))
        }
        Some(Verb::Backup) => {
            let bodies = server.back_up(file).map_err(|error| error.to_string())?;
            Ok(format!(
                "backed up to {shown}, with {bodies} bodies: the server's own command goes on with the world, with --data {shown} and \
                 without --directory"
            ))
        }
        Some(Verb::Drain) => {
            let node = node(about)?;
            server.drain(node).map_err(|error| error.to_string())?;
            Ok(format!("{node} is drained: other nodes have its regions, and it has ended"))
        }
        None => Err(format!("a request to `{verb}`, which this version of dcd does not know")),
    }
}

/// Parses the name of a node.
pub(super) fn node(text: &str) -> Result<NodeId, String> {
    let number = text.strip_prefix('n').and_then(|number| number.parse().ok());
    number.map(NodeId).ok_or_else(|| format!("`{text}` is no node; write its name as `dcd status` does: n2"))
}

/// Writes a file under another name first, so that nobody reads a part of it.
fn write_whole(path: &Path, text: &str) -> io::Result<()> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let part = path.with_file_name(format!(".{name}.part"));
    fs::write(&part, text)?;
    fs::rename(&part, path)
}

/// Returns the files of a folder whose names begin with `prefix`, in order.
fn files(folder: &Path, prefix: &str) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let is_one = |path: &PathBuf| {
        path.file_name().and_then(|name| name.to_str()).is_some_and(|name| name.starts_with(prefix))
    };
    let mut files: Vec<_> = entries.map(|entry| entry.path()).filter(is_one).collect();
    files.sort_unstable();
    files
}

fn refused(path: &Path, error: &io::Error) -> Failure {
    let remedy = match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "make room there",
        io::ErrorKind::PermissionDenied => "see that this user may write there",
        _ => "name a file in a folder that exists",
    };
    Failure::usage(format!("{}: {error}; {remedy}", path.display()))
}
