//! Creates servers, which hold a world for other processes, mints join tokens, and joins worlds as a node.

use std::ffi::c_char;
use std::path::PathBuf;
use std::time::Duration;

use dcd::cluster::Grouping;
use dcd::network::{JoinConfig, JoinRole, ServeConfig};
use dcd::protocol::{DelayThresholds, MAX_LAG, MAX_STATE_TICKS, Pace, Thresholds};
use dcd::runtime::GroupConfig;
use dcd::{Tick, World as Dcd};

use crate::guard::guard;
use crate::ids::DcdWorld;
use crate::join::Entry;
use crate::pointer::{self, Out, Room, Sized32};
use crate::registry::{self, ask, with};
use crate::role::{DCD_ROLE_BUILDER, DCD_ROLE_CLIENT, DCD_ROLE_NODE, DCD_ROLE_PARTICIPANT, DcdRole};
use crate::status::{DCD_ERR_NULL, DCD_ERR_UNSUPPORTED, DcdStatus, Failure};
use crate::world::{self, DcdWorldDef, Opened};

/// In DcdServerDef.flags: the server begins anew, and forgets a world that the data folder holds.
pub const DCD_SERVER_FRESH: u32 = 1;
/// In DcdServerDef.flags: the world advances as fast as the nodes can, rather than in real time.
pub const DCD_SERVER_UNPACED: u32 = 2;

/// Settings by which nodes form groups and keep in step. Start from DCD_GROUP_DEF_INIT.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdGroupDef {
    /// Size of this struct: sizeof(DcdGroupDef).
    pub struct_size: u32,
    /// Largest number of ticks by which nodes run ahead of one another, and extrapolate, 0 to 60; 0: lockstep. Above 0 the coupling
    /// must be DCD_COUPLING_OWNER.
    pub lag_ticks: u32,
    /// Round trip below which nodes share a group, milliseconds; 0: all nodes that reach each other share one.
    pub near_ms: f32,
    /// Round trip above which members are voted out of their group, milliseconds; above near_ms, and 0 where that is 0.
    pub far_ms: f32,
    /// Largest distance of a body from its place in the group that is authoritative for it, metres, above 0.
    pub agree: f32,
    /// Largest number of nodes in a group, 1 to 1024.
    pub size: u32,
}

/// Definition of a server. Start from DCD_SERVER_DEF_INIT and give at least `data_path` and one of `scene` and `source`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdServerDef {
    /// Size of this struct: sizeof(DcdServerDef).
    pub struct_size: u32,
    /// Number of nodes to wait for before the first tick, 1 to 1024.
    pub nodes: u32,
    /// Name of a scene of the library, or path of a scene file, as in dcd_world_open_scene; null with `source`.
    pub scene: *const c_char,
    /// Texts "name=value" that change parameters of the scene, or null.
    pub params: *const *const c_char,
    /// Number of texts in `params`.
    pub param_count: usize,
    /// Cut and coupling of the world, or null. The same members count as in dcd_world_open_scene.
    pub world: *const DcdWorldDef,
    /// Local world to serve as it is now, with its cut and settings; else null (v is 0). It is copied and stays the program's.
    /// Bodies keep their user data, and have other handles in the worlds that join. With it, `scene`, `params` and `world` are
    /// null. Callbacks (hooks) and the strengths of joints stay behind: a served world has none.
    pub source: DcdWorld,
    /// How nodes form groups, or null for DCD_GROUP_DEF_INIT.
    pub groups: *const DcdGroupDef,
    /// Address to listen at, such as "127.0.0.1:7420", "0.0.0.0:7420" or "[::]:7420"; port 0 takes any free one (dcd_address).
    pub listen: *const c_char,
    /// Path of a folder, made if need be, that keeps the server's keys, the list of used tokens, and the world. A server that died
    /// goes on with the world when one is made in the same way. Each server has a folder of its own.
    pub data_path: *const c_char,
    /// Tick after which the world ends; 0: it ends when it is destroyed.
    pub last_tick: u64,
    /// Largest speed at which clients may move their avatars, m/s, above 0 and up to 100,000.
    pub avatar_speed: f32,
    /// DCD_SERVER_... bits.
    pub flags: u32,
    /// User data of the world; dcd_world_info gives it back.
    pub user_data: u64,
    /// Number of steps from one state of a moving body that clients are told to the next, 1 to 30. Clients show the steps between
    /// by interpolation (dcd_view_time). 1 tells each step, in up to three times the bytes of 3.
    pub state_every: u32,
    /// Share of participants, 0 to 1, whose regions the leader computes once more, to compare; 0: none. A participant that
    /// computes otherwise is sent away. Which ones are drawn is not told. It needs lockstep, and a node that is no participant and
    /// computes as many more regions.
    pub verify: f32,
    /// Address at which the server answers over HTTP with its metrics (/metrics, in Prometheus' text format) and whether it is well
    /// (/healthz, /readyz), such as "127.0.0.1:9420"; port 0 takes any free one (dcd_metrics_address). Whoever reaches it may read
    /// them. Null: nowhere, and nothing is measured.
    pub metrics: *const c_char,
    /// Place in etcd that keeps the world instead of the folder: "etcd://HOST:PORT[,HOST:PORT...]/NAME", in a library that is built
    /// with its feature etcd. Null: the folder keeps the world.
    ///
    /// Servers with the same place, scene and settings stand by for one another: dcd_server_create waits until none of the others
    /// serves.
    ///
    /// Over TLS the place is "etcds://HOST:PORT/NAME?cacert=FILE", with "&cert=FILE&key=FILE" where etcd asks for certificates, and
    /// "&user=NAME&password-file=FILE" where it has users. Without a file the password is in the environment (`DCD_ETCD_PASSWORD`).
    pub directory: *const c_char,
    /// Path of a file to record to, for `dcd replay`, or null. The recording holds all that the server is given. A file that holds
    /// something is refused: it may say what went wrong before.
    pub record_path: *const c_char,
    /// Time that the avatars of a client that left wait for its return (DcdClientDef.identity_path) before they are removed,
    /// seconds, above 0 and up to 31,536,000.
    pub avatar_expiry: f32,
    /// Reserved; must be 0.
    pub reserved: u32,
}

