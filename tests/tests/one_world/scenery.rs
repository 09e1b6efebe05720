//! Generates random scenes of all kinds of bodies, and the bare world that a partitioned one must agree with.

use dcd::physics::{ColliderId, Coupling};
use dcd::protocol::{Velocity, WorldPose};
use dcd::runtime::{LocalWorld, Partitioning, WorldConfig};
use dcd::scene::{Scene, SceneBody};
use dcd::space::{BodyId, Bounds};
use proptest::prelude::*;
use rapier3d::parry::utils::Array2;
use rapier3d::prelude::*;

/// Half the edge of the box in which bodies are placed, metres.
pub(crate) const HALF_M: f32 = 12.0;

/// A body in numbers that proptest can shrink.
#[derive(Clone, Debug)]
pub(crate) struct Thing {
    kind: u8,
    shape: u8,
    size: f32,
    at: [f32; 3],
    spin: [f32; 3],
    velocity: [f32; 3],
    sensor: bool,
    groups: (u32, u32, bool),
    second_collider: bool,
}

pub(crate) fn place() -> impl Strategy<Value = [f32; 3]> {
    prop::array::uniform3(-HALF_M..HALF_M)
}

pub(crate) fn things() -> impl Strategy<Value = Vec<Thing>> {
    prop::collection::vec(thing(), 1..24)
}

pub(crate) fn thing() -> impl Strategy<Value = Thing> {
    let numbers = (0u8..6, 0u8..12, 0.2f32..2.0, place());
    let motion = (prop::array::uniform3(-3.0f32..3.0), prop::array::uniform3(-4.0f32..4.0));
    let groups = (0u32..8, 0u32..8, any::<bool>());
    let sensor = prop::bool::weighted(0.2);
    (numbers, motion, sensor, groups, prop::bool::weighted(0.2)).prop_map(
        |((kind, shape, size, at), (spin, velocity), sensor, groups, second_collider)| Thing {
            kind,
            shape,
            size,
            at,
            spin,
            velocity,
            sensor,
            groups,
            second_collider,
        },
    )
}

impl Thing {
    pub(crate) fn scene_body(&self) -> SceneBody {
        // Flat and infinite shapes have no mass, so only bodies that are not pushed have them.
        let (kind, shape) = match (self.kind, self.shape) {
            (0 | 1, shape) => (RigidBodyType::Fixed, shape),
            (2, shape) => (RigidBodyType::KinematicPositionBased, shape % 7),
            (3, shape) => (RigidBodyType::KinematicVelocityBased, shape % 7),
            (_, shape) => (RigidBodyType::Dynamic, shape % 7),
        };
        let spin = if self.shape > 6 { [0.0; 3] } else { self.spin };
        let groups = InteractionGroups::new(
            Group::from_bits_retain(self.groups.0),
            Group::from_bits_retain(self.groups.1),
            if self.groups.2 { InteractionTestMode::Or } else { InteractionTestMode::And },
        );
        let collider =
            ColliderBuilder::new(shape_of(shape, self.size)).sensor(self.sensor).collision_groups(groups);
        let mut colliders = vec![collider.clone()];
        if self.second_collider {
            colliders.push(ColliderBuilder::ball(self.size * 0.5).translation(Vector::new(0.0, 1.5, 0.0)));
        }
        let mut body = RigidBodyBuilder::new(kind);
        if kind != RigidBodyType::Fixed {
            body = body.linvel(Vector::from(self.velocity)).angvel(Vector::from(self.spin));
        }
        let rotation = Rotation::from_scaled_axis(Vector::from(spin)).normalize().to_array();
        SceneBody { pose: WorldPose { translation: self.at.map(f64::from), rotation }, body, colliders }
    }
}

