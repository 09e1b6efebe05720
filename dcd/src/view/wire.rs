//! Encodes the messages to the page: little-endian, with each list aligned to the size of its numbers, so
//! that the page reads it in place.
//!
//! Each message begins with a byte for its kind. `page/wire.js` decodes them.

use super::sample::Sample;
use crate::drawing::{Arrival, JointSeen, Mesh, Moment, Part, Seen};

/// The version of the messages. Only programs that read another program's viewer need it: the page and its
/// program are of one build.
pub(super) const VERSION: u8 = 2;

const HELLO: u8 = 1;
const MESH: u8 = 2;
const BODY: u8 = 3;
const FRAME: u8 = 4;
const SAMPLES: u8 = 5;
const STATE: u8 = 6;
const JOINTS: u8 = 7;

/// Marks the slot of a fixed body.
const FIXED: u32 = 1 << 31;

/// Bits of a body in a frame.
const PRESENT: u8 = 1;
const SLEEPING: u8 = 2;
const SHARED: u8 = 4;
const OUTSIDE: u8 = 8;

#[derive(Default)]
struct Writer(Vec<u8>);

impl Writer {
    fn new(kind: u8, bytes: [u8; 3]) -> Self {
        Self(vec![kind, bytes[0], bytes[1], bytes[2]])
    }

    fn u16(&mut self, value: u16) {
        self.0.extend(value.to_le_bytes());
    }

    fn u32(&mut self, value: u32) {
        self.0.extend(value.to_le_bytes());
    }

    fn f32(&mut self, value: f32) {
        self.0.extend(value.to_le_bytes());
    }

    fn f32s(&mut self, values: &[f32]) {
        values.iter().for_each(|&value| self.f32(value));
    }

    fn f64(&mut self, value: f64) {
        self.0.extend(value.to_le_bytes());
    }
}

/// The first message to a viewer: what does not change while a world is viewed.
pub(super) struct Hello {
    pub(super) name: String,
    /// Says whether the page may pause the world and step it.
    pub(super) controls: bool,
    /// The first and the last tick of a recording. The page may go to any tick between them.
    pub(super) recorded: Option<[u64; 2]>,
    pub(super) dt_s: f32,
    /// The origin of the page's space, in world space.
    pub(super) origin: [f64; 3],
    pub(super) bounds: [[f64; 3]; 2],
}

pub(super) fn hello(hello: &Hello) -> Vec<u8> {
    let is_recording = hello.recorded.is_some();
    let mut to = Writer::new(HELLO, [VERSION, u8::from(hello.controls), u8::from(is_recording)]);
    to.f32(hello.dt_s);
    hello.origin.iter().for_each(|&v| to.f64(v));
    hello.bounds.iter().flatten().for_each(|&v| to.f64(v));
    hello.recorded.unwrap_or_default().iter().for_each(|&tick| to.f64(tick as f64));
    to.0.extend(hello.name.as_bytes());
    to.0
}

pub(super) fn mesh(number: u16, mesh: &Mesh) -> Vec<u8> {
    let mut to = Writer::new(MESH, [0; 3]);
    to.u32(number.into());
    to.u32(mesh.vertices.len() as u32);
    to.u32(mesh.triangles.len() as u32);
    to.f32s(mesh.vertices.as_flattened());
    mesh.triangles.as_flattened().iter().for_each(|&index| to.u32(index));
    to.0
}

/// Encodes a body that came or, if it is fixed, moved.
pub(super) fn body(arrival: &Arrival, origin: [f64; 3]) -> Vec<u8> {
    let mut to = Writer::new(BODY, [arrival.kind, u8::from(arrival.own), u8::from(arrival.fixed.is_some())]);
    to.u32(arrival.slot | if arrival.fixed.is_some() { FIXED } else { 0 });
    to.u32(arrival.id.bits() as u32);
    to.u32((arrival.id.bits() >> 32) as u32);
    to.u32(arrival.parts.len() as u32);
    let pose = arrival.fixed.unwrap_or_default();
    to.f32s(&relative(pose.translation, origin));
    to.f32s(&pose.rotation);
    arrival.parts.iter().for_each(|part| write_part(&mut to, part));
    to.0
}

/// Encodes a slot that is empty now.
pub(super) fn gone(slot: u32, is_fixed: bool) -> Vec<u8> {
    let mut to = Writer::new(BODY, [0, 0, u8::from(is_fixed)]);
    to.u32(slot | if is_fixed { FIXED } else { 0 });
    to.0.resize(to.0.len() + 40, 0);
    to.0
}

fn write_part(to: &mut Writer, part: &Part) {
    to.u16(part.geometry);
    to.u16(u16::from(part.sensor));
    to.f32s(&part.translation);
    to.f32s(&part.rotation);
    to.f32s(&part.size);
}

pub(super) fn joints(joints: &[JointSeen]) -> Vec<u8> {
    let mut to = Writer::new(JOINTS, [0; 3]);
    to.u32(joints.len() as u32);
    for joint in joints {
        for (slot, is_fixed) in joint.slots {
            to.u32(slot | if is_fixed { FIXED } else { 0 });
        }
        to.f32s(joint.anchors.as_flattened());
    }
    to.0
}

