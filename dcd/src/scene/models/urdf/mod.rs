//! Reads URDF files through rapier3d-urdf.

mod parse;
mod roots;
mod unknown;
mod welds;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Component, Path, PathBuf};

use rapier3d::glamx::glam::{DMat3, DVec3};
use rapier3d::prelude::*;
use rapier3d_urdf::urdf_rs::{self, Geometry};
use rapier3d_urdf::{UrdfLoaderOptions, UrdfRobot};

use super::ModelParams;
use super::files::Files;
use super::mass::Mass;
use super::mesh::{self, Meshes};
use super::model::{Model, ModelJoint, Part, collider_builder, drop_wide_limits};
use super::source::{Fault, Source};
use crate::physics::LinkSettings;
use crate::scene::SceneError;
use parse::Parsed;
use roots::Roots;
use welds::Welds;

/// Reads a URDF file into a model.
pub(super) fn read(source: &Source, params: &ModelParams, files: &Files) -> Result<Model, SceneError> {
    let document = source.document("robot")?;
    parse::parse(&document)
        .and_then(|parsed| convert(source, parsed, params, files))
        .map_err(|fault| source.fault(fault))
}

fn convert(source: &Source, mut parsed: Parsed, params: &ModelParams, files: &Files) -> Result<Model, Fault> {
    // The loader ignores meshes that it cannot read, and takes a URDF's moving meshes for shells. So it is
    // given boxes in their place, one per mesh, which are then replaced.
    let mut meshes = Meshes::default();
    let shapes = mesh_shapes(&mut parsed.robot, source.folder(), files, &mut meshes)?;
    for mesh in meshes.not_z_up {
        parsed.warnings.add("up_axis of Collada", mesh, "its numbers are taken as they stand");
    }
    let roots = Roots::take(&mut parsed.robot);
    let begins = roots.of_links(&parsed.robot);
    let options = UrdfLoaderOptions { make_roots_fixed: params.fixed, ..UrdfLoaderOptions::default() };
    let made = UrdfRobot::from_robot(&parsed.robot, options, source.folder());
    let mut model = Model {
        name: if parsed.robot.name.is_empty() { source.stem() } else { parsed.robot.name.clone() },
        gravity: [0.0, 0.0, -9.81],
        dt_s: None,
        parts: Vec::new(),
        joints: Vec::new(),
        apart: BTreeSet::new(),
        warnings: parsed.warnings,
    };
    for link in &made.links {
        let from = &parsed.robot.links[link.urdf_link_index];
        let surface = parsed.surfaces.get(&from.name).copied().unwrap_or_default();
        let colliders = link.colliders.iter().map(|collider| {
            let builder = collider_builder(&collider.collider);
            builder.friction(surface.friction).restitution(surface.restitution)
        });
        let mut part = Part::of(from.name.clone(), &link.body, colliders.collect());
        part.mass = mass_of(&from.inertial);
        part.pose = begins.get(&from.name).copied().unwrap_or_default() * part.pose;
        if roots.fixed.contains(&from.name) {
            part.body.body_type = RigidBodyType::Fixed;
        }
        model.parts.push(part);
    }
    add_joints(&mut model, &made, &parsed.robot, &parsed.unlimited, params.multibody);
    let welds = Welds::of(&model);
    fix_weightless_roots(&mut model, &welds);
    let fixed = welds.any(&model, Part::is_fixed);
    for ((part, link), fixed) in model.parts.iter_mut().zip(&made.links).zip(fixed) {
        let name = &parsed.robot.links[link.urdf_link_index].name;
        replace_meshes(part, shapes.get(name).map_or(&[], Vec::as_slice), fixed)?;
    }
    welds.merge(&mut model);
    keep_overlapping_apart(&mut model);
    Ok(model)
}

/// A mesh of a link that is to replace the shape of the link's collider of this index.
struct MeshShape {
    collider: usize,
    points: Vec<Vector>,
    triangles: Vec<[u32; 3]>,
    file: String,
}

