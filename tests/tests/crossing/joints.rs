//! Tests joints whose bodies several regions hold.

use super::bare::{Setup, as_in_bare_rapier};
use super::*;

/// Inserts two bodies with the border between them, tied by this joint.
fn tied(world: &mut LocalWorld, joint: impl Into<GenericJoint>) -> (BodyId, BodyId, dcd::space::JointId) {
    let a = world.insert(body_at(-0.75, 0.0, 0.0).can_sleep(false), cube().density(2.0)).unwrap();
    let b = world.insert(body_at(0.75, 0.0, 0.0).can_sleep(false), cube()).unwrap();
    let joint = world.insert_joint(a, b, joint).unwrap();
    (a, b, joint)
}

fn kinds() -> Vec<(&'static str, GenericJoint)> {
    let (left, right) = (Vector::new(0.75, 0.0, 0.0), Vector::new(-0.75, 0.0, 0.0));
    let revolute = || RevoluteJointBuilder::new(Vector::Z).local_anchor1(left).local_anchor2(right);
    let prismatic = || PrismaticJointBuilder::new(Vector::X).local_anchor1(left).local_anchor2(right);
    let force = MotorModel::ForceBased;
    vec![
        ("fixed", FixedJointBuilder::new().local_anchor1(left).local_anchor2(right).build().into()),
        ("spherical", SphericalJointBuilder::new().local_anchor1(left).local_anchor2(right).build().into()),
        ("revolute", revolute().build().into()),
        ("revolute with limits", revolute().limits([-0.2, 0.2]).build().into()),
        ("revolute with a motor", revolute().motor_velocity(2.0, 5.0).motor_model(force).build().into()),
        (
            "revolute with a weak motor",
            revolute().motor_velocity(20.0, 50.0).motor_max_force(0.4).motor_model(force).build().into(),
        ),
        ("revolute with an acceleration motor", revolute().motor_velocity(2.0, 5.0).build().into()),
        ("prismatic", prismatic().build().into()),
        ("prismatic with limits", prismatic().limits([-0.1, 0.3]).build().into()),
        (
            "prismatic with a spring",
            prismatic().motor_position(0.5, 20.0, 1.0).motor_model(force).build().into(),
        ),
        ("rope", RopeJointBuilder::new(1.7).build().into()),
        (
            "spherical with limits",
            SphericalJointBuilder::new()
                .local_anchor1(left)
                .local_anchor2(right)
                .limits(JointAxis::AngZ, [-0.1, 0.3])
                .build()
                .into(),
        ),
        (
            "spherical with a motor",
            SphericalJointBuilder::new()
                .local_anchor1(left)
                .local_anchor2(right)
                .motor_position(JointAxis::AngZ, 0.4, 4.0, 1.0)
                .motor_model(JointAxis::AngZ, force)
                .build()
                .into(),
        ),
        // A pin in a slot, for which Rapier has no builder in 3D.
        (
            "pin in a slot",
            GenericJointBuilder::new(JointAxesMask::all() & !(JointAxesMask::LIN_X | JointAxesMask::ANG_Z))
                .local_anchor1(left)
                .local_anchor2(right)
                .limits(JointAxis::LinX, [-0.1, 0.4])
                .build(),
        ),
        (
            "coupled axes",
            GenericJointBuilder::new(JointAxesMask::ANG_AXES)
                .coupled_axes(JointAxesMask::LIN_X | JointAxesMask::LIN_Y)
                .limits(JointAxis::LinX, [0.0, 1.6])
                .build(),
        ),
        (
            "two motors and a locked axis",
            GenericJointBuilder::new(JointAxesMask::LIN_Z | JointAxesMask::ANG_X | JointAxesMask::ANG_Y)
                .local_anchor1(left)
                .local_anchor2(right)
                .set_motor(JointAxis::LinX, 0.3, 0.0, 20.0, 2.0)
                .motor_velocity(JointAxis::AngZ, 1.0, 1.0)
                .build(),
        ),
        (
            "soft",
            FixedJointBuilder::new()
                .local_anchor1(left)
                .local_anchor2(right)
                .softness(SpringCoefficients::new(3.0, 0.5))
                .build()
                .into(),
        ),
        ("spring", SpringJointBuilder::new(2.0, 30.0, 0.5).build().into()),
        (
            "strong spring by acceleration",
            SpringJointBuilder::new(2.0, 30.0, 0.5)
                .spring_model(MotorModel::AccelerationBased)
                .build()
                .into(),
        ),
    ]
}

#[test]
fn joints_of_all_kinds_move_their_ends_as_in_one_world() {
    for coupling in SHARING {
        for (name, joint) in kinds() {
            let off = deviation(weightless(halves(coupling)), |world| {
                let (a, b, _) = tied(world, joint);
                steps(world, 3);
                world.update(a, |body| body.apply_impulse(Vector::new(-1.0, 0.4, 0.0), true)).unwrap();
                world.update(b, |body| body.apply_impulse(Vector::new(0.8, -0.3, 0.0), true)).unwrap();
                world.update(b, |body| body.apply_torque_impulse(Vector::new(0.0, 0.0, 0.1), true)).unwrap();
                steps(world, 60);
            });
            assert!(off < 4e-2, "{} {name}: {off}", coupling.name());
        }
    }
}

