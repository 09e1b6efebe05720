//! Carries the contacts of resting bodies over to another process. The sender tells how the bodies of a
//! region lay when their contacts were found, and records of the bodies include that. The receiver makes
//! bodies from such records in a region where nothing else moves yet. It finds their contacts as they lay
//! then, and lets them bear their loads before they move.

use std::collections::{BTreeMap, BTreeSet};

use rapier3d::prelude::*;

use super::mass_splitting::MassSplit;
use super::sleepers::Lulled;
use super::{BodyRef, Ownership, Region};
use crate::physics::contact_listener::TouchListener;
use crate::protocol::{Check, ContactOffset};
use crate::space::{BodyId, Tick, mixed};

/// The most bodies that press on each other for which contact offsets are told. Of a larger group only the
/// present poses are known.
const LARGEST: usize = 256;
/// The most silent steps in which contacts that have been found come to bear their loads. Towers of 100:1
/// sway by 9 cm/s after four, by 2 cm/s after eight, as in one world, and by 1 cm/s after sixteen. Thirty-two
/// gain nothing.
const SILENT_STEPS: usize = 16;
/// The most bodies that are stepped in all silent steps together. Many bodies get fewer steps, so that nobody
/// waits for long.
const SILENT_WORK: usize = 32_000;
/// The fewest silent steps, for any number of bodies. The first ones solve contacts as deep as they were
/// found, the others take that out again.
const FEWEST_STEPS: usize = 4;

impl Region {
    /// Returns how those of these bodies that are owned here, and the bodies that press on them, lay when
    /// their contacts were found, as far as that is known.
    pub(in crate::physics) fn contact_offsets(
        &self,
        tick: Tick,
        ids: &[BodyId],
    ) -> BTreeMap<BodyId, ContactOffset> {
        let (mut offsets, mut seen) = (BTreeMap::new(), BTreeSet::new());
        for handle in ids.iter().filter_map(|id| self.handle_of(*id)) {
            if !self.stands(handle) || seen.contains(&handle.into_raw_parts()) {
                continue;
            }
            let members = self.pressing_on(handle, &mut seen);
            if members.len() > LARGEST || !members.iter().all(|member| self.stands(member.handle)) {
                continue;
            }
            let lay = self.contact_poses(&members, tick).into_iter();
            let own: Vec<_> = lay.map(|(handle, pose)| (handle, self.offset_to(handle, &pose))).collect();
            if own.iter().all(|(_, offset)| offset.check().is_ok()) {
                offsets.extend(own.into_iter().map(|(handle, offset)| (self.slot(handle).id, offset)));
            }
        }
        offsets
    }

