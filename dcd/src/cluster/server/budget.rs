//! Bounds what one client may cost others. Its avatars cost the nodes that compute them (iterations, corners,
//! size, characters, vehicles, and how many share a place). Its requests cost the server.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use nalgebra::{Isometry3, Vector3};

use super::{MAX_AVATARS, MAX_SHAPE_BYTES};
use crate::cluster::Record;
use crate::protocol::{
    BodyRecord, BodyTraits, Character, ColliderRecord, Costs, Pose, Refusal, ShapeHash, ShapeRecord, Vehicle,
    encoded_len,
};
use crate::space::{BodyId, Bounds, ClientId};

/// The most iterations of either kind that an avatar may ask for, for itself and everything that it touches.
pub(super) const MAX_EXTRA_ITERATIONS: u32 = 8;
/// The most corners that the colliders of all avatars of one client may have together. A round shape counts
/// as one corner.
const MAX_CORNERS: usize = 20_000;
/// How far an avatar may reach from its origin, metres.
pub(super) const MAX_REACH_M: f32 = 100.0;
/// The most avatars of one client that a new one may overlap, by bounding spheres.
pub(super) const MAX_OVERLAPS: usize = 64;

/// The most characters and vehicles of one client. Each looks around in every tick, where other bodies only
/// meet what comes.
const MAX_CONTROLLED: usize = 32;

/// The greatest step height, step depth and way down to the ground of a client's character, metres.
const MAX_STRIDE_M: f32 = 1.0;
/// The widest gap that a client's character may keep, metres.
const MAX_GAP_M: f32 = 0.1;
/// The greatest mass by which a client's character may push, kilograms.
const MAX_MASS_KG: f32 = 1e4;

/// The most wheels of a client's vehicle. Each is a ray in every substep.
const MAX_CLIENT_WHEELS: usize = 8;
/// How far the wheels of a client's vehicle may reach from the origin of its chassis, metres. What they may
/// stand on is held with the vehicle.
const MAX_WHEEL_REACH_M: f32 = 10.0;
/// The greatest acceleration by all suspensions of a vehicle together, m/s². Stiffer ones shoot the chassis
/// into the air.
const MAX_SUSPENSION_M_S2: f32 = 200.0;
/// The greatest damping of all suspensions of a vehicle together, 1/s. More than once per tick turns a fall
/// into a leap.
const MAX_DAMPING: f32 = 60.0;

/// The avatars that a client may bring at once, including those that it removes again: twice all that it may
/// have.
const SPAWNS: f64 = 2.0 * MAX_AVATARS as f64;
/// How many more avatars a client may bring per second.
const SPAWNS_PER_S: f64 = 128.0;
/// How many more bytes of shapes a client may bring with its avatars per second, as others are forgotten. All
/// clients are told of them.
const SHAPE_BYTES_PER_S: f64 = MAX_SHAPE_BYTES as f64 / 60.0;
/// The cost of a search of the world for scenery, in avatars.
const LOOK: f64 = 8.0;
/// The cost of telling a client the whole world, in avatars.
const WELCOME: f64 = 64.0;

/// The sum of what was asked for, less what time has forgiven.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Account {
    asked: f64,
    at: Duration,
}

impl Account {
    /// Counts a request of this cost, unless the sum would exceed `most`. Returns whether it was counted.
    /// Time forgives `per_s` per second.
    pub(super) fn ask(&mut self, now: Duration, cost: f64, most: f64, per_s: f64) -> bool {
        let forgiven = (now - self.at).as_secs_f64() * per_s;
        (self.asked, self.at) = ((self.asked - forgiven).max(0.0), now);
        let may = self.asked + cost <= most;
        if may {
            self.asked += cost;
        }
        may
    }

    /// Takes back a cost that was counted.
    pub(super) fn give_back(&mut self, cost: f64) {
        self.asked = (self.asked - cost).max(0.0);
    }
}

/// The bytes that a shape takes besides its record: to keep it, to tell all clients of it, and then to tell
/// them that it is gone.
const KEPT_BYTES: usize = 256;

/// Returns the bytes that it takes to keep a shape and to send it.
pub(super) fn kept_len(shape: &ShapeRecord) -> usize {
    KEPT_BYTES + encoded_len(shape)
}

/// The shapes that one client has brought, that were new to the world, and that are not forgotten yet.
#[derive(Clone, Debug, Default)]
pub(super) struct Brought {
    /// The bytes that each shape takes.
    shapes: BTreeMap<ShapeHash, usize>,
    bytes: usize,
}

