//! Declares the status codes, and keeps the message that goes with a failure.

use std::cell::RefCell;
use std::ffi::{CStr, c_char};
use std::ops::Deref;

use dcd::cluster::RestoreError;
use dcd::error::{GltfError, RecordingError};
use dcd::net::NetError;
use dcd::physics::{HostError, ShapeError};
use dcd::runtime::{ConnectionError, ProcessError, SnapshotError, WorldError};
use dcd::scene::SceneError;
use dcd::{Instead, Unsupported};

/// Result of a call: DCD_OK, or one of the negative DCD_ERR_ codes. A code never changes its number.
pub type DcdStatus = i32;

/// The call succeeded.
pub const DCD_OK: DcdStatus = 0;
/// A pointer or a handle that must be given is null.
pub const DCD_ERR_NULL: DcdStatus = -1;
/// A handle is stale: what it named was destroyed, or belongs to another world.
pub const DCD_ERR_STALE_ID: DcdStatus = -2;
/// A struct_size is not that of this library's struct. Start from the DCD_…_INIT macro.
pub const DCD_ERR_STRUCT: DcdStatus = -3;
/// A value is out of range: NaN, a negative size, an unknown constant, a count above DCD_MAX_ITEMS.
pub const DCD_ERR_ARGUMENT: DcdStatus = -4;
/// The caller's memory is too small. The size needed was written. A call that asks for the size, by null with room for 0, returns
/// DCD_OK.
pub const DCD_ERR_SMALL_BUFFER: DcdStatus = -5;
/// The call cannot be done now: it comes from within a function that the library calls (see Threads), where worlds may not be used;
/// or, for dcd_step_begin, a step that was begun is not waited for yet; or, for messages, too many wait to be sent.
pub const DCD_ERR_BUSY: DcdStatus = -6;
/// Nobody answered in time.
pub const DCD_ERR_TIMEOUT: DcdStatus = -8;
/// The server refuses, or the link to it is gone.
pub const DCD_ERR_NETWORK: DcdStatus = -9;
/// Versions do not fit: the header that the program was compiled with and the library it runs with, or the build that wrote a
/// snapshot and this one.
pub const DCD_ERR_VERSION: DcdStatus = -10;
/// The library has a bug. The world that was called can only be destroyed; other worlds go on.
pub const DCD_ERR_PANIC: DcdStatus = -11;
/// The role of this world (DcdWorldInfo.role) cannot do this. The message names the role.
pub const DCD_ERR_UNSUPPORTED: DcdStatus = -12;
/// A file cannot be read or written.
pub const DCD_ERR_IO: DcdStatus = -13;
/// The system or the world has no more of something: threads, ids.
pub const DCD_ERR_LIMIT: DcdStatus = -14;

/// Why a call failed. It is boxed, so that a call returns one word. Otherwise four words would be copied from place to place even
/// though the call went well.
#[derive(Debug)]
pub(crate) struct Failure(Box<Why>);

/// The code of a failure, and a message with the cause and the remedy.
#[derive(Debug)]
pub(crate) struct Why {
    pub status: DcdStatus,
    pub message: String,
}

const _: () = assert!(size_of::<Result<(), Failure>>() == size_of::<usize>());

impl Deref for Failure {
    type Target = Why;

    fn deref(&self) -> &Why {
        &self.0
    }
}

impl Failure {
    #[cold]
    pub(crate) fn new(status: DcdStatus, message: impl Into<String>) -> Self {
        Self(Box::new(Why { status, message: message.into() }))
    }

    pub(crate) fn argument(message: impl Into<String>) -> Self {
        Self::new(DCD_ERR_ARGUMENT, message)
    }

    /// Names the file where the failure is one of a file or of what is in it.
    pub(crate) fn of_file(self, path: &str) -> Self {
        match self.status {
            DCD_ERR_ARGUMENT | DCD_ERR_IO | DCD_ERR_VERSION => {
                Self::new(self.status, format!("{path}: {}", self.message))
            }
            _ => self,
        }
    }
}

/// Names settings and functions as the header does, where a message names those of the command line or of Rust.
fn in_c(mut message: String) -> String {
    const NAMES: [(&str, &str); 6] = [
        ("its --data and --listen", "the same data_path and listen"),
        ("`--identity`", "identity_path"),
        ("--identity", "identity_path"),
        ("--give-up", "give_up_ms"),
        ("--advertise", "DcdNodeDef.advertise"),
        ("World::record_last", "dcd_record_last"),
    ];
    for (rust, c) in NAMES {
        if message.contains(rust) {
            message = message.replace(rust, c);
        }
    }
    message
}