    /// Finds the contacts of inserted bodies where these `lay`, and solves them in silent steps, so that they
    /// are warm: after each of the steps all that moves is put back. A body that lay where it is now is put
    /// aside a little, since exactly flush faces lose contacts. Contacts that begin are reported as events.
    pub(in crate::physics) fn warm_up(
        &mut self,
        tick: Tick,
        parameters: &IntegrationParameters,
        lay: &[(RigidBodyHandle, Pose)],
    ) {
        let before = std::mem::replace(&mut self.world.integration_parameters, *parameters);
        let moves = |(_, body): &(RigidBodyHandle, &RigidBody)| !body.is_fixed() && body.is_enabled();
        let bodies = self.world.bodies.iter().filter(moves);
        let kept: Vec<_> = bodies.map(|(handle, body)| (handle, body.clone())).collect();
        let sleeps = |(_, body): &&(RigidBodyHandle, RigidBody)| body.is_dynamic() && body.is_sleeping();
        let sleepers: Vec<_> = kept.iter().filter(sleeps).map(|(handle, _)| *handle).collect();
        // Their contacts come to bear their loads as all others do.
        self.put_to_sleep.clear();
        self.turnover.born_asleep.clear();
        self.turnover.born_awake.clear();
        self.obstacles.clear();
        self.turnover.departed.clear();
        self.turnover.left.clear();
        sleepers.iter().for_each(|handle| self.world.bodies[*handle].wake_up(false));
        for &(handle, pose) in lay {
            // A disabled body is not put back, and touches nothing.
            if !self.world.bodies[handle].is_enabled() {
                continue;
            }
            let is_known = pose != *self.world.bodies[handle].position();
            let aside = if is_known { Vector::ZERO } else { self.aside(handle, mixed(tick.0)) };
            let pose = Pose::from_parts(pose.translation + aside, pose.rotation);
            self.world_mut().bodies[handle].set_position(pose, false);
        }
        // As before any step: Rapier must not come upon what was removed since the last one.
        self.tell_joints();
        self.hand_awake_over();
        let (last, any_sleeps) = (silent_steps(kept.len()), !sleepers.is_empty());
        for step in 0..=last + usize::from(any_sleeps) {
            kept.iter().for_each(|(handle, was)| self.carry_on(*handle, was, parameters.dt));
            let limits = if step > last { self.lull(&sleepers) } else { Vec::new() };
            self.world.step_with_events(&(), &TouchListener(&self.listener));
            self.restore_limits(Lulled { limits, ..Lulled::default() }, parameters.dt);
            for (handle, was) in &kept {
                // Rapier wakes what is moved. In the step before, resting bodies hardly move.
                let sleeper = was.is_sleeping() && was.is_dynamic();
                let is_left = sleeper && (step == last || self.world.bodies[*handle].is_sleeping());
                if !is_left {
                    self.put_back(*handle, was);
                }
            }
            for handle in self.world.quarantine().bodies().to_vec() {
                self.set_aside(handle);
            }
        }
        self.quarantined_before = !self.quarantined.is_empty();
        self.note_solved(before.dt);
        self.listener.drain(self.anchor, 1.0, &mut self.events);
        self.events.make_tellable();
    }

    /// Makes a position-based kinematic body go on at its speed for a step. Records hold no target, and
    /// without one it would stop.
    fn carry_on(&mut self, handle: RigidBodyHandle, was: &RigidBody, dt_s: f32) {
        let moves = was.linvel() != Vector::ZERO || was.angvel() != Vector::ZERO;
        if was.body_type() == RigidBodyType::KinematicPositionBased && moves {
            let next = was.predict_position_using_velocity(dt_s);
            self.world.bodies[handle].set_next_kinematic_position(next);
        }
    }

    /// Puts a body back to where and how it was. A body that has been woken stays awake.
    fn put_back(&mut self, handle: RigidBodyHandle, was: &RigidBody) {
        let body = &mut self.world.bodies[handle];
        body.set_position(*was.position(), false);
        if was.body_type() == RigidBodyType::KinematicPositionBased {
            body.set_next_kinematic_position(*was.next_position());
        }
        body.set_linvel(was.linvel(), false);
        body.set_angvel(was.angvel(), false);
        let fell_asleep = body.is_sleeping() && !was.is_sleeping();
        if fell_asleep {
            self.world.wake_up(handle, false);
        }
        if !was.is_sleeping() {
            let activation = self.world.bodies[handle].activation_mut();
            activation.time_since_can_sleep = was.activation().time_since_can_sleep;
        }
    }

    /// Returns a dynamic body and all dynamic bodies that press on it, directly or through others, in id
    /// order.
    fn pressing_on(&self, first: RigidBodyHandle, seen: &mut BTreeSet<(u32, u32)>) -> Vec<BodyRef> {
        let (mut members, mut open) = (Vec::new(), vec![first]);
        seen.insert(first.into_raw_parts());
        while let Some(handle) = open.pop() {
            members.push(BodyRef { id: self.slot(handle).id, handle });
            self.for_each_pair(handle, |other, pair| {
                let presses = pair.is_none_or(|pair| pair.total_impulse_magnitude() > 0.0);
                if presses && self.world.bodies[other].is_dynamic() && seen.insert(other.into_raw_parts()) {
                    open.push(other);
                }
            });
        }
        members.sort_unstable_by_key(|link| link.id);
        members
    }

