//! Predicts contacts among the bodies that one region holds, and finds which of these bodies must therefore be
//! held by other regions too, be split, or stay for now.

use rapier3d::prelude::RigidBodyHandle;

use super::PredictedContacts;
use super::near::Near;
use crate::physics::coupling::sweep::for_each_overlap;
use crate::physics::partition::Partition;
use crate::physics::region::{BodyRef, Ownership, Region};
use crate::protocol::NearbyBody;
use crate::space::RegionSet;

impl PredictedContacts {
    /// Returns the bodies owned here with a predicted contact to a body that is held here and led by another
    /// region, with the rank of that region. It solves the contact, so that it must hold both bodies by then.
    /// Bodies that their owner leads are left out, since meetings name them already.
    pub(in crate::physics::coupling) fn joining(&self, region: &Region) -> Vec<(RigidBodyHandle, usize)> {
        let led = region.held_elsewhere().filter_map(|link| {
            let slot = region.slot(link.handle);
            let rank = slot.led_by.filter(|rank| *rank != region.rank())?;
            let is_met = slot.role == Ownership::Ghost { owner: rank };
            (!is_met).then(|| (link, RegionSet::only(rank)))
        });
        let found = self.met_here(region, led, |_| true);
        found.into_iter().flat_map(|(one, ranks)| ranks.iter().map(move |rank| (one, rank))).collect()
    }

    /// Returns the bodies owned here that `asks` selects and that have a predicted contact to a split body
    /// held here, in order of handle: they are to be split too. All regions that hold both solve such a
    /// contact, each against a part of the mass, so that a whole body would get a part of what the other one
    /// loses.
    pub(in crate::physics::coupling) fn splitting(
        &self,
        region: &Region,
        is_split: impl Fn(RigidBodyHandle) -> bool,
        asks: impl Fn(RigidBodyHandle) -> bool,
    ) -> Vec<RigidBodyHandle> {
        let split = region.held_elsewhere().filter(|link| is_split(link.handle));
        let found = self.met_here(region, split.map(|link| (link, RegionSet::EMPTY)), asks);
        let mut found: Vec<_> = found.into_iter().map(|(one, _)| one).collect();
        found.sort_unstable_by_key(|handle| handle.into_raw_parts());
        found.dedup();
        found
    }

    /// Returns the awake bodies owned here that `asks` selects and that have a predicted contact to one of
    /// `held`, with the regions noted with that one.
    fn met_here(
        &self,
        region: &Region,
        held: impl Iterator<Item = (BodyRef, RegionSet)>,
        asks: impl Fn(RigidBodyHandle) -> bool,
    ) -> Vec<(RigidBodyHandle, RegionSet)> {
        let mut held = held.peekable();
        if held.peek().is_none() {
            return Vec::new();
        }
        let asked = self.near.iter().filter(|near| near.awake && asks(near.link.handle));
        let asked: Vec<_> = asked.map(Near::nearby).collect();
        if asked.is_empty() {
            return Vec::new();
        }
        let nearby = |(link, goes)| NearbyBody { goes, ..Near::of(region, link, self.ahead_s).nearby() };
        let held: Vec<_> = held.map(nearby).collect();
        let mut found = Vec::new();
        for_each_overlap(&asked, &held, f64::from(self.ahead_s), |one, other| {
            if one.id != other.id {
                found.extend(region.handle_of(one.id).map(|handle| (handle, other.goes)));
            }
        });
        found
    }

    /// Returns the bodies owned here that are to move to another region and have a predicted contact to a
    /// dynamic body that stays, in order of handle.
    pub(in crate::physics::coupling) fn parting(
        &self,
        region: &Region,
        moves: impl Fn(RigidBodyHandle) -> bool,
    ) -> Vec<RigidBodyHandle> {
        let dynamic = |near: &&Near| near.is_dynamic(region);
        let all = || self.near.iter().filter(dynamic);
        let is_out = |near: &&Near| near.awake && !region.cell().contains_box(&near.swept);
        let going: Vec<_> = all().filter(is_out).filter(|near| moves(near.link.handle)).collect();
        if going.is_empty() {
            return Vec::new();
        }
        // The boxes of both are swept equally far: how far does not change while a world lasts.
        let around = going.iter().map(|near| near.swept).reduce(|all, bounds| all.union(&bounds));
        let is_in_reach = |near: &&Near| around.is_some_and(|around| around.touches(&near.swept));
        // Bodies that go along need not be out of the cell yet.
        let staying = all().filter(is_in_reach).filter(|near| !moves(near.link.handle)).collect();
        let nearby = |nears: Vec<&Near>| nears.into_iter().map(Near::nearby).collect::<Vec<_>>();
        let mut found = Vec::new();
        for_each_overlap(&nearby(going), &nearby(staying), f64::from(self.ahead_s), |one, _| {
            found.extend(region.handle_of(one.id));
        });
        found.sort_unstable_by_key(|handle| handle.into_raw_parts());
        found.dedup();
        found
    }

    /// Returns the kinematic bodies owned here that may carry bodies of this region, with the regions where
    /// the carried bodies may soon be.
    pub(in crate::physics::coupling) fn carriers(
        &self,
        region: &Region,
        partition: &Partition,
    ) -> Vec<(RigidBodyHandle, RegionSet)> {
        let is_carried = |near: &Near| near.driven || near.is_dynamic(region);
        self.going_with(region, partition, |near| !is_carried(near), is_carried)
    }

    /// Returns the dynamic bodies owned here that a character, a vehicle or a sensor of this region may meet, and the
    /// dynamic bodies with a sensor that other bodies of this region may meet, with the regions where these may soon
    /// be. What is in a sensor does not touch it: without this the two would part for some ticks when one of them
    /// comes to have another owner.
    pub(in crate::physics::coupling) fn on_the_way(
        &self,
        region: &Region,
        partition: &Partition,
    ) -> Vec<(RigidBodyHandle, RegionSet)> {
        let is_dynamic = |near: &Near| near.is_dynamic(region);
        let mut found = self.going_with(region, partition, is_dynamic, |near| near.driven || near.senses);
        if self.near.iter().any(|near| near.senses && is_dynamic(near)) {
            let senses = |near: &Near| near.senses && is_dynamic(near);
            found.extend(self.going_with(region, partition, senses, is_dynamic));
        }
        found
    }

    /// Returns the bodies that `stays` selects and that may touch one that `goes` selects, with the regions where
    /// that one may soon be.
    fn going_with(
        &self,
        region: &Region,
        partition: &Partition,
        stays: impl Fn(&Near) -> bool,
        goes: impl Fn(&Near) -> bool,
    ) -> Vec<(RigidBodyHandle, RegionSet)> {
        let own = RegionSet::only(region.rank());
        let going = self.near.iter().filter(|near| near.awake && goes(near));
        let going =
            going.map(|near| NearbyBody { goes: near.goes(region, partition).without(own), ..near.nearby() });
        let going: Vec<_> = going.filter(|near| !near.goes.is_empty()).collect();
        if going.is_empty() {
            return Vec::new();
        }
        let staying: Vec<_> = self.near.iter().filter(|near| stays(near)).map(Near::nearby).collect();
        let mut found = Vec::new();
        for_each_overlap(&staying, &going, f64::from(self.ahead_s), |one, other| {
            if one.id != other.id {
                found.extend(region.handle_of(one.id).map(|handle| (handle, other.goes)));
            }
        });
        found
    }
}
