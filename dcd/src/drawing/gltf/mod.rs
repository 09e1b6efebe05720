//! Writes glTF files (binary, version 2.0) of a world: of a moment, or of a stretch of time as an animation.
//!
//! [`Film::take`] takes moments one after the other, of a world that runs or of one that is replayed. Each
//! body is a node named by its id, with its shapes below it, in the colour of the region that owned it at
//! first. A body that comes or goes meanwhile has the scale 0 before and after.

mod blob;
mod document;
mod primitives;

use std::collections::BTreeMap;
use std::io::{self, Write};

use super::colour;
use super::geometry::{Mesh, Part};
use super::moment::{Looker, Moment, Wishes};
use super::source::Source;
use crate::protocol::WorldPose;
use crate::space::BodyId;

/// The most poses of bodies in a file: a gibibyte.
const MOST_KEYS: usize = 1 << 25;

/// The error of a world that cannot be written as a glTF file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum GltfError {
    /// The file cannot be written.
    #[error("the glTF file cannot be written: {0}; check the path, its permissions and the disk")]
    Io(#[from] io::Error),
    /// The file would be larger than a glTF file can be.
    #[error(
        "the glTF file would be larger than 4 GiB; take a shorter stretch, or fewer pictures per second of it"
    )]
    TooLarge,
}

/// A glTF file in the making: one moment of a world, or several.
#[derive(Default)]
pub(crate) struct Film {
    looker: Looker,
    /// The origin of all positions in the film, near the bodies, so that f32 is exact enough.
    origin: Option<[f64; 3]>,
    bodies: Vec<Filmed>,
    /// Indices in `bodies`, by whether a body is fixed and by its slot.
    by_slot: BTreeMap<(bool, u32), usize>,
    meshes: Vec<Mesh>,
    /// The time of the first moment, and that of the last one relative to it, seconds.
    begin_s: f64,
    last_s: f32,
    ticks: Option<[u64; 2]>,
    keys: usize,
}

/// A body, and its poses over time.
struct Filmed {
    id: BodyId,
    kind: u8,
    region: Option<u32>,
    colour: [u8; 4],
    parts: Vec<Part>,
    keys: Vec<Key>,
    /// The last time at which it had the pose of its last key, seconds.
    still_s: f32,
    /// The times at which it came and, if it did, went; seconds.
    came_s: f32,
    gone_s: Option<f32>,
}

/// The pose of a body at a time, relative to the origin of the film.
#[derive(Clone, Copy, PartialEq)]
struct Key {
    time_s: f32,
    at: [f32; 3],
    turn: [f32; 4],
}

impl Filmed {
    /// Notes its pose; returns how many keys that added.
    fn note(&mut self, key: Key) -> usize {
        let before = self.keys.len();
        match self.keys.last().copied() {
            Some(last) if (last.at, last.turn) == (key.at, key.turn) => {}
            Some(last) if self.still_s > last.time_s => {
                self.keys.extend([Key { time_s: self.still_s, ..last }, key]);
            }
            _ => self.keys.push(key),
        }
        self.still_s = key.time_s;
        self.keys.len() - before
    }
}

impl Film {
    /// Films a world as it is now, at a time that the caller gives; times go up.
    pub(crate) fn look(&mut self, world: &impl Source, seconds: f64) -> Result<(), GltfError> {
        let moment = self.looker.look(world, &Wishes::default(), Moment::default());
        self.take(moment, seconds)
    }