impl Brought {
    /// Returns the bytes of these shapes and all brought ones together. The client may have brought some of
    /// these already.
    pub(super) fn bytes_with(&self, new: &[ShapeRecord]) -> usize {
        let new = new.iter().filter(|shape| !self.shapes.contains_key(&shape.hash()));
        self.bytes.saturating_add(new.map(kept_len).sum())
    }

    /// Counts shapes as brought.
    pub(super) fn add(&mut self, new: &[ShapeRecord]) {
        for shape in new {
            let bytes = kept_len(shape);
            self.bytes += bytes - self.shapes.insert(shape.hash(), bytes).unwrap_or(0);
        }
    }

    /// Stops counting shapes that are forgotten.
    pub(super) fn forget(&mut self, gone: &BTreeSet<ShapeHash>) {
        // `gone` has shapes of all clients, so it may be the longer list.
        if self.shapes.len() < gone.len() {
            self.shapes.retain(|hash, _| !gone.contains(hash));
            self.bytes = self.shapes.values().sum();
        } else {
            self.bytes -= gone.iter().filter_map(|hash| self.shapes.remove(hash)).sum::<usize>();
        }
    }
}

/// What one client may build, and what it has asked for.
#[derive(Clone, Debug, Default)]
pub(super) struct Building {
    /// Says whether its certificate says that it may build.
    pub may: bool,
    pub changes: Account,
    pub misuses: Account,
    pub shapes: Brought,
    /// The sizes of bodies that the client has built, each computed once. Some of the bodies may be gone.
    pub sizes: BTreeMap<BodyId, Size>,
    /// The indices of the next body and the next joint that the client may build, as far as this server
    /// knows.
    pub next: (u32, u32),
}

/// What one client has asked of a server, over all of its visits.
#[derive(Clone, Debug, Default)]
pub(super) struct Allowance {
    pub shapes: Brought,
    /// Bytes of shapes that came with avatars.
    told: Account,
    /// Avatars, searches and welcomes, counted in avatars.
    asked: Account,
    /// Says whether the client may build, and what it has asked for and built.
    pub building: Building,
}

impl Allowance {
    /// Counts an avatar to be brought. Returns whether the client may bring it.
    pub(super) fn spawn(&mut self, now: Duration) -> bool {
        self.ask(now, 1.0)
    }

    /// Counts shapes new to the world that come with an avatar. Returns whether the client may bring them.
    pub(super) fn bring(&mut self, now: Duration, new: &[ShapeRecord]) -> bool {
        let bytes: usize = new.iter().map(kept_len).sum();
        self.told.ask(now, bytes as f64, MAX_SHAPE_BYTES as f64, SHAPE_BYTES_PER_S)
    }

    /// Counts a search of the world for scenery. Returns whether the client may have it.
    pub(super) fn look(&mut self, now: Duration) -> bool {
        self.ask(now, LOOK)
    }

    /// Counts a welcome. Returns whether the client may be told the world.
    pub(super) fn welcome(&mut self, now: Duration) -> bool {
        self.ask(now, WELCOME)
    }

    fn ask(&mut self, now: Duration, cost: f64) -> bool {
        self.asked.ask(now, cost, SPAWNS, SPAWNS_PER_S)
    }
}

/// Returns why an avatar may not come beside those that its client has, if it costs too much. Its shapes are
/// on record or in `brought`, and suit clients.
pub(super) fn refusal(
    record: &Record,
    client: ClientId,
    avatar: &BodyRecord,
    brought: &[ShapeRecord],
) -> Option<Refusal> {
    let traits = &avatar.traits;
    if traits.extra_solver_iterations.max(traits.extra_pgs_iterations) > MAX_EXTRA_ITERATIONS {
        return Some(Refusal::Costly(Costs::Iterations));
    }
    if traits.character.is_some_and(|character| !may_walk(&character)) {
        return Some(Refusal::Costly(Costs::Strides));
    }
    if traits.vehicle.as_ref().is_some_and(|vehicle| !may_drive(vehicle)) {
        return Some(Refusal::Costly(Costs::Wheels));
    }
    let find = record.shapes_with(brought);
    let size = |avatar: &BodyRecord| Size::of(avatar, &find);
    let new = size(avatar);
    if new.reach_m > MAX_REACH_M {
        return Some(Refusal::Costly(Costs::Size));
    }
    let looks =
        |body: &BodyRecord| usize::from(body.traits.character.is_some() || body.traits.vehicle.is_some());
    let (mut corners, mut overlaps, mut controlled) = (new.corners, 0, looks(avatar));
    for (id, _) in record.avatars(client) {
        let Some(other) = record.body(id) else { continue };
        let of = size(other);
        corners += of.corners;
        controlled += looks(other);
        let apart = (0..3).map(|k| avatar.state.pose.translation[k] - other.state.pose.translation[k]);
        let apart_m = apart.map(|v| v * v).sum::<f64>().sqrt();
        overlaps += usize::from(apart_m < f64::from(new.reach_m + of.reach_m));
    }
    if controlled > MAX_CONTROLLED {
        return Some(Refusal::Costly(Costs::Characters));
    }
    if corners > MAX_CORNERS {
        return Some(Refusal::Costly(Costs::Corners));
    }
    (overlaps > MAX_OVERLAPS).then_some(Refusal::Costly(Costs::Overlaps))
}