impl From<dcd::Error> for Failure {
    fn from(error: dcd::Error) -> Self {
        use dcd::Error;
        match error {
            Error::World(error) => error.into(),
            Error::Shape(error) => error.into(),
            Error::Snapshot(error) => error.into(),
            Error::Gltf(error) => error.into(),
            Error::Scene(error) => error.into(),
            Error::Recording(error) => error.into(),
            Error::Process(error) => error.into(),
            Error::Unsupported(error) => error.into(),
            Error::Connection(error) => error.into(),
            Error::Lost(why) => Self::new(DCD_ERR_NETWORK, in_c(why)),
            error => Self::argument(error.to_string()),
        }
    }
}

impl From<Unsupported> for Failure {
    fn from(Unsupported { role, what, instead }: Unsupported) -> Self {
        let in_c = match instead {
            Instead::ComputeAlone => "this is for worlds that one process computes alone (dcd_world_create)",
            Instead::JoinAsClient => {
                "it works for others; join the world as a client (dcd_client_connect) to see it and play in it"
            }
            Instead::Serve => "it has no network; serve it (dcd_server_create)",
            Instead::MakeSourceAnew => "make the world anew with dcd_world_create",
            Instead::DriveAvatars => {
                "it drives its own avatars by dcd_body_set_velocity and dcd_body_set_pose"
            }
            Instead::Walk => {
                "a character obeys dcd_body_set_velocity and goes where it can walk; to have one elsewhere, destroy it and create another"
            }
            Instead::PushByAvatars => {
                "it drives its own avatars, which push what they meet (dcd_body_set_velocity)"
            }
            Instead::PushFound => {
                "push what a query finds (dcd_overlap_shapes_submit, dcd_body_apply_impulse)"
            }
            Instead::MakeAvatars => "it has its own avatars (dcd_own_avatars) to meet them with",
            Instead::ShapeAtBirth => {
                "give an avatar its own in DcdBodyDef, and other bodies theirs in the scene"
            }
            Instead::UsualSleep => {
                "leave sleep_linear, sleep_angular and sleep_after as DCD_BODY_DEF_INIT has them"
            }
            Instead::FixedInScene => {
                "give the scene the fixed body, make a kinematic one, or join by a token that lets it build (DCD_ROLE_BUILDER)"
            }
            Instead::JointsInScene => {
                "joints belong to the scene that the server was given, its program, and who joins by a token that lets it build \
                 (DCD_ROLE_BUILDER)"
            }
            Instead::KinematicByVelocity => "make a DCD_KINEMATIC one and give it velocities",
            Instead::RecordNodes => {
                "a server, node or participant is recorded from its beginning (record_path of DcdServerDef, DcdNodeDef and \
                 DcdParticipantDef)"
            }
            Instead::HearTouches => "it hears when contacts begin and end (dcd_events)",
            Instead::CompareLocal => {
                "it hears of bodies at different ticks; compare hashes of local worlds (dcd_world_create)"
            }
            Instead::SubmitQuery => {
                "it hears where bodies are and computes nothing; submit what you ask (dcd_cast_rays_submit and the like)"
            }
            Instead::AskServer => {
                "whoever runs the server can: its program by dcd_token_create, or `dcd token` beside it"
            }
            Instead::SayInterest => "it is seen where its area of interest is (dcd_interest_set)",
            // The other texts name no function.
            instead => &instead.to_string(),
        };
        Self::new(DCD_ERR_UNSUPPORTED, format!("a {role} cannot {what}: {in_c}"))
    }
}

impl From<ConnectionError> for Failure {
    fn from(error: ConnectionError) -> Self {
        let status = match error {
            ConnectionError::Gone => DCD_ERR_STALE_ID,
            ConnectionError::NotServer | ConnectionError::NotByServer => DCD_ERR_UNSUPPORTED,
            ConnectionError::Lost => DCD_ERR_NETWORK,
            ConnectionError::TooLong { .. } => DCD_ERR_ARGUMENT,
            ConnectionError::Full => DCD_ERR_BUSY,
        };
        Self::new(status, error.to_string())
    }
}

