//! Splits the mass of a body among its copies in several regions. Each copy that counts has a part of the
//! mass and of the user's force. It is also pushed by a force that makes up for missing neighbours at the
//! edge of an overlap.

use rapier3d::dynamics::RigidBodyAdditionalMassProps;
use rapier3d::prelude::*;
use serde::{Deserialize, Serialize};

use super::Region;
use crate::physics::record;
use crate::protocol::{BodyKind, BodyTraits, ColliderMass, ExtraMass, MassRecord};
use crate::space::RegionSet;

/// The factor by which a remembered force may grow per step. More is an impact, not a load to be evened out.
const IMPACT: f32 = 4.0;
/// The part of a tick in which the memory of forces follows, however many exchanges the tick has. Contact
/// forces of shorter steps are rougher, and copies that answer them at once drive each other apart. Four
/// exchanges squeezed boxes out from under a hundred courses and felled towers of 100:1, eight felled those
/// of 10:1; two held all of these.
const FORCE_MEMORY_TICKS: f32 = 0.5;
/// The most by which the memory of torques follows in an exchange. With more than two exchanges per tick it
/// must follow still more slowly than that of forces. Slowed by the square, it held with up to sixteen
/// exchanges; in proportion, it fell with eight.
const TORQUE_MEMORY: f32 = 0.3;

/// The split of one body's mass and user's force among regions, and the forces on the copy here.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(in crate::physics) struct MassSplit {
    /// The regions whose copies have a part of the mass. If this region is not among them, the copy here is a
    /// ghost that only follows.
    pub among: RegionSet,
    /// The number of parts into which the mass is split, of which the copy here has one.
    parts: usize,
    /// Says whether Rapier has quarantined the copy here, because its numbers were no longer finite.
    broken: bool,
    /// The user's force and torque on the whole body.
    user_force: Vector,
    user_torque: Vector,
    /// The force and torque on this copy that even out the edges of the overlap, until the next exchange.
    push: Vector,
    twist: Vector,
    /// The velocities with which the copy began the steps since the last exchange.
    start: Option<Start>,
}

/// The velocities of a copy at the beginning of the steps between two exchanges.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
struct Start {
    linear: Vector,
    /// The angular velocity as gyroscopic forces alone would have it at the end.
    angular: Vector,
    elapsed_s: f32,
}

impl MassSplit {
    fn whole(body: &RigidBody, rank: usize) -> Self {
        Self {
            among: RegionSet::only(rank),
            parts: 1,
            broken: false,
            user_force: body.user_force(),
            user_torque: body.user_torque(),
            push: Vector::ZERO,
            twist: Vector::ZERO,
            start: None,
        }
    }

    /// Returns whether the mass is split among several copies. If not, the owner's copy counts alone, and the
    /// others are ghosts that follow.
    pub(in crate::physics) fn is_split(&self) -> bool {
        self.among.len() > 1
    }

    /// Returns the linear velocity with which the copy began the steps since the last exchange; none before
    /// the first.
    pub(in crate::physics) fn began_with(&self) -> Option<Vector> {
        self.start.map(|start| start.linear)
    }

    /// Returns whether Rapier has quarantined the copy here.
    pub(in crate::physics) fn is_broken(&self) -> bool {
        self.broken
    }
}

impl Region {
    /// Returns the mass split of a body held here; none while one region alone holds it.
    #[inline]
    pub(in crate::physics) fn mass_split(&self, handle: RigidBodyHandle) -> Option<&MassSplit> {
        self.slot(handle).mass_split.as_deref()
    }

    fn mass_split_mut(&mut self, handle: RigidBodyHandle) -> Option<&mut MassSplit> {
        self.slot_mut(handle).mass_split.as_deref_mut()
    }

    /// Begins a mass split for a copy that has come to be held here whole, or is announced anew. All force on
    /// it is its user's.
    pub(in crate::physics) fn begin_mass_split(&mut self, handle: RigidBodyHandle) {
        let rank = self.rank;
        let whole = MassSplit::whole(&self.world.bodies[handle], rank);
        let (force, torque) = (whole.user_force, whole.user_torque);
        let mass_split = self.slot_mut(handle).mass_split.get_or_insert_with(|| Box::new(whole));
        (mass_split.user_force, mass_split.user_torque) = (force, torque);
    }

