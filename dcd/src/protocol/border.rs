//! Defines the border message that one region sends another in each exchange, and the contact reports of a
//! region.
//!
//! The couplings fill and read these values. Within a process they are handed over as they are; between
//! processes they are encoded.

use bincode::{Decode, Encode};
use serde::{Deserialize, Serialize};

use super::{Alteration, BodyRecord, BodyTraits, Check, Impulse, Input, JointRecord, Velocity, WorldPose};
use crate::space::{BodyId, Bounds, Epoch, RegionId, RegionSet, Tick};

/// The owner's state of a body, sent to a region that holds a ghost of it.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct SharedState {
    /// The body.
    pub id: BodyId,
    /// The present owner.
    pub owner: RegionId,
    /// The epoch of the owner, which grows with each transfer.
    pub epoch: Epoch,
    /// The pose.
    pub pose: WorldPose,
    /// The velocity.
    pub velocity: Velocity,
    /// Says whether the owner's copy sleeps.
    pub sleeping: bool,
}

/// The state of the sender's own copy of a body after the last substep: its part in the consensus among all
/// regions that hold the body.
#[derive(Clone, Copy, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct CopyState {
    /// The body.
    pub id: BodyId,
    /// The pose of the copy.
    pub pose: WorldPose,
    /// The velocity of the copy.
    pub velocity: Velocity,
    /// Says whether the copy sleeps.
    pub sleeping: bool,
    /// The time for which the copy has been still, seconds.
    pub still_s: f32,
    /// The force of contacts and joints on this copy, newtons, as its region remembers it.
    pub force_n: [f32; 3],
    /// The torque of contacts and joints on this copy, newton metres.
    pub torque_nm: [f32; 3],
    /// A hash of the bodies that press on this copy; 0 if none does.
    pub partners: u64,
    /// Says whether the numbers of the copy are finite. If not, they are sent as zero, and the copy does not
    /// count.
    pub sound: bool,
    /// From the owner only: the sender's part of the copy's island, named by the lowest id in it; `None` if
    /// the copy is in no island.
    pub part: Option<BodyId>,
    /// The number of bodies in the copy's island as the sender sees it, ghosts included; [`BIG_ISLAND`] if it
    /// is too large to move.
    pub seen: u16,
    /// The number of these bodies that the sender owns.
    pub size: u16,
    /// The lowest id in the copy's island as the sender sees it, ghosts included. It is the same for all
    /// copies in the island.
    pub island: BodyId,
    /// The regions that hold all bodies of that island.
    pub held_by: RegionSet,
    /// Says whether anything in that island touches something that no contact moves.
    pub grounded: bool,
    /// The regions in which the body may sleep although this copy is awake: those that hold all that touches it here and is
    /// not at rest. None if the copy has not been still for long enough.
    pub rests_with: RegionSet,
}

/// An impulse that a copy got since the last exchange from a body that is not held by the same regions, or
/// that the copy got after it had been sent to a new holder.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Strike {
    /// The body that was struck.
    pub id: BodyId,
    /// The body that struck it, if all regions that hold both tell of its impulse; `None` if one region alone
    /// tells of the impulse.
    pub by: Option<BodyId>,
    /// The number of bodies in the island of both, as the sender sees it. The region that sees most is
    /// believed.
    pub seen: u16,
    /// The number of bodies of that island that the sender owns. Of regions that see as many, the one that owns
    /// most is believed.
    pub size: u16,
    /// The regions that hold what struck the body, or that held the body then. Other regions did not see the
    /// impulse.
    pub held_by: RegionSet,
    /// The impulse.
    pub impulse: Impulse,
}

/// The sender's knowledge of one region's part of an island whose bodies several regions own.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct IslandPart {
    /// The sender's own part of the island, as in [`CopyState::part`].
    pub of: BodyId,
    /// The lowest id in this part.
    pub name: BodyId,
    /// The rank of the region that owns the bodies of this part.
    pub rank: u8,
    /// The number of these bodies; [`BIG_ISLAND`] if they alone are too many to move.
    pub size: u16,
    /// Says whether that region treats the island as one that moves whole.
    pub whole: bool,
    /// From how many parts away the sender heard of this part; 0 is its own.
    pub hops: u16,
}

/// The size that is sent for islands that are too large to move whole.
pub const BIG_ISLAND: u16 = u16::MAX;

