//! Leads bodies after another group that is authoritative for them (inter-group correction, thesis 3.3.8), unless they were
//! just hit here.

use rapier3d::prelude::*;

use crate::cluster::{correction, deviation_m, shift};
use crate::physics::{Hits, Ownership, Region, RegionHost};
use crate::protocol::{BodyKind, BodyRecord, SharedState, Velocity};
use crate::space::{BodyId, Tick};

/// For how many ticks after a body was led hits are noted.
const FORGET_TICKS: u64 = 60;

/// The hits of the bodies of a world in which some are led.
#[derive(Clone, Default)]
pub(super) struct Led {
    /// When a body was led last; `None` where none was of late.
    last: Option<Tick>,
    /// By how many ticks what was told of bodies then came late at most.
    late: u64,
    /// The bodies that do not sleep, in id order. A body is led first when it has come off its course, maybe by a hit.
    hits: Vec<(BodyId, Hits)>,
}

impl Led {
    /// Corrects bodies towards their states in the authoritative group after tick `told`.
    ///
    /// A body that was hit since then goes on as it does here: the authoritative group may have computed the same hit
    /// by now. To be put back to where it was about to be hit, it would hit again, and as if it were infinitely heavy.
    ///
    /// A body that is `stuck` behind another one is put there, in every copy held here, unless joints hold it.
    pub(super) fn lead(
        &mut self,
        host: &mut RegionHost,
        told: Tick,
        states: &[SharedState],
        stuck: &[BodyId],
        band_m: f64,
    ) {
        // Poses here are those after the last tick.
        let now = host.tick();
        let late = now.0.saturating_sub(told.0);
        let lag_s = (now.0 as f64 - told.0 as f64) * f64::from(host.settings().dt_s);
        let until_now = if self.last == Some(now) { self.late } else { 0 };
        (self.last, self.late) = (Some(now), until_now.max(late.min(FORGET_TICKS)));
        for state in states {
            if stuck.binary_search(&state.id).is_ok() && put(host, state, lag_s) {
                continue;
            }
            let known = self.hits.binary_search_by_key(&state.id, |(id, _)| *id);
            if !known.is_ok_and(|at| self.hits[at].1.outdate(told, late)) {
                lead(host, state, lag_s, band_m);
            }
        }
    }

    /// Notes how bodies move before a step.
    pub(super) fn look_ahead(&mut self, host: &RegionHost) {
        let mut known = std::mem::take(&mut self.hits).into_iter().peekable();
        let is_of_late = |last: &Tick| last.0 + FORGET_TICKS > host.tick().0;
        if !self.last.as_ref().is_some_and(is_of_late) {
            *self = Self::default();
            return;
        }
        for (id, region, handle) in free_copies(host) {
            while known.next_if(|(other, _)| *other < id).is_some() {}
            let mut hits = known.next_if(|(other, _)| *other == id).unwrap_or_default().1;
            hits.look_ahead(&region.physics().bodies[handle]);
            self.hits.push((id, hits));
        }
    }

    /// Notes which bodies were hit in the last step.
    pub(super) fn look_back(&mut self, host: &RegionHost) {
        if self.hits.is_empty() {
            return;
        }
        let mut known = self.hits.iter_mut().peekable();
        for (id, region, handle) in free_copies(host) {
            while known.next_if(|(other, _)| *other < id).is_some() {}
            if let Some((_, hits)) = known.next_if(|(other, _)| *other == id) {
                hits.look_back(region, handle, host.tick(), self.late, host.settings().dt_s);
            }
        }
    }
}

/// Returns a copy of each dynamic body here that does not sleep and is free of joints, in id order, the owner's if it is here.
/// Joints pull in every tick, so a hit is not told from that.
fn free_copies(host: &RegionHost) -> Vec<(BodyId, &Region, RigidBodyHandle)> {
    let is_free = |region: &Region, handle: RigidBodyHandle| {
        region.physics().bodies[handle].is_dynamic() && !region.is_jointed(handle)
    };
    let mut copies: Vec<_> =
        host.awake_copies().filter(|(.., region, handle)| is_free(region, *handle)).collect();
    copies.sort_by_key(|(id, role, ..)| (*id, *role != Ownership::Owner));
    copies.dedup_by_key(|(id, ..)| *id);
    copies.into_iter().map(|(id, _, region, handle)| (id, region, handle)).collect()
}