    /// Films the next moment of a world, at a time; times go up. All moments must come from one series of
    /// looks, from the first moment on.
    pub(crate) fn take(&mut self, moment: Moment, seconds: f64) -> Result<(), GltfError> {
        let origin = *self.origin.get_or_insert_with(|| {
            self.begin_s = seconds;
            middle(&moment)
        });
        let time_s = ((seconds - self.begin_s) as f32).max(self.last_s);
        self.last_s = time_s;
        self.ticks = Some([self.ticks.map_or(moment.tick, |ticks| ticks[0]), moment.tick]);
        self.meshes.extend(moment.meshes);
        for (slot, is_fixed) in &moment.departures {
            if let Some(place) = self.by_slot.remove(&(*is_fixed, *slot)) {
                self.bodies[place].gone_s = Some(time_s);
            }
        }
        let key = |pose: &WorldPose| Key {
            time_s,
            at: std::array::from_fn(|i| (pose.translation[i] - origin[i]) as f32),
            turn: pose.rotation,
        };
        for body in moment.arrivals {
            let place = self.by_slot.entry((body.fixed.is_some(), body.slot));
            let place = place.and_modify(|place| self.bodies[*place].parts.clone_from(&body.parts));
            // A body whose look changes again and again is filmed with its last look.
            let place = place.or_insert_with(|| {
                self.bodies.push(Filmed {
                    id: body.id,
                    kind: body.kind,
                    region: None,
                    colour: colour::of_fixed(),
                    parts: body.parts,
                    keys: Vec::new(),
                    still_s: time_s,
                    came_s: time_s,
                    gone_s: None,
                });
                self.bodies.len() - 1
            });
            // All fixed bodies arrive anew if one of them was moved.
            if let Some(pose) = body.fixed {
                self.keys += self.bodies[*place].note(key(&pose));
            }
        }
        for (seen, &slot) in moment.rows.iter().zip(moment.slots.iter()) {
            let Some(&place) = self.by_slot.get(&(false, slot)) else { continue };
            let body = &mut self.bodies[place];
            if body.keys.is_empty() {
                body.colour = colour::of_body(seen);
                body.region = moment.regions.get(usize::from(seen.owner)).map(|region| region.id);
            }
            self.keys += body.note(key(&WorldPose { translation: seen.at, rotation: seen.turn }));
        }
        if self.keys > MOST_KEYS { Err(GltfError::TooLarge) } else { Ok(()) }
    }

    /// Writes the file; an empty one if no moment was taken.
    pub(crate) fn write(&self, to: impl Write) -> Result<(), GltfError> {
        document::write(self, to)
    }
}

/// Returns the middle of the movable bodies, in whole metres.
fn middle(moment: &Moment) -> [f64; 3] {
    let count = moment.rows.len().max(1) as f64;
    std::array::from_fn(|i| {
        let mean = (moment.rows.iter().map(|row| row.at[i]).sum::<f64>() / count).round();
        if mean.is_finite() { mean } else { 0.0 }
    })
}

#[cfg(test)]
mod tests {
    use rapier3d::prelude::*;
    use serde_json::Value;

    use super::*;
    use crate::runtime::{LocalWorld, WorldConfig};

