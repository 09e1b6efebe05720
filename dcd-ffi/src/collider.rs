//! Adds, changes, reads and removes the colliders of a body: shape, friction, restitution, mass, collision groups, events.

use dcd::protocol::{ColliderMass, ColliderRecord, CombineRule, Groups, Pose};
use dcd::query::ShapeHash;
use rapier3d::geometry::ColliderMassProps;
use rapier3d::prelude::{
    ActiveCollisionTypes, ActiveEvents, ActiveHooks, CoefficientCombineRule, Collider, ColliderBuilder,
    Group, InteractionGroups, InteractionTestMode, SharedShape,
};

use crate::guard::guard;
use crate::ids::{DcdBodyId, DcdShapeId, DcdWorld};
use crate::pointer::{self, Out, Sized32, check_bits, check_fraction, check_not_negative};
use crate::registry::{self, World, ask, with};
use crate::shape;
use crate::status::{DcdStatus, Failure};
use crate::types::{
    DCD_COMBINE_AVERAGE, DCD_COMBINE_GEOMETRIC_MEAN, DCD_EVENT_CONTACT, DCD_EVENT_FORCE, DcdCombineRule,
    DcdFrame,
};

/// Stands for all colliders of a body, in place of a collider's number.
pub const DCD_ALL_COLLIDERS: u32 = u32::MAX;

/// Largest number of colliders of one body.
pub const DCD_MAX_COLLIDERS: u32 = 4096;

/// In DcdBodyDef.pairs: a dynamic body meets dynamic ones.
pub const DCD_PAIR_DYNAMIC_DYNAMIC: u32 = 1;
/// In DcdBodyDef.pairs: a dynamic body meets kinematic ones, and the other way round.
pub const DCD_PAIR_DYNAMIC_KINEMATIC: u32 = 2;
/// In DcdBodyDef.pairs: a dynamic body meets fixed ones, and the other way round.
pub const DCD_PAIR_DYNAMIC_FIXED: u32 = 4;
/// In DcdBodyDef.pairs: a kinematic body meets kinematic ones.
pub const DCD_PAIR_KINEMATIC_KINEMATIC: u32 = 8;
/// In DcdBodyDef.pairs: a kinematic body meets fixed ones, and the other way round, such as a fixed sensor that notices doors and
/// players.
pub const DCD_PAIR_KINEMATIC_FIXED: u32 = 16;
/// In DcdBodyDef.pairs: a fixed body meets fixed ones.
pub const DCD_PAIR_FIXED_FIXED: u32 = 32;

/// In DcdColliderProperties.flags: the collider is a sensor, which detects and does not push.
pub const DCD_COLLIDER_SENSOR: u32 = 1;
/// In DcdColliderProperties.flags: the collider is not there until this flag is taken away.
pub const DCD_COLLIDER_DISABLED: u32 = 2;
/// In DcdColliderProperties.flags: two colliders that both have this flag collide when groups and mask match one way. All others
/// must match both ways.
pub const DCD_COLLIDER_ANY_GROUP: u32 = 4;

/// Properties of one collider of a body. Start from DCD_COLLIDER_PROPERTIES_INIT, or from dcd_collider_properties.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DcdColliderProperties {
    /// Size of this struct: sizeof(DcdColliderProperties).
    pub struct_size: u32,
    /// DCD_COLLIDER_… bits.
    pub flags: u32,
    /// Pose of the collider on the body.
    pub frame: DcdFrame,
    /// Density, kg/m³, 0 or more. When read later, it is 0 where the mass was given, or centre and inertia with it (by Rapier's own
    /// setters).
    pub density: f32,
    /// Mass, kilograms; 0: by density.
    pub mass: f32,
    /// Friction: Coulomb coefficient, 0 or more. This and all that follows is as in DcdBodyDef.
    pub friction: f32,
    /// Restitution, 0 to 1.
    pub restitution: f32,
    /// DCD_COMBINE_… rule for friction.
    pub friction_rule: DcdCombineRule,
    /// DCD_COMBINE_… rule for restitution.
    pub restitution_rule: DcdCombineRule,
    /// Distance that the collider is kept away from others, metres.
    pub contact_skin: f32,
    /// DCD_EVENT_… bits.
    pub events: u32,
    /// Force above which DCD_EVENT_FORCE reports a contact, newtons.
    pub force_threshold: f32,
    /// Groups that the collider belongs to, as bits.
    pub groups: u32,
    /// Groups that the collider meets, as bits.
    pub mask: u32,
    /// Groups that the collider belongs to when it comes to pushing, as bits.
    pub solver_groups: u32,
    /// Groups that push the collider and that it pushes, as bits.
    pub solver_mask: u32,
    /// DCD_PAIR_… bits: which types of bodies the collider meets.
    pub pairs: u32,
    /// DCD_HOOK_… bits: the functions of dcd_hooks_set that are asked about it.
    pub hooks: u32,
    /// User data of the collider, such as the number of its material; contacts and hits carry it.
    pub user_data: u64,
}

