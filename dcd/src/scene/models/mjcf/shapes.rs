//! Builds the shapes and masses of geoms. Rapier's loader makes some otherwise than MuJoCo, or not at all:
//! meshes of several parts, meshes in the file itself, ellipsoids, height fields. In place of each geom but
//! planes the loader is given a small ball, which is then replaced.

use std::collections::BTreeSet;
use std::path::Path;

use rapier3d::parry::utils::Array2;
use rapier3d::prelude::*;
use rapier3d_mjcf::mjcf_rs::body::{Geom, GeomType, InertiaSpec, Inertial};
use rapier3d_mjcf::mjcf_rs::compiler::InertiaFromGeom;
use rapier3d_mjcf::mjcf_rs::glam::{DQuat, DVec3};
use rapier3d_mjcf::mjcf_rs::{self as mjcf, assets::MeshInertia};

use crate::scene::models::files::Files;
use crate::scene::models::mesh::{self, Meshes};
use crate::scene::models::source::Fault;
use crate::scene::models::warnings::Warnings;

/// The most heights of a height field. Without elevations, a few characters in the file state their number.
const MAX_HEIGHTS: usize = 1 << 24;

/// A geom's shape in the space of its body.
pub(super) type Placed = (SharedShape, Pose);

/// Prepares the file for the loader, and returns the shapes of the geoms that touch, by body, in order.
pub(super) fn prepare(
    file: &mut mjcf::Model,
    folder: &Path,
    files: &Files,
    convex: &BTreeSet<String>,
    warnings: &mut Warnings,
) -> Result<Vec<Vec<Placed>>, Fault> {
    let mut maker = Maker { meshes: Meshes::default(), convex, folder, files };
    // Geoms that are only visual are not loaded.
    file.compiler.discard_visual = true;
    let mut all = Vec::new();
    for index in 0..file.bodies.len() {
        let mut touching = Vec::new();
        let mut mass = MassProperties::default();
        let body = &file.bodies[index].body;
        let from_geoms = match file.compiler.inertia_from_geom {
            InertiaFromGeom::True => !body.geoms.is_empty(),
            InertiaFromGeom::Auto => body.inertial.is_none(),
            InertiaFromGeom::False => false,
        } && index > 0;
        let mut geoms = body.geoms.clone();
        for geom in &mut geoms {
            spread(geom);
            let touches = geom.contype != 0 || geom.conaffinity != 0;
            if !touches && !from_geoms {
                continue;
            }
            let placed = maker.shape(file, geom)?;
            if from_geoms && geom.type_ != GeomType::Plane && geom.type_ != GeomType::Hfield {
                mass += maker.mass(file, geom, &placed, warnings)?;
            }
            if touches {
                touching.push(placed);
            }
        }
        for geom in &mut geoms {
            if !matches!(geom.type_, GeomType::Plane) {
                let size = [1e-3; 3];
                *geom = Geom {
                    type_: GeomType::Sphere,
                    size,
                    fromto: None,
                    mesh: None,
                    hfield: None,
                    ..geom.clone()
                };
            }
        }
        let body = &mut file.bodies[index].body;
        body.geoms = geoms;
        if from_geoms {
            body.inertial = (mass.inv_mass > 0.0).then(|| inertial(&mass)).or(body.inertial.take());
        }
        all.push(touching);
    }
    file.compiler.inertia_from_geom = InertiaFromGeom::False;
    Ok(all)
}

/// Converts `fromto` to size and pose.
fn spread(geom: &mut Geom) {
    let Some([x1, y1, z1, x2, y2, z2]) = geom.fromto.take() else { return };
    let (from, to) = (DVec3::new(x1, y1, z1), DVec3::new(x2, y2, z2));
    let half = 0.5 * (to - from).length();
    let turn =
        (from - to).try_normalize().map_or(DQuat::IDENTITY, |axis| DQuat::from_rotation_arc(DVec3::Z, axis));
    geom.pose = mjcf::Pose::from_parts(0.5 * (from + to), turn);
    geom.size = match geom.type_ {
        GeomType::Box | GeomType::Ellipsoid => [geom.size[0], geom.size[0], half],
        _ => [geom.size[0], half, 0.0],
    };
}

struct Maker<'a> {
    meshes: Meshes,
    /// Meshes to which the file gives the mass of their hull. The reader takes that for the default, which it
    /// is not.
    convex: &'a BTreeSet<String>,
    folder: &'a Path,
    files: &'a Files,
}