#[test]
fn joints_of_all_kinds_tie_bodies_at_a_border_as_in_bare_rapier() {
    for (name, joint) in kinds() {
        let mut tied = Setup::weightless(60);
        let left = body_at(-0.75, 0.0, 0.0).linvel(Vector::new(-0.6, 0.2, 0.0));
        let right = body_at(0.75, 0.0, 0.0).linvel(Vector::new(0.8, -0.3, 0.0)).angvel(Vector::Z * 0.5);
        let a = tied.push(left.can_sleep(false), cube().density(2.0));
        let b = tied.push(right.can_sleep(false), cube());
        let free = tied.clone();
        tied.joints.push((a, b, joint));
        as_in_bare_rapier(name, 0.04, &tied, &free);
    }
}

#[test]
fn tied_bodies_touch_over_a_border_only_if_their_joint_lets_them() {
    for contacts in [true, false] {
        for coupling in SHARING {
            let gap_m = std::cell::Cell::new(0.0);
            let off = deviation(weightless(halves(coupling)), |world| {
                let spring = SpringJointBuilder::new(0.2, 30.0, 5.0).contacts_enabled(contacts);
                let (a, b, _) = tied(world, spring);
                steps(world, 120);
                gap_m.set(distance(at(world, a), at(world, b)));
            });
            assert!(off < 0.03, "{} {contacts}: {off}", coupling.name());
            let gap_m = gap_m.get();
            assert_eq!(gap_m > 0.95, contacts, "{}: {gap_m} m apart", coupling.name());
        }
    }
}

#[test]
fn a_motor_changed_while_its_joint_is_shared_has_the_force_it_was_given() {
    for coupling in SHARING {
        let mut world = LocalWorld::new(weightless(halves(coupling))).unwrap();
        let rail: GenericJoint = PrismaticJointBuilder::new(Vector::X)
            .local_anchor1(Vector::new(0.75, 0.0, 0.0))
            .local_anchor2(Vector::new(-0.75, 0.0, 0.0))
            .motor_model(MotorModel::ForceBased)
            .build()
            .into();
        let (a, b, joint) = tied(&mut world, rail);
        steps(&mut world, 5);
        assert_eq!((parts(&world, a), parts(&world, b)), (2, 2), "{}", coupling.name());
        // So far from its target that the force is at its limit: 3 N on 2 kg and 1 kg.
        world
            .update_joint(joint, |joint| {
                joint.set_motor(JointAxis::LinX, 1e4, 0.0, 1e4, 0.0);
                joint.set_motor_max_force(JointAxis::LinX, 3.0);
            })
            .unwrap();
        steps(&mut world, 20);
        let t = 20.0 / 60.0;
        let (va, vb) = (speed(&world, a)[0], speed(&world, b)[0]);
        assert!((va + 1.5 * t).abs() < 0.02 && (vb - 3.0 * t).abs() < 0.02, "{}: {va} {vb}", coupling.name());
        let record = world.host().joints_of(a).next().unwrap();
        assert_eq!(record.motors[0].max_force, 3.0, "{}", coupling.name());
        world.update_joint(joint, |joint| assert_eq!(joint.motors[0].max_force, 3.0)).unwrap();
        world.remove_joint(joint).unwrap();
        steps(&mut world, 20);
        assert!((speed(&world, b)[0] - vb).abs() < 0.02, "{}: it flies on", coupling.name());
    }
}

#[test]
fn the_load_of_a_joint_is_that_of_one_world() {
    for coupling in SHARING {
        for exchanges in [1, 2] {
            let mut config = cut(coupling, &[(Axis::Y, 0.0)]);
            config.step.exchanges = exchanges;
            let mut world = LocalWorld::new(config).unwrap();
            let hook = RigidBodyBuilder::fixed().translation(Vector::new(0.0, 2.0, 0.0));
            let hook = world.insert(hook, ColliderBuilder::ball(0.1)).unwrap();
            let link = |world: &mut LocalWorld, y| {
                world
                    .insert(body_at(0.0, y, 0.0).can_sleep(false), ColliderBuilder::ball(0.25).mass(2.0))
                    .unwrap()
            };
            let (upper, lower) = (link(&mut world, 0.6), link(&mut world, -0.6));
            let hang = |length: f32| {
                SphericalJointBuilder::new()
                    .local_anchor1(Vector::new(0.0, -length / 2.0, 0.0))
                    .local_anchor2(Vector::new(0.0, length / 2.0, 0.0))
            };
            let top = world.insert_joint(hook, upper, hang(1.4)).unwrap();
            let middle = world.insert_joint(upper, lower, hang(1.2)).unwrap();
            steps(&mut world, 120);
            for (joint, weight) in [(top, 4.0 * 9.81), (middle, 2.0 * 9.81)] {
                let load = world.joint_load(joint).unwrap();
                let what = format!("{} {exchanges}: {load:?} of {weight} N", coupling.name());
                assert!((load[1].abs() - weight).abs() < 0.05 * weight, "{what}");
            }
        }
    }
}

