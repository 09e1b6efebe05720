//! Puts a glTF file together: nodes, meshes, materials, and the animation.

use std::collections::BTreeMap;
use std::io::Write;

use serde_json::{Value, json};

use super::blob::Blob;
use super::primitives::{self, Solid};
use super::{Film, Filmed, GltfError, Key};
use crate::drawing::colour;
use crate::drawing::geometry::{BALL, BOX, CAPSULE, CONE, CYLINDER, FIRST_MESH, PLANE, Part};

const MAGIC: &[u8; 4] = b"glTF";
const VERSION: u32 = 2;
const JSON: &[u8; 4] = b"JSON";
const BIN: &[u8; 4] = b"BIN\0";
/// The modes in which a primitive is drawn.
const LINES: u32 = 1;
const TRIANGLES: u32 = 4;
/// The half edge of the square that stands for a plane, metres.
const PLANE_M: f32 = 1000.0;

/// What determines the vertices of a primitive: the number of its geometry and, of a capsule, the bits of
/// radius and half height.
type Outline = (u16, [u32; 2]);

#[derive(Default)]
struct Document {
    blob: Blob,
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    channels: Vec<Value>,
    samplers: Vec<Value>,
    material_of: BTreeMap<[u8; 4], usize>,
    /// Primitives without their material; `None` where there is nothing to draw.
    primitive_of: BTreeMap<Outline, Option<Value>>,
    mesh_of: BTreeMap<(Outline, [u8; 4]), usize>,
}

pub(super) fn write(film: &Film, mut to: impl Write) -> Result<(), GltfError> {
    let mut document = Document::default();
    let children: Vec<usize> = film.bodies.iter().map(|body| document.body(film, body)).collect();
    let origin = film.origin.unwrap_or_default().map(|v| v as f32);
    let mut root = json!({ "name": "world", "translation": origin });
    if !children.is_empty() {
        root["children"] = json!(children);
    }
    document.nodes.push(root);
    let scene = json!({
        "name": "dcd",
        "nodes": [document.nodes.len() - 1],
        "extras": { "ticks": film.ticks },
    });
    let Document { blob, nodes, meshes, materials, channels, samplers, .. } = document;
    let (mut block, views, accessors) = blob.finish();
    let mut all = json!({
        "asset": { "version": "2.0", "generator": concat!("dcd ", env!("CARGO_PKG_VERSION")) },
        "scene": 0,
        "scenes": [scene],
        "nodes": nodes,
    });
    // glTF has no empty lists.
    let lists =
        [("meshes", meshes), ("materials", materials), ("bufferViews", views), ("accessors", accessors)];
    for (name, list) in lists.into_iter().filter(|(_, list)| !list.is_empty()) {
        all[name] = Value::from(list);
    }
    if !channels.is_empty() {
        all["animations"] = json!([{ "name": "run", "channels": channels, "samplers": samplers }]);
    }
    if !block.is_empty() {
        all["buffers"] = json!([{ "byteLength": block.len() }]);
    }
    let mut text = serde_json::to_vec(&all).map_err(std::io::Error::from)?;
    text.resize(text.len().next_multiple_of(4), b' ');
    block.resize(block.len().next_multiple_of(4), 0);
    let whole = 12 + 8 + text.len() + if block.is_empty() { 0 } else { 8 + block.len() };
    let size = |length: usize| u32::try_from(length).map_err(|_| GltfError::TooLarge);
    to.write_all(MAGIC)?;
    to.write_all(&VERSION.to_le_bytes())?;
    to.write_all(&size(whole)?.to_le_bytes())?;
    for (kind, chunk) in [(JSON, text), (BIN, block)].into_iter().filter(|(_, chunk)| !chunk.is_empty()) {
        to.write_all(&size(chunk.len())?.to_le_bytes())?;
        to.write_all(kind)?;
        to.write_all(&chunk)?;
    }
    Ok(to.flush()?)
}

