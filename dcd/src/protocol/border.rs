//! Defines the border message that one region sends another in each exchange, and the contact reports of a region. The coupling
//! methods fill and read these values; in one process they are handed over as they are, between processes they are encoded.

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use super::{Alteration, BodyRecord, BodyTraits, Check, Impulse, Input, JointRecord, Velocity, WorldPose};
use crate::space::{BodyId, Bounds, Epoch, RegionId, RegionSet, Tick};

/// The owner's state of a body, sent to a region that holds a replica of it.
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

/// The state of the sender's own copy of a body after the last substep, input of the consensus among all regions that hold it.
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
    /// Force of contacts and joints on this copy, newtons, as its region remembers it.
    pub force_n: [f32; 3],
    /// Torque of contacts and joints on it, newton metres.
    pub torque_nm: [f32; 3],
    /// A hash of the bodies that press on this copy; 0 when none does.
    pub partners: u64,
    /// Whether its numbers are finite; if not, they are sent as zero and the copy does not count.
    pub sound: bool,
    /// From the owner only: the sender's part of the copy's island, named by the lowest id in it; `None` while it is in no island.
    pub part: Option<BodyId>,
    /// How many bodies the copy's island has in all as the sender sees it, ghosts among them; [`BIG_ISLAND`] when it is too large
    /// to move.
    pub seen: u16,
    /// How many of them the sender owns.
    pub size: u16,
    /// The lowest id in the copy's island as the sender sees it, ghosts among them: the same for all copies in it.
    pub island: BodyId,
    /// The regions that hold all bodies of that island.
    pub held_by: RegionSet,
}

/// The impulse that a copy got since the last exchange from a body that not the same regions hold; or that it got after it had been
/// sent to a new holder.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Strike {
    /// Which body was struck.
    pub id: BodyId,
    /// By which one, of whose impulse all that hold both tell; `None` for what one region alone tells.
    pub by: Option<BodyId>,
    /// How many bodies the island of both has as the sender sees it: who sees most is believed.
    pub seen: u16,
    /// The regions that hold what struck it, or that held it then: others did not see that.
    pub held_by: RegionSet,
    /// How much.
    pub impulse: Impulse,
}

/// The sender's knowledge of one region's part of an island whose bodies several regions own.
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
    /// Whether their region treats the island as one that moves whole.
    pub whole: bool,
    /// From how many parts away the sender heard of it; 0 is its own.
    pub hops: u16,
}

/// The size sent for islands that are too large to move whole.
pub const BIG_ISLAND: u16 = u16::MAX;

/// The membership of a body (its owner and holders) from now on, sent by its owner to all regions that hold it.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Membership {
    /// Which body.
    pub id: BodyId,
    /// Epoch of the owner.
    pub epoch: Epoch,
    /// Rank of the owner.
    pub owner: u8,
    /// All regions that hold it, the owner too.
    pub holders: RegionSet,
    /// Those of them that hold a warm-up ghost: it only follows the other copies and has no part in mass splitting.
    pub warming: RegionSet,
}

/// A predicted contact: an AABB and a ball around a body near the receiver's region which the receiver does not hold.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct NearbyBody {
    /// Which body.
    pub id: BodyId,
    /// Its AABB, world space, metres.
    pub bounds: Bounds,
    /// Radius of a ball around the middle of that which holds the body as well, metres.
    pub radius_m: f32,
    /// Velocity of both, m/s.
    pub velocity: [f32; 3],
    /// Whether it is awake.
    pub awake: bool,
    /// How many bodies of its island the sender owns; [`BIG_ISLAND`] when it is too large to move, 0 for what no contact moves.
    pub island: u16,
    /// Whether the sender keeps it to itself: who meets it must send it what meets it.
    pub stays: bool,
    /// Whether it is a part of a multibody, which is never held by two regions.
    pub articulated: bool,
    /// Regions that hold it, or may own it in the ticks that the sender looks ahead: bodies that carry it must be there.
    pub goes: RegionSet,
}

/// The predicted contacts that a region sends another: bodies that might meet the receiver's.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct NearbyBodies {
    /// AABB of all that the sender's bodies reach beyond its cell; sent to the regions that it concerns.
    pub extent: Option<Bounds>,
    /// Other regions whose bodies reach into the sender's cell, as the receiver's do: they may meet there.
    pub visitors: RegionSet,
    /// In id order.
    pub bodies: Vec<NearbyBody>,
}

/// Where a replica is to be while the receiver first finds its contacts: how it lay when the sender found them. Rapier keeps their lever
/// arms as they are then.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct ContactPose {
    /// Which body; its record says where it is.
    pub id: BodyId,
    /// Where it lay, relative to what it touches, world space.
    pub pose: WorldPose,
}