/// Puts a dynamic body that no joint holds to its authoritative state in another group. Returns whether it is there.
fn put(host: &mut RegionHost, target: &SharedState, lag_s: f64) -> bool {
    let Some(BodyRecord { traits, .. }) = host.record(target.id) else { return false };
    if traits.kind != BodyKind::Dynamic || host.joints_of(target.id).next().is_some() {
        return false;
    }
    host.move_copies(target.id, target.pose.moved(&target.velocity, lag_s))
        && host.steer(target.id, &target.velocity)
}

/// Corrects a body towards its authoritative state in another group.
fn lead(host: &mut RegionHost, target: &SharedState, lag_s: f64, band_m: f64) {
    let Some(BodyRecord { state, traits, .. }) = host.record(target.id) else { return };
    // A character walks on from that pose by itself.
    let walks = traits.character.is_some();
    if traits.kind == BodyKind::KinematicPosition || walks {
        let next_s = lag_s + if walks { 0.0 } else { f64::from(host.settings().dt_s) };
        host.move_copies(target.id, target.pose.moved(&target.velocity, next_s));
        return;
    }
    let goal = target.pose.moved(&target.velocity, lag_s);
    if target.sleeping && state.sleeping && deviation_m(&state.pose, &goal) <= band_m {
        return;
    }
    let is_free = traits.kind == BodyKind::Dynamic && target.id.client().is_none();
    let velocity = if is_free && is_alone(host, target.id) {
        let shift = shift(&state.pose, target, lag_s, band_m);
        if shift != Velocity::default() {
            host.move_copies(target.id, state.pose.moved(&shift, f64::from(host.settings().dt_s)));
        }
        target.velocity
    } else {
        correction(&state.pose, target, lag_s, band_m)
    };
    host.change_copies(target.id, |body| {
        body.set_linvel(Vector::from_array(velocity.linear), true);
        body.set_angvel(Vector::from_array(velocity.angular), true);
    });
}