// SAFETY: begins with `struct_size`; every other member is a number.
unsafe impl Sized32 for DcdColliderProperties {
    const NAME: &'static str = "DcdColliderProperties";
}

/// All DCD_HOOK_… bits; Rapier's bits are the same.
const ALL_HOOKS: u32 = 7;

const RULES: [CoefficientCombineRule; 6] = [
    CoefficientCombineRule::Average,
    CoefficientCombineRule::Min,
    CoefficientCombineRule::Multiply,
    CoefficientCombineRule::Max,
    CoefficientCombineRule::ClampedSum,
    CoefficientCombineRule::GeometricMean,
];

const RECORDED_RULES: [CombineRule; 6] = [
    CombineRule::Average,
    CombineRule::Min,
    CombineRule::Multiply,
    CombineRule::Max,
    CombineRule::ClampedSum,
    CombineRule::GeometricMean,
];

/// Rapier's types of collisions, in the order of the DCD_PAIR_… bits.
const PAIRS: [ActiveCollisionTypes; 6] = [
    ActiveCollisionTypes::DYNAMIC_DYNAMIC,
    ActiveCollisionTypes::DYNAMIC_KINEMATIC,
    ActiveCollisionTypes::DYNAMIC_FIXED,
    ActiveCollisionTypes::KINEMATIC_KINEMATIC,
    ActiveCollisionTypes::KINEMATIC_FIXED,
    ActiveCollisionTypes::FIXED_FIXED,
];

impl DcdColliderProperties {
    fn of(record: &ColliderRecord) -> Self {
        let bit = |bit: u32, set: bool| if set { bit } else { 0 };
        let (density, mass) = match record.mass {
            ColliderMass::Density(density) => (density, 0.0),
            ColliderMass::Mass(mass) => (0.0, mass),
            ColliderMass::Properties(record) if record.inv_mass == 0.0 => (0.0, 0.0),
            ColliderMass::Properties(record) => (0.0, record.inv_mass.recip()),
        };
        let types = ActiveCollisionTypes::from_bits_truncate(record.collision_types);
        let events = ActiveEvents::from_bits_truncate(record.events);
        let groups = record.collision_groups;
        Self {
            struct_size: size_of::<Self>() as u32,
            flags: bit(DCD_COLLIDER_SENSOR, record.sensor)
                | bit(DCD_COLLIDER_DISABLED, !record.enabled)
                | bit(DCD_COLLIDER_ANY_GROUP, groups.any),
            frame: DcdFrame { p: record.pose.translation, q: record.pose.rotation },
            density,
            mass,
            friction: record.friction,
            restitution: record.restitution,
            friction_rule: record.friction_rule as u32,
            restitution_rule: record.restitution_rule as u32,
            contact_skin: record.contact_skin_m,
            events: bit(DCD_EVENT_CONTACT, events.contains(ActiveEvents::COLLISION_EVENTS))
                | bit(DCD_EVENT_FORCE, events.contains(ActiveEvents::CONTACT_FORCE_EVENTS)),
            force_threshold: record.force_event_threshold_n,
            groups: groups.memberships,
            mask: groups.filter,
            solver_groups: record.solver_groups.memberships,
            solver_mask: record.solver_groups.filter,
            pairs: (0..6).map(|i| bit(1 << i, types.contains(PAIRS[i]))).sum(),
            hooks: record.hooks & ALL_HOOKS,
            user_data: record.user_data as u64,
        }
    }

