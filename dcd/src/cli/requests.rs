//! Passes requests of `dcd save`, `dcd restore`, `dcd backup` and `dcd drain` to the `dcd serve` of a data
//! folder, and the answers back, as files in that folder.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::failure::Failure;
use super::run::snapshot::check_place;
use super::values::{AS_SERVERS_USER, of_folder, stands_by};
use crate::cluster::DrainError;
use crate::runtime::{LocalWorld, ServerProcess, Waiting, is_served, is_standby, is_waiting};
use crate::space::NodeId;

/// The most time for a server: it gives up nodes that hang within seconds, and writes large files.
const WAIT: Duration = Duration::from_secs(120);
/// The most time until a server takes a request. It may be busy with another one.
const TAKE: Duration = Duration::from_secs(30);
/// The interval at which the asker looks for the answer.
const LOOK: Duration = Duration::from_millis(20);
/// The interval at which the asker looks whether the server still runs.
const LOOK_FOR_SERVER: Duration = Duration::from_secs(2);
/// The first line of an answer: the request is done.
const DONE: &str = "done";
/// The first line of an answer: what was asked for cannot be done, and nothing was.
const IMPOSSIBLE: &str = "impossible";
/// The first line of an answer: something failed.
const FAILED: &str = "failed";
const REQUEST: &str = "request-";
const ANSWER: &str = "answer-";
/// The file by which an asker shows that it waits. What an asker that was killed has asked is not done.
const ASKER: &str = "asker-";

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
    if verb == Verb::Save && would_replace_own(data, &file) {
        return Err(Failure::usage(format!(
            "{} lies in the server's data folder, whose own files a save must not replace; choose another folder, or a name that ends in .dcd",
            file.display()
        )));
    }
    if verb == Verb::Backup && lies_in(&file, data) {
        return Err(Failure::usage(format!(
            "{} would lie in the folder that is backed up; choose a folder elsewhere, best on another disk",
            file.display()
        )));
    }
    let file = file.to_str().ok_or_else(|| Failure::usage("the file's path is no UTF-8; choose another"))?;
    ask(data, verb, file)
}

/// Returns whether a file may be one that the server of a data folder keeps there: none of these ends in .dcd.
fn would_replace_own(data: &Path, file: &Path) -> bool {
    let whole = |path: Option<&Path>| path.and_then(|path| path.canonicalize().ok());
    let lies_there = whole(file.parent()).is_some_and(|folder| Some(folder) == whole(Some(data)));
    lies_there && file.extension().is_none_or(|ending| ending != "dcd")
}

/// Returns whether a folder that is to be made would lie in another one, at any depth.
fn lies_in(new: &Path, folder: &Path) -> bool {
    let Ok(folder) = folder.canonicalize() else { return false };
    new.ancestors().skip(1).filter_map(|above| above.canonicalize().ok()).any(|above| above == folder)
}

/// Asks the server of a data folder, waits until the request is done, and returns what the server says.
pub(super) fn ask(data: &Path, verb: Verb, about: &str) -> Result<String, Failure> {
    let shown = data.display();
    // A server that takes over locks the folder before it stands by no longer.
    let is_standby = is_standby(data);
    if !is_served(data).map_err(|error| of_folder(&error))? {
        if is_standby {
            return Err(stands_by(data));
        }
        return Err(Failure::usage(format!(
            "no server runs in {shown}; start it, or name the folder that `dcd serve` was started with (--data)"
        )));
    }
    let asked = Asked::write(data, verb, about)?;
    let (request, answer) = (&asked.request, &asked.answer);
    let (begun, mut looked) = (Instant::now(), Instant::now());
    loop {
        if let Ok(said) = fs::read_to_string(answer) {
            return match said.split_once('\n') {
                Some((DONE, text)) => Ok(text.to_owned()),
                Some((IMPOSSIBLE, text)) => Err(Failure::usage(text)),
                Some((_, text)) => Err(Failure::run(text)),
                None => Err(Failure::run(format!("{} is no answer of a server: {said}", answer.display()))),
            };
        }
        // Only once in a while, as this takes the lock of the folder for a moment.
        if looked.elapsed() >= LOOK_FOR_SERVER {
            looked = Instant::now();
            if is_served(data).is_ok_and(|served| !served) && !answer.exists() {
                return Err(Failure::run(format!("the server of {shown} has stopped before it was done")));
            }
        }
        // Who removes the request first has it: from then on the server does not do it.
        if begun.elapsed() >= TAKE && fs::remove_file(request).is_ok() {
            return Err(Failure::run(format!(
                "the server of {shown} does not hear of `dcd {}`: it hangs, is busy with another request, or is no `dcd serve` (a program's \
                 server obeys `dcd end` alone; it saves its world by World::save_file or dcd_snapshot_save_file)",
                verb.name()
            )));
        }
        if begun.elapsed() >= WAIT {
            return Err(Failure::run(format!(
                "the server of {shown} has not said that it is done; see its log"
            )));
        }
        std::thread::sleep(LOOK);
    }
}

