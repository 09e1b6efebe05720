// Draws the world. The poses of all bodies are in textures that are filled straight from the stream. Each part of a body is one
// instance of a geometry, and reads its pose there.

import { BOX, CAPSULE, FIRST_MESH, PLANE, custom, primitive } from "/shapes.js";
import { FIXED, PRESENT, parts } from "/wire.js";

const WIDE = 1024;
const NOBODY = 0xffffffff;
// The most vertices to which instances are expanded, see `batch`.
const SPREAD = 3 << 20;

const POSES = `
uniform highp sampler2D placesNow, placesThen;
uniform highp isampler2D turnsNow, turnsThen;
uniform highp usampler2D marksNow, marksThen;
uniform float between;
vec3 turned(vec4 q, vec3 v) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v); }
ivec2 cell(uint slot) { return ivec2(slot & 1023u, slot >> 10); }
bool pose(uint slot, out vec3 at, out vec4 turn, out uvec4 mark) {
  if (slot == 0xffffffffu) { at = vec3(0); turn = vec4(0, 0, 0, 1); mark = uvec4(0, 1, 0, 0); return true; }
  ivec2 c = cell(slot);
  mark = texelFetch(marksNow, c, 0);
  at = texelFetch(placesNow, c, 0).xyz;
  turn = vec4(texelFetch(turnsNow, c, 0)) / 32767.0;
  if (between < 1.0 && (texelFetch(marksThen, c, 0).y & 1u) != 0u) {
    vec3 then = texelFetch(placesThen, c, 0).xyz;
    vec4 turnThen = vec4(texelFetch(turnsThen, c, 0)) / 32767.0;
    if (distance(then, at) < 3.0) {
      at = mix(then, at, between);
      turn = mix(dot(turn, turnThen) < 0.0 ? -turnThen : turnThen, turn, between);
    }
  }
  turn = normalize(turn);
  return (mark.y & 1u) != 0u;
}
`;

