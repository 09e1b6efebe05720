//! What one region tells another once an exchange, and what it reports of contacts. The coupling methods fill and read
//! these values; in one process they are handed over as they are, between processes they are encoded.

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use super::{BodyRecord, Check, Input, JointRecord, Velocity, WorldPose};
use crate::space::{BodyId, Bounds, Epoch, RegionId, RegionSet, Tick};

/// The owner's word on a body that the receiver holds a replica of.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct SharedState {
    /// Which body.
    pub id: BodyId,
    /// Its present owner.
    pub owner: RegionId,
    /// How often it has changed hands.
    pub epoch: Epoch,
    /// Where it is.
    pub pose: WorldPose,
    /// How it moves.
    pub velocity: Velocity,
    /// Whether the owner's copy sleeps.
    pub sleeping: bool,
}

/// What the sender's own copy of a body became in the last (micro-)step, for all regions that hold it to agree on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct CopyState {
    /// Which body.
    pub id: BodyId,
    /// Where the copy is.
    pub pose: WorldPose,
    /// How it moves.
    pub velocity: Velocity,
    /// Whether it sleeps.
    pub sleeping: bool,
    /// What contacts and joints press on this copy, newtons, as its region remembers it.
    pub force_n: [f32; 3],
    /// The same for turning, newton metres.
    pub torque_nm: [f32; 3],
    /// A hash of the bodies that press on this copy; 0 when none does.
    pub partners: u64,
    /// Whether its numbers are finite; if not, they stand at zero and the copy does not count.
    pub sound: bool,
    /// Of its owner: the sender's part of the copy's island, by the lowest id in it; none while it is in none.
    pub part: Option<BodyId>,
    /// How many bodies the copy's island has in all as the sender sees it, ghosts among them; [`BIG_ISLAND`] when it is too large
    /// to move.
    pub seen: u16,
    /// How many of them the sender owns.
    pub size: u16,
}

/// What the sender knows of one region's part of an island that several regions have bodies of.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct IslandPart {
    /// The sender's own part of the island, as in [`CopyState::part`].
    pub of: BodyId,
    /// The lowest id in this part.
    pub name: BodyId,
    /// Rank of the region that owns the bodies of this part.
    pub rank: u8,
    /// How many they are; [`BIG_ISLAND`] when they alone are too many to move.
    pub size: u16,
    /// Whether their region takes the island for one that moves whole.
    pub whole: bool,
    /// From how many parts away the sender heard of it; 0 is its own.
    pub hops: u16,
}

/// The size told of islands that are too large to move whole.
pub const BIG_ISLAND: u16 = u16::MAX;

/// Who holds and who owns a body from now on, told by its owner to all who hold it.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Membership {
    /// Which body.
    pub id: BodyId,
    /// Of the owner.
    pub epoch: Epoch,
    /// Rank of the owner.
    pub owner: u8,
    /// All that hold it, the owner too.
    pub holders: RegionSet,
    /// Those of them whose copies only follow the others': they have no part of the mass.
    pub warming: RegionSet,
}

/// A body near the receiver's region which the receiver does not hold.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct NearbyBody {
    /// Which body.
    pub id: BodyId,
    /// A box around it, world space, metres.
    pub bounds: Bounds,
    /// How the box moves, m/s.
    pub velocity: [f32; 3],
    /// Whether it is awake.
    pub awake: bool,
    /// How many bodies of its island the sender owns; [`BIG_ISLAND`] when it is too large to move, 0 for what no contact moves.
    pub island: u16,
    /// Regions that hold it, or may own it in the ticks that the sender looks ahead: what carries it must be there.
    pub goes: RegionSet,
}

/// What a region shows to another: bodies that might meet the other's.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct NearbyBodies {
    /// A box around all that the sender's bodies reach beyond its cell; told to whom it concerns.
    pub extent: Option<Bounds>,
    /// Other regions whose bodies reach into the sender's cell, as the receiver's do: they may meet there.
    pub visitors: RegionSet,
    /// In id order.
    pub bodies: Vec<NearbyBody>,
}

/// The receiver becomes the owner of a body.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Transfer {
    /// The body, whole, at the epoch of the new owner.
    pub body: BodyRecord,
    /// The regions that hold a replica.
    pub holders: RegionSet,
    /// Whether its island moves whole.
    pub whole: bool,
}

/// A body changed owner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Handover {
    /// Which body.
    pub body: BodyId,
    /// The region that owned it.
    pub from: RegionId,
    /// The region that owns it now.
    pub to: RegionId,
}

/// Everything that one region has to say to another after a step; each list in id order.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct BorderMessage {
    /// Who speaks.
    pub from: RegionId,
    /// Who is spoken to.
    pub to: RegionId,
    /// After which step.
    pub tick: Tick,
    /// Bodies that moved or changed sleep.
    pub states: Vec<SharedState>,
    /// Bodies that the receiver is to hold a replica of from now on, whole.
    pub replicas: Vec<BodyRecord>,
    /// Joints new to the receiver.
    pub joints: Vec<JointRecord>,
    /// Bodies the receiver need not hold any more.
    pub drops: Vec<BodyId>,
    /// Bodies the receiver now owns.
    pub transfers: Vec<Transfer>,
    /// Bodies of the receiver whose replica was woken here.
    pub wakes: Vec<BodyId>,
    /// The sender's copies of bodies that both hold, when regions agree on means.
    pub copies: Vec<CopyState>,
    /// Of each part of an island of whose bodies there are copies above: the island's parts, the sender's first.
    pub islands: Vec<IslandPart>,
    /// Changes among the holders of bodies that the receiver holds.
    pub members: Vec<Membership>,
    /// What the sender shows to the receiver; `None`: the same as before.
    pub nearby: Option<NearbyBodies>,
    /// Substeps that the sender takes in the next tick; 0: as many as before.
    pub steps: u8,
}

