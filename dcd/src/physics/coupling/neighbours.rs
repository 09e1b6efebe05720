//! Chooses the regions with which a region exchanges messages in a tick: its neighbours, not all regions, so
//! that the cost of a tick grows with the borders and not with the world.
//!
//! Both sides of a pair must choose alike without asking, since each waits for what the other sends. So the
//! choice follows from what both know. Two regions are neighbours in a tick when
//!
//! - their cells are near each other,
//! - both hold a body, or one has told the other of bodies near it,
//! - a third region has told both that they may meet in its cell, or
//! - one of them asked for the other when they last met. All regions meet every [`MEET_EVERY`] ticks, after
//!   each change of the tree or of membership, and with each insertion. This is the lookahead of conservative
//!   simulation (Chandy and Misra 1979) with a fixed period.
//!
//! A body that is thrown so far between two meetings that it comes to a region that is no neighbour is sent
//! there at the next meeting.

use serde::{Deserialize, Serialize};

use crate::physics::outbox::Outbox;
use crate::physics::partition::Partition;
use crate::physics::rank_remap::RankRemap;
use crate::physics::region::{Ownership, Region};
use crate::space::{RegionSet, Tick};

/// All regions meet in ticks that are multiples of this.
pub(super) const MEET_EVERY: u64 = 8;

/// Returns whether all regions meet in a tick, whatever else happens.
pub(in crate::physics) fn meet_in(tick: Tick) -> bool {
    tick.0.is_multiple_of(MEET_EVERY)
}

/// Returns in how many ticks from this one all regions meet next.
pub(super) fn ticks_to_meeting(tick: Tick) -> u64 {
    MEET_EVERY - tick.0 % MEET_EVERY
}

/// Returns whether two regions exchange messages in every tick.
pub(super) fn are_beside(partition: &Partition, one: usize, other: usize) -> bool {
    partition.cell(one).gap_m(partition.cell(other)) <= partition.near_m()
}

/// The number of ticks that a region must look ahead to ask for a neighbour in time.
pub(super) const LOOKAHEAD_TICKS: f32 = MEET_EVERY as f32;

/// The neighbours of a region, by rank.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(in crate::physics) struct Neighbours {
    /// The neighbours of the present tick.
    now: RegionSet,
    /// Neighbours for another reason than that all regions meet; and those of them that were no such
    /// neighbours in the tick before.
    near: RegionSet,
    fresh: RegionSet,
    /// Regions whose cells are near this one's, itself among them.
    beside: RegionSet,
    /// Regions outside `beside` of which this one has a reason to be a neighbour.
    wanted: RegionSet,
    /// Says whether all regions meet in the present tick; and the regions that this one asked there, or that asked
    /// it.
    meet: bool,
    asking: RegionSet,
    /// The regions that asked or were asked at the last meeting.
    asked: RegionSet,
    /// Regions that are behind the present time, since they are stepped at a lower rate. They hear of what is
    /// near them, but do not come to hold or own further bodies.
    behind: RegionSet,
    /// Regions that should hold or own a body from here, but are not at the same time as this one.
    missed: RegionSet,
}

impl Neighbours {
    /// Finds the regions whose cells are near. Must be called whenever the tree has changed.
    pub(in crate::physics) fn settle(&mut self, region: &Region, partition: &Partition) {
        #[cfg(test)]
        SETTLED.set(SETTLED.get() + 1);
        let near = |rank: &usize| are_beside(partition, region.rank(), *rank);
        self.beside = (0..partition.len()).filter(near).collect();
    }

    /// Begins a tick, in which all regions meet or only neighbours do. The regions that are `acquainted` with
    /// this one by predicted contacts are neighbours too.
    pub(super) fn begin(&mut self, region: &Region, acquainted: RegionSet, regions: usize, meet: bool) {
        if std::mem::replace(&mut self.meet, meet) {
            self.asked = std::mem::take(&mut self.asking);
        }
        let mut near = self.beside.union(self.asked).union(held_with(region)).union(acquainted);
        near.remove(region.rank());
        self.fresh = near.without(std::mem::replace(&mut self.near, near));
        self.now = if meet { (0..regions).collect() } else { near };
        self.now.remove(region.rank());
    }

    /// Notes the regions that will be behind the present time when the tick ends. A region stays missed until
    /// this one is `stepped` again: both may come to be at the same time only ticks later.
    pub(super) fn leave_behind(&mut self, behind: RegionSet, stepped: bool) {
        self.behind = behind;
        if stepped {
            self.missed = RegionSet::EMPTY;
        }
    }

