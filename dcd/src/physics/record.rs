//! Converts bodies and colliders to records and back, with all that a transfer must not lose.

use std::sync::Arc;

use rapier3d::dynamics::RigidBodyAdditionalMassProps;
use rapier3d::geometry::ColliderMassProps;
use rapier3d::prelude::*;

use super::convert::{self, vector};
use super::shapes::{ShapeError, ShapeLibrary};
use crate::protocol::{
    BodyKind, BodyRecord, BodyState, BodyTraits, ColliderMass, ColliderRecord, CombineRule, ExtraMass,
    Groups, MassRecord, ShapeRecord, WorldPose,
};
use crate::space::{BodyId, Bounds, Epoch};

/// The number of latest kinds with which a new body is compared.
pub(super) const LIKE: usize = 4;

impl ShapeLibrary {
    /// Records a body. `pose`, in world space, replaces the body's own position. Adds the body's shapes to
    /// the library. Colliders come as builders, since built colliders no longer tell where their mass is
    /// from.
    pub fn describe(
        &mut self,
        id: BodyId,
        pose: WorldPose,
        body: &RigidBody,
        colliders: &[ColliderBuilder],
    ) -> Result<BodyRecord, ShapeError> {
        // Collecting results would reserve room for four.
        let mut records = Vec::with_capacity(colliders.len());
        for collider in colliders {
            records.push(collider_record(collider, self)?);
        }
        let state = BodyState { pose, ..state_of(body, [0.0; 3]) };
        let traits = self.share(Arc::new(traits_of(body, records)))?;
        Ok(BodyRecord { id, epoch: Epoch(0), state, traits, user_data: body.user_data })
    }

    /// Returns the traits of a new body whose shapes are in the library. A body that is like one of the
    /// latest kinds shares the traits of these.
    pub(crate) fn share(&mut self, traits: Arc<BodyTraits>) -> Result<Arc<BodyTraits>, ShapeError> {
        if self.latest.iter().any(|known| Arc::ptr_eq(known, &traits)) {
            return Ok(traits);
        }
        if let Some(known) = self.latest.iter().find(|known| **known == traits) {
            return Ok(Arc::clone(known));
        }
        if hangs(&traits, self) {
            return Err(ShapeError::Massless);
        }
        if self.latest.len() == LIKE {
            self.latest.remove(0);
        }
        self.latest.push(Arc::clone(&traits));
        Ok(traits)
    }
}

/// Returns whether a dynamic body has colliders without an inside, and no mass from these or anything else.
/// Rapier takes its mass to be infinite.
pub(crate) fn hangs(traits: &BodyTraits, shapes: &ShapeLibrary) -> bool {
    use ShapeRecord::{HalfSpace, HeightField, Polyline, Segment, TriMesh, Triangle};
    let is_hollow = |collider: &ColliderRecord| {
        let shape = shapes.record_of(collider.shape);
        shape.is_some_and(|shape| {
            matches!(
                shape,
                TriMesh(..) | HeightField(..) | Polyline(..) | Segment(..) | Triangle(..) | HalfSpace(..)
            )
        })
    };
    let mass_of = |collider: &ColliderRecord| build_collider(collider, shapes).map_or(0.0, |own| own.mass());
    let mut enabled = traits.colliders.iter().filter(|collider| collider.enabled);
    traits.kind == BodyKind::Dynamic
        && traits.extra_mass.is_none()
        && enabled.clone().any(is_hollow)
        && enabled.all(|collider| mass_of(collider) == 0.0)
}

/// Reads a body's state, which steps change, from Rapier's body.
pub(crate) fn state_of(body: &RigidBody, anchor: [f64; 3]) -> BodyState {
    BodyState {
        pose: convert::world_from_region(anchor, body.position()),
        velocity: convert::velocity_of(body),
        force: body.user_force().to_array(),
        torque: body.user_torque().to_array(),
        sleeping: body.is_sleeping(),
        still_s: body.activation().time_since_can_sleep,
        gait: None,
        drive: None,
        contact_offset: None,
    }
}