    pub(crate) fn check(&self) -> Result<(), Failure> {
        check_bits(
            self.flags,
            DCD_COLLIDER_SENSOR | DCD_COLLIDER_DISABLED | DCD_COLLIDER_ANY_GROUP,
            "flags",
        )?;
        self.frame.check("frame")?;
        for (value, name) in [
            (self.density, "density"),
            (self.mass, "mass"),
            (self.friction, "friction"),
            (self.contact_skin, "contact_skin"),
            (self.force_threshold, "force_threshold"),
        ] {
            check_not_negative(value, name)?;
        }
        check_fraction(self.restitution, "restitution")?;
        check_bits(self.hooks, ALL_HOOKS, "hooks")?;
        for (rule, name) in
            [(self.friction_rule, "friction_rule"), (self.restitution_rule, "restitution_rule")]
        {
            if rule > DCD_COMBINE_GEOMETRIC_MEAN {
                return Err(Failure::argument(format!("{name} {rule} is none; use a DCD_COMBINE_… rule")));
            }
        }
        check_bits(self.events, DCD_EVENT_CONTACT | DCD_EVENT_FORCE, "events")?;
        check_bits(self.pairs, 63, "pairs")
    }

    /// Returns a builder of a collider with these properties.
    pub(crate) fn builder(&self, shape: SharedShape) -> ColliderBuilder {
        // Rapier's setters are not inlined into this crate, so each would copy the builder.
        let mut builder = ColliderBuilder::new(shape);
        builder.position = self.frame.pose();
        builder.friction = self.friction;
        builder.restitution = self.restitution;
        builder.friction_combine_rule = RULES[self.friction_rule as usize];
        builder.restitution_combine_rule = RULES[self.restitution_rule as usize];
        builder.contact_skin = self.contact_skin;
        builder.is_sensor = self.has(DCD_COLLIDER_SENSOR);
        builder.enabled = !self.has(DCD_COLLIDER_DISABLED);
        builder.active_events = active_events(self.events);
        builder.contact_force_event_threshold = self.force_threshold;
        builder.collision_groups = self.interaction(self.groups, self.mask);
        builder.solver_groups = self.interaction(self.solver_groups, self.solver_mask);
        builder.active_collision_types = self.collision_types();
        builder.active_hooks = ActiveHooks::from_bits_truncate(self.hooks);
        builder.user_data = u128::from(self.user_data);
        builder.mass_properties = match self.mass > 0.0 {
            true => ColliderMassProps::Mass(self.mass),
            false => ColliderMassProps::Density(self.density),
        };
        builder
    }

    /// Returns what is recorded of a collider with these properties: the same as of what [`DcdColliderProperties::builder`] builds.
    pub(crate) fn record(&self, shape: ShapeHash) -> ColliderRecord {
        let groups = |memberships: u32, filter: u32| Groups {
            memberships,
            filter,
            any: self.has(DCD_COLLIDER_ANY_GROUP),
        };
        ColliderRecord {
            shape,
            pose: Pose { translation: self.frame.p, rotation: self.frame.q },
            mass: match self.mass > 0.0 {
                true => ColliderMass::Mass(self.mass),
                false => ColliderMass::Density(self.density),
            },
            friction: self.friction,
            friction_rule: RECORDED_RULES[self.friction_rule as usize],
            restitution: self.restitution,
            restitution_rule: RECORDED_RULES[self.restitution_rule as usize],
            sensor: self.has(DCD_COLLIDER_SENSOR),
            enabled: !self.has(DCD_COLLIDER_DISABLED),
            collision_groups: groups(self.groups, self.mask),
            solver_groups: groups(self.solver_groups, self.solver_mask),
            collision_types: self.collision_types().bits(),
            events: active_events(self.events).bits(),
            hooks: self.hooks & ALL_HOOKS,
            force_event_threshold_n: self.force_threshold,
            contact_skin_m: self.contact_skin,
            user_data: self.user_data.into(),
        }
    }

