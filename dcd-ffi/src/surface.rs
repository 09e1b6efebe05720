//! What bodies are like to touch, and what they report: of bodies that are there already, those of scenes included.

use rapier3d::prelude::*;

use crate::body::{self, DCD_EVENT_CONTACT, DCD_EVENT_FORCE, DcdBodyId};
use crate::guard::guard;
use crate::pointer::check_not_negative;
use crate::status::{DcdStatus, Failure};
use crate::world::{DcdWorld, with};

/// In place of a part's number: all shapes of the body.
pub const DCD_ALL_PARTS: u32 = u32::MAX;

/// Sets what dcd_events tells of a body, as DcdBodyDef.events and force_threshold do when it is made: DCD_EVENT_… bits and
/// newtons. `part` is the number of one of its shapes, from 0, or DCD_ALL_PARTS.
///
/// Of a contact that is there already, the end is told only if the beginning was.
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a part that is not there, unknown bits or a threshold below 0,
/// DCD_ERR_UNSUPPORTED in a served world.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_body_set_events(
    world: DcdWorld,
    body: DcdBodyId,
    part: u32,
    events: u32,
    force_threshold: f32,
) -> DcdStatus {
    guard("dcd_body_set_events", || {
        body::check_bits(events, DCD_EVENT_CONTACT | DCD_EVENT_FORCE, "events")?;
        check_not_negative(force_threshold, "force_threshold")?;
        change(world, body, part, |collider| {
            collider.set_active_events(active_events(events));
            collider.set_contact_force_event_threshold(force_threshold);
        })
    })
}

/// Sets how a body slides and bounces: Coulomb coefficient, 0 or more, and restitution, 0 to 1. `part` as in
/// dcd_body_set_events.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a part that is not there or a coefficient out of range,
/// DCD_ERR_UNSUPPORTED in a served world.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_body_set_material(
    world: DcdWorld,
    body: DcdBodyId,
    part: u32,
    friction: f32,
    restitution: f32,
) -> DcdStatus {
    guard("dcd_body_set_material", || {
        check_not_negative(friction, "friction")?;
        check_not_negative(restitution, "restitution")?;
        change(world, body, part, |collider| {
            collider.set_friction(friction);
            collider.set_restitution(restitution);
        })
    })
}

/// Sets which groups a body belongs to and which it meets, as DcdBodyDef.groups and mask do. `part` as in
/// dcd_body_set_events.
///
/// Errors: DCD_ERR_NULL, DCD_ERR_STALE_ID, DCD_ERR_ARGUMENT for a part that is not there, DCD_ERR_UNSUPPORTED in a served
/// world.
#[unsafe(no_mangle)]
pub extern "C" fn dcd_body_set_groups(
    world: DcdWorld,
    body: DcdBodyId,
    part: u32,
    groups: u32,
    mask: u32,
) -> DcdStatus {
    guard("dcd_body_set_groups", || {
        change(world, body, part, |collider| collider.set_collision_groups(interaction(groups, mask)))
    })
}

/// Rapier's flags for DCD_EVENT_… bits.
pub(crate) fn active_events(bits: u32) -> ActiveEvents {
    let mut events = ActiveEvents::empty();
    events.set(ActiveEvents::COLLISION_EVENTS, bits & DCD_EVENT_CONTACT != 0);
    events.set(ActiveEvents::CONTACT_FORCE_EVENTS, bits & DCD_EVENT_FORCE != 0);
    events
}

pub(crate) fn interaction(groups: u32, mask: u32) -> InteractionGroups {
    let group = Group::from_bits_retain;
    InteractionGroups::new(group(groups), group(mask), InteractionTestMode::And)
}

fn change(
    world: DcdWorld,
    body: DcdBodyId,
    part: u32,
    mut change: impl FnMut(&mut Collider),
) -> Result<(), Failure> {
    with(world, |world| {
        world.backend.check_surfaces()?;
        let id = body::find(world, body)?;
        let parts = match part {
            DCD_ALL_PARTS => 0..world.backend.parts(id),
            part => part as usize..part as usize + 1,
        };
        for part in parts {
            world.backend.update_collider(id, part, &mut change)?;
        }
        Ok(())
    })
}
