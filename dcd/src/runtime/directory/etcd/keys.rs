//! Reads and writes the keys of one world in etcd. Writes of the world's holder are fenced by the holder's
//! own key.

use std::time::{Duration, Instant};

use super::address::EtcdAddress;
use super::gateway::{Compare, Found, Gateway, GatewayError, Op};
use crate::cluster::directory::DirectoryError;

/// How long etcd is asked again while it does not answer: an election of etcd takes one or two seconds.
const TRY: Duration = Duration::from_secs(10);
/// The pause between two such attempts.
const AGAIN: Duration = Duration::from_millis(20);
/// The most bytes of a value: a transaction stays below the 1.5 MiB that etcd allows.
pub(super) const VALUE_BYTES: usize = 512 << 10;

/// The keys of one world.
#[derive(Clone, Debug)]
pub(super) struct Keys {
    pub(super) gateway: Gateway,
    address: EtcdAddress,
}

/// The keys of one world, for the server that holds it. Clones write for the same holder.
#[derive(Clone, Debug)]
pub(super) struct Hold {
    keys: Keys,
    /// The name of the holder, unlike all others.
    holder: String,
    /// The revision of etcd at which the holder's key was created.
    created: i64,
}

impl Keys {
    pub(super) fn new(address: EtcdAddress) -> Result<Self, DirectoryError> {
        Ok(Self { gateway: Gateway::new(&address)?, address })
    }

    /// Returns where the world is, for people to read.
    pub(super) fn place(&self) -> String {
        self.address.to_string()
    }

    /// Returns the full key of this name.
    pub(super) fn key(&self, name: &str) -> Vec<u8> {
        format!("dcd/{}/{name}", self.address.name).into_bytes()
    }

    /// Returns the key that the holder renews by writing it.
    pub(super) fn holder(&self) -> Vec<u8> {
        self.key("holder")
    }

    pub(super) fn read(&mut self, name: &str) -> Result<Option<Vec<u8>>, DirectoryError> {
        let key = self.key(name);
        let found = patiently(|| self.gateway.read(&key)).map_err(|error| self.unreadable(&error))?;
        Ok(found.map(|found| found.value))
    }

    /// Returns the keys and values of all names from the first on, before the second, in order.
    pub(super) fn read_range(&mut self, from: &str, to: &str) -> Result<Vec<Found>, DirectoryError> {
        let (mut from, to, mut all) = (self.key(from), self.key(to), Vec::<Found>::new());
        loop {
            let page =
                patiently(|| self.gateway.read_page(&from, &to)).map_err(|error| self.unreadable(&error))?;
            all.extend(page.found);
            match all.last() {
                Some(last) if page.more => from = [&last.key[..], &[0]].concat(),
                _ => return Ok(all),
            }
        }
    }

    /// Writes a value unless there is one, and returns the value that is there then. Asks only once, so that
    /// a wrong address is reported at once.
    pub(super) fn read_or_create(&mut self, name: &str, value: &[u8]) -> Result<Vec<u8>, DirectoryError> {
        let key = self.key(name);
        let create = Op::Put(key.clone(), value.to_vec());
        let created = self.gateway.transact(&[Compare::Created(key.clone(), 0)], &[create]);
        let found = created.and_then(|_| self.gateway.read(&key)).map_err(|error| self.unreadable(&error))?;
        Ok(found.map(|found| found.value).unwrap_or_default())
    }

    pub(super) fn unreadable(&self, error: &GatewayError) -> DirectoryError {
        let (place, cause) = (self.place(), error.to_string());
        match error {
            GatewayError::Away(_) => DirectoryError::Unreachable { place, cause },
            GatewayError::Full(_) => DirectoryError::Unwritable { place, cause },
            GatewayError::Refused(_) | GatewayError::Unknown(_) => {
                DirectoryError::Unreadable { place, cause }
            }
        }
    }
}

impl Hold {
    pub(super) fn new(keys: Keys, holder: String, created: i64) -> Self {
        Self { keys, holder, created }
    }

    /// Returns a clone for reading or writing much.
    pub(super) fn for_bulk(&self) -> Self {
        let mut hold = self.clone();
        hold.keys.gateway = hold.keys.gateway.for_bulk();
        hold
    }

    /// Returns where the world is, for people to read.
    pub(super) fn place(&self) -> String {
        self.keys.place()
    }

    pub(super) fn keys(&mut self) -> &mut Keys {
        &mut self.keys
    }

    /// Does all writes at once, unless another server holds the world by now. They must fit into one
    /// transaction of etcd, and be right when they are done late, or twice.
    pub(super) fn write(&mut self, ops: &[Op]) -> Result<(), DirectoryError> {
        match self.transact(None, ops)? {
            true => Ok(()),
            false => Err(DirectoryError::Deposed { place: self.keys.place() }),
        }
    }

    /// Does the same only if a key has this value; returns whether it had. `false` may also mean that etcd
    /// has done the writes already, and did not answer in time.
    pub(super) fn write_if(
        &mut self,
        name: &str,
        value: Option<&[u8]>,
        ops: &[Op],
    ) -> Result<bool, DirectoryError> {
        let is = Compare::Is(self.keys.key(name), value.map(<[u8]>::to_vec));
        if self.transact(Some(is), ops)? {
            return Ok(true);
        }
        self.renew()?;
        Ok(false)
    }

    fn transact(&mut self, condition: Option<Compare>, ops: &[Op]) -> Result<bool, DirectoryError> {
        let fence = Compare::Created(self.keys.holder(), self.created);
        let conditions: Vec<_> = std::iter::once(fence).chain(condition).collect();
        patiently(|| self.keys.gateway.transact(&conditions, ops)).map_err(|error| {
            DirectoryError::Unwritable { place: self.keys.place(), cause: error.to_string() }
        })
    }

    /// Renews the hold: shows that the holder lives.
    pub(super) fn renew(&mut self) -> Result<(), DirectoryError> {
        let sign = Op::Put(self.keys.holder(), self.holder.clone().into_bytes());
        self.write(&[sign])
    }

    /// Releases the hold, so that others need not wait. Asks only once: if that fails, others soon notice the
    /// silence.
    pub(super) fn release(&mut self) {
        let key = self.keys.holder();
        let fence = Compare::Created(key.clone(), self.created);
        let _ = self.keys.gateway.transact(&[fence], &[Op::delete(&key)]);
    }
}

/// Asks until etcd answers, for some seconds. The request must do the same when it is done twice.
fn patiently<T>(mut ask: impl FnMut() -> Result<T, GatewayError>) -> Result<T, GatewayError> {
    let deadline = Instant::now() + TRY;
    loop {
        match ask() {
            Err(GatewayError::Away(_)) if Instant::now() < deadline => std::thread::sleep(AGAIN),
            answer => return answer,
        }
    }
}
