//! Decodes bytes that nobody encoded: messages, states, the handshake of joining, scenes, options, requests
//! of browsers, snapshots and recordings.

use std::cell::RefCell;
use std::io::Cursor;
use std::path::Path;
use std::time::Duration;

use dcd::cluster::CanBuild;
use dcd::delta::{FreeMotion, Receiver};
use dcd::protocol::{Part, decode, encode};
use dcd::recording::{Computers, LocalPhysics, Physics, last_tick, open};
use dcd::runtime::LocalWorld;
use dcd::sim::{StandIn, sim_world};
use dcd::{Params, Scene, Tick};

use super::script::events;

/// Decodes a message. A valid message survives encoding and decoding.
pub(super) fn message(bytes: &[u8]) {
    if let Ok(message) = decode(bytes) {
        let again = encode(&message);
        // The bytes are compared, not the values: a value may contain NaN.
        let twice = decode(&again).expect("what was decoded can be sent on");
        assert_eq!(encode(&twice), again);
    }
}

/// Reads datagrams of states, one per event.
pub(super) fn states(script: &[u8]) {
    let (mut receiver, mut now) = (Receiver::default(), Duration::ZERO);
    receiver.set_motion(FreeMotion::of(&sim_world(1).step));
    for (index, event) in events(script).enumerate() {
        now += event.after();
        let part = Part {
            series: (event.kind / 64).into(),
            batch: index as u32 + u32::from(event.kind % 4),
            number: index as u32 ^ u32::from(event.from / 16),
            states: event.bytes.to_vec(),
        };
        let _ = receiver.take_in(now, Tick(index as u64), &part, event.from % 16 == 15);
        let _ = receiver.due(now, 0);
    }
}

/// Reads messages of the joining handshake, and texts of tokens.
pub(super) fn joining(bytes: &[u8]) {
    dcd::net::read_joining(bytes);
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if let Ok(token) = text.parse::<dcd::net::Token>() {
        assert_eq!(token.to_string().parse(), Ok(token));
    }
    if let Ok(key) = text.parse::<dcd::net::ResumeKey>() {
        assert_eq!(key.to_string().parse(), Ok(key));
    }
}

thread_local! {
    /// The folder of the files that this thread reads.
    static FOLDER: RefCell<Option<tempfile::TempDir>> = const { RefCell::new(None) };
}

/// Returns whether a file of this name and content is a scene.
pub(super) fn loads(name: &str, content: &[u8]) -> bool {
    in_file(name, content, |path| Scene::load(path, &Params::default()).is_ok())
}

/// Writes a file of this name and content, and has it read.
fn in_file(name: &str, content: &[u8], read: impl FnOnce(&Path) -> bool) -> bool {
    FOLDER.with_borrow_mut(|folder| {
        let folder = folder.get_or_insert_with(|| tempfile::tempdir().expect("a folder can be made"));
        let path = folder.path().join(name);
        std::fs::write(&path, content).expect("a file can be written");
        read(&path)
    })
}

/// Loads a scene file.
pub(super) fn scene(text: &[u8]) {
    loads("scene.toml", text);
}

/// Loads a model, in either format.
pub(super) fn model(text: &[u8]) {
    for name in ["model.xml", "model.urdf"] {
        loads(name, text);
    }
}

/// Reads what a browser sends to a viewer, which includes HTTP requests.
pub(super) fn page(bytes: &[u8]) {
    dcd::read_browser(bytes);
}

/// Reads a file of options. No content of it begins a world anew.
pub(super) fn config(text: &[u8]) {
    is_config(text);
}

/// Returns whether a file of this content is a file of options.
pub(super) fn is_config(content: &[u8]) -> bool {
    in_file("options.toml", content, dcd::cli::reads_config)
}

/// Restores a snapshot.
pub(super) fn snapshot(bytes: &[u8]) {
    let _ = LocalWorld::restore(bytes, 1);
}

/// Stand-ins that compute what recorded nodes and servers need. Local worlds get none: their recordings hold
/// snapshots, which are trusted.
struct Stands;

impl Computers for Stands {
    fn node(&self, _stand_in: bool) -> Option<Box<dyn Physics>> {
        Some(Box::<StandIn>::default())
    }

    fn can_build(&self) -> Option<CanBuild> {
        Some(|_, _| true)
    }

    fn local(&self) -> Option<Box<dyn LocalPhysics>> {
        None
    }
}

/// Replays a recording to its end.
pub(super) fn recording(bytes: &[u8]) {
    let _ = last_tick(Cursor::new(bytes.to_vec()));
    if let Ok(mut replayed) = open(Cursor::new(bytes.to_vec()), &Stands) {
        while let Ok(Some(_)) = replayed.advance() {}
    }
}