impl From<WorldError> for Failure {
    fn from(error: WorldError) -> Self {
        let status = match &error {
            WorldError::NoBody(_) | WorldError::NoJoint(_) => DCD_ERR_STALE_ID,
            WorldError::Full | WorldError::Host(HostError::Threads { .. }) => DCD_ERR_LIMIT,
            WorldError::Tree(_)
            | WorldError::Host(_)
            | WorldError::Control(_)
            | WorldError::Setting { .. }
            | WorldError::TooFast { .. }
            | WorldError::NoCharacter(_)
            | WorldError::NoVehicle(_)
            | WorldError::OtherWorld
            | WorldError::NoCollider { .. } => DCD_ERR_ARGUMENT,
        };
        // DcdWorldDef names these members without their unit.
        let mut message = error.to_string();
        for (name, unit) in [("dt", "_s"), ("tolerance", "_m_s"), ("speed_limit", "_m_s")] {
            message = message.replace(&format!("{name}{unit} is"), &format!("{name} is"));
        }
        Self::new(status, message)
    }
}

impl From<ProcessError> for Failure {
    fn from(error: ProcessError) -> Self {
        let status = match &error {
            ProcessError::Timeout { .. }
            | ProcessError::NoStatus { .. }
            | ProcessError::NotSaved { .. }
            | ProcessError::NotReleased { .. }
            | ProcessError::Net(NetError::Unreachable { .. }) => DCD_ERR_TIMEOUT,
            ProcessError::Net(
                NetError::File { .. } | NetError::Damaged { .. } | NetError::FolderTaken { .. },
            )
            | ProcessError::Directory(_)
            | ProcessError::Record { .. }
            | ProcessError::Backup { .. }
            | ProcessError::Restore(RestoreError::NoWorld | RestoreError::Entry(_)) => DCD_ERR_IO,
            ProcessError::Fault => DCD_ERR_PANIC,
            ProcessError::Thread(_) | ProcessError::Net(NetError::Threads(_)) => DCD_ERR_LIMIT,
            ProcessError::Restore(RestoreError::OtherWorld)
            | ProcessError::Net(NetError::Token(_))
            | ProcessError::Token(_)
            | ProcessError::Role { .. }
            | ProcessError::Lag { .. }
            | ProcessError::OtherSteps { .. }
            | ProcessError::Unservable { .. }
            | ProcessError::Tree(_)
            | ProcessError::World(_)
            | ProcessError::Shape(_)
            | ProcessError::Host(_) => DCD_ERR_ARGUMENT,
            ProcessError::Net(_)
            | ProcessError::Metrics { .. }
            | ProcessError::Device(_)
            | ProcessError::ServerGone { .. }
            | ProcessError::GivenUp { .. }
            | ProcessError::LeaderUnreachable { .. }
            | ProcessError::Superseded { .. }
            | ProcessError::Evicted { .. }
            | ProcessError::SentAway { .. }
            | ProcessError::Refused(_)
            | ProcessError::Ended(_)
            | ProcessError::WorldEnded
            | ProcessError::Stopped => DCD_ERR_NETWORK,
        };
        Self::new(status, in_c(error.to_string()))
    }
}

impl From<RecordingError> for Failure {
    fn from(error: RecordingError) -> Self {
        let status = match &error {
            RecordingError::Unwritable { .. }
            | RecordingError::NotWhole { .. }
            | RecordingError::Former(_)
            | RecordingError::Io(_) => DCD_ERR_IO,
            _ => DCD_ERR_ARGUMENT,
        };
        Self::new(status, in_c(error.to_string()))
    }
}

impl From<GltfError> for Failure {
    fn from(error: GltfError) -> Self {
        let status = match &error {
            GltfError::TooLarge => DCD_ERR_LIMIT,
            _ => DCD_ERR_IO,
        };
        Self::new(status, error.to_string())
    }
}

impl From<SnapshotError> for Failure {
    fn from(error: SnapshotError) -> Self {
        let status = match &error {
            SnapshotError::Io(_) | SnapshotError::Unsavable(_) => DCD_ERR_IO,
            SnapshotError::Unlike { .. } => DCD_ERR_VERSION,
            SnapshotError::Threads(_) => DCD_ERR_LIMIT,
            SnapshotError::Foreign
            | SnapshotError::Truncated(_)
            | SnapshotError::Damaged(_)
            | SnapshotError::Undecodable(_) => DCD_ERR_ARGUMENT,
        };
        Self::new(status, error.to_string())
    }
}

impl From<ShapeError> for Failure {
    fn from(error: ShapeError) -> Self {
        Self::argument(error.to_string())
    }
}

