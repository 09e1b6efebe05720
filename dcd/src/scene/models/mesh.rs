//! Reads meshes from files, and builds hulls and triangle shapes from them.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::{Path, PathBuf};

use rapier3d::prelude::*;
use rapier3d_meshloader::mesh_loader;

use super::collada::{self, Corners};
use super::source::Fault;
use crate::scene::bounded::read_bounded;

/// Vertices of a mesh and its triangles.
pub(super) type Triangles = (Vec<Vector>, Vec<[u32; 3]>);

/// A cache of mesh files, so that a mesh that many bodies use is read once.
#[derive(Default)]
pub(super) struct Meshes {
    files: BTreeMap<PathBuf, Vec<Triangles>>,
    /// Collada files whose own axes are not z-up: their numbers are taken as they stand, as ROS does.
    pub(super) not_z_up: Vec<String>,
}

const FORMATS: &str = "obj, stl or dae";

impl Meshes {
    /// Returns the meshes of a file, unscaled.
    pub(super) fn read(&mut self, path: &Path) -> Result<&[Triangles], Fault> {
        if !self.files.contains_key(path) {
            let (meshes, z_up) = read(path).map_err(|Fault { line, cause, remedy }| {
                // The line is one of the mesh's file, not of the model's.
                let line = line.map(|line| format!(":{line}")).unwrap_or_default();
                Fault::new(format!("mesh {}{line}: {cause}", path.display()), remedy)
            })?;
            if !z_up {
                self.not_z_up.push(path.file_name().unwrap_or_default().to_string_lossy().into_owned());
            }
            self.files.insert(path.to_owned(), meshes);
        }
        Ok(&self.files[path])
    }
}

/// Returns the meshes of a file, and whether their axes are z-up, which they are unless the file says
/// otherwise.
fn read(path: &Path) -> Result<(Vec<Triangles>, bool), Fault> {
    let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    if !["obj", "stl", "dae"].contains(&extension.as_str()) {
        let cause = format!("meshes of type `{extension}` cannot be read");
        return Err(Fault::new(cause, format!("convert it to {FORMATS}")));
    }
    let bytes = read_bounded(path).map_err(|error| {
        Fault::new(error.to_string(), "put the mesh there, or correct the path in the file")
    })?;
    let (meshes, z_up) = match &*extension {
        "dae" => {
            let text =
                str::from_utf8(&bytes).map_err(|error| Fault::new(error.to_string(), "save it as UTF-8"))?;
            let scene = collada::read(text)?;
            (scene.instances.into_iter().map(indexed).collect(), scene.z_up)
        }
        // The loader tells formats by lower-case extensions only.
        _ => (load(&bytes, &path.with_extension(&extension))?, true),
    };
    if meshes.is_empty() {
        return Err(Fault::new("it has no triangle", "check that it is the right file"));
    }
    if meshes.iter().any(|(points, _)| points.iter().any(|point| !point.is_finite())) {
        return Err(Fault::new("a vertex of it is not finite", "repair the mesh"));
    }
    Ok((meshes, z_up))
}

/// Reads an obj or stl file, without the materials that an obj names: they could be any file of any size, and
/// nothing collides with a colour.
fn load(bytes: &[u8], path: &Path) -> Result<Vec<Triangles>, Fault> {
    if path.extension().is_some_and(|extension| extension == "stl")
        && let Some(corners) = binary_stl(bytes)
    {
        return Ok((!corners.is_empty()).then(|| indexed(corners)).into_iter().collect());
    }
    let no_materials = |_: &Path| -> io::Result<Vec<u8>> { Err(io::ErrorKind::NotFound.into()) };
    let scene = mesh_loader::Loader::default().load_from_slice_with_reader(bytes, path, no_materials);
    let scene = scene
        .map_err(|error| Fault::new(error.to_string(), format!("check that it is a whole {FORMATS} file")))?;
    let meshes = scene.meshes.into_iter().filter(|mesh| !mesh.vertices.is_empty() && !mesh.faces.is_empty());
    Ok(meshes.map(|mesh| (mesh.vertices.into_iter().map(Vector::from).collect(), mesh.faces)).collect())
}