/// Returns whether no copy of a body touches anything or is held by a joint.
fn is_alone(host: &RegionHost, id: BodyId) -> bool {
    host.regions().all(|region| {
        let Some(handle) = region.handle_of(id) else { return true };
        let physics = region.physics();
        let touches = |collider: &ColliderHandle| {
            physics.narrow_phase.contact_pairs_with(*collider).any(|pair| pair.has_any_active_contact())
        };
        !region.is_jointed(handle) && !physics.bodies[handle].colliders().iter().any(touches)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::physics::Partition;
    use crate::protocol::WorldPose;
    use crate::scene::{Scene, SceneJoint};
    use crate::space::{Bounds, DistributionTree};

    /// A world of one region.
    fn host(scene: &Scene) -> RegionHost {
        let tree = DistributionTree::halved(Bounds::around([0.0; 3], [20.0; 3]), 1).unwrap();
        let regions: Vec<_> = tree.leaves().collect();
        let mut host =
            RegionHost::new(Partition::new(tree, None), scene.step_settings(), 1, &regions).unwrap();
        let (bodies, joints) = scene.records(host.shapes_mut()).unwrap();
        host.insert(bodies, &joints).unwrap();
        host
    }

    fn velocity(host: &RegionHost, id: BodyId) -> [f32; 3] {
        let (region, handle) = host.owned(id).unwrap();
        region.shared_state(handle).velocity.linear
    }

    #[test]
    fn a_ball_that_is_led_and_a_ball_that_it_hits_part_as_in_one_world_however_late_it_is_told_of() {
        for (bounce, speed) in [(0.0, 2.0), (0.5, 6.0), (1.0, 2.0), (1.0, 12.0)] {
            let mut scene = Scene { gravity: [0.0; 3], ..Scene::empty("balls") };
            for (x, v) in [(0.0, 0.0), (-3.0, speed)] {
                let body = RigidBodyBuilder::dynamic().linvel(Vector::X * v);
                let ball = ColliderBuilder::ball(0.5).restitution(bounce).friction(0.0);
                scene.push(WorldPose::at([x, 0.1, 0.0]), body, ball);
            }
            for late in [1, 4, 8, 12] {
                // Another group computes the same, and is authoritative for the ball that flies.
                let (mut there, mut here, mut led) = (host(&scene), host(&scene), Led::default());
                let ids: Vec<_> = there.owned_bodies().map(|(id, ..)| id).collect();
                let mut told = Vec::new();
                for tick in 0..(60.0 * 3.0 / speed) as usize + 140 {
                    let (region, handle) = there.owned(ids[1]).unwrap();
                    told.push(region.shared_state(handle));
                    if let Some(tick) = tick.checked_sub(late) {
                        led.lead(&mut here, Tick(tick as u64), &told[tick..=tick], &[], 0.01);
                    }
                    led.look_ahead(&here);
                    there.step().unwrap();
                    here.step().unwrap();
                    led.look_back(&here);
                }
                for &id in &ids {
                    let (there, here) = (velocity(&there, id), velocity(&here, id));
                    let is_off = there.iter().zip(here).any(|(a, b)| (a - b).abs() > 0.05 * speed);
                    assert!(
                        !is_off,
                        "{late} ticks late, bounce {bounce}, {speed} m/s: {id} {here:?}, not {there:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn what_nothing_touches_comes_to_its_place_without_getting_energy() {
        let mut scene = Scene { gravity: [0.0; 3], ..Scene::empty("ball") };
        let turning = RigidBodyBuilder::dynamic().linvel(Vector::X * 2.0).angvel(Vector::Y);
        scene.push(WorldPose::at([0.0; 3]), turning, ColliderBuilder::ball(0.5));
        let (mut there, mut here, mut led) = (host(&scene), host(&scene), Led::default());
        let id = here.owned_bodies().map(|(id, ..)| id).next().unwrap();
        // Here it is behind, to the side, and turned.
        let behind = WorldPose { translation: [-0.3, 0.1, 0.0], rotation: [0.1, 0.0, 0.0, 0.994_987_4] };
        here.move_copies(id, behind);
        let state = |host: &RegionHost| {
            let (region, handle) = host.owned(id).unwrap();
            region.shared_state(handle)
        };
        for _ in 0..120 {
            let (now, told) = (here.tick(), state(&there));
            led.lead(&mut here, now, &[told], &[], 0.01);
            led.look_ahead(&here);
            there.step().unwrap();
            here.step().unwrap();
            led.look_back(&here);
            let [Velocity { linear, angular }, of_there] = [&here, &there].map(|host| state(host).velocity);
            let faster = (0..3).map(|i| {
                (linear[i] - of_there.linear[i]).abs().max((angular[i] - of_there.angular[i]).abs())
            });
            assert!(faster.fold(0.0, f32::max) < 1e-5, "{linear:?} {angular:?}, not {of_there:?}");
        }
        let (here, there) = (state(&here).pose, state(&there).pose);
        assert!(deviation_m(&here, &there) <= 0.01, "{here:?}, not {there:?}");
        let turned = here.isometry().rotation.angle_to(&there.isometry().rotation);
        assert!(turned < 0.02, "{turned}");
    }

    #[test]
    fn what_is_stuck_behind_a_wall_is_put_to_its_place_unless_a_joint_holds_it() {
        for is_tied in [false, true] {
            let mut scene = Scene { gravity: [0.0; 3], ..Scene::empty("wall") };
            let ball = || (RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5));
            let (body, collider) = ball();
            let led_one = scene.push(WorldPose::at([-3.0, 0.0, 0.0]), body, collider);
            let wall = ColliderBuilder::cuboid(0.5, 5.0, 5.0);
            scene.push(WorldPose::at([0.0; 3]), RigidBodyBuilder::fixed(), wall);
            if is_tied {
                let (body, collider) = ball();
                let other = scene.push(WorldPose::at([-3.0, 1.5, 0.0]), body, collider);
                let joint = SphericalJointBuilder::new().local_anchor1(Vector::Y * 1.5).build().into();
                scene.joints.push(SceneJoint { a: led_one, b: other, joint, multibody: None });
            }
            let (mut here, mut led) = (host(&scene), Led::default());
            let id = here.owned_bodies().map(|(id, ..)| id).next().unwrap();
            let (region, handle) = here.owned(id).unwrap();
            let goal = SharedState { pose: WorldPose::at([3.0, 0.0, 0.0]), ..region.shared_state(handle) };
            let mut x_after = |stuck: &[BodyId], ticks: u64| {
                for _ in 0..ticks {
                    let now = here.tick();
                    led.lead(&mut here, now, &[goal], stuck, 0.01);
                    led.look_ahead(&here);
                    here.step().unwrap();
                    led.look_back(&here);
                }
                let (region, handle) = here.owned(id).unwrap();
                region.shared_state(handle).pose.translation[0]
            };
            let before = x_after(&[], 300);
            assert!((-1.3..-0.9).contains(&before), "it is pushed against the wall: {before}");
            let put = x_after(&[id], 1);
            let expected = if is_tied { before } else { 3.0 };
            assert!((put - expected).abs() < 1e-2, "{put}, not {expected}");
        }
    }
}