/// Replaces each `<mesh>` of a collision by one box per part of the mesh, and returns the parts by link.
fn mesh_shapes(
    robot: &mut urdf_rs::Robot,
    folder: &Path,
    files: &Files,
    meshes: &mut Meshes,
) -> Result<BTreeMap<String, Vec<MeshShape>>, Fault> {
    let mut shapes: BTreeMap<String, Vec<MeshShape>> = BTreeMap::new();
    for link in &mut robot.links {
        let mut collisions = Vec::new();
        for collision in std::mem::take(&mut link.collision) {
            let Geometry::Mesh { filename, scale } = &collision.geometry else {
                collisions.push(collision);
                continue;
            };
            let scale = scale.map_or(Vector::ONE, |scale| Vector::from(scale.0.map(|v| v as f32)));
            for (points, triangles) in meshes.read(&resolve(filename, folder, files)?)? {
                shapes.entry(link.name.clone()).or_default().push(MeshShape {
                    collider: collisions.len(),
                    points: points.iter().map(|&point| point * scale).collect(),
                    triangles: triangles.clone(),
                    file: filename.clone(),
                });
                let geometry = Geometry::Box { size: urdf_rs::Vec3([1e-3; 3]) };
                collisions.push(urdf_rs::Collision { geometry, ..collision.clone() });
            }
        }
        link.collision = collisions;
    }
    Ok(shapes)
}

/// Returns the file behind a mesh's name. `package://name/path` is looked for in the folders above, with and
/// without `name`.
fn resolve(name: &str, folder: &Path, files: &Files) -> Result<PathBuf, Fault> {
    let remedy = "put the mesh there, or correct the path in the file";
    let plain = name.strip_prefix("file://").unwrap_or(name);
    let package = name.strip_prefix("package://").or_else(|| name.strip_prefix("model://"));
    let Some(inside) = package else {
        let path = folder.join(plain);
        files.check(&path, None)?;
        let missing = || Fault::new(format!("mesh {} is not there", path.display()), remedy);
        return if path.is_file() { Ok(path) } else { Err(missing()) };
    };
    // A file named without a folder lies in the current one.
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let (package, rest) = inside.split_once('/').unwrap_or(("", inside));
    let is_name = matches!(Path::new(package).components().next(), Some(Component::Normal(_)));
    let places = |above: &Path| {
        let package = is_name.then(|| above.join(package));
        [(package, above.join(inside)), (None, above.join(rest))]
    };
    let found = whole.ancestors().flat_map(places).find(|(_, path)| path.is_file());
    let Some((package, path)) = found else {
        let cause = format!("mesh {name} is in no folder above {}", whole.display());
        let remedy = "put the package into a folder above, or write the path relative to the file";
        return Err(Fault::new(cause, remedy));
    };
    files.check(&path, package.as_deref())?;
    Ok(path)
}

fn replace_meshes(part: &mut Part, shapes: &[MeshShape], fixed: bool) -> Result<(), Fault> {
    for shape in shapes {
        let made = if fixed {
            mesh::triangles(shape.points.clone(), shape.triangles.clone())
        } else {
            mesh::hull(&shape.points)
        };
        let made = made
            .or_else(|| mesh::triangles(shape.points.clone(), shape.triangles.clone()))
            .ok_or_else(|| {
                let cause = format!("mesh {} of link {} has no area", shape.file, part.name);
                Fault::new(cause, "repair the mesh, or use a box")
            })?;
        part.colliders[shape.collider].shape = made;
    }
    Ok(())
}

/// Returns the rotation of an origin.
fn turn(origin: &urdf_rs::Pose) -> Rotation {
    let [roll, pitch, yaw] = origin.rpy.0.map(|v| v as f32);
    Rotation::from_rotation_z(yaw) * Rotation::from_rotation_y(pitch) * Rotation::from_rotation_x(roll)
}

/// Returns the mass from the file's numbers: the loader does not turn the inertia by its origin's `rpy`.
fn mass_of(inertial: &urdf_rs::Inertial) -> MassProperties {
    let urdf_rs::Inertial { origin, mass, inertia: i } = inertial;
    let tensor = [i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz];
    let own = Mass { kg: mass.value, centre: DVec3::ZERO, inertia: DMat3::from_cols_array(&tensor) };
    let frame = Pose::from_parts(Vector::from(origin.xyz.0.map(|v| v as f32)), turn(origin));
    own.placed(&frame).properties()
}