/// Returns whether a client's character may have these measures. It may look around no farther than it must,
/// and climb no walls.
fn may_walk(character: &Character) -> bool {
    let lengths = [character.step_height_m, character.step_depth_m, character.snap_m];
    lengths.iter().all(|length| *length <= MAX_STRIDE_M)
        && character.gap_m <= MAX_GAP_M
        && character.mass_kg <= MAX_MASS_KG
}

/// Returns whether a client's vehicle may have such wheels.
fn may_drive(vehicle: &Vehicle) -> bool {
    let (mut speed_up_m_s2, mut damping) = (0.0, 0.0);
    for wheel in &vehicle.wheels {
        speed_up_m_s2 += wheel.stiffness * wheel.travel_m;
        damping += wheel.compression.max(wheel.relaxation);
    }
    speed_up_m_s2 <= MAX_SUSPENSION_M_S2
        && damping <= MAX_DAMPING
        && vehicle.wheels.len() <= MAX_CLIENT_WHEELS
        && vehicle.reach_m() <= MAX_WHEEL_REACH_M
}

/// What a body costs the nodes that hold it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    pub corners: usize,
    /// The number of colliders, where a compound counts as its parts.
    pub colliders: usize,
    /// How far the body reaches from its origin, metres, including contact skins and how far it looks ahead.
    pub reach_m: f32,
}

impl Size {
    pub(super) fn of<'a>(body: &BodyRecord, find: impl Fn(ShapeHash) -> Option<&'a ShapeRecord>) -> Self {
        let (mut corners, mut colliders, mut reach_m) = (0, 0, 0.0f32);
        for (collider, at, shape) in parts_of(body, find) {
            corners += shape.corner_count();
            colliders += 1;
            let way_m = at.translation.vector.norm() as f32;
            reach_m = reach_m.max(way_m + shape.reach_m() + margin_m(&body.traits, collider));
        }
        Self { corners, colliders: colliders.max(body.traits.colliders.len()), reach_m }
    }
}

/// Returns the AABB in world space around all colliders of a body, if it has any. Rapier compares these boxes
/// first.
pub(super) fn bounds_of<'a>(
    body: &BodyRecord,
    find: impl Fn(ShapeHash) -> Option<&'a ShapeRecord>,
) -> Option<Bounds> {
    let world_from_body = body.state.pose.isometry();
    let bounds = |(collider, at, shape): (&ColliderRecord, Isometry3<f64>, &ShapeRecord)| {
        let place = world_from_body * at;
        let turned = place.rotation.to_rotation_matrix().into_inner().abs();
        let half = turned * Vector3::from(shape.half_extents_m().map(f64::from));
        let around = Bounds::around(place.translation.vector.into(), half.into());
        around.grown(f64::from(margin_m(&body.traits, collider)))
    };
    parts_of(body, find).into_iter().map(bounds).reduce(|a, b| a.union(&b))
}

/// Returns how far a body looks around one of its colliders, metres.
pub(super) fn margin_m(traits: &BodyTraits, collider: &ColliderRecord) -> f32 {
    collider.contact_skin_m + traits.soft_ccd_m.max(0.0)
}

/// Returns the shapes of a body, each with its collider and its pose on the body. The parts of a compound
/// stand in its place.
fn parts_of<'a, 'b>(
    body: &'b BodyRecord,
    find: impl Fn(ShapeHash) -> Option<&'a ShapeRecord>,
) -> Vec<(&'b ColliderRecord, Isometry3<f64>, &'a ShapeRecord)> {
    let mut parts = Vec::new();
    for collider in &body.traits.colliders {
        let at = collider.pose.isometry();
        match find(collider.shape) {
            Some(ShapeRecord::Compound(of)) => {
                let place =
                    |(pose, hash): &(Pose, ShapeHash)| Some((collider, at * pose.isometry(), find(*hash)?));
                parts.extend(of.iter().filter_map(place));
            }
            shape => parts.extend(shape.map(|shape| (collider, at, shape))),
        }
    }
    parts
}
