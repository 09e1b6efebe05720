//! Reads the table `[[body.collider]]` of scene files.

use rapier3d::parry::transformation::try_convex_hull;
use rapier3d::prelude::*;
use serde::Deserialize;

use super::numbers::{Direction, Finite, NonNegative, Positive, Quaternion, Share, rotation, set, vector};
use super::source::Fault;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ColliderDef {
    shape: Shape,
    half_size: Option<[Positive; 3]>,
    radius: Option<Positive>,
    half_height: Option<Positive>,
    border: Option<Positive>,
    normal: Option<Direction>,
    points: Option<Vec<[Finite; 3]>>,
    triangles: Option<Vec<[u32; 3]>>,
    one_sided: Option<bool>,
    heights: Option<Vec<Vec<Finite>>>,
    size: Option<[Positive; 3]>,
    position: Option<[Finite; 3]>,
    rotation: Option<Quaternion>,
    euler_deg: Option<[Finite; 3]>,
    density: Option<NonNegative>,
    mass: Option<NonNegative>,
    friction: Option<NonNegative>,
    friction_rule: Option<Rule>,
    restitution: Option<Share>,
    restitution_rule: Option<Rule>,
    sensor: Option<bool>,
    enabled: Option<bool>,
    groups: Option<GroupsDef>,
    solver_groups: Option<GroupsDef>,
    #[serde(default)]
    events: Vec<Event>,
    force_threshold: Option<NonNegative>,
    skin: Option<NonNegative>,
    user_data: Option<u64>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Shape {
    Box,
    Sphere,
    Capsule,
    Cylinder,
    Cone,
    Halfspace,
    Hull,
    Mesh,
    Heightfield,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Rule {
    Average,
    Min,
    Multiply,
    Max,
    ClampedSum,
    GeometricMean,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Event {
    Touch,
    Force,
}

/// Numbers of groups, 1 to 32.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GroupsDef {
    #[serde(rename = "in")]
    memberships: Option<Vec<u32>>,
    #[serde(rename = "with")]
    filter: Option<Vec<u32>>,
    #[serde(default)]
    any: bool,
}

impl ColliderDef {
    pub(super) fn build(&self) -> Result<ColliderBuilder, Fault> {
        self.refuse_keys_of_other_shapes()?;
        let mut collider = ColliderBuilder::new(self.shape()?);
        collider.position = Pose::from_parts(
            self.position.map_or(Vector::ZERO, vector),
            rotation(self.rotation, self.euler_deg)?,
        );
        collider.mass_properties = match (self.density, self.mass) {
            (None, None) => collider.mass_properties,
            (Some(density), None) => ColliderMassProps::Density(density.0),
            (None, Some(mass)) => ColliderMassProps::Mass(mass.0),
            (Some(_), Some(_)) => {
                return Err(Fault::new("a collider has both `density` and `mass`", "write one of them"));
            }
        };
        set(&mut collider.friction, self.friction.map(|v| v.0));
        set(&mut collider.friction_combine_rule, self.friction_rule.map(Rule::of_rapier));
        set(&mut collider.restitution, self.restitution.map(|v| v.0));
        set(&mut collider.restitution_combine_rule, self.restitution_rule.map(Rule::of_rapier));
        set(&mut collider.is_sensor, self.sensor);
        set(&mut collider.enabled, self.enabled);
        set(&mut collider.collision_groups, self.groups.as_ref().map(GroupsDef::build).transpose()?);
        set(&mut collider.solver_groups, self.solver_groups.as_ref().map(GroupsDef::build).transpose()?);
        for event in &self.events {
            collider.active_events |= match event {
                Event::Touch => ActiveEvents::COLLISION_EVENTS,
                Event::Force => ActiveEvents::CONTACT_FORCE_EVENTS,
            };
        }
        set(&mut collider.contact_force_event_threshold, self.force_threshold.map(|v| v.0));
        set(&mut collider.contact_skin, self.skin.map(|v| v.0));
        set(&mut collider.user_data, self.user_data.map(u128::from));
        Ok(collider)
    }

    fn shape(&self) -> Result<SharedShape, Fault> {
        let border = self.border.map(|border| border.0);
        Ok(match self.shape {
            Shape::Box => {
                let [x, y, z] = self.need("half_size", self.half_size)?.map(|v| v.0);
                match border {
                    None => SharedShape::cuboid(x, y, z),
                    Some(border) => SharedShape::round_cuboid(x, y, z, border),
                }
            }
            Shape::Sphere => SharedShape::ball(self.need("radius", self.radius)?.0),
            Shape::Capsule => {
                let (half, radius) = self.round()?;
                SharedShape::capsule_y(half, radius)
            }
            Shape::Cylinder => match (self.round()?, border) {
                ((half, radius), None) => SharedShape::cylinder(half, radius),
                ((half, radius), Some(border)) => SharedShape::round_cylinder(half, radius, border),
            },
            Shape::Cone => match (self.round()?, border) {
                ((half, radius), None) => SharedShape::cone(half, radius),
                ((half, radius), Some(border)) => SharedShape::round_cone(half, radius, border),
            },
            Shape::Halfspace => SharedShape::halfspace(self.need("normal", self.normal)?.0),
            Shape::Hull => self.hull()?,
            Shape::Mesh => self.mesh()?,
            Shape::Heightfield => self.heightfield()?,
        })
    }

    fn round(&self) -> Result<(f32, f32), Fault> {
        Ok((self.need("half_height", self.half_height)?.0, self.need("radius", self.radius)?.0))
    }

    fn hull(&self) -> Result<SharedShape, Fault> {
        // Parry's plain `convex_hull` panics where this one errs; a flat hull has no mass.
        try_convex_hull(&self.points()?)
            .ok()
            .and_then(|(points, triangles)| SharedShape::convex_mesh(points, &triangles))
            .filter(|hull| hull.mass_properties(1.0).mass() > 0.0)
            .ok_or_else(|| {
                let remedy = "give at least four that do not lie in one plane";
                Fault::new("the points of a hull enclose no volume", remedy)
            })
    }

    fn mesh(&self) -> Result<SharedShape, Fault> {
        let points = self.points()?;
        let triangles = self.need("triangles", self.triangles.clone())?;
        if let Some(corner) = triangles.iter().flatten().find(|corner| **corner as usize >= points.len()) {
            return Err(Fault::new(
                format!("a triangle names point {corner}, but there are {} points", points.len()),
                "count points from 0",
            ));
        }
        let flags = match self.one_sided {
            None | Some(true) => TriMeshFlags::FIX_INTERNAL_EDGES,
            Some(false) => TriMeshFlags::default(),
        };
        SharedShape::trimesh_with_flags(points, triangles, flags).map_err(|error| {
            Fault::new(format!("the mesh cannot be built: {error}"), "correct its triangles")
        })
    }

    fn heightfield(&self) -> Result<SharedShape, Fault> {
        let rows = self.need("heights", self.heights.as_ref())?;
        let size = self.need("size", self.size)?.map(|v| v.0);
        let columns = rows.first().map_or(0, Vec::len);
        if rows.len() < 2 || columns < 2 || rows.iter().any(|row| row.len() != columns) {
            return Err(Fault::new(
                "the heights are not a rectangle of at least 2 by 2",
                "give rows (along z) of equally many heights (along x)",
            ));
        }
        // Parry wants them column by column.
        let heights = (0..columns * rows.len()).map(|i| rows[i % rows.len()][i / rows.len()].0).collect();
        let heights = Array2::new(rows.len(), columns, heights);
        Ok(SharedShape::heightfield_with_flags(
            heights,
            Vector::from(size),
            HeightFieldFlags::FIX_INTERNAL_EDGES,
        ))
    }

    fn points(&self) -> Result<Vec<Vector>, Fault> {
        Ok(self.need("points", self.points.as_ref())?.iter().copied().map(vector).collect())
    }

    fn need<T>(&self, key: &str, value: Option<T>) -> Result<T, Fault> {
        value.ok_or_else(|| {
            Fault::new(
                format!("a collider of shape `{}` lacks `{key}`", self.shape.name()),
                format!("it takes {}", self.shape.keys().join(", ")),
            )
        })
    }

    /// Refuses keys of other shapes: a radius on a box would otherwise be ignored without a word.
    fn refuse_keys_of_other_shapes(&self) -> Result<(), Fault> {
        let given = [
            ("half_size", self.half_size.is_some()),
            ("radius", self.radius.is_some()),
            ("half_height", self.half_height.is_some()),
            ("border", self.border.is_some()),
            ("normal", self.normal.is_some()),
            ("points", self.points.is_some()),
            ("triangles", self.triangles.is_some()),
            ("one_sided", self.one_sided.is_some()),
            ("heights", self.heights.is_some()),
            ("size", self.size.is_some()),
        ];
        match given.iter().find(|(key, given)| *given && !self.shape.keys().contains(key)) {
            None => Ok(()),
            Some((key, _)) => Err(Fault::new(
                format!("a collider of shape `{}` has no `{key}`", self.shape.name()),
                format!("it takes {}", self.shape.keys().join(", ")),
            )),
        }
    }
}

impl Shape {
    fn keys(self) -> &'static [&'static str] {
        match self {
            Self::Box => &["half_size", "border"],
            Self::Sphere => &["radius"],
            Self::Capsule => &["half_height", "radius"],
            Self::Cylinder | Self::Cone => &["half_height", "radius", "border"],
            Self::Halfspace => &["normal"],
            Self::Hull => &["points"],
            Self::Mesh => &["points", "triangles", "one_sided"],
            Self::Heightfield => &["heights", "size"],
        }
    }

    fn name(self) -> String {
        format!("{self:?}").to_lowercase()
    }
}

impl Rule {
    fn of_rapier(self) -> CoefficientCombineRule {
        match self {
            Self::Average => CoefficientCombineRule::Average,
            Self::Min => CoefficientCombineRule::Min,
            Self::Multiply => CoefficientCombineRule::Multiply,
            Self::Max => CoefficientCombineRule::Max,
            Self::ClampedSum => CoefficientCombineRule::ClampedSum,
            Self::GeometricMean => CoefficientCombineRule::GeometricMean,
        }
    }
}

impl GroupsDef {
    fn build(&self) -> Result<InteractionGroups, Fault> {
        let mode = if self.any { InteractionTestMode::Or } else { InteractionTestMode::And };
        let plain = InteractionGroups::all();
        Ok(InteractionGroups::new(
            self.memberships.as_deref().map_or(Ok(plain.memberships), group)?,
            self.filter.as_deref().map_or(Ok(plain.filter), group)?,
            mode,
        ))
    }
}

fn group(numbers: &[u32]) -> Result<Group, Fault> {
    let mut bits = 0;
    for &number in numbers {
        if !(1..=32).contains(&number) {
            return Err(Fault::new(format!("there is no group {number}"), "groups are numbered 1 to 32"));
        }
        bits |= 1 << (number - 1);
    }
    Ok(Group::from_bits_truncate(bits))
}
