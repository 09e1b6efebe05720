//! Checks values from strangers beyond their format: finite numbers, unit quaternions, indices in range, ids
//! that agree. This file has bodies, joints, shapes and border messages; `messages` has the rest.
//!
//! "Parse, don't validate": [`decode`](super::decode) never returns a message that fails [`Check`].

mod messages;

use super::*;
use crate::space::{Epoch, Tick};

/// The greatest distance from the origin at which anything in a world can be, metres.
pub const WORLD_REACH_M: f64 = 1e9;

/// The largest extent of a shape and of a path in a client's query, metres. With larger numbers Parry's
/// searches do not end, or abort the process.
pub const SHAPE_REACH_M: f32 = 1e6;

/// The least thickness of a shape, metres, for the same reason.
pub const SHAPE_LEAST_M: f32 = 1e-4;

/// The most rounds per tick.
pub const MAX_ROUNDS: u32 = 64;

/// The most ticks for which members run on without hearing from one another.
pub const MAX_LAG: u32 = 60;

/// The most ticks between two states of a body that clients are told.
pub const MAX_STATE_TICKS: u32 = 30;

/// The greatest depth of an overlap, in contact hops.
pub const MAX_DEPTH: u32 = 16;

/// The most colliders of one body.
pub const MAX_COLLIDERS: usize = 4_096;

/// The most bytes of a program's message.
pub const PROGRAM_MESSAGE_BYTES: usize = 32 << 10;

/// The most bytes of a program's datagram. With its envelope it fits a datagram of the network.
pub const PROGRAM_DATAGRAM_BYTES: usize = 1_024;

/// The newest tick: four million years at 60 ticks per second. Counting on from it does not overflow.
const MAX_TICK: u64 = 1 << 53;

/// The newest view, for the same reason: the epochs of bodies that are placed in it must leave room for their
/// transfers.
const MAX_VIEW: u64 = 1 << 38;

/// A broken rule of the protocol: the field, and the rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field} must be {rule}")]
pub struct Invalid {
    /// The field.
    pub field: &'static str,
    /// The rule: what the field must be.
    pub rule: &'static str,
}

/// A value that can be checked against the rules of the protocol.
pub trait Check {
    /// Returns the first rule that is broken, as an error.
    fn check(&self) -> Result<(), Invalid>;
}

fn must(holds: bool, field: &'static str, rule: &'static str) -> Result<(), Invalid> {
    if holds { Ok(()) } else { Err(Invalid { field, rule }) }
}

fn finite(values: &[f32], field: &'static str) -> Result<(), Invalid> {
    must(values.iter().all(|v| v.is_finite()), field, "finite")
}

fn not_negative(values: &[f32], field: &'static str) -> Result<(), Invalid> {
    must(values.iter().all(|v| v.is_finite() && *v >= 0.0), field, "finite and not negative")
}

fn within_reach(values: &[f32], field: &'static str) -> Result<(), Invalid> {
    must(values.iter().all(|v| v.abs() <= SHAPE_REACH_M), field, "finite and within 1e6 m")
}

fn size(values: &[f32], field: &'static str) -> Result<(), Invalid> {
    must(values.iter().all(|v| (SHAPE_LEAST_M..=SHAPE_REACH_M).contains(v)), field, "from 1e-4 to 1e6 m")
}

/// Checks limits, which may be infinite but never NaN.
fn numbers(values: &[f32], field: &'static str) -> Result<(), Invalid> {
    must(values.iter().all(|v| !v.is_nan()), field, "numbers")
}

fn unit(rotation: &[f32; 4], field: &'static str) -> Result<(), Invalid> {
    let norm2: f32 = rotation.iter().map(|v| v * v).sum();
    must((norm2 - 1.0).abs() < 2e-3, field, "a unit quaternion")
}

fn all<T: Check>(values: &[T]) -> Result<(), Invalid> {
    values.iter().try_for_each(Check::check)
}

fn ascending<T, K: Ord>(values: &[T], key: impl Fn(&T) -> K, field: &'static str) -> Result<(), Invalid> {
    must(values.windows(2).all(|pair| key(&pair[0]) < key(&pair[1])), field, "in ascending order, each once")
}

impl Check for Tick {
    fn check(&self) -> Result<(), Invalid> {
        must(self.0 <= MAX_TICK, "tick", "at most 2^53")
    }
}

impl Check for ViewNumber {
    fn check(&self) -> Result<(), Invalid> {
        must(self.0 <= MAX_VIEW, "view", "at most 2^38")
    }
}

impl Check for Epoch {
    fn check(&self) -> Result<(), Invalid> {
        must(*self <= Epoch::placed_in(2 * MAX_VIEW), "epoch", "at most that of view 2^39")
    }
}

