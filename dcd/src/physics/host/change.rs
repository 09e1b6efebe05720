//! Applies a user's changes to every copy of a body or joint alike: in place, by kinematic target or by
//! teleport.

use std::collections::BTreeMap;
use std::sync::Arc;

use rapier3d::prelude::*;

use super::{HostError, RegionHost, Side, StepSettings};
use crate::physics::articulation::LinkSettings;
use crate::physics::convert;
use crate::physics::partition::HUB_REACH_M;
use crate::physics::region::{Ownership, Region};
use crate::protocol::{
    BodyRecord, BodyState, Drive, Input, JointRecord, LinkMotion, Push, Velocity, WorldPose,
};
use crate::space::{BodyId, JointId};

/// The speed, m/s and rad/s, above which nothing pushes a body.
pub(in crate::physics) const MOST_M_S: f32 = 1e6;

impl RegionHost {
    /// Sets how the world is stepped from the next tick on. If gravity is another, wakes what sleeps, and has what is
    /// still begin anew to be so. The host must compute every region. The coupling, its exchanges, depth and island limit
    /// stay as they are.
    pub fn set_settings(&mut self, settings: StepSettings) {
        let StepSettings { coupling, exchanges, depth, island_limit, .. } = self.settings;
        let former = self.settings.gravity;
        self.settings = StepSettings { coupling, exchanges, depth, island_limit, ..settings };
        if settings.gravity == former {
            return;
        }
        self.sides.iter_mut().for_each(|side| side.region.set_gravity(settings.gravity));
        let falls = |(id, region, handle): (BodyId, &Region, RigidBodyHandle)| {
            region.physics().bodies[handle].is_dynamic().then_some(id)
        };
        for id in self.owned_bodies().filter_map(falls).collect::<Vec<_>>() {
            self.change_copies(id, |body| body.wake_up(true));
        }
    }

    /// Lets a user change a body in place. A body that becomes or ceases to be immovable is placed anew; so
    /// is an immovable body that was moved, and an untied one that was moved to where another region
    /// computes. Returns what [`RegionHost::change_copies`] would. A change that is refused leaves the body
    /// what and where it was.
    pub fn update<R>(
        &mut self,
        id: BodyId,
        change: impl FnMut(&mut RigidBody) -> R,
    ) -> Result<Option<R>, HostError> {
        let Some(was) = self.record(id) else { return Ok(None) };
        let before = self.places_of_immovable(id);
        let from = self.place_of_movable(id);
        let result = self.change_copies(id, change);
        let after = self.places_of_immovable(id);
        // Each region has its own space. The first one's is that of [`RegionHost::region_pose`].
        let moved = if after == before { None } else { after.first().copied() };
        self.settle(was, moved)?;
        if let (Some(from), Some(to)) = (from, self.place_of_movable(id)) {
            self.arrive(id, &from, &to)?;
        }
        Ok(result)
    }

    /// Returns the pose in world space of the owner's copy of a movable body, if that is here.
    fn place_of_movable(&self, id: BodyId) -> Option<WorldPose> {
        self.owned(id).map(|(region, handle)| region.world_pose(handle))
    }

    /// Returns the pose of an immovable body in each region that holds it, in world space; nothing for other
    /// bodies.
    fn places_of_immovable(&self, id: BodyId) -> Vec<WorldPose> {
        if self.statics.body(id).is_none() {
            return Vec::new();
        }
        self.regions().filter_map(|region| Some(region.world_pose(region.handle_of(id)?))).collect()
    }