#[test]
fn a_chain_across_a_cut_hangs_as_in_one_world() {
    for (axis, at) in [(Axis::X, 4.1), (Axis::X, 1.0), (Axis::Y, -3.0)] {
        for coupling in SHARING {
            let off = deviation(cut(coupling, &[(axis, at)]), |world| {
                let hook = world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.1)).unwrap();
                let mut last = hook;
                for i in 0..17 {
                    let body = body_at(0.5 * (i + 1) as f32, 0.0, 0.0);
                    let link = world.insert(body, ColliderBuilder::ball(0.15).mass(1.0)).unwrap();
                    let joint = SphericalJointBuilder::new()
                        .local_anchor1(Vector::new(0.25, 0.0, 0.0))
                        .local_anchor2(Vector::new(-0.25, 0.0, 0.0));
                    world.insert_joint(last, link, joint).unwrap();
                    last = link;
                }
                steps(world, 60);
            });
            assert!(off < 0.04, "{} {axis:?} = {at}: {off}", coupling.name());
        }
    }
}

#[test]
fn small_assemblies_move_whole_under_island() {
    for coupling in [Coupling::Island, Coupling::Auto] {
        let mut config = weightless(halves(coupling));
        config.step.island_limit = 64;
        let mut world = LocalWorld::new(config).unwrap();
        let mut links: Vec<BodyId> = Vec::new();
        for i in 0..6 {
            let body = body_at(-4.0 + i as f32, 0.0, 0.0).linvel(Vector::new(2.0, 0.0, 0.0));
            let link = world.insert(body, ColliderBuilder::ball(0.25)).unwrap();
            if let Some(&last) = links.last() {
                let joint = SphericalJointBuilder::new()
                    .local_anchor1(Vector::new(0.5, 0.0, 0.0))
                    .local_anchor2(Vector::new(-0.5, 0.0, 0.0));
                world.insert_joint(last, link, joint).unwrap();
            }
            links.push(link);
        }
        let (mut homes, mut last) = (0, None);
        for _ in 0..180 {
            steps(&mut world, 1);
            let home = world.owner_of(links[0]);
            assert!(links.iter().all(|&link| world.owner_of(link) == home), "torn at {}", world.tick());
            // Meanwhile a user changes a link by its id.
            world.update(links[3], |body| body.apply_impulse(Vector::new(0.0, 0.0, 1e-7), true)).unwrap();
            homes += usize::from(last != home);
            last = home;
        }
        assert_eq!(homes, 2, "{}: here, then there", coupling.name());
        for pair in links.windows(2) {
            let gap = distance(at(&world, pair[0]), at(&world, pair[1]));
            assert!((gap - 1.0).abs() < 1e-2, "{}: {gap}", coupling.name());
        }
    }
}

#[test]
fn a_joint_that_comes_to_what_sleeps_wakes_it() {
    let configs = SHARING.map(halves).into_iter().chain([one_world()]).map(weightless);
    for (config, fixed) in configs.flat_map(|config| [false, true].map(|fixed| (config.clone(), fixed))) {
        let coupling = config.step.coupling;
        let mut world = LocalWorld::new(config).unwrap();
        let left = if fixed { RigidBodyBuilder::fixed() } else { RigidBodyBuilder::dynamic() };
        let left = world.insert(left.translation(Vector::X * -2.0), cube()).unwrap();
        let right = world.insert(body_at(2.0, 0.0, 0.0), cube()).unwrap();
        steps(&mut world, 180);
        assert!(world.body(right).unwrap().is_sleeping());
        world.insert_joint(left, right, RopeJointBuilder::new(3.0)).unwrap();
        steps(&mut world, 60);
        let apart = distance(at(&world, left), at(&world, right));
        assert!(apart < 3.1, "{coupling:?}, fixed {fixed}: {apart} m apart");
    }
}

#[test]
fn a_motor_wakes_its_bodies_also_before_the_first_step_of_its_joint() {
    let mut world = LocalWorld::new(weightless(one_world())).unwrap();
    let post = world.insert(fixed_at(0.0), ColliderBuilder::ball(0.1)).unwrap();
    let door = world.insert(body_at(1.0, 0.0, 0.0), cube()).unwrap();
    let hinge = RevoluteJointBuilder::new(Vector::Y).local_anchor2(-Vector::X).contacts_enabled(false);
    let hinge = world.insert_joint(post, door, hinge).unwrap();
    world.update(door, RigidBody::sleep).unwrap();
    let turn = |joint: &mut GenericJoint| {
        joint.set_motor_velocity(JointAxis::AngX, 1.0, 10.0);
    };
    world.update_joint(hinge, turn).unwrap();
    steps(&mut world, 30);
    assert!(at(&world, door)[2].abs() > 0.1, "{:?}", at(&world, door));
}
