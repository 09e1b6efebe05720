//! Joins a world that a server holds, as a client or as a participant, and lists the avatars of this process.

use std::ffi::c_char;
use std::net::{SocketAddr, ToSocketAddrs};
use std::path::PathBuf;
use std::time::{Duration, Instant};

use dcd::World as Dcd;
use dcd::network::JoinConfig;
use dcd::protocol::{Area, WORLD_REACH_M};

use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::pointer::{self, Out, Room, Sized32, check_point};
use crate::registry::{self, ask};
use crate::status::{DCD_ERR_NETWORK, DCD_ERR_NULL, DCD_ERR_TIMEOUT, DcdStatus, Failure};
use crate::world;

/// Definition of a client that joins a served world. Start from DCD_CLIENT_DEF_INIT and give at least `server` and `token`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdClientDef {
    /// Size of this struct: sizeof(DcdClientDef).
    pub struct_size: u32,
    /// Time to wait for the server and the world, milliseconds; 0: 10,000.
    pub timeout_ms: u32,
    /// Address of the server: "host:port", "192.0.2.1:port" or "[2001:db8::1]:port". Where servers stand by for one another (`dcd
    /// serve --directory`), the addresses of all, separated by commas without spaces: the one that answers is the server, now and
    /// later on.
    pub server: *const c_char,
    /// Token that `dcd token --role client` (or `builder`) or dcd_token_create gave. Joining uses it up.
    pub token: *const c_char,
    /// Path of a file that keeps the client's identity, or null. Joining writes the file. A client that joins with it again gets
    /// back the avatars that were left behind. The file holds a secret.
    pub identity_path: *const c_char,
    /// User data of the world; dcd_world_info gives it back.
    pub user_data: u64,
    /// Centre of the first area of interest, world space, metres.
    pub interest_centre: [f64; 3],
    /// Radius of the first area of interest, metres. The client is told the bodies in the area, the scenery that reaches into it,
    /// and the shapes and joints of those. What comes there later, or where dcd_interest_set moves the area to, appears
    /// (DCD_CHANGE_APPEARED). 0: the client is told the whole world, whatever its interest is later on.
    pub interest_radius: f64,
    /// Time that the server may be out of reach later on before dcd_step gives up, milliseconds; 0: 30,000. It counts from when the
    /// client has noticed, which is 10 to 14 s after it last heard of a server that was killed (2 to 3 s where `server` names several).
    pub give_up_ms: u32,
    /// Reserved; must be 0.
    pub reserved: u32,
}

/// Definition of a participant that joins a served world. Start from DCD_PARTICIPANT_DEF_INIT and give at least `server` and
/// `token`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdParticipantDef {
    /// Size of this struct: sizeof(DcdParticipantDef).
    pub struct_size: u32,
    /// Time to wait for the server and the world, milliseconds, as in DcdClientDef.
    pub timeout_ms: u32,
    /// Address of the server, as in DcdClientDef.
    pub server: *const c_char,
    /// Token that `dcd token --role participant` or dcd_token_create gave. Joining uses it up.
    pub token: *const c_char,
    /// Path of the identity file, as in DcdClientDef.
    pub identity_path: *const c_char,
    /// User data of the world; dcd_world_info gives it back.
    pub user_data: u64,
    /// Number of threads that compute the participant's share of the world, 1 to 1024; 0: one per core.
    pub threads: u32,
    /// Time that the server may be out of reach later on before dcd_step gives up, milliseconds; 0: the participant waits without
    /// end, since it computes a share of the world.
    pub give_up_ms: u32,
    /// Centre of the first area of interest, metres, as in DcdClientDef.
    pub interest_centre: [f64; 3],
    /// Radius of the first area of interest, metres, as in DcdClientDef.
    pub interest_radius: f64,
    /// Path of a file to record to, for `dcd replay`, or null. The recording holds all that the participant's share of the world is
    /// given, and a digest of each region after each tick.
    pub record_path: *const c_char,
    /// Address at which the participant's node answers with its metrics, or null, as in DcdServerDef.
    pub metrics: *const c_char,
}

