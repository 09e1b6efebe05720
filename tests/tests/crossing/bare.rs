//! Runs a scene in one bare Rapier world, and cut at x = 0. Features of Rapier must give the same result, and
//! must matter in the scene.

use super::*;

/// A scene: bodies, joints between them by their places in the list, and how they are stepped.
#[derive(Clone)]
pub(crate) struct Setup {
    pub(crate) bodies: Vec<(RigidBodyBuilder, Vec<ColliderBuilder>)>,
    pub(crate) joints: Vec<(usize, usize, GenericJoint)>,
    pub(crate) gravity: Vector,
    pub(crate) parameters: IntegrationParameters,
    pub(crate) ticks: usize,
}

impl Setup {
    /// Returns a scene with nothing but a floor without friction, under Earth's gravity.
    pub(crate) fn on_floor(ticks: usize) -> Self {
        let mut setup = Self::weightless(ticks);
        setup.gravity = Vector::Y * -9.81;
        setup.push(fixed_at(-0.5), ColliderBuilder::cuboid(60.0, 0.5, 60.0).friction(0.0));
        setup
    }

    pub(crate) fn weightless(ticks: usize) -> Self {
        let parameters = IntegrationParameters::default();
        Self { bodies: Vec::new(), joints: Vec::new(), gravity: Vector::ZERO, parameters, ticks }
    }

    /// Adds a body, and returns its place in the list.
    pub(crate) fn push(&mut self, body: RigidBodyBuilder, collider: ColliderBuilder) -> usize {
        self.bodies.push((body, vec![collider]));
        self.bodies.len() - 1
    }

    /// Returns the final poses of all bodies in a bare Rapier world.
    pub(crate) fn bare(&self) -> Vec<Pose> {
        let mut world = PhysicsWorld::new();
        (world.gravity, world.integration_parameters) = (self.gravity, self.parameters);
        let mut handles = Vec::new();
        for (body, colliders) in &self.bodies {
            let handle = world.bodies.insert(body.build());
            for collider in colliders {
                world.colliders.insert_with_parent(collider.build(), handle, &mut world.bodies);
            }
            handles.push(handle);
        }
        for &(a, b, joint) in &self.joints {
            world.insert_impulse_joint(handles[a], handles[b], joint);
        }
        for _ in 0..self.ticks {
            world.step();
        }
        handles.iter().map(|&handle| *world.bodies[handle].position()).collect()
    }

    pub(crate) fn world(&self, mut config: WorldConfig) -> (LocalWorld, Vec<BodyId>) {
        config.step.gravity = self.gravity.to_array();
        config.step.integration = self.parameters;
        let mut world = LocalWorld::new(config).unwrap();
        let mut ids = Vec::new();
        for (body, colliders) in &self.bodies {
            let at = body.position;
            let pose = dcd::protocol::WorldPose {
                translation: at.translation.to_array().map(f64::from),
                rotation: at.rotation.to_array(),
            };
            ids.push(world.insert_at(pose, body.clone(), colliders.clone()).unwrap());
        }
        for &(a, b, joint) in &self.joints {
            world.insert_joint(ids[a], ids[b], joint).unwrap();
        }
        (world, ids)
    }

    /// Returns the final poses of all bodies in a partitioned world, and whether any body was ever a ghost or
    /// transferred.
    pub(crate) fn partitioned(&self, config: WorldConfig) -> (Vec<Pose>, bool) {
        let (mut world, ids) = self.world(config);
        let mut met = false;
        for _ in 0..self.ticks {
            steps(&mut world, 1);
            met |= world.stats().ghosts + world.stats().transfers as usize > 0;
        }
        let pose = |&id: &BodyId| {
            let pose = world.pose(id).unwrap();
            let at = Vector::from(pose.translation.map(|v| v as f32));
            Pose::from_parts(at, Rotation::from_array(pose.rotation))
        };
        (ids.iter().map(pose).collect(), met)
    }
}

/// Returns the distance of two ends of a scene, metres: the greatest difference of any body's place, or of a
/// point 1 m from it.
pub(crate) fn apart(a: &[Pose], b: &[Pose]) -> f32 {
    assert_eq!(a.len(), b.len());
    let points = [Vector::ZERO, Vector::X, Vector::Y, Vector::Z];
    let off = |(a, b): (&Pose, &Pose)| {
        points.map(|point| (*a * point - *b * point).length()).into_iter().fold(0.0, f32::max)
    };
    a.iter().zip(b).map(off).fold(0.0, f32::max)
}

/// Checks that a scene cut at x = 0 ends within `gate_m` of where a bare world ends it, and that it ends
/// elsewhere without the feature.
pub(crate) fn as_in_bare_rapier(name: &str, gate_m: f32, with: &Setup, without: &Setup) {
    let bare = with.bare();
    let matters = apart(&bare, &without.bare());
    assert!(matters > 4.0 * gate_m, "{name}: the scene does not show it: {matters} m");
    let one = with.partitioned(one_world()).0;
    assert!(one == bare, "{name}: one region is {} m off", apart(&one, &bare));
    for coupling in SHARING {
        let (cut, met) = with.partitioned(halves(coupling));
        let off = apart(&bare, &cut);
        assert!(off < gate_m, "{name}, {}: {off} m apart", coupling.name());
        assert!(met, "{name}, {}: nothing came near the border", coupling.name());
    }
}