/// Definition of a node that joins a served world. Start from DCD_NODE_DEF_INIT and give at least `server` and `token`.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct DcdNodeDef {
    /// Size of this struct: sizeof(DcdNodeDef).
    pub struct_size: u32,
    /// Time to wait for the server and the world, milliseconds, as in DcdClientDef.
    pub timeout_ms: u32,
    /// Address of the server, as in DcdClientDef.
    pub server: *const c_char,
    /// Token that dcd_token_create or `dcd token --role node` gave. Joining uses it up. A used token will do where the file of
    /// identity_path exists already.
    pub token: *const c_char,
    /// Path of the identity file, as in DcdClientDef.
    pub identity_path: *const c_char,
    /// Address at which other nodes reach this one, such as "192.0.2.7:7421", or null: any free port of the interface towards the
    /// server.
    pub listen: *const c_char,
    /// User data of the world; dcd_world_info gives it back.
    pub user_data: u64,
    /// Number of threads that compute the node's share of the world, 1 to 1024; 0: one per core.
    pub threads: u32,
    /// Time that the server may be out of reach later on before the node gives up, milliseconds; 0: the node waits without end, and
    /// computes on.
    pub give_up_ms: u32,
    /// Path of a file to record to, for `dcd replay`, or null, as in DcdServerDef. The recording holds all that the node is given,
    /// and a digest of each region after each tick.
    pub record_path: *const c_char,
    /// Address at which the node answers with its metrics, or null, as in DcdServerDef.
    pub metrics: *const c_char,
    /// Address to give to other nodes and clients, where it is not the one listened at, as behind a NAT; or null.
    pub advertise: *const c_char,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdGroupDef {
    const NAME: &'static str = "DcdGroupDef";
}
// SAFETY: begins with `struct_size`; every other member is a number or a raw pointer.
unsafe impl Sized32 for DcdServerDef {
    const NAME: &'static str = "DcdServerDef";
}
// SAFETY: as above.
unsafe impl Sized32 for DcdNodeDef {
    const NAME: &'static str = "DcdNodeDef";
}