    /// Returns the neighbours that will be at the present time when the tick ends.
    pub(super) fn present(&self) -> RegionSet {
        self.now.without(self.behind)
    }

    /// Returns the regions that should hold or own a body from here, but are not at the same time as this
    /// one.
    pub(super) fn missed(&self) -> RegionSet {
        self.missed
    }

    /// Translates all ranks, after ranks have changed; all regions meet in the next tick.
    pub(super) fn remap_ranks(&mut self, ranks: &RankRemap) {
        *self = Self {
            wanted: ranks.set(self.wanted),
            missed: ranks.set(self.missed),
            meet: self.meet,
            ..Self::default()
        };
    }

    /// Returns the neighbours of a round before the last of a tick: those for which an exchange is due, and
    /// new ones, which may not know yet how many substeps this region takes.
    pub(super) fn in_round(&self, is_due: impl Fn(usize) -> bool) -> RegionSet {
        self.near.iter().filter(|&rank| self.fresh.contains(rank) || is_due(rank)).collect()
    }

    /// Returns the regions whose cells are near this one's, itself among them.
    pub(super) fn beside(&self) -> RegionSet {
        self.beside
    }

    /// Returns the neighbours of the present tick.
    pub(in crate::physics) fn now(&self) -> RegionSet {
        self.now
    }

    /// Returns those of these regions that are neighbours at the present time, and the region of rank `own`
    /// if it is among them. Notes as wanted all that are not neighbours for good, also those asked for
    /// already, for as long as they are needed.
    pub(super) fn reached(&mut self, own: usize, regions: RegionSet) -> RegionSet {
        self.need(regions);
        regions.intersection(self.present().union(RegionSet::only(own)))
    }

    /// Notes regions that are to hold or own a body from here, whether they are behind the present time or
    /// not.
    pub(super) fn need(&mut self, regions: RegionSet) {
        self.want(regions);
        self.missed = self.missed.union(regions.intersection(self.behind));
    }

    /// Makes this region and others come to the same time as soon as they are stepped: they are to hold a
    /// body together from then on.
    pub(super) fn wait_for(&mut self, regions: RegionSet) {
        self.want(regions);
        self.missed = self.missed.union(regions);
    }

    /// Returns the regions that are behind the present time.
    pub(super) fn behind(&self) -> RegionSet {
        self.behind
    }

    /// Returns whether any of these regions is behind the present time.
    pub(super) fn are_behind(&self, regions: RegionSet) -> bool {
        !regions.intersection(self.behind).is_empty()
    }

    /// Returns whether some region, in a world of `regions` regions, is not a neighbour for good.
    pub(super) fn has_strangers(&self, regions: usize) -> bool {
        self.beside.len() < regions
    }

    /// Notes regions that are to be neighbours from the next meeting on.
    pub(super) fn want(&mut self, regions: RegionSet) {
        self.wanted = self.wanted.union(regions.without(self.beside));
    }

    /// Asks the wanted regions to be neighbours, if all regions meet in this tick.
    pub(super) fn ask(&mut self, own: usize, outbox: &mut Outbox) {
        if self.meet {
            self.wanted.remove(own);
            for rank in self.wanted.iter() {
                outbox.to(rank).asks = true;
            }
            self.asking = self.asking.union(std::mem::take(&mut self.wanted));
        }
    }

    /// Notes that the region of this rank has asked to be a neighbour.
    pub(super) fn hear(&mut self, rank: usize) {
        self.asking.insert(rank);
    }
}

/// Returns the regions that hold or own a body that is held here too.
pub(super) fn held_with(region: &Region) -> RegionSet {
    region.held_elsewhere().fold(RegionSet::EMPTY, |all, link| {
        let slot = region.slot(link.handle);
        let all = all.union(slot.holders);
        match slot.role {
            Ownership::Ghost { owner } => all.union(RegionSet::only(owner)),
            _ => all,
        }
    })
}