    /// Changes a collider from the properties `before` to these. What is as it was is not touched, because Rapier knows more of
    /// some of it than C.
    fn apply(&self, before: &Self, collider: &mut Collider) {
        if self.frame != before.frame {
            collider.set_position_wrt_parent(self.frame.pose());
        }
        if (self.density, self.mass) != (before.density, before.mass) {
            if self.mass > 0.0 {
                collider.set_mass(self.mass);
            } else {
                collider.set_density(self.density);
            }
        }
        collider.set_friction(self.friction);
        collider.set_restitution(self.restitution);
        collider.set_friction_combine_rule(RULES[self.friction_rule as usize]);
        collider.set_restitution_combine_rule(RULES[self.restitution_rule as usize]);
        collider.set_contact_skin(self.contact_skin);
        collider.set_sensor(self.has(DCD_COLLIDER_SENSOR));
        if (self.flags ^ before.flags) & DCD_COLLIDER_DISABLED != 0 {
            collider.set_enabled(!self.has(DCD_COLLIDER_DISABLED));
        }
        if self.events != before.events {
            collider.set_active_events(active_events(self.events));
        }
        collider.set_contact_force_event_threshold(self.force_threshold);
        let groups = |own: &Self| (own.groups, own.mask, own.flags & DCD_COLLIDER_ANY_GROUP);
        if groups(self) != groups(before) {
            collider.set_collision_groups(self.interaction(self.groups, self.mask));
        }
        let groups = |own: &Self| (own.solver_groups, own.solver_mask, own.flags & DCD_COLLIDER_ANY_GROUP);
        if groups(self) != groups(before) {
            collider.set_solver_groups(self.interaction(self.solver_groups, self.solver_mask));
        }
        if self.pairs != before.pairs {
            collider.set_active_collision_types(self.collision_types());
        }
        if self.hooks != before.hooks {
            collider.set_active_hooks(ActiveHooks::from_bits_truncate(self.hooks));
        }
        if self.user_data != before.user_data {
            collider.user_data = u128::from(self.user_data);
        }
    }

    fn has(&self, bit: u32) -> bool {
        self.flags & bit != 0
    }

    fn interaction(&self, groups: u32, mask: u32) -> InteractionGroups {
        let mode =
            if self.has(DCD_COLLIDER_ANY_GROUP) { InteractionTestMode::Or } else { InteractionTestMode::And };
        InteractionGroups::new(Group::from_bits_retain(groups), Group::from_bits_retain(mask), mode)
    }

    fn collision_types(&self) -> ActiveCollisionTypes {
        let asked = PAIRS.iter().enumerate().filter(|(i, _)| self.pairs & (1 << i) != 0);
        asked.map(|(_, &types)| types).collect()
    }
}

/// Reads the properties of one collider of a body. `collider` is its number, from 0.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT, DCD_ERR_ARGUMENT (a collider that is not there).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_collider_properties(
    world: DcdWorld,
    body: DcdBodyId,
    collider: u32,
    out: *mut DcdColliderProperties,
) -> DcdStatus {
    guard("dcd_collider_properties", || {
        // SAFETY: the caller vouches for `out`.
        let out = unsafe { Out::sized(out, "out")? };
        ask(world, |world| {
            out.write(read(world, body, collider)?);
            Ok(())
        })
    })
}

/// Changes the properties of one collider of a body: read them by dcd_collider_properties, change members, and give them back. What
/// is as it was stays as it is. Contacts that there are feel a change in the next step; what touches the body wakes.
///
/// `properties` is read during the call.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_STRUCT.
/// - DCD_ERR_ARGUMENT: a collider that is not there, or a member out of range.
/// - DCD_ERR_UNSUPPORTED: in a served world, except for its server and builders, which change movable bodies.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_collider_set_properties(
    world: DcdWorld,
    body: DcdBodyId,
    collider: u32,
    properties: *const DcdColliderProperties,
) -> DcdStatus {
    guard("dcd_collider_set_properties", || {
        // SAFETY: the caller vouches for the pointer.
        let after = unsafe { pointer::read_sized(properties, "properties")? };
        with(world, |world| {
            world.dcd.changes_colliders()?;
            let (id, before) = (registry::find(world, body)?, read(world, body, collider)?);
            after.check()?;
            world
                .dcd
                .update_collider((id, collider as usize), |collider| after.apply(&before, collider))
                .map_err(Failure::from)
        })
    })
}