    /// Applies a change to every copy of a body held here, so that owner and ghosts stay alike. Returns what
    /// `change` returned for the owner's copy, or for the first other copy if the owner is elsewhere. What is
    /// recorded of an immovable body keeps its place, and no body becomes movable or immovable by this.
    pub(crate) fn change_copies<R>(
        &mut self,
        id: BodyId,
        mut change: impl FnMut(&mut RigidBody) -> R,
    ) -> Option<R> {
        let mut result = None;
        for place in self.places_of(id) {
            let region = &mut self.sides[place].region;
            let Some(handle) = region.handle_of(id) else { continue };
            let role = region.slot(handle).role;
            let returned = region.change(handle, &mut change);
            if role == Ownership::Immovable {
                let user_data = region.physics().bodies[handle].user_data;
                self.statics.set_traits(id, &region.slot(handle).traits, user_data);
            }
            if role == Ownership::Owner || result.is_none() {
                result = Some(returned);
            }
        }
        result
    }

    /// Does what an input asks of a body, in every copy held here.
    pub fn obey(&mut self, input: &Input) {
        // Looked up only for a jump, as most inputs are no jumps.
        let jump = || input.jump_of(&self.record(input.body)?.traits);
        if let Some(pose) = input.pose.and_then(|_| jump()) {
            self.move_copies(input.body, pose);
        }
        match &input.drive {
            Some(drive) => self.drive(input.body, drive),
            None => self.steer(input.body, &input.velocity),
        };
    }

    /// Sets the velocity of a body, in every copy held here, and wakes it. For a character this is the
    /// velocity that it wants. Returns whether the body is held here.
    pub fn steer(&mut self, id: BodyId, velocity: &Velocity) -> bool {
        let mut walks = false;
        for place in self.places_of(id) {
            walks |= self.sides[place].region.set_wanted(id, velocity.linear);
        }
        self.change_copies(id, |body| {
            if !walks {
                body.set_linvel(Vector::from_array(velocity.linear), true);
            }
            body.set_angvel(Vector::from_array(velocity.angular), true);
        })
        .is_some()
    }

    /// Sets what the driver of a vehicle does, in every copy held here, and wakes it. Returns whether the
    /// body is held here and a vehicle.
    pub fn drive(&mut self, id: BodyId, drive: &Drive) -> bool {
        let mut drives = false;
        for place in self.places_of(id) {
            drives |= self.sides[place].region.set_drive(id, Some(*drive));
        }
        drives && self.change_copies(id, |body| body.wake_up(true)).is_some()
    }

    /// Returns whether a push would make a body faster than [`MOST_M_S`], and faster than it is. A force counts for one
    /// tick. Beyond single precision Rapier would take the body out of the world.
    pub fn is_too_much(&self, push: &Push) -> bool {
        let held =
            || self.regions().find_map(|region| region.handle_of(push.body).map(|handle| (region, handle)));
        let Some((region, handle)) = self.owned(push.body).or_else(held) else { return false };
        let body = &region.physics().bodies[handle];
        let mass = body.mass_properties();
        let seconds = if push.lasts { self.settings.dt_s } else { 1.0 };
        // A copy of a body that regions share has a part of its mass. One that only follows is pushed as if it moved.
        let scale = seconds / region.share_of(handle) as f32;
        let (linear, angular) = in_full(region, handle, push);
        let (inv_mass, inv_inertia) = match body.is_dynamic() {
            true => (mass.effective_inv_mass, mass.effective_world_inv_inertia),
            false => {
                let own = &mass.local_mprops;
                (Vector::splat(own.inv_mass), own.world_inv_inertia(body.rotation()))
            }
        };
        let is_too_fast = |before: Vector, more: Vector| {
            let after = before + more;
            !after.is_finite() || after.length() > MOST_M_S && after.length() > before.length()
        };
        is_too_fast(body.linvel(), linear * scale * inv_mass)
            || is_too_fast(body.angvel(), inv_inertia * (angular * scale))
    }