/// Encodes the state of everything that moves, as it is at a tick.
pub(super) fn frame(moment: &Moment, origin: [f64; 3]) -> Vec<u8> {
    let count = moment.slot_count as usize;
    let mut to = Writer(Vec::with_capacity(48 + 64 * moment.regions.len() + 24 * count));
    to.0.extend([FRAME, 0, 0, 0]);
    to.u32(moment.number as u32);
    to.f64(moment.tick as f64);
    let lists =
        [moment.regions.len(), moment.borders.len(), count, moment.ghosts.len(), moment.contacts.len()];
    lists.iter().for_each(|&length| to.u32(length as u32));
    to.u32(0);
    // By owner: the number of bodies, and the number of those that are awake.
    let mut owned = vec![[0u32; 2]; moment.regions.len()];
    for seen in &moment.rows {
        if let Some(counts) = owned.get_mut(usize::from(seen.owner)) {
            counts[0] += 1;
            counts[1] += u32::from(!seen.sleeping);
        }
    }
    for (region, counts) in moment.regions.iter().zip(owned) {
        to.u32(region.id);
        to.u32(region.node.unwrap_or(u32::MAX));
        counts.into_iter().for_each(|count| to.u32(count));
        to.u32(region.ghosts as u32);
        to.f32(region.step_ms);
        to.f32s(&relative(region.cell.min, origin));
        to.f32s(&relative(region.cell.max, origin));
    }
    for border in &moment.borders {
        border.between.iter().for_each(|&place| to.u16(place));
        to.u32(border.bodies as u32);
        to.u32(border.exchanges as u32);
        to.f32(border.disagreement_m_s);
    }
    // By slot: all positions, then all rotations, then four bytes for each slot.
    let lists = to.0.len();
    to.0.resize(lists + 24 * count, 0);
    let (places, rest) = to.0[lists..].split_at_mut(12 * count);
    let (turns, marks) = rest.split_at_mut(8 * count);
    for (seen, &slot) in moment.rows.iter().zip(moment.slots.iter()) {
        let slot = slot as usize;
        for (bytes, v) in places[12 * slot..][..12].chunks_exact_mut(4).zip(relative(seen.at, origin)) {
            bytes.copy_from_slice(&v.to_le_bytes());
        }
        for (bytes, v) in turns[8 * slot..][..8].chunks_exact_mut(2).zip(seen.turn) {
            bytes.copy_from_slice(&((v * 32767.0) as i16).to_le_bytes());
        }
        let bits =
            PRESENT | if seen.sleeping { SLEEPING } else { 0 } | if seen.outside { OUTSIDE } else { 0 };
        let mark = [seen.owner.min(255) as u8, bits, 0, eighths(speed_m_s(seen))];
        marks[4 * slot..][..4].copy_from_slice(&mark);
    }
    for ghost in &moment.ghosts {
        let mark = &mut marks[4 * ghost.slot as usize..][..4];
        mark[1] |= SHARED;
        mark[2] = mark[2].max(eighths(8.0 * ghost.off_m_s));
    }
    for ghost in &moment.ghosts {
        to.u32(ghost.slot);
        to.u32(ghost.holder.into());
    }
    for contact in &moment.contacts {
        to.f32s(&relative(contact.at, origin));
        to.f32s(&contact.force_n);
    }
    to.0
}

pub(super) fn samples<'a>(samples: impl Iterator<Item = &'a Sample>) -> Vec<u8> {
    let mut to = Writer::new(SAMPLES, [0; 3]);
    to.u32(0);
    let mut count = 0;
    for sample in samples {
        to.f64(sample.tick as f64);
        to.f32(sample.step_ms);
        to.f32s(&[sample.transfers, sample.exchanges, sample.bytes].map(|count| count as f32));
        to.f32(sample.disagreement_m_s);
        to.u32(0);
        count += 1;
    }
    to.0[4..8].copy_from_slice(&u32::to_le_bytes(count));
    to.0
}

/// The state of the viewer, which ends every answer; only the details of a chosen body come after it.
pub(super) struct State {
    pub(super) paused: bool,
    pub(super) speed: f32,
    /// The first and the last tick that can be shown.
    pub(super) kept: [u64; 2],
    pub(super) viewers: usize,
    /// The current tick and the goal of a recording that is on its way to a tick.
    pub(super) going: Option<[u64; 2]>,
}

pub(super) fn state(state: &State) -> Vec<u8> {
    let mut to = Writer::new(STATE, [u8::from(state.paused), u8::from(state.going.is_some()), 0]);
    to.f32(state.speed);
    state.kept.iter().for_each(|&tick| to.f64(tick as f64));
    to.u32(state.viewers as u32);
    state.going.unwrap_or_default().iter().for_each(|&tick| to.f64(tick as f64));
    to.0
}

fn speed_m_s(seen: &Seen) -> f32 {
    seen.velocity_m_s.iter().map(|v| v * v).sum::<f32>().sqrt()
}

fn relative(at: [f64; 3], origin: [f64; 3]) -> [f32; 3] {
    std::array::from_fn(|i| (at[i] - origin[i]) as f32)
}

/// Returns a number in eighths, as a byte; larger numbers as 255.
fn eighths(value: f32) -> u8 {
    (value * 8.0).min(255.0) as u8
}