impl Check for WorldPose {
    fn check(&self) -> Result<(), Invalid> {
        must(
            self.translation.iter().all(|v| v.abs() <= WORLD_REACH_M),
            "pose.translation",
            "finite and within 1e9 m",
        )?;
        unit(&self.rotation, "pose.rotation")
    }
}

impl Check for Pose {
    fn check(&self) -> Result<(), Invalid> {
        within_reach(&self.translation, "local pose.translation")?;
        unit(&self.rotation, "local pose.rotation")
    }
}

impl Check for Velocity {
    fn check(&self) -> Result<(), Invalid> {
        must(self.is_finite(), "velocity", "finite")
    }
}

impl Check for BodyState {
    fn check(&self) -> Result<(), Invalid> {
        self.pose.check()?;
        self.velocity.check()?;
        finite(&self.force, "force")?;
        finite(&self.torque, "torque")?;
        numbers(&[self.still_s], "still_s")?;
        self.drive.as_ref().map_or(Ok(()), Check::check)?;
        self.gait.as_ref().map_or(Ok(()), Check::check)?;
        self.contact_offset.as_ref().map_or(Ok(()), Check::check)
    }
}

impl Check for ContactOffset {
    fn check(&self) -> Result<(), Invalid> {
        let length = |v: [f32; 3]| v.iter().map(|v| v * v).sum::<f32>().sqrt();
        must(length(self.moved_m) <= Self::FARTHEST_M, "contact_offset.moved_m", "at most 0.5 m long")?;
        must(
            length(self.turned) <= Self::MOST_TURNED,
            "contact_offset.turned",
            "a quarter of a radian at most",
        )
    }
}

impl Check for Drive {
    fn check(&self) -> Result<(), Invalid> {
        self.fault().map_or(Ok(()), |(field, rule)| must(false, field, rule))
    }
}

impl Check for Gait {
    fn check(&self) -> Result<(), Invalid> {
        finite(&self.wanted, "gait.wanted")?;
        finite(&[self.rise_m_s], "gait.rise_m_s")
    }
}

impl Check for SharedState {
    fn check(&self) -> Result<(), Invalid> {
        self.epoch.check()?;
        self.pose.check()?;
        self.velocity.check()
    }
}

impl Check for MassRecord {
    fn check(&self) -> Result<(), Invalid> {
        finite(&self.local_com, "mass.local_com")?;
        not_negative(&[self.inv_mass], "mass.inv_mass")?;
        not_negative(&self.inv_principal_inertia, "mass.inv_principal_inertia")?;
        unit(&self.principal_frame, "mass.principal_frame")
    }
}

impl Check for ColliderRecord {
    fn check(&self) -> Result<(), Invalid> {
        self.pose.check()?;
        match &self.mass {
            ColliderMass::Density(value) | ColliderMass::Mass(value) => {
                not_negative(&[*value], "collider.mass")?
            }
            ColliderMass::Properties(record) => record.check()?,
        }
        not_negative(&[self.friction], "collider.friction")?;
        not_negative(&[self.restitution], "collider.restitution")?;
        numbers(&[self.force_event_threshold_n], "collider.force_event_threshold_n")?;
        not_negative(&[self.contact_skin_m], "collider.contact_skin_m")
    }
}

impl Check for BodyTraits {
    fn check(&self) -> Result<(), Invalid> {
        finite(&[self.linear_damping, self.angular_damping], "damping")?;
        finite(&[self.gravity_scale, self.soft_ccd_m], "gravity_scale, soft_ccd_m")?;
        numbers(&[self.sleep_linear_threshold, self.sleep_angular_threshold, self.sleep_after_s], "sleep")?;
        match &self.extra_mass {
            Some(ExtraMass::Mass(value)) => not_negative(&[*value], "extra_mass")?,
            Some(ExtraMass::Properties(record)) => record.check()?,
            None => {}
        }
        // Solvers loop this often, and a stranger must not stall a region with one body.
        must(self.extra_solver_iterations <= 1_000, "extra_solver_iterations", "at most 1000")?;
        must(self.extra_pgs_iterations <= 1_000, "extra_pgs_iterations", "at most 1000")?;
        must(self.colliders.len() <= MAX_COLLIDERS, "colliders", "at most 4096")?;
        if let Some(character) = &self.character {
            character.fault().map_or(Ok(()), |(field, rule)| must(false, field, rule))?;
            let walks = self.kind == BodyKind::KinematicVelocity;
            must(walks, "kind of a character", "kinematic by velocity")?;
            let shaped = self.colliders.iter().any(|collider| !collider.sensor);
            must(shaped, "colliders of a character", "one or more that are no sensors")?;
        }
        if let Some(vehicle) = &self.vehicle {
            vehicle.fault().map_or(Ok(()), |(field, rule)| must(false, field, rule))?;
            must(self.kind == BodyKind::Dynamic, "kind of a vehicle", "dynamic")?;
        }
        all(&self.colliders)
    }
}