/// Reads a body's traits, which steps do not change. The colliders' records are handed in, since Rapier
/// forgets the source of their mass.
pub(crate) fn traits_of(body: &RigidBody, colliders: Vec<ColliderRecord>) -> BodyTraits {
    let activation = body.activation();
    BodyTraits {
        kind: match body.body_type() {
            RigidBodyType::Dynamic | RigidBodyType::SoftFrame => BodyKind::Dynamic,
            RigidBodyType::Fixed => BodyKind::Fixed,
            RigidBodyType::KinematicPositionBased => BodyKind::KinematicPosition,
            RigidBodyType::KinematicVelocityBased => BodyKind::KinematicVelocity,
        },
        enabled: body.is_enabled(),
        linear_damping: body.linear_damping(),
        angular_damping: body.angular_damping(),
        gravity_scale: body.gravity_scale(),
        locked_axes: body.locked_axes().bits(),
        dominance: body.dominance_group(),
        ccd: body.is_ccd_enabled(),
        soft_ccd_m: body.soft_ccd_prediction(),
        fast_rotation: body.is_fast_rotation_allowed(),
        gyroscopic: body.gyroscopic_forces_enabled(),
        extra_solver_iterations: body.additional_solver_iterations() as u32,
        extra_pgs_iterations: body.additional_pgs_iterations() as u32,
        sleep_linear_threshold: activation.normalized_linear_threshold,
        sleep_angular_threshold: activation.angular_threshold,
        sleep_after_s: activation.time_until_sleep,
        extra_mass: body.mass_properties().additional_local_mprops.as_deref().and_then(|extra| match extra {
            RigidBodyAdditionalMassProps::Mass(mass) if *mass == 0.0 => None,
            RigidBodyAdditionalMassProps::MassProps(props) if *props == MassProperties::default() => None,
            RigidBodyAdditionalMassProps::Mass(mass) => Some(ExtraMass::Mass(*mass)),
            RigidBodyAdditionalMassProps::MassProps(props) => Some(ExtraMass::Properties(mass_record(props))),
        }),
        character: None,
        vehicle: None,
        colliders,
    }
}

/// Sets a body's traits where they differ, without waking it.
pub(super) fn set_traits(body: &mut RigidBody, new: &BodyTraits) {
    let old = traits_of(body, Vec::new());
    if old.kind != new.kind {
        body.set_body_type(body_type(new.kind), false);
    }
    if old.enabled != new.enabled {
        body.set_enabled(new.enabled);
    }
    body.set_linear_damping(new.linear_damping);
    body.set_angular_damping(new.angular_damping);
    if old.gravity_scale != new.gravity_scale {
        body.set_gravity_scale(new.gravity_scale, false);
    }
    if old.locked_axes != new.locked_axes {
        body.set_locked_axes(LockedAxes::from_bits_truncate(new.locked_axes), false);
    }
    if old.dominance != new.dominance {
        body.set_dominance_group(new.dominance);
    }
    body.enable_ccd(new.ccd);
    body.set_soft_ccd_prediction(new.soft_ccd_m);
    body.set_allow_fast_rotation(new.fast_rotation);
    body.enable_gyroscopic_forces(new.gyroscopic);
    body.set_additional_solver_iterations(new.extra_solver_iterations as usize);
    body.set_additional_pgs_iterations(new.extra_pgs_iterations as usize);
    let activation = body.activation_mut();
    activation.normalized_linear_threshold = new.sleep_linear_threshold;
    activation.angular_threshold = new.sleep_angular_threshold;
    activation.time_until_sleep = new.sleep_after_s;
    if old.extra_mass != new.extra_mass {
        match &new.extra_mass {
            None => body.set_additional_mass(0.0, false),
            Some(ExtraMass::Mass(mass)) => body.set_additional_mass(*mass, false),
            Some(ExtraMass::Properties(mass)) => {
                body.set_additional_mass_properties(mass_properties(mass), false);
            }
        }
    }
}