impl Maker<'_> {
    fn shape(&mut self, file: &mjcf::Model, geom: &Geom) -> Result<Placed, Fault> {
        let size = geom.size.map(|v| v as f32);
        let of_size = |count: usize| {
            let good = size[..count].iter().all(|v| v.is_finite() && *v > 0.0);
            let cause = || format!("geom {} has no size ({:?})", name_of(geom), geom.size);
            if good { Ok(()) } else { Err(Fault::new(cause(), "give it a size, all numbers above 0")) }
        };
        let upright = Pose::from_rotation(Rotation::from_rotation_x(std::f32::consts::FRAC_PI_2));
        let (shape, turn) = match geom.type_ {
            GeomType::Plane => (SharedShape::halfspace(Vector::Z), Pose::IDENTITY),
            GeomType::Sphere => of_size(1).map(|()| (SharedShape::ball(size[0]), Pose::IDENTITY))?,
            GeomType::Capsule => {
                of_size(2).map(|()| (SharedShape::capsule_z(size[1], size[0]), Pose::IDENTITY))?
            }
            GeomType::Cylinder => of_size(2).map(|()| (SharedShape::cylinder(size[1], size[0]), upright))?,
            GeomType::Box => {
                of_size(3).map(|()| (SharedShape::cuboid(size[0], size[1], size[2]), Pose::IDENTITY))?
            }
            GeomType::Ellipsoid => of_size(3).map(|()| (ellipsoid(size), Pose::IDENTITY))?,
            GeomType::Mesh => (self.hull(file, geom)?, Pose::IDENTITY),
            GeomType::Hfield => (height_field(file, geom)?, upright),
            GeomType::Sdf => {
                let cause = format!(
                    "geom {} is a signed distance field, which a dcd world cannot have",
                    name_of(geom)
                );
                return Err(Fault::new(cause, "use a mesh"));
            }
        };
        Ok((shape, Pose::from(geom.pose) * turn))
    }

    fn mass(
        &mut self,
        file: &mjcf::Model,
        geom: &Geom,
        (shape, pose): &Placed,
        warnings: &mut Warnings,
    ) -> Result<MassProperties, Fault> {
        let unit = match geom.type_ {
            // The hull that touches has corners; the mass is the ellipsoid's own.
            GeomType::Ellipsoid => {
                let [x, y, z] = geom.size.map(|v| v as f32);
                let mass = 4.0 / 3.0 * std::f32::consts::PI * x * y * z;
                let inertia = Vector::new(y * y + z * z, x * x + z * z, x * x + y * y) * (mass / 5.0);
                MassProperties::new(Vector::ZERO, mass, inertia)
            }
            GeomType::Mesh => {
                let asset = asset(file, geom)?;
                let (points, triangles) = self.vertices(file, geom)?;
                let named = asset.name.as_ref().is_some_and(|name| self.convex.contains(name));
                if asset.inertia == MeshInertia::Exact || file.compiler.exact_mesh_inertia {
                    mesh::triangles(points, triangles)
                        .map_or(MassProperties::default(), |mesh| mesh.mass_properties(1.0))
                } else if named || triangles.is_empty() {
                    shape.mass_properties(1.0)
                } else {
                    if asset.inertia == MeshInertia::Shell {
                        warnings.add("mesh inertia shell", name_of(geom), "the mesh is solid");
                    }
                    mesh::pyramids(&points, &triangles)
                }
            }
            _ => shape.mass_properties(1.0),
        };
        let factor = match geom.mass {
            Some(mass) => mass as f32 * unit.inv_mass,
            None => geom.density.unwrap_or(file.compiler.inertia_density) as f32,
        };
        if factor <= 0.0 || unit.inv_mass == 0.0 {
            return Ok(MassProperties::default());
        }
        let whole = MassProperties::with_principal_inertia_frame(
            unit.local_com,
            unit.mass() * factor,
            unit.principal_inertia() * factor,
            unit.principal_inertia_local_frame,
        );
        Ok(whole.transform_by(pose))
    }

    fn hull(&mut self, file: &mjcf::Model, geom: &Geom) -> Result<SharedShape, Fault> {
        let (points, _) = self.vertices(file, geom)?;
        mesh::hull(&points).ok_or_else(|| {
            let cause = format!("the mesh of geom {} has no volume", name_of(geom));
            Fault::new(cause, "give the mesh a thickness, or use a box")
        })
    }

    /// Returns all parts of the mesh together, scaled.
    fn vertices(&mut self, file: &mjcf::Model, geom: &Geom) -> Result<mesh::Triangles, Fault> {
        let asset = asset(file, geom)?;
        let scale = Vector::from(asset.scale.map(|v| v as f32));
        if let Some(numbers) = &asset.inline_vertices {
            let (points, odd) = numbers.as_chunks::<3>();
            let indices = asset.inline_faces.as_deref().unwrap_or_default();
            let (faces, rest) = indices.as_chunks::<3>();
            let there = indices.iter().all(|&index| (index as usize) < points.len());
            if !odd.is_empty() || !rest.is_empty() || !there {
                let name = geom.mesh.as_deref().unwrap_or_default();
                let cause = format!("mesh `{name}` has a face of no vertex, or not three numbers for each");
                return Err(Fault::new(cause, "correct vertex and face; vertices are counted from 0"));
            }
            let points = points.iter().map(|point| Vector::from(point.map(|v| v as f32)) * scale);
            return Ok((points.collect(), faces.to_vec()));
        }
        let Some(path) = file.resolve_mesh_file(asset, self.folder) else {
            let cause =
                format!("mesh `{}` has neither file nor vertices", geom.mesh.as_deref().unwrap_or_default());
            return Err(Fault::new(cause, "give it one of them"));
        };
        self.files.check(&path, None)?;
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        for (part, faces) in self.meshes.read(&path)? {
            let first = points.len() as u32;
            points.extend(part.iter().map(|&point| point * scale));
            triangles.extend(faces.iter().map(|face| face.map(|i| i + first)));
        }
        Ok((points, triangles))
    }
}

