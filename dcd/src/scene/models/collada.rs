//! Reads Collada files: the triangles of each geometry, once per instance in the scene, in metres and at the
//! place of its node. mesh-loader, which reads the other formats, does not do for Collada. It places one
//! instance of each geometry, multiplies the transforms of nodes in the wrong order, and panics at indices
//! that are out of range.
//!
//! Section numbers are those of the [specification](https://www.khronos.org/files/collada_spec_1_4.pdf) of
//! Collada 1.4.

use std::collections::VecDeque;
use std::collections::btree_map::{BTreeMap, Entry};
use std::str::FromStr;

use rapier3d::glamx::glam::{DAffine3, DMat3, DQuat, DVec3};
use rapier3d::prelude::*;
use roxmltree::Node;

use super::source::{Fault, child, elements, parsed};

/// The most bytes of a scene's nodes, each counted with the nodes in it and as often as it is instanced. A
/// small file whose nodes each instance the next one twice describes an endless scene.
const MAX_SCENE: usize = 16 << 20;
/// The most triangles of all instances together.
const MAX_TRIANGLES: usize = 1 << 22;

/// The corners of triangles.
pub(super) type Corners = Vec<[Vector; 3]>;

/// The content of a Collada file.
pub(super) struct Collada {
    /// Instances of geometries that have triangles.
    pub(super) instances: Vec<Corners>,
    /// Says whether the file's own axes are z-up, or it does not say. The numbers are taken as they stand in
    /// either case.
    pub(super) z_up: bool,
}

/// Reads the text of a Collada file.
pub(super) fn read(text: &str) -> Result<Collada, Fault> {
    let document = parsed(text)?;
    let root = document.root_element();
    let asset = child(root, "asset");
    let axis = asset.and_then(|asset| child(asset, "up_axis"));
    let unit = asset.and_then(|asset| child(asset, "unit")).and_then(|unit| unit.attribute("meter"));
    let unit = unit.map_or(Ok(1.0), |meter| meter.trim().parse::<f64>());
    let unit = unit.ok().filter(|unit| *unit > 0.0).ok_or_else(|| {
        Fault::at(root, "its unit is not a length", "write <unit meter=\"..\"/> with a number above 0")
    })?;
    let library = Library::of(root);
    let placed = library.placed(root, DAffine3::from_scale(DVec3::splat(unit)))?;
    Ok(Collada {
        instances: library.instances(&placed)?,
        z_up: axis.and_then(|axis| axis.text()).is_none_or(|axis| axis.trim() == "Z_UP"),
    })
}

/// The elements that others can point to, by kind and id.
struct Library<'a, 'd>(BTreeMap<(&'a str, &'a str), Node<'a, 'd>>);

/// A geometry and its transform.
type Placed<'a, 'd> = (Node<'a, 'd>, DAffine3);

impl<'a, 'd> Library<'a, 'd> {
    fn of(root: Node<'a, 'd>) -> Self {
        let named = root.descendants().filter_map(|node| {
            let id = node.attribute("id")?;
            Some(((node.tag_name().name(), id), node))
        });
        Self(named.collect())
    }

    /// Returns the element to which the attribute points.
    fn target(&self, from: Node<'a, 'd>, attribute: &str, kind: &'static str) -> Result<Node<'a, 'd>, Fault> {
        let url = from.attribute(attribute).unwrap_or_default();
        self.0.get(&(kind, url.trim_start_matches('#'))).copied().ok_or_else(|| {
            let cause = format!("<{}> names <{kind}> `{url}`, which is not there", from.tag_name().name());
            Fault::at(from, cause, "export the mesh as one whole file")
        })
    }

    /// Returns the geometries of the scene, once per instance; in a file without a scene, each geometry once.
    fn placed(&self, root: Node<'a, 'd>, unit: DAffine3) -> Result<Vec<Placed<'a, 'd>>, Fault> {
        let scene = child(root, "scene").and_then(|scene| child(scene, "instance_visual_scene"));
        let Some(scene) = scene else {
            let geometries = root.descendants().filter(|node| node.has_tag_name("geometry"));
            return Ok(geometries.map(|geometry| (geometry, unit)).collect());
        };
        let mut found = Vec::new();
        let mut bytes = 0;
        let mut open = VecDeque::from([(self.target(scene, "url", "visual_scene")?, unit)]);
        while let Some((node, above)) = open.pop_front() {
            bytes += node.range().len();
            if bytes > MAX_SCENE {
                let cause = "its scene has more than 16 MiB of nodes, counted as often as they are instanced";
                return Err(Fault::at(scene, cause, "make it simpler"));
            }
            let place = above * transform(node)?;
            for child in elements(node) {
                match child.tag_name().name() {
                    "node" => open.push_back((child, place)),
                    "instance_node" => open.push_back((self.target(child, "url", "node")?, place)),
                    "instance_geometry" => found.push((self.target(child, "url", "geometry")?, place)),
                    "instance_controller" => {
                        let cause = "a mesh on a skeleton (<instance_controller>) cannot be read";
                        return Err(Fault::at(child, cause, "export the mesh without its skeleton"));
                    }
                    _ => {}
                }
            }
        }
        Ok(found)
    }