    /// Splits the mass of a body among these regions. From now on the copy here has its part of the mass and
    /// of joints' forces.
    pub(in crate::physics) fn split_mass_among(&mut self, handle: RigidBodyHandle, among: RegionSet) {
        if self.mass_split(handle).is_none() {
            let whole = MassSplit::whole(&self.world.bodies[handle], self.rank);
            self.slot_mut(handle).mass_split = Some(Box::new(whole));
        }
        let parts = self.parts_among(handle, among);
        let mass_split = self.mass_split_mut(handle).expect("it is shared out from now on");
        mass_split.among = among;
        if std::mem::replace(&mut mass_split.parts, parts) != parts {
            self.leave_at_rest(handle);
            self.divide(handle, parts);
        }
        for joint in self.slot(handle).joints.clone() {
            self.share_joint(joint);
        }
    }

    /// Ends the mass split of a body that this region alone holds from now on. It has all of its mass and
    /// only its user's force.
    pub(in crate::physics) fn undivide(&mut self, handle: RigidBodyHandle) {
        self.split_mass_among(handle, RegionSet::only(self.rank));
        self.push(handle, Vector::ZERO, Vector::ZERO);
        self.press(handle);
        self.slot_mut(handle).mass_split = None;
    }

    /// Sets the force and torque on a copy here that even out the edges of the overlap, in N and N m, from
    /// the next step on.
    pub(in crate::physics) fn push(&mut self, handle: RigidBodyHandle, push: Vector, twist: Vector) {
        if let Some(mass_split) = self.mass_split_mut(handle) {
            (mass_split.push, mass_split.twist) = (push, twist);
        }
    }

    /// Prepares a copy for a step: applies the forces on it. In the first step since the last exchange, also
    /// notes its velocities.
    pub(in crate::physics) fn prepare_copy(&mut self, handle: RigidBodyHandle, dt_s: f32) {
        let body = &self.world.bodies[handle];
        if body.is_sleeping() {
            return self.restart_copy(handle);
        }
        if !body.is_dynamic() {
            return;
        }
        let (linear, angular) = (body.linvel(), body.angvel_with_gyroscopic_forces(dt_s));
        let Some(mass_split) = self.mass_split_mut(handle) else { return };
        let start = mass_split.start.get_or_insert(Start { linear, angular, elapsed_s: 0.0 });
        start.elapsed_s += dt_s;
        self.press(handle);
    }

    /// Ends the steps since the last exchange. The next ones are measured from the copy's velocities at their
    /// beginning.
    pub(in crate::physics) fn restart_copy(&mut self, handle: RigidBodyHandle) {
        if let Some(mass_split) = self.mass_split_mut(handle) {
            mass_split.start = None;
        }
    }

    /// Enables a copy that Rapier has quarantined, so that it can be written.
    pub(in crate::physics) fn mend_copy(&mut self, handle: RigidBodyHandle) {
        if self.mass_split_mut(handle).is_some_and(|mass_split| std::mem::take(&mut mass_split.broken)) {
            self.world_mut().bodies[handle].set_enabled(true);
            self.note_awake(handle, false);
            self.look_at_ties();
        }
    }

    /// Gives up a body of which Rapier has quarantined all copies: it stays disabled until its user enables
    /// it.
    pub(in crate::physics) fn give_up_copies(&mut self, handle: RigidBodyHandle) {
        if let Some(mass_split) = self.mass_split_mut(handle) {
            (mass_split.user_force, mass_split.user_torque) = (Vector::ZERO, Vector::ZERO);
        }
        self.read_disabled(handle);
    }