// SAFETY: begins with `struct_size`; every other member is a number or a raw pointer.
unsafe impl Sized32 for DcdClientDef {
    const NAME: &'static str = "DcdClientDef";
}
// SAFETY: as above.
unsafe impl Sized32 for DcdParticipantDef {
    const NAME: &'static str = "DcdParticipantDef";
}

/// Joins a world as a client. A server holds the world, and nodes compute it. The call waits until the server has told the whole
/// world, or what is near of it.
///
/// The server tells the world as it is on its record: up to half a second old (two seconds more where the server has just gone on
/// with a stored world). Until the first states have come from the nodes, the world is at tick 0, and who computes what is not
/// known. The world need not have nodes yet: it stands still until it has.
///
/// The handle is used like that of a local world, with these differences:
/// - Avatars. dcd_body_create makes an avatar, a dynamic or kinematic body of the client's own. Its id is valid at once, and the
///   body stands where the client put it. DCD_CHANGE_APPEARED tells that it is in the world. DCD_CHANGE_REFUSED tells that it is not to
///   be, and then its id is stale.
/// - Input. dcd_body_set_velocity sets the speed of an avatar, and dcd_body_set_pose lets it jump. The next dcd_step sends this
///   input. The server may set a limit to speed, and refuse by DCD_CHANGE_REFUSED.
/// - Steps. dcd_step takes in what has come since the last, and returns at once: call it as often as dt says.
/// - Lost server. A server that is out of reach is dialled again for half a minute (DcdClientDef.give_up_ms). Meanwhile the world
///   goes on as long as nodes compute it, and avatars can be moved. Avatars that are created or destroyed meanwhile are so once the
///   server is back. After that time, or when the world has ended or its server is back with another one, each dcd_step returns DCD_ERR_NETWORK. The world can still be
///   read, and must be destroyed.
/// - Events. The bodies that are there on joining are not reported: list them once by dcd_bodies, and follow dcd_events from then
///   on. Contacts are reported of the client's own avatars, if these ask for them.
/// - Bodies. They are where they were when last heard of, some ticks ago. Bodies of others can only be read.
/// - Unsupported. Joints, forces and impulses, sleep, dcd_borders, dcd_state_hash and queries return DCD_ERR_UNSUPPORTED, except
///   for queries that are submitted (dcd_cast_rays_submit, dcd_cast_shapes_submit, dcd_overlap_shapes_submit and the like).
/// - Leaving. dcd_world_destroy leaves in order. The avatars leave with the client, and come back when it joins with the same
///   identity file.
///
/// `def` and its texts are read during the call. The library keeps threads of its own until the world is destroyed.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STRUCT.
/// - DCD_ERR_ARGUMENT: a malformed address or token, or a token for another role.
/// - DCD_ERR_TIMEOUT: nobody answers.
/// - DCD_ERR_NETWORK: the server refuses (a used or expired token, another version) or cannot be reached.
/// - DCD_ERR_IO: the identity file.
/// - DCD_ERR_LIMIT: no threads.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_client_connect(def: *const DcdClientDef, out: *mut DcdWorld) -> DcdStatus {
    guard("dcd_client_connect", || {
        // SAFETY: the caller vouches for both pointers and for the texts.
        let (entry, out) = unsafe {
            let def = pointer::read_sized(def, "def")?;
            pointer::check_reserved(def.reserved)?;
            let entry = Entry::read(def.server, def.token, def.identity_path, def.timeout_ms, def.user_data)?;
            let entry = entry.near(&def.interest_centre, def.interest_radius)?.patient(def.give_up_ms);
            (entry, Out::new(out, "out")?)
        };
        entry.enter(1, out, Dcd::connect)
    })
}