/// Creates a server, which holds a world, decides which node computes what, and lets clients in. It computes nothing itself: the
/// world begins with the nodes that join it (dcd_node_join, dcd_participant_join, or `dcd node` on other machines).
///
/// The server works on threads of the library, whether or not the program calls dcd_step. dcd_step says whether all is well, and
/// takes in what came for the program.
/// - Changing the world. The program may make, move and destroy bodies by the handle, and tie new ones (dcd_bodies_create,
///   dcd_joint_create). What it did since the last dcd_step is sent with the next, is on record before anybody hears of it, and is
///   computed alike by all nodes.
/// - Reading bodies. Bodies are read from the record: as nodes last told, at most half a second ago. To see them move, join the
///   world, also from the same process.
/// - Queries. The nodes answer what is submitted (dcd_cast_rays_submit and the like), after what the program did before.
/// - Events. dcd_events reports connections, messages, and the contacts of all bodies that ask for them, but for some while nodes
///   join or leave.
/// - Ending. dcd_world_destroy ends the world for all, and so does `dcd end`. After dcd_server_suspend, or when the process ends
///   without dcd_world_destroy, a server that is made in the same way goes on with the world.
/// - Folder. It keeps the server's keys (authority.pem), the list of used tokens (joins.log), locks, and the world (world.redb).
///
/// `def` and what it points to are read during the call.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STRUCT.
/// - DCD_ERR_ARGUMENT: a member out of range, an unknown scene, or a stored world that is another one.
/// - DCD_ERR_IO: the scene's file or the folder, also while another server uses the folder.
/// - DCD_ERR_NETWORK: an address cannot be listened at.
/// - DCD_ERR_LIMIT: no threads.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_server_create(def: *const DcdServerDef, out: *mut DcdWorld) -> DcdStatus {
    guard("dcd_server_create", || {
        // SAFETY: the caller vouches for all pointers and texts.
        let (def, out, opened, groups, listen, data, metrics, directory, record) = unsafe {
            let def = pointer::read_sized(def, "def")?;
            let opened = if def.source.v == 0 {
                if def.scene.is_null() {
                    let message =
                        "scene and source are both null; name a scene, or give a local world as source";
                    return Err(Failure::new(DCD_ERR_NULL, message));
                }
                Some(world::open(def.scene, def.params, def.param_count, def.world)?)
            } else if def.scene.is_null() && def.params.is_null() && def.world.is_null() {
                None
            } else {
                return Err(Failure::argument(
                    "a source says all of the world; give no scene, params or world with it",
                ));
            };
            let groups = if def.groups.is_null() {
                GroupConfig::default()
            } else {
                groups(&pointer::read_sized(def.groups, "def->groups")?)?
            };
            let listen = pointer::address(pointer::text(def.listen, "listen")?, "listen")?;
            let data = pointer::text(def.data_path, "data_path")?;
            let metrics = pointer::optional_address(def.metrics, "metrics")?;
            let directory = pointer::optional(def.directory, "directory")?.map(str::to_owned);
            let record = pointer::optional(def.record_path, "record_path")?.map(PathBuf::from);
            (def, Out::new(out, "out")?, opened, groups, listen, data, metrics, directory, record)
        };
        if !(1..=1024).contains(&def.nodes) {
            return Err(Failure::argument(format!("nodes is {}; give 1 to 1024", def.nodes)));
        }
        if !(0.0..=1.0).contains(&def.verify) {
            return Err(Failure::argument(format!("verify is {}; give a share from 0 to 1", def.verify)));
        }
        if !(1..=MAX_STATE_TICKS).contains(&def.state_every) {
            let every = def.state_every;
            return Err(Failure::argument(format!(
                "state_every is {every}; give 1 to {MAX_STATE_TICKS} steps"
            )));
        }
        if !(def.avatar_speed > 0.0 && def.avatar_speed <= 1e5) {
            let speed = def.avatar_speed;
            return Err(Failure::argument(format!(
                "avatar_speed is {speed}; give metres per second up to 100000"
            )));
        }
        let expiry = def.avatar_expiry;
        if !(expiry > 0.0 && expiry <= A_YEAR) {
            return Err(Failure::argument(format!("avatar_expiry is {expiry}; give seconds up to {A_YEAR}")));
        }
        pointer::check_reserved(def.reserved)?;
        if def.flags & !(DCD_SERVER_FRESH | DCD_SERVER_UNPACED) != 0 {
            let flags = def.flags;
            return Err(Failure::argument(format!("flags is {flags:#x}; give bits DCD_SERVER_...")));
        }
        let config = ServeConfig {
            listen,
            data: data.into(),
            fresh: def.flags & DCD_SERVER_FRESH != 0,
            nodes: def.nodes as usize,
            pace: if def.flags & DCD_SERVER_UNPACED != 0 { Pace::Unpaced } else { Pace::RealTime },
            last_tick: (def.last_tick > 0).then_some(Tick(def.last_tick)),
            avatar_speed_limit: def.avatar_speed,
            avatar_expiry: Duration::from_secs_f32(expiry),
            state_every: def.state_every,
            verify: def.verify.into(),
            groups,
            metrics,
            directory,
            record,
            ..ServeConfig::new("")
        };
        let server = match opened {
            Some(Opened { scene, config: world, .. }) => Dcd::serve(&scene, &world, config)?,
            None => {
                // The source is copied first, so that other calls use it while the server stands by.
                let serve = with(def.source, |source| Ok(source.dcd.copy_to_serve()?))?;
                serve(config)?
            }
        };
        out.write(registry::add(server, def.user_data));
        Ok(())
    })
}

