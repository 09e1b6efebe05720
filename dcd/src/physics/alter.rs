//! Changes bodies, colliders and joints to match new records, in the regions that compute them.

use rapier3d::prelude::*;

use super::{HostError, RegionHost, joints, record};
use crate::protocol::{Alteration, ColliderMass, ColliderRecord, JointRecord};

impl RegionHost {
    /// Makes a change to every copy held here, by the setters that a local world's user calls. Returns
    /// whether any copy is held here.
    pub fn alter(&mut self, alteration: &Alteration) -> Result<bool, HostError> {
        match alteration {
            Alteration::Joint(record) => Ok(self.update_joint(record.id, |joint| set_joint(joint, record))),
            Alteration::Body { body, traits, user_data, wakes } => {
                let Some(known) = self.record(*body) else { return Ok(false) };
                self.check_kind(*body, traits.kind)?;
                self.change_copies(*body, |copy| {
                    record::set_traits(copy, traits);
                    copy.user_data = *user_data;
                    if *wakes {
                        copy.wake_up(true);
                    }
                });
                for (index, (old, new)) in known.traits.colliders.iter().zip(&traits.colliders).enumerate() {
                    if old != new {
                        self.update_collider(*body, index, |collider| set_collider(collider, old, new))?;
                    }
                }
                Ok(true)
            }
        }
    }
}

/// Sets what differs between two records of a collider.
fn set_collider(collider: &mut Collider, old: &ColliderRecord, new: &ColliderRecord) {
    collider.set_friction(new.friction);
    collider.set_friction_combine_rule(record::rapier_rule(new.friction_rule));
    collider.set_restitution(new.restitution);
    collider.set_restitution_combine_rule(record::rapier_rule(new.restitution_rule));
    if old.sensor != new.sensor {
        collider.set_sensor(new.sensor);
    }
    if old.enabled != new.enabled {
        collider.set_enabled(new.enabled);
    }
    if old.collision_groups != new.collision_groups {
        collider.set_collision_groups(record::rapier_groups(new.collision_groups));
    }
    if old.solver_groups != new.solver_groups {
        collider.set_solver_groups(record::rapier_groups(new.solver_groups));
    }
    if old.collision_types != new.collision_types {
        collider.set_active_collision_types(ActiveCollisionTypes::from_bits_truncate(new.collision_types));
    }
    collider.set_active_events(ActiveEvents::from_bits_truncate(new.events));
    collider.set_active_hooks(ActiveHooks::from_bits_truncate(new.hooks));
    collider.set_contact_force_event_threshold(new.force_event_threshold_n);
    collider.set_contact_skin(new.contact_skin_m);
    collider.user_data = new.user_data;
    if old.mass != new.mass {
        match &new.mass {
            ColliderMass::Density(density) => collider.set_density(*density),
            ColliderMass::Mass(mass) => collider.set_mass(*mass),
            ColliderMass::Properties(mass) => collider.set_mass_properties(record::mass_properties(mass)),
        }
    }
}

/// Sets a joint by its record, and keeps what the solver has found out for its next step.
fn set_joint(joint: &mut GenericJoint, record: &JointRecord) {
    let mut new = joints::joint_of(record);
    for axis in 0..new.limits.len() {
        new.limits[axis].impulse = joint.limits[axis].impulse;
        new.motors[axis].impulse = joint.motors[axis].impulse;
    }
    let enabled = new.is_enabled();
    new.enabled = joint.enabled;
    new.set_enabled(enabled);
    *joint = new;
}