/// Adds a collider to a body, as the last of its colliders. Its number goes to `out`, which may be null. The contacts of the body
/// begin anew, without memory.
///
/// `properties` is read during the call; null is DCD_COLLIDER_PROPERTIES_INIT.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID (world, body or shape), DCD_ERR_STRUCT.
/// - DCD_ERR_ARGUMENT: a member out of range, or more than DCD_MAX_COLLIDERS.
/// - DCD_ERR_UNSUPPORTED: in a served world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_collider_add(
    world: DcdWorld,
    body: DcdBodyId,
    shape: DcdShapeId,
    properties: *const DcdColliderProperties,
    out: *mut u32,
) -> DcdStatus {
    guard("dcd_collider_add", || {
        // SAFETY: the caller vouches for what is not null.
        let (properties, out) = unsafe {
            (
                if properties.is_null() { USUAL } else { pointer::read_sized(properties, "properties")? },
                if out.is_null() { None } else { Some(Out::new(out, "out")?) },
            )
        };
        properties.check()?;
        with(world, |world| {
            world.dcd.shapes_bodies()?;
            let (id, shape) = (registry::find(world, body)?, shape::find(world, shape)?.clone());
            let collider = world.dcd.collider_count(id);
            if collider >= DCD_MAX_COLLIDERS as usize {
                return Err(Failure::argument(format!(
                    "the body has {collider} colliders; make a compound of some"
                )));
            }
            world.dcd.insert_collider(id, properties.builder(shape))?;
            if let Some(out) = out {
                out.write(collider as u32);
            }
            Ok(())
        })
    })
}

/// Removes a collider from a body. The numbers of the colliders after it move down by one. The contacts of the body begin anew,
/// without memory.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT (a collider that is not there or is the only one), DCD_ERR_UNSUPPORTED
/// (in a served world).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_collider_remove(world: DcdWorld, body: DcdBodyId, collider: u32) -> DcdStatus {
    guard("dcd_collider_remove", || {
        with(world, |world| {
            world.dcd.shapes_bodies()?;
            let id = registry::find(world, body)?;
            if world.dcd.collider_count(id) == 1 && collider == 0 {
                return Err(Failure::argument(
                    "the body has no other collider; destroy it, or disable the collider",
                ));
            }
            world.events.loses_collider(&world.dcd, id);
            world.dcd.remove_collider((id, collider as usize)).map_err(Failure::from)
        })
    })
}

/// Sets the shape of a collider of a body. The contacts of the body begin anew, without memory.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (world, body or shape), DCD_ERR_ARGUMENT (a collider that is not there),
/// DCD_ERR_UNSUPPORTED (in a served world).
#[unsafe(no_mangle)]
pub extern "C" fn dcd_collider_set_shape(
    world: DcdWorld,
    body: DcdBodyId,
    collider: u32,
    shape: DcdShapeId,
) -> DcdStatus {
    guard("dcd_collider_set_shape", || {
        with(world, |world| {
            world.dcd.shapes_bodies()?;
            let (id, shape) = (registry::find(world, body)?, shape::find(world, shape)?.clone());
            world
                .dcd
                .update_collider((id, collider as usize), |collider| collider.set_shape(shape.clone()))
                .map_err(Failure::from)
        })
    })
}

/// Sets what dcd_events reports of a body, as DcdBodyDef.events and force_threshold do when it is made: DCD_EVENT_… bits and
/// newtons. `collider` is the number of one of its colliders, from 0, or DCD_ALL_COLLIDERS.
///
/// The end of a contact that is there already is reported only if its beginning was. Where neither of its two colliders is to
/// report it any more, the end is reported with the next step.
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_ARGUMENT: a collider that is not there, unknown bits, or a threshold below 0.
/// - DCD_ERR_UNSUPPORTED: in a served world, except for its server and builders, which change movable bodies.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_body_set_events(
    world: DcdWorld,
    body: DcdBodyId,
    collider: u32,
    events: u32,
    force_threshold: f32,
) -> DcdStatus {
    guard("dcd_body_set_events", || {
        check_bits(events, DCD_EVENT_CONTACT | DCD_EVENT_FORCE, "events")?;
        check_not_negative(force_threshold, "force_threshold")?;
        change(world, body, collider, |collider| {
            collider.set_active_events(active_events(events));
            collider.set_contact_force_event_threshold(force_threshold);
        })
    })
}

