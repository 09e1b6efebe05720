//! Creates, finds and destroys bodies, and checks their definitions.

use std::sync::Arc;

use dcd::Role;
use dcd::protocol::{BodyKind, BodyState, BodyTraits, Velocity, WorldPose};
use dcd::query::ShapeHash;
use dcd::space::BodyId;
use rapier3d::prelude::*;

use crate::collider::{DCD_COLLIDER_ANY_GROUP, DCD_COLLIDER_SENSOR, DcdColliderProperties};
pub use crate::definition::DcdBodyDef;
use crate::guard::{guard, guard_value};
use crate::handle::stale;
use crate::ids::{DcdBodyId, DcdWorld};
use crate::pointer::{self, Out};
use crate::properties::{DcdBodyProperties, recorded_kind};
use crate::registry::{World, ask, find, with};
use crate::shape;
use crate::status::{DcdStatus, Failure};
use crate::types::{
    DCD_BODY_ANY_GROUP, DCD_BODY_ASLEEP, DCD_BODY_NO_SLEEP, DCD_BODY_SENSOR, DCD_DYNAMIC, DcdFrame,
    DcdVelocity, check_pose, check_velocity,
};

/// Creates one body, as dcd_bodies_create does.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_create(
    world: DcdWorld,
    def: *const DcdBodyDef,
    out: *mut DcdBodyId,
) -> DcdStatus {
    // SAFETY: the caller upholds the same contract.
    guard("dcd_body_create", || unsafe { create(world, (def, "def"), 1, out) })
}

/// Creates `count` bodies, all or none. `defs` and `out` have `count` entries; `defs` is read during the call. Bodies are in the
/// world at once, and the next step moves them.
///
/// - The bodies of a client or participant are avatars. DCD_CHANGE_APPEARED or DCD_CHANGE_REFUSED tells what became of each.
/// - The bodies of a server or a builder are the world's own, of any kind. They stay when a builder leaves. Nodes compute them from
///   some ticks after the next dcd_step on. A builder is told what became of each, as a client is.
///
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID (world or shape), DCD_ERR_STRUCT.
/// - DCD_ERR_ARGUMENT: a member out of range, more than DCD_MAX_ITEMS bodies, a dynamic body without mass or faster than
///   DcdWorldInfo.speed_limit, or an avatar of a mesh or terrain.
/// - DCD_ERR_LIMIT: the world has given 4,294,967,295 ids.
/// - DCD_ERR_UNSUPPORTED: a node; an avatar that is fixed, of DCD_KINEMATIC_POSE, or with thresholds of sleep.
/// - DCD_ERR_NETWORK: the link is gone.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_bodies_create(
    world: DcdWorld,
    defs: *const DcdBodyDef,
    count: usize,
    out: *mut DcdBodyId,
) -> DcdStatus {
    // SAFETY: the caller upholds the same contract.
    guard("dcd_bodies_create", || unsafe { create(world, (defs, "defs"), count, out) })
}

