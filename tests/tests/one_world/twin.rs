//! Runs the same world twice, partitioned and bare, and compares them.

use std::collections::BTreeSet;

use dcd::physics::Coupling;
use dcd::protocol::WorldPose;
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::scene::{Scene, SceneBody};
use dcd::space::{BodyId, JointId};
use proptest::prelude::*;
use rapier3d::prelude::*;

use super::operations::Operation;
use super::scenery::{Bare, HALF_M, scene, velocity};

/// How far bodies that touched nothing may be from their places in one world, metres, and how much more per
/// tick: substeps integrate the same forces in another number of parts.
const GATE_M: f32 = 0.01;
const GATE_A_TICK_M: f32 = 0.002;

struct Body {
    id: BodyId,
    bare: RigidBodyHandle,
    /// The body as it would be described now.
    spec: SceneBody,
}

struct Joint {
    id: JointId,
    bare: ImpulseJointHandle,
    ends: [BodyId; 2],
}

pub(crate) struct Twin {
    world: LocalWorld,
    bare: PhysicsWorld,
    bodies: Vec<Body>,
    joints: Vec<Joint>,
    untied: Vec<JointId>,
    /// Bodies that touched others or hang on a joint: the worlds agree on these only as well as couplings do.
    rough: BTreeSet<BodyId>,
    ticks: usize,
    /// Says whether the last operation was a step. Rapier takes in changes, those of centres of mass too, only in
    /// steps.
    stepped: bool,
}

impl Twin {
    pub(crate) fn new(regions: usize, coupling: Coupling, gravity: bool) -> Self {
        let scene: Scene = scene(&[]);
        let mut config = WorldConfig::for_scene(&scene);
        config.partitioning = Partitioning::Regions(regions);
        config.step = config.step.with_coupling(coupling);
        let mut bare = scene.bare_world();
        if gravity {
            config.step.gravity = [0.0, -9.81, 0.0];
            bare.gravity = Vector::from(config.step.gravity);
        }
        Self {
            world: LocalWorld::new(config).unwrap(),
            bare,
            bodies: Vec::new(),
            joints: Vec::new(),
            untied: Vec::new(),
            rough: BTreeSet::new(),
            ticks: 0,
            stepped: false,
        }
    }

    pub(crate) fn apply(&mut self, operation: &Operation) -> Result<(), TestCaseError> {
        self.stepped = matches!(operation, Operation::Step(_));
        match operation {
            Operation::Insert(thing) => self.insert(thing.scene_body()),
            Operation::Step(ticks) => {
                for _ in 0..*ticks {
                    self.step();
                }
            }
            Operation::Ask(question) => {
                let specs: Vec<_> = self.bodies.iter().map(|body| (body.id, body.spec.clone())).collect();
                question.check(&self.world, &Bare::of(&self.world, &specs))?;
            }
            _ if self.bodies.is_empty() => {}
            Operation::Remove(which) => self.remove(*which),
            Operation::Tie { a, b, kind } => self.tie(*a, *b, *kind),
            Operation::Untie(which) => {
                if !self.joints.is_empty() {
                    let joint = self.joints.remove(which % self.joints.len());
                    self.world.remove_joint(joint.id).unwrap();
                    self.bare.remove_impulse_joint(joint.bare).unwrap();
                    self.untied.push(joint.id);
                }
            }
            Operation::Motor(which, speed) => {
                if !self.joints.is_empty() {
                    let joint = &self.joints[which % self.joints.len()];
                    let change = |joint: &mut GenericJoint| {
                        joint.set_motor_velocity(JointAxis::AngX, *speed, 1.0);
                    };
                    self.world.update_joint(joint.id, change).unwrap();
                    change(&mut self.bare.impulse_joints.get_mut(joint.bare, true).unwrap().data);
                }
            }
            Operation::Force(which, force) => {
                self.both(*which, |body| body.add_force(Vector::from(*force), true));
            }
            Operation::ForgetForces(which) => self.both(*which, |body| body.reset_forces(true)),
            // The mass of a disabled body depends on when it was disabled.
            Operation::Impulse(which, _) if !self.spec(*which).body.enabled => {}
            Operation::Impulse(which, impulse) => {
                self.both(*which, |body| body.apply_impulse(Vector::from(*impulse) * 0.1, true));
            }
            Operation::Velocity(which, linear, angular) => {
                let body = &self.bodies[which % self.bodies.len()];
                if body.spec.body.body_type != RigidBodyType::Fixed {
                    self.world.set_velocity(body.id, velocity(*linear, *angular)).unwrap();
                    let bare = &mut self.bare.bodies[body.bare];
                    bare.set_linvel(Vector::from(*linear), true);
                    bare.set_angvel(Vector::from(*angular), true);
                }
            }
            Operation::Teleport(which, to) => {
                let body = &self.bodies[which % self.bodies.len()];
                let pose = self.world.pose(body.id).unwrap();
                let to = WorldPose { translation: to.map(f64::from), ..pose };
                self.world.set_pose(body.id, to).unwrap();
                let to = Vector::from(to.translation.map(|v| v as f32));
                self.bare.bodies[body.bare].set_translation(to, true);
            }
            Operation::SendTo(which, to) => {
                let body = &self.bodies[which % self.bodies.len()];
                if body.spec.body.body_type == RigidBodyType::KinematicPositionBased {
                    // Regions look some metres ahead: a body that goes farther in a tick must be teleported.
                    let pose = self.world.pose(body.id).unwrap();
                    let there = |i: usize| pose.translation[i] + f64::from(to[i] / HALF_M);
                    let to = WorldPose { translation: std::array::from_fn(there), ..pose };
                    self.world.set_next_pose(body.id, to).unwrap();
                    let to = Pose::from_parts(
                        Vector::from(to.translation.map(|v| v as f32)),
                        Rotation::from_array(to.rotation),
                    );
                    self.bare.bodies[body.bare].set_next_kinematic_position(to);
                }
            }
            Operation::Kind(which, dynamic) => self.change_kind(*which, *dynamic),
            Operation::Enable(which, on) => {
                self.both(*which, |body| body.set_enabled(*on));
                self.spec(*which).body.enabled = *on;
            }
            Operation::Sleep(which) => {
                if !self.is_tied(*which) {
                    self.both(*which, RigidBody::sleep);
                }
            }
            Operation::Groups(which, memberships, filter) => {
                let groups = InteractionGroups::new(
                    Group::from_bits_retain(*memberships),
                    Group::from_bits_retain(*filter),
                    InteractionTestMode::And,
                );
                self.first_collider(*which, |collider| collider.set_collision_groups(groups));
                self.spec(*which).colliders[0].collision_groups = groups;
            }
            Operation::Sensor(which, sensor) => {
                self.first_collider(*which, |collider| collider.set_sensor(*sensor));
                self.spec(*which).colliders[0].is_sensor = *sensor;
            }
            Operation::Collider(which, on) => {
                // While a body is disabled, Rapier does not tell whether its colliders were disabled by the
                // user.
                if self.spec(*which).body.enabled {
                    self.first_collider(*which, |collider| collider.set_enabled(*on));
                    self.spec(*which).colliders[0].enabled = *on;
                }
            }
        }
        Ok(())
    }

