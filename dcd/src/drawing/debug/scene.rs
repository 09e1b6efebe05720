//! Draws the world of a `Source`, flag by flag.

use std::collections::BTreeMap;

use nalgebra::Point3;

use super::{DebugDraw, DebugDrawFlags, DebugDrawSettings, DebugShape};
use crate::drawing::colour;
use crate::drawing::geometry::{
    BALL, BOX, CAPSULE, CONE, CYLINDER, FIRST_MESH, Geometries, Mesh, PLANE, Part,
};
use crate::drawing::source::{Seen, Source, Tie};
use crate::protocol::WorldPose;
use crate::space::{BodyId, Bounds};

/// The most contacts that are drawn.
const MOST_CONTACTS: usize = 1 << 16;
/// The widths of points, pixels: of contacts and centres of mass, and of avatars.
const POINT_PX: f32 = 5.0;
const AVATAR_PX: f32 = 12.0;
const WHITE: [u8; 4] = [0xff; 4];
const FORCE: [u8; 4] = [0xd1, 0x66, 0x2b, 0xff];
const JOINT: [u8; 4] = [0x7f, 0x8b, 0xa0, 0xff];

/// The shapes of a world, kept from one drawing to the next.
#[derive(Default)]
pub(crate) struct Canvas {
    geometries: Geometries,
    meshes: Vec<Mesh>,
}

impl Canvas {
    /// Draws a world.
    pub(crate) fn draw(
        &mut self,
        world: &impl Source,
        settings: &DebugDrawSettings,
        to: &mut (impl DebugDraw + ?Sized),
    ) {
        use DebugDrawFlags as Flag;
        let what = settings.what;
        let is_near = |at: &[f64; 3]| settings.within.is_none_or(|bounds| contains(&bounds, at));
        if what.has(Flag::BORDERS) {
            draw_regions(world, to);
        }
        if what.has(Flag::SHAPES) {
            world.for_each_fixed(|id, pose, _| self.draw_body(world, id, pose, colour::of_fixed(), to));
        }
        let of_movable = [
            Flag::SHAPES,
            Flag::AABBS,
            Flag::SWEPT_AABBS,
            Flag::CENTRES_OF_MASS,
            Flag::VELOCITIES,
            Flag::AVATARS,
            Flag::LABELS,
        ];
        if what.has_any(&of_movable) {
            world.for_each_movable(|id, seen| {
                if is_near(&seen.at) {
                    self.draw_movable(world, id, &seen, settings, to);
                }
            });
        }
        if what.has(Flag::GHOSTS) {
            for (holder, bounds) in world.ghost_boxes() {
                if is_near(&bounds.centre()) {
                    to.aabb(&bounds, colour::of_region(holder));
                }
            }
        }
        if what.has(Flag::JOINTS) {
            draw_joints(world, is_near, to);
        }
        if what.has(Flag::CONTACTS) {
            for contact in world.contacts(MOST_CONTACTS).into_iter().filter(|contact| is_near(&contact.at)) {
                to.point(contact.at, POINT_PX, FORCE);
                to.line(contact.at, moved(contact.at, contact.force_n, settings.metres_per_n), FORCE);
            }
        }
    }

    fn draw_movable(
        &mut self,
        world: &impl Source,
        id: BodyId,
        seen: &Seen,
        settings: &DebugDrawSettings,
        to: &mut (impl DebugDraw + ?Sized),
    ) {
        use DebugDrawFlags as Flag;
        let (what, own) = (settings.what, colour::of_body(seen));
        if what.has(Flag::SHAPES) {
            let pose = WorldPose { translation: seen.at, rotation: seen.turn };
            self.draw_body(world, id, &pose, own, to);
        }
        if what.has_any(&[Flag::AABBS, Flag::SWEPT_AABBS, Flag::CENTRES_OF_MASS])
            && let Some(extent) = world.extent(id)
        {
            if what.has(Flag::AABBS) {
                to.aabb(&extent.aabb, own);
            }
            if what.has(Flag::SWEPT_AABBS) {
                to.aabb(&extent.swept, colour::faint(own));
            }
            if what.has(Flag::CENTRES_OF_MASS) {
                to.point(extent.centre_of_mass, POINT_PX, own);
            }
        }
        if what.has(Flag::VELOCITIES) && seen.velocity_m_s != [0.0; 3] {
            to.line(seen.at, moved(seen.at, seen.velocity_m_s, settings.metres_per_m_s), own);
        }
        if what.has(Flag::AVATARS) && id.client().is_some() {
            to.point(seen.at, AVATAR_PX, if world.is_own(id) { WHITE } else { own });
        }
        if what.has(Flag::LABELS) {
            to.text(seen.at, &id.to_string(), own);
        }
    }

