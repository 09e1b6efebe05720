//! Collects the numbers of a glTF file: one binary block, views of it by what they hold, and accessors to lists in them.

use serde_json::{Value, json};

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// The views, in their order.
#[derive(Clone, Copy)]
enum View {
    Vertices,
    Indices,
    Scalars,
    Vectors,
    Rotations,
}

const VIEWS: [View; 5] = [View::Vertices, View::Indices, View::Scalars, View::Vectors, View::Rotations];

/// The numbers collected so far.
#[derive(Default)]
pub(super) struct Blob {
    bytes: [Vec<u8>; VIEWS.len()],
    /// Accessors, each with the index of its view in [`VIEWS`].
    accessors: Vec<(usize, Value)>,
}

impl Blob {
    /// Adds positions of vertices; returns their accessor.
    pub(super) fn positions(&mut self, vertices: &[[f32; 3]]) -> usize {
        let bound = |pick: fn(f32, f32) -> f32, from: f32| -> [f32; 3] {
            std::array::from_fn(|i| vertices.iter().map(|vertex| vertex[i]).fold(from, pick))
        };
        let bounds = (bound(f32::min, f32::INFINITY), bound(f32::max, f32::NEG_INFINITY));
        let at = self.floats(View::Vertices, vertices, "VEC3");
        (self.accessors[at].1["min"], self.accessors[at].1["max"]) = (json!(bounds.0), json!(bounds.1));
        at
    }

    /// Adds normals of vertices; returns their accessor.
    pub(super) fn normals(&mut self, normals: &[[f32; 3]]) -> usize {
        self.floats(View::Vertices, normals, "VEC3")
    }

    /// Adds indices of vertices; returns their accessor.
    pub(super) fn indices(&mut self, indices: &[u32]) -> usize {
        let offset = self.bytes[View::Indices as usize].len();
        self.bytes[View::Indices as usize].extend(indices.iter().flat_map(|index| index.to_le_bytes()));
        self.accessor(View::Indices, offset, indices.len(), UNSIGNED_INT, "SCALAR")
    }

    /// Adds ascending times; returns their accessor.
    pub(super) fn times(&mut self, times: &[f32]) -> usize {
        let list: Vec<_> = times.iter().map(|&time| [time]).collect();
        let at = self.floats(View::Scalars, &list, "SCALAR");
        let accessor = &mut self.accessors[at].1;
        (accessor["min"], accessor["max"]) =
            (json!([times.first().unwrap_or(&0.0)]), json!([times.last().unwrap_or(&0.0)]));
        at
    }

    /// Adds translations or scales; returns their accessor.
    pub(super) fn vectors(&mut self, vectors: &[[f32; 3]]) -> usize {
        self.floats(View::Vectors, vectors, "VEC3")
    }

    /// Adds unit quaternions; returns their accessor.
    pub(super) fn rotations(&mut self, rotations: &[[f32; 4]]) -> usize {
        self.floats(View::Rotations, rotations, "VEC4")
    }

    /// Returns the binary block, its views and accessors.
    pub(super) fn finish(self) -> (Vec<u8>, Vec<Value>, Vec<Value>) {
        let (mut block, mut views) = (Vec::new(), Vec::new());
        let mut number = [0; VIEWS.len()];
        for view in VIEWS {
            let bytes = &self.bytes[view as usize];
            // glTF has no empty views.
            if bytes.is_empty() {
                continue;
            }
            let mut json = json!({ "buffer": 0, "byteOffset": block.len(), "byteLength": bytes.len() });
            match view {
                View::Vertices => (json["byteStride"], json["target"]) = (json!(12), json!(ARRAY_BUFFER)),
                View::Indices => json["target"] = json!(ELEMENT_ARRAY_BUFFER),
                View::Scalars | View::Vectors | View::Rotations => {}
            }
            number[view as usize] = views.len();
            views.push(json);
            block.extend(bytes);
        }
        let accessors = self.accessors.into_iter().map(|(view, mut accessor)| {
            accessor["bufferView"] = json!(number[view]);
            accessor
        });
        (block, views, accessors.collect())
    }

    fn floats<const N: usize>(&mut self, view: View, list: &[[f32; N]], kind: &str) -> usize {
        let offset = self.bytes[view as usize].len();
        self.bytes[view as usize].extend(list.as_flattened().iter().flat_map(|v| v.to_le_bytes()));
        self.accessor(view, offset, list.len(), FLOAT, kind)
    }

    fn accessor(&mut self, view: View, offset: usize, count: usize, component: u32, kind: &str) -> usize {
        let accessor =
            json!({ "byteOffset": offset, "componentType": component, "count": count, "type": kind });
        self.accessors.push((view as usize, accessor));
        self.accessors.len() - 1
    }
}