    fn insert(&mut self, spec: SceneBody) {
        let id = self.world.insert_at(spec.pose, spec.body.clone(), spec.colliders.clone()).unwrap();
        let pose = Pose::from_parts(
            Vector::from(spec.pose.translation.map(|v| v as f32)),
            Rotation::from_array(spec.pose.rotation),
        );
        let bare = self.bare.insert_body(spec.body.clone().pose(pose));
        for collider in &spec.colliders {
            self.bare.insert_collider(collider.clone(), Some(bare));
        }
        self.bodies.push(Body { id, bare, spec });
    }

    fn remove(&mut self, which: usize) {
        let body = self.bodies.remove(which % self.bodies.len());
        self.world.remove(body.id).unwrap();
        self.bare.remove_body(body.bare).unwrap();
        let (gone, kept) = std::mem::take(&mut self.joints)
            .into_iter()
            .partition::<Vec<_>, _>(|joint| joint.ends.contains(&body.id));
        self.untied.extend(gone.iter().map(|joint| joint.id));
        self.joints = kept;
    }

    fn tie(&mut self, a: usize, b: usize, kind: u8) {
        let (a, b) = (&self.bodies[a % self.bodies.len()], &self.bodies[b % self.bodies.len()]);
        // Rapier 0.36.1 panics at a joint between two bodies that are not dynamic, and at a joint to a body
        // that is already disabled.
        let dynamic = |body: &Body| body.spec.body.body_type == RigidBodyType::Dynamic;
        let enabled = a.spec.body.enabled && b.spec.body.enabled;
        if a.id == b.id || !(dynamic(a) || dynamic(b)) || !enabled {
            return;
        }
        let reach = Vector::new(0.5, 0.0, 0.0);
        let joint: GenericJoint = match kind {
            0 => SphericalJointBuilder::new().local_anchor1(reach).local_anchor2(-reach).into(),
            1 => RevoluteJointBuilder::new(Vector::Z).local_anchor1(reach).local_anchor2(-reach).into(),
            2 => FixedJointBuilder::new().local_anchor1(reach).local_anchor2(-reach).into(),
            3 => PrismaticJointBuilder::new(Vector::X).limits([-1.0, 1.0]).into(),
            4 => RopeJointBuilder::new(3.0).into(),
            _ => SpringJointBuilder::new(2.0, 10.0, 1.0).into(),
        };
        let id = self.world.insert_joint(a.id, b.id, joint).unwrap();
        let bare = self.bare.insert_impulse_joint(a.bare, b.bare, joint);
        let ends = [a.id, b.id];
        self.rough.extend(ends);
        self.joints.push(Joint { id, bare, ends });
    }