    /// Notes that Rapier has quarantined a copy that was no longer finite. If several regions hold the body,
    /// the other copies decide.
    pub(super) fn set_aside(&mut self, handle: RigidBodyHandle) {
        let Some(slot) = self.slot_at(handle) else { return };
        self.quarantined.push(slot.id);
        self.note_awake(handle, false);
        match self.mass_split_mut(handle) {
            Some(mass_split) => mass_split.broken = true,
            None => self.read_disabled(handle),
        }
    }

    /// Reads the traits of a body that Rapier has disabled, without what only [`Region::refine`] gave it.
    fn read_disabled(&mut self, handle: RigidBodyHandle) {
        self.unrefine(handle);
        self.refresh(handle);
        self.tie_anew(handle);
    }

    /// Returns the smoothed force and torque of contacts and joints on a copy. They are measured since the
    /// last exchange, as what moved the copy besides gravity and the forces applied here, and low-pass
    /// filtered from the values `before`.
    pub(in crate::physics) fn strain(
        &self,
        handle: RigidBodyHandle,
        before: (Vector, Vector),
        tick_s: f32,
    ) -> (Vector, Vector) {
        let body = &self.world.bodies[handle];
        let Some(mass_split) = self.mass_split(handle) else { return before };
        // Frozen while asleep.
        let Some(start) = mass_split.start.filter(|_| body.is_dynamic() && !body.is_sleeping()) else {
            return before;
        };
        let (parts, mass) = (mass_split.parts.max(1) as f32, body.mass());
        let gravity = self.world.gravity;
        let gained = (body.linvel() - start.linear) / start.elapsed_s - gravity * body.gravity_scale();
        let mut force = gained * mass - mass_split.push - mass_split.user_force / parts;
        let spun = (body.angvel() - start.angular) / start.elapsed_s;
        let mut torque = inertia_times(body, spun) - mass_split.twist - mass_split.user_torque / parts;
        let most = IMPACT * (before.0.length() + mass * gravity.length().max(1.0));
        if force.length() > most {
            let cut = most / force.length();
            force *= cut;
            torque *= cut;
        }
        let follow = (start.elapsed_s / (FORCE_MEMORY_TICKS * tick_s)).min(1.0);
        let twist = TORQUE_MEMORY * follow * follow;
        (force * follow + before.0 * (1.0 - follow), before.1 + (torque - before.1) * twist)
    }

    /// Returns the impulse of contacts and joints on a copy with all of the mass, newton seconds, in a step of this
    /// length: what moved the copy besides gravity, damping and the forces applied here. Nothing is known along
    /// locked axes, nor of a vehicle, whose wheels push it, nor at the highest speed, nor if the copy has made several
    /// steps since the last exchange.
    pub(in crate::physics) fn push_in_step(
        &self,
        handle: RigidBodyHandle,
        dt_s: f32,
    ) -> Option<[Option<f32>; 3]> {
        let body = &self.world.bodies[handle];
        let mass_split = self.mass_split(handle).filter(|mass_split| mass_split.parts == 1)?;
        let start = mass_split.start.filter(|start| start.elapsed_s <= 1.01 * dt_s)?;
        let undamped = body.linvel() * (1.0 + dt_s * body.linear_damping());
        let is_capped = undamped.length() >= 0.999 * self.world.integration_parameters.max_linear_velocity();
        if !body.is_dynamic() || body.is_sleeping() || is_capped || self.slot(handle).traits.vehicle.is_some()
        {
            return None;
        }
        let gained = undamped - start.linear - self.world.gravity * (body.gravity_scale() * dt_s);
        let push = gained * body.mass() - (mass_split.push + mass_split.user_force) * dt_s;
        let moves = body.mass_properties().effective_inv_mass.to_array().map(|inverse| inverse != 0.0);
        let known = |i: usize| moves[i].then_some(push.to_array()[i]);
        Some(std::array::from_fn(known))
    }

    /// Returns the user's force and torque on the whole body, in N and N m, if it has a mass split.
    pub(super) fn user_load(&self, handle: RigidBodyHandle) -> Option<(Vector, Vector)> {
        self.mass_split(handle).map(|mass_split| (mass_split.user_force, mass_split.user_torque))
    }