impl Check for BodyRecord {
    fn check(&self) -> Result<(), Invalid> {
        self.epoch.check()?;
        self.state.check()?;
        let walks = self.traits.character.is_some();
        must(self.state.gait.is_some() == walks, "gait", "that of a character, and no other body's")?;
        let drives = self.traits.vehicle.is_some();
        must(self.state.drive.is_some() == drives, "drive", "that of a vehicle, and no other body's")?;
        self.traits.check()
    }
}

impl Check for Placed {
    fn check(&self) -> Result<(), Invalid> {
        self.body.check()
    }
}

impl Check for BodyCheckpoint {
    fn check(&self) -> Result<(), Invalid> {
        self.epoch.check()?;
        self.state.check()
    }
}

impl Check for JointRecord {
    fn check(&self) -> Result<(), Invalid> {
        must(self.a != self.b, "joint.a, joint.b", "two different bodies")?;
        self.frame_a.check()?;
        self.frame_b.check()?;
        for limit in &self.limits {
            numbers(&[limit.min, limit.max], "joint.limit")?;
            finite(&[limit.impulse], "joint.limit.impulse")?;
        }
        for motor in &self.motors {
            finite(&[motor.target_vel, motor.target_pos, motor.impulse], "joint.motor")?;
            numbers(&[motor.stiffness, motor.damping, motor.max_force], "joint.motor")?;
        }
        numbers(&self.softness, "joint.softness")?;
        let Some(link) = &self.link else { return Ok(()) };
        must(
            (self.locked_axes >> 3 & 7).count_ones() != 1,
            "joint.link",
            "no joint that turns about two axes",
        )?;
        finite(&link.damping.unwrap_or_default(), "joint.link.damping")?;
        finite(&link.armature, "joint.link.armature")?;
        finite(&link.friction, "joint.link.friction")?;
        finite(link.springs.as_flattened(), "joint.link.springs")?;
        let Some(motion) = &link.motion else { return Ok(()) };
        finite(&motion.coordinates, "joint.link.motion")?;
        finite(&motion.rotation, "joint.link.motion")?;
        finite(&motion.velocity, "joint.link.motion")?;
        finite(&motion.root_velocity, "joint.link.motion")
    }
}

impl Check for ShapeRecord {
    fn check(&self) -> Result<(), Invalid> {
        let points = |points: &[[f32; 3]], field| within_reach(points.as_flattened(), field);
        let indices = |ids: &[u32], len: usize, field| {
            must(ids.iter().all(|&i| (i as usize) < len), field, "indices of the shape's own vertices")
        };
        match self {
            Self::Ball(radius) => size(&[*radius], "ball"),
            Self::Cuboid(half) => size(half, "cuboid"),
            Self::Capsule(a, b, radius) => {
                points(&[*a, *b], "capsule")?;
                size(&[*radius], "capsule")
            }
            Self::Cylinder(a, b) | Self::Cone(a, b) => size(&[*a, *b], "cylinder or cone"),
            Self::Segment(ends) => points(ends, "segment"),
            Self::Triangle(corners) => points(corners, "triangle"),
            Self::HalfSpace(normal) => {
                let norm2: f32 = normal.iter().map(|v| v * v).sum();
                must((norm2 - 1.0).abs() < 2e-3, "half-space.normal", "of unit length")
            }
            Self::ConvexPolyhedron(vertices, triangles) | Self::TriMesh(vertices, triangles, _) => {
                must(!vertices.is_empty() && !triangles.is_empty(), "mesh", "not empty")?;
                points(vertices, "mesh.vertices")?;
                indices(triangles.as_flattened(), vertices.len(), "mesh.triangles")
            }
            Self::Polyline(vertices, edges) => {
                must(!vertices.is_empty() && !edges.is_empty(), "polyline", "not empty")?;
                points(vertices, "polyline.vertices")?;
                indices(edges.as_flattened(), vertices.len(), "polyline.edges")
            }
            Self::HeightField(heights, rows, columns, scale, _, cells) => {
                within_reach(heights, "height field.heights")?;
                size(scale, "height field.scale")?;
                must(*rows >= 2 && *columns >= 2, "height field", "at least 2 × 2")?;
                let count = u64::from(*rows) * u64::from(*columns);
                must(heights.len() as u64 == count, "height field.heights", "rows × columns")?;
                let count = u64::from(rows - 1) * u64::from(columns - 1);
                let fits = cells.is_empty() || cells.len() as u64 == count;
                must(fits, "height field.cells", "none or (rows - 1) × (columns - 1)")
            }
            Self::RoundCuboid(half, border) => {
                size(half, "round cuboid")?;
                size(&[*border], "round cuboid")
            }
            Self::RoundCylinder(a, b, border) | Self::RoundCone(a, b, border) => {
                size(&[*a, *b, *border], "round cylinder or cone")
            }
            Self::RoundTriangle(corners, border) => {
                points(corners, "round triangle")?;
                size(&[*border], "round triangle")
            }
            Self::RoundConvexPolyhedron(vertices, triangles, border) => {
                must(!vertices.is_empty() && !triangles.is_empty(), "round hull", "not empty")?;
                points(vertices, "round hull.vertices")?;
                indices(triangles.as_flattened(), vertices.len(), "round hull.triangles")?;
                size(&[*border], "round hull")
            }
            Self::Voxels(edges, voxels) => {
                size(edges, "voxels.size")?;
                must(
                    shape::voxels_fit(voxels),
                    "voxels",
                    "some, ascending, within 2^20 and in at most 2^16 blocks",
                )
            }
            Self::Compound(parts) => {
                must(!parts.is_empty(), "compound", "not empty")?;
                parts.iter().try_for_each(|(pose, _)| pose.check())
            }
        }
    }
}