    fn instances(&self, placed: &[Placed<'a, 'd>]) -> Result<Vec<Corners>, Fault> {
        let mut known: BTreeMap<usize, Vec<[DVec3; 3]>> = BTreeMap::new();
        let mut instances = Vec::new();
        let mut count = 0;
        for &(geometry, place) in placed {
            let triangles = match known.entry(geometry.id().get_usize()) {
                Entry::Occupied(entry) => entry.into_mut(),
                Entry::Vacant(entry) => entry.insert(self.triangles(geometry)?),
            };
            count += triangles.len();
            if count > MAX_TRIANGLES {
                let cause = format!("its scene has more than {MAX_TRIANGLES} triangles");
                return Err(Fault::at(geometry, cause, "make it simpler"));
            }
            if !triangles.is_empty() {
                let corner = |corner| place.transform_point3(corner).as_vec3();
                instances.push(triangles.iter().map(|triangle| triangle.map(corner)).collect());
            }
        }
        Ok(instances)
    }

    /// Returns the triangles of a geometry in its own space and unit.
    fn triangles(&self, geometry: Node<'a, 'd>) -> Result<Vec<[DVec3; 3]>, Fault> {
        let mesh = part(geometry, "mesh")?;
        let points = self.positions(mesh)?;
        let mut triangles = Vec::new();
        for primitive in elements(mesh) {
            for face in faces(primitive)? {
                let corner = |index: usize| {
                    points.get(index).copied().ok_or_else(|| {
                        let cause = format!("a triangle has vertex {index} of {}", points.len());
                        Fault::at(primitive, cause, "export the mesh again")
                    })
                };
                let [a, b, c] = face.map(corner);
                triangles.push([a?, b?, c?]);
            }
        }
        Ok(triangles)
    }

    /// Returns the positions of a mesh's vertices.
    fn positions(&self, mesh: Node<'a, 'd>) -> Result<Vec<DVec3>, Fault> {
        let vertices = part(mesh, "vertices")?;
        let source = self.target(input(vertices, "POSITION")?, "source", "source")?;
        let accessor = part(part(source, "technique_common")?, "accessor")?;
        let numbers: Vec<f64> = numbers(self.target(accessor, "source", "float_array")?)?;
        let (offset, stride) = (whole(accessor, "offset", 0)?, whole(accessor, "stride", 1)?);
        if stride < 3 {
            let cause = format!("its vertices have {stride} coordinates, not 3");
            return Err(Fault::at(accessor, cause, "export the mesh again"));
        }
        let points = numbers.get(offset..).unwrap_or_default().chunks(stride);
        Ok(points.filter(|point| point.len() >= 3).map(DVec3::from_slice).collect())
    }
}

/// Returns the product of a node's transforms. The one that is written last is applied first (section 5,
/// `<node>`).
fn transform(node: Node<'_, '_>) -> Result<DAffine3, Fault> {
    let mut product = DAffine3::IDENTITY;
    for child in elements(node) {
        product *= match child.tag_name().name() {
            "translate" => DAffine3::from_translation(exactly::<3>(child)?.into()),
            "scale" => DAffine3::from_scale(exactly::<3>(child)?.into()),
            "rotate" => {
                let [x, y, z, degrees] = exactly::<4>(child)?;
                let axis = DVec3::new(x, y, z).try_normalize();
                let turn = |axis| DQuat::from_axis_angle(axis, degrees.to_radians());
                DAffine3::from_quat(axis.map_or(DQuat::IDENTITY, turn))
            }
            "matrix" => {
                // Row by row.
                let [xx, xy, xz, x, yx, yy, yz, y, zx, zy, zz, z, ..] = exactly::<16>(child)?;
                let columns = DMat3::from_cols_array(&[xx, yx, zx, xy, yy, zy, xz, yz, zz]);
                DAffine3::from_mat3_translation(columns, DVec3::new(x, y, z))
            }
            "lookat" => {
                let points: [f64; 9] = exactly(child)?;
                let [eye, interest, up] = [0, 3, 6].map(|first| DVec3::from_slice(&points[first..]));
                let z = (eye - interest).normalize_or_zero();
                let x = up.cross(z).normalize_or_zero();
                DAffine3::from_mat3_translation(DMat3::from_cols(x, z.cross(x), z), eye)
            }
            "skew" => {
                return Err(Fault::at(child, "<skew> cannot be read", "export transforms as matrices"));
            }
            _ => continue,
        };
    }
    Ok(product)
}