/// The files of a request that is waited for. They are removed with this.
struct Asked {
    request: PathBuf,
    answer: PathBuf,
    asker: PathBuf,
    _waiting: Waiting,
}

impl Asked {
    fn write(data: &Path, verb: Verb, about: &str) -> Result<Self, Failure> {
        let id = std::process::id();
        let [request, answer, asker] = [REQUEST, ANSWER, ASKER].map(|kind| data.join(format!("{kind}{id}")));
        // Of a former process with this id.
        let _ = fs::remove_file(&answer);
        let waiting = Waiting::show(&asker).map_err(|error| refused(&asker, &error))?;
        let asked = Self { request, answer, asker, _waiting: waiting };
        let text = format!("{}\n{about}", verb.name());
        write_whole(&asked.request, &text).map_err(|error| refused(&asked.request, &error))?;
        Ok(asked)
    }
}

impl Drop for Asked {
    fn drop(&mut self) {
        for path in [&self.request, &self.answer, &self.asker] {
            let _ = fs::remove_file(path);
        }
    }
}

/// A file of a request: what it is, and the id of the asker.
struct Letter {
    path: PathBuf,
    kind: &'static str,
    asker: String,
}

/// Returns the files of requests in this folder, in order.
fn letters(data: &Path) -> Vec<Letter> {
    let entries = fs::read_dir(data).into_iter().flatten().flatten();
    let read = |path: PathBuf| {
        let name = path.file_name()?.to_str()?;
        let found = |kind: &'static str| Some((kind, name.strip_prefix(kind)?.to_owned()));
        let (kind, asker) = [REQUEST, ANSWER, ASKER].into_iter().find_map(found)?;
        Some(Letter { path, kind, asker })
    };
    let mut letters: Vec<_> = entries.filter_map(|entry| read(entry.path())).collect();
    letters.sort_unstable_by(|a, b| a.path.cmp(&b.path));
    letters
}

/// Removes requests to a former server of this folder. If a server runs they are its own, and stay.
pub(super) fn forget(data: &Path) {
    if is_served(data).is_ok_and(|served| served) {
        return;
    }
    for letter in letters(data) {
        let _ = fs::remove_file(letter.path);
    }
}

/// Carries out the requests to the server of this folder, and removes what askers have left that were killed.
pub(super) fn obey(data: &Path, server: &ServerProcess) {
    for Letter { path, kind, asker } in letters(data) {
        if !is_waiting(&data.join(format!("{ASKER}{asker}"))) {
            let _ = fs::remove_file(path);
        } else if kind == REQUEST
            && let Some(said) = done(&path, server)
        {
            // If this fails, the asker waits until its time is up.
            let _ = write_whole(&data.join(format!("{ANSWER}{asker}")), &said);
        }
    }
}

/// Carries out a request, and returns the answer; `None` if the asker has withdrawn it.
fn done(request: &Path, server: &ServerProcess) -> Option<String> {
    let read = fs::read_to_string(request);
    if read.as_ref().is_err_and(|error| error.kind() == io::ErrorKind::NotFound) {
        return None;
    }
    if fs::remove_file(request).is_err_and(|error| error.kind() == io::ErrorKind::NotFound) {
        return None;
    }
    let said = match read.as_ref().map(|text| text.split_once('\n')) {
        Ok(Some((verb, about))) => carry_out(verb, about, server),
        Ok(None) => Err((FAILED, "the request is no request of dcd".to_owned())),
        Err(error) => {
            let path = request.display();
            Err((FAILED, format!("the server cannot read the request {path}: {error}; {AS_SERVERS_USER}")))
        }
    };
    let (outcome, text) = said.map_or_else(|error| error, |text| (DONE, text));
    Some(format!("{outcome}\n{text}"))
}