    /// Returns the number of parts into which the mass of a body held here is split. Rapier's body in each
    /// region that counts has one of them.
    pub fn share_of(&self, handle: RigidBodyHandle) -> usize {
        self.slot_at(handle)
            .and_then(|slot| slot.mass_split.as_deref())
            .map_or(1, |mass_split| mass_split.parts)
    }

    /// Returns whether the copy of a body here counts: whether it is one of those among which the mass is
    /// split. Any other copy is a ghost that only follows them.
    pub(in crate::physics) fn counts(&self, handle: RigidBodyHandle) -> bool {
        let mass_split = self.slot_at(handle).and_then(|slot| slot.mass_split.as_deref());
        mass_split.is_none_or(|mass_split| mass_split.among.contains(self.rank))
    }

    /// Sets Rapier's forces on the copy to its part of the user's force, plus the push.
    fn press(&mut self, handle: RigidBodyHandle) {
        let Some(mass_split) = self.mass_split(handle) else { return };
        let parts = mass_split.parts.max(1) as f32;
        let (force, torque) = (
            mass_split.user_force / parts + mass_split.push,
            mass_split.user_torque / parts + mass_split.twist,
        );
        let body = &self.world.bodies[handle];
        if body.user_force() == force && body.user_torque() == torque {
            return;
        }
        let body = &mut self.world_mut().bodies[handle];
        body.reset_forces(false);
        body.reset_torques(false);
        body.add_force(force, false);
        body.add_torque(torque, false);
    }

    /// Lets a user see and change the body whole: with all of its mass and only the user's forces. Reads its
    /// traits anew.
    pub(super) fn change_whole<R>(
        &mut self,
        handle: RigidBodyHandle,
        change: impl FnOnce(&mut RigidBody) -> R,
    ) -> R {
        let Some(parts) = self.mass_split(handle).map(|mass_split| mass_split.parts) else {
            let extra_mass = self.slot(handle).traits.extra_mass;
            let result = change(&mut self.world_mut().bodies[handle]);
            self.refresh(handle);
            if self.slot(handle).traits.extra_mass != extra_mass {
                // Rapier itself does so only when it steps.
                let PhysicsWorld { bodies, colliders, .. } = self.world_mut();
                bodies[handle].recompute_mass_properties_from_colliders(colliders);
            }
            return result;
        };
        let before = self.lift(handle);
        // Changing colliders would wake the body, though its user may only look at it, or have put it to
        // sleep. So all of the mass is set as extra mass of the body, and its colliders count for none.
        let all = all_of(self.world.bodies[handle].mass_properties().local_mprops, parts);
        let body = &mut self.world_mut().bodies[handle];
        if parts > 1 {
            body.set_additional_mass_properties(all, false);
            body.recompute_mass_properties_from_colliders(&ColliderSet::new());
        }
        let result = change(body);
        let stood_in = RigidBodyAdditionalMassProps::MassProps(all);
        if parts > 1 && body.mass_properties().additional_local_mprops.as_deref() == Some(&stood_in) {
            let traits = self.slot(handle).traits.clone();
            divide_extra(&mut self.world_mut().bodies[handle], &traits, 1.0);
        }
        self.refresh(handle);
        let parts_now = self.parts_now(handle);
        if parts_now == parts {
            let traits = self.slot(handle).traits.clone();
            let PhysicsWorld { bodies, colliders, .. } = self.world_mut();
            divide_extra(&mut bodies[handle], &traits, 1.0 / parts as f32);
            bodies[handle].recompute_mass_properties_from_colliders(colliders);
        } else {
            self.divide(handle, parts_now);
        }
        self.lower(handle, parts_now, before);
        result
    }

    /// Lets a user change the body's colliders, which have all of their mass meanwhile.
    pub(super) fn change_colliders_whole<R>(
        &mut self,
        handle: RigidBodyHandle,
        change: impl FnOnce(&mut Region) -> R,
    ) -> R {
        if self.mass_split(handle).is_none() {
            return change(self);
        }
        let before = self.lift(handle);
        self.divide(handle, 1);
        let result = change(self);
        let parts = self.parts_now(handle);
        self.divide(handle, parts);
        self.lower(handle, parts, before);
        result
    }

