//! Reads the tables `[[body]]` and `[[grid]]` of scene files.

use rapier3d::prelude::*;
use serde::Deserialize;
use toml::Spanned;

use super::collider::ColliderDef;
use super::numbers::{Finite, NonNegative, Place, Positive, Quaternion, rotation, set, vector};
use super::source::Fault;
use crate::scene::SceneBody;
use crate::scene::dice::Dice;
use crate::scene::model::world_pose;
use crate::space::Axis;

/// The most bodies of one grid.
const MOST: u64 = 2_000_000;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BodyDef {
    pub(super) name: Option<String>,
    #[serde(default)]
    kind: Kind,
    #[serde(default)]
    position: Place,
    rotation: Option<Quaternion>,
    euler_deg: Option<[Finite; 3]>,
    velocity: Option<[Finite; 3]>,
    spin: Option<[Finite; 3]>,
    linear_damping: Option<NonNegative>,
    angular_damping: Option<NonNegative>,
    gravity_scale: Option<Finite>,
    #[serde(default)]
    lock_position: Vec<Axis>,
    #[serde(default)]
    lock_rotation: Vec<Axis>,
    dominance: Option<i8>,
    ccd: Option<bool>,
    soft_ccd: Option<NonNegative>,
    fast_rotation: Option<bool>,
    gyroscopic: Option<bool>,
    can_sleep: Option<bool>,
    sleeping: Option<bool>,
    enabled: Option<bool>,
    extra_mass: Option<Positive>,
    extra_solver_iterations: Option<u16>,
    extra_pgs_iterations: Option<u16>,
    user_data: Option<u64>,
    #[serde(default)]
    collider: Vec<Spanned<ColliderDef>>,
}

#[derive(Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    #[default]
    Dynamic,
    Fixed,
    KinematicPosition,
    KinematicVelocity,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct GridDef {
    count: [u32; 3],
    spacing: Place,
    jitter: Option<NonNegative>,
    #[serde(default)]
    seed: u64,
    body: BodyDef,
}

/// Returns whether a collider has no inside, and so no mass by density.
fn is_hollow(collider: &ColliderBuilder) -> bool {
    let shape = &collider.shape;
    shape.as_halfspace().is_some() || shape.as_trimesh().is_some() || shape.as_heightfield().is_some()
}

impl BodyDef {
    pub(super) fn build(&self) -> Result<SceneBody, Fault> {
        let turn = rotation(self.rotation, self.euler_deg)?;
        let build =
            |def: &Spanned<ColliderDef>| def.get_ref().build().map_err(|fault| fault.within(def.span()));
        let colliders = self.collider.iter().map(build).collect::<Result<Vec<_>, _>>()?;
        self.refuse_motion_of_what_does_not_move()?;
        let enabled = colliders.iter().filter(|collider| collider.enabled);
        let mass_kg: f32 = enabled.map(|collider| collider.build().mass()).sum();
        // What is heavier than single precision holds has no mass, by Rapier.
        let is_heavy = |collider: &ColliderBuilder| {
            !is_hollow(collider)
                && matches!(collider.mass_properties, ColliderMassProps::Density(density) if density > 0.0)
        };
        let is_beyond = !mass_kg.is_finite()
            || mass_kg == 0.0 && colliders.iter().any(|collider| collider.enabled && is_heavy(collider));
        if self.kind == Kind::Dynamic && is_beyond {
            return Err(Fault::new(
                "the mass of a dynamic body is beyond single precision",
                "make it smaller or lighter",
            ));
        }
        if self.kind == Kind::Dynamic && self.extra_mass.is_none() && mass_kg <= 0.0 {
            return Err(if colliders.iter().any(|collider| collider.enabled && is_hollow(collider)) {
                Fault::new(
                    "a dynamic body has no mass: a halfspace, an open mesh and a heightfield have none by density",
                    "give its [[body.collider]] a mass, or the body an extra_mass or kind = \"fixed\"",
                )
            } else {
                Fault::new(
                    "a dynamic body has no mass",
                    "give it a [[body.collider]] that is enabled, with a density or mass, or an extra_mass",
                )
            });
        }
        Ok(SceneBody { pose: world_pose(self.position.0, turn), body: self.builder(), colliders })
    }