/// The handover of a body to the receiver, which becomes its owner.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Transfer {
    /// The body, whole, at the epoch of the new owner.
    pub body: BodyRecord,
    /// The regions that hold a replica.
    pub holders: RegionSet,
    /// Whether its island moves whole.
    pub whole: bool,
}

/// A record that a body changed owner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Handover {
    /// Which body.
    pub body: BodyId,
    /// The region that owned it.
    pub from: RegionId,
    /// The region that owns it now.
    pub to: RegionId,
}

/// A border message: everything that one region sends another after a step; each list in id order.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct BorderMessage {
    /// The sender.
    pub from: RegionId,
    /// The receiver.
    pub to: RegionId,
    /// After which step.
    pub tick: Tick,
    /// Bodies that moved or changed sleep.
    pub states: Vec<SharedState>,
    /// Bodies that the receiver is to hold a replica of from now on, whole.
    pub replicas: Vec<BodyRecord>,
    /// How some of these lay when their contacts were found.
    pub contact_poses: Vec<ContactPose>,
    /// Joints new to the receiver.
    pub joints: Vec<JointRecord>,
    /// Bodies the receiver need not hold any more.
    pub drops: Vec<BodyId>,
    /// Bodies the receiver now owns.
    pub transfers: Vec<Transfer>,
    /// Bodies of the receiver whose replica was woken here.
    pub wakes: Vec<BodyId>,
    /// The sender's copies of bodies that both hold, when regions reach consensus on them.
    pub copies: Vec<CopyState>,
    /// What struck these copies, unseen by some regions that hold them; one body may come several times.
    pub strikes: Vec<Strike>,
    /// Of each part of an island of whose bodies there are copies above: the island's parts, the sender's first.
    pub islands: Vec<IslandPart>,
    /// Changes among the holders of bodies that the receiver holds.
    pub members: Vec<Membership>,
    /// The sender's predicted contacts; `None`: the same as before.
    pub nearby: Option<NearbyBodies>,
    /// Substeps that the sender takes in the next tick; 0: as many as before.
    pub steps: u8,
    /// Whether the sender asks to exchange messages in every tick until all regions meet again.
    pub asks: bool,
}

impl BorderMessage {
    /// Returns whether the message has no content.
    pub fn is_empty(&self) -> bool {
        self.states.is_empty()
            && self.replicas.is_empty()
            && self.joints.is_empty()
            && self.drops.is_empty()
            && self.transfers.is_empty()
            && self.wakes.is_empty()
            && self.copies.is_empty()
            && self.strikes.is_empty()
            && self.islands.is_empty()
            && self.members.is_empty()
            && self.nearby.is_none()
            && self.steps == 0
            && !self.asks
    }

    /// Returns whether all ranks in it exist in a world of so many regions.
    pub fn names_only(&self, regions: usize) -> bool {
        let transfers = self.transfers.iter().map(|transfer| transfer.holders);
        let members = self.members.iter().flat_map(|member| [member.holders, member.warming]);
        let visitors = self.nearby.iter().map(|nearby| nearby.visitors);
        let goes = self.nearby.iter().flat_map(|nearby| &nearby.bodies).map(|nearby| nearby.goes);
        let strikes = self.strikes.iter().map(|strike| strike.held_by);
        let copies = self.copies.iter().map(|copy| copy.held_by);
        let sets = transfers.chain(members).chain(visitors).chain(goes).chain(strikes).chain(copies);
        sets.fold(RegionSet::EMPTY, RegionSet::union).iter().all(|rank| rank < regions)
            && self.members.iter().all(|member| usize::from(member.owner) < regions)
            && self.islands.iter().all(|part| usize::from(part.rank) < regions)
    }

    /// Returns the epochs of all bodies in it.
    pub(crate) fn epochs(&self) -> impl Iterator<Item = Epoch> {
        let states = self.states.iter().map(|state| state.epoch);
        let replicas = self.replicas.iter().map(|body| body.epoch);
        let transfers = self.transfers.iter().map(|transfer| transfer.body.epoch);
        states.chain(replicas).chain(transfers).chain(self.members.iter().map(|member| member.epoch))
    }