impl Check for CopyState {
    fn check(&self) -> Result<(), Invalid> {
        self.pose.check()?;
        self.velocity.check()?;
        numbers(&[self.still_s], "copy.still_s")?;
        finite(&self.force_n, "copy.force_n")?;
        finite(&self.torque_nm, "copy.torque_nm")
    }
}

impl Check for Strike {
    fn check(&self) -> Result<(), Invalid> {
        must(self.by != Some(self.id), "strike.by", "another body")?;
        finite(&self.impulse.linear, "strike.linear")?;
        finite(&self.impulse.angular, "strike.angular")
    }
}

impl Check for Membership {
    fn check(&self) -> Result<(), Invalid> {
        self.epoch.check()?;
        let owner = usize::from(self.owner);
        must(self.holders.contains(owner), "member.holders", "a set with the owner in it")?;
        must(!self.warming.contains(owner), "member.warming", "a set without the owner in it")
    }
}

impl Check for NearbyBodies {
    fn check(&self) -> Result<(), Invalid> {
        let boxes = self.bodies.iter().map(|nearby| &nearby.bounds).chain(&self.extent);
        let mut corners = boxes.flat_map(|bounds| bounds.min.iter().chain(&bounds.max));
        must(corners.all(|v| !v.is_nan()), "nearby.bounds", "numbers")?;
        self.bodies.iter().try_for_each(|nearby| finite(&nearby.velocity, "nearby.velocity"))?;
        must(self.bodies.iter().all(|nearby| nearby.radius_m >= 0.0), "nearby.radius_m", "at least 0")?;
        ascending(&self.bodies, |nearby| nearby.id, "nearby.bodies")
    }
}

impl Check for BorderMessage {
    fn check(&self) -> Result<(), Invalid> {
        self.tick.check()?;
        ascending(&self.copies, |copy| copy.id, "border.copies")?;
        all(&self.copies)?;
        all(&self.strikes)?;
        all(&self.members)?;
        self.nearby.iter().try_for_each(Check::check)?;
        must(self.steps <= 64, "border.steps", "at most 64")?;
        ascending(&self.states, |state| state.id, "border.states")?;
        all(&self.states)?;
        self.ghosts.iter().try_for_each(Check::check)?;
        ascending(&self.contact_poses, |lay| lay.id, "border.contact_poses")?;
        self.contact_poses.iter().try_for_each(|lay| lay.pose.check())?;
        all(&self.joints)?;
        self.transfers.iter().try_for_each(|transfer| transfer.body.check())
    }
}

impl Check for RegionEvents {
    fn check(&self) -> Result<(), Invalid> {
        all(&self.touches)?;
        all(&self.forces)
    }
}

impl Check for Touch {
    fn check(&self) -> Result<(), Invalid> {
        must(self.point.iter().all(|v| v.is_finite()), "touch.point", "finite")?;
        finite(&self.normal, "touch.normal")?;
        finite(&[self.speed], "touch.speed")
    }
}

impl Check for ContactForce {
    fn check(&self) -> Result<(), Invalid> {
        finite(&self.force_n, "force.force_n")?;
        finite(&[self.magnitude_n, self.threshold_n], "force.magnitude_n")
    }
}
