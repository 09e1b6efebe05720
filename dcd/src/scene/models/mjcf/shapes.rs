//! Builds the shapes and masses of geoms. Rapier's loader makes some otherwise than MuJoCo, or not at all:
//! meshes of several parts, meshes in the file itself, ellipsoids, height fields. In place of each geom but
//! planes the loader is given a small ball, which is then replaced.

use std::collections::BTreeSet;
use std::path::Path;

use rapier3d::glamx::glam::{DMat3, DVec3 as Vec3};
use rapier3d::parry::utils::Array2;
use rapier3d::prelude::*;
use rapier3d_mjcf::mjcf_rs::body::{Geom, GeomType, InertiaSpec, Inertial};
use rapier3d_mjcf::mjcf_rs::compiler::InertiaFromGeom;
use rapier3d_mjcf::mjcf_rs::glam::{DQuat, DVec3};
use rapier3d_mjcf::mjcf_rs::{self as mjcf, assets::MeshInertia};

use crate::scene::models::files::Files;
use crate::scene::models::mass::{self, Mass};
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
        let mut mass = Mass::default();
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
                mass = mass + maker.mass(file, geom, &placed, warnings)?;
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
        if from_geoms && mass.kg > 0.0 {
            body.inertial = Some(inertial(&mass));
        } else if let Some(given) = &mut body.inertial {
            *given = own_inertial(given, body.name.as_deref(), &file.compiler)?;
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
    ) -> Result<Mass, Fault> {
        let unit = match geom.type_ {
            // The hull that touches has corners; the mass is the ellipsoid's own.
            GeomType::Ellipsoid => {
                let [x, y, z] = geom.size;
                let kg = 4.0 / 3.0 * std::f64::consts::PI * x * y * z;
                let moments = Vec3::new(y * y + z * z, x * x + z * z, x * x + y * y) * (kg / 5.0);
                Mass { kg, centre: Vec3::ZERO, inertia: DMat3::from_diagonal(moments) }
            }
            GeomType::Mesh => {
                let asset = asset(file, geom)?;
                let (points, triangles) = self.vertices(file, geom)?;
                let named = asset.name.as_ref().is_some_and(|name| self.convex.contains(name));
                if named || triangles.is_empty() {
                    // As in MuJoCo, vertices without faces weigh as their hull, whatever the file says.
                    Mass::of_shape(&**shape)
                } else if asset.inertia == MeshInertia::Exact || file.compiler.exact_mesh_inertia {
                    mass::enclosed(&points, &triangles)
                } else {
                    if asset.inertia == MeshInertia::Shell {
                        warnings.add("mesh inertia shell", name_of(geom), "the mesh is solid");
                    }
                    mass::pyramids(&points, &triangles)
                }
            }
            _ => Mass::of_shape(&**shape),
        };
        let given = geom.mass.unwrap_or(geom.density.unwrap_or(file.compiler.inertia_density));
        if given < 0.0 {
            let cause = format!("geom {} has a mass or density of {given}", name_of(geom));
            return Err(Fault::new(cause, "give kilograms, or kilograms per cubic metre, from 0"));
        }
        if given == 0.0 || unit.kg == 0.0 {
            return Ok(Mass::default());
        }
        let factor = if geom.mass.is_some() { given / unit.kg } else { given };
        Ok((unit * factor).placed(pose))
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

/// Returns a mass for the loader. Its axes are found here: the loader leaves that to Parry.
fn inertial(mass: &Mass) -> Inertial {
    let (moments, axes) = mass.principal();
    let pose =
        mjcf::Pose::from_parts(DVec3::from_array(mass.centre.to_array()), DQuat::from_array(axes.to_array()));
    Inertial { pose, mass: mass.kg, inertia: InertiaSpec::Diagonal(moments.to_array()) }
}

/// Returns what `<inertial>` says for the loader, or an error if no body can be so. As in MuJoCo, moments of
/// which one exceeds the sum of the others are refused, or made equal if the compiler balances them.
fn own_inertial(
    given: &Inertial,
    body: Option<&str>,
    compiler: &mjcf::compiler::Compiler,
) -> Result<Inertial, Fault> {
    /// Of the sum: what numbers of a few digits may lack.
    const ROUNDING: f64 = 1e-6;
    let name = body.map_or_else(|| "without a name".to_owned(), |name| format!("`{name}`"));
    if given.mass < 0.0 {
        let cause = format!("body {name} has a mass of {}", given.mass);
        return Err(Fault::new(cause, "give kilograms, from 0"));
    }
    let mut own = match given.inertia {
        InertiaSpec::Diagonal(_) => given.clone(),
        InertiaSpec::Full([xx, yy, zz, xy, xz, yz]) => inertial(&Mass {
            kg: given.mass,
            centre: Vec3::from_array(given.pose.translation.to_array()),
            inertia: DMat3::from_cols_array(&[xx, xy, xz, xy, yy, yz, xz, yz, zz]),
        }),
    };
    if let InertiaSpec::Diagonal(moments) = &mut own.inertia {
        let sum: f64 = moments.iter().sum();
        let [least, most] = [f64::min, f64::max].map(|of| moments.iter().copied().fold(moments[0], of));
        if least < -ROUNDING * sum.abs() {
            let cause = format!("body {name} has a moment of inertia of {least}");
            return Err(Fault::new(cause, "give kg m², from 0; a full inertia must be positive definite"));
        }
        *moments = moments.map(|moment| moment.max(compiler.bound_inertia));
        let sum: f64 = moments.iter().sum();
        if most > (0.5 + ROUNDING) * sum && compiler.balance_inertia {
            *moments = [sum / 3.0; 3];
        } else if most > (0.5 + ROUNDING) * sum {
            let cause =
                format!("body {name} has an inertia of which one moment exceeds the sum of the others");
            return Err(Fault::new(
                cause,
                "correct it, give <compiler balanceinertia=\"true\"/>, or leave <inertial> out",
            ));
        }
    }
    Ok(own)
}

fn name_of(geom: &Geom) -> String {
    geom.name.as_ref().map_or_else(|| "without a name".to_owned(), |name| format!("`{name}`"))
}
