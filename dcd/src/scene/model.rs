//! Defines a scene: the bodies, joints and settings of a world before its first tick.

use rapier3d::prelude::*;

use crate::fidelity::Fidelity;
use crate::physics::{CouplingChoice, LinkSettings, StepSettings, equip_link, insert_link, motion_of};
use crate::protocol::{BodyState, LinkRecord, Velocity, WorldPose};
use crate::space::{Axis, Balance, Bounds, Viewpoint};

/// The content of a world at its first tick, and the settings by which it is to be stepped.
#[derive(Clone, Debug)]
pub struct Scene {
    /// The name, for titles and results.
    pub name: String,
    /// Gravity, m/s².
    pub gravity: [f32; 3],
    /// The length of a tick, seconds.
    pub dt_s: f32,
    /// The box that is divided into regions, metres; bodies may leave it.
    pub bounds: Bounds,
    /// The bodies: body `i` becomes `BodyId::persistent(i)`.
    pub bodies: Vec<SceneBody>,
    /// The joints, in order of insertion.
    pub joints: Vec<SceneJoint>,
    /// The number of Rapier's solver iterations per tick.
    pub solver_iterations: usize,
    /// The speed limit of dynamic bodies, m/s.
    pub speed_limit_m_s: f32,
    /// The number of regions that suits the scene, if it says so.
    pub regions: Option<usize>,
    /// The first cuts, if the scene says so: an axis and a position on it in metres. Each cut divides all
    /// regions that it meets.
    pub cuts: Vec<(Axis, f64)>,
    /// The load balancing of regions, if the scene says so: in a local world, and in a served one.
    pub balance: Option<Balance>,
    /// How much of the world is computed in full.
    pub fidelity: Fidelity,
    /// The viewpoints from which the scene is looked at, if it says so.
    pub viewpoints: Vec<Viewpoint>,
    /// The coupling that the scene asks for.
    pub coupling: CouplingChoice,
    /// The avatar of a client, if the scene says so.
    pub avatar: Option<AvatarHint>,
    /// Differences from the scene's file, one per line: the feature, the names it concerns, and what becomes
    /// of it.
    pub warnings: Vec<String>,
}

/// A body of a scene, with its colliders. The builder's own position is zero: `pose`, in f64, places the
/// body.
#[derive(Clone, Debug)]
pub struct SceneBody {
    /// The pose at which the body starts, in world space.
    pub pose: WorldPose,
    /// All other properties of the body.
    pub body: RigidBodyBuilder,
    /// The colliders, in order of insertion.
    pub colliders: Vec<ColliderBuilder>,
}

/// A joint between two bodies of the scene.
#[derive(Clone, Copy, Debug)]
pub struct SceneJoint {
    /// The index of the first body.
    pub a: usize,
    /// The index of the second body.
    pub b: usize,
    /// The frames, limits and motors.
    pub joint: GenericJoint,
    /// The settings of a multibody joint: the second body is a link of the first one's multibody (reduced
    /// coordinates). `None`: impulses tie the bodies. Along the free axes links start where the poses of their
    /// bodies have them, and move as these do.
    pub multibody: Option<LinkSettings>,
}

/// A box that a client may drive through the scene as its avatar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AvatarHint {
    /// The pose at which the box starts, in world space.
    pub pose: WorldPose,
    /// Half of the edges of the box, metres.
    pub half_size_m: [f32; 3],
    /// The mass, kilograms.
    pub mass_kg: f32,
    /// The velocity that the box tries to keep, m/s.
    pub drive_m_s: [f32; 3],
}

impl Scene {
    /// Returns the step settings that the scene asks for; what it does not say is the default.
    pub fn step_settings(&self) -> StepSettings {
        self.coupling.applied_to(StepSettings {
            gravity: self.gravity,
            dt_s: self.dt_s,
            solver_iterations: self.solver_iterations,
            ..StepSettings::default().with_speed_limit(self.speed_limit_m_s)
        })
    }

