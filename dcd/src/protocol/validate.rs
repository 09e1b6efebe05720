//! Checks values from strangers beyond their format: finite numbers, unit quaternions, indices in range, ids that agree.
//! "Parse, don't validate": [`decode`](super::decode) never returns a message that fails [`Check`].

use super::*;
use crate::space::{Allocation, Balance, Bounds, DistributionTree, MAX_REGIONS};

/// The farthest distance from the origin at which anything of a world can be, in metres.
pub const WORLD_REACH_M: f64 = 1e9;

/// The largest extent of a shape and of a path in a client's query, in metres: with larger numbers Parry's searches do not end,
/// or abort the process.
pub const SHAPE_REACH_M: f32 = 1e6;

/// The least thickness of a shape, in metres, for the same reason.
pub const SHAPE_LEAST_M: f32 = 1e-4;

/// The most rounds per tick.
pub const MAX_ROUNDS: u32 = 64;

/// The most ticks that members run on without hearing from one another.
pub const MAX_LAG: u32 = 60;

/// The most contact hops of an overlap's depth.
pub const MAX_DEPTH: u32 = 16;

/// The most colliders of one body.
pub const MAX_COLLIDERS: usize = 4_096;

/// The most bytes of a program's message.
pub const PROGRAM_MESSAGE_BYTES: usize = 32 << 10;

/// The most bytes of a program's datagram: with its envelope it fits one of the transport's.
pub const PROGRAM_DATAGRAM_BYTES: usize = 1_024;

/// A broken rule of the protocol: the field, and the rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{field} must be {rule}")]
pub struct Invalid {
    /// Which field.
    pub field: &'static str,
    /// What it must be.
    pub rule: &'static str,
}

/// Checks whether a value keeps the rules of the protocol.
pub trait Check {
    /// Returns the first broken rule as an error.
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

/// Limits may be infinite, but never NaN.
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
        self.gait.as_ref().map_or(Ok(()), Check::check)
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
        // Solvers loop this often: a stranger must not stall a region with one body.
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
        finite(&self.force_n, "copy.force_n")?;
        finite(&self.torque_nm, "copy.torque_nm")
    }
}

impl Check for Membership {
    fn check(&self) -> Result<(), Invalid> {
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
        ascending(&self.bodies, |nearby| nearby.id, "nearby.bodies")
    }
}

impl Check for BorderMessage {
    fn check(&self) -> Result<(), Invalid> {
        ascending(&self.copies, |copy| copy.id, "border.copies")?;
        all(&self.copies)?;
        all(&self.members)?;
        self.nearby.iter().try_for_each(Check::check)?;
        must(self.steps <= 64, "border.steps", "at most 64")?;
        ascending(&self.states, |state| state.id, "border.states")?;
        all(&self.states)?;
        self.replicas.iter().try_for_each(Check::check)?;
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

impl Check for EnvironmentProperties {
    fn check(&self) -> Result<(), Invalid> {
        if let Some((what, _, range)) = self.step.fault() {
            must(false, what, range)?;
        }
        must(self.halo_m.is_none_or(|v| v.is_finite() && v >= 0.0), "world.halo_m", "finite, not negative")?;
        not_negative(&[self.avatar_speed_limit], "world.avatar_speed_limit")?;
        self.thresholds.check()?;
        if let Some((what, _, range)) = self.balance.as_ref().and_then(Balance::fault) {
            must(false, what, range)?;
        }
        must(self.protocol.lag_ticks() <= u64::from(MAX_LAG), "world.lag_ticks", "at most 60")?;
        let Bounds { min, max } = self.tree.bounds();
        must(min.iter().chain(&max).all(|v| v.abs() <= WORLD_REACH_M), "world.bounds", "within 1e9 m")?;
        must(self.tree.is_sound(), "world.tree", "connected, cut inside its cells and within its limits")
    }
}

impl Check for Thresholds {
    fn check(&self) -> Result<(), Invalid> {
        not_negative(&[self.dead_reckoning_m, self.between_groups_m], "thresholds")?;
        let Some(delay) = self.delay else { return Ok(()) };
        not_negative(&[delay.inclusion_ms, delay.rejection_ms, delay.deviation_ms], "thresholds.delay")?;
        must(
            0.0 < delay.inclusion_ms && delay.inclusion_ms < delay.rejection_ms,
            "thresholds.inclusion_ms",
            "positive and below rejection_ms",
        )
    }
}

impl Check for View {
    fn check(&self) -> Result<(), Invalid> {
        ascending(&self.members, |member| member.node, "view.members")?;
        let is_member = |node| self.members.iter().any(|member| member.node == node);
        must(is_member(self.leader), "view.leader", "a member")?;
        must(self.allocation.values().all(|&node| is_member(node)), "view.allocation", "to members")?;
        suits(&self.allocation, &self.tree)
    }
}

/// Checks a tree, and that its regions are allocated.
fn suits(allocation: &Allocation, tree: &DistributionTree) -> Result<(), Invalid> {
    must(tree.is_sound(), "tree", "connected, cut inside its cells and within its limits")?;
    must(allocation.keys().copied().eq(tree.leaves()), "allocation", "of the tree's regions")
}

impl Check for LoadReport {
    fn check(&self) -> Result<(), Invalid> {
        let fine = |v: f64| v.is_finite() && v >= 0.0;
        ascending(&self.regions, |region| region.region, "load.regions")?;
        must(self.regions.len() <= MAX_REGIONS, "load.regions", "at most 256")?;
        must(self.regions.iter().all(|r| fine(r.activity) && fine(r.step_us)), "load", "0 or more")?;
        for burden in &self.burdens {
            must(burden.place.iter().all(|v| v.is_finite()), "load.place", "finite")?;
            must(fine(burden.weight), "load.weight", "0 or more")?;
            must(burden.island.is_none_or(|i| i < self.islands.len()), "load.island", "one of its islands")?;
        }
        must(self.islands.iter().all(Bounds::is_finite), "load.islands", "finite boxes")
    }
}

impl Check for Chunk {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Shapes(shapes) => all(shapes),
            Self::Bodies(bodies) => all(bodies),
            Self::Placed(bodies) => all(bodies),
            Self::Joints(joints) => all(joints),
        }
    }
}

