//! Tests that the user's contact hooks act in every region.

use std::sync::Arc;

use dcd::physics::{ContactHooks, Coupling, HookedPair};
use rapier3d::prelude::*;

use super::*;

/// Lets one body fall through everything, and hides another from all sensors.
struct Ghosts {
    falls: BodyId,
    unseen: BodyId,
}

impl ContactHooks for Ghosts {
    fn filter_contact_pair(&self, pair: &HookedPair<'_>) -> Option<SolverFlags> {
        let met = [pair.first.body, pair.second.body].contains(&self.falls);
        (!met).then_some(SolverFlags::COMPUTE_RIGID_IMPULSES)
    }

    fn filter_intersection_pair(&self, pair: &HookedPair<'_>) -> bool {
        ![pair.first.body, pair.second.body].contains(&self.unseen)
    }
}

#[test]
fn a_body_that_the_user_lets_through_falls_through_a_floor_that_two_regions_hold() {
    for coupling in Coupling::ALL {
        let mut world = LocalWorld::new(halves(coupling)).unwrap();
        let hooked = ActiveHooks::FILTER_CONTACT_PAIRS | ActiveHooks::FILTER_INTERSECTION_PAIR;
        let floor = ColliderBuilder::cuboid(60.0, 0.5, 60.0).active_hooks(hooked);
        world.insert(fixed_at(-0.5), floor).unwrap();
        let area = ColliderBuilder::cuboid(5.0, 1.0, 5.0)
            .sensor(true)
            .active_hooks(hooked)
            .active_events(ActiveEvents::COLLISION_EVENTS);
        let area = world.insert(fixed_at(1.0), area).unwrap();
        let [falls, unseen] = [0.1, -0.1].map(|x| world.insert(body_at(x, 3.5, x * 30.0), cube()).unwrap());
        world.set_hooks(Some(Arc::new(Ghosts { falls, unseen })));
        let mut noticed = Vec::new();
        for _ in 0..120 {
            steps(&mut world, 1);
            let began = world.events().touches.iter().filter(|touch| touch.began && touch.sensor);
            noticed.extend(began.map(|touch| (touch.key.a.min(touch.key.b), touch.key.a.max(touch.key.b))));
        }
        let height = |id| world.pose(id).unwrap().translation[1];
        assert!(height(falls) < -3.0, "{coupling:?}: at {}", height(falls));
        assert!((height(unseen) - 0.5).abs() < 0.02, "{coupling:?}: at {}", height(unseen));
        assert_eq!(noticed, [(area, falls)], "{coupling:?}");
        world.set_hooks(None);
        let solid = world.insert(body_at(0.0, 3.5, 5.0), cube()).unwrap();
        steps(&mut world, 120);
        assert!((world.pose(solid).unwrap().translation[1] - 0.5).abs() < 0.02, "{coupling:?}");
    }
}

/// A belt that moves what lies on it along x.
struct Belt;

fn carry(contacts: &mut ContactModificationContext<'_>, towards_first: f32) {
    let Some(manifold) = contacts.rigid_mut() else { return };
    for contact in manifold.solver_contacts.iter_mut() {
        contact.tangent_velocity = Vector::X * 2.0 * towards_first;
    }
}

/// Returns the sign of the belt's velocity in a pair. The velocity is that of the first surface against the
/// second: negative if the box comes first.
fn sign(first: &Collider) -> f32 {
    if first.user_data == 7 { -1.0 } else { 1.0 }
}

impl ContactHooks for Belt {
    fn modify_solver_contacts(&self, pair: &HookedPair<'_>, contacts: &mut ContactModificationContext<'_>) {
        carry(contacts, sign(pair.colliders[0]));
    }
}

impl PhysicsHooks for Belt {
    fn modify_solver_contacts(&self, contacts: &mut ContactModificationContext<'_>) {
        carry(contacts, sign(&contacts.colliders[contacts.collider1]));
    }
}

#[test]
fn a_belt_carries_a_box_over_a_border_as_in_one_world() {
    // The hooks belong to the box, and must go with it to the other region.
    let hooked = || cube().user_data(7).active_hooks(ActiveHooks::MODIFY_SOLVER_CONTACTS);
    let mut bare = PhysicsWorld::new();
    bare.insert(fixed_at(-0.5), ColliderBuilder::cuboid(60.0, 0.5, 60.0));
    let (carried, _) = bare.insert(body_at(-3.0, 0.5, 0.0), hooked());
    for _ in 0..240 {
        bare.step_with_events(&Belt, &());
    }
    let one = bare.bodies[carried].translation();
    assert!(one.x > 2.0, "the test needs a belt that carries: {one}");
    for coupling in Coupling::ALL {
        let mut world = LocalWorld::new(halves(coupling)).unwrap();
        world.set_hooks(Some(Arc::new(Belt)));
        insert_floor(&mut world);
        let carried = world.insert(body_at(-3.0, 0.5, 0.0), hooked()).unwrap();
        let first = world.owner_of(carried);
        steps(&mut world, 240);
        assert_ne!(world.owner_of(carried), first, "{coupling:?}");
        let at = Vector::from(world.pose(carried).unwrap().translation.map(|v| v as f32));
        assert!((at - one).length() < 0.05, "{coupling:?}: at {at}, in one world {one}");
    }
}

/// A platform that lets bodies through from below.
struct OneWay;

impl ContactHooks for OneWay {
    fn modify_solver_contacts(&self, pair: &HookedPair<'_>, contacts: &mut ContactModificationContext<'_>) {
        let up = if pair.colliders[0].user_data == 7 { Vector::Y } else { -Vector::Y };
        contacts.update_as_oneway_platform(up, 0.2);
    }
}

#[test]
fn a_ball_jumps_through_a_one_way_platform_at_a_border_and_lands_on_it() {
    let platform = ColliderBuilder::cuboid(5.0, 0.1, 5.0).user_data(7);
    let platform = platform.active_hooks(ActiveHooks::MODIFY_SOLVER_CONTACTS);
    for coupling in Coupling::ALL {
        let mut world = LocalWorld::new(halves(coupling)).unwrap();
        world.set_hooks(Some(Arc::new(OneWay)));
        world.insert(fixed_at(1.0), platform.clone()).unwrap();
        let jump = |x: f32| body_at(x, 0.0, 0.0).linvel(Vector::new(-x, 7.0, 0.0)).can_sleep(false);
        let balls = [-0.3, 0.3].map(|x| {
            let body = jump(x).translation(Vector::new(x, 0.0, 3.0 * x));
            world.insert(body, ColliderBuilder::ball(0.3)).unwrap()
        });
        steps(&mut world, 150);
        for id in balls {
            assert!((at(&world, id)[1] - 1.4).abs() < 0.05, "{coupling:?}: {:?}", at(&world, id));
        }
    }
}