impl BorderMessage {
    /// Whether there is nothing to say.
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
            && self.replicas.is_empty()
            && self.joints.is_empty()
            && self.drops.is_empty()
            && self.transfers.is_empty()
            && self.wakes.is_empty()
            && self.copies.is_empty()
            && self.islands.is_empty()
            && self.members.is_empty()
            && self.nearby.is_none()
            && self.steps == 0
    }

    /// Whether all ranks in it are of a world of so many regions: others would name nobody.
    pub fn names_only(&self, regions: usize) -> bool {
        let transfers = self.transfers.iter().map(|transfer| transfer.holders);
        let members = self.members.iter().flat_map(|member| [member.holders, member.warming]);
        let visitors = self.nearby.iter().map(|nearby| nearby.visitors);
        let goes = self.nearby.iter().flat_map(|nearby| &nearby.bodies).map(|nearby| nearby.goes);
        let sets = transfers.chain(members).chain(visitors).chain(goes);
        sets.fold(RegionSet::EMPTY, RegionSet::union).iter().all(|rank| rank < regions)
            && self.members.iter().all(|member| usize::from(member.owner) < regions)
            && self.islands.iter().all(|part| usize::from(part.rank) < regions)
    }

    /// Where bodies are `seconds` after the message was written, as far as their velocities tell (dead reckoning, thesis 3.3.11).
    pub fn extrapolate(&mut self, seconds: f64) {
        let ahead = |pose: &mut WorldPose, velocity: &Velocity, sleeping: bool| {
            if !sleeping {
                *pose = pose.moved(velocity, seconds);
            }
        };
        for SharedState { pose, velocity, sleeping, .. } in &mut self.states {
            ahead(pose, velocity, *sleeping);
        }
        let bodies =
            self.replicas.iter_mut().chain(self.transfers.iter_mut().map(|transfer| &mut transfer.body));
        for BodyRecord { state, .. } in bodies {
            ahead(&mut state.pose, &state.velocity, state.sleeping);
        }
    }

    /// A body is gone from the world: it is neither told of nor handed over. Returns it if it was to be.
    pub fn forget(&mut self, gone: BodyId) -> Option<BodyRecord> {
        self.states.retain(|state| state.id != gone);
        self.replicas.retain(|body| body.id != gone);
        self.joints.retain(|joint| joint.a != gone && joint.b != gone);
        self.wakes.retain(|&id| id != gone);
        self.copies.retain(|copy| copy.id != gone);
        self.members.retain(|member| member.id != gone);
        let at = self.transfers.iter().position(|transfer| transfer.body.id == gone)?;
        Some(self.transfers.remove(at).body)
    }

    /// A body that is handed over goes where its user wants it to.
    pub fn apply_input(&mut self, input: &Input) {
        let of = self.transfers.iter_mut().find(|transfer| transfer.body.id == input.body);
        if let Some(Transfer { body, .. }) = of {
            body.state.velocity = input.velocity;
            body.state.pose = input.pose.unwrap_or(body.state.pose);
        }
    }

    /// Forgets the content and keeps the memory.
    pub fn clear(&mut self) {
        self.states.clear();
        self.replicas.clear();
        self.joints.clear();
        self.drops.clear();
        self.transfers.clear();
        self.wakes.clear();
        self.copies.clear();
        self.islands.clear();
        self.members.clear();
        self.nearby = None;
        self.steps = 0;
    }
}

/// Two colliders by the bodies they belong to and their places there, the lower body first.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Encode, Decode, Serialize, Deserialize,
)]
pub struct ContactKey {
    /// The body with the lower id.
    pub a: BodyId,
    /// The other one.
    pub b: BodyId,
    /// Collider of `a`, in order of insertion.
    pub collider_a: u16,
    /// Collider of `b`, in order of insertion.
    pub collider_b: u16,
}

/// Two colliders began or ceased to touch in one region.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Touch {
    /// Which.
    pub key: ContactKey,
    /// Began or ceased.
    pub began: bool,
    /// Whether one of them is a sensor.
    pub sensor: bool,
    /// Where, in world space, metres; the middle between the bodies when the contact has no point.
    pub point: [f64; 3],
    /// From `a` to `b`, unit length, or zero for sensors and ends.
    pub normal: [f32; 3],
    /// Approach speed before the contact, m/s, as far as known; 0 for ends.
    pub speed: f32,
}

/// A contact pressed harder than a collider's threshold; of one region, its share in that, whatever it is.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct ContactForce {
    /// Which.
    pub key: ContactKey,
    /// Sum of the forces on `b`, newtons, world axes.
    pub force_n: [f32; 3],
    /// Sum of the magnitudes, newtons.
    pub magnitude_n: f32,
    /// The lower of the colliders' thresholds, newtons.
    pub threshold_n: f32,
}

/// What one region saw of contacts in one tick. A pair held by two regions is in both; whoever collects reports it once.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct RegionEvents {
    /// Which region.
    pub region: RegionId,
    /// In which tick.
    pub tick: Tick,
    /// In order of appearance.
    pub touches: Vec<Touch>,
    /// In order of appearance.
    pub forces: Vec<ContactForce>,
}

impl RegionEvents {
    /// Leaves numbers out that may not travel: those of contacts with a body that is no longer finite.
    pub fn make_tellable(&mut self) {
        for touch in &mut self.touches {
            if touch.check().is_err() {
                (touch.point, touch.normal, touch.speed) = ([0.0; 3], [0.0; 3], 0.0);
            }
        }
        self.forces.retain(|force| force.check().is_ok());
    }
}