/// Returns the triangles of a binary STL file: a header of 80 bytes of any content, the number of triangles,
/// and 50 bytes of each. `None` if the length is another one: the file is text then, or broken. The loader goes
/// by the first word, `solid` in text, but programs begin the headers of binary files by it too.
fn binary_stl(bytes: &[u8]) -> Option<Corners> {
    const TRIANGLE: usize = 50;
    let (_, counted) = bytes.split_at_checked(80)?;
    let (count, triangles) = counted.split_first_chunk::<4>()?;
    if u64::from(u32::from_le_bytes(*count)) * TRIANGLE as u64 != triangles.len() as u64 {
        return None;
    }
    let number = |bytes: &[u8], at: usize| {
        f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
    };
    let corner = |bytes: &[u8], at: usize| {
        Vector::new(number(bytes, at), number(bytes, at + 4), number(bytes, at + 8))
    };
    // The normal comes first, and an attribute of two bytes last.
    let corners = |bytes: &[u8]| [12, 24, 36].map(|at| corner(bytes, at));
    Some(triangles.chunks_exact(TRIANGLE).map(corners).collect())
}

fn indexed(corners: Corners) -> Triangles {
    let faces = (0..corners.len() as u32).map(|face| [3 * face, 3 * face + 1, 3 * face + 2]).collect();
    (corners.into_flattened(), faces)
}

/// Returns the convex hull of points, if it has a volume and can be sent. Parry fails at some rings of many
/// points in a plane. Then the hull of the points that lie farthest in many directions stands in.
pub(super) fn hull(points: &[Vector]) -> Option<SharedShape> {
    let of = |points: &[Vector]| SharedShape::convex_hull(points).filter(travels);
    of(points).or_else(|| [512, 256, 128, 64].into_iter().find_map(|count| of(&outermost(points, count))))
}

/// Returns the points that lie farthest in `count` directions, spread evenly over the sphere, each point
/// once.
fn outermost(points: &[Vector], count: usize) -> Vec<Vector> {
    let golden = std::f32::consts::PI * (5f32.sqrt() - 1.0);
    let directions = (0..count).map(|i| {
        let height = 1.0 - 2.0 * (i as f32 + 0.5) / count as f32;
        let (sin, cos) = (golden * i as f32).sin_cos();
        let radius = (1.0 - height * height).sqrt();
        Vector::new(cos * radius, sin * radius, height)
    });
    let farthest = |along: Vector| {
        (0..points.len()).max_by(|&a, &b| points[a].dot(along).total_cmp(&points[b].dot(along)))
    };
    let chosen: BTreeSet<usize> = directions.filter_map(farthest).collect();
    chosen.into_iter().map(|index| points[index]).collect()
}

/// Returns the triangles as they are, if they can be sent.
pub(super) fn triangles(points: Vec<Vector>, triangles: Vec<[u32; 3]>) -> Option<SharedShape> {
    SharedShape::trimesh_with_flags(points, triangles, TriMeshFlags::MERGE_DUPLICATE_VERTICES)
        .ok()
        .filter(travels)
}

fn travels(shape: &SharedShape) -> bool {
    crate::physics::ShapeLibrary::default().intern(shape).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_stl_is_binary_if_its_length_says_so_whatever_its_header_says() {
        let stl = |header: &str, count: u32| {
            let mut bytes = vec![b' '; 80];
            bytes[..header.len()].copy_from_slice(header.as_bytes());
            bytes.extend(count.to_le_bytes());
            for _ in 0..count {
                let numbers = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0, 0.0];
                bytes.extend(numbers.iter().flat_map(|number: &f32| number.to_le_bytes()));
                bytes.extend([7u8; 2]);
            }
            bytes
        };
        let read = |bytes: &[u8]| load(bytes, Path::new("m.stl")).unwrap();
        let right = [Vector::ZERO, Vector::new(2.0, 0.0, 0.0), Vector::new(0.0, 3.0, 0.0)];
        // 10, and 10 in a byte of 2,560, are newlines.
        for (header, count) in
            [("solid cube", 10), ("solid \ncube", 12), ("solid cube", 2_560), ("solid cube", 12), ("", 12)]
        {
            let meshes = read(&stl(header, count));
            let [(points, triangles)] = &meshes[..] else { panic!("{header:?}: {} meshes", meshes.len()) };
            assert_eq!(triangles.len(), count as usize, "{header:?}");
            assert_eq!((&points[..3], triangles[1]), (&right[..], [3, 4, 5]), "{header:?}");
        }
        assert!(read(&stl("solid none", 0)).is_empty());
        let text = "solid t\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 2 0 0\nvertex 0 3 0\n\
                    endloop\nendfacet\nendsolid t\n";
        assert_eq!(read(text.as_bytes())[0].0, right);
    }
}