    /// Refuses a velocity that would be ignored.
    fn refuse_motion_of_what_does_not_move(&self) -> Result<(), Fault> {
        let kind = match self.kind {
            Kind::Dynamic | Kind::KinematicVelocity => return Ok(()),
            Kind::Fixed => "fixed",
            Kind::KinematicPosition => "kinematic-position",
        };
        let given = [("velocity", self.velocity), ("spin", self.spin)];
        let moves = |(_, value): &&(_, Option<[Finite; 3]>)| value.is_some_and(|v| vector(v) != Vector::ZERO);
        match given.iter().find(moves) {
            None => Ok(()),
            Some((key, _)) => Err(Fault::new(
                format!("a body of kind `{kind}` has a `{key}`, and would not move by it"),
                "drop it, or write kind = \"kinematic-velocity\"",
            )),
        }
    }

    fn builder(&self) -> RigidBodyBuilder {
        let mut body = RigidBodyBuilder::new(match self.kind {
            Kind::Dynamic => RigidBodyType::Dynamic,
            Kind::Fixed => RigidBodyType::Fixed,
            Kind::KinematicPosition => RigidBodyType::KinematicPositionBased,
            Kind::KinematicVelocity => RigidBodyType::KinematicVelocityBased,
        });
        let mut locks = LockedAxes::empty();
        for axis in &self.lock_position {
            locks |= LockedAxes::from_bits_truncate(LockedAxes::TRANSLATION_LOCKED_X.bits() << axis.index());
        }
        for axis in &self.lock_rotation {
            locks |= LockedAxes::from_bits_truncate(LockedAxes::ROTATION_LOCKED_X.bits() << axis.index());
        }
        body = body.locked_axes(locks);
        if let Some(mass) = self.extra_mass {
            body = body.additional_mass(mass.0);
        }
        set(&mut body.linvel, self.velocity.map(vector));
        set(&mut body.angvel, self.spin.map(vector));
        set(&mut body.linear_damping, self.linear_damping.map(|v| v.0));
        set(&mut body.angular_damping, self.angular_damping.map(|v| v.0));
        set(&mut body.gravity_scale, self.gravity_scale.map(|v| v.0));
        set(&mut body.dominance_group, self.dominance);
        set(&mut body.ccd_enabled, self.ccd);
        set(&mut body.soft_ccd_prediction, self.soft_ccd.map(|v| v.0));
        set(&mut body.allow_fast_rotation, self.fast_rotation);
        set(&mut body.gyroscopic_forces_enabled, self.gyroscopic);
        set(&mut body.can_sleep, self.can_sleep);
        set(&mut body.sleeping, self.sleeping);
        set(&mut body.enabled, self.enabled);
        set(&mut body.additional_solver_iterations, self.extra_solver_iterations.map(usize::from));
        set(&mut body.additional_pgs_iterations, self.extra_pgs_iterations.map(usize::from));
        set(&mut body.user_data, self.user_data.map(u128::from));
        body
    }
}

impl GridDef {
    /// Builds the copies, x fastest, then y, then z. With a name they are `name[0]`, `name[1]` ….
    pub(super) fn build(
        &self,
        mut push: impl FnMut(Option<&str>, SceneBody) -> Result<(), Fault>,
    ) -> Result<(), Fault> {
        let [nx, ny, nz] = self.count.map(u64::from);
        let total = nx.saturating_mul(ny).saturating_mul(nz);
        if !(1..=MOST).contains(&total) {
            return Err(Fault::new(
                format!("a grid of count = {:?} has {total} bodies", self.count),
                format!("make it 1 to {MOST} bodies"),
            ));
        }
        // Built once: copies share their shapes.
        let model = self.body.build()?;
        let jitter = self.jitter.map_or(0.0, |jitter| jitter.0);
        let mut dice = Dice::new(self.seed);
        for i in 0..total {
            let cell = [i % nx, i / nx % ny, i / (nx * ny)];
            let shift = dice.in_cube(jitter);
            let mut copy = model.clone();
            for axis in 0..3 {
                copy.pose.translation[axis] +=
                    cell[axis] as f64 * self.spacing.0[axis] + f64::from(shift[axis]);
            }
            push(self.body.name.as_ref().map(|name| format!("{name}[{i}]")).as_deref(), copy)?;
        }
        Ok(())
    }
}