/// Builds Rapier's body and colliders, in the space of a region with this origin (anchor).
pub(crate) fn build(
    record: &BodyRecord,
    anchor: [f64; 3],
    shapes: &ShapeLibrary,
) -> Result<(RigidBody, Vec<Collider>), ShapeError> {
    let colliders = record.traits.colliders.iter();
    let colliders = colliders.map(|collider| build_collider(collider, shapes)).collect::<Result<_, _>>()?;
    Ok((build_body(record, anchor), colliders))
}

pub(super) fn body_type(kind: BodyKind) -> RigidBodyType {
    match kind {
        BodyKind::Dynamic => RigidBodyType::Dynamic,
        BodyKind::Fixed => RigidBodyType::Fixed,
        BodyKind::KinematicPosition => RigidBodyType::KinematicPositionBased,
        BodyKind::KinematicVelocity => RigidBodyType::KinematicVelocityBased,
    }
}

fn build_body(record: &BodyRecord, anchor: [f64; 3]) -> RigidBody {
    let mut body = body_builder(record, anchor).build();
    finish_body(&mut body, record);
    body
}

/// Returns the builder of a body; [`finish_body`] does the rest. Insertion calls both separately: a body that
/// is built before it is inserted is copied once more, which takes as long as all else that is done to it
/// here.
pub(super) fn body_builder(record: &BodyRecord, anchor: [f64; 3]) -> RigidBodyBuilder {
    let (traits, state) = (&record.traits, &record.state);
    // Each of Rapier's setters would copy the builder: they are not inlined into this crate.
    let mut builder = RigidBodyBuilder::new(body_type(traits.kind));
    builder.position = convert::region_from_world(anchor, &state.pose);
    builder.linvel = vector(state.velocity.linear);
    builder.angvel = vector(state.velocity.angular);
    builder.linear_damping = traits.linear_damping;
    builder.angular_damping = traits.angular_damping;
    builder.gravity_scale = traits.gravity_scale;
    builder.dominance_group = traits.dominance;
    builder.ccd_enabled = traits.ccd;
    builder.soft_ccd_prediction = traits.soft_ccd_m;
    builder.allow_fast_rotation = traits.fast_rotation;
    builder.gyroscopic_forces_enabled = traits.gyroscopic;
    builder.additional_solver_iterations = traits.extra_solver_iterations as usize;
    builder.additional_pgs_iterations = traits.extra_pgs_iterations as usize;
    builder.sleeping = state.sleeping;
    builder.enabled = traits.enabled;
    builder.user_data = record.user_data;
    if traits.locked_axes != 0 {
        builder = builder.locked_axes(LockedAxes::from_bits_truncate(traits.locked_axes));
    }
    match traits.extra_mass {
        None => builder,
        Some(ExtraMass::Mass(mass)) => builder.additional_mass(mass),
        Some(ExtraMass::Properties(props)) => builder.additional_mass_properties(mass_properties(&props)),
    }
}

/// Sets what Rapier's builder does not know.
pub(super) fn finish_body(body: &mut RigidBody, record: &BodyRecord) {
    let (traits, state) = (&record.traits, &record.state);
    // Few bodies are pushed all the time.
    if body.is_dynamic() && (state.force, state.torque) != ([0.0; 3], [0.0; 3]) {
        body.add_force(vector(state.force), false);
        body.add_torque(vector(state.torque), false);
    }
    let activation = body.activation_mut();
    activation.normalized_linear_threshold = traits.sleep_linear_threshold;
    activation.angular_threshold = traits.sleep_angular_threshold;
    activation.time_until_sleep = traits.sleep_after_s;
    activation.time_since_can_sleep = state.still_s;
}

/// Returns the AABB of the colliders of a body in its recorded pose, in world space; infinite for half-spaces.
pub(crate) fn bounds_of(record: &BodyRecord, shapes: &ShapeLibrary) -> Result<Bounds, ShapeError> {
    let origin = record.state.pose.translation;
    let at_origin = Pose::from_parts(Vector::ZERO, convert::rotation(record.state.pose.rotation));
    let mut bounds = Bounds::new(origin, origin);
    for collider in &record.traits.colliders {
        let shape = shapes.shape(collider.shape)?;
        let aabb = shape.compute_aabb(&(at_origin * convert::pose(collider.pose)));
        let (min, max) = (aabb.mins.to_array(), aabb.maxs.to_array());
        // Parry's half-space spans half of f32's range: that is infinity here.
        let far = |v: f32| if v.abs() > 1e30 { f64::INFINITY.copysign(f64::from(v)) } else { f64::from(v) };
        bounds = bounds.union(&Bounds {
            min: std::array::from_fn(|i| origin[i] + far(min[i])),
            max: std::array::from_fn(|i| origin[i] + far(max[i])),
        });
    }
    Ok(bounds)
}