impl From<SceneError> for Failure {
    fn from(error: SceneError) -> Self {
        let status = if matches!(error, SceneError::Read { .. }) { DCD_ERR_IO } else { DCD_ERR_ARGUMENT };
        Self::new(status, error.to_string())
    }
}

thread_local! {
    static LAST: RefCell<String> = const { RefCell::new(String::new()) };
}

/// Keeps the message of this thread's last failure.
pub(crate) fn remember(function: &str, failure: &Failure) {
    let message = format!("{function}: {}", failure.message);
    // A thread that is ending has no thread-locals any more, and nobody reads its message.
    let _ = LAST.try_with(|last| *last.borrow_mut() = message);
}

/// Returns the message of this thread's last failure.
pub(crate) fn last() -> String {
    LAST.try_with(|last| last.borrow().clone()).unwrap_or_default()
}

pub(crate) fn name(status: DcdStatus) -> &'static CStr {
    match status {
        DCD_OK => c"DCD_OK",
        DCD_ERR_NULL => c"DCD_ERR_NULL",
        DCD_ERR_STALE_ID => c"DCD_ERR_STALE_ID",
        DCD_ERR_STRUCT => c"DCD_ERR_STRUCT",
        DCD_ERR_ARGUMENT => c"DCD_ERR_ARGUMENT",
        DCD_ERR_SMALL_BUFFER => c"DCD_ERR_SMALL_BUFFER",
        DCD_ERR_BUSY => c"DCD_ERR_BUSY",
        DCD_ERR_TIMEOUT => c"DCD_ERR_TIMEOUT",
        DCD_ERR_NETWORK => c"DCD_ERR_NETWORK",
        DCD_ERR_VERSION => c"DCD_ERR_VERSION",
        DCD_ERR_PANIC => c"DCD_ERR_PANIC",
        DCD_ERR_UNSUPPORTED => c"DCD_ERR_UNSUPPORTED",
        DCD_ERR_IO => c"DCD_ERR_IO",
        DCD_ERR_LIMIT => c"DCD_ERR_LIMIT",
        _ => c"(no DCD status)",
    }
}

/// Copies as much of `text` as fits, cut between characters, and ends it with NUL. Returns the length of the whole text.
///
/// # Safety
/// `buf` is null or points to `cap` writable bytes.
pub(crate) unsafe fn copy_text(text: &str, buf: *mut c_char, cap: usize) -> usize {
    if !buf.is_null() && cap > 0 {
        let fits = (0..=text.len().min(cap - 1)).rev().find(|&end| text.is_char_boundary(end)).unwrap_or(0);
        // SAFETY: `fits` < `cap`, so both the text and its NUL lie within the caller's buffer.
        unsafe {
            std::ptr::copy_nonoverlapping(text.as_ptr().cast(), buf, fits);
            buf.add(fits).write(0);
        }
    }
    text.len()
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use dcd::{World, WorldConfig};

    use super::*;

    #[test]
    fn messages_name_settings_and_functions_of_c() {
        let given_up = ProcessError::GivenUp {
            server: ([10, 0, 0, 1], 7000).into(),
            waited: Duration::from_secs(9),
            reason: "timed out".into(),
        };
        assert_eq!(
            Failure::from(given_up).message,
            "the server at 10.0.0.1:7000 has been out of reach for 9 s (timed out); start it again with the same data_path and listen, \
             and this process with a new token, or a node with its identity_path; give_up_ms lets it wait longer"
        );
        let mut world = World::new(WorldConfig::default()).unwrap();
        let nothing = Failure::from(world.keep_recording("kept.dcdr").unwrap_err());
        assert_eq!(
            (nothing.status, &*nothing.message),
            (DCD_ERR_ARGUMENT, "nothing is recorded: begin by dcd_record_last")
        );
    }

    #[test]
    fn what_is_no_file_is_refused_with_its_path_and_a_remedy() {
        let mut world = World::new(WorldConfig::default()).unwrap();
        for path in ["", "no/such/folder/fall.dcdr"] {
            let refused = Failure::from(world.record_to(path).unwrap_err());
            assert_eq!(refused.status, DCD_ERR_IO);
            let (begin, end) = (format!("cannot record to \"{path}\": "), "or name another file");
            assert!(
                refused.message.starts_with(&begin) && refused.message.ends_with(end),
                "{}",
                refused.message
            );
        }
    }
}