/// The membership of a body from now on, that is its owner and holders. The owner sends it to all regions
/// that hold the body.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Membership {
    /// The body.
    pub id: BodyId,
    /// The epoch of the owner.
    pub epoch: Epoch,
    /// The rank of the owner.
    pub owner: u8,
    /// All regions that hold the body, the owner included.
    pub holders: RegionSet,
    /// The holders with a warm-up ghost, which only follows the other copies and has no part in mass
    /// splitting.
    pub warming: RegionSet,
}

/// A predicted contact: an AABB and a ball around a body that is near the receiver's region and that the
/// receiver does not hold.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct NearbyBody {
    /// The body.
    pub id: BodyId,
    /// The AABB in world space, metres.
    pub bounds: Bounds,
    /// The radius of a ball around the middle of the AABB that holds the body as well, metres.
    pub radius_m: f32,
    /// The velocity of both, m/s.
    pub velocity: [f32; 3],
    /// Says whether the body is awake.
    pub awake: bool,
    /// The number of bodies in its island that the sender owns; [`BIG_ISLAND`] if the island is too large to
    /// move, 0 for a body that no contact moves.
    pub island: u16,
    /// Says whether the sender keeps the body to itself, so that a region whose body meets it must send that body
    /// there.
    pub stays: bool,
    /// Says whether the body is part of a multibody, which two regions never hold.
    pub articulated: bool,
    /// Says whether the body is a character or a vehicle: what it meets must be where it goes.
    pub driven: bool,
    /// Says whether the body asks for continuous collision detection: what it meets must be wherever it is held.
    pub ccd: bool,
    /// The regions that hold the body, or may own it in the ticks that the sender looks ahead. Bodies that
    /// carry it must be there too.
    pub goes: RegionSet,
}

/// The predicted contacts that one region sends another: bodies that might meet the receiver's.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct NearbyBodies {
    /// The AABB of all that the sender's bodies reach beyond its cell. It is sent to the regions that it
    /// concerns.
    pub extent: Option<Bounds>,
    /// Other regions whose bodies reach into the sender's cell, as the receiver's do, so that they may meet
    /// there.
    pub visitors: RegionSet,
    /// The bodies, in id order.
    pub bodies: Vec<NearbyBody>,
}

/// The pose that a ghost has while the receiver first finds its contacts: how it lay when the sender found
/// them. Rapier keeps the lever arms of contacts as they are then.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct ContactPose {
    /// The body. Its record says where it is.
    pub id: BodyId,
    /// The pose in which it lay relative to what it touches, world space.
    pub pose: WorldPose,
}

/// The handover of a body to the receiver, which becomes its owner.
#[derive(Clone, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Transfer {
    /// The body, whole, at the epoch of the new owner.
    pub body: BodyRecord,
    /// The regions that hold a ghost of the body.
    pub holders: RegionSet,
    /// Says whether the body's island moves whole.
    pub whole: bool,
}

/// A change of a body's owner.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Handover {
    /// The body.
    pub body: BodyId,
    /// The region that owned the body before.
    pub from: RegionId,
    /// The region that owns the body now.
    pub to: RegionId,
}

/// A border message: everything that one region sends another after a step. Each list is in id order.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct BorderMessage {
    /// The sender.
    pub from: RegionId,
    /// The receiver.
    pub to: RegionId,
    /// The step after which it is sent.
    pub tick: Tick,
    /// Bodies that moved or changed sleep.
    pub states: Vec<SharedState>,
    /// Bodies, whole, of which the receiver is to hold a ghost from now on.
    pub ghosts: Vec<BodyRecord>,
    /// How some of these bodies lay when their contacts were found.
    pub contact_poses: Vec<ContactPose>,
    /// Joints that are new to the receiver.
    pub joints: Vec<JointRecord>,
    /// Bodies that the receiver need not hold any more.
    pub drops: Vec<BodyId>,
    /// Bodies that the receiver now owns.
    pub transfers: Vec<Transfer>,
    /// Bodies of the receiver whose ghost was woken at the sender.
    pub wakes: Vec<BodyId>,
    /// The sender's copies of bodies that both hold, if regions reach consensus on them.
    pub copies: Vec<CopyState>,
    /// Impulses on these copies that some regions which hold them have not seen. One body may come several
    /// times.
    pub strikes: Vec<Strike>,
    /// For each part of an island with bodies among `copies`: all parts of the island, the sender's first.
    pub islands: Vec<IslandPart>,
    /// Changes among the holders of bodies that the receiver holds.
    pub members: Vec<Membership>,
    /// The sender's predicted contacts; `None` if they are the same as before.
    pub nearby: Option<NearbyBodies>,
    /// The substeps that the sender takes in the next tick; 0 if they are as many as before.
    pub steps: u8,
    /// Says whether the sender asks to exchange messages in every tick until all regions meet again.
    pub asks: bool,
    /// Says whether the sender is gone: its process was lost before it told the receiver anything in this exchange.
    /// What it told before does not hold any more.
    pub gone: bool,
}

