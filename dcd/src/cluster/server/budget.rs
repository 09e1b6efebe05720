//! Bounds what one client may cost others: its avatars those who compute them (iterations, corners, size, characters, vehicles,
//! and how many share a place), its requests the server.

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

/// The most iterations of either kind that an avatar may ask for, for itself and all that it touches.
pub(super) const MAX_EXTRA_ITERATIONS: u32 = 8;
/// The most corners that the colliders of all avatars of one client have together; what is round counts as one.
const MAX_CORNERS: usize = 20_000;
/// How far an avatar may reach from its origin, metres.
pub(super) const MAX_REACH_M: f32 = 100.0;
/// The most avatars of one client that a new one may overlap, by bounding spheres.
pub(super) const MAX_OVERLAPS: usize = 64;

/// The most characters and vehicles of one client: each looks around in every tick, where others only meet what comes.
const MAX_CONTROLLED: usize = 32;

/// The highest and deepest step of a client's character, and the farthest way down to the ground, metres.
const MAX_STRIDE_M: f32 = 1.0;
/// The widest gap that it keeps, metres.
const MAX_GAP_M: f32 = 0.1;
/// The greatest mass by which it pushes, kilograms.
const MAX_MASS_KG: f32 = 1e4;

/// The most wheels of a client's vehicle: each is a ray in every substep.
const MAX_CLIENT_WHEELS: usize = 8;
/// How far its wheels may reach from the origin of its chassis, metres: what they may stand on is held with it.
const MAX_WHEEL_REACH_M: f32 = 10.0;
/// The greatest acceleration by all suspensions together, m/s²: stiffer ones shoot their chassis into the air.
const MAX_SUSPENSION_M_S2: f32 = 200.0;
/// The greatest damping of all suspensions together, 1/s: beyond once a tick it turns a fall into a leap.
const MAX_DAMPING: f32 = 60.0;

/// The avatars that a client may bring at once, those included that it removes again: all that it may have, twice.
const SPAWNS: f64 = 2.0 * MAX_AVATARS as f64;
/// How many more each second.
const SPAWNS_PER_S: f64 = 128.0;
/// The bytes of shapes that a client may bring more with its avatars each second, as others are forgotten: all are told of them.
const SHAPE_BYTES_PER_S: f64 = MAX_SHAPE_BYTES as f64 / 60.0;
/// What a search of the world for scenery counts, in avatars.
const LOOK: f64 = 8.0;
/// What being told the whole world counts, in avatars.
const WELCOME: f64 = 64.0;

/// What was asked, less what time has forgiven.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Account {
    asked: f64,
    at: Duration,
}

impl Account {
    /// Counts a request of this cost, if that leaves no more than `most`; returns whether it does. Time forgives `per_s` each second.
    pub(super) fn ask(&mut self, now: Duration, cost: f64, most: f64, per_s: f64) -> bool {
        let forgiven = (now - self.at).as_secs_f64() * per_s;
        (self.asked, self.at) = ((self.asked - forgiven).max(0.0), now);
        let may = self.asked + cost <= most;
        if may {
            self.asked += cost;
        }
        may
    }

    /// Takes back what was counted.
    pub(super) fn give_back(&mut self, cost: f64) {
        self.asked = (self.asked - cost).max(0.0);
    }
}

/// The bytes that it takes to keep a shape beside its record, and to tell all of it and then that it is gone.
const KEPT_BYTES: usize = 256;

/// Returns what a shape takes to keep and to send, bytes.
pub(super) fn kept_len(shape: &ShapeRecord) -> usize {
    KEPT_BYTES + encoded_len(shape)
}

/// The shapes that one client has brought, that nobody knew before, and that are not forgotten yet.
#[derive(Clone, Debug, Default)]
pub(super) struct Brought {
    /// The bytes that each takes.
    shapes: BTreeMap<ShapeHash, usize>,
    bytes: usize,
}

impl Brought {
    /// Returns how many bytes they take with these, of which it may have brought some already.
    pub(super) fn bytes_with(&self, new: &[ShapeRecord]) -> usize {
        let new = new.iter().filter(|shape| !self.shapes.contains_key(&shape.hash()));
        self.bytes.saturating_add(new.map(kept_len).sum())
    }

    /// Counts these.
    pub(super) fn add(&mut self, new: &[ShapeRecord]) {
        for shape in new {
            let bytes = kept_len(shape);
            self.bytes += bytes - self.shapes.insert(shape.hash(), bytes).unwrap_or(0);
        }
    }

    /// Counts those no more that are forgotten.
    pub(super) fn forget(&mut self, gone: &BTreeSet<ShapeHash>) {
        // Of all who ever brought one.
        if self.shapes.len() < gone.len() {
            self.shapes.retain(|hash, _| !gone.contains(hash));
            self.bytes = self.shapes.values().sum();
        } else {
            self.bytes -= gone.iter().filter_map(|hash| self.shapes.remove(hash)).sum::<usize>();
        }
    }
}

/// What one client may build, and has asked for.
#[derive(Clone, Debug, Default)]
pub(super) struct Building {
    /// Its certificate says so.
    pub may: bool,
    pub changes: Account,
    pub misuses: Account,
    pub shapes: Brought,
    /// The sizes of bodies that it has built, computed once; some may be gone.
    pub sizes: BTreeMap<BodyId, Size>,
    /// The indices of the next body and the next joint, as far as this server knows.
    pub next: (u32, u32),
}

/// What one client has asked of a server, over all of its visits.
#[derive(Clone, Debug, Default)]
pub(super) struct Allowance {
    pub shapes: Brought,
    /// Bytes of shapes of avatars.
    told: Account,
    /// Avatars and welcomes.
    asked: Account,
    /// Whether it may build, and what it has asked and done for that.
    pub building: Building,
}

impl Allowance {
    /// Counts an avatar to be brought. Returns whether the client may bring it.
    pub(super) fn spawn(&mut self, now: Duration) -> bool {
        self.ask(now, 1.0)
    }

    /// Counts shapes that nobody knew, which come with an avatar. Returns whether the client may bring them.
    pub(super) fn bring(&mut self, now: Duration, new: &[ShapeRecord]) -> bool {
        let bytes: usize = new.iter().map(kept_len).sum();
        self.told.ask(now, bytes as f64, MAX_SHAPE_BYTES as f64, SHAPE_BYTES_PER_S)
    }

    /// Counts a search of the world. Returns whether the client may have it.
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

/// Returns why this avatar may not come beside those that its client has, if its cost is too high. Its shapes are on record or in
/// `brought`, and suit clients.
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

/// Returns whether a client's character may walk so: it looks around no farther than it must, and climbs no walls.
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

/// What a body costs those who hold it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    pub corners: usize,
    /// Colliders, or parts of those that are compounds.
    pub colliders: usize,
    /// From the body's origin, with what its colliders keep between them and others, and how far it looks ahead.
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

/// Returns a box in the world around all colliders of a body, if it has any: what Rapier compares first.
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

/// Returns how far around a collider its body looks.
pub(super) fn margin_m(traits: &BodyTraits, collider: &ColliderRecord) -> f32 {
    collider.contact_skin_m + traits.soft_ccd_m.max(0.0)
}

/// Returns the shapes of a body, parts of compounds in their stead: each with its collider, and where it is on the body.
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