    /// Extrapolates all bodies in it by `seconds` at their velocities (dead reckoning, thesis 3.3.11).
    pub fn extrapolate(&mut self, seconds: f64) {
        let ahead = |pose: &mut WorldPose, velocity: &Velocity, sleeping: bool| {
            if !sleeping {
                *pose = pose.moved(velocity, seconds);
            }
        };
        // They are of the tick in which it was sent.
        self.contact_poses.clear();
        for SharedState { pose, velocity, sleeping, .. } in &mut self.states {
            ahead(pose, velocity, *sleeping);
        }
        let bodies =
            self.replicas.iter_mut().chain(self.transfers.iter_mut().map(|transfer| &mut transfer.body));
        for BodyRecord { state, .. } in bodies {
            ahead(&mut state.pose, &state.velocity, state.sleeping);
        }
    }

    /// Removes a body that is gone from the world from all lists. Returns its record if it was to be handed over.
    pub fn forget(&mut self, gone: BodyId) -> Option<BodyRecord> {
        self.states.retain(|state| state.id != gone);
        self.replicas.retain(|body| body.id != gone);
        self.contact_poses.retain(|lay| lay.id != gone);
        self.joints.retain(|joint| joint.a != gone && joint.b != gone);
        self.wakes.retain(|&id| id != gone);
        self.copies.retain(|copy| copy.id != gone);
        self.strikes.retain(|strike| strike.id != gone);
        self.members.retain(|member| member.id != gone);
        let at = self.transfers.iter().position(|transfer| transfer.body.id == gone)?;
        Some(self.transfers.remove(at).body)
    }

    /// Applies an input to the body if it is being handed over in this message, or as a character copied.
    pub fn apply_input(&mut self, input: &Input) {
        let of = self.transfers.iter_mut().find(|transfer| transfer.body.id == input.body);
        if let Some(Transfer { body, .. }) = of {
            body.obey(input);
            body.state.pose = input.jump_of(&body.traits).unwrap_or(body.state.pose);
        }
        // Of other bodies the owner tells how they move.
        let is_driven = |traits: &BodyTraits| match input.drive {
            Some(_) => traits.vehicle.is_some(),
            None => traits.character.is_some(),
        };
        let obeys = |body: &&mut BodyRecord| body.id == input.body && is_driven(&body.traits);
        self.replicas.iter_mut().filter(obeys).for_each(|body| body.obey(input));
    }

    /// Changes what the body or the joint is, if it is being handed over or copied in this message.
    pub fn alter(&mut self, alteration: &Alteration) {
        match alteration {
            Alteration::Body { body: id, traits, user_data, wakes } => {
                let handed_over = self.transfers.iter_mut().map(|transfer| &mut transfer.body);
                for body in handed_over.chain(&mut self.replicas).filter(|body| body.id == *id) {
                    body.set_traits(traits.clone(), *user_data);
                    body.state.sleeping &= !wakes;
                }
            }
            Alteration::Joint(record) => {
                for joint in self.joints.iter_mut().filter(|joint| joint.id == record.id) {
                    let known = std::mem::replace(joint, (**record).clone());
                    // Who alters it knows neither how it moves nor what was found out of it in the last step.
                    if let (Some(link), Some(known)) = (&mut joint.link, &known.link) {
                        link.motion = known.motion;
                    }
                    for axis in 0..known.limits.len() {
                        joint.limits[axis].impulse = known.limits[axis].impulse;
                        joint.motors[axis].impulse = known.motors[axis].impulse;
                    }
                }
            }
        }
    }

    /// Removes the content and keeps the memory.
    pub fn clear(&mut self) {
        self.states.clear();
        self.replicas.clear();
        self.contact_poses.clear();
        self.joints.clear();
        self.drops.clear();
        self.transfers.clear();
        self.wakes.clear();
        self.copies.clear();
        self.strikes.clear();
        self.islands.clear();
        self.members.clear();
        self.nearby = None;
        self.steps = 0;
        self.asks = false;
    }
}

/// The key of a contact: two colliders by their bodies and their places there, the lower body first.
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

impl ContactKey {
    /// Returns the body that `body` touches, if it is one of the two.
    pub fn other(&self, body: BodyId) -> Option<BodyId> {
        match body {
            _ if body == self.a => Some(self.b),
            _ if body == self.b => Some(self.a),
            _ => None,
        }
    }
}

/// An event: two colliders began or ceased to touch in one region.
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

/// An event: a contact pressed harder than a collider's threshold; of one region, its share in that, whatever it is.
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

/// The contact events of one region in one tick. A pair held by two regions is in both; the collector reports it once.
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
    /// Removes numbers that must not be sent: those of contacts with a body that is no longer finite.
    pub fn make_tellable(&mut self) {
        for touch in &mut self.touches {
            if touch.check().is_err() {
                (touch.point, touch.normal, touch.speed) = ([0.0; 3], [0.0; 3], 0.0);
            }
        }
        self.forces.retain(|force| force.check().is_ok());
    }
}