fn shape_of(kind: u8, size: f32) -> SharedShape {
    let wavy = |i: usize, j: usize| ((i * 7 + j * 3) % 5) as f32 * 0.4;
    match kind {
        0 => SharedShape::ball(size),
        1 => SharedShape::cuboid(size, size * 0.5, size * 2.0),
        2 => SharedShape::capsule_y(size, size * 0.5),
        3 => SharedShape::cylinder(size, size),
        4 => SharedShape::cone(size, size),
        5 => SharedShape::round_cuboid(size, size, size, 0.1),
        6 => SharedShape::compound(vec![
            (Pose::from_translation(Vector::new(size, 0.0, 0.0)), SharedShape::ball(size)),
            (Pose::from_translation(Vector::new(-size, 0.0, 0.0)), SharedShape::cuboid(size, size, size)),
        ]),
        7 => SharedShape::heightfield(
            Array2::new(9, 9, (0..81).map(|k| wavy(k / 9, k % 9)).collect()),
            Vector::new(30.0, 1.0, 30.0),
        ),
        8 => {
            let corners = (0..25).map(|k| {
                let (i, j) = (k / 5, k % 5);
                Vector::new(i as f32 * 7.0 - 14.0, wavy(i, j), j as f32 * 7.0 - 14.0)
            });
            let cells = (0..16u32).map(|k| k / 4 * 5 + k % 4);
            let triangles = cells.flat_map(|k| [[k, k + 1, k + 5], [k + 1, k + 6, k + 5]]);
            SharedShape::trimesh(corners.collect(), triangles.collect()).unwrap()
        }
        9 => SharedShape::cuboid(25.0, size * 0.25, 25.0),
        10 => SharedShape::polyline(vec![Vector::new(-9.0, 0.0, 0.0), Vector::new(9.0, size, 0.0)], None),
        _ => SharedShape::halfspace(Vector::Y),
    }
}

/// Returns a scene with these bodies, without gravity.
pub(crate) fn scene(things: &[Thing]) -> Scene {
    let mut scene = Scene::empty("random");
    scene.gravity = [0.0; 3];
    scene.bounds = Bounds::around([0.0; 3], [f64::from(HALF_M); 3]);
    scene.bodies = things.iter().map(Thing::scene_body).collect();
    scene
}

pub(crate) fn world(scene: &Scene, regions: usize, coupling: Coupling) -> LocalWorld {
    let config = WorldConfig::for_scene(scene);
    let step = config.step.with_coupling(coupling);
    let config = WorldConfig { partitioning: Partitioning::Regions(regions), step, ..config };
    LocalWorld::from_scene(scene, config).unwrap()
}

/// One Rapier world with the bodies of a partitioned world as they are now, and their ids by Rapier's
/// handles.
pub(crate) struct Bare {
    pub(crate) world: PhysicsWorld,
    ids: Vec<(RigidBodyHandle, BodyId)>,
}

impl Bare {
    /// Makes it from a world. `bodies` are those of the world, as they were described.
    pub(crate) fn of(world: &LocalWorld, bodies: &[(BodyId, SceneBody)]) -> Self {
        let mut scene = Scene::empty("bare");
        scene.gravity = [0.0; 3];
        for (id, body) in bodies {
            let pose = world.pose(*id).expect("a body that was not removed");
            scene.bodies.push(SceneBody { pose, ..body.clone() });
        }
        let mut bare = scene.bare_world();
        // Updates Rapier's tree, which a partitioned world does not need.
        bare.detect_collisions(&(), &());
        let ids = bare.bodies.iter().map(|(handle, _)| handle).zip(bodies.iter().map(|(id, _)| *id));
        Self { ids: ids.collect(), world: bare }
    }

    pub(crate) fn name(&self, handle: ColliderHandle) -> ColliderId {
        let parent = self.world.colliders[handle].parent().unwrap();
        let (_, body) = *self.ids.iter().find(|(other, _)| *other == parent).unwrap();
        let index = self.world.bodies[parent].colliders().iter().position(|&other| other == handle);
        ColliderId { body, index: index.unwrap() }
    }

    pub(crate) fn body(&self, collider: &Collider) -> BodyId {
        let parent = collider.parent().unwrap();
        self.ids.iter().find(|(other, _)| *other == parent).unwrap().1
    }
}

pub(crate) fn velocity(linear: [f32; 3], angular: [f32; 3]) -> Velocity {
    Velocity { linear, angular }
}