impl Check for Input {
    fn check(&self) -> Result<(), Invalid> {
        self.velocity.check()?;
        self.drive.as_ref().map_or(Ok(()), Check::check)?;
        self.pose.map_or(Ok(()), |pose| pose.check())
    }
}

impl Check for WorldOp {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Insert { bodies, shapes, joints } => {
                all(bodies)?;
                all(shapes)?;
                all(joints)
            }
            // Who applies it checks it against the tree.
            Self::Remove(_) | Self::RemoveJoint(_) | Self::Repartition(_) => Ok(()),
            Self::Input(input) => input.check(),
            Self::Push(push) => push.check(),
            Self::Alter(alteration) => alteration.check(),
            Self::Correct { states, .. } => all(states),
            Self::Ask { question, .. } => question.check(),
        }
    }
}

impl Check for Push {
    fn check(&self) -> Result<(), Invalid> {
        finite(&self.linear, "push.linear")?;
        finite(&self.angular, "push.angular")?;
        must(self.point.is_none_or(|point| point.iter().all(|v| v.is_finite())), "push.point", "finite")
    }
}

impl Check for Query {
    fn check(&self) -> Result<(), Invalid> {
        must(self.cost() <= MAX_COST, "query", "of 1024 rays, or what costs as much")?;
        must(self.fits(), "query", "short enough for a client's frame")?;
        must(self.filter.exclude.len() <= MAX_COST, "query.exclude", "at most 1024")?;
        ascending(&self.filter.exclude, |&body| body, "query.exclude")?;
        must(
            self.shapes.iter().all(ShapeRecord::suits_clients),
            "query.shapes",
            "neither meshes, terrain, voxels nor half-spaces",
        )?;
        all(&self.shapes)?;
        match &self.parts {
            QueryParts::Rays(rays) => all(rays),
            QueryParts::Casts(casts) => {
                let turns = casts.iter().any(|cast| cast.turn != [0.0; 3]);
                let small = self.shapes.iter().all(|shape| shape.largest_m() <= MAX_TURNING_M);
                must(!turns || small, "query.shapes", "within 100 m of their origins where one turns")?;
                all(casts)
            }
            QueryParts::Overlaps(overlaps) => all(overlaps),
        }
    }
}

impl Check for RayQuery {
    fn check(&self) -> Result<(), Invalid> {
        must(self.origin.iter().all(|v| v.is_finite()), "ray.origin", "finite")?;
        finite(&self.direction, "ray.direction")?;
        must(self.direction != [0.0; 3], "ray.direction", "longer than 0")?;
        must(self.max_m >= 0.0, "ray.max_m", "0 or more")
    }
}