/// Returns the vertex indices of each triangle of an element, with polygons cut into fans; none for an
/// element without triangles.
fn faces(primitive: Node<'_, '_>) -> Result<Vec<[usize; 3]>, Fault> {
    let kind = primitive.tag_name().name();
    if !["triangles", "polylist", "polygons", "trifans", "tristrips"].contains(&kind) {
        return Ok(Vec::new());
    }
    if let Some(holes) = child(primitive, "ph") {
        return Err(Fault::at(holes, "polygons with holes cannot be read", "export triangles"));
    }
    // Each corner has one index per offset; one of them is the vertex.
    let offset = whole(input(primitive, "VERTEX")?, "offset", 0)?;
    let mut last = offset;
    for input in elements(primitive).filter(|node| node.has_tag_name("input")) {
        last = last.max(whole(input, "offset", 0)?);
    }
    let counts: Vec<usize> = child(primitive, "vcount").map_or(Ok(Vec::new()), numbers)?;
    let mut faces: Vec<[usize; 3]> = Vec::new();
    for p in elements(primitive).filter(|node| node.has_tag_name("p")) {
        let indices: Vec<usize> = numbers(p)?;
        let corners = indices.chunks(last.saturating_add(1)).filter_map(|corner| corner.get(offset).copied());
        let corners: Vec<usize> = corners.collect();
        match kind {
            "triangles" => faces.extend(corners.as_chunks::<3>().0),
            "polylist" => {
                let mut rest = &corners[..];
                for &count in &counts {
                    let short =
                        || Fault::at(p, "it has fewer corners than <vcount>", "export the mesh again");
                    let (polygon, more) = rest.split_at_checked(count).ok_or_else(short)?;
                    faces.extend(fan(polygon));
                    rest = more;
                }
            }
            // Every second triangle of a strip is turned round.
            "tristrips" => faces.extend(corners.windows(3).enumerate().map(|(i, w)| match i % 2 {
                0 => [w[0], w[1], w[2]],
                _ => [w[1], w[0], w[2]],
            })),
            _ => faces.extend(fan(&corners)),
        }
    }
    Ok(faces)
}

/// Returns the triangles of a convex polygon.
fn fan(polygon: &[usize]) -> impl Iterator<Item = [usize; 3]> {
    polygon.windows(2).skip(1).map(move |side| [polygon[0], side[0], side[1]])
}

fn part<'a, 'd>(node: Node<'a, 'd>, kind: &str) -> Result<Node<'a, 'd>, Fault> {
    child(node, kind).ok_or_else(|| {
        let cause = format!("<{}> has no <{kind}>", node.tag_name().name());
        Fault::at(node, cause, "export the mesh as triangles or polygons")
    })
}

fn input<'a, 'd>(node: Node<'a, 'd>, semantic: &str) -> Result<Node<'a, 'd>, Fault> {
    let mut inputs = elements(node).filter(|input| input.has_tag_name("input"));
    inputs.find(|input| input.attribute("semantic") == Some(semantic)).ok_or_else(|| {
        let cause = format!("<{}> has no <input> of {semantic}", node.tag_name().name());
        Fault::at(node, cause, "export the mesh again")
    })
}

/// Returns an attribute that is a whole number, or `default` if it is not there.
fn whole(node: Node<'_, '_>, attribute: &str, default: usize) -> Result<usize, Fault> {
    node.attribute(attribute).map_or(Ok(default), |text| number(node, text.trim()))
}

/// Returns the numbers that are the content of an element.
fn numbers<T: FromStr>(node: Node<'_, '_>) -> Result<Vec<T>, Fault> {
    let texts = node.children().filter(Node::is_text).filter_map(|text| text.text());
    texts.flat_map(str::split_ascii_whitespace).map(|word| number(node, word)).collect()
}

fn exactly<const N: usize>(node: Node<'_, '_>) -> Result<[f64; N], Fault> {
    let numbers: Vec<f64> = numbers(node)?;
    let count = numbers.len();
    <[f64; N]>::try_from(numbers).map_err(|_| {
        let cause = format!("<{}> has {count} numbers, not {N}", node.tag_name().name());
        Fault::at(node, cause, "export the mesh again")
    })
}

fn number<T: FromStr>(node: Node<'_, '_>, text: &str) -> Result<T, Fault> {
    text.parse().map_err(|_| {
        let cause = format!("<{}> has `{text}` where a number should be", node.tag_name().name());
        Fault::at(node, cause, "export the mesh again")
    })
}