/// Returns how far a body's colliders and wheels reach from its centre of mass, in metres: the radius of a ball that holds them all.
pub(crate) fn reach_of(body: &RigidBody, colliders: &ColliderSet, traits: &BodyTraits) -> f32 {
    let centre = body.local_center_of_mass();
    let wheels = traits.vehicle.as_ref().map_or(0.0, |vehicle| vehicle.reach_m() + centre.length());
    body.colliders()
        .iter()
        .filter_map(|&handle| colliders.get(handle))
        .map(|collider| {
            let local = collider.position_wrt_parent().copied().unwrap_or(Pose::IDENTITY);
            let ball = collider.shape().compute_bounding_sphere(&local);
            (ball.center - centre).length() + ball.radius + collider.contact_skin()
        })
        .fold(wheels, f32::max)
}

pub(super) fn collider_record(
    collider: &ColliderBuilder,
    shapes: &mut ShapeLibrary,
) -> Result<ColliderRecord, ShapeError> {
    Ok(ColliderRecord {
        shape: shapes.intern(&collider.shape)?,
        pose: convert::pose_record(&collider.position),
        mass: match &collider.mass_properties {
            ColliderMassProps::Density(density) => ColliderMass::Density(*density),
            ColliderMassProps::Mass(mass) => ColliderMass::Mass(*mass),
            ColliderMassProps::MassProperties(props) => ColliderMass::Properties(mass_record(props)),
        },
        friction: collider.friction,
        friction_rule: combine_rule(collider.friction_combine_rule),
        restitution: collider.restitution,
        restitution_rule: combine_rule(collider.restitution_combine_rule),
        sensor: collider.is_sensor,
        enabled: collider.enabled,
        collision_groups: groups(collider.collision_groups),
        solver_groups: groups(collider.solver_groups),
        collision_types: collider.active_collision_types.bits(),
        events: collider.active_events.bits(),
        hooks: collider.active_hooks.bits(),
        force_event_threshold_n: collider.contact_force_event_threshold,
        contact_skin_m: collider.contact_skin,
        user_data: collider.user_data,
    })
}

/// Returns the record of a collider that its user changed in place. Its shape and position are as in the old record.
pub(crate) fn renewed(record: &ColliderRecord, collider: &Collider) -> ColliderRecord {
    ColliderRecord {
        shape: record.shape,
        pose: record.pose,
        mass: mass_of(collider),
        friction: collider.friction(),
        friction_rule: combine_rule(collider.friction_combine_rule()),
        restitution: collider.restitution(),
        restitution_rule: combine_rule(collider.restitution_combine_rule()),
        sensor: collider.is_sensor(),
        enabled: is_enabled_itself(collider),
        collision_groups: groups(collider.collision_groups()),
        solver_groups: groups(collider.solver_groups()),
        collision_types: collider.active_collision_types().bits(),
        events: collider.active_events().bits(),
        hooks: collider.active_hooks().bits(),
        force_event_threshold_n: collider.contact_force_event_threshold(),
        contact_skin_m: collider.contact_skin(),
        user_data: collider.user_data,
    }
}

/// Returns whether a collider is enabled, whether its body is or not.
fn is_enabled_itself(collider: &Collider) -> bool {
    // Rapier keeps apart who disabled it, but tells only by what it does: only what its user disabled can be
    // enabled.
    let mut probe = collider.clone();
    probe.set_enabled(true);
    collider.is_enabled() || !probe.is_enabled()
}

fn build_collider(record: &ColliderRecord, shapes: &ShapeLibrary) -> Result<Collider, ShapeError> {
    collider_builder(record, shapes).map(|builder| builder.build())
}