impl Check for CastQuery {
    fn check(&self) -> Result<(), Invalid> {
        self.pose.check()?;
        within_reach(&self.motion, "cast.motion")?;
        let turn2: f32 = self.turn.iter().map(|v| v * v).sum();
        must(turn2 <= MAX_TURN * MAX_TURN, "cast.turn", "at most 64 radians")?;
        must((0.0..=SHAPE_REACH_M).contains(&self.margin_m), "cast.margin_m", "from 0 to 1e6 m")?;
        let is_plain = self.margin_m == 0.0 && !self.leaves;
        must(turn2 == 0.0 || is_plain, "cast.turn", "0 with a margin, or if it leaves what it starts in")
    }
}

impl Check for OverlapQuery {
    fn check(&self) -> Result<(), Invalid> {
        match &self.place {
            Place::Shape(_, pose) => pose.check(),
            Place::Point(point) => must(point.iter().all(|v| v.is_finite()), "overlap.point", "finite"),
            Place::Box(bounds) => {
                let in_order = (0..3).all(|i| bounds.min[i] <= bounds.max[i]);
                must(in_order, "overlap.box", "of corners in order")
            }
        }
    }
}

impl Check for RayAnswer {
    fn check(&self) -> Result<(), Invalid> {
        must(self.point.iter().all(|v| v.is_finite()), "answer.point", "finite")?;
        finite(&self.normal, "answer.normal")?;
        must(self.distance_m >= 0.0, "answer.distance_m", "0 or more")
    }
}

impl Check for CastAnswer {
    fn check(&self) -> Result<(), Invalid> {
        must(self.point.iter().all(|v| v.is_finite()), "answer.point", "finite")?;
        finite(&self.normal, "answer.normal")?;
        finite(&self.point_on_shape, "answer.point_on_shape")?;
        finite(&self.normal_on_shape, "answer.normal_on_shape")?;
        must((0.0..=1.0).contains(&self.fraction), "answer.fraction", "from 0 to 1")
    }
}

impl Check for QueryResult {
    fn check(&self) -> Result<(), Invalid> {
        let few = |count| must(count <= MAX_COST, "answer", "to at most 1024");
        match self {
            Self::Rays(hits) => {
                few(hits.len())?;
                hits.iter().flatten().try_for_each(Check::check)
            }
            Self::Casts(hits) => {
                few(hits.len())?;
                hits.iter().flatten().try_for_each(Check::check)
            }
            Self::Overlaps(lists) => {
                few(lists.len())?;
                must(lists.iter().map(Vec::len).sum::<usize>() <= MAX_FOUND, "answer", "of at most 4096")?;
                lists.iter().try_for_each(|list| ascending(list, |&found| found, "answer"))
            }
            Self::TooMuch => Ok(()),
        }
    }
}

impl Check for Dispatch {
    fn check(&self) -> Result<(), Invalid> {
        must((1..=MAX_ROUNDS).contains(&self.rounds), "dispatch.rounds", "1 to 64")?;
        all(&self.ops)
    }
}

impl Check for Done {
    fn check(&self) -> Result<(), Invalid> {
        must((1..=MAX_ROUNDS).contains(&self.rounds_wanted), "done.rounds_wanted", "1 to 64")?;
        self.answers.iter().try_for_each(|answer| answer.found.check())?;
        self.load.as_ref().map_or(Ok(()), Check::check)?;
        all(&self.events)
    }
}

impl Check for ToNode {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Welcome { world, .. } => world.check(),
            Self::Chunk(chunk) => chunk.check(),
            Self::Finish { dispatches, .. } => all(dispatches),
            Self::Adopt { view, .. } => view.check(),
            Self::Apply { ops, .. } => all(ops),
            Self::Ask { question, .. } => question.check(),
            Self::Roster(members) => ascending(members, |member| member.node, "roster"),
            Self::InterGroup { states, .. } => all(states),
            Self::Authority { stances, .. } => ascending(stances, |stance| stance.body, "stances"),
            Self::WorldEnd
            | Self::Settle { .. }
            | Self::Fetch { .. }
            | Self::Poll { .. }
            | Self::Shutdown { .. } => Ok(()),
        }
    }
}

