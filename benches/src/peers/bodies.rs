//! Describes the bodies that every engine is given: boxes and balls of one material, as a scene of the
//! library has them.

use std::error::Error;

use dcd::protocol::{Velocity, WorldPose};
use dcd::rapier3d::prelude::*;
use dcd::scene::Scene;

/// A scene in terms that every engine knows.
#[derive(Clone, Debug)]
pub(super) struct Bodies {
    /// Gravity, m/s².
    pub(super) gravity: [f32; 3],
    /// Seconds per step.
    pub(super) dt_s: f32,
    /// Solver iterations of Rapier, substeps of Box3D.
    pub(super) substeps: usize,
    /// The friction of all bodies: engines mix different values by rules of their own.
    pub(super) friction: f32,
    /// The restitution of all bodies, likewise.
    pub(super) restitution: f32,
    /// The bodies, in the order of the scene.
    pub(super) bodies: Vec<Body>,
}

/// One body with one collider around its middle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    /// Says whether the body is dynamic; otherwise it is fixed.
    pub(super) moves: bool,
    pub(super) solid: Solid,
    /// The density, kg/m³.
    pub(super) density: f32,
    /// The place and the velocity with which the body starts.
    pub(super) start: State,
}

/// A shape that every engine has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Solid {
    /// Half edges, metres.
    Box([f32; 3]),
    /// Radius, metres.
    Ball(f32),
}

/// The place and motion of a body; numbers that are not finite stand for a body that is gone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct State {
    pub(super) pose: WorldPose,
    pub(super) velocity: Velocity,
}

impl Bodies {
    /// Takes the bodies of a scene, unless it has something that some engine lacks or treats otherwise.
    pub(super) fn of(scene: &Scene) -> Result<Self, Box<dyn Error>> {
        let refuse = |index: usize, what: &str| {
            format!("`{}` cannot be run by all engines: its body {index} {what}", scene.name)
        };
        if !scene.joints.is_empty() {
            return Err(format!("`{}` cannot be run by all engines: it has joints", scene.name).into());
        }
        let [x, _, z] = scene.gravity;
        if x != 0.0 || z != 0.0 {
            return Err(
                format!("`{}` cannot be run by all engines: Jolt's gravity is along y", scene.name).into()
            );
        }
        let mut material: Option<[f32; 2]> = None;
        let mut bodies = Vec::new();
        for (index, body) in scene.bodies.iter().enumerate() {
            let moves = match body.body.body_type {
                RigidBodyType::Dynamic => true,
                RigidBodyType::Fixed => false,
                _ => return Err(refuse(index, "is kinematic").into()),
            };
            if moves && body.body.can_sleep {
                return Err(refuse(index, "may sleep; engines differ in when").into());
            }
            let [collider] = &body.colliders[..] else {
                return Err(refuse(index, "has not one collider").into());
            };
            if collider.position != Pose::IDENTITY {
                return Err(refuse(index, "has its collider aside").into());
            }
            let own = [collider.friction, collider.restitution];
            if *material.get_or_insert(own) != own {
                return Err(refuse(index, "has another friction or restitution than the first").into());
            }
            let solid = match collider.shape.as_typed_shape() {
                TypedShape::Cuboid(cuboid) => Solid::Box(cuboid.half_extents.to_array()),
                TypedShape::Ball(ball) => Solid::Ball(ball.radius),
                _ => return Err(refuse(index, "is neither a box nor a ball").into()),
            };
            let density = match &collider.mass_properties {
                ColliderMassProps::Density(density) => *density,
                ColliderMassProps::Mass(mass_kg) => mass_kg / solid.volume_m3(),
                ColliderMassProps::MassProperties(_) => {
                    return Err(refuse(index, "has an inertia of its own").into());
                }
            };
            let (linear, angular) = (body.body.linvel.to_array(), body.body.angvel.to_array());
            let start = State { pose: body.pose, velocity: Velocity { linear, angular } };
            bodies.push(Body { moves, solid, density, start });
        }
        let [friction, restitution] = material.ok_or_else(|| format!("`{}` is empty", scene.name))?;
        Ok(Self {
            gravity: scene.gravity,
            dt_s: scene.dt_s,
            substeps: scene.solver_iterations,
            friction,
            restitution,
            bodies,
        })
    }

    /// Returns the bodies that move, in the order of the scene.
    pub(super) fn movers(&self) -> impl Iterator<Item = &Body> {
        self.bodies.iter().filter(|body| body.moves)
    }
}

impl Body {
    pub(super) fn mass_kg(&self) -> f64 {
        f64::from(self.density * self.solid.volume_m3())
    }
}

impl Solid {
    pub(super) fn volume_m3(self) -> f32 {
        match self {
            Self::Box([x, y, z]) => 8.0 * x * y * z,
            Self::Ball(radius_m) => 4.0 / 3.0 * std::f32::consts::PI * radius_m.powi(3),
        }
    }

    /// Returns the radius of a sphere around it.
    pub(super) fn reach_m(self) -> f64 {
        match self {
            Self::Box(half) => f64::from(Vector::from(half).length()),
            Self::Ball(radius_m) => radius_m.into(),
        }
    }
}

impl State {
    /// Returns the state of a body that the engine lost.
    pub(super) fn gone() -> Self {
        Self { pose: WorldPose::at([f64::NAN; 3]), velocity: Velocity::default() }
    }

    /// Makes a state from f32 places, as engines give them.
    pub(super) fn new(place: [f32; 3], rotation: [f32; 4], linear: [f32; 3], angular: [f32; 3]) -> Self {
        let pose = WorldPose { translation: place.map(f64::from), rotation };
        Self { pose, velocity: Velocity { linear, angular } }
    }
}

#[cfg(test)]
mod tests {
    use dcd::scene::Params;

    use super::*;

    fn error(name: &str, params: &[&str]) -> String {
        let scene = Scene::named(name, &Params::from_args(params).unwrap()).unwrap();
        Bodies::of(&scene).unwrap_err().to_string()
    }

    #[test]
    fn what_an_engine_lacks_is_refused_by_name() {
        for (name, params, cause) in [
            ("heap", &["mixed=1"][..], "neither a box nor a ball"),
            ("pyramid", &["sleep=1"], "may sleep"),
            ("chain", &[], "joints"),
        ] {
            let error = error(name, params);
            assert!(error.contains(&format!("`{name}`")) && error.contains(cause), "{error}");
        }
    }

    #[test]
    fn mass_and_material_are_those_of_the_scene() {
        let scene = Scene::named("dve", &Params::new().with("n", 8)).unwrap();
        let bodies = Bodies::of(&scene).unwrap();
        assert_eq!((bodies.friction, bodies.restitution, bodies.gravity), (0.0, 1.0, [0.0; 3]));
        assert_eq!((bodies.movers().count(), bodies.bodies.len()), (8, 14));
        assert!(bodies.movers().all(|body| (body.mass_kg() - 1.0).abs() < 1e-6));
    }
}