/// Stops a server without ending its world. What is known of the world is written to the data folder. Nodes compute on. All
/// processes dial a server that is made in the same way: nodes and participants without end, clients for half a minute
/// (give_up_ms). From here on dcd_step fails with DCD_ERR_NETWORK; dcd_world_destroy frees the handle.
///
/// Errors: DCD_ERR_STALE_ID, DCD_ERR_UNSUPPORTED (the world is not a server).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_server_suspend(world: DcdWorld) -> DcdStatus {
    guard("dcd_server_suspend", || with(world, |world| Ok(world.dcd.suspend()?)))
}

/// Mints a token that lets one process join this server as `role`: DCD_ROLE_CLIENT, DCD_ROLE_BUILDER, DCD_ROLE_PARTICIPANT or
/// DCD_ROLE_NODE. A builder joins by dcd_client_connect, and may change what is the world's own. The token can be used once, within
/// `valid_seconds` (1 to 31,536,000).
///
/// Writes the token to `buf` of `cap` bytes with a NUL, and its size with NUL to `needed`. With `cap` 0, `buf` may be null, to ask
/// for the size: 512 bytes are always enough, and asking mints none.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER.
/// - DCD_ERR_ARGUMENT: another role or time.
/// - DCD_ERR_IO: the server's folder.
/// - DCD_ERR_UNSUPPORTED: the world is not a server.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_token_create(
    world: DcdWorld,
    role: DcdRole,
    valid_seconds: u32,
    buf: *mut c_char,
    cap: usize,
    needed: *mut usize,
) -> DcdStatus {
    guard("dcd_token_create", || {
        // SAFETY: the caller vouches for `cap` bytes and for `needed`.
        let room = unsafe { Room::new(buf, cap, needed, ["buf", "needed"])? };
        let role = match role {
            DCD_ROLE_CLIENT => JoinRole::Client,
            DCD_ROLE_PARTICIPANT => JoinRole::Participant,
            DCD_ROLE_NODE => JoinRole::Node,
            DCD_ROLE_BUILDER => JoinRole::Builder,
            role => {
                let roles = "DCD_ROLE_CLIENT, DCD_ROLE_BUILDER, DCD_ROLE_PARTICIPANT or DCD_ROLE_NODE";
                return Err(Failure::argument(format!("role is {role}; give {roles}")));
            }
        };
        if !(1..=31_536_000).contains(&valid_seconds) {
            return Err(Failure::argument(format!("valid_seconds is {valid_seconds}; give 1 to 31536000")));
        }
        with(world, |world| {
            world.dcd.mints_tokens()?;
            if cap < TOKEN_ROOM {
                return room.fill(std::iter::repeat_n(0, TOKEN_ROOM));
            }
            let token = world.dcd.token(role, Duration::from_secs(valid_seconds.into()))?;
            fill_text(room, &token)
        })
    })
}

/// Writes the address at which a server or a node listens, such as "127.0.0.1:7420", to `buf` of `cap` bytes with a NUL, and its
/// size with NUL to `needed`. With `cap` 0, `buf` may be null, to ask for the size.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`needed` is written all the same, `buf` is not),
/// DCD_ERR_UNSUPPORTED (a world of another role).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_address(
    world: DcdWorld,
    buf: *mut c_char,
    cap: usize,
    needed: *mut usize,
) -> DcdStatus {
    guard("dcd_address", || {
        // SAFETY: the caller vouches for `cap` bytes and for `needed`.
        let room = unsafe { Room::new(buf, cap, needed, ["buf", "needed"])? };
        ask(world, |world| fill_text(room, &world.dcd.address()?.to_string()))
    })
}