    /// Pushes a dynamic body, in every copy held here, and wakes it. Returns whether the body is held here. A push
    /// that is too much ([`RegionHost::is_too_much`]) is left out.
    pub fn push(&mut self, push: &Push) -> bool {
        if self.is_too_much(push) {
            // A builder may ask for thousands of these.
            tracing::debug!(body = %push.body, ?push, "a push is left out: the body would be too fast");
            return false;
        }
        let mut held = false;
        for place in self.places_of(push.body) {
            let region = &mut self.sides[place].region;
            let Some(handle) = region.handle_of(push.body) else { continue };
            let (linear, angular) = in_full(region, handle, push);
            region.change(handle, |body| {
                if push.lasts {
                    body.reset_forces(true);
                    body.reset_torques(true);
                    body.add_force(linear, true);
                    body.add_torque(angular, true);
                } else {
                    body.apply_impulse(linear, true);
                    body.apply_torque_impulse(angular, true);
                }
            });
            held = true;
        }
        held
    }

    /// Returns the centre of mass of a body, in world space, from its owner's copy, or from another one if
    /// that is elsewhere.
    pub fn centre_of_mass(&self, id: BodyId) -> Option<[f64; 3]> {
        let held = || self.regions().find_map(|region| Some((region, region.handle_of(id)?)));
        let (region, handle) = self.owned(id).or_else(held)?;
        Some(centre_in(region, handle))
    }

    /// Applies a change to one collider of a body, in every copy held here. `index` counts colliders in order
    /// of insertion. Returns what [`RegionHost::change_copies`] would. A body whose shape changed is placed
    /// anew, and so is an immovable one whose collider was moved: Rapier 0.36.1 does not forget all contacts
    /// of a compound that becomes something else. If a shape is refused, nothing changes.
    pub fn update_collider<R>(
        &mut self,
        id: BodyId,
        index: usize,
        mut change: impl FnMut(&mut Collider) -> R,
    ) -> Result<Option<R>, HostError> {
        let shape_of = |body: &BodyRecord| body.traits.colliders.get(index).map(|collider| collider.shape);
        let shape = self.record(id).as_ref().and_then(shape_of);
        let (mut result, mut reach_m) = (None, 0.0f32);
        for place in self.places_of(id) {
            let region = &mut self.sides[place].region;
            let Some(handle) = region.handle_of(id) else { continue };
            let role = region.slot(handle).role;
            let Some(returned) = region.update_collider(handle, index, &mut self.shapes, &mut change) else {
                return Ok(None);
            };
            // All copies refuse the same.
            let returned = returned?;
            reach_m = reach_m.max(region.slot(handle).reach_m);
            if role == Ownership::Owner || result.is_none() {
                result = Some(returned);
            }
        }
        match self.statics.body(id).cloned() {
            Some(known) => {
                let copies = self.regions().filter_map(|region| Some((region, region.handle_of(id)?)));
                let Some(traits) = copies.map(|(region, handle)| region.slot(handle).traits.clone()).next()
                else {
                    return Ok(result);
                };
                let (old, new) = (&known.traits.colliders[index], &traits.colliders[index]);
                if (old.shape, old.pose) == (new.shape, new.pose) {
                    self.statics.set_traits(id, &traits, known.user_data);
                } else {
                    self.replace(BodyRecord { traits, ..known })?;
                }
            }
            None => {
                Arc::make_mut(&mut self.partition).widen_halo(reach_m);
                if let Some(body) = self.record(id).filter(|body| shape_of(body) != shape) {
                    self.replace(body)?;
                }
            }
        }
        Ok(result)
    }

    /// Applies a change to every copy of a joint held here. Returns whether there is one.
    pub fn update_joint(&mut self, id: JointId, mut change: impl FnMut(&mut GenericJoint)) -> bool {
        let mut found = false;
        for Side { region, .. } in &mut self.sides {
            found |= region.change_joint(id, &mut change);
        }
        found
    }

    /// Changes the link settings of a multibody joint. Returns whether there is such a joint.
    pub fn update_link(&mut self, id: JointId, settings: &LinkSettings) -> bool {
        let mut found = false;
        for Side { region, .. } in &mut self.sides {
            found |= region.change_link(id, settings);
        }
        found
    }