/// # Safety
/// `defs` and `out` are null or have `count` entries.
unsafe fn create(
    world: DcdWorld,
    (defs, name): (*const DcdBodyDef, &'static str),
    count: usize,
    out: *mut DcdBodyId,
) -> Result<(), Failure> {
    if count > 0 {
        // SAFETY: there is at least one entry. Its size is checked before the others are looked for behind it.
        unsafe { pointer::read_sized(defs, name)? };
        pointer::check(out, "out")?;
    }
    // SAFETY: the caller vouches for `count` entries.
    let defs = unsafe { pointer::slice(defs, count, name)? };
    with(world, |world| {
        if let [def] = defs {
            let known = check(world, def)?;
            let id = insert(world, def, known)?;
            // SAFETY: not null, aligned, and the caller vouches for one entry.
            unsafe { out.write(world.mark.body(id)) };
            return Ok(());
        }
        for (i, def) in defs.iter().enumerate() {
            check(world, def)
                .and_then(|_| shape::find(world, def.shape))
                .map_err(|failure| Failure::new(failure.status, format!("defs[{i}]: {}", failure.message)))?;
        }
        // Others hear at once of a client's avatars, so a client that may not have all of them makes none.
        if count > 1 && world.dcd.role() != Role::Local {
            for def in defs {
                let body = build(world, def)?;
                world.dcd.can_insert(body.pose, &body.body, &[body.collider])?;
            }
        }
        let mut made = Vec::with_capacity(count);
        for def in defs {
            let known = world.made.like(def).cloned();
            match insert(world, def, known) {
                Ok(id) => made.push(id),
                Err(failure) => {
                    world.dcd.take_back(&made)?;
                    return Err(failure);
                }
            }
        }
        for (i, &id) in made.iter().enumerate() {
            // SAFETY: not null, aligned, and the caller vouches for `count` entries.
            unsafe { out.add(i).write(world.mark.body(id)) };
        }
        Ok(())
    })
}

/// Inserts a body by its checked definition, and by what is recorded of it if that is known.
fn insert(world: &mut World, def: &DcdBodyDef, known: Option<Arc<BodyTraits>>) -> Result<BodyId, Failure> {
    if world.dcd.role() != Role::Local {
        let body = build(world, def)?;
        return Ok(world.dcd.insert_at(body.pose, body.body, [body.collider])?);
    }
    let World { mark, dcd, shapes, made, .. } = world;
    let (kind, shape) = (recorded_kind(def.body_type)?, shape::among(shapes, *mark, def.shape)?);
    let traits = |shape| match known {
        Some(known) => known,
        None => {
            let traits = Arc::new(def.traits(kind, shape));
            made.keep(def, Arc::clone(&traits));
            traits
        }
    };
    Ok(dcd.insert_recorded(def.state(), def.user_data.into(), shape, traits)?)
}

/// A checked definition.
pub(crate) struct NewBody {
    pub pose: WorldPose,
    pub body: RigidBody,
    pub collider: ColliderBuilder,
}

impl DcdBodyDef {
    /// Returns the state that is recorded of the body at first, as Rapier's builder makes it.
    fn state(&self) -> BodyState {
        let sleeping = self.flags & (DCD_BODY_ASLEEP | DCD_BODY_NO_SLEEP) == DCD_BODY_ASLEEP;
        let DcdVelocity { linear, angular } = self.velocity;
        BodyState {
            pose: self.pose.into(),
            velocity: if sleeping { Velocity::default() } else { Velocity { linear, angular } },
            force: [0.0; 3],
            torque: [0.0; 3],
            sleeping,
            still_s: if sleeping { RigidBodyActivation::default_time_until_sleep() } else { 0.0 },
            gait: None,
            drive: None,
            contact_offset: None,
        }
    }

    fn traits(&self, kind: BodyKind, shape: ShapeHash) -> BodyTraits {
        self.properties().traits(kind, vec![self.collider().record(shape)])
    }

    fn properties(&self) -> DcdBodyProperties {
        DcdBodyProperties {
            struct_size: size_of::<DcdBodyProperties>() as u32,
            body_type: self.body_type,
            flags: self.flags & !(OF_STATE | OF_COLLIDER),
            locked: self.locked,
            dominance: self.dominance,
            linear_damping: self.linear_damping,
            angular_damping: self.angular_damping,
            gravity_scale: self.gravity_scale,
            soft_ccd: self.soft_ccd,
            sleep_linear: self.sleep_linear,
            sleep_angular: self.sleep_angular,
            sleep_after: self.sleep_after,
            extra_mass: self.extra_mass,
            extra_centre: self.extra_centre,
            extra_inertia: self.extra_inertia,
            extra_solver_iterations: self.extra_solver_iterations,
            extra_pgs_iterations: self.extra_pgs_iterations,
            reserved: 0,
            user_data: self.user_data,
        }
    }

    fn collider(&self) -> DcdColliderProperties {
        let bit = |of: u32, bit: u32| if self.flags & of != 0 { bit } else { 0 };
        DcdColliderProperties {
            struct_size: size_of::<DcdColliderProperties>() as u32,
            flags: bit(DCD_BODY_SENSOR, DCD_COLLIDER_SENSOR)
                | bit(DCD_BODY_ANY_GROUP, DCD_COLLIDER_ANY_GROUP),
            frame: DcdFrame { p: [0.0; 3], q: [0.0, 0.0, 0.0, 1.0] },
            density: self.density,
            mass: self.mass,
            friction: self.friction,
            restitution: self.restitution,
            friction_rule: self.friction_rule,
            restitution_rule: self.restitution_rule,
            contact_skin: self.contact_skin,
            events: self.events,
            force_threshold: self.force_threshold,
            groups: self.groups,
            mask: self.mask,
            solver_groups: self.solver_groups,
            solver_mask: self.solver_mask,
            pairs: self.pairs,
            hooks: self.hooks,
            user_data: self.material,
        }
    }
}

/// Flags of a definition: those that describe its state at first, and those that belong to its shape.
const OF_STATE: u32 = DCD_BODY_ASLEEP;
const OF_COLLIDER: u32 = DCD_BODY_SENSOR | DCD_BODY_ANY_GROUP;

/// Checks a definition and turns it into Rapier's builders.
pub(crate) fn parse(world: &World, def: &DcdBodyDef) -> Result<NewBody, Failure> {
    check(world, def)?;
    build(world, def)
}

/// Checks all of a definition but its shape. Returns what is recorded of such a body, if one like it was made lately.
fn check(world: &World, def: &DcdBodyDef) -> Result<Option<Arc<BodyTraits>>, Failure> {
    if def.struct_size as usize != size_of::<DcdBodyDef>() {
        return Err(Failure::new(
            crate::status::DCD_ERR_STRUCT,
            format!("struct_size is {}; start each entry from DCD_BODY_DEF_INIT", def.struct_size),
        ));
    }
    check_pose(&def.pose)?;
    check_velocity(&def.velocity)?;
    let known = world.made.like(def).cloned();
    if known.is_none() {
        def.properties().check()?;
        def.collider().check()?;
        if def.body_type == DCD_DYNAMIC && def.density == 0.0 && def.mass == 0.0 && def.extra_mass == 0.0 {
            return Err(Failure::argument(
                "density is 0; a dynamic body needs some mass, water has 1000 kg/m³",
            ));
        }
    }
    Ok(known)
}

/// Turns a checked definition into Rapier's builders.
fn build(world: &World, def: &DcdBodyDef) -> Result<NewBody, Failure> {
    described(def, shape::find(world, def.shape)?.clone())
}

fn described(def: &DcdBodyDef, shape: SharedShape) -> Result<NewBody, Failure> {
    let properties = def.properties();
    let mut body = properties
        .builder()?
        .linvel(Vector::from_array(def.velocity.linear))
        .angvel(Vector::from_array(def.velocity.angular))
        .sleeping(def.flags & DCD_BODY_ASLEEP != 0)
        .build();
    properties.set_thresholds(&mut body);
    let collider = def.collider().builder(shape);
    Ok(NewBody { pose: def.pose.into(), body, collider })
}

/// Destroys `count` bodies with their joints, all or none. Contacts that they had are reported as ended after the next step.
///
/// Errors:
/// - DCD_ERR_NULL, DCD_ERR_STALE_ID (the world, a body, or a body named twice).
/// - DCD_ERR_ARGUMENT: more than DCD_MAX_ITEMS.
/// - DCD_ERR_UNSUPPORTED: a body of others in a served world.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_bodies_destroy(
    world: DcdWorld,
    bodies: *const DcdBodyId,
    count: usize,
) -> DcdStatus {
    guard("dcd_bodies_destroy", || {
        // SAFETY: the caller vouches for `count` entries.
        destroy(world, unsafe { pointer::slice(bodies, count, "bodies")? })
    })
}