impl Check for ToServer {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Settling { dispatches, .. } => all(dispatches),
            Self::Survey { claims, division, .. } => {
                ascending(claims, |claim| claim.id, "survey.claims")?;
                division.iter().try_for_each(|(tree, allocation)| suits(allocation, tree))
            }
            Self::Repartitioned { tree, allocation, .. } => suits(allocation, tree),
            Self::Found { bodies, .. } | Self::Removed { bodies, .. } => all(bodies),
            Self::Checkpoint { bodies, .. } => all(bodies),
            Self::Answer { found, .. } => found.check(),
            Self::Contacts { events, .. } => {
                all(&events.touches)?;
                all(&events.forces)
            }
            Self::Delays(delays) => {
                ascending(delays, |delay| delay.node, "delays")?;
                delays.iter().try_for_each(|delay| not_negative(delay.delay_ms.as_slice(), "delay_ms"))
            }
            Self::Ballot { delay_ms, .. } => not_negative(delay_ms.as_slice(), "ballot.delay_ms"),
            Self::InterGroup { states, .. } => all(states),
            Self::Touched { bodies, .. } => ascending(bodies, |&(body, _)| body, "touched"),
            Self::Loaded | Self::LinkLost { .. } | Self::Call(_) | Self::Leave => Ok(()),
        }
    }
}

impl Check for FromClient {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Input(input) => input.check(),
            Self::Spawn { body, shapes } => {
                body.check()?;
                all(shapes)
            }
            Self::Ask(question) => question.check(),
            Self::Interest(area) => area.map_or(Ok(()), |area| area.check()),
            Self::Introduce(ids) => {
                must(ids.len() <= MAX_INTRODUCED, "introduce", "at most 1,024 bodies at once")
            }
            Self::Heard(heard) => {
                must(heard.datagrams.len() <= MAX_HEARD, "heard", "at most 64 runs of datagrams at once")
            }
            Self::Despawn(_) | Self::Leave => Ok(()),
        }
    }
}

impl Check for Area {
    fn check(&self) -> Result<(), Invalid> {
        let is_there = self.centre.iter().all(|v| v.abs() <= WORLD_REACH_M);
        must(is_there, "interest.centre", "within a million kilometres")?;
        let is_size = self.radius_m > 0.0 && self.radius_m <= WORLD_REACH_M;
        must(is_size, "interest.radius_m", "above 0 and at most a million kilometres")
    }
}

impl Check for ToClient {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Welcome { world, .. } => world.check(),
            Self::Chunk(chunk) => chunk.check(),
            Self::Inserted { body, shapes, joints } => {
                body.check()?;
                all(shapes)?;
                all(joints)
            }
            Self::Altered(alteration) => alteration.check(),
            Self::States { states, .. } => all(states),
            // Unpacked, and checked, by who takes them in.
            Self::CompactStates { .. } => Ok(()),
            Self::Answer { found, .. } => found.check(),
            Self::Contacts { touches, forces, .. } => {
                all(touches)?;
                all(forces)
            }
            Self::LeaderIs { tree: Some(tree), allocation, .. } | Self::Regions { tree, allocation } => {
                suits(allocation, tree)
            }
            Self::WorldEnd | Self::LeaderIs { .. } | Self::Removed(_) | Self::Rejected { .. } => Ok(()),
        }
    }
}

impl Check for Program {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::Message(bytes) => {
                must(bytes.len() <= PROGRAM_MESSAGE_BYTES, "program.message", "32 KiB at most")
            }
            Self::Datagram(bytes) => {
                must(bytes.len() <= PROGRAM_DATAGRAM_BYTES, "program.datagram", "1 KiB at most")
            }
            Self::Taken(_) => Ok(()),
        }
    }
}

impl Check for Message {
    fn check(&self) -> Result<(), Invalid> {
        match self {
            Self::ToNode(message) => message.check(),
            Self::ToServer(message) => message.check(),
            Self::Dispatch(dispatch) => dispatch.check(),
            Self::Done(done) => done.check(),
            Self::Report(report) => all(&report.states),
            Self::Border(border) => all(&border.messages),
            Self::FromClient(client, message) => {
                must(client.0 != 0, "client", "a client's id, from 1")?;
                message.check()
            }
            Self::ToClient(_, message) => message.check(),
            Self::Program(program) => program.check(),
            Self::Hello(_) | Self::Waiting(_) | Self::Ping(_) | Self::Pong(_) => Ok(()),
        }
    }
}