    /// Returns the position and velocity of a link of a multibody, if its region is computed here and has
    /// stepped.
    pub fn link_motion(&self, id: JointId) -> Option<LinkMotion> {
        self.regions().find_map(|region| region.link_motion(id))
    }

    /// Sets the velocity of a link of a multibody, by degree of freedom. Returns whether there is such a
    /// joint.
    pub fn set_link_velocity(&mut self, id: JointId, velocity: [f32; 6]) -> bool {
        let mut found = false;
        for Side { region, .. } in &mut self.sides {
            found |= region.set_link_velocity(id, velocity);
        }
        found
    }

    /// Returns the whole record of a joint, if any region here holds it.
    pub fn joint(&self, id: JointId) -> Option<JointRecord> {
        self.regions().find_map(|region| region.joint_record(id))
    }

    /// Returns the whole records of a body's joints, by id. The joints of an immovable body lie in many
    /// regions, each of which has those of its own bodies.
    pub fn all_joints_of(&self, id: BodyId) -> BTreeMap<JointId, JointRecord> {
        let regions = self.places_of(id).map(|place| &self.sides[place].region);
        let holders = regions.filter_map(|region| Some((region, region.handle_of(id)?)));
        let joints = holders.flat_map(|(region, handle)| region.joints_of(handle));
        joints.map(|joint| (joint.id, joint)).collect()
    }

    /// Returns the load on the locked axes of a joint in the last step: newtons along the three axes of its
    /// frame, newton metres about them. It is summed over the regions here that bear a part of it; copies
    /// that only follow do not have the joint's load. Rapier first makes what it solves orthogonal, so the
    /// numbers of several axes are mixed.
    pub fn joint_load(&self, id: JointId) -> Option<[f32; 6]> {
        let loads = self.regions().filter_map(|region| {
            let load = region.joint_load(id)?;
            let bears = region.joint_bodies(id).is_some_and(|(a, b)| region.answers_for(a.min(b), a.max(b)));
            Some(if bears { load } else { [0.0; 6] })
        });
        loads.reduce(|sum, load| std::array::from_fn(|axis| sum[axis] + load[axis]))
    }

    /// Sets the kinematic target of a position-based kinematic body: its pose at the end of the next tick.
    /// Returns whether any region here holds the body.
    pub fn send_to(&mut self, id: BodyId, pose: WorldPose) -> Result<bool, HostError> {
        if !pose.is_valid() {
            return Err(HostError::NotFinite(id));
        }
        let mut held = false;
        for place in self.places_of(id) {
            let region = &mut self.sides[place].region;
            if let Some(handle) = region.handle_of(id) {
                let pose = convert::region_from_world(region.anchor(), &pose);
                region.change(handle, |body| body.set_next_kinematic_position(pose));
                held = true;
            }
        }
        Ok(held)
    }

    /// Returns the kinematic target of a body owned here, if it has one.
    pub(super) fn target_of(&self, id: BodyId) -> Option<WorldPose> {
        let (owner, handle) = self.owned(id)?;
        let body = &owner.physics().bodies[handle];
        let is_sent = body.body_type() == RigidBodyType::KinematicPositionBased
            && body.next_position() != body.position()
            && !body.is_sleeping();
        let target = is_sent.then(|| convert::world_from_region(owner.anchor(), body.next_position()));
        // The next step quarantines what is not finite.
        target.filter(WorldPose::is_valid)
    }

    /// Sets the kinematic targets of the first ghosts of new bodies. A record does not hold a target that was
    /// set before any step, so the target is taken from the owner's copy.
    pub(super) fn target_newcomers(&mut self, fresh: &[BodyId]) {
        for &id in fresh {
            if let Some(to) = self.target_of(id) {
                let rank = self.present_place(id).0;
                for Side { region, .. } in self.sides.iter_mut().filter(|side| side.region.rank() != rank) {
                    if let Some(handle) = region.handle_of(id) {
                        let to = convert::region_from_world(region.anchor(), &to);
                        region.change(handle, |body| body.set_next_kinematic_position(to));
                    }
                }
            }
        }
    }