/// Joins a world as a participant: a client, as dcd_client_connect makes it, whose process also computes a share of the world.
///
/// Threads of the library compute the share, whether or not the program calls dcd_step. dcd_world_destroy first hands the share to
/// the other nodes, which may take some seconds. A process that ends without it is found dead and replaced.
/// Errors: as dcd_client_connect, and DCD_ERR_ARGUMENT (threads out of range).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_participant_join(
    def: *const DcdParticipantDef,
    out: *mut DcdWorld,
) -> DcdStatus {
    guard("dcd_participant_join", || {
        // SAFETY: the caller vouches for both pointers and for the texts.
        let (entry, threads, out) = unsafe {
            let def = pointer::read_sized(def, "def")?;
            let entry = Entry::read(def.server, def.token, def.identity_path, def.timeout_ms, def.user_data)?;
            let entry = entry.near(&def.interest_centre, def.interest_radius)?.patient(def.give_up_ms);
            let entry = entry.recorded(def.record_path)?.measured(def.metrics)?;
            (entry, def.threads, Out::new(out, "out")?)
        };
        let threads = world::asked_threads(threads)?;
        entry.enter(threads, out, Dcd::participate)
    })
}

/// Lists the avatars that this process hosts, oldest first: those that it made, in the world or on their way, and those that an
/// earlier stay left behind. A local world has none.
///
/// Avatars of an earlier stay are in the world on joining, and then no DCD_CHANGE_APPEARED tells of them. Where the process that
/// computed them had not let go of them yet, they come back soon after joining (DCD_CHANGE_APPEARED).
///
/// Writes the ids to `out`, which has `cap` entries, and their number to `count`. With `cap` 0, `out` may be null, to ask for the
/// number.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`count` is written all the same, `out` is not).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_own_avatars(
    world: DcdWorld,
    out: *mut DcdBodyId,
    cap: usize,
    count: *mut usize,
) -> DcdStatus {
    guard("dcd_own_avatars", || {
        // SAFETY: the caller vouches for `cap` entries and for `count`.
        let out = unsafe { Room::new(out, cap, count, ["out", "count"])? };
        ask(world, |world| {
            let avatars = world.dcd.own_avatars();
            out.fill(avatars.into_iter().map(|id| world.mark.body(id)))
        })
    })
}

/// Checked members that the definitions of all processes that join share.
pub(crate) struct Entry {
    server: String,
    token: String,
    identity: Option<PathBuf>,
    timeout: Duration,
    give_up: Option<Duration>,
    user_data: u64,
    interest: Option<Area>,
    record: Option<PathBuf>,
    metrics: Option<SocketAddr>,
}

impl Entry {
    /// # Safety
    /// The texts are null or NUL-terminated.
    pub(crate) unsafe fn read(
        server: *const c_char,
        token: *const c_char,
        identity: *const c_char,
        timeout_ms: u32,
        user_data: u64,
    ) -> Result<Self, Failure> {
        // SAFETY: the caller upholds the same contract.
        unsafe {
            Ok(Self {
                server: given(server, "server", "the server's host:port, as \"192.0.2.7:7420\"")?,
                token: given(token, "token", "what `dcd token` or dcd_token_create gave")?,
                identity: if identity.is_null() {
                    None
                } else {
                    Some(pointer::text(identity, "identity_path")?.into())
                },
                timeout: Duration::from_millis(if timeout_ms == 0 { 10_000 } else { timeout_ms.into() }),
                give_up: None,
                user_data,
                interest: None,
                record: None,
                metrics: None,
            })
        }
    }

    /// Sets how long the server may be out of reach before this process gives up, unless it is 0.
    pub(crate) fn patient(self, give_up_ms: u32) -> Self {
        let give_up = (give_up_ms > 0).then(|| Duration::from_millis(give_up_ms.into()));
        Self { give_up, ..self }
    }

    /// Sets the file to which what is computed here is recorded, unless the path is null.
    ///
    /// # Safety
    /// The text is null or NUL-terminated.
    pub(crate) unsafe fn recorded(self, path: *const c_char) -> Result<Self, Failure> {
        // SAFETY: the caller upholds the same contract.
        let path = unsafe { pointer::optional(path, "record_path")? };
        Ok(Self { record: path.map(PathBuf::from), ..self })
    }

    /// Sets the address at which metrics are answered, unless it is null.
    ///
    /// # Safety
    /// The text is null or NUL-terminated.
    pub(crate) unsafe fn measured(self, metrics: *const c_char) -> Result<Self, Failure> {
        // SAFETY: the caller upholds the same contract.
        Ok(Self { metrics: unsafe { pointer::optional_address(metrics, "metrics")? }, ..self })
    }