const BODY_VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec4 corner;
layout(location = 1) in vec3 side;
layout(location = 2) in uvec2 who;
layout(location = 3) in vec3 partAt;
layout(location = 4) in vec4 partTurn;
layout(location = 5) in vec3 size;
uniform mat4 camera;
uniform bool capsule, central, flatSides, boxes;
uniform vec3 eye;
uniform uint colouring;
uniform float topSpeed, topOff;
uniform vec3 palette[12];
uniform vec3 ground, quiet;
uniform uint chosen;
uniform bool ghosts;
uniform highp usampler2D holders;
${POSES}
out vec3 place, normal;
flat out vec4 tint;
flat out vec4 rim;
out vec3 inside;
flat out vec3 extent;
flat out uint slotOut, isFixed;
vec3 heat(float t) { return mix(mix(vec3(.16, .36, .75), vec3(.93, .80, .35), smoothstep(0., .5, t)), vec3(.86, .20, .16), smoothstep(.5, 1., t)); }
void main() {
  vec3 at; vec4 turn; uvec4 mark;
  bool there = pose(who.x, at, turn, mark);
  slotOut = who.x == 0xffffffffu ? who.y >> 8 : who.x;
  vec3 p = capsule ? corner.xyz * size.x + vec3(0, corner.w * size.y, 0) : corner.xyz * size;
  vec3 n = capsule ? side : side / max(size, vec3(1e-6));
  if (boxes) {
    vec3 e = turned(vec4(-turn.xyz, turn.w), eye - at);
    if (!central) e = turned(vec4(-partTurn.xyz, partTurn.w), e - partAt);
    p *= mix(vec3(-1), vec3(1), greaterThanEqual(e, vec3(0)));
  }
  inside = p; extent = size;
  place = at + turned(turn, central ? p : partAt + turned(partTurn, p));
  normal = flatSides ? vec3(0) : turned(turn, turned(partTurn, n));
  bool fixedBody = who.x == 0xffffffffu, sensor = (who.y & 1u) != 0u;
  vec3 colour = fixedBody ? ground : palette[mark.x % 12u];
  // Bodies of one owner are told apart.
  if (!fixedBody) colour *= 1.0 + 0.14 * (fract(float(who.x) * 0.618034) - 0.5);
  if (!fixedBody && colouring == 1u) colour = heat(float(mark.w) / 8.0 / topSpeed);
  if (!fixedBody && colouring == 2u) colour = heat(float(mark.z) / 64.0 / topOff);
  if (!fixedBody && (mark.y & 2u) != 0u) colour = mix(colour, quiet, 0.48);
  tint = vec4(colour, sensor ? 0.35 : (mark.y & 8u) != 0u ? 0.45 : 1.0);
  isFixed = fixedBody ? 1u : 0u;
  rim = vec4(0);
  if (!fixedBody && ghosts && (mark.y & 4u) != 0u) {
    uint holder = texelFetch(holders, cell(who.x), 0).x;
    if (holder != 255u) rim = vec4(palette[holder % 12u], 0.75);
  }
  if ((who.y & 2u) != 0u) rim = vec4(1.0, 1.0, 1.0, 0.9);
  if (chosen != 0xffffffffu && slotOut == chosen) rim = vec4(1.0, 0.45, 0.1, 1.0);
  gl_Position = there ? camera * vec4(place, 1) : vec4(0, 0, 2, 1);
  gl_PointSize = 1.0;
}`;

const BODY_FRAGMENT = `#version 300 es
precision highp float;
in vec3 place, normal;
in vec3 inside;
flat in vec4 tint;
flat in vec4 rim;
flat in vec3 extent;
flat in uint slotOut, isFixed;
uniform vec3 eye, sky, haze;
uniform bool boxes, edges, flatSides, grid, pick;
uniform float light, far;
out vec4 colour;
float lines(vec2 at, float step, float wide) {
  vec2 u = at / step, w = fwidth(u);
  vec2 d = abs(fract(u - 0.5) - 0.5) / max(w, vec2(1e-6));
  return (1.0 - min(min(d.x, d.y) / wide, 1.0)) * (1.0 - smoothstep(0.08, 0.35, max(w.x, w.y)));
}
void main() {
  if (pick) { colour = vec4(float(slotOut & 255u), float((slotOut >> 8) & 255u), float((slotOut >> 16) & 255u), float(slotOut >> 24)) / 255.0; return; }
  vec3 n = flatSides ? normalize(cross(dFdx(place), dFdy(place))) : normalize(normal);
  vec3 to = eye - place;
  float away = length(to);
  to /= away;
  if (dot(n, to) < 0.0) n = -n;
  float key = max(dot(n, normalize(vec3(0.45, 0.8, 0.35))), 0.0);
  float day = 0.5 + 0.5 * n.y;
  vec3 c = tint.rgb * (mix(0.46, 0.70, day) * light + 0.36 * key);
  float edge = 0.0;
  if (edges) {
    vec3 gap = extent - abs(inside), w = fwidth(inside);
    vec3 near = smoothstep(vec3(0), max(1.6 * w, vec3(1e-6)), gap);
    float a = min(near.x + near.y, min(near.y + near.z, near.x + near.z));
    edge = 1.0 - clamp(a, 0.0, 1.0);
    edge *= 1.0 - smoothstep(0.1, 0.5, max(w.x, max(w.y, w.z)) / max(min(extent.x, min(extent.y, extent.z)), 1e-6));
    c *= 1.0 - 0.3 * edge;
  }
  if (grid && isFixed != 0u && n.y > 0.7) {
    c = mix(c, c * 0.9, 0.7 * lines(place.xz, 1.0, 1.2));
    c = mix(c, c * 0.8, 0.8 * lines(place.xz, 10.0, 1.4));
  }
  if (rim.a > 0.0) {
    float f = 1.0 - abs(dot(n, to));
    c = mix(c, rim.rgb, rim.a * max(smoothstep(0.45, 0.8, f), edge));
    if (boxes) {
      vec3 share = abs(inside) / max(extent, vec3(1e-6));
      vec3 s = step(vec3(0.86), share);
      if (s.x + s.y + s.z > 1.5) c = mix(c, rim.rgb, rim.a);
    }
  }
  c = mix(c, haze, smoothstep(0.45 * far, far, away));
  colour = vec4(c, tint.a);
}`;

const FLAT_VERTEX = `#version 300 es
precision highp float;
layout(location = 0) in vec3 at;
layout(location = 1) in vec4 shade;
layout(location = 2) in uint slot;
uniform mat4 camera;
uniform float points;
${POSES}
out vec4 tint;
void main() {
  vec3 p; vec4 turn; uvec4 mark;
  bool there = pose(slot, p, turn, mark);
  tint = shade;
  gl_Position = there ? camera * vec4(p + turned(turn, at), 1) : vec4(0, 0, 2, 1);
  gl_PointSize = points;
}`;

const FLAT_FRAGMENT = `#version 300 es
precision highp float;
in vec4 tint;
out vec4 colour;
void main() { colour = tint; }`;

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [kind, text] of [[gl.VERTEX_SHADER, vertex], [gl.FRAGMENT_SHADER, fragment]]) {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
    gl.attachShader(made, shader);
  }
  gl.linkProgram(made);
  if (!gl.getProgramParameter(made, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(made));
  const at = {};
  for (let i = 0; i < gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS); i++) {
    const name = gl.getActiveUniform(made, i).name.replace("[0]", "");
    at[name] = gl.getUniformLocation(made, name);
  }
  return { made, at };
}

// Returns v rotated by q.
export function turned(q, v) {
  const c = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const i = c(q, v).map((x, k) => x + q[3] * v[k]), o = c(q, i);
  return [0, 1, 2].map((k) => v[k] + 2 * o[k]);
}

// Returns the rotation by b, then by a.
function product(a, b) {
  const [x, y, z, w] = a, [i, j, k, l] = b;
  return [w * i + x * l + y * k - z * j, w * j - x * k + y * l + z * i, w * k + x * j - y * i + z * l, w * l - x * i - y * j - z * k];
}

export class Scene {
  constructor(canvas) {
    const gl = canvas.getContext("webgl2", { antialias: false, powerPreference: "high-performance" });
    if (!gl) throw new Error("this browser has no WebGL 2");
    // `slow`: the CPU draws. Moving pictures are then drawn without smooth edges, pictures at rest with them.
    const named = gl.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL ?? gl.RENDERER;
    this.slow = /swiftshader|llvmpipe|software/i.test(gl.getParameter(named));
    this.smooth = { target: gl.createFramebuffer(), buffers: [gl.createRenderbuffer(), gl.createRenderbuffer()], size: "" };
    Object.assign(this, { gl, canvas, bodies: new Map(), meshes: new Map(), batches: new Map(), joints: [], stale: false });
    this.body = program(gl, BODY_VERTEX, BODY_FRAGMENT);
    this.flat = program(gl, FLAT_VERTEX, FLAT_FRAGMENT);
    this.rows = 0;
    this.frame = this.then = null;
    this.sets = [0, 1].map(() => ({ places: gl.createTexture(), turns: gl.createTexture(), marks: gl.createTexture() }));
    this.holders = gl.createTexture();
    this.flats = ["planes", "edges", "contacts", "joints"].map((name) => [name, this.makeFlat()]);
    this.flats = Object.fromEntries(this.flats);
    this.room(1);
  }

  // Makes textures with room for at least `count` slots.
  room(count) {
    const rows = Math.max(1, Math.ceil(count / WIDE));
    if (rows <= this.rows) return;
    const gl = this.gl;
    this.rows = Math.max(rows, Math.min(2 * this.rows, 4096));
    const make = (texture, inner, format, type) => {
      gl.bindTexture(gl.TEXTURE_2D, texture);
      gl.texImage2D(gl.TEXTURE_2D, 0, inner, WIDE, this.rows, 0, format, type, null);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.NEAREST);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MAG_FILTER, gl.NEAREST);
    };
    for (const set of this.sets) {
      make(set.places, gl.RGB32F, gl.RGB, gl.FLOAT);
      make(set.turns, gl.RGBA16I, gl.RGBA_INTEGER, gl.SHORT);
      make(set.marks, gl.RGBA8UI, gl.RGBA_INTEGER, gl.UNSIGNED_BYTE);
    }
    make(this.holders, gl.R8UI, gl.RED_INTEGER, gl.UNSIGNED_BYTE);
    this.then = null;
  }

  fill(texture, count, parts, format, type, data) {
    const gl = this.gl, whole = Math.floor(count / WIDE), rest = count % WIDE;
    gl.bindTexture(gl.TEXTURE_2D, texture);
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    if (whole) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, WIDE, whole, format, type, data.subarray(0, whole * WIDE * parts));
    if (rest) gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, whole, rest, 1, format, type, data.subarray(whole * WIDE * parts));
  }

  mesh(message) {
    this.meshes.set(message.number, custom(message));
  }

  // Takes a body that came, went or, if it is fixed, moved.
  put(message) {
    if (message.count === 0 && message.slot >= FIXED) this.bodies.delete(message.slot);
    else this.bodies.set(message.slot, message);
    this.stale = true;
  }

  // Sorts all parts of all bodies into one batch per geometry.
  sort() {
    const gl = this.gl, lists = new Map();
    for (const body of this.bodies.values()) {
      for (const part of parts(body)) {
        if (!lists.has(part.geometry)) lists.set(part.geometry, []);
        lists.get(part.geometry).push([body, part]);
      }
    }
    for (const [number, batch] of this.batches) if (!lists.has(number)) { this.drop(batch); this.batches.delete(number); }
    for (const [number, list] of lists) {
      if (number >= FIRST_MESH && !this.meshes.has(number)) continue;
      const data = new ArrayBuffer(48 * list.length), ints = new Uint32Array(data), floats = new Float32Array(data);
      list.forEach(([body, part], i) => {
        const fixed = body.slot >= FIXED;
        let { at, turn } = part;
        if (fixed) {
          const moved = turned(body.turn, at);
          at = [0, 1, 2].map((k) => body.at[k] + moved[k]);
          turn = product(body.turn, turn);
        }
        ints[12 * i] = fixed ? NOBODY : body.slot;
        ints[12 * i + 1] = (part.sensor ? 1 : 0) | (body.own ? 2 : 0) | ((fixed ? ((body.slot & 0x7fffff) | 0x800000) : 0) << 8);
        floats.set(at, 12 * i + 2);
        floats.set(turn, 12 * i + 5);
        floats.set(part.size, 12 * i + 9);
      });
      this.drop(this.batches.get(number));
      const shape = number < FIRST_MESH ? primitive(number, list.length) : this.meshes.get(number);
      const batch = this.batch(shape, data, list.length);
      batch.clear = list.some(([, part]) => part.sensor);
      batch.central = list.every(([body, { at, turn }]) => body.slot < FIXED && !at.some((v) => v) && turn[3] === 1);
      this.batches.set(number, batch);
    }
    this.stale = false;
    this.instances = [...this.batches.values()].reduce((sum, batch) => sum + batch.count, 0);
  }

  // Makes the buffers of one draw call. The CPU takes long over instances: if it draws, each vertex has the data of its instance.
  batch(shape, data, count) {
    const gl = this.gl, array = gl.createVertexArray(), corners = shape.vertices.length / 7;
    const spread = this.slow && count * corners <= SPREAD;
    let { indices } = shape;
    let contents = [new Float32Array(shape.vertices), data];
    if (spread) {
      const [from, to] = [new Uint32Array(data), new Uint32Array(19 * corners * count)];
      const vertices = new Uint32Array(contents[0].buffer);
      indices = new Uint32Array(indices.length * count);
      for (let i = 0, at = 0; i < count; i++) {
        const one = from.subarray(12 * i, 12 * i + 12);
        for (let k = 0; k < corners; k++, at += 19) {
          to.set(vertices.subarray(7 * k, 7 * k + 7), at);
          to.set(one, at + 7);
        }
        for (let k = 0; k < shape.indices.length; k++) indices[i * shape.indices.length + k] = i * corners + shape.indices[k];
      }
      contents = [to];
    }
    const buffers = [...contents, new Uint32Array(indices)].map((content, i) => {
      const buffer = gl.createBuffer();
      gl.bindVertexArray(array);
      const target = i === contents.length ? gl.ELEMENT_ARRAY_BUFFER : gl.ARRAY_BUFFER;
      gl.bindBuffer(target, buffer);
      gl.bufferData(target, content, gl.STATIC_DRAW);
      return buffer;
    });
    const reals = (at, size, stride, offset) => { gl.enableVertexAttribArray(at); gl.vertexAttribPointer(at, size, gl.FLOAT, false, stride, offset); };
    gl.bindBuffer(gl.ARRAY_BUFFER, buffers[0]);
    const [wide, skip] = spread ? [76, 28] : [48, 0];
    reals(0, 4, spread ? 76 : 28, 0);
    reals(1, 3, spread ? 76 : 28, 16);
    if (!spread) gl.bindBuffer(gl.ARRAY_BUFFER, buffers[1]);
    gl.enableVertexAttribArray(2);
    gl.vertexAttribIPointer(2, 2, gl.UNSIGNED_INT, wide, skip);
    reals(3, 3, wide, skip + 8);
    reals(4, 4, wide, skip + 20);
    reals(5, 3, wide, skip + 36);
    if (!spread) for (const at of [2, 3, 4, 5]) gl.vertexAttribDivisor(at, 1);
    gl.bindVertexArray(null);
    return { array, buffers, count, spread, length: indices.length, mode: shape.lines ? gl.LINES : gl.TRIANGLES };
  }

  drop(batch) {
    if (!batch) return;
    batch.buffers.forEach((buffer) => this.gl.deleteBuffer(buffer));
    this.gl.deleteVertexArray(batch.array);
  }

  makeFlat() {
    const gl = this.gl, array = gl.createVertexArray(), buffer = gl.createBuffer();
    gl.bindVertexArray(array);
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    for (const [at, size, offset] of [[0, 3, 0], [1, 4, 12]]) {
      gl.enableVertexAttribArray(at);
      gl.vertexAttribPointer(at, size, gl.FLOAT, false, 32, offset);
    }
    gl.enableVertexAttribArray(2);
    gl.vertexAttribIPointer(2, 1, gl.UNSIGNED_INT, 32, 28);
    gl.bindVertexArray(null);
    return { array, buffer, count: 0 };
  }

  // Sets lines, points or triangles. Each vertex has a place, a colour, and the slot of the body that it is on.
  setFlat(name, vertices) {
    const flat = this.flats[name], data = new ArrayBuffer(32 * vertices.length);
    const floats = new Float32Array(data), ints = new Uint32Array(data);
    vertices.forEach(([at, colour, slot], i) => {
      floats.set(at, 8 * i);
      floats.set(colour, 8 * i + 3);
      ints[8 * i + 7] = slot ?? NOBODY;
    });
    this.gl.bindBuffer(this.gl.ARRAY_BUFFER, flat.buffer);
    this.gl.bufferData(this.gl.ARRAY_BUFFER, data, this.gl.DYNAMIC_DRAW);
    flat.count = vertices.length;
  }

  // Takes a frame. Bodies are interpolated from the frame before, unless `jump` is set.
  show(frame, jump) {
    const gl = this.gl;
    this.room(frame.count);
    this.sets.reverse();
    const [set] = this.sets;
    this.fill(set.places, frame.count, 3, gl.RGB, gl.FLOAT, frame.places);
    this.fill(set.turns, frame.count, 4, gl.RGBA_INTEGER, gl.SHORT, frame.turns);
    this.fill(set.marks, frame.count, 4, gl.RGBA_INTEGER, gl.UNSIGNED_BYTE, frame.marks);
    const holders = new Uint8Array(frame.count).fill(255);
    for (let i = 0; i < frame.ghosts.length; i += 2) holders[frame.ghosts[i]] = frame.ghosts[i + 1];
    this.fill(this.holders, frame.count, 1, gl.RED_INTEGER, gl.UNSIGNED_BYTE, holders);
    this.then = jump || !this.frame || this.frame.count > frame.count ? null : this.frame;
    this.frame = frame;
  }

  poses(at, between) {
    const gl = this.gl, [now, then] = this.sets;
    const textures = [now.places, then.places, now.turns, then.turns, now.marks, then.marks, this.holders];
    ["placesNow", "placesThen", "turnsNow", "turnsThen", "marksNow", "marksThen", "holders"].forEach((name, i) => {
      gl.activeTexture(gl.TEXTURE0 + i);
      gl.bindTexture(gl.TEXTURE_2D, textures[i]);
      if (at[name]) gl.uniform1i(at[name], i);
    });
    gl.uniform1f(at.between, this.then ? between : 1);
  }

  // Draws everything. `look` says from where and how.
  draw(look) {
    const gl = this.gl, { canvas } = this;
    if (this.stale) this.sort();
    if (look.smooth) this.smoothly();
    gl.viewport(0, 0, canvas.width, canvas.height);
    gl.clearColor(...look.back, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (this.frame) this.drawAll(look);
    if (look.smooth) {
      const { width, height } = canvas;
      gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
      gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
      gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    }
  }

  // Makes the following calls draw to a buffer of up to four samples per pixel.
  smoothly() {
    const gl = this.gl, { target, buffers, size } = this.smooth, { width, height } = this.canvas;
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    if (size === `${width} ${height}`) return;
    this.smooth.size = `${width} ${height}`;
    const samples = Math.min(4, gl.getParameter(gl.MAX_SAMPLES));
    for (const [buffer, kind, where] of [[buffers[0], gl.RGBA8, gl.COLOR_ATTACHMENT0], [buffers[1], gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]]) {
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorageMultisample(gl.RENDERBUFFER, samples, kind, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, where, gl.RENDERBUFFER, buffer);
    }
  }

  drawAll(look) {
    const gl = this.gl;
    this.drawBodies(look, false);
    const { made, at } = this.flat;
    gl.useProgram(made);
    gl.uniformMatrix4fv(at.camera, false, look.matrix);
    this.poses(at, look.between);
    gl.enable(gl.BLEND);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.depthMask(false);
    const draw = (name, mode, points) => {
      const flat = this.flats[name];
      if (!flat.count) return;
      gl.uniform1f(at.points, points);
      gl.bindVertexArray(flat.array);
      gl.drawArrays(mode, 0, flat.count);
    };
    if (look.borders) { draw("planes", gl.TRIANGLES, 1); draw("edges", gl.LINES, 1); }
    gl.disable(gl.DEPTH_TEST);
    if (look.joints) draw("joints", gl.LINES, 1);
    if (look.contacts) { draw("contacts", gl.LINES, 1); }
    gl.depthMask(true);
    gl.disable(gl.BLEND);
    gl.bindVertexArray(null);
  }

  drawBodies(look, pick) {
    const gl = this.gl, { made, at } = this.body;
    gl.useProgram(made);
    gl.enable(gl.DEPTH_TEST);
    gl.uniformMatrix4fv(at.camera, false, look.matrix);
    gl.uniform3fv(at.eye, look.eye);
    gl.uniform3fv(at.palette, look.palette);
    gl.uniform3fv(at.ground, look.ground);
    gl.uniform3fv(at.quiet, look.quiet);
    gl.uniform3fv(at.haze, look.back);
    gl.uniform1f(at.light, look.light);
    gl.uniform1f(at.far, look.far);
    gl.uniform1f(at.topSpeed, look.topSpeed);
    gl.uniform1f(at.topOff, look.topOff);
    gl.uniform1ui(at.colouring, look.colouring);
    gl.uniform1ui(at.chosen, look.chosen);
    gl.uniform1i(at.ghosts, look.ghosts ? 1 : 0);
    gl.uniform1i(at.pick, pick ? 1 : 0);
    this.poses(at, look.between);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    for (const [number, batch] of [...this.batches].sort(([a], [b]) => (b === PLANE) - (a === PLANE))) {
      gl.uniform1i(at.capsule, number === CAPSULE ? 1 : 0);
      gl.uniform1i(at.boxes, number === BOX ? 1 : 0);
      // Edges of many small boxes are not seen, and take the CPU long.
      gl.uniform1i(at.edges, number === BOX && !(this.slow && batch.count > 8000 && !look.smooth) ? 1 : 0);
      gl.uniform1i(at.grid, number === BOX || number === PLANE ? 1 : 0);
      gl.uniform1i(at.flatSides, number === BOX || number >= FIRST_MESH ? 1 : 0);
      gl.uniform1i(at.central, batch.central ? 1 : 0);
      if (number !== BOX && number < PLANE) gl.enable(gl.CULL_FACE); else gl.disable(gl.CULL_FACE);
      if (!pick && (batch.clear || look.outside)) gl.enable(gl.BLEND); else gl.disable(gl.BLEND);
      gl.bindVertexArray(batch.array);
      if (batch.spread) gl.drawElements(batch.mode, batch.length, gl.UNSIGNED_INT, 0);
      else gl.drawElementsInstanced(batch.mode, batch.length, gl.UNSIGNED_INT, 0, batch.count);
    }
    gl.disable(gl.BLEND);
    gl.disable(gl.CULL_FACE);
    gl.bindVertexArray(null);
  }

  // Returns the slot of the body that is seen at a pixel, or null.
  at(x, y, look) {
    const gl = this.gl, { width, height } = this.canvas;
    const target = gl.createFramebuffer(), colour = gl.createRenderbuffer(), depth = gl.createRenderbuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, target);
    for (const [buffer, kind, where] of [[colour, gl.RGBA8, gl.COLOR_ATTACHMENT0], [depth, gl.DEPTH_COMPONENT24, gl.DEPTH_ATTACHMENT]]) {
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, kind, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, where, gl.RENDERBUFFER, buffer);
    }
    gl.viewport(0, 0, width, height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(x, height - 1 - y, 1, 1);
    gl.clearColor(1, 1, 1, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    if (this.frame) this.drawBodies(look, true);
    const pixel = new Uint8Array(4);
    gl.readPixels(x, height - 1 - y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    gl.disable(gl.SCISSOR_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.deleteFramebuffer(target);
    gl.deleteRenderbuffer(colour);
    gl.deleteRenderbuffer(depth);
    const slot = (pixel[0] | pixel[1] << 8 | pixel[2] << 16 | pixel[3] << 24) >>> 0;
    if (slot === NOBODY) return null;
    // Fixed bodies are marked by a bit of their own here.
    return slot & 0x800000 ? (slot & 0x7fffff | FIXED) >>> 0 : slot;
  }

  // Returns the place of a movable body between two frames; null if it is not in the picture.
  place(slot, between) {
    const { frame, then } = this, isIn = (picture) => picture && slot < picture.count && picture.marks[4 * slot + 1] & PRESENT;
    if (!isIn(frame)) return null;
    const now = frame.places.subarray(3 * slot, 3 * slot + 3);
    if (between >= 1 || !isIn(then)) return [...now];
    return [0, 1, 2].map((i) => then.places[3 * slot + i] + between * (now[i] - then.places[3 * slot + i]));
  }
}