impl Document {
    /// Adds the node of a body; returns its number.
    fn body(&mut self, film: &Film, body: &Filmed) -> usize {
        let children: Vec<usize> = body.parts.iter().filter_map(|part| self.part(film, body, part)).collect();
        let kind = ["dynamic", "fixed", "kinematic"][usize::from(body.kind).min(2)];
        let mut node = json!({
            "name": body.id.to_string(),
            "extras": { "id": body.id.bits().to_string(), "kind": kind, "region": body.region },
        });
        if !children.is_empty() {
            node["children"] = json!(children);
        }
        if let Some(key) = body.keys.first() {
            (node["translation"], node["rotation"]) = (json!(key.at), json!(key.turn));
        }
        self.nodes.push(node);
        let number = self.nodes.len() - 1;
        self.animate(number, body, film.last_s);
        number
    }

    fn part(&mut self, film: &Film, body: &Filmed, part: &Part) -> Option<usize> {
        let colour = if part.sensor { colour::faint(body.colour) } else { body.colour };
        let mesh = self.mesh(film, part, colour)?;
        let mut node = json!({ "mesh": mesh, "translation": part.translation, "rotation": part.rotation });
        if matches!(part.geometry, BOX | BALL | CYLINDER | CONE) {
            node["scale"] = json!(part.size);
        }
        self.nodes.push(node);
        Some(self.nodes.len() - 1)
    }

    fn animate(&mut self, node: usize, body: &Filmed, last_s: f32) {
        if body.keys.len() > 1 {
            let (moves, turns) = (differ(&body.keys, |key| key.at), differ(&body.keys, |key| key.turn));
            let times: Vec<_> = body.keys.iter().map(|key| key.time_s).collect();
            let times = self.blob.times(&times);
            if moves {
                let places: Vec<_> = body.keys.iter().map(|key| key.at).collect();
                let places = self.blob.vectors(&places);
                self.channel(node, "translation", times, places, "LINEAR");
            }
            if turns {
                let turns = continuous(body.keys.iter().map(|key| key.turn));
                let turns = self.blob.rotations(&turns);
                self.channel(node, "rotation", times, turns, "LINEAR");
            }
        }
        // A body has the scale 0 while it does not exist.
        let (absent, present) = ([0.0; 3], [1.0; 3]);
        let mut scales = vec![(0.0, if body.came_s > 0.0 { absent } else { present })];
        if body.came_s > 0.0 {
            scales.push((body.came_s, present));
        }
        if let Some(gone_s) = body.gone_s.filter(|&gone_s| gone_s > body.came_s && gone_s <= last_s) {
            scales.push((gone_s, absent));
        }
        if scales.len() > 1 {
            let (times, scales): (Vec<_>, Vec<_>) = scales.into_iter().unzip();
            let (times, scales) = (self.blob.times(&times), self.blob.vectors(&scales));
            self.channel(node, "scale", times, scales, "STEP");
        }
    }

    fn channel(&mut self, node: usize, path: &str, input: usize, output: usize, interpolation: &str) {
        let sampler = self.samplers.len();
        self.samplers.push(json!({ "input": input, "output": output, "interpolation": interpolation }));
        self.channels.push(json!({ "sampler": sampler, "target": { "node": node, "path": path } }));
    }

    fn mesh(&mut self, film: &Film, part: &Part, colour: [u8; 4]) -> Option<usize> {
        let [radius, half_height, _] = part.size;
        let size = if part.geometry == CAPSULE { [radius, half_height].map(f32::to_bits) } else { [0; 2] };
        let outline = (part.geometry, size);
        if let Some(&mesh) = self.mesh_of.get(&(outline, colour)) {
            return Some(mesh);
        }
        if !self.primitive_of.contains_key(&outline) {
            let primitive = match part.geometry {
                BOX => self.solid(&primitives::cube()),
                BALL => self.solid(&primitives::ball()),
                CAPSULE => self.solid(&primitives::capsule(radius, half_height)),
                CYLINDER => self.solid(&primitives::cylinder()),
                CONE => self.solid(&primitives::cone()),
                PLANE => self.solid(&primitives::plane(PLANE_M)),
                mesh => self.surface(film, usize::from(mesh - FIRST_MESH)),
            };
            self.primitive_of.insert(outline, primitive);
        }
        let mut primitive = self.primitive_of.get(&outline)?.clone()?;
        primitive["material"] = json!(self.material(colour));
        self.meshes.push(json!({ "primitives": [primitive] }));
        self.mesh_of.insert((outline, colour), self.meshes.len() - 1);
        Some(self.meshes.len() - 1)
    }