pub(super) fn collider_builder(
    record: &ColliderRecord,
    shapes: &ShapeLibrary,
) -> Result<ColliderBuilder, ShapeError> {
    let mut builder = ColliderBuilder::new(shapes.shape(record.shape)?);
    builder.position = convert::pose(record.pose);
    builder.friction = record.friction;
    builder.friction_combine_rule = rapier_rule(record.friction_rule);
    builder.restitution = record.restitution;
    builder.restitution_combine_rule = rapier_rule(record.restitution_rule);
    builder.is_sensor = record.sensor;
    builder.enabled = record.enabled;
    builder.collision_groups = rapier_groups(record.collision_groups);
    builder.solver_groups = rapier_groups(record.solver_groups);
    builder.active_collision_types = ActiveCollisionTypes::from_bits_truncate(record.collision_types);
    builder.active_events = ActiveEvents::from_bits_truncate(record.events);
    builder.active_hooks = ActiveHooks::from_bits_truncate(record.hooks);
    builder.contact_force_event_threshold = record.force_event_threshold_n;
    builder.contact_skin = record.contact_skin_m;
    builder.user_data = record.user_data;
    builder.mass_properties = match record.mass {
        ColliderMass::Density(density) => ColliderMassProps::Density(density),
        ColliderMass::Mass(mass) => ColliderMassProps::Mass(mass),
        ColliderMass::Properties(props) => {
            ColliderMassProps::MassProperties(Box::new(mass_properties(&props)))
        }
    };
    Ok(builder)
}

/// Returns where the mass of a collider is from. Rapier does not tell whether the collider was given a
/// density, a mass or all mass properties; its mass properties with other shapes show it.
fn mass_of(collider: &Collider) -> ColliderMass {
    let mut tried = collider.clone();
    let [small, large] = [1.0, 2.0].map(|radius| {
        tried.set_shape(SharedShape::ball(radius));
        tried.mass_properties()
    });
    if small.inv_mass != large.inv_mass {
        ColliderMass::Density(collider.density())
    } else if small != large {
        ColliderMass::Mass(collider.mass())
    } else if small == MassProperties::default() {
        // It is zero, whichever was given.
        ColliderMass::Density(0.0)
    } else {
        ColliderMass::Properties(mass_record(&small))
    }
}

fn mass_record(props: &MassProperties) -> MassRecord {
    MassRecord {
        local_com: props.local_com.to_array(),
        inv_mass: props.inv_mass,
        inv_principal_inertia: props.inv_principal_inertia.to_array(),
        principal_frame: props.principal_inertia_local_frame.to_array(),
    }
}

pub(crate) fn mass_properties(record: &MassRecord) -> MassProperties {
    MassProperties {
        local_com: vector(record.local_com),
        inv_mass: record.inv_mass,
        inv_principal_inertia: vector(record.inv_principal_inertia),
        principal_inertia_local_frame: convert::rotation(record.principal_frame),
    }
}

fn groups(groups: InteractionGroups) -> Groups {
    Groups {
        memberships: groups.memberships.bits(),
        filter: groups.filter.bits(),
        any: groups.test_mode == InteractionTestMode::Or,
    }
}

pub(super) fn rapier_groups(groups: Groups) -> InteractionGroups {
    let mode = if groups.any { InteractionTestMode::Or } else { InteractionTestMode::And };
    InteractionGroups::new(
        Group::from_bits_retain(groups.memberships),
        Group::from_bits_retain(groups.filter),
        mode,
    )
}

fn combine_rule(rule: CoefficientCombineRule) -> CombineRule {
    match rule {
        CoefficientCombineRule::Average => CombineRule::Average,
        CoefficientCombineRule::Min => CombineRule::Min,
        CoefficientCombineRule::Multiply => CombineRule::Multiply,
        CoefficientCombineRule::Max => CombineRule::Max,
        CoefficientCombineRule::ClampedSum => CombineRule::ClampedSum,
        CoefficientCombineRule::GeometricMean => CombineRule::GeometricMean,
    }
}