impl BorderMessage {
    /// Returns whether the message has no content.
    pub fn is_empty(&self) -> bool {
        self.nearby.is_none() && self.says_only_nearby()
    }

    /// Returns whether the message has no content but [`BorderMessage::nearby`].
    pub fn says_only_nearby(&self) -> bool {
        self.states.is_empty()
            && self.ghosts.is_empty()
            && self.joints.is_empty()
            && self.drops.is_empty()
            && self.transfers.is_empty()
            && self.wakes.is_empty()
            && self.copies.is_empty()
            && self.strikes.is_empty()
            && self.islands.is_empty()
            && self.members.is_empty()
            && self.steps == 0
            && !self.asks
            && !self.gone
    }

    /// Returns whether all ranks in the message exist in a world of `regions` regions.
    pub fn names_only(&self, regions: usize) -> bool {
        let transfers = self.transfers.iter().map(|transfer| transfer.holders);
        let members = self.members.iter().flat_map(|member| [member.holders, member.warming]);
        let visitors = self.nearby.iter().map(|nearby| nearby.visitors);
        let goes = self.nearby.iter().flat_map(|nearby| &nearby.bodies).map(|nearby| nearby.goes);
        let strikes = self.strikes.iter().map(|strike| strike.held_by);
        let copies = self.copies.iter().flat_map(|copy| [copy.held_by, copy.rests_with]);
        let sets = transfers.chain(members).chain(visitors).chain(goes).chain(strikes).chain(copies);
        sets.fold(RegionSet::EMPTY, RegionSet::union).iter().all(|rank| rank < regions)
            && self.members.iter().all(|member| usize::from(member.owner) < regions)
            && self.islands.iter().all(|part| usize::from(part.rank) < regions)
    }

    /// Returns the epochs of all bodies in the message.
    pub(crate) fn epochs(&self) -> impl Iterator<Item = Epoch> {
        let states = self.states.iter().map(|state| state.epoch);
        let ghosts = self.ghosts.iter().map(|body| body.epoch);
        let transfers = self.transfers.iter().map(|transfer| transfer.body.epoch);
        states.chain(ghosts).chain(transfers).chain(self.members.iter().map(|member| member.epoch))
    }

    /// Extrapolates all bodies in the message by `seconds` at their velocities (dead reckoning, thesis
    /// 3.3.11).
    pub fn extrapolate(&mut self, seconds: f64) {
        self.carry_forward(|_, pose, velocity| *pose = pose.moved(velocity, seconds));
    }

    /// Applies a change to the pose and velocity of each body in the message that does not sleep, and forgets what
    /// holds only for the tick in which the message was sent.
    pub(crate) fn carry_forward(&mut self, mut change: impl FnMut(BodyId, &mut WorldPose, &mut Velocity)) {
        self.contact_poses.clear();
        for SharedState { id, pose, velocity, sleeping, .. } in &mut self.states {
            if !*sleeping {
                change(*id, pose, velocity);
            }
        }
        let bodies =
            self.ghosts.iter_mut().chain(self.transfers.iter_mut().map(|transfer| &mut transfer.body));
        for BodyRecord { id, state, .. } in bodies {
            if !state.sleeping {
                change(*id, &mut state.pose, &mut state.velocity);
            }
        }
    }

    /// Removes a body that is gone from the world from all lists. Returns its record if it was being handed
    /// over.
    pub fn forget(&mut self, gone: BodyId) -> Option<BodyRecord> {
        self.states.retain(|state| state.id != gone);
        self.ghosts.retain(|body| body.id != gone);
        self.contact_poses.retain(|lay| lay.id != gone);
        self.joints.retain(|joint| joint.a != gone && joint.b != gone);
        self.wakes.retain(|&id| id != gone);
        self.copies.retain(|copy| copy.id != gone);
        self.strikes.retain(|strike| strike.id != gone);
        self.members.retain(|member| member.id != gone);
        let at = self.transfers.iter().position(|transfer| transfer.body.id == gone)?;
        Some(self.transfers.remove(at).body)
    }