    fn solid(&mut self, solid: &Solid) -> Option<Value> {
        let (positions, normals) = (self.blob.positions(&solid.vertices), self.blob.normals(&solid.normals));
        let indices = self.blob.indices(solid.triangles.as_flattened());
        Some(json!({
            "attributes": { "POSITION": positions, "NORMAL": normals },
            "indices": indices,
            "mode": TRIANGLES,
        }))
    }

    /// Adds a mesh of the world: of triangles, or of lines if the last two corners of each triangle are the
    /// same.
    fn surface(&mut self, film: &Film, number: usize) -> Option<Value> {
        let mesh = film.meshes.get(number)?;
        let is_there = |triangle: &&[u32; 3]| triangle.iter().all(|&at| (at as usize) < mesh.vertices.len());
        let triangles: Vec<_> = mesh.triangles.iter().filter(is_there).copied().collect();
        let is_lines = triangles.iter().all(|[_, b, c]| b == c);
        let indices: Vec<u32> = match is_lines {
            true => triangles.iter().flat_map(|&[a, b, _]| [a, b]).collect(),
            false => triangles.into_flattened(),
        };
        if indices.is_empty() {
            return None;
        }
        let (positions, indices) = (self.blob.positions(&mesh.vertices), self.blob.indices(&indices));
        let mode = if is_lines { LINES } else { TRIANGLES };
        Some(json!({ "attributes": { "POSITION": positions }, "indices": indices, "mode": mode }))
    }

    fn material(&mut self, colour: [u8; 4]) -> usize {
        if let Some(&material) = self.material_of.get(&colour) {
            return material;
        }
        let [red, green, blue, opacity] = colour.map(|part| f32::from(part) / 255.0);
        let [red, green, blue] = [red, green, blue].map(linear);
        let mut material = json!({
            "pbrMetallicRoughness": {
                "baseColorFactor": [red, green, blue, opacity], "metallicFactor": 0.0, "roughnessFactor": 0.8,
            },
            "doubleSided": true,
        });
        if opacity < 1.0 {
            material["alphaMode"] = json!("BLEND");
        }
        self.materials.push(material);
        self.material_of.insert(colour, self.materials.len() - 1);
        self.materials.len() - 1
    }
}

fn differ<const N: usize>(keys: &[Key], what: impl Fn(&Key) -> [f32; N]) -> bool {
    keys.windows(2).any(|two| what(&two[0]) != what(&two[1]))
}

/// Returns rotations with such signs that each is the shorter way from the one before: a quaternion and its
/// negative are the same rotation.
fn continuous(turns: impl Iterator<Item = [f32; 4]>) -> Vec<[f32; 4]> {
    let mut all: Vec<[f32; 4]> = Vec::new();
    for turn in turns {
        let dot = all.last().map_or(1.0, |last| (0..4).map(|i| last[i] * turn[i]).sum::<f32>());
        all.push(if dot < 0.0 { turn.map(|v| -v) } else { turn });
    }
    all
}

/// Returns a component of an sRGB colour as the linear number that glTF has (IEC 61966-2-1).
fn linear(srgb: f32) -> f32 {
    if srgb <= 0.04045 { srgb / 12.92 } else { libm::powf((srgb + 0.055) / 1.055, 2.4) }
}
