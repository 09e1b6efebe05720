//! Looks at a world in etcd while another server holds it.

use std::time::{Duration, Instant};

use super::keys::Keys;
use super::{EtcdWorld, Head, segment, segment_name};
use crate::cluster::directory::Key;

/// The time between two looks at a world that is not stored yet.
const EVERY: Duration = Duration::from_secs(5);
/// How many segments are looked through, from the newest on. Nearly each has the world's entry.
const SEGMENTS: usize = 8;

/// A look at a world that another server may hold. What cannot be read, as while the holder begins the log
/// anew, is looked at later.
pub(in crate::runtime::directory) struct Glance {
    keys: Keys,
    looked: Option<Instant>,
}

impl Glance {
    pub(in crate::runtime::directory) fn at(world: &EtcdWorld) -> Self {
        let mut keys = world.keys.clone();
        keys.gateway = keys.gateway.for_bulk();
        Self { keys, looked: None }
    }

    /// Returns the world's entry as it was stored last; `None` if there is none, if it cannot be read, or if
    /// this was asked a moment ago.
    pub(in crate::runtime::directory) fn world(&mut self) -> Option<Vec<u8>> {
        if self.looked.is_some_and(|looked| looked.elapsed() < EVERY) {
            return None;
        }
        self.looked = Some(Instant::now());
        let head = self.keys.key("head");
        let head = self.keys.gateway.read(&head).ok()??;
        let Head { first, next, .. } = Head::decode(&head.value, "").ok()?;
        for number in (first..next).rev().take(SEGMENTS) {
            let segment = self.segment(number)?;
            let mut records = segment::decode(&segment)?.into_iter().rev();
            if let Some((.., world)) = records.find(|(key, ..)| *key == Key::World) {
                return world.map(<[u8]>::to_vec);
            }
        }
        None
    }

    fn segment(&mut self, number: u64) -> Option<Vec<u8>> {
        let [from, to] = [number, number + 1].map(|number| self.keys.key(&segment_name(number)));
        let page = self.keys.gateway.read_page(&from, &to).ok()?;
        Some(page.found.into_iter().flat_map(|part| part.value).collect())
    }
}