#[cfg(all(test, feature = "net"))]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::physics::{
        Coupling, LinkSettings, Partition, StepSettings, joint_record, try_on_body, try_on_collider,
        try_on_joint,
    };
    use crate::protocol::{BodyKind, BodyRecord, BorderMessage, LinkMotion, LinkRecord, WorldPose};
    use crate::space::{Axis, BodyId, Bounds, DistributionTree, JointId};

    const BOX: BodyId = BodyId::persistent(2);
    const HINGE: JointId = JointId(7);

    /// The name of a change, and the change.
    type Change<'a, T> = (&'static str, &'a dyn Fn(&mut T));

    /// Boxes that slide and fall on a floor in two regions, one of them on the border, and a lever on a post.
    fn host(coupling: Coupling) -> RegionHost {
        let bounds = Bounds::around([0.0; 3], [20.0; 3]);
        let tree = DistributionTree::cut_by(bounds, &[(Axis::X, 0.0)]).unwrap();
        let partition = Partition::new(tree, None);
        let leaves = partition.leaves().to_vec();
        let settings = StepSettings::default().with_coupling(coupling);
        let mut host = RegionHost::new(partition, settings, 1, &leaves).unwrap();
        let dynamic = RigidBodyBuilder::dynamic;
        let bodies = [
            (RigidBodyBuilder::fixed(), ColliderBuilder::cuboid(10.0, 0.5, 10.0), [0.0, -0.5, 0.0]),
            (
                dynamic().linvel(Vector::new(3.0, 0.0, 0.0)),
                ColliderBuilder::cuboid(0.5, 0.5, 0.5),
                [-4.0, 0.5, 0.0],
            ),
            (
                dynamic().linvel(Vector::new(1.0, 0.0, 2.0)),
                ColliderBuilder::cuboid(0.5, 0.5, 0.5),
                [-0.2, 0.6, 0.0],
            ),
            (dynamic(), ColliderBuilder::ball(0.5), [0.1, 2.0, 0.1]),
            (RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.1), [0.0, 4.0, -5.0]),
            (dynamic().can_sleep(false), ColliderBuilder::cuboid(1.0, 0.1, 0.1), [1.0, 4.0, -5.0]),
        ];
        let records = bodies.into_iter().enumerate().map(|(i, (body, collider, at))| {
            let id = BodyId::persistent(i as u32);
            host.shapes_mut().describe(id, WorldPose::at(at), &body.build(), &[collider]).unwrap()
        });
        let records: Vec<_> = records.collect();
        let hinge = RevoluteJointBuilder::new(Vector::Z)
            .local_anchor2(Vector::new(-1.0, 0.0, 0.0))
            .contacts_enabled(false)
            .build();
        let joint = joint_record(HINGE, BodyId::persistent(4), BodyId::persistent(5), &hinge.data);
        host.insert(records, &[joint]).unwrap();
        step(&mut host, 10);
        host
    }

    fn step(host: &mut RegionHost, ticks: u32) {
        (0..ticks).for_each(|_| host.step().unwrap());
    }

    fn states(host: &RegionHost) -> Vec<BodyRecord> {
        (0..6).map(|i| host.record(BodyId::persistent(i)).unwrap()).collect()
    }

    /// Makes the same change in place and by record. Checks that both come to the same, and that the change
    /// makes a difference.
    fn compare(
        name: &str,
        coupling: Coupling,
        in_place: impl Fn(&mut RegionHost),
        by_record: impl Fn(&mut RegionHost) -> Alteration,
    ) {
        let [mut a, mut b, mut untouched] = [host(coupling), host(coupling), host(coupling)];
        in_place(&mut a);
        let alteration = by_record(&mut b);
        assert!(b.alter(&alteration).unwrap());
        [&mut a, &mut b, &mut untouched].into_iter().for_each(|host| step(host, 60));
        assert_eq!(states(&a), states(&b), "{name}, {coupling:?}");
        assert_ne!(states(&a), states(&untouched), "{name} changes something");
    }

    #[test]
    fn what_is_changed_by_its_record_moves_as_what_is_changed_in_place() {
        let heavy = MassProperties::new(Vector::new(0.0, -0.2, 0.1), 3.0, Vector::new(1.0, 0.5, 0.5));
        let bodies: &[Change<'_, RigidBody>] = &[
            ("gravity", &|body| body.set_gravity_scale(-0.5, true)),
            ("damping", &|body| {
                body.set_linear_damping(2.0);
                body.set_angular_damping(0.5);
            }),
            ("locked axes", &|body| body.set_locked_axes(LockedAxes::TRANSLATION_LOCKED_Z, true)),
            ("mass", &|body| body.set_additional_mass(5.0, true)),
            ("mass properties", &|body| body.set_additional_mass_properties(heavy, true)),
            ("kind", &|body| body.set_body_type(RigidBodyType::KinematicVelocityBased, true)),
            ("disabled", &|body| body.set_enabled(false)),
            ("user data", &|body| body.user_data = 7),
            ("iterations", &|body| body.set_additional_solver_iterations(3)),
        ];
        let colliders: &[Change<'_, Collider>] = &[
            ("friction", &|collider| collider.set_friction(0.0)),
            ("sensor", &|collider| collider.set_sensor(true)),
            ("density", &|collider| collider.set_density(4.0)),
            ("groups", &|collider| collider.set_collision_groups(InteractionGroups::none())),
            ("disabled", &|collider| collider.set_enabled(false)),
        ];
        let joints: &[Change<'_, GenericJoint>] = &[
            ("motor", &|joint| {
                joint.set_motor_velocity(JointAxis::AngX, 4.0, 10.0);
            }),
            ("limits", &|joint| {
                joint.set_limits(JointAxis::AngX, [-0.25, 0.25]);
            }),
            ("disabled", &|joint| joint.set_enabled(false)),
        ];
        for coupling in [Coupling::Auto, Coupling::Overlap] {
            for (name, change) in bodies {
                let by_record = |host: &mut RegionHost| {
                    let tried =
                        try_on_body(&host.record(BOX).unwrap(), host.shapes(), &mut |body| change(body))
                            .unwrap();
                    assert!(!tried.moves, "{name}");
                    let (traits, user_data) = (Arc::new(tried.traits), tried.user_data);
                    Alteration::Body { body: BOX, traits, user_data, wakes: tried.wakes }
                };
                compare(
                    name,
                    coupling,
                    |host| host.change_copies(BOX, |body| change(body)).unwrap(),
                    by_record,
                );
            }
            for (name, change) in colliders {
                let in_place = |host: &mut RegionHost| {
                    host.update_collider(BOX, 0, |collider| change(collider)).unwrap().unwrap();
                };
                let by_record = |host: &mut RegionHost| {
                    let known = host.record(BOX).unwrap();
                    let tried = try_on_collider(&known, 0, host.shapes(), &mut |collider| change(collider));
                    let mut traits = (*known.traits).clone();
                    traits.colliders[0] = tried.unwrap().unwrap();
                    let (traits, user_data) = (Arc::new(traits), known.user_data);
                    Alteration::Body { body: BOX, traits, user_data, wakes: false }
                };
                compare(name, coupling, in_place, by_record);
            }
            for (name, change) in joints {
                let in_place =
                    |host: &mut RegionHost| assert!(host.update_joint(HINGE, |joint| change(joint)));
                let by_record = |host: &mut RegionHost| {
                    let tried = try_on_joint(&host.joint(HINGE).unwrap(), &mut |joint| change(joint));
                    Alteration::Joint(Box::new(tried))
                };
                compare(name, coupling, in_place, by_record);
            }
        }
    }

    #[test]
    fn a_link_that_is_on_its_way_moves_as_it_did_whatever_becomes_of_its_joint() {
        let ids = [4, 5].map(BodyId::persistent);
        let hinge: GenericJoint = RevoluteJointBuilder::new(Vector::Z).into();
        let known = LinkSettings::default().record();
        let known = JointRecord { link: Some(known), ..joint_record(HINGE, ids[0], ids[1], &hinge) };
        let mut sent = known.clone();
        sent.motors[3].impulse = 2.0;
        let motion = LinkMotion { velocity: [1.0; 6], ..LinkMotion::default() };
        sent.link = sent.link.map(|link| LinkRecord { motion: Some(motion), ..link });
        let mut message = BorderMessage { joints: vec![sent], ..BorderMessage::default() };
        let altered = try_on_joint(&known, &mut |joint| {
            joint.set_motor_velocity(JointAxis::AngX, 4.0, 10.0);
        });
        message.alter(&Alteration::Joint(Box::new(altered)));
        let found = &message.joints[0];
        assert_eq!((found.motors[3].target_vel, found.motors[3].impulse), (4.0, 2.0));
        assert_eq!(found.link.unwrap().motion, Some(motion));
    }

    #[test]
    fn a_link_of_a_multibody_is_not_given_another_type_by_its_record() {
        let mut host = host(Coupling::Auto);
        let ids = [4, 5].map(BodyId::persistent);
        host.remove_joint(HINGE);
        let hinge: GenericJoint = RevoluteJointBuilder::new(Vector::Z).local_anchor2(-Vector::X).into();
        let link = Some(LinkSettings::default().record());
        host.tie(JointRecord { link, ..joint_record(JointId(8), ids[0], ids[1], &hinge) }).unwrap();
        step(&mut host, 1);
        let mut traits = (*host.record(ids[1]).unwrap().traits).clone();
        traits.kind = BodyKind::KinematicVelocity;
        let alteration =
            Alteration::Body { body: ids[1], traits: Arc::new(traits), user_data: 0, wakes: true };
        let refused = host.alter(&alteration).unwrap_err().to_string();
        assert!(refused.contains("remove the joint first"), "{refused}");
        step(&mut host, 10);
        host.remove_joint(JointId(8));
        assert!(host.alter(&alteration).unwrap());
        step(&mut host, 10);
    }
}