    /// Builds one plain Rapier world with the same bodies in the same order, the same dt and iterations: the
    /// reference with which a partitioned run is compared. Positions are rounded to f32. It has one thread.
    /// With the feature `parallel` it has a pool of its own, since otherwise Rapier would use rayon's global
    /// pool; `set_thread_pool` gives it another.
    pub fn bare_world(&self) -> PhysicsWorld {
        let mut world = PhysicsWorld { gravity: Vector::from(self.gravity), ..PhysicsWorld::new() };
        #[cfg(feature = "parallel")]
        world.configure_thread_pool(1).expect("the system has one more thread");
        world.integration_parameters.dt = self.dt_s;
        world.integration_parameters.num_solver_iterations = self.solver_iterations;
        world.integration_parameters.normalized_max_linear_velocity = self.speed_limit_m_s;
        let handles: Vec<_> = self
            .bodies
            .iter()
            .map(|SceneBody { pose, body, colliders }| {
                let handle = world.insert_body(body.clone().pose(bare_pose(pose)));
                for collider in colliders {
                    world.insert_collider(collider.clone(), Some(handle));
                }
                handle
            })
            .collect();
        let mut links = Vec::new();
        for joint in &self.joints {
            let (a, b) = (handles[joint.a], handles[joint.b]);
            match self.link_record(joint) {
                Some(link) => links.extend(
                    insert_link(&mut world.multibody_joints, a, b, joint.joint, &link).map(|it| (it, link)),
                ),
                None => drop(world.insert_impulse_joint(a, b, joint.joint)),
            }
        }
        for (handle, link) in links {
            equip_link(&mut world.multibody_joints, handle, &link);
        }
        world
    }

    /// Returns the link of a joint that is to be a multibody joint; `None` for an impulse joint.
    pub(super) fn link_record(&self, joint: &SceneJoint) -> Option<LinkRecord> {
        /// The displacement along a free axis, metres or radians, up to which it is rounding and no motion.
        const STRAY: f32 = 1e-4;
        let link = joint.multibody?.record();
        let above = |&body: &usize| {
            let is_above = |other: &&SceneJoint| other.b == body && other.multibody.is_some();
            self.joints.iter().find(is_above).map(|other| other.a)
        };
        // Bounded, in case the joints are a loop.
        let root = std::iter::successors(Some(joint.a), above).take(self.joints.len()).last()?;
        let [a, b, root] = [joint.a, joint.b, root].map(|body| self.bodies[body].state());
        let motion = motion_of(&joint.joint, None, &a, &b, &root);
        let free = |axis: &usize| joint.joint.locked_axes.bits() & (1 << axis) == 0;
        let is_away = (0..6).filter(free).any(|axis| motion.coordinates[axis].abs() > STRAY);
        let moves = motion.velocity.iter().chain(&motion.root_velocity).any(|v| *v != 0.0);
        Some(LinkRecord { motion: (is_away || moves).then_some(motion), ..link })
    }

    /// Returns a scene without bodies, to be filled: Earth's gravity, 60 ticks per second, Rapier's 4
    /// iterations.
    #[must_use]
    pub fn empty(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            gravity: [0.0, -9.81, 0.0],
            dt_s: 1.0 / 60.0,
            bounds: Bounds::around([0.0; 3], [0.0; 3]),
            bodies: Vec::new(),
            joints: Vec::new(),
            solver_iterations: 4,
            speed_limit_m_s: StepSettings::default().speed_limit_m_s(),
            regions: None,
            cuts: Vec::new(),
            balance: None,
            fidelity: Fidelity::Off,
            viewpoints: Vec::new(),
            coupling: CouplingChoice::default(),
            avatar: None,
            warnings: Vec::new(),
        }
    }

    /// Adds a body with one collider and returns its index.
    pub fn push(&mut self, pose: WorldPose, body: RigidBodyBuilder, collider: ColliderBuilder) -> usize {
        self.bodies.push(SceneBody { pose, body, colliders: vec![collider] });
        self.bodies.len() - 1
    }

    /// Adds a fixed box.
    pub fn push_fixed_box(&mut self, centre: [f64; 3], half: [f32; 3], material: &ColliderBuilder) {
        let collider =
            ColliderBuilder { shape: SharedShape::cuboid(half[0], half[1], half[2]), ..material.clone() };
        self.push(WorldPose::at(centre), RigidBodyBuilder::fixed(), collider);
    }

    /// Returns the AABB of all finite bodies that can move, or of all finite bodies if none can; `None` if
    /// there is none.
    pub fn tight_bounds(&self) -> Option<Bounds> {
        let around = |bodies: &mut dyn Iterator<Item = &SceneBody>| {
            bodies.map(SceneBody::bounds).filter(Bounds::is_finite).reduce(|a, b| a.union(&b))
        };
        around(&mut self.bodies.iter().filter(|body| body.body.body_type != RigidBodyType::Fixed))
            .or_else(|| around(&mut self.bodies.iter()))
    }
}