fn asset<'a>(file: &'a mjcf::Model, geom: &Geom) -> Result<&'a mjcf::assets::Mesh, Fault> {
    let name = geom.mesh.as_deref().unwrap_or_default();
    file.assets.mesh(name).ok_or_else(|| {
        let cause = format!("geom {} uses mesh `{name}`, which <asset> does not have", name_of(geom));
        Fault::new(cause, "add the mesh to <asset>, or correct its name")
    })
}

/// Returns an ellipsoid as a hull fine enough to roll: Parry's ball as triangles, stretched, and widened
/// until its volume is the ellipsoid's.
fn ellipsoid(half: [f32; 3]) -> SharedShape {
    let (points, _) = rapier3d::parry::shape::Ball::new(1.0).to_trimesh(16, 16);
    let sphere = 4.0 / 3.0 * std::f32::consts::PI;
    let unit = SharedShape::convex_hull(&points).expect("a ball has a volume").mass_properties(1.0).mass();
    let out = Vector::from(half) * (sphere / unit).cbrt();
    let points: Vec<_> = points.into_iter().map(|point| point * out).collect();
    mesh::hull(&points).expect("a ball stretched along its axes has a volume")
}

/// Builds a height field. MuJoCo's rows run along y, the first at the far end. Parry's run along z, the first
/// at the near end, which is the far end of y once the field stands upright.
fn height_field(file: &mjcf::Model, geom: &Geom) -> Result<SharedShape, Fault> {
    let name = geom.hfield.as_deref().unwrap_or_default();
    let Some(asset) = file.assets.hfield(name) else {
        let cause = format!("geom {} uses height field `{name}`, which <asset> does not have", name_of(geom));
        return Err(Fault::new(cause, "add it to <asset>, or correct its name"));
    };
    let (rows, columns) = (asset.nrow as usize, asset.ncol as usize);
    if rows.saturating_mul(columns) > MAX_HEIGHTS {
        let cause = format!("height field `{name}` has {rows} times {columns} heights");
        return Err(Fault::new(cause, "make it 16 million at most"));
    }
    // Without heights MuJoCo makes a flat field, for a program to fill in.
    let flat = (asset.elevation.is_none() && asset.file.is_none()).then(|| vec![0.0; rows * columns]);
    let heights = asset.elevation.as_ref().or(flat.as_ref());
    let Some(heights) = heights.filter(|e| e.len() == rows * columns && rows > 1 && columns > 1) else {
        let cause = format!("height field `{name}` is not given by nrow * ncol numbers in the file");
        return Err(Fault::new(
            cause,
            "write its heights as elevation=\"..\": images and other files are not read",
        ));
    };
    let least = heights.iter().copied().fold(f64::INFINITY, f64::min);
    let span = heights.iter().copied().fold(f64::NEG_INFINITY, f64::max) - least;
    let span = if span > 0.0 { span } else { 1.0 };
    let at =
        |row: usize, column: usize| ((heights[row * columns + column] - least) / span * asset.size[2]) as f32;
    // Column by column.
    let data = (0..columns).flat_map(|column| (0..rows).map(move |row| (row, column)));
    let data = data.map(|(row, column)| at(row, column)).collect();
    let scale = Vector::new(2.0 * asset.size[0] as f32, 1.0, 2.0 * asset.size[1] as f32);
    Ok(SharedShape::heightfield(Array2::new(rows, columns, data), scale))
}

fn inertial(mass: &MassProperties) -> Inertial {
    let [[xx, xy, xz], [_, yy, yz], [_, _, zz]] = mass.reconstruct_inertia_matrix().to_cols_array_2d();
    Inertial {
        pose: mjcf::Pose::from_translation(DVec3::from_array(mass.local_com.to_array().map(f64::from))),
        mass: mass.mass().into(),
        inertia: InertiaSpec::Full([xx, yy, zz, xy, xz, yz].map(f64::from)),
    }
}

fn name_of(geom: &Geom) -> String {
    geom.name.as_ref().map_or_else(|| "without a name".to_owned(), |name| format!("`{name}`"))
}