    /// Sets the area of interest to join with, unless the radius is 0.
    fn near(self, centre: &[f64; 3], radius_m: f64) -> Result<Self, Failure> {
        let range = 0.0..=WORLD_REACH_M;
        if !range.contains(&radius_m) {
            let message =
                format!("interest_radius is {radius_m}; give metres up to 1e9, or 0 for the whole world");
            return Err(Failure::argument(message));
        }
        check_point(centre, "interest_centre")?;
        let area = Area { centre: *centre, radius_m };
        Ok(Self { interest: (radius_m > 0.0).then_some(area), ..self })
    }

    /// Looks up the servers' names. Some of several may not be found now, as their machines may be gone.
    fn servers(&self) -> Result<Vec<Vec<SocketAddr>>, Failure> {
        let (mut servers, mut unfound) = (Vec::new(), None);
        for name in self.server.split(',') {
            match resolve(name) {
                Ok(found) => servers.push(found),
                Err(failure) if failure.status == DCD_ERR_NETWORK => unfound = Some(failure),
                Err(failure) => return Err(failure),
            }
        }
        match unfound {
            Some(failure) if servers.is_empty() => return Err(failure),
            _ => {}
        }
        if servers.len() > 1 {
            // One socket dials addresses of one family.
            servers.iter_mut().for_each(|found| found.sort_by_key(SocketAddr::is_ipv6));
        }
        Ok(servers)
    }

    /// Tries each address behind the servers' names until one answers.
    pub(crate) fn enter(
        self,
        threads: usize,
        out: Out<DcdWorld>,
        join: impl Fn(&JoinConfig) -> Result<Dcd, dcd::Error>,
    ) -> Result<(), Failure> {
        let deadline = Instant::now() + self.timeout;
        let servers = self.servers()?;
        let count = servers.iter().map(Vec::len).max().unwrap_or(0);
        for i in 0..count {
            let left = (count - i) as u32;
            let mut addresses = servers.iter().filter_map(|found| found.get(i).or(found.last()).copied());
            let Some(server) = addresses.next() else { break };
            let usual = JoinConfig::new(server, self.token.clone());
            let config = JoinConfig {
                give_up: self.give_up,
                standbys: addresses.collect(),
                identity: self.identity.clone(),
                timeout: deadline.saturating_duration_since(Instant::now()) / left,
                threads,
                interest: self.interest,
                record: self.record.clone(),
                metrics: self.metrics,
                ..usual
            };
            match join(&config).map_err(Failure::from) {
                // Nobody answers at this address.
                Err(failure) if failure.status == DCD_ERR_TIMEOUT && left > 1 => {}
                result => {
                    out.write(registry::add(result?, self.user_data));
                    return Ok(());
                }
            }
        }
        Err(Failure::new(DCD_ERR_NETWORK, format!("{} stands for no address; give host:port", self.server)))
    }
}

/// Reads a text that must be given.
///
/// # Safety
/// It is null or NUL-terminated.
unsafe fn given(text: *const c_char, name: &str, what: &str) -> Result<String, Failure> {
    if text.is_null() {
        return Err(Failure::new(DCD_ERR_NULL, format!("{name} is null; give {what}")));
    }
    // SAFETY: the caller upholds the same contract.
    unsafe { Ok(pointer::text(text, name)?.to_owned()) }
}

/// Returns the addresses behind "host:port".
fn resolve(server: &str) -> Result<Vec<SocketAddr>, Failure> {
    if server.contains("://") {
        let message = format!("server is \"{server}\"; give host:port, without what ends in ://");
        return Err(Failure::argument(message));
    }
    let port = server.rsplit_once(':').and_then(|(_, port)| port.parse::<u16>().ok());
    if port.is_none_or(|port| port == 0) {
        return Err(Failure::argument(format!(
            "server is \"{server}\"; give host:port, as \"127.0.0.1:7420\" or \"[::1]:7420\""
        )));
    }
    match server.to_socket_addrs() {
        Ok(addresses) => Ok(addresses.collect()),
        Err(cause) => Err(Failure::new(
            DCD_ERR_NETWORK,
            format!(
                "cannot find the address of \"{server}\" ({cause}); check the name and your name service"
            ),
        )),
    }
}