/// Sets how a body slides and bounces: friction, a Coulomb coefficient of 0 or more, and restitution, 0 to 1. `collider` is as in
/// dcd_body_set_events. Contacts that there are feel a change in the next step; what touches the body wakes.
///
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_ARGUMENT: a collider that is not there, or a coefficient out of range.
/// - DCD_ERR_UNSUPPORTED: in a served world, except for its server and builders, which change movable bodies.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_body_set_material(
    world: DcdWorld,
    body: DcdBodyId,
    collider: u32,
    friction: f32,
    restitution: f32,
) -> DcdStatus {
    guard("dcd_body_set_material", || {
        check_not_negative(friction, "friction")?;
        check_fraction(restitution, "restitution")?;
        change(world, body, collider, |collider| {
            collider.set_friction(friction);
            collider.set_restitution(restitution);
        })
    })
}

/// Sets which groups a body belongs to and which it meets, as DcdBodyDef.groups and mask do. `collider` is as in
/// dcd_body_set_events.
///
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID.
/// - DCD_ERR_ARGUMENT: a collider that is not there.
/// - DCD_ERR_UNSUPPORTED: in a served world, except for its server and builders, which change movable bodies.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_body_set_groups(
    world: DcdWorld,
    body: DcdBodyId,
    collider: u32,
    groups: u32,
    mask: u32,
) -> DcdStatus {
    guard("dcd_body_set_groups", || {
        let group = Group::from_bits_retain;
        change(world, body, collider, |collider| {
            let mode = collider.collision_groups().test_mode;
            collider.set_collision_groups(InteractionGroups::new(group(groups), group(mask), mode));
        })
    })
}

/// The values of DCD_COLLIDER_PROPERTIES_INIT.
const USUAL: DcdColliderProperties = DcdColliderProperties {
    struct_size: size_of::<DcdColliderProperties>() as u32,
    flags: 0,
    frame: DcdFrame { p: [0.0; 3], q: [0.0, 0.0, 0.0, 1.0] },
    density: 1000.0,
    mass: 0.0,
    friction: 0.5,
    restitution: 0.0,
    friction_rule: DCD_COMBINE_AVERAGE,
    restitution_rule: DCD_COMBINE_AVERAGE,
    contact_skin: 0.0,
    events: 0,
    force_threshold: 0.0,
    groups: u32::MAX,
    mask: u32::MAX,
    solver_groups: u32::MAX,
    solver_mask: u32::MAX,
    pairs: DCD_PAIR_DYNAMIC_DYNAMIC | DCD_PAIR_DYNAMIC_KINEMATIC | DCD_PAIR_DYNAMIC_FIXED,
    hooks: 0,
    user_data: 0,
};

fn read(world: &World, body: DcdBodyId, collider: u32) -> Result<DcdColliderProperties, Failure> {
    Ok(DcdColliderProperties::of(&recorded(world, body, collider)?))
}

/// Returns the record of one collider of a body.
pub(crate) fn recorded(world: &World, body: DcdBodyId, collider: u32) -> Result<ColliderRecord, Failure> {
    let id = world.mark.body_id(body)?;
    let record = world.dcd.record(id).ok_or_else(|| registry::missing(world, body))?;
    let colliders = &record.traits.colliders;
    colliders.get(collider as usize).cloned().ok_or_else(|| {
        Failure::argument(format!(
            "the body has {} colliders, there is no collider {collider}; count from 0",
            colliders.len()
        ))
    })
}

/// Returns Rapier's flags for DCD_EVENT_… bits.
fn active_events(bits: u32) -> ActiveEvents {
    let mut events = ActiveEvents::empty();
    events.set(ActiveEvents::COLLISION_EVENTS, bits & DCD_EVENT_CONTACT != 0);
    events.set(ActiveEvents::CONTACT_FORCE_EVENTS, bits & DCD_EVENT_FORCE != 0);
    events
}

fn change(
    world: DcdWorld,
    body: DcdBodyId,
    collider: u32,
    mut change: impl FnMut(&mut Collider),
) -> Result<(), Failure> {
    with(world, |world| {
        world.dcd.changes_colliders()?;
        let id = registry::find(world, body)?;
        let colliders = match collider {
            DCD_ALL_COLLIDERS => 0..world.dcd.collider_count(id),
            collider => collider as usize..collider as usize + 1,
        };
        for collider in colliders {
            world.dcd.update_collider((id, collider), &mut change)?;
        }
        Ok(())
    })
}