    /// Returns the mass of a movable body held here, in kilograms: the whole mass even where it is split
    /// among regions.
    pub fn mass_kg(&self, id: BodyId) -> Option<f32> {
        let of = |region: &Region, handle: RigidBodyHandle| {
            region.physics().bodies[handle].mass() * region.share_of(handle) as f32
        };
        let here = || self.regions().find_map(|region| Some(of(region, region.handle_of(id)?)));
        self.owned(id).map(|(region, handle)| of(region, handle)).or_else(here)
    }

    /// Converts a pose from world space to the space of the region that owns a body, or of one that holds it.
    pub fn region_pose(&self, id: BodyId, pose: &WorldPose) -> Option<Pose> {
        let holds = |region: &&Region| region.handle_of(id).is_some();
        let owner = self.owned(id).map(|(region, _)| region);
        let region = owner.or_else(|| self.regions().find(holds))?;
        Some(convert::region_from_world(region.anchor(), pose))
    }

    /// Moves a body to a pose in world space, in every copy. An immovable body is placed anew. So is an
    /// untied one that comes to another cell, or far off in the same one, if its owner does not compute that
    /// cell. Returns whether the body is held here.
    pub fn teleport(&mut self, id: BodyId, pose: WorldPose) -> Result<bool, HostError> {
        if !pose.is_valid() {
            return Err(HostError::NotFinite(id));
        }
        self.meet_all();
        if let Some(body) = self.statics.body(id) {
            let mut body = body.clone();
            body.state.pose = pose;
            let joints = self.all_joints_of(id);
            self.reinsert(vec![body], &joints.into_values().collect::<Vec<_>>())?;
            return Ok(true);
        }
        let Some(record) = self.record(id) else { return Ok(false) };
        let is_free = self.joints_of(id).next().is_none();
        let is_jump = self.is_jump(&record.state.pose, &pose);
        // A body that is moved wakes, wherever it comes to lie.
        let state = BodyState { pose, sleeping: false, still_s: 0.0, ..record.state };
        let moved = BodyRecord { state, ..record };
        if is_free && is_jump && self.partition.rank_at(pose.translation) != self.present_place(id).0 {
            self.reinsert(vec![moved], &[])?;
            return Ok(true);
        }
        Ok(self.move_copies(id, pose))
    }

    /// Returns whether a body that is put elsewhere leaves what it touched, so that it should be computed
    /// where it comes to lie. That is so in another cell, and far off in the same one: the island for which
    /// another region computes the body is not there.
    fn is_jump(&self, from: &WorldPose, to: &WorldPose) -> bool {
        let [before, after] = [from, to].map(|pose| self.partition.rank_at(pose.translation));
        let way = (0..3).map(|i| to.translation[i] - from.translation[i]);
        let way_m = way.map(|v| v * v).sum::<f64>().sqrt();
        before != after || way_m > f64::from(HUB_REACH_M)
    }

    /// Places anew a body that a user has put elsewhere, with what it meets there.
    fn arrive(&mut self, id: BodyId, from: &WorldPose, to: &WorldPose) -> Result<(), HostError> {
        // The next step quarantines what is not finite.
        if !to.is_valid() || !self.is_jump(from, to) {
            return Ok(());
        }
        let rank = self.partition.rank_at(to.translation);
        self.meet_all();
        let record = self.record(id).filter(|body| body.state.velocity.is_finite());
        if let Some(record) = record
            && rank != self.present_place(id).0
            && self.joints_of(id).next().is_none()
        {
            self.reinsert(vec![record], &[])?;
        }
        Ok(())
    }