    /// Applies an input to its body, if the body is handed over in this message, or is a character or vehicle
    /// that is copied.
    pub fn apply_input(&mut self, input: &Input) {
        let of = self.transfers.iter_mut().find(|transfer| transfer.body.id == input.body);
        if let Some(Transfer { body, .. }) = of {
            body.obey(input);
            body.state.pose = input.jump_of(&body.traits).unwrap_or(body.state.pose);
        }
        // How other bodies move is told by their owner.
        let is_driven = |traits: &BodyTraits| match input.drive {
            Some(_) => traits.vehicle.is_some(),
            None => traits.character.is_some(),
        };
        let obeys = |body: &&mut BodyRecord| body.id == input.body && is_driven(&body.traits);
        self.ghosts.iter_mut().filter(obeys).for_each(|body| body.obey(input));
    }

    /// Applies an alteration to its body or joint, if that is handed over or copied in this message.
    pub fn alter(&mut self, alteration: &Alteration) {
        match alteration {
            Alteration::Body { body: id, traits, user_data, wakes } => {
                let handed_over = self.transfers.iter_mut().map(|transfer| &mut transfer.body);
                for body in handed_over.chain(&mut self.ghosts).filter(|body| body.id == *id) {
                    body.set_traits(traits.clone(), *user_data);
                    body.state.sleeping &= !wakes;
                }
            }
            Alteration::Joint(record) => {
                for joint in self.joints.iter_mut().filter(|joint| joint.id == record.id) {
                    let known = std::mem::replace(joint, (**record).clone());
                    // An alteration does not know how the joint moves, nor the impulses that the last step
                    // found.
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

    /// Removes the content and keeps the allocated memory.
    pub fn clear(&mut self) {
        self.states.clear();
        self.ghosts.clear();
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

/// The key of a contact: two colliders, each by its body and its index there, the body with the lower id
/// first.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Encode, Decode, Serialize, Deserialize,
)]
pub struct ContactKey {
    /// The body with the lower id.
    pub a: BodyId,
    /// The body with the higher id.
    pub b: BodyId,
    /// The index among the colliders of `a`, from 0 in order of insertion.
    pub collider_a: u16,
    /// The index among the colliders of `b`, from 0 in order of insertion.
    pub collider_b: u16,
}

impl ContactKey {
    /// Returns the body that `body` touches; `None` if `body` is neither of the two.
    pub fn other(&self, body: BodyId) -> Option<BodyId> {
        match body {
            _ if body == self.a => Some(self.b),
            _ if body == self.b => Some(self.a),
            _ => None,
        }
    }
}

/// A contact event: two colliders began or ceased to touch.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct Touch {
    /// The two colliders.
    pub key: ContactKey,
    /// Says whether the contact began; otherwise it ceased.
    pub began: bool,
    /// Says whether one of the two is a sensor.
    pub sensor: bool,
    /// The point of contact in world space, metres. If the contact has no point, the middle between the
    /// bodies.
    pub point: [f64; 3],
    /// The unit normal from `a` to `b`; zero for sensors, and when the contact ceases.
    pub normal: [f32; 3],
    /// The approach speed before the contact, m/s, as far as it is known; 0 when the contact ceases.
    pub speed: f32,
}

/// A contact event: a contact pressed harder than a collider's threshold. Among the events of one region, the
/// region's part of the force, whatever its size.
#[derive(Clone, Copy, Debug, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct ContactForce {
    /// The two colliders.
    pub key: ContactKey,
    /// The sum of the forces on `b`, newtons, world axes.
    pub force_n: [f32; 3],
    /// The sum of the magnitudes of the forces, newtons.
    pub magnitude_n: f32,
    /// The lower of the colliders' thresholds, newtons.
    pub threshold_n: f32,
}

/// The contact events of one region in one tick. A pair that two regions hold is in the events of both; the
/// collector reports it once.
#[derive(Clone, Debug, Default, PartialEq, Encode, Decode, Serialize, Deserialize)]
pub struct RegionEvents {
    /// The region.
    pub region: RegionId,
    /// The tick.
    pub tick: Tick,
    /// Contacts that began or ceased, in order of appearance.
    pub touches: Vec<Touch>,
    /// Contacts that pressed harder than a threshold, in order of appearance.
    pub forces: Vec<ContactForce>,
}

impl RegionEvents {
    /// Removes numbers that must not be sent: those of contacts with a body whose numbers are not finite any
    /// more.
    pub fn make_tellable(&mut self) {
        for touch in &mut self.touches {
            if touch.check().is_err() {
                (touch.point, touch.normal, touch.speed) = ([0.0; 3], [0.0; 3], 0.0);
            }
        }
        self.forces.retain(|force| force.check().is_ok());
    }
}