/// Carries out a request, and returns what it came to; or how it failed, and why.
fn carry_out(verb: &str, about: &str, server: &ServerProcess) -> Result<String, (&'static str, String)> {
    let file = Path::new(about);
    let shown = file.display();
    let failed = |error: &dyn std::fmt::Display| (FAILED, format!("{shown}: {error}"));
    match Verb::ALL.into_iter().find(|known| known.name() == verb) {
        Some(Verb::Save) => {
            // Before the world stops for it.
            check_place(file).map_err(|cause| {
                (
                    IMPOSSIBLE,
                    format!("{shown}: {cause}; name a file in a folder where the server's user may write"),
                )
            })?;
            let world = server.save().map_err(|error| (FAILED, error.to_string()))?;
            world.save_file(file).map_err(|error| failed(&error))?;
            let (tick, bodies) = (world.tick().0, world.stats().bodies);
            Ok(format!("saved {bodies} movable bodies after tick {tick} to {shown}"))
        }
        Some(Verb::Restore) => {
            let saved = LocalWorld::open_snapshot(file).and_then(|from| LocalWorld::restore(from, 1));
            let world = saved.map_err(|error| (IMPOSSIBLE, format!("{shown}: {error}")))?;
            server.replace(&world).map_err(|error| failed(&error))?;
            let tick = world.tick().0;
            Ok(format!(
                "the world goes on with what {shown} holds, saved after tick {tick}, but for avatars of clients that are away"
            ))
        }
        Some(Verb::Backup) => {
            let is_free = !file.exists() && file.parent().is_some_and(Path::is_dir);
            let outcome = if is_free { FAILED } else { IMPOSSIBLE };
            let bodies = server.back_up(file).map_err(|error| (outcome, error.to_string()))?;
            Ok(format!(
                "backed up to {shown}, with {bodies} movable bodies (avatars of clients that are away, too): the server's own command goes on with the world, with --data {shown} and \
                 without --directory"
            ))
        }
        Some(Verb::Drain) => {
            let node = node(about).map_err(|error| (IMPOSSIBLE, error))?;
            server.drain(node).map_err(|error| match error {
                DrainError::Unknown(_)
                | DrainError::Gone(_)
                | DrainError::Last(_)
                | DrainError::Plays(..) => (IMPOSSIBLE, error.to_string()),
                error => (FAILED, error.to_string()),
            })?;
            Ok(format!("{node} is drained: other nodes have its regions, and it has ended"))
        }
        None => Err((FAILED, format!("a request to `{verb}`, which this version of dcd does not know"))),
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

fn refused(path: &Path, error: &io::Error) -> Failure {
    let remedy = match error.kind() {
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => "make room there",
        io::ErrorKind::PermissionDenied => AS_SERVERS_USER,
        _ => "name a file in a folder that exists",
    };
    Failure::usage(format!("{}: {error}; {remedy}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::runtime::{Origin, ServeConfig, WorldConfig};

    #[test]
    fn what_a_killed_asker_has_asked_is_not_done_and_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let (data, file) = (folder.path().join("data"), folder.path().join("saved"));
        let world = LocalWorld::new(WorldConfig::default()).unwrap();
        let server = ServerProcess::start(Origin::World(&world), ServeConfig::new(&data)).unwrap();
        let about = file.to_str().unwrap();
        let names = |kind: &str| letters(&data).into_iter().filter(|letter| letter.kind == kind).count();

        let asked = Asked::write(&data, Verb::Backup, about).unwrap();
        obey(&data, &server);
        assert!(file.exists() && asked.answer.exists() && !asked.request.exists());
        assert_eq!([REQUEST, ANSWER, ASKER].map(names), [0, 1, 1]);
        drop(asked);
        assert!(letters(&data).is_empty());

        // What cannot be is told from what fails.
        let nowhere = folder.path().join("no/such");
        for (verb, about) in [
            ("backup", about),
            ("save", folder.path().to_str().unwrap()),
            ("save", nowhere.to_str().unwrap()),
        ] {
            let (outcome, text) = carry_out(verb, about, &server).unwrap_err();
            assert_eq!(outcome, IMPOSSIBLE, "{verb}: {text}");
        }

        // Of two that were killed, the server had answered one.
        for (kind, id) in [(REQUEST, 1), (ASKER, 1), (ANSWER, 2), (ASKER, 2), (REQUEST, 3)] {
            fs::write(data.join(format!("{kind}{id}")), "backup\nelsewhere").unwrap();
        }
        obey(&data, &server);
        assert!(letters(&data).is_empty() && !Path::new("elsewhere").exists());
    }
}