#[cfg(test)]
thread_local! {
    pub(super) static SETTLED: std::cell::Cell<usize> = const { std::cell::Cell::new(0) };
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;

    use super::{Neighbours, meet_in};
    use crate::physics::host::processes::Processes;
    use crate::physics::outbox::Outbox;
    use crate::physics::region::Region;
    use crate::physics::{Coupling, RegionHost};
    use crate::protocol::WorldPose;
    use crate::runtime::WorldConfig;
    use crate::scene::Scene;
    use crate::space::{BodyId, Bounds, Cell, RegionId, RegionSet, Tick};

    const REGIONS: usize = 12;

    /// A corridor of 240 m with a floor. Balls fly both ways, at up to 80 m/s, over boxes that rest and
    /// through one another. A platform of 60 m moves along it.
    fn corridor() -> Scene {
        let mut scene = Scene::empty("corridor");
        scene.push_fixed_box([0.0, -0.5, 0.0], [120.0, 0.5, 5.0], &ColliderBuilder::ball(1.0));
        let mut push = |at: [f64; 3], body: RigidBodyBuilder, collider: ColliderBuilder| {
            scene.push(WorldPose::at(at), body, collider);
        };
        for i in 0..30 {
            let x = 7.9 * f64::from(i) - 115.0;
            push([x, 0.5, 0.0], RigidBodyBuilder::dynamic(), ColliderBuilder::cuboid(0.5, 0.5, 0.5));
        }
        for i in 0..40_u8 {
            let (x, to) = (5.7 * f64::from(i) - 112.0, if i % 2 == 0 { 2.0 } else { -2.0 });
            let body = RigidBodyBuilder::dynamic().gravity_scale(0.0).can_sleep(false);
            let body = body.linvel(Vector::new(to * f32::from(i), 0.0, 0.0));
            push([x, 2.0 + 0.1 * f64::from(i % 7), 1.5], body, ColliderBuilder::ball(0.3).restitution(0.9));
        }
        let platform = RigidBodyBuilder::kinematic_velocity_based().linvel(Vector::new(4.0, 0.0, 0.0));
        push([-70.0, 6.0, 0.0], platform, ColliderBuilder::cuboid(30.0, 0.2, 2.0));
        scene.bounds = Bounds::new([-120.0, -1.0, -5.0], [120.0, 9.0, 5.0]);
        scene
    }

    #[test]
    fn who_is_asked_for_stays_a_neighbour_as_long_as_there_is_a_reason() {
        let part = Bounds::around([0.0; 3], [1.0; 3]);
        let region = Region::new(RegionId(0), 0, Cell::EVERYWHERE, &part, [0.0; 3]);
        let mut neighbours = Neighbours { beside: RegionSet::only(0), ..Neighbours::default() };
        let mut outbox = Outbox::new(RegionId(0), (0..9).map(RegionId).collect());
        let is_neighbour = (0..48).map(|tick| {
            neighbours.begin(&region, RegionSet::EMPTY, 9, meet_in(Tick(tick)));
            let now = neighbours.now().contains(5);
            if (1..30).contains(&tick) {
                assert_eq!(neighbours.reached(0, RegionSet::only(5)).contains(5), now);
            }
            neighbours.ask(0, &mut outbox);
            now
        });
        let is_neighbour: Vec<_> = is_neighbour.collect();
        assert!(is_neighbour[1..8].iter().all(|now| !now), "not met yet");
        assert!(is_neighbour[8..=40].iter().all(|now| *now), "{is_neighbour:?}");
        assert!(is_neighbour[41..].iter().all(|now| !now), "no reason any more");
    }

    #[test]
    fn processes_that_hear_of_their_neighbours_only_compute_what_one_process_does() {
        let scene = corridor();
        for coupling in [Coupling::Auto, Coupling::Overlap, Coupling::Owner] {
            let step = WorldConfig::for_scene(&scene).step.with_coupling(coupling);
            let mut runs = [1, 4, REGIONS].map(|count| Processes::of(&scene, step, REGIONS, count));
            let count = runs[0].states().len();
            let (mut heard, ticks) = (0, 240);
            for tick in 0..ticks {
                for run in &mut runs {
                    // To the other end at once.
                    if tick == 100 {
                        for host in &mut run.0 {
                            host.meet_all();
                            host.move_copies(BodyId::persistent(3), WorldPose::at([110.0, 3.0, 0.0]));
                        }
                    }
                    run.step();
                }
                heard += runs[2].0.iter().map(|host| host.neighbours().len()).sum::<usize>();
                let states = runs[0].states();
                assert_eq!(states.len(), count, "{coupling:?}, tick {tick}");
                for run in &runs[1..] {
                    assert!(run.states() == states, "{coupling:?}, tick {tick}: {} processes", run.0.len());
                }
            }
            let transfers: u64 = runs[2].0.iter().map(RegionHost::transfers).sum();
            assert!(transfers > 100, "{coupling:?}: {transfers} transfers");
            let heard = heard as f64 / f64::from(ticks) / REGIONS as f64;
            assert!(heard < 6.0, "{coupling:?}: a region hears of {heard:.1} of {} others", REGIONS - 1);
        }
    }
}