/// Writes the address at which a server, a node or a participant answers with its metrics, such as "127.0.0.1:9420", to `buf` of
/// `cap` bytes with a NUL, and its size with NUL to `needed`. With `cap` 0, `buf` may be null, to ask for the size.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_SMALL_BUFFER (`needed` is written all the same, `buf` is not),
/// DCD_ERR_UNSUPPORTED (`metrics` of the world's definition was null).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_metrics_address(
    world: DcdWorld,
    buf: *mut c_char,
    cap: usize,
    needed: *mut usize,
) -> DcdStatus {
    guard("dcd_metrics_address", || {
        // SAFETY: the caller vouches for `cap` bytes and for `needed`.
        let room = unsafe { Room::new(buf, cap, needed, ["buf", "needed"])? };
        ask(world, |world| {
            let message = "this world answers nowhere with metrics; give `metrics` in the definition of the server, node or participant";
            let found = world.dcd.metrics_address();
            fill_text(room, &found.ok_or_else(|| Failure::new(DCD_ERR_UNSUPPORTED, message))?.to_string())
        })
    })
}

/// Joins a world as a node: this process computes a share of the world. The call returns once the server has let the node in. The
/// share comes when the server gives it one.
///
/// The node works on threads of the library, whether or not the program calls dcd_step, which does what it does for a server. While
/// the server is out of reach the node computes on, and waits for it without end (DcdNodeDef.give_up_ms).
///
/// The handle serves dcd_step, dcd_poll, dcd_events, dcd_stats, connections and messages as a server's does. It has no bodies, no
/// tokens and no dcd_disconnect: to see the world too, use dcd_participant_join. dcd_world_destroy first hands the share to other
/// nodes, which may take some seconds.
/// Errors: as dcd_participant_join, and DCD_ERR_ARGUMENT (a malformed `listen` or `advertise`).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_node_join(def: *const DcdNodeDef, out: *mut DcdWorld) -> DcdStatus {
    guard("dcd_node_join", || {
        // SAFETY: the caller vouches for both pointers and for the texts.
        let (entry, (listen, advertise), threads, out) = unsafe {
            let def = pointer::read_sized(def, "def")?;
            let entry = Entry::read(def.server, def.token, def.identity_path, def.timeout_ms, def.user_data)?;
            let entry = entry.patient(def.give_up_ms);
            let listen = pointer::optional_address(def.listen, "listen")?;
            let advertise = pointer::optional_address(def.advertise, "advertise")?;
            let entry = entry.recorded(def.record_path)?.measured(def.metrics)?;
            (entry, (listen, advertise), def.threads, Out::new(out, "out")?)
        };
        let threads = world::asked_threads(threads)?;
        entry.enter(threads, out, |config| {
            Dcd::join_as_node(&JoinConfig { listen, advertise, ..config.clone() })
        })
    })
}

/// One year, seconds.
const A_YEAR: f32 = 31_536_000.0;

/// Room for any token, NUL included.
const TOKEN_ROOM: usize = 512;

fn fill_text(room: Room<c_char>, text: &str) -> Result<(), Failure> {
    let bytes: Vec<_> = text.bytes().chain([0]).map(|byte| byte as c_char).collect();
    room.fill(bytes.into_iter())
}

fn groups(def: &DcdGroupDef) -> Result<GroupConfig, Failure> {
    let wrong = |name: &str, value: f32, range: &str| {
        Err(Failure::argument(format!("groups->{name} is {value}; give {range}")))
    };
    if u64::from(def.lag_ticks) > MAX_LAG as u64 {
        return wrong("lag_ticks", def.lag_ticks as f32, "0 to 60");
    }
    if !(def.agree > 0.0 && def.agree <= 1e6) {
        return wrong("agree", def.agree, "metres above 0");
    }
    if !(1..=1024).contains(&def.size) {
        return wrong("size", def.size as f32, "1 to 1024 nodes");
    }
    let delay = match (def.near_ms, def.far_ms) {
        (0.0, 0.0) => None,
        (near, far) if near > 0.0 && near < far && far <= 1e6 => {
            Some(DelayThresholds { inclusion_ms: near, rejection_ms: far, deviation_ms: far - near })
        }
        (_, far) => {
            return wrong("far_ms", far, "milliseconds above near_ms, which is above 0, or 0 for both");
        }
    };
    Ok(GroupConfig {
        lag_ticks: def.lag_ticks,
        thresholds: Thresholds { delay, between_groups_m: def.agree, ..Thresholds::default() },
        grouping: Grouping { max_size: def.size as usize, ..Grouping::default() },
    })
}