/// Destroys one body, as dcd_bodies_destroy does.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_body_destroy(world: DcdWorld, body: DcdBodyId) -> DcdStatus {
    guard("dcd_body_destroy", || destroy(world, &[body]))
}

fn destroy(world: DcdWorld, bodies: &[DcdBodyId]) -> Result<(), Failure> {
    with(world, |world| {
        if let [body] = *bodies {
            let id = find(world, body)?;
            world.dcd.can_remove(id)?;
            return remove(world, id);
        }
        let mut ids: Vec<_> = bodies.iter().map(|&body| find(world, body)).collect::<Result<_, _>>()?;
        ids.sort_unstable();
        if let Some(twice) = ids.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(stale("body", world.mark.body(twice[0]).v));
        }
        ids.iter().try_for_each(|&id| world.dcd.can_remove(id))?;
        ids.into_iter().try_for_each(|id| remove(world, id))
    })
}

/// Removes a body that this process may remove.
fn remove(world: &mut World, id: BodyId) -> Result<(), Failure> {
    world.events.departs(id, world.dcd.user_data(id).unwrap_or(0) as u64);
    Ok(world.dcd.remove(id)?)
}

/// Returns whether the id names a body of this world. Returns false also from within a function that the library calls, and once
/// the world answers DCD_ERR_PANIC.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_body_is_valid(world: DcdWorld, body: DcdBodyId) -> bool {
    guard_value(false, || ask(world, |world| find(world, body)).is_ok())
}

