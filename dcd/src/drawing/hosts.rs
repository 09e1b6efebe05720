//! Implements `Source` for a cluster whose nodes this process computes, as a replay does. Each body is drawn
//! as its owner has it.

use std::collections::{BTreeMap, BTreeSet};

use super::host::{guests, seen};
use super::source::{BorderSeen, ContactSeen, Details, Extent, Ghost, RegionSeen, Seen, Source, Tie};
use crate::physics::{Region, RegionHost};
use crate::protocol::{BodyRecord, ShapeHash, ShapeRecord, WorldPose};
use crate::space::{BodyId, Bounds, JointId, NodeId, RegionId};

/// The regions of several nodes, or those of a local world, after the same tick. A body that two groups of
/// nodes own is drawn as the first node has it.
pub(crate) struct Hosts<'a> {
    tick: u64,
    hosts: Vec<Host<'a>>,
    regions: Vec<RegionSeen>,
}

/// The regions of one node.
struct Host<'a> {
    regions: &'a RegionHost,
    /// For each leaf of its tree, the index of the region in the list of all regions.
    places: Vec<u16>,
}

impl<'a> Hosts<'a> {
    /// Collects the regions of hosts; returns `None` if there is no host.
    pub(crate) fn of(
        tick: u64,
        hosts: impl IntoIterator<Item = (Option<NodeId>, &'a RegionHost)>,
    ) -> Option<Self> {
        let hosts: Vec<_> = hosts.into_iter().collect();
        let mut all = Vec::new();
        for (node, host) in &hosts {
            let here: BTreeSet<u32> = host.regions().map(|region| region.id().0).collect();
            let node = node.map(|node| node.0);
            let own = Source::regions(*host).into_iter().filter(|region| here.contains(&region.id));
            all.extend(own.map(|region| RegionSeen { node, ..region }));
        }
        // Adds the regions of nodes that are not here.
        let computed: BTreeSet<u32> = all.iter().map(|region| region.id).collect();
        let (_, first) = hosts.first()?;
        all.extend(Source::regions(*first).into_iter().filter(|region| !computed.contains(&region.id)));
        all.sort_by_key(|region| (region.id, region.node));
        let place = |node: Option<NodeId>, id: RegionId| {
            let of = |node: Option<u32>| all.iter().position(|one| (one.id, one.node) == (id.0, node));
            let of_another = || all.iter().position(|one| one.id == id.0);
            of(node.map(|node| node.0)).or_else(of_another).unwrap_or(0) as u16
        };
        let host = |(node, regions): (Option<NodeId>, &'a RegionHost)| {
            let leaves = regions.partition().tree().leaves();
            Host { regions, places: leaves.map(|id| place(node, id)).collect() }
        };
        let hosts = hosts.into_iter().map(host).collect();
        Some(Self { tick, hosts, regions: all })
    }

    /// Returns how long a tick is, in seconds.
    pub(crate) fn dt_s(&self) -> f32 {
        self.hosts.first().map_or(0.0, |host| host.regions.settings().dt_s)
    }

    /// Returns the host that owns a body, or else one that knows it.
    fn host_of(&self, id: BodyId) -> Option<&RegionHost> {
        let hosts = || self.hosts.iter().map(|host| host.regions);
        hosts()
            .find(|host| host.owned(id).is_some())
            .or_else(|| hosts().find(|host| host.record(id).is_some()))
    }

    /// Returns every ghost, with the index of the region that owns its body and whether another host has that
    /// region.
    fn copies(&self) -> Vec<(Ghost, u16, bool)> {
        let mut owners = BTreeMap::new();
        for (at, host) in self.hosts.iter().enumerate() {
            for (id, region, handle) in host.regions.owned_bodies() {
                let velocity = region.velocity(handle).linear;
                owners.entry(id).or_insert((at, host.place(region), velocity));
            }
        }
        let mut copies = Vec::new();
        for (at, host) in self.hosts.iter().enumerate() {
            for (id, region, handle) in host.regions.ghosts() {
                let Some(&(owner, place, own)) = owners.get(&id) else { continue };
                let here = region.velocity(handle).linear;
                let off2: f32 = (0..3).map(|i| (own[i] - here[i]).powi(2)).sum();
                let ghost = Ghost { id, holder: host.place(region), off_m_s: off2.sqrt() };
                copies.push((ghost, place, owner != at));
            }
        }
        copies
    }
}

impl Host<'_> {
    fn place(&self, region: &Region) -> u16 {
        self.places[region.rank()]
    }
}