    fn draw_body(
        &mut self,
        world: &impl Source,
        id: BodyId,
        pose: &WorldPose,
        colour: [u8; 4],
        to: &mut (impl DebugDraw + ?Sized),
    ) {
        let Some(record) = world.record(id) else { return };
        let parts = self.geometries.of_body(&record, |hash| world.shape(hash));
        self.meshes.extend(self.geometries.take_fresh());
        for part in parts {
            let colour = if part.sensor { colour::faint(colour) } else { colour };
            to.shape(id, &self.shape_of(&part), &placed(pose, &part), colour);
        }
    }

    fn shape_of(&self, part: &Part) -> DebugShape<'_> {
        let [radius, half_height, _] = part.size;
        match part.geometry {
            BOX => DebugShape::Box { half: part.size },
            BALL => DebugShape::Ball { radius },
            CAPSULE => DebugShape::Capsule { half_height, radius },
            CYLINDER => DebugShape::Cylinder { half_height, radius },
            CONE => DebugShape::Cone { half_height, radius },
            PLANE => DebugShape::HalfSpace,
            mesh => {
                let number = mesh - FIRST_MESH;
                let Mesh { vertices, triangles } = &self.meshes[usize::from(number)];
                DebugShape::Mesh { number: number.into(), vertices, triangles }
            }
        }
    }
}

fn draw_regions(world: &impl Source, to: &mut (impl DebugDraw + ?Sized)) {
    let bounds = world.bounds();
    for (place, region) in world.regions().iter().enumerate() {
        // The cells of outer regions reach to infinity.
        let within = |v: f64, axis: usize| v.clamp(bounds.min[axis], bounds.max[axis]);
        let cell = Bounds::new(
            std::array::from_fn(|i| within(region.cell.min[i], i)),
            std::array::from_fn(|i| within(region.cell.max[i], i)),
        );
        to.aabb(&cell, colour::of_region(place as u16));
    }
}

fn draw_joints(world: &impl Source, is_near: impl Fn(&[f64; 3]) -> bool, to: &mut (impl DebugDraw + ?Sized)) {
    let mut places = BTreeMap::new();
    world.for_each_fixed(|id, &pose, _| {
        places.insert(id, pose);
    });
    world.for_each_movable(|id, seen| {
        places.insert(id, WorldPose { translation: seen.at, rotation: seen.turn });
    });
    let joints = world.joints();
    for Tie { bodies, anchors } in joints.values() {
        let [Some(a), Some(b)] = bodies.map(|id| places.get(&id)) else { continue };
        if !is_near(&a.translation) && !is_near(&b.translation) {
            continue;
        }
        let [on_a, on_b] = [(a, anchors[0]), (b, anchors[1])].map(|(pose, anchor)| at(pose, anchor));
        to.line(a.translation, on_a, JOINT);
        to.line(on_a, on_b, FORCE);
        to.line(on_b, b.translation, JOINT);
    }
}

fn contains(bounds: &Bounds, at: &[f64; 3]) -> bool {
    (0..3).all(|i| bounds.min[i] <= at[i] && at[i] <= bounds.max[i])
}

/// Returns a point on a body in world space.
fn at(pose: &WorldPose, local: [f32; 3]) -> [f64; 3] {
    (pose.isometry() * Point3::from(local.map(f64::from))).coords.into()
}

/// Returns the pose of a part of a body in world space.
fn placed(pose: &WorldPose, part: &Part) -> WorldPose {
    if part.translation == [0.0; 3] && part.rotation == WorldPose::default().rotation {
        return *pose;
    }
    let local = WorldPose { translation: part.translation.map(f64::from), rotation: part.rotation };
    let place = pose.isometry() * local.isometry();
    let [x, y, z, w] = [place.rotation.i, place.rotation.j, place.rotation.k, place.rotation.w];
    WorldPose { translation: place.translation.vector.into(), rotation: [x, y, z, w].map(|v| v as f32) }
}

fn moved(from: [f64; 3], by: [f32; 3], scale: f32) -> [f64; 3] {
    std::array::from_fn(|i| from[i] + f64::from(by[i] * scale))
}
