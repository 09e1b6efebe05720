//! Compares the lists of bodies that two regions exchanged, so that both regions find the same predicted
//! contacts (meetings) between a body owned here and a body of the other region.

use serde::{Deserialize, Serialize};

use super::PredictedContacts;
use crate::physics::coupling::island;
use crate::physics::coupling::sweep::for_each_overlap;
use crate::protocol::NearbyBody;
use crate::space::{BodyId, RegionSet};

/// A predicted contact between a body owned here and one that is owned by another region.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(in crate::physics::coupling) struct Meeting {
    /// The body owned here.
    pub own: BodyId,
    /// The size of its island as sent to the other region; 0 if the other body sleeps, or asks for continuous
    /// collision detection.
    own_island: u16,
    /// Rank of the other body's owner.
    pub rank: usize,
    /// The size of the other body's island, in bodies that its region owns; 1 for a character and for a
    /// kinematic part of a multibody, 0 for any other body that no contact moves.
    pub island: u16,
    /// Says whether the other body stays in its region, whatever it meets.
    pub stays: bool,
    /// Says whether the other body is a part of a multibody.
    pub articulated: bool,
    /// Says whether the other body is a character or a vehicle.
    driven: bool,
    /// Regions that hold the other body, or may come to own it soon.
    pub goes: RegionSet,
}

impl Meeting {
    /// Returns whether the island of the body owned here is so much larger than the other one that the other one
    /// alone need be held by both regions. By the sizes that both regions know, never both outweigh.
    pub(in crate::physics::coupling) fn outweighs(self) -> bool {
        !self.stays && island::outweighs(self.own_island, self.island)
    }

    /// Returns the regions that must hold the body owned here for what it meets: the other body's, and those that
    /// the other body goes to if it is driven.
    pub(in crate::physics::coupling) fn concerned(self) -> RegionSet {
        let goes = if self.driven { self.goes } else { RegionSet::EMPTY };
        goes.union(RegionSet::only(self.rank))
    }
}

impl PredictedContacts {
    /// Predicts contacts with the regions whose lists changed.
    pub(in crate::physics::coupling) fn meet(&mut self) {
        let changed = std::mem::take(&mut self.changed);
        if changed.is_empty() {
            return;
        }
        let Self { meetings, shown, seen, ahead_s, .. } = self;
        meetings.retain(|meeting| !changed.contains(meeting.rank));
        for rank in changed.iter() {
            for_each_overlap(&shown[rank].bodies, &seen[rank].bodies, f64::from(*ahead_s), |own, other| {
                if own.awake || other.awake {
                    let NearbyBody { island, stays, articulated, driven, goes, .. } = *other;
                    // What else belongs to a sleeping body's island is not known. A copy that CCD has not
                    // stopped would go on.
                    let weighs = other.awake && !other.ccd;
                    let (own, own_island) = (own.id, if weighs { own.island } else { 0 });
                    meetings.push(Meeting {
                        own,
                        own_island,
                        rank,
                        island,
                        stays,
                        articulated,
                        driven,
                        goes,
                    });
                }
            });
        }
        meetings.sort_unstable_by_key(|meeting| (meeting.own, meeting.rank, meeting.island));
    }

    /// Returns the regions with whose bodies contacts are predicted, and those that such bodies may come to.
    pub(in crate::physics::coupling) fn met_with(&self) -> RegionSet {
        self.meetings.iter().fold(RegionSet::EMPTY, |all, meeting| {
            all.union(RegionSet::only(meeting.rank)).union(meeting.goes)
        })
    }

    /// Returns the predicted contacts of one body.
    pub(in crate::physics::coupling) fn meetings_of(&self, own: BodyId) -> impl Iterator<Item = &Meeting> {
        let from = self.meetings.partition_point(|meeting| meeting.own < own);
        self.meetings[from..].iter().take_while(move |meeting| meeting.own == own)
    }
}