impl Source for Hosts<'_> {
    fn tick(&self) -> u64 {
        self.tick
    }

    fn bounds(&self) -> Bounds {
        let bounds = self.hosts.first().map(|host| Source::bounds(host.regions));
        bounds.unwrap_or_else(|| Bounds::new([0.0; 3], [0.0; 3]))
    }

    fn for_each_movable(&self, mut look: impl FnMut(BodyId, Seen)) {
        let mut all = BTreeMap::new();
        for host in &self.hosts {
            for (id, region, handle) in host.regions.owned_bodies() {
                all.entry(id).or_insert_with(|| seen(region, handle, host.place(region).into()));
            }
        }
        for host in &self.hosts {
            for (id, guest) in guests(host.regions) {
                let owner = host.places[usize::from(guest.owner)];
                all.entry(id).or_insert(Seen { owner, ..guest });
            }
        }
        all.into_iter().for_each(|(id, seen)| look(id, seen));
    }

    fn for_each_fixed(&self, look: impl FnMut(BodyId, &WorldPose, u64)) {
        if let Some(host) = self.hosts.first() {
            host.regions.for_each_fixed(look);
        }
    }

    fn record(&self, id: BodyId) -> Option<BodyRecord> {
        self.host_of(id)?.record(id)
    }

    fn shape(&self, hash: ShapeHash) -> Option<ShapeRecord> {
        self.hosts.iter().find_map(|host| host.regions.shape(hash))
    }

    fn joints(&self) -> BTreeMap<JointId, Tie> {
        self.hosts.iter().flat_map(|host| Source::joints(host.regions)).collect()
    }

    fn regions(&self) -> Vec<RegionSeen> {
        self.regions.clone()
    }

    fn borders(&self) -> Vec<BorderSeen> {
        let mut borders = Vec::new();
        for host in &self.hosts {
            let inner = Source::borders(host.regions).into_iter();
            borders.extend(inner.map(|border| BorderSeen {
                between: border.between.map(|rank| host.places[usize::from(rank)]),
                ..border
            }));
        }
        // Between nodes: by how much the copies differ after the tick.
        let mut across: BTreeMap<[u16; 2], (usize, f32)> = BTreeMap::new();
        for (ghost, owner, _) in self.copies().into_iter().filter(|(.., across)| *across) {
            let between = [owner.min(ghost.holder), owner.max(ghost.holder)];
            let (bodies, off_m_s) = across.entry(between).or_default();
            (*bodies, *off_m_s) = (*bodies + 1, off_m_s.max(ghost.off_m_s));
        }
        borders.extend(across.into_iter().map(|(between, (bodies, disagreement_m_s))| BorderSeen {
            between,
            bodies,
            exchanges: 0,
            disagreement_m_s,
        }));
        borders
    }

    fn ghosts(&self) -> Vec<Ghost> {
        self.copies().into_iter().map(|(ghost, ..)| ghost).collect()
    }

    fn ghost_boxes(&self) -> Vec<(u16, Bounds)> {
        let of = |host: &Host<'_>| {
            let boxes = host.regions.ghost_boxes().into_iter();
            boxes.map(|(rank, bounds)| (host.places[usize::from(rank)], bounds)).collect::<Vec<_>>()
        };
        self.hosts.iter().flat_map(of).collect()
    }

    fn contacts(&self, most: usize) -> Vec<ContactSeen> {
        self.hosts.iter().flat_map(|host| host.regions.contacts(most)).take(most).collect()
    }

    fn extent(&self, id: BodyId) -> Option<Extent> {
        self.host_of(id)?.extent(id)
    }

    fn details(&self, id: BodyId) -> Option<Details> {
        self.host_of(id)?.details(id)
    }

    fn is_own(&self, _id: BodyId) -> bool {
        false
    }
}