pub(super) fn rapier_rule(rule: CombineRule) -> CoefficientCombineRule {
    match rule {
        CombineRule::Average => CoefficientCombineRule::Average,
        CombineRule::Min => CoefficientCombineRule::Min,
        CombineRule::Multiply => CoefficientCombineRule::Multiply,
        CombineRule::Max => CoefficientCombineRule::Max,
        CombineRule::ClampedSum => CoefficientCombineRule::ClampedSum,
        CombineRule::GeometricMean => CoefficientCombineRule::GeometricMean,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A body with nothing left at its default.
    fn unusual() -> (RigidBodyBuilder, Vec<ColliderBuilder>) {
        let mass = MassProperties::new(Vector::new(0.1, 0.2, 0.3), 4.0, Vector::new(1.0, 2.0, 3.0));
        let body = RigidBodyBuilder::dynamic()
            .linvel(Vector::new(1.0, 2.0, 3.0))
            .angvel(Vector::new(0.1, 0.2, 0.3))
            .linear_damping(0.25)
            .angular_damping(0.5)
            .gravity_scale(0.75)
            .locked_axes(LockedAxes::TRANSLATION_LOCKED_X | LockedAxes::ROTATION_LOCKED_Z)
            .dominance_group(3)
            .ccd_enabled(true)
            .soft_ccd_prediction(0.125)
            .allow_fast_rotation(true)
            .gyroscopic_forces_enabled(false)
            .additional_solver_iterations(2)
            .additional_pgs_iterations(3)
            .additional_mass_properties(mass)
            .can_sleep(false)
            .user_data(u128::MAX - 5);
        let collider = ColliderBuilder::cuboid(0.5, 1.0, 1.5)
            .position(Pose::from_parts(Vector::new(0.0, 0.5, 0.0), Rotation::from_rotation_x(0.5)))
            .mass(3.0)
            .friction(0.9)
            .friction_combine_rule(CoefficientCombineRule::Max)
            .restitution(0.4)
            .restitution_combine_rule(CoefficientCombineRule::Multiply)
            .collision_groups(InteractionGroups::new(Group::GROUP_3, Group::GROUP_7, InteractionTestMode::Or))
            .solver_groups(InteractionGroups::new(Group::GROUP_1, Group::GROUP_2, InteractionTestMode::And))
            .active_collision_types(ActiveCollisionTypes::all())
            .active_events(ActiveEvents::all())
            .active_hooks(ActiveHooks::FILTER_INTERSECTION_PAIR | ActiveHooks::MODIFY_SOLVER_CONTACTS)
            .contact_force_event_threshold(12.0)
            .contact_skin(0.01)
            .user_data(77);
        let sensor = ColliderBuilder::ball(2.0).sensor(true).mass_properties(mass).enabled(false);
        (body, vec![collider, sensor])
    }

    #[test]
    fn a_body_rebuilt_from_its_record_has_the_same_record() {
        let (body, colliders) = unusual();
        let mut shapes = ShapeLibrary::default();
        let pose = WorldPose { translation: [1.0, 2.0, 3.0], rotation: [0.5, 0.5, 0.5, 0.5] };
        let mut record = shapes.describe(BodyId::persistent(9), pose, &body.build(), &colliders).unwrap();
        record.state.force = [1.0, -2.0, 3.0];
        record.state.torque = [0.0, 0.5, 0.0];
        record.state.still_s = 0.25;
        let (rebuilt, _) = build(&record, [0.0; 3], &shapes).unwrap();
        assert_eq!(state_of(&rebuilt, [0.0; 3]), record.state);
        assert_eq!(traits_of(&rebuilt, record.traits.colliders.clone()), *record.traits);
    }

    #[test]
    fn a_collider_rebuilt_from_its_record_is_the_one_that_was_described() {
        let (_, colliders) = unusual();
        let mut shapes = ShapeLibrary::default();
        for builder in &colliders {
            let record = collider_record(builder, &mut shapes).unwrap();
            let (direct, rebuilt) = (builder.build(), build_collider(&record, &shapes).unwrap());
            assert_eq!(direct.material(), rebuilt.material());
            assert_eq!(direct.mass_properties(), rebuilt.mass_properties());
            assert_eq!(direct.collision_groups(), rebuilt.collision_groups());
            assert_eq!(direct.solver_groups(), rebuilt.solver_groups());
            assert_eq!(direct.active_events(), rebuilt.active_events());
            assert_eq!(direct.active_hooks(), rebuilt.active_hooks());
            assert_eq!(direct.active_collision_types(), rebuilt.active_collision_types());
            assert_eq!(direct.is_sensor(), rebuilt.is_sensor());
            assert_eq!(direct.is_enabled(), rebuilt.is_enabled());
            assert_eq!(direct.contact_skin(), rebuilt.contact_skin());
            assert_eq!(direct.contact_force_event_threshold(), rebuilt.contact_force_event_threshold());
            assert_eq!(direct.position(), rebuilt.position());
            assert_eq!(direct.user_data, rebuilt.user_data);
        }
    }

    #[test]
    fn a_dynamic_body_without_an_inside_needs_a_mass() {
        let corners = vec![Vector::ZERO, Vector::X, Vector::Z];
        let sheet = ColliderBuilder::trimesh(corners, vec![[0, 1, 2]]).unwrap();
        let described = |body: RigidBodyBuilder, colliders: &[ColliderBuilder]| {
            ShapeLibrary::default().describe(
                BodyId::default(),
                WorldPose::default(),
                &body.build(),
                colliders,
            )
        };
        let (dynamic, alone) = (RigidBodyBuilder::dynamic, std::slice::from_ref(&sheet));
        assert_eq!(described(dynamic(), alone).unwrap_err(), ShapeError::Massless);
        assert!(described(RigidBodyBuilder::fixed(), alone).is_ok());
        assert!(described(dynamic().additional_mass(2.0), alone).is_ok());
        assert!(described(dynamic(), &[sheet.clone().mass(2.0)]).is_ok());
        assert!(described(dynamic(), &[sheet.clone(), ColliderBuilder::ball(0.5)]).is_ok());
        assert!(described(dynamic(), &[ColliderBuilder::ball(0.5).density(0.0)]).is_ok(), "as Rapier has it");
    }

    #[test]
    fn bodies_that_are_described_one_after_the_other_share_what_they_are_until_one_is_changed() {
        let mut shapes = ShapeLibrary::default();
        let mut described = |id: u32, at: f64, friction: f32| {
            let body = RigidBodyBuilder::dynamic().user_data(id.into()).build();
            let (id, pose) = (BodyId::persistent(id), WorldPose::at([at, 0.0, 0.0]));
            let ball = ColliderBuilder::ball(0.5).friction(friction);
            shapes.describe(id, pose, &body, &[ball]).unwrap()
        };
        let [one, mut like_it, other, last] =
            [(1, 0.0, 0.5), (2, 5.0, 0.5), (3, 0.0, 0.25), (4, 0.0, 0.5)].map(|(a, b, c)| described(a, b, c));
        assert!(Arc::ptr_eq(&one.traits, &like_it.traits));
        assert_eq!((like_it.id, like_it.state.pose.translation[0]), (BodyId::persistent(2), 5.0));
        assert_eq!((one.user_data, like_it.user_data), (1, 2), "each has its own");
        assert_eq!(other.traits.colliders[0].friction, 0.25);
        assert!(Arc::ptr_eq(&last.traits, &one.traits), "kinds may take turns");
        Arc::make_mut(&mut like_it.traits).gravity_scale = 0.0;
        assert_eq!(one.traits.gravity_scale, 1.0);
    }

    #[test]
    fn a_half_space_reaches_everywhere() {
        let mut shapes = ShapeLibrary::default();
        let floor = ColliderBuilder::new(SharedShape::halfspace(Vector::Y));
        let body = RigidBodyBuilder::fixed();
        let record =
            shapes.describe(BodyId::default(), WorldPose::default(), &body.build(), &[floor]).unwrap();
        assert_eq!(bounds_of(&record, &shapes).unwrap().min[0], f64::NEG_INFINITY);
    }
}