    /// Sets pose (in region space) and velocity of the owner's copy alone, and wakes nothing: a deliberate
    /// fault, to see that it is found. Returns whether the body is owned here.
    pub(crate) fn disturb(&mut self, id: BodyId, pose: Pose, linvel: Vector, angvel: Vector) -> bool {
        let Some(home) = self.owner_index.home(id) else { return false };
        let Some(place) = self.place_of[home.rank] else { return false };
        self.sides[place].region.change(home.handle, |body| {
            body.set_position(pose, false);
            body.set_linvel(linvel, false);
            body.set_angvel(angvel, false);
        });
        true
    }

    /// Moves every copy held here to a pose. The next exchange hands the body over if it left its region.
    /// Returns whether any region here holds it.
    pub fn move_copies(&mut self, id: BodyId, pose: WorldPose) -> bool {
        let mut held = false;
        for place in self.places_of(id) {
            let region = &mut self.sides[place].region;
            if let Some(handle) = region.handle_of(id) {
                let pose = convert::region_from_world(region.anchor(), &pose);
                region.change(handle, |body| body.set_position(pose, true));
                held = true;
            }
        }
        held
    }
}

/// Returns the linear and the angular part of a push on a copy of a body, about the centre of this copy itself: on
/// nodes, the owner's copy may be elsewhere.
fn in_full(region: &Region, handle: RigidBodyHandle, push: &Push) -> (Vector, Vector) {
    let linear = Vector::from_array(push.linear);
    let centre = centre_in(region, handle);
    let arm = push.point.map_or(Vector::ZERO, |point| {
        Vector::from_array(std::array::from_fn(|i| (point[i] - centre[i]) as f32))
    });
    (linear, Vector::from_array(push.angular) + arm.cross(linear))
}

