//! Opens the directory in which a server keeps its world, and the authority of that world: in the data
//! folder, or in etcd, where standby servers find them too.

#[cfg(feature = "etcd")]
mod etcd;
mod lock;
mod redb;

use std::path::Path;
use std::sync::Arc;

use super::{ProcessError, ServeConfig, WorldError};
use crate::cluster::directory::Directory;
#[cfg(feature = "etcd")]
use crate::cluster::directory::DirectoryError;
use crate::net::Authority;

pub(super) use self::lock::FolderLock;
pub(crate) use self::lock::{is_served, is_there};
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
/// world. Returns `None` if `goes_on` ended the wait.
pub(super) fn open(config: &ServeConfig, goes_on: GoesOn<'_>) -> Result<Option<Opened>, ProcessError> {
    match &config.directory {
        None => in_folder(&config.data, config.fresh).map(Some),
        Some(address) => in_etcd(address, config, goes_on),
    }
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
fn in_etcd(address: &str, config: &ServeConfig, goes_on: GoesOn<'_>) -> Result<Option<Opened>, ProcessError> {
    // From here on the address is without its options, since people read it.
    let (options, address) = (address, etcd::EtcdAddress::shown(address));
    let options = etcd::EtcdAddress::parse(options).map_err(|range| malformed(address, range))?;
    let mut world = etcd::EtcdWorld::at(options)?;
    let authority =
        Authority::load_or_adopt(&config.data, |own| world.authority(own).map_err(ProcessError::from))?;
    let authority = Arc::new(authority);
    // A name for people to read, different for each server.
    let number = u64::from_be_bytes(crate::net::random()?);
    let holder = format!("{} (process {}, {number:016x})", config.listen, std::process::id());
    let (mut stood_by, mut is_away, mut is_taken) = (false, false, false);
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
            goes_on(&format!("standing by for {other}"), true)
        }
        etcd::Wait::Away(why) => {
            if !std::mem::replace(&mut is_away, true) {
                tracing::warn!(
                    place = address,
                    holder = why,
                    "etcd does not answer as it should; asking again"
                );
            }
            goes_on(&format!("waiting for etcd: {why}"), false)
        }
    };
    let Some(directory) = world.open(&holder, config.fresh, &mut wait_on)? else {
        return match is_taken {
            true => Err(DirectoryError::Taken { place: address.to_owned() }.into()),
            false => Ok(None),
        };
    };
    if directory.is_cleared() {
        return Err(ProcessError::WorldEnded);
    }
    if stood_by {
        tracing::info!(place = address, "taking over");
    }
    let folder_lock = FolderLock::take(&config.data, &config.data)?;
    authority.record_in(Box::new(directory.journal()));
    authority.open_ledger()?;
    Ok(Some(Opened { directory: Box::new(directory), authority, folder_lock: Some(folder_lock) }))
}

#[cfg(feature = "etcd")]
fn malformed(address: &str, range: &'static str) -> ProcessError {
    WorldError::Setting { what: "directory", value: address.to_owned(), range }.into()
}

#[cfg(not(feature = "etcd"))]
fn in_etcd(address: &str, _: &ServeConfig, _: GoesOn<'_>) -> Result<Option<Opened>, ProcessError> {
    let range = "this dcd was built without the feature `etcd`: build it with that, as cargo install --features cli,etcd";
    // Drops what comes before an @, where somebody may have written a password, and the options.
    let place = address.rsplit('@').next().unwrap_or_default();
    let value = place.split('?').next().unwrap_or_default().to_owned();
    Err(WorldError::Setting { what: "directory", value, range }.into())
}