    /// Takes away the force and torque that even out the edges, and returns them.
    fn lift(&mut self, handle: RigidBodyHandle) -> (Vector, Vector) {
        let mass_split = self.mass_split_mut(handle).expect("only what is shared out is lifted");
        let before = (mass_split.push, mass_split.twist);
        (mass_split.parts, mass_split.push, mass_split.twist) = (1, Vector::ZERO, Vector::ZERO);
        self.press(handle);
        before
    }

    /// Undoes [`Region::lift`], with the forces that the user left.
    fn lower(&mut self, handle: RigidBodyHandle, parts: usize, before: (Vector, Vector)) {
        let body = &self.world.bodies[handle];
        let (force, torque) = (body.user_force(), body.user_torque());
        let mass_split = self.mass_split_mut(handle).expect("only what is shared out was lifted");
        (mass_split.user_force, mass_split.user_torque) = (force, torque);
        (mass_split.push, mass_split.twist) = before;
        mass_split.parts = parts;
        // The user's change must not be taken for a contact force.
        (mass_split.start, mass_split.broken) = (None, false);
        self.press(handle);
    }

    /// Returns into how many parts the mass is to be split, by the body's present traits.
    fn parts_now(&self, handle: RigidBodyHandle) -> usize {
        self.mass_split(handle).map_or(1, |mass_split| self.parts_among(handle, mass_split.among))
    }

    fn parts_among(&self, handle: RigidBodyHandle, among: RegionSet) -> usize {
        if self.slot(handle).traits.kind == BodyKind::Dynamic { among.len().max(1) } else { 1 }
    }

    /// Scales every source of the body's mass, colliders and extra mass, to one of so many parts.
    fn divide(&mut self, handle: RigidBodyHandle, parts: usize) {
        let traits = self.slot(handle).traits.clone();
        let share = 1.0 / parts as f32;
        let PhysicsWorld { bodies, colliders, .. } = self.world_mut();
        let body = &mut bodies[handle];
        for (record, &collider) in traits.colliders.iter().zip(body.colliders()) {
            let collider = &mut colliders[collider];
            match &record.mass {
                ColliderMass::Density(density) => collider.set_density(density * share),
                ColliderMass::Mass(mass) => collider.set_mass(mass * share),
                ColliderMass::Properties(props) => {
                    collider.set_mass_properties(shared_properties(props, share));
                }
            }
        }
        divide_extra(body, &traits, share);
        body.recompute_mass_properties_from_colliders(colliders);
    }
}

fn inertia_times(body: &RigidBody, angular: Vector) -> Vector {
    let local = &body.mass_properties().local_mprops;
    let world_from_principal = *body.rotation() * local.principal_inertia_local_frame;
    world_from_principal * (local.principal_inertia() * (world_from_principal.inverse() * angular))
}

/// Returns the mass of so many equal parts together.
fn all_of(part: MassProperties, parts: usize) -> MassProperties {
    let parts = parts as f32;
    MassProperties {
        inv_mass: part.inv_mass / parts,
        inv_principal_inertia: part.inv_principal_inertia / parts,
        ..part
    }
}

fn divide_extra(body: &mut RigidBody, traits: &BodyTraits, share: f32) {
    match &traits.extra_mass {
        None => body.set_additional_mass_properties(MassProperties::default(), false),
        Some(ExtraMass::Mass(mass)) => body.set_additional_mass(mass * share, false),
        Some(ExtraMass::Properties(props)) => {
            body.set_additional_mass_properties(shared_properties(props, share), false);
        }
    }
}

fn shared_properties(props: &MassRecord, share: f32) -> MassProperties {
    let whole = record::mass_properties(props);
    MassProperties {
        inv_mass: whole.inv_mass / share,
        inv_principal_inertia: whole.inv_principal_inertia / share,
        ..whole
    }
}