fn add_joints(
    model: &mut Model,
    made: &UrdfRobot,
    robot: &urdf_rs::Robot,
    unlimited: &BTreeSet<String>,
    multibody: bool,
) {
    for made in &made.joints {
        let from = &robot.joints[made.source_urdf_joint_index()];
        let name = from.name.clone();
        let mut joint = made.joint;
        let axis = match from.joint_type {
            urdf_rs::JointType::Revolute | urdf_rs::JointType::Continuous => Some(JointAxis::AngX),
            urdf_rs::JointType::Prismatic => Some(JointAxis::LinX),
            _ => None,
        };
        if unlimited.contains(&name) {
            joint.limit_axes = JointAxesMask::empty();
        }
        let mut link = (multibody && model.links(made.link1, made.link2, &joint))
            .then(|| LinkSettings { damping: Some([0.0; 6]), ..LinkSettings::default() });
        if link.is_none() && drop_wide_limits(&mut joint) {
            model.warnings.add("limit of a whole turn or more", &*name, "is not limited");
        }
        if let (Some(axis), Some(dynamics)) = (axis, &from.dynamics) {
            match &mut link {
                Some(link) => {
                    link.damping = Some([dynamics.damping as f32; 6]);
                    link.friction = [dynamics.friction as f32; 6];
                }
                None => brake(&mut joint, axis, dynamics, model, &name),
            }
        }
        model.joints.push(ModelJoint { a: made.link1, b: made.link2, joint, tree: true, link });
    }
}

/// Applies `<dynamics>`: damping, or dry friction.
fn brake(
    joint: &mut GenericJoint,
    axis: JointAxis,
    dynamics: &urdf_rs::Dynamics,
    model: &mut Model,
    name: &str,
) {
    if dynamics.damping > 0.0 {
        joint.set_motor_model(axis, MotorModel::ForceBased);
        joint.set_motor_velocity(axis, 0.0, dynamics.damping as f32);
        if dynamics.friction > 0.0 {
            model.warnings.add("dynamics friction", name, "has no effect beside damping");
        }
    } else if dynamics.friction > 0.0 {
        joint.set_motor_model(axis, MotorModel::ForceBased);
        joint.set_motor_velocity(axis, 0.0, 0.0);
        joint.set_motor_max_force(axis, dynamics.friction as f32);
    }
}

/// Fixes roots that have no mass, nor are tied to any by fixed joints: such a root is the world, or stands in
/// it. A root without mass whose name is `world` is the world, as in other readers of URDF.
fn fix_weightless_roots(model: &mut Model, welds: &Welds) {
    let weighs = welds.any(model, |part| part.mass.inv_mass > 0.0);
    for (index, weighs) in weighs.into_iter().enumerate() {
        let root = model.joints.iter().all(|joint| joint.b != index);
        let part = &mut model.parts[index];
        let is_world = part.mass.inv_mass == 0.0 && part.name == roots::WORLD;
        if root && part.is_dynamic() && (is_world || !weighs) {
            part.body.body_type = RigidBodyType::Fixed;
            model.warnings.add("root without mass", &*part.name, "is fixed where it is");
        }
    }
}

/// Keeps links of one robot that overlap at the start from touching: they overlap by design.
fn keep_overlapping_apart(model: &mut Model) {
    let overlap = |a: &Part, b: &Part| {
        a.colliders.iter().any(|x| {
            b.colliders.iter().any(|y| {
                let (at, to) = (a.pose * x.position, b.pose * y.position);
                rapier3d::parry::query::intersection_test(&at, &*x.shape, &to, &*y.shape)
                    .is_ok_and(|found| found.intersecting)
            })
        })
    };
    let tied: BTreeSet<_> =
        model.joints.iter().map(|joint| (joint.a.min(joint.b), joint.a.max(joint.b))).collect();
    for a in 0..model.parts.len() {
        for b in a + 1..model.parts.len() {
            if !tied.contains(&(a, b)) && overlap(&model.parts[a], &model.parts[b]) {
                model.keep_apart(a, b);
                let names = format!("{} and {}", model.parts[a].name, model.parts[b].name);
                model.warnings.add("links that overlap at the start", names, "never touch");
            }
        }
    }
}
