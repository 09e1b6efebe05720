//! Opens the directory in which a server keeps its world, and the authority of that world: in the data
//! folder, or in etcd, where standby servers find them too.

#[cfg(feature = "etcd")]
mod etcd;
mod lock;
mod redb;

use std::path::Path;
use std::sync::Arc;

use super::{ProcessError, ServeConfig, WorldError};
use crate::cluster::difference;
#[cfg(feature = "etcd")]
use crate::cluster::directory::DirectoryError;
use crate::cluster::directory::{Directory, Entry, Key};
use crate::net::Authority;
use crate::protocol::EnvironmentProperties;

pub(super) use self::lock::FolderLock;
pub(crate) use self::lock::{is_elsewhere, is_served, is_standby, is_there};
pub use self::redb::RedbDirectory;

/// What a server holds while it serves a world.
pub(super) struct Opened {
    pub(super) directory: Box<dyn Directory>,
    pub(super) authority: Arc<Authority>,
    /// The lock of the data folder, if the world is stored elsewhere.
    pub(super) folder_lock: Option<FolderLock>,
}

/// Decides whether to keep waiting, from the reason in words, and from whether the server is a standby.
pub(crate) type GoesOn<'a> = &'a mut dyn FnMut(&str, bool) -> bool;

/// Opens the directory that the configuration names. In etcd this waits until no other server holds the
/// world. Returns `None` if `goes_on` ended the wait. `served` is the world that is to be served.
pub(super) fn open(
    config: &ServeConfig,
    served: &EnvironmentProperties,
    goes_on: GoesOn<'_>,
) -> Result<Option<Opened>, ProcessError> {
    match &config.directory {
        None => in_folder(&config.data, config.fresh).map(Some),
        Some(address) => in_etcd(address, config, served, goes_on),
    }
}

/// Checks that the stored world, if there is one, is the one that is to be served.
pub(super) fn check_same(
    entries: &[Entry],
    served: &EnvironmentProperties,
    config: &ServeConfig,
) -> Result<(), ProcessError> {
    let stored = entries.iter().find(|entry| entry.key == Key::World);
    match stored.and_then(|world| difference(&world.value, served)) {
        None => Ok(()),
        Some(parts) => Err(other_world(&parts, config.directory.is_some())),
    }
}

/// Returns the error of a server whose world differs from the stored one in these parts.
fn other_world(parts: &str, is_in_etcd: bool) -> ProcessError {
    let what = if is_in_etcd { "the world of this name in etcd" } else { "what the data folder holds" };
    let range = match is_in_etcd {
        true => {
            "serve the same scene with the same options as its other servers, end it (`dcd end` beside the server that serves it), or give this \
             world another name (--directory)"
        }
        false => {
            "serve the same scene with the same options to go on with it, end it (`dcd end`), forget it (--fresh), or choose another folder \
             (--data)"
        }
    };
    let value = format!("another world that has not ended (it differs in {parts})");
    WorldError::Setting { what, value, range }.into()
}

fn in_folder(folder: &Path, fresh: bool) -> Result<Opened, ProcessError> {
    let authority = Arc::new(Authority::load_or_create(folder)?);
    authority.open_ledger()?;
    let directory = match fresh {
        true => RedbDirectory::open_or_replace(folder)?,
        false => RedbDirectory::open(folder)?,
    };
    Ok(Opened { directory: Box::new(directory), authority, folder_lock: None })
}

#[cfg(feature = "etcd")]
fn in_etcd(
    address: &str,
    config: &ServeConfig,
    served: &EnvironmentProperties,
    goes_on: GoesOn<'_>,
) -> Result<Option<Opened>, ProcessError> {
    // From here on the address is without its options, since people read it.
    let (options, address) = (address, etcd::EtcdAddress::shown(address));
    let options = etcd::EtcdAddress::parse(options).map_err(|range| malformed(address, range))?;
    let mut world = etcd::EtcdWorld::at(options)?;
    let authority =
        Authority::load_or_adopt(&config.data, |own| world.authority(own).map_err(ProcessError::from))?;
    let authority = Arc::new(authority);
    let standby = lock::show_standby(&config.data)?;
    // A name for people to read, different for each server.
    let number = u64::from_be_bytes(crate::net::random()?);
    let machine = host_name().map(|name| format!(" on {name}")).unwrap_or_default();
    let holder = format!("{}{machine} (process {}, {number:016x})", config.listen, std::process::id());
    let (mut stood_by, mut is_away, mut is_taken) = (false, false, false);
    let mut stored = Some(etcd::Glance::at(&world));
    let mut unlike = None;
    let mut wait_on = |wait: etcd::Wait| match wait {
        etcd::Wait::Held(_) if config.fresh => {
            is_taken = true;
            false
        }
        etcd::Wait::Held(other) => {
            if !std::mem::replace(&mut stood_by, true) {
                tracing::info!(
                    place = address,
                    holder = other,
                    "standing by: another server holds the world"
                );
            }
            // Once the world is known to be the same, it stays so while it is held.
            if let Some(value) = stored.as_mut().and_then(etcd::Glance::world) {
                stored = None;
                unlike = difference(&value, served);
            }
            unlike.is_none() && goes_on(&format!("standing by for {other}"), true)
        }
        etcd::Wait::Away(why) => {
            if !std::mem::replace(&mut is_away, true) {
                tracing::warn!(
                    place = address,
                    reason = why,
                    "etcd does not answer as it should; asking again"
                );
            }
            goes_on(&format!("waiting for etcd: {why}"), false)
        }
    };
    let Some(directory) = world.open(&holder, config.fresh, &mut wait_on)? else {
        return match unlike {
            _ if is_taken => Err(DirectoryError::Taken { place: address.to_owned() }.into()),
            Some(parts) => Err(other_world(&parts, true)),
            None => Ok(None),
        };
    };
    if directory.is_cleared() {
        return Err(ProcessError::WorldEnded);
    }
    if stood_by {
        tracing::info!(place = address, "taking over");
    }
    let folder_lock = FolderLock::take(&config.data, &config.data)?;
    folder_lock.note(true).map_err(|error| DirectoryError::Unwritable {
        place: config.data.display().to_string(),
        cause: error.to_string(),
    })?;
    drop(standby);
    authority.record_in(Box::new(directory.journal()));
    authority.open_ledger()?;
    Ok(Some(Opened { directory: Box::new(directory), authority, folder_lock: Some(folder_lock) }))
}

/// Returns the name of this machine, if the system says it.
#[cfg(feature = "etcd")]
fn host_name() -> Option<String> {
    let of_linux = std::fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name = of_linux.or_else(|| std::env::var("HOSTNAME").or_else(|_| std::env::var("COMPUTERNAME")).ok());
    name.map(|name| name.trim().to_owned()).filter(|name| !name.is_empty())
}

#[cfg(feature = "etcd")]
fn malformed(address: &str, range: &'static str) -> ProcessError {
    WorldError::Setting { what: "directory", value: address.to_owned(), range }.into()
}

#[cfg(not(feature = "etcd"))]
fn in_etcd(
    address: &str,
    _: &ServeConfig,
    _: &EnvironmentProperties,
    _: GoesOn<'_>,
) -> Result<Option<Opened>, ProcessError> {
    let range = "this dcd was built without the feature `etcd`: build it with that, as cargo install --features cli,etcd";
    // Drops what comes before an @, where somebody may have written a password, and the options.
    let place = address.rsplit('@').next().unwrap_or_default();
    let value = place.split('?').next().unwrap_or_default().to_owned();
    Err(WorldError::Setting { what: "directory", value, range }.into())
}