/// Finds the body that the world numbered `index` when it was made: body i of a scene, or the i-th body that was created.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID (the body is destroyed, or there is none yet).
#[unsafe(no_mangle)]
pub unsafe extern "C" fn dcd_body_at(world: DcdWorld, index: u32, out: *mut DcdBodyId) -> DcdStatus {
    guard("dcd_body_at", || {
        // SAFETY: the caller vouches for `out`.
        let out = unsafe { Out::new(out, "out")? };
        ask(world, |world| {
            let id = BodyId::persistent(index);
            if !world.dcd.contains(id) {
                world.dcd.sees("see the bodies of its world")?;
                return Err(stale("body number", u64::from(index)));
            }
            out.write(world.mark.body(id));
            Ok(())
        })
    })
}

#[cfg(test)]
mod tests {
    use dcd::physics::ShapeLibrary;

    use super::*;
    use crate::definition::Made;
    use crate::ids::DcdShapeId;
    use crate::types::{
        DCD_BODY_CCD, DCD_BODY_DISABLED, DCD_BODY_FAST_SPIN, DCD_BODY_NO_GYRO, DCD_FIXED, DCD_KINEMATIC,
        DCD_KINEMATIC_POSE, DcdPose,
    };

    /// A definition with nothing at its default.
    fn unusual() -> DcdBodyDef {
        DcdBodyDef {
            struct_size: size_of::<DcdBodyDef>() as u32,
            body_type: DCD_DYNAMIC,
            pose: DcdPose { p: [100_000.125, -2.0, 3.0], q: [0.5, 0.5, 0.5, 0.5] },
            velocity: DcdVelocity { linear: [1.0, 2.0, 3.0], angular: [0.1, 0.2, 0.3] },
            shape: DcdShapeId { v: 0 },
            density: 3.0,
            mass: 0.0,
            friction: 0.9,
            restitution: 0.4,
            friction_rule: 2,
            restitution_rule: 5,
            contact_skin: 0.01,
            linear_damping: 0.25,
            angular_damping: 0.75,
            gravity_scale: -0.5,
            flags: 0,
            locked: 0,
            events: 3,
            force_threshold: 12.0,
            groups: 5,
            mask: 6,
            solver_groups: 7,
            solver_mask: 1 << 31,
            pairs: 42,
            dominance: -3,
            soft_ccd: 0.125,
            sleep_linear: 0.07,
            sleep_angular: 0.08,
            sleep_after: 3.0,
            extra_mass: 0.0,
            extra_centre: [0.0; 3],
            extra_inertia: [0.0; 3],
            extra_solver_iterations: 4,
            extra_pgs_iterations: 2,
            hooks: 5,
            user_data: u64::MAX - 5,
            material: 77,
        }
    }