impl SceneBody {
    /// Returns where the body starts, and how it moves there.
    fn state(&self) -> BodyState {
        let velocity = Velocity { linear: self.body.linvel.to_array(), angular: self.body.angvel.to_array() };
        BodyState {
            pose: self.pose,
            velocity,
            force: [0.0; 3],
            torque: [0.0; 3],
            sleeping: false,
            still_s: 0.0,
            gait: None,
            drive: None,
            contact_offset: None,
        }
    }

    /// Returns the AABB of the body's colliders where it starts: the position alone if it has no colliders,
    /// infinite for a half-space.
    pub fn bounds(&self) -> Bounds {
        let turn = Pose::from_rotation(rotation(&self.pose));
        let at = self.pose.translation;
        self.colliders
            .iter()
            .map(|collider| {
                let aabb = collider.shape.compute_aabb(&(turn * collider.position));
                Bounds {
                    min: std::array::from_fn(|i| at[i] + far(aabb.mins[i])),
                    max: std::array::from_fn(|i| at[i] + far(aabb.maxs[i])),
                }
            })
            .reduce(|a, b| a.union(&b))
            .unwrap_or(Bounds::new(at, at))
    }
}

/// Returns a coordinate of an AABB, infinite beyond 1e30: Parry's half-space spans half of f32's range.
fn far(v: f32) -> f64 {
    if v.abs() > 1e30 { f64::INFINITY.copysign(v.into()) } else { v.into() }
}

/// Returns a pose rounded to f32.
pub(crate) fn bare_pose(pose: &WorldPose) -> Pose {
    Pose::from_parts(Vector::from(pose.translation.map(|v| v as f32)), rotation(pose))
}

/// Returns a world pose of an f64 position and an f32 rotation.
pub(crate) fn world_pose(translation: [f64; 3], rotation: Rotation) -> WorldPose {
    WorldPose { translation, rotation: rotation.to_array() }
}

fn rotation(pose: &WorldPose) -> Rotation {
    Rotation::from_array(pose.rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bare_world_has_the_bodies_in_order_and_the_settings() {
        let mut scene = Scene::empty("two");
        scene.dt_s = 0.01;
        scene.solver_iterations = 7;
        for x in [1.0, 5.0] {
            scene.push(WorldPose::at([x, 0.0, 0.0]), RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.5));
        }
        scene.joints.push(SceneJoint {
            a: 0,
            b: 1,
            joint: RopeJointBuilder::new(4.0).into(),
            multibody: None,
        });
        let world = scene.bare_world();
        let xs: Vec<_> = world.rigid_bodies().map(|(_, body)| body.translation().x).collect();
        assert_eq!(xs, [1.0, 5.0]);
        assert_eq!(world.integration_parameters.dt, 0.01);
        assert_eq!(world.integration_parameters.num_solver_iterations, 7);
        assert_eq!(world.impulse_joints().count(), 1);
    }

    #[test]
    fn a_half_space_is_infinite_and_bounds_leave_it_out() {
        let mut scene = Scene::empty("floor");
        let floor = ColliderBuilder::new(SharedShape::halfspace(Vector::Y));
        let floor = scene.push(WorldPose::default(), RigidBodyBuilder::fixed(), floor);
        assert_eq!(scene.bodies[floor].bounds().min[0], f64::NEG_INFINITY);
        assert_eq!(scene.tight_bounds(), None);
        scene.push(WorldPose::default(), RigidBodyBuilder::fixed(), ColliderBuilder::ball(1.0));
        assert_eq!(scene.tight_bounds(), Some(Bounds::around([0.0; 3], [1.0; 3])));
    }

    #[test]
    fn bounds_are_around_what_can_move_and_keep_millimetres_far_out() {
        let mut scene = Scene::empty("far");
        scene.push_fixed_box([0.0; 3], [9.0; 3], &ColliderBuilder::ball(1.0));
        let turn = Rotation::from_rotation_z(std::f32::consts::FRAC_PI_2);
        scene.push(
            world_pose([1e7 + 0.001, 0.0, 0.0], turn),
            RigidBodyBuilder::dynamic(),
            ColliderBuilder::cuboid(1.0, 2.0, 3.0),
        );
        let bounds = scene.tight_bounds().unwrap();
        assert!((bounds.max[0] - (1e7 + 2.001)).abs() < 1e-4, "{bounds:?}");
        assert!((bounds.max[1] - 1.0).abs() < 1e-4, "{bounds:?}");
    }
}
