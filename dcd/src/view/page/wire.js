// Reads the messages of the stream: see wire.rs, which writes them.

export const FIXED = 0x80000000;
export const PRESENT = 1, SLEEPING = 2, SHARED = 4, OUTSIDE = 8;

const text = new TextDecoder();

export function read(buffer) {
  const view = new DataView(buffer);
  const u32 = (at) => view.getUint32(at, true), f32 = (at) => view.getFloat32(at, true), f64 = (at) => view.getFloat64(at, true);
  switch (view.getUint8(0)) {
    case 1:
      return {
        kind: "hello", controls: view.getUint8(2) === 1, recorded: view.getUint8(3) === 1 ? [f64(80), f64(88)] : null, dt: f32(4),
        origin: [f64(8), f64(16), f64(24)],
        min: [f64(32), f64(40), f64(48)], max: [f64(56), f64(64), f64(72)],
        name: text.decode(new Uint8Array(buffer, 96)),
      };
    case 2: {
      const [number, vertices, triangles] = [u32(4), u32(8), u32(12)];
      return {
        kind: "mesh", number,
        vertices: new Float32Array(buffer, 16, 3 * vertices),
        triangles: new Uint32Array(buffer, 16 + 12 * vertices, 3 * triangles),
      };
    }
    case 3:
      return {
        kind: "body", sort: view.getUint8(1), own: view.getUint8(2) === 1, slot: u32(4),
        id: (BigInt(u32(12)) << 32n) | BigInt(u32(8)), count: u32(16),
        at: new Float32Array(buffer, 20, 3), turn: new Float32Array(buffer, 32, 4), buffer,
      };
    case 4: {
      const [regions, borders, count, ghosts, contacts] = [16, 20, 24, 28, 32].map(u32);
      let at = 40;
      const frame = { kind: "frame", number: u32(4), tick: f64(8), count, regions: [], borders: [] };
      for (let i = 0; i < regions; i++, at += 48) {
        const node = u32(at + 4);
        frame.regions.push({
          id: u32(at), node: node === 0xffffffff ? null : node, owned: u32(at + 8), awake: u32(at + 12), ghosts: u32(at + 16),
          ms: f32(at + 20), min: [24, 28, 32].map((o) => f32(at + o)), max: [36, 40, 44].map((o) => f32(at + o)),
        });
      }
      for (let i = 0; i < borders; i++, at += 16) {
        frame.borders.push({
          a: view.getUint16(at, true), b: view.getUint16(at + 2, true), bodies: u32(at + 4), exchanges: u32(at + 8), off: f32(at + 12),
        });
      }
      frame.places = new Float32Array(buffer, at, 3 * count);
      frame.turns = new Int16Array(buffer, at + 12 * count, 4 * count);
      frame.marks = new Uint8Array(buffer, at + 20 * count, 4 * count);
      at += 24 * count;
      frame.ghosts = new Uint32Array(buffer, at, 2 * ghosts);
      frame.contacts = new Float32Array(buffer, at + 8 * ghosts, 6 * contacts);
      return frame;
    }
    case 5: {
      const samples = [];
      for (let i = 0, at = 8; i < u32(4); i++, at += 32) {
        samples.push({
          tick: f64(at), ms: f32(at + 8), transfers: f32(at + 12), exchanges: f32(at + 16), bytes: f32(at + 20), off: f32(at + 24),
        });
      }
      return { kind: "samples", samples };
    }
    case 6:
      return { kind: "state", paused: view.getUint8(1) === 1, speed: f32(4), oldest: f64(8), newest: f64(16), viewers: u32(24), going: view.getUint8(2) === 1 ? [f64(28), f64(36)] : null };
    case 7: {
      const joints = [];
      for (let i = 0, at = 8; i < u32(4); i++, at += 32) {
        joints.push({ slots: [u32(at), u32(at + 4)], anchors: new Float32Array(buffer, at + 8, 6) });
      }
      return { kind: "joints", joints };
    }
    case 123:
      return { kind: "details", ...JSON.parse(text.decode(buffer)) };
    default:
      return null;
  }
}

// Returns the parts of a body: geometry, whether it is a sensor, place, turn and size.
export function parts(body) {
  const view = new DataView(body.buffer), all = [];
  for (let i = 0, at = 48; i < body.count; i++, at += 44) {
    all.push({
      geometry: view.getUint16(at, true), sensor: view.getUint16(at + 2, true) === 1,
      at: new Float32Array(body.buffer, at + 4, 3), turn: new Float32Array(body.buffer, at + 16, 4),
      size: new Float32Array(body.buffer, at + 32, 3),
    });
  }
  return all;
}

export const ASK = { see: 1, past: 2, pause: 3, step: 4, speed: 5, contacts: 6, choose: 7, leave: 8, go: 9 };

// Returns a message to the server: what is asked, and a number, which is a BigInt unless it is a speed.
export function ask(what, number = 0n) {
  const view = new DataView(new ArrayBuffer(9));
  view.setUint8(0, what);
  if (typeof number === "bigint") view.setBigUint64(1, number, true);
  else view.setFloat64(1, number, true);
  return view.buffer;
}