    #[test]
    fn a_definition_is_recorded_as_the_body_that_rapiers_builders_make_of_it() {
        let flags = (0..8).map(|bit| DcdBodyDef { flags: 1 << bit, ..unusual() });
        let asleep = [DCD_BODY_NO_SLEEP, DCD_BODY_DISABLED].map(|flag| flag | DCD_BODY_ASLEEP);
        let several = [DCD_BODY_CCD | DCD_BODY_FAST_SPIN, DCD_BODY_NO_GYRO | DCD_BODY_ANY_GROUP, 0];
        let flags =
            flags.chain(asleep.into_iter().chain(several).map(|flags| DcdBodyDef { flags, ..unusual() }));
        let kinds = [DCD_FIXED, DCD_KINEMATIC, DCD_KINEMATIC_POSE];
        let kinds = kinds.map(|body_type| DcdBodyDef { body_type, flags: DCD_BODY_ASLEEP, ..unusual() });
        let locked = (0..7).map(|bit| DcdBodyDef { locked: (1 << bit) & 63, ..unusual() });
        let masses = [(2.5, [0.0; 3], [0.0; 3]), (2.5, [0.1, 0.2, 0.3], [1.0, 2.0, 0.0])];
        let masses = masses.map(|(extra_mass, extra_centre, extra_inertia)| DcdBodyDef {
            extra_mass,
            extra_centre,
            extra_inertia,
            mass: 8.0,
            ..unusual()
        });
        let mut shapes = ShapeLibrary::default();
        for def in flags.chain(kinds).chain(locked).chain(masses) {
            let shape = SharedShape::ball(0.5);
            let (kind, name) = (recorded_kind(def.body_type).unwrap(), shapes.intern(&shape).unwrap());
            let NewBody { pose, body, collider } = described(&def, shape).unwrap();
            let record = shapes.describe(BodyId::persistent(0), pose, &body, &[collider]).unwrap();
            assert_eq!(
                (def.state(), def.traits(kind, name), u128::from(def.user_data)),
                (record.state, (*record.traits).clone(), record.user_data),
                "{def:?}"
            );
        }
    }

    #[test]
    fn bodies_are_alike_whose_definitions_say_the_same_of_all_but_place_motion_and_user_data() {
        let (def, name) = (unusual(), ShapeHash([7; 16]));
        let mut made = Made::default();
        let traits = Arc::new(def.traits(BodyKind::Dynamic, name));
        made.keep(&def, Arc::clone(&traits));
        let elsewhere = DcdPose { p: [1.0, 2.0, 3.0], ..def.pose };
        let velocity = DcdVelocity { linear: [9.0; 3], ..def.velocity };
        let like_it = DcdBodyDef { pose: elsewhere, velocity, user_data: 5, ..def };
        assert!(made.like(&like_it).is_some_and(|known| Arc::ptr_eq(known, &traits)));
        let others = [
            DcdBodyDef { body_type: DCD_KINEMATIC, ..def },
            DcdBodyDef { shape: DcdShapeId { v: 1 }, ..def },
            DcdBodyDef { friction: 0.8, ..def },
            DcdBodyDef { flags: DCD_BODY_ASLEEP, ..def },
            DcdBodyDef { material: 78, ..def },
            DcdBodyDef { density: f32::NAN, ..def },
        ];
        assert!(others.iter().all(|other| made.like(other).is_none()));
        // Kinds take turns. Where there are more than are kept, those that were made first go.
        for (kinds, kept) in [(&others[..3], true), (&others[3..5], false)] {
            for other in kinds {
                made.keep(other, Arc::new(other.traits(BodyKind::Dynamic, name)));
            }
            assert_eq!(made.like(&def).is_some(), kept);
            assert!(kinds.iter().all(|other| made.like(other).is_some()));
        }
    }
}
