//! Steps a region's Rapier world by one substep, and collects its contact events and quarantined bodies.

use std::time::Instant;

use rapier3d::prelude::*;

use super::iterations::iteration_s;
use super::mass_splitting::MassSplit;
use super::{Region, kinematic_targets};
use crate::physics::hooks::Named;
use crate::space::BodyId;

impl Region {
    /// Returns whether its next substep is the first of a tick.
    pub(in crate::physics) fn begins_tick(&self) -> bool {
        self.targets.is_first()
    }

    /// Steps the Rapier world by one of `steps` substeps of a tick.
    pub(in crate::physics) fn step(&mut self, parameters: &IntegrationParameters, steps: usize) {
        let before = std::mem::replace(&mut self.world.integration_parameters, *parameters);
        let is_still = |region: &Self| region.world.islands.num_active_bodies() == 0;
        let unchanged = Some(self.revision).filter(|revision| *revision == self.stepped && is_still(self));
        if self.targets.is_first() {
            self.forget_quarantined();
            self.walk(parameters.dt * steps as f32);
        }
        self.drive_on(parameters.dt);
        kinematic_targets::approach(self, steps);
        self.tell_joints();
        self.stirred = false;
        self.wake_what_is_about_to_be_struck(parameters.dt);
        self.hand_awake_over();
        self.choose_joints();
        let woken = self.wake_newcomers(parameters.dt);
        self.moved.take();
        let start = Instant::now();
        match self.hooks.as_deref() {
            Some(hooks) => {
                let named = Named { hooks, listener: &self.listener, anchor: self.anchor, region: self.id() };
                self.world.step_with_events(&named, &self.listener);
            }
            None => self.world.step_with_events(&(), &self.listener),
        }
        self.slow_multibodies(parameters.max_linear_velocity());
        self.restore_limits(woken, parameters.dt);
        let (awake, joints) = (self.world.islands.num_active_bodies(), self.world.impulse_joints.len());
        self.profile.note(start.elapsed(), &self.world.physics_pipeline.counters, awake, joints);
        self.note_solved(before.dt);
        self.note_iterations(iteration_s(&before, 0));
        self.listener.remind(&mut self.world.colliders);
        let heard = self.events.forces.len();
        self.listener.drain(self.anchor, 1.0 / steps as f32, &mut self.events);
        self.events.make_tellable();
        self.answer_for_forces(heard);
        for handle in self.world.quarantine().bodies().to_vec() {
            self.set_aside(handle);
        }
        self.revision = unchanged.filter(|_| is_still(self)).unwrap_or(self.revision + 1);
        self.stepped = self.revision;
    }

    /// Slows each multibody of which a link is faster than a speed, m/s, as a whole: its centre, or what is farthest
    /// from it, by the link's spin. Rapier itself slows other bodies only.
    fn slow_multibodies(&mut self, most_m_s: f32) {
        let speed = |link: &MultibodyLink| {
            let (handle, body) = (link.rigid_body_handle(), &self.world.bodies[link.rigid_body_handle()]);
            body.linvel().length().max(body.angvel().length() * self.slot(handle).reach_m)
        };
        let fastest = |of: &Multibody| of.links().map(speed).fold(0.0, f32::max);
        let all =
            self.world.multibody_joints.multibodies().map(|of| (of.root().rigid_body_handle(), fastest(of)));
        let too_fast: Vec<_> = all.filter(|(_, fastest)| *fastest > most_m_s).collect();
        for (root, fastest) in too_fast {
            let (world, by) = (self.world_mut(), most_m_s / fastest);
            let index =
                world.multibody_joints.rigid_body_link(root).expect("the root of a multibody").multibody;
            let Some(multibody) = world.multibody_joints.get_multibody_mut(index) else { continue };
            multibody.generalized_velocity_mut().as_mut_slice().iter_mut().for_each(|v| *v *= by);
            for link in multibody.links() {
                let body = &mut world.bodies[link.rigid_body_handle()];
                let (linear, angular) = (body.linvel() * by, body.angvel() * by);
                body.set_linvel(linear, false);
                body.set_angvel(angular, false);
            }
        }
    }

    /// Notes the length of the substep in which the contacts of awake bodies have just been solved. Sleeping
    /// bodies keep the impulses of a substep that may have been longer or shorter. Rapier lets bodies fall
    /// asleep before it solves, so a body that is awake after a step has been solved in it.
    pub(in crate::physics) fn note_solved(&mut self, dt_before_s: f32) {
        let dt_s = self.world.integration_parameters.dt;
        if self.solved_dt_s.is_empty() && dt_s == dt_before_s {
            return;
        }
        self.solved_dt_s.resize(self.slots.len(), dt_before_s);
        for handle in self.world.islands.active_bodies() {
            self.solved_dt_s[handle.into_raw_parts().0 as usize] = dt_s;
        }
    }

    /// Keeps, of the contact forces from index `from` on, those that this region is to report.
    pub(in crate::physics) fn answer_for_forces(&mut self, from: usize) {
        let mut forces = std::mem::take(&mut self.events.forces);
        let heard = forces.split_off(from);
        forces.extend(heard.into_iter().filter(|force| self.answers_for(force.key.a, force.key.b)));
        self.events.forces = forces;
    }

    /// Returns whether this region reports a force between two bodies, of which `a` has the lower id. Where
    /// each copy has all of the mass, one of the regions that hold both reports it. Where masses are split,
    /// all regions do whose copies have a part.
    pub(in crate::physics) fn answers_for(&self, a: BodyId, b: BodyId) -> bool {
        let [a, b] = [a, b].map(|id| self.handle_of(id));
        let splits = |copy: Option<_>| {
            copy.and_then(|handle| self.mass_split(handle)).is_some_and(MassSplit::is_split)
        };
        if splits(a) || splits(b) {
            return [a, b].into_iter().flatten().all(|handle| self.counts(handle));
        }
        let [a, b] = [a, b].map(|copy| copy.map(|handle| self.slot(handle)));
        let teller = |slot: Option<_>, other| slot.and_then(|slot| self.teller(slot, other));
        teller(a, b).or_else(|| teller(b, a)) == Some(self.rank)
    }
}