    /// Returns whether a body may stand here by itself: this region alone says where it is, and no joint ties
    /// it.
    fn stands(&self, handle: RigidBodyHandle) -> bool {
        let slot = self.slot(handle);
        slot.role == Ownership::Owner
            && slot.joints.is_empty()
            && self.world.bodies[handle].is_dynamic()
            && !slot.mass_split.as_deref().is_some_and(MassSplit::is_split)
    }

    fn offset_to(&self, handle: RigidBodyHandle, lay: &Pose) -> ContactOffset {
        let is = self.world.bodies[handle].position();
        let turn = lay.rotation * is.rotation.inverse();
        let turn = if turn.w < 0.0 { -turn } else { turn };
        ContactOffset {
            moved_m: (lay.translation - is.translation).to_array(),
            turned: [turn.x, turn.y, turn.z],
        }
    }
}

/// Returns in how many silent steps the contacts of so many bodies come to bear their loads, once they are
/// found.
fn silent_steps(bodies: usize) -> usize {
    (SILENT_WORK / bodies.max(1)).clamp(FEWEST_STEPS, SILENT_STEPS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::host::processes::Processes;
    use crate::physics::{Partition, RegionHost, StepSettings};
    use crate::protocol::{BodyRecord, WorldPose};
    use crate::runtime::WorldConfig;
    use crate::scene::{Params, Scene};
    use crate::space::{Bounds, DistributionTree};

    /// Makes another process compute the only region of a world, from its bodies' records as `record` changes
    /// them.
    fn handed_over(host: &RegionHost, record: impl Fn(BodyRecord) -> BodyRecord) -> RegionHost {
        handed_over_at(host, host.tick(), record)
    }

    fn handed_over_at(
        host: &RegionHost,
        tick: Tick,
        record: impl Fn(BodyRecord) -> BodyRecord,
    ) -> RegionHost {
        let tree = host.partition().tree().clone();
        let leaf = tree.leaves().next().unwrap();
        let mut next = RegionHost::new(Partition::new(tree.clone(), None), *host.settings(), 1, &[]).unwrap();
        *next.shapes_mut() = host.shapes().clone();
        next.insert(host.scenery().cloned().collect(), &[]).unwrap();
        let bodies = host.records(&host.owned_bodies().map(|(id, ..)| id).collect::<Vec<_>>());
        let placed = bodies.into_iter().map(|body| (leaf, record(body))).collect();
        next.set_tick(tick);
        next.rebuild(&tree, &[leaf], placed, &[], &[]).unwrap();
        next.announce();
        next.exchange().unwrap();
        next
    }

    /// Returns the largest speed of a body against what carries it at `speed_m_s`, from two and a half
    /// seconds on, in m/s, for each stretch of 200 ticks. Before each stretch but the first another process
    /// takes over, from records as `record` changes them; without `record` the same process goes on.
    fn ride(
        scene: &Scene,
        speed_m_s: f32,
        carrier: RigidBodyType,
        stretches: usize,
        record: Option<impl Fn(BodyRecord) -> BodyRecord + Copy>,
    ) -> Vec<f32> {
        let (mut scene, speed) = (scene.clone(), Vector::new(speed_m_s, 0.0, 0.0));
        for body in &mut scene.bodies {
            body.body = body.body.clone().linvel(speed);
            if body.body.body_type == RigidBodyType::Fixed {
                body.body.body_type = carrier;
            }
        }
        scene.bounds = Bounds::new([-20.0, -1.0, -20.0], [300.0, 11.0, 20.0]);
        let tree = DistributionTree::halved(scene.bounds, 1).unwrap();
        let Processes(mut all) = Processes::cut(&scene, WorldConfig::for_scene(&scene).step, tree, 1);
        let mut host = all.remove(0);
        let step = |host: &mut RegionHost| {
            // The platform comes first.
            let (platform, _, mut pose, _) = host.states().next().unwrap();
            if carrier == RigidBodyType::KinematicPositionBased {
                pose.translation[0] += f64::from(speed_m_s * host.settings().dt_s);
                host.send_to(platform, pose).unwrap();
            }
            host.step().unwrap();
        };
        (0..150).for_each(|_| step(&mut host));
        let mut stretch = |at: usize| {
            if let Some(record) = record.filter(|_| at > 0) {
                host = handed_over(&host, record);
            }
            let mut worst_m_s = 0.0f32;
            for _ in 0..200 {
                step(&mut host);
                for (.., velocity) in host.states().skip(1) {
                    worst_m_s = worst_m_s.max((Vector::from_array(velocity.linear) - speed).length());
                }
            }
            worst_m_s
        };
        (0..stretches).map(&mut stretch).collect()
    }

    fn forgetful(mut body: BodyRecord) -> BodyRecord {
        body.state.contact_offset = None;
        body
    }

    fn worst(of: &[f32]) -> f32 {
        of.iter().copied().fold(0.0, f32::max)
    }

    fn goes_on_as_in_one_world(name: &str, params: &Params) {
        let scene = Scene::named(name, &params.clone().with("sleep", 0)).unwrap();
        let (by_speed, by_position) =
            (RigidBodyType::KinematicVelocityBased, RigidBodyType::KinematicPositionBased);
        for (speed_m_s, carrier) in [(0.0, by_speed), (6.0, by_speed), (6.0, by_position)] {
            let one_m_s = worst(&ride(&scene, speed_m_s, carrier, 3, None::<fn(BodyRecord) -> BodyRecord>));
            let worst_m_s = worst(&ride(&scene, speed_m_s, carrier, 11, Some(|body| body)));
            let of = format!("{name} {params:?} at {speed_m_s} m/s, {carrier:?}");
            println!("{of}: {worst_m_s:.4} m/s, in one world {one_m_s:.4}");
            assert!(worst_m_s < 1.3 * one_m_s + 0.005, "{of}: {worst_m_s} m/s, in one world {one_m_s}");
        }
    }

    #[test]
    fn towers_under_load_stand_as_in_one_world_while_one_process_after_the_other_computes_them() {
        for ratio in [1, 10, 30, 100] {
            goes_on_as_in_one_world("tower", &Params::new().with("top_mass_ratio", ratio));
        }
    }

    #[test]
    fn walls_and_pyramids_stand_as_in_one_world_while_one_process_after_the_other_computes_them() {
        goes_on_as_in_one_world("wall", &Params::new().with("width", 6).with("height", 8));
        goes_on_as_in_one_world("pyramid", &Params::new().with("base", 8).with("gap", 0));
    }

    /// As after the death of their process. Heavier towers lean farther each time.
    #[test]
    fn light_towers_are_not_shaken_where_nobody_knows_how_they_lay() {
        let scene = Scene::named("tower", &Params::new().with("sleep", 0)).unwrap();
        let all_m_s = ride(&scene, 0.0, RigidBodyType::KinematicVelocityBased, 11, Some(forgetful));
        assert!(worst(&all_m_s) < 0.03, "{all_m_s:?} m/s");
        let scene =
            Scene::named("tower", &Params::new().with("top_mass_ratio", 100).with("sleep", 0)).unwrap();
        let worst_m_s = worst(&ride(&scene, 0.0, RigidBodyType::KinematicVelocityBased, 4, Some(forgetful)));
        assert!(worst_m_s > 1.0, "{worst_m_s} m/s: Rapier has learnt better");
    }

    /// Makes a world of one region with a floor and bodies of 1 m, given by place, upward speed and
    /// restitution: balls if the restitution is above 0, else boxes.
    fn world_of(bodies: &[([f64; 3], f32, f32)]) -> RegionHost {
        world_of_sleepers(bodies, false)
    }

    fn world_of_sleepers(bodies: &[([f64; 3], f32, f32)], can_sleep: bool) -> RegionHost {
        let tree = DistributionTree::halved(Bounds::around([0.0; 3], [50.0; 3]), 1).unwrap();
        let leaves: Vec<_> = tree.leaves().collect();
        let step = StepSettings::default();
        let mut host = RegionHost::new(Partition::new(tree, None), step, 1, &leaves).unwrap();
        let (floor, top) = (RigidBodyBuilder::fixed().build(), WorldPose::at([0.0, -0.5, 0.0]));
        let slab = ColliderBuilder::cuboid(50.0, 0.5, 50.0).restitution(1.0);
        let mut all = vec![host.shapes_mut().describe(BodyId::persistent(0), top, &floor, &[slab]).unwrap()];
        for (id, &(at, rise_m_s, restitution)) in (1..).zip(bodies) {
            let body = RigidBodyBuilder::dynamic().linvel(Vector::Y * rise_m_s).can_sleep(can_sleep).build();
            let shape = match restitution > 0.0 {
                true => ColliderBuilder::ball(0.5).restitution(restitution),
                false => ColliderBuilder::cuboid(0.5, 0.5, 0.5)
                    .active_events(ActiveEvents::all())
                    .contact_force_event_threshold(0.0),
            };
            let (id, at) = (BodyId::persistent(id), WorldPose::at(at));
            all.push(host.shapes_mut().describe(id, at, &body, &[shape]).unwrap());
        }
        host.insert(all, &[]).unwrap();
        host
    }

    #[test]
    fn what_is_about_to_bounce_bounces_and_what_lies_tells_once_that_it_touches() {
        let mut host = world_of(&[([0.0, 0.5, 0.0], 0.0, 0.0), ([5.0, 0.55, 0.0], -5.0, 0.5)]);
        let rise = |host: &RegionHost, id: u32| {
            let (region, handle) = host.owned(BodyId::persistent(id)).unwrap();
            region.physics().bodies[handle].linvel().y
        };
        let told = |host: &RegionHost| {
            let events = || host.events();
            let begun = events().flat_map(|events| &events.touches).filter(|touch| touch.began).count();
            (begun, events().flat_map(|events| &events.forces).count())
        };
        host.step().unwrap();
        assert!(rise(&host, 2) < -4.5, "{} m/s: it has yet to bounce", rise(&host, 2));
        let mut next = handed_over(&host, |body| body);
        assert_eq!(told(&next), (1, 0), "forces are told of steps that count");
        (0..2).for_each(|_| next.step().unwrap());
        assert_eq!(told(&next), (1, 2));
        // The mean of its restitution and the floor's counts.
        assert!(rise(&next, 2) > 3.3 && rise(&next, 1).abs() < 0.01, "{} m/s", rise(&next, 2));
    }

    #[test]
    fn what_bounces_by_what_it_falls_on_alone_bounces() {
        let mut host = world_of(&[([0.0, 0.5, 0.0], 0.0, 0.0), ([5.0, 0.55, 0.0], -5.0, 0.0)]);
        let rise = |host: &RegionHost| host.states().last().unwrap().3.linear[1];
        host.step().unwrap();
        assert!(rise(&host) < -4.5, "{} m/s: it has yet to bounce", rise(&host));
        let mut next = handed_over(&host, |body| body);
        (0..2).for_each(|_| next.step().unwrap());
        // Half of the floor's restitution counts.
        assert!(rise(&next) > 2.0, "{} m/s", rise(&next));
    }

    #[test]
    fn contacts_of_any_number_of_bodies_come_to_bear_loads() {
        assert_eq!([0, 2_000, 4_000, 100_000].map(silent_steps), [16, 16, 8, 4]);
    }

    #[test]
    fn what_has_come_to_be_tied_is_not_solved_without_its_joints() {
        let mut host = world_of(&[([0.0, 0.5, 0.0], 0.0, 0.0), ([5.0, 0.5, 0.0], 0.0, 0.0)]);
        (0..60).for_each(|_| host.step().unwrap());
        let ids = [1, 2].map(BodyId::persistent);
        let mut bodies = host.records(&ids);
        assert!(bodies.iter().all(|body| body.state.contact_offset.is_some()));
        let hinge: GenericJoint = RevoluteJointBuilder::new(Vector::Z).into();
        let joint =
            crate::physics::joint_record(crate::space::JointId(1), ids[1], BodyId::persistent(0), &hinge);
        crate::physics::placement::note_standing(&mut bodies, &[joint]);
        assert_eq!([0, 1].map(|of| bodies[of].state.contact_offset.is_some()), [true, false]);
    }

    /// As after a restart of the server, which places the region's bodies anew: no step was made since its
    /// joints went.
    #[test]
    fn silent_steps_come_upon_no_joint_of_bodies_that_went() {
        let mut host = world_of(&[
            ([0.0, 0.5, 0.0], 0.0, 0.0),
            ([5.0, 0.5, 0.0], 0.0, 0.0),
            ([7.0, 0.5, 0.0], 0.0, 0.0),
        ]);
        let ids = [1, 2, 3].map(BodyId::persistent);
        let rope: GenericJoint = RopeJointBuilder::new(3.0).into();
        let joint = crate::physics::joint_record(crate::space::JointId(1), ids[1], ids[2], &rope);
        host.insert(Vec::new(), std::slice::from_ref(&joint)).unwrap();
        (0..60).for_each(|_| host.step().unwrap());
        let tree = host.partition().tree().clone();
        let leaf = tree.leaves().next().unwrap();
        let placed = host.records(&ids).into_iter().map(|body| (leaf, body)).collect();
        host.rebuild(&tree, &[leaf], placed, &[joint], &[]).unwrap();
        host.announce();
        host.exchange().unwrap();
        (0..10).for_each(|_| host.step().unwrap());
        assert!(ids.iter().all(|id| host.record(*id).unwrap().state.pose.translation[1] > 0.49));
        assert_eq!(host.regions().next().unwrap().physics().impulse_joints.len(), 1);
    }

    #[test]
    fn what_is_read_of_a_copy_bears_loads_where_that_says_how_anything_lay() {
        let mut host = world_of(&[([0.0, 0.5, 0.0], 0.0, 0.0), ([5.0, 0.5, 0.0], 0.0, 0.0)]);
        (0..60).for_each(|_| host.step().unwrap());
        let ids = [1, 2].map(BodyId::persistent);
        let of_one = |mut body: BodyRecord| {
            body.state.contact_offset = body.state.contact_offset.filter(|_| body.id == ids[0]);
            body
        };
        let tree = host.partition().tree().clone();
        let leaves: Vec<_> = tree.leaves().collect();
        let mut opened = RegionHost::new(Partition::new(tree, None), *host.settings(), 1, &leaves).unwrap();
        *opened.shapes_mut() = host.shapes().clone();
        let movable = host.records(&ids).into_iter().map(of_one);
        opened.insert_saved(host.scenery().cloned().chain(movable).collect(), &[]).unwrap();
        for next in [opened, handed_over_at(&host, Tick(0), of_one)] {
            let region = next.regions().next().unwrap();
            for id in ids {
                let collider = region.physics().bodies[region.handle_of(id).unwrap()].colliders()[0];
                let mut pairs = region.physics().narrow_phase.contact_pairs_with(collider);
                assert!(pairs.any(|pair| pair.total_impulse_magnitude() > 0.0), "{id}");
            }
        }
    }

    #[test]
    fn the_first_tick_tells_what_silent_steps_have_quarantined() {
        let mut host = world_of(&[([0.0, 0.5, 0.0], 0.0, 0.0), ([5.0, 0.5, 0.0], 0.0, 0.0)]);
        (0..60).for_each(|_| host.step().unwrap());
        let id = BodyId::persistent(2);
        let mut next = handed_over(&host, |mut body| {
            if body.id == id {
                body.state.velocity.linear = [f32::NAN; 3];
            }
            body
        });
        for told in [&[id][..], &[]] {
            next.step().unwrap();
            assert_eq!(next.regions().next().unwrap().quarantined(), told);
        }
    }

    #[test]
    fn only_what_is_asked_for_is_searched() {
        let at = |x: f64, y: f64| ([x, y, 0.0], 0.0, 0.0);
        let mut host = world_of(&[at(0.0, 0.5), at(0.0, 1.5), at(5.0, 0.5)]);
        (0..60).for_each(|_| host.step().unwrap());
        let found = |asked: &[u32]| {
            let ids: Vec<_> = asked.iter().map(|id| BodyId::persistent(*id)).collect();
            let offsets = host.regions().next().unwrap().contact_offsets(host.tick(), &ids);
            offsets.into_keys().map(BodyId::index).collect::<Vec<_>>()
        };
        assert_eq!([found(&[2]), found(&[3]), found(&[0])], [vec![1, 2], vec![3], vec![]]);
        assert_eq!(found(&[1, 2, 3]), [1, 2, 3]);
    }

    #[test]
    fn what_is_disabled_stays_where_it_is() {
        let mut host = world_of(&[([0.0, 0.5, 0.0], 0.0, 0.0), ([5.0, 0.5, 0.0], 0.0, 0.0)]);
        (0..60).for_each(|_| host.step().unwrap());
        let ids = [1, 2].map(BodyId::persistent);
        host.change_copies(ids[1], |body| body.set_enabled(false)).unwrap();
        let next = handed_over(&host, |body| body);
        for id in ids {
            let [before, after] = [&host, &next].map(|host| host.record(id).unwrap());
            assert_eq!(before.traits.enabled, id == ids[0]);
            assert_eq!(before.state.pose, after.state.pose, "{id}");
        }
    }

    #[test]
    fn what_sleeps_stays_where_it_is_however_often_another_process_takes_over() {
        let lies = |x: f64, y: f64| ([x, y, 0.0], 0.0, 0.0);
        let mut host =
            world_of_sleepers(&[lies(0.0, 0.5), lies(5.0, 0.5), lies(9.0, 0.5), lies(9.0, 1.5)], true);
        let poses =
            |host: &RegionHost| host.states().map(|(_, _, pose, _)| pose.translation).collect::<Vec<_>>();
        (0..300).for_each(|_| host.step().unwrap());
        let before = poses(&host);
        for known in [true, false] {
            for _ in 0..5 {
                assert!(host.awake_bodies().is_empty(), "known: {known}");
                host = handed_over(&host, |body| if known { body } else { forgetful(body) });
                for _ in 0..4 {
                    host.step().unwrap();
                    assert!(host.awake_bodies().is_empty(), "known: {known}");
                }
            }
        }
        let moved_m =
            |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|i| (a[i] - b[i]).abs()).fold(0.0, f64::max);
        let worst_m = before.iter().zip(&poses(&host)).map(moved_m).fold(0.0, f64::max);
        assert!(worst_m < 1e-4, "{worst_m} m");
    }

    #[test]
    fn what_lay_where_another_one_is_is_found_where_it_is() {
        let pair = [([0.0, 0.5, 0.0], 0.0, 0.0), ([0.0, 1.5, 0.0], 0.0, 0.0)];
        let host = |near: bool| {
            world_of(&[&pair[..], &[([1.03, 0.5, 0.0], 0.0, 0.5)][..usize::from(near)]].concat())
        };
        for (near, wanted) in [(false, true), (true, false)] {
            let mut host = host(near);
            (0..60).for_each(|_| host.step().unwrap());
            let aside = |mut body: BodyRecord| {
                let offset = ContactOffset { moved_m: [0.04, 0.0, 0.0], ..ContactOffset::default() };
                // The body next to them has no offset.
                body.state.contact_offset = (body.id != BodyId::persistent(3)).then_some(offset);
                body
            };
            let next = handed_over(&host, aside);
            let region = next.regions().next().unwrap();
            let handle = region.handle_of(BodyId::persistent(1)).unwrap();
            let before =
                host.regions().next().unwrap().world_pose(host.owned(BodyId::persistent(1)).unwrap().1);
            assert_eq!(region.world_pose(handle), before, "all is put back");
            let collider = region.physics().bodies[handle].colliders()[0];
            let mut pairs = region.physics().narrow_phase.contact_pairs_with(collider);
            assert_eq!(
                pairs.any(|pair| pair.total_impulse_magnitude() > 0.0),
                wanted,
                "something near: {near}"
            );
        }
    }
}
