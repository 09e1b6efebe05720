//! Saves worlds as bytes or files, and restores them.

use std::ffi::{c_char, c_void};
use std::io::Read;
use std::path::Path;

use dcd::Role;
use dcd::runtime::{LocalWorld, SnapshotError};

use crate::guard::guard;
use crate::ids::DcdWorld;
use crate::pointer::{self, Room};
use crate::registry::with;
use crate::status::{DcdStatus, Failure};

/// Saves a snapshot of a world: bodies, joints, contacts, regions, settings. A local world goes on from there to the same bits, in
/// this program or another one of the same build. Handles of shapes, views, and the user_data of the world are not part of it.
///
/// A server saves the world as it is after one tick, for which its nodes stop for some ticks. The snapshot is that of a local
/// world, avatars too, without contacts. What the server's program did since its last dcd_step is not in it. The call waits for
/// half a minute at most.
///
/// Writes the bytes to `buf` of `cap` bytes, and their number to `needed`. With `cap` 0, `buf` may be null, to ask for the number,
/// which costs as much as saving. While nothing changes the number stays the same. A served world changes: save it to a file.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_SMALL_BUFFER: `needed` is written all the same, `buf` is not.
/// - DCD_ERR_TIMEOUT: nodes do not answer their server.
/// - DCD_ERR_UNSUPPORTED: a client, participant or node.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_snapshot_save(
    world: DcdWorld,
    buf: *mut c_void,
    cap: usize,
    needed: *mut usize,
) -> DcdStatus {
    guard("dcd_snapshot_save", || {
        // SAFETY: the caller vouches for `cap` bytes and for `needed`.
        let out = unsafe { Room::new(buf.cast::<u8>(), cap, needed, ["buf", "needed"])? };
        with(world, |world| {
            let mut bytes = Vec::new();
            world.dcd.save(&mut bytes)?;
            out.fill(bytes.into_iter())
        })
    })
}

/// Saves a world to a file, as dcd_snapshot_save does. `dcd run` goes on with such a file, and writes them by --save. A file that
/// is there is replaced once the new one is whole. A symbolic link stays, and the file that it leads to is replaced. Devices, pipes
/// and folders are refused.
///
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_IO.
/// - DCD_ERR_TIMEOUT: nodes do not answer their server.
/// - DCD_ERR_UNSUPPORTED: a client, participant or node.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_snapshot_save_file(world: DcdWorld, path: *const c_char) -> DcdStatus {
    guard("dcd_snapshot_save_file", || {
        // SAFETY: the caller vouches for the text.
        let path = unsafe { pointer::text(path, "path")? };
        with(world, |world| world.dcd.save_file(path).map_err(|error| Failure::from(error).of_file(path)))
    })
}

/// Restores a snapshot of `size` bytes into a world: into the one that it was saved from, to go back, or into any other, which
/// loses what it held. Threads and shapes stay those of this world. All else is as saved, gravity and regions too.
///
/// - Ids. Ids of bodies and joints that this world gave are valid if the saved world has them, else stale. If
///   the snapshot is of another world, other bodies may have them: then forget all ids. dcd_body_at finds bodies by number.
/// - Later ids. Ids that are given later are new. Where something was made since the save, what is made now gets other ids than it
///   got then. A world of several regions then goes on to other bits, since how contacts are found again at a border depends on ids.
///   To go back and on to the same bits whatever was made, use dcd_checkpoint_create.
/// - Views. dcd_state_view and dcd_events are as after the last step before saving, except for the user_data of bodies that were
///   destroyed, which is 0.
/// - Server. Its world goes on with the bodies and joints of the snapshot, for all nodes and clients. Its ticks and regions go on,
///   and tick length and gravity must be the same. What its program did since its last dcd_step is dropped. Avatars are their
///   clients': those that are in both go where they were, and none comes or goes.
///
/// `data` is read during the call. After an error the world is as it was. Damage is found; malice is not: load nothing that is not
/// trusted.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_ARGUMENT: bytes that are no snapshot, or damaged.
/// - DCD_ERR_VERSION: a snapshot of another build of the library.
/// - DCD_ERR_UNSUPPORTED: a client, participant or node.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_snapshot_load(world: DcdWorld, data: *const c_void, size: usize) -> DcdStatus {
    guard("dcd_snapshot_load", || {
        pointer::check(data.cast::<u8>(), "data")?;
        if size > isize::MAX as usize {
            return Err(Failure::argument(format!("size is {size}, which is more than memory holds")));
        }
        // SAFETY: not null, of a size that can be; the caller vouches for the bytes.
        let data = unsafe { std::slice::from_raw_parts(data.cast::<u8>(), size) };
        load(world, || Ok(data))
    })
}

/// Restores a snapshot from a file into a world, as dcd_snapshot_load does.
///
/// Errors: as dcd_snapshot_load, and DCD_ERR_IO (the file cannot be read).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_snapshot_load_file(world: DcdWorld, path: *const c_char) -> DcdStatus {
    guard("dcd_snapshot_load_file", || {
        // SAFETY: the caller vouches for the text.
        let path = unsafe { pointer::text(path, "path")? };
        load(world, || LocalWorld::open_snapshot(Path::new(path))).map_err(|failure| failure.of_file(path))
    })
}

fn load<R: Read>(world: DcdWorld, open: impl FnOnce() -> Result<R, SnapshotError>) -> Result<(), Failure> {
    with(world, |world| {
        world.dcd.can_be_saved()?;
        world.dcd.reload(open()?)?;
        match world.dcd.role() {
            Role::Local => {
                world.events.forget();
                world.show();
            }
            // A server has already reported what it heard with its last step.
            _ => world.show_states(),
        }
        Ok(())
    })
}