    /// Returns the JSON of a file, and its block.
    fn read(film: &Film) -> (Value, Vec<u8>) {
        let mut bytes = Vec::new();
        film.write(&mut bytes).unwrap();
        let number = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&bytes[..4], number(4), number(8)), (&b"glTF"[..], 2, bytes.len()));
        let text = &bytes[20..20 + number(12)];
        let block = bytes.get(28 + text.len()..).unwrap_or_default().to_vec();
        (serde_json::from_slice(text).unwrap(), block)
    }

    fn cube(world: &mut LocalWorld, x: f32, vx: f32) -> BodyId {
        let body = RigidBodyBuilder::dynamic()
            .translation(Vector::new(x, 0.0, 0.0))
            .linvel(Vector::new(vx, 0.0, 0.0))
            .gravity_scale(0.0);
        world.insert(body, ColliderBuilder::cuboid(0.5, 0.5, 0.5)).unwrap()
    }

    #[test]
    fn bodies_that_come_and_go_have_no_size_before_and_after_and_those_that_rest_no_keys() {
        let mut world = LocalWorld::new(WorldConfig::default()).unwrap();
        let resting = cube(&mut world, -9.0, 0.0);
        let leaving = cube(&mut world, 0.0, 1.0);
        let mut film = Film::default();
        film.look(world.host(), 10.0).unwrap();
        world.step().unwrap();
        world.remove(leaving).unwrap();
        let coming = cube(&mut world, 9.0, 1.0);
        film.look(world.host(), 11.0).unwrap();
        world.step().unwrap();
        film.look(world.host(), 12.0).unwrap();
        let (json, block) = read(&film);
        let node = |id: BodyId| {
            let nodes = json["nodes"].as_array().unwrap();
            nodes.iter().position(|node| node["name"] == id.to_string()).expect("it is there")
        };
        let animation = &json["animations"][0];
        let floats = |accessor: &Value| -> Vec<f32> {
            let accessor = &json["accessors"][accessor.as_u64().unwrap() as usize];
            let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
            let offset = [accessor, view].map(|of| of["byteOffset"].as_u64().unwrap() as usize);
            let width = if accessor["type"] == "VEC3" { 3 } else { 1 };
            let bytes =
                &block[offset[0] + offset[1]..][..4 * width * accessor["count"].as_u64().unwrap() as usize];
            bytes.chunks(4).map(|bytes| f32::from_le_bytes(bytes.try_into().unwrap())).collect()
        };
        let keys = |id: BodyId, path: &str| {
            let channels = animation["channels"].as_array().unwrap();
            let is_meant =
                |channel: &&Value| channel["target"]["node"] == node(id) && channel["target"]["path"] == path;
            let sampler = channels.iter().find(is_meant)?["sampler"].as_u64().unwrap() as usize;
            let sampler = &animation["samplers"][sampler];
            Some((floats(&sampler["input"]), floats(&sampler["output"])))
        };
        assert_eq!(keys(leaving, "scale"), Some((vec![0.0, 1.0], vec![1.0, 1.0, 1.0, 0.0, 0.0, 0.0])));
        assert_eq!(keys(coming, "scale"), Some((vec![0.0, 1.0], vec![0.0, 0.0, 0.0, 1.0, 1.0, 1.0])));
        let (times, places) = keys(coming, "translation").expect("it moves");
        let origin = film.origin.unwrap()[0];
        let last = world.pose(coming).unwrap().translation[0] - origin;
        assert_eq!((times, places[3]), (vec![1.0, 2.0], last as f32));
        assert_eq!((keys(resting, "translation"), keys(resting, "scale")), (None, None));
        assert_eq!(json["scenes"][0]["extras"]["ticks"], serde_json::json!([0, 2]));
    }

    #[test]
    fn what_rests_and_then_moves_rests_until_then() {
        let mut body = Filmed {
            id: BodyId::persistent(0),
            kind: 0,
            region: None,
            colour: [0; 4],
            parts: Vec::new(),
            keys: Vec::new(),
            still_s: 0.0,
            came_s: 0.0,
            gone_s: None,
        };
        let key = |time_s: f32, x: f32| Key { time_s, at: [x, 0.0, 0.0], turn: [0.0, 0.0, 0.0, 1.0] };
        for (time, x) in [(0.0, 1.0), (1.0, 1.0), (2.0, 1.0), (3.0, 2.0), (4.0, 3.0), (5.0, 3.0)] {
            body.note(key(time, x));
        }
        let kept: Vec<_> = body.keys.iter().map(|key| (key.time_s, key.at[0])).collect();
        assert_eq!(kept, [(0.0, 1.0), (2.0, 1.0), (3.0, 2.0), (4.0, 3.0)]);
    }

    #[test]
    fn a_film_of_nothing_is_a_file_too() {
        let (json, block) = read(&Film::default());
        assert_eq!((json["nodes"].as_array().unwrap().len(), block.len()), (1, 0));
        assert_eq!((json.get("buffers"), json.get("meshes")), (None, None));
    }
}