/// Returns the centre of mass of a copy, in world space, even right after the copy was moved.
fn centre_in(region: &Region, handle: RigidBodyHandle) -> [f64; 3] {
    let (body, pose) = (&region.physics().bodies[handle], region.motion(handle).0);
    let arm = (*body.rotation() * body.local_center_of_mass()).to_array();
    std::array::from_fn(|i| pose.translation[i] + f64::from(arm[i]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::host::processes::Processes;
    use crate::physics::region::BodyRef;
    use crate::physics::{Coupling, Partition};
    use crate::scene::{Params, Scene};
    use crate::space::{Axis, Bounds, DistributionTree};

    /// Two boxes of 1 kg that touch over the border of two regions, on a floor.
    fn pair() -> RegionHost {
        let bounds = Bounds::around([0.0; 3], [20.0; 3]);
        let tree = DistributionTree::cut_by(bounds, &[(Axis::X, 0.0)]).unwrap();
        let partition = Partition::new(tree, None);
        let leaves = partition.leaves().to_vec();
        let settings =
            StepSettings { island_limit: 0, ..StepSettings::default().with_coupling(Coupling::Overlap) };
        let mut host = RegionHost::new(partition, settings, 1, &leaves).unwrap();
        let boxes = [(0, RigidBodyBuilder::fixed(), -0.5), (1, RigidBodyBuilder::dynamic(), 0.5)];
        let boxes = boxes.into_iter().chain([(2, RigidBodyBuilder::dynamic(), 0.5)]);
        let records = boxes.map(|(id, body, y)| {
            let half = if id == 0 { 10.0 } else { 0.5 };
            let collider = ColliderBuilder::cuboid(half, 0.5, half);
            let x = [0.0, -0.5, 0.5][id as usize];
            let pose = WorldPose::at([x, y, 0.0]);
            host.shapes_mut()
                .describe(BodyId::persistent(id), pose, &body.can_sleep(false).build(), &[collider])
                .unwrap()
        });
        let records = records.collect();
        host.insert(records, &[]).unwrap();
        for _ in 0..20 {
            host.step().unwrap();
        }
        host
    }

    #[test]
    fn what_arrived_and_was_removed_does_not_come_back() {
        let mut host = pair();
        let id = BodyId::persistent(1);
        let (region, handle) = host.owned(id).unwrap();
        let (rank, transfers) = (region.rank(), host.transfers());
        host.sides[rank].border.note_arrival(BodyRef { id, handle });
        host.note_arrivals();
        assert_eq!(host.owned(id).map(|(region, _)| region.rank()), Some(rank));
        host.remove(id);
        // An exchange in which this region takes no part.
        host.note_arrivals();
        assert!(host.owned(id).is_none() && host.transfers() == transfers + 1);
    }

    /// A copy here may lie a little off the owner's, which may be elsewhere.
    #[test]
    fn a_push_at_a_point_does_the_same_wherever_the_owner_is_computed() {
        let scene = Scene::named("tower", &Params::default()).unwrap();
        let settings = StepSettings::default().with_coupling(Coupling::Overlap);
        let mut all = [1, 2].map(|count| Processes::of(&scene, settings, 2, count));
        let mut pushed = 0;
        for tick in 0..120 {
            if tick % 20 == 10 {
                let held =
                    |host: &RegionHost, id| host.regions().all(|region| region.handle_of(id).is_some());
                let ids: Vec<_> = all[0].states().into_iter().map(|(id, ..)| id).collect();
                for id in ids.into_iter().filter(|&id| held(&all[0].0[0], id)).collect::<Vec<_>>() {
                    let [x, y, z] = all[0].0[0].record(id).unwrap().state.pose.translation;
                    let push = Push::impulse(id, [0.0, 0.0, 0.5]).at([x + 0.1, y + 0.1, z]);
                    all.iter_mut().flat_map(|processes| &mut processes.0).for_each(|host| {
                        host.push(&push);
                    });
                    pushed += 1;
                }
            }
            all.iter_mut().for_each(Processes::step);
            assert_eq!(all[0].states(), all[1].states(), "tick {tick}");
        }
        assert!(pushed > 0);
    }

    #[test]
    fn a_push_beyond_all_speed_is_left_out() {
        let id = BodyId::persistent(1);
        let pushes = [
            Push::torque_impulse(id, [0.0, 1e20, 0.0]),
            Push::impulse(id, [3e38, 0.0, 0.0]),
            Push::force(id, [0.0; 3], [0.0, 1e30, 0.0]),
            Push::force(id, [0.0, 1e12, 0.0], [0.0; 3]),
        ];
        let after = |push: Option<&Push>| {
            let mut host = pair();
            host.step().unwrap();
            let is_done = push.map(|push| host.push(push));
            (0..3).for_each(|_| host.step().unwrap());
            let at = host.states().find(|(of, ..)| *of == id).map(|(_, _, pose, _)| pose);
            (is_done, at.unwrap())
        };
        let (_, at_rest) = after(None);
        for push in &pushes {
            assert_eq!(after(Some(push)), (Some(false), at_rest), "{push:?}");
        }
        let (is_done, at) = after(Some(&Push::impulse(id, [0.0, 9.0, 0.0])));
        assert!(is_done == Some(true) && at != at_rest);
    }

    #[test]
    fn a_copy_that_is_not_finite_is_restored_from_the_others() {
        let mut host = pair();
        let id = BodyId::persistent(1);
        let handle = host.sides[0].region.handle_of(id).unwrap();
        assert_eq!(host.sides[0].region.share_of(handle), 2);
        host.sides[0].region.world_mut().bodies[handle].set_linvel(Vector::splat(f32::NAN), true);
        host.step().unwrap();
        assert_eq!(host.sides[0].region.quarantined(), [id]);
        for _ in 0..60 {
            host.step().unwrap();
        }
        for region in host.regions() {
            let body = &region.physics().bodies[region.handle_of(id).unwrap()];
            assert!(body.is_enabled() && region.quarantined().is_empty());
            assert!(
                (body.translation() - Vector::new(-0.5, 0.5, 0.0)).length() < 0.01,
                "{}",
                body.translation()
            );
        }
    }
}