    /// Makes a body that is not fixed dynamic or kinematic.
    fn change_kind(&mut self, which: usize, dynamic: bool) {
        if self.spec(which).body.body_type == RigidBodyType::Fixed || self.is_tied(which) {
            return;
        }
        let kind = if dynamic { RigidBodyType::Dynamic } else { RigidBodyType::KinematicVelocityBased };
        self.both(which, |body| body.set_body_type(kind, true));
        self.spec(which).body.body_type = kind;
    }

    fn is_tied(&self, which: usize) -> bool {
        let id = self.bodies[which % self.bodies.len()].id;
        self.joints.iter().any(|joint| joint.ends.contains(&id))
    }

    fn spec(&mut self, which: usize) -> &mut SceneBody {
        let count = self.bodies.len();
        &mut self.bodies[which % count].spec
    }

    fn both(&mut self, which: usize, change: impl Fn(&mut RigidBody)) {
        let body = &self.bodies[which % self.bodies.len()];
        self.world.update(body.id, &change).unwrap();
        change(&mut self.bare.bodies[body.bare]);
    }

    fn first_collider(&mut self, which: usize, change: impl Fn(&mut Collider)) {
        let body = &self.bodies[which % self.bodies.len()];
        self.world.update_collider(body.id, 0, &change).unwrap();
        let collider = self.bare.bodies[body.bare].colliders()[0];
        change(&mut self.bare.colliders[collider]);
        // Rapier does this in its next step, and impulses until then act on the old mass.
        self.bare.bodies[body.bare].recompute_mass_properties_from_colliders(&self.bare.colliders);
    }

    fn step(&mut self) {
        self.world.step().unwrap();
        assert_eq!(self.world.host().validate(), []);
        self.bare.step();
        self.ticks += 1;
        let name = |handle| self.bodies.iter().find(|body| body.bare == handle).map(|body| body.id);
        let met = pairs(&self.bare, name);
        let theirs = self
            .world
            .regions()
            .flat_map(|region| pairs(region.physics(), |handle| region.role_of(handle).map(|(id, _)| id)));
        self.rough.extend(met.into_iter().chain(theirs));
    }

    /// Checks what must hold at all times.
    pub(crate) fn check(&self) -> Result<(), TestCaseError> {
        let movable = |body: &&Body| body.spec.body.body_type != RigidBodyType::Fixed;
        let expected: Vec<_> = self.bodies.iter().filter(movable).map(|body| body.id).collect();
        let ids: Vec<_> = self.world.states().map(|(id, ..)| id).collect();
        prop_assert_eq!(ids, expected, "movable bodies");
        for body in &self.bodies {
            let owners = usize::from(movable(&body));
            prop_assert_eq!(self.world.owners_of(body.id), owners, "owners of {}", body.id);
            let pose = self.world.pose(body.id);
            prop_assert!(pose.is_some_and(|pose| pose.is_valid()), "{} at {:?}", body.id, pose);
            if self.stepped {
                self.check_place(body)?;
            }
        }
        for joint in &self.joints {
            prop_assert!(self.world.joint_load(joint.id).is_some(), "{} is lost", joint.id);
        }
        for &joint in &self.untied {
            prop_assert!(self.world.joint_load(joint).is_none(), "{} is still there", joint);
        }
        prop_assert_eq!(self.world.stats().bodies, self.bodies.iter().filter(movable).count());
        Ok(())
    }

    fn check_place(&self, body: &Body) -> Result<(), TestCaseError> {
        if self.rough.contains(&body.id) {
            return Ok(());
        }
        let (bare, ours) = (&self.bare.bodies[body.bare], self.world.body(body.id).unwrap());
        let place = |body: &RigidBody| {
            let moves = body.is_enabled() && body.is_dynamic();
            if moves { body.center_of_mass() } else { body.translation() }
        };
        let apart = (place(bare) - place(ours)).length();
        let gate = GATE_M + GATE_A_TICK_M * self.ticks as f32;
        prop_assert!(
            apart <= gate,
            "{} is {} m apart: {} and {}",
            body.id,
            apart,
            ours.translation(),
            bare.translation()
        );
        // The velocity of a body that goes where it is sent is Rapier's own memory of its last step, and is
        // not carried over a border.
        if body.spec.body.body_type == RigidBodyType::Dynamic {
            let (v, one) = (ours.linvel(), bare.linvel());
            let same = (v - one).length() <= 0.02 + 0.01 * one.length();
            prop_assert!(same, "{}: {} and {} m/s", body.id, v, one);
        }
        prop_assert_eq!(ours.is_enabled(), bare.is_enabled());
        prop_assert_eq!(ours.body_type(), bare.body_type());
        Ok(())
    }
}

/// Returns the bodies that are near enough to others for contacts.
fn pairs(world: &PhysicsWorld, name: impl Fn(RigidBodyHandle) -> Option<BodyId>) -> Vec<BodyId> {
    let parents = world.narrow_phase.contact_pairs().flat_map(|pair| [pair.collider1, pair.collider2]);
    parents.filter_map(|handle| name(world.colliders.get(handle)?.parent()?)).collect()
}
