// The page: connects the stream, the scene, the camera and the controls.

import { Camera } from "/camera.js";
import { Scene, turned } from "/scene.js";
import { Timeline } from "/timeline.js";
import { ASK, FIXED, PRESENT, SLEEPING, ask, read } from "/wire.js";

const get = (id) => document.getElementById(id);
const settings = new URLSearchParams(location.hash.slice(1));
const canvas = get("scene");

// Numbers for tests and curious people.
const counters = { frames: 0, drawn: 0, bytes: 0, bodies: 0, asleep: 0, instances: 0, tick: 0, drawnPerSecond: 0, firstPictureMs: null, smooth: false, connected: false, paused: false };
window.dcd = { counters };

const PALETTE = ["4269d0", "efb118", "3ca951", "ff725c", "a463f2", "38b2c4", "ff8ab7", "9c6b4e", "7f8ba0", "b8c13a", "5fa8e8", "d8763a"];
const rgb = (hex) => [0, 2, 4].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);
const THEMES = {
  light: { back: rgb("f4f5f7"), ground: rgb("dcdfe3"), quiet: rgb("c9cdd3"), light: 1, bar: "#2f5fd0", mark: "#d1662b", line: "#7f8ba0", soft: "#66707c", panel: "#ffffff" },
  dark: { back: rgb("14171b"), ground: rgb("434a54"), quiet: rgb("5a626d"), light: 0.92, bar: "#86aaff", mark: "#f0a35e", line: "#7f8ba0", soft: "#98a2ad", panel: "#1d2127" },
};
const palette = new Float32Array(PALETTE.flatMap(rgb));
let theme = THEMES.light;
const night = matchMedia("(prefers-color-scheme: dark)");
function dress() {
  const name = settings.get("theme") ?? (night.matches ? "dark" : "light");
  document.documentElement.dataset.theme = name;
  theme = THEMES[name] ?? THEMES.light;
  camera.moved = timeline.changed = true;
  borders = null;
}

const camera = new Camera();
const timeline = new Timeline(get("timeline"));
let scene, hello = null, state = null, regions = [], borders = null, bounds = null;
let between = 1, interval = 50, arrived = 0, painting = true, fitted = false;
let chosen = null, chosenId = 0n, details = null, following = false, past = null;

// The stream. One request for a picture is open at a time, so a slow page is sent fewer pictures.
let socket = null, pending = false;
function connect() {
  socket = new WebSocket(`ws://${location.host}/stream?key=${new URLSearchParams(location.search).get("key") ?? ""}`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => {
    counters.connected = true;
    pending = false;
    if (options.contacts) send(ASK.contacts, 1n);
    // After a lost link everything is sent anew, and the past picture that was shown is no longer kept.
    timeline.samples = [];
    goTo(Infinity);
    if (chosen !== null) send(ASK.choose, chosenId);
  };
  socket.onclose = () => {
    counters.connected = false;
    setTimeout(connect, 1000);
    get("status").textContent = hello ? "the world is gone: its program has ended, or the link is lost" : "refused: open the address that the program printed";
  };
  socket.onmessage = ({ data }) => {
    counters.bytes += data.byteLength;
    const message = read(data);
    if (message) take[message.kind]?.(message);
  };
}
const send = (what, number) => socket?.readyState === WebSocket.OPEN && socket.send(ask(what, number));

const take = {
  hello(message) {
    hello = message;
    document.title = `${hello.name} · dcd`;
    get("name").textContent = hello.name;
    get("controls").hidden = !hello.controls;
    borders = null;
  },
  mesh: (message) => scene.mesh(message),
  body: (message) => { scene.put(message); painting = true; },
  joints(message) {
    const joints = message.joints.flatMap(({ slots, anchors }) => [0, 1].map((end) => {
      const at = [...anchors.subarray(3 * end, 3 * end + 3)], slot = slots[end], fixed = slot >= FIXED && scene.bodies.get(slot);
      const place = fixed ? turned(fixed.turn, at).map((v, i) => v + fixed.at[i]) : at;
      return [place, [0.95, 0.35, 0.55, 0.9], fixed ? undefined : slot];
    }));
    scene.setFlat("joints", joints);
  },
  frame(frame) {
    const now = performance.now(), jump = past !== null || state?.paused || now - arrived > 600 || frame.tick < counters.tick;
    interval = jump ? interval : 0.8 * interval + 0.2 * Math.min(300, Math.max(15, now - arrived));
    arrived = now;
    between = jump || scene.slow ? 1 : 0;
    scene.show(frame, jump);
    findChosen();
    counters.frames++;
    counters.tick = frame.tick;
    regions = frame.regions;
    measure(frame);
    drawBorders(frame);
    if (options.contacts) drawContacts(frame);
    painting = true;
    tellRegions();
  },
  samples: ({ samples }) => timeline.add(samples),
  details: (message) => { details = message; tellChosen(); },
  state(message) {
    const before = state;
    state = message;
    pending = false;
    counters.paused = state.paused;
    get("play").textContent = state.paused ? "play" : "pause";
    const speed = get("speed");
    if (before?.speed !== state.speed) for (const option of speed.options) option.selected = Math.abs(Number(option.value) - state.speed) < 1e-4;
    const scrub = get("scrub");
    [scrub.min, scrub.max] = hello?.recorded ?? [state.oldest, state.newest];
    if (past === null && !dragging) scrub.value = state.going?.[1] ?? state.newest;
    counters.going = state.going !== null;
  },
};

// Counts bodies, and finds the box that they are in.
function measure(frame) {
  let bodies = 0, asleep = 0;
  const min = [Infinity, Infinity, Infinity], max = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < frame.count; i++) {
    const mark = frame.marks[4 * i + 1];
    if (!(mark & PRESENT)) continue;
    bodies++;
    if (mark & SLEEPING) asleep++;
    for (let k = 0; k < 3; k++) {
      const v = frame.places[3 * i + k];
      if (v < min[k]) min[k] = v;
      if (v > max[k]) max[k] = v;
    }
  }
  Object.assign(counters, { bodies, asleep });
  if (!bodies) { min.fill(-5); max.fill(5); }
  // The box in which borders are drawn grows at once, but does not shrink with each body that moves inwards.
  if (!bounds || min.some((v, k) => v < bounds.min[k]) || max.some((v, k) => v > bounds.max[k])) {
    const near = (k, v) => hello ? Math.max(hello.min[k] - hello.origin[k], Math.min(hello.max[k] - hello.origin[k], v)) : v;
    bounds = { min: min.map((v, k) => near(k, v - 3)), max: max.map((v, k) => near(k, v + 2)) };
    for (let k = 0; k < 3; k++) if (bounds.max[k] - bounds.min[k] < 2) bounds.max[k] = bounds.min[k] + 2;
    borders = null;
  }
  if (!fitted) {
    fitted = true;
    camera.fit(min.map((v) => v - 1), max.map((v) => v + 1));
    for (const name of ["yaw", "pitch", "distance"]) if (settings.has(name)) camera[name] = Number(settings.get(name));
    if (settings.has("target")) camera.target = settings.get("target").split(",").map((v, k) => Number(v) - (hello?.origin[k] ?? 0));
  }
}

// Draws the faces that regions share, the redder the more their copies disagree.
function drawBorders(frame) {
  const key = JSON.stringify([regions.map(({ min, max }) => [min, max]), frame.borders.map(({ a, b, off }) => [a, b, Math.round(off * 50)])]);
  if (key === borders) return;
  borders = key;
  const off = new Map(frame.borders.map((border) => [`${border.a},${border.b}`, border.off]));
  const planes = [], edges = [], calm = theme === THEMES.dark ? [0.65, 0.75, 0.95] : [0.25, 0.35, 0.55];
  for (let a = 0; a < regions.length; a++)
    for (let b = a + 1; b < regions.length; b++) {
      const low = [0, 1, 2].map((k) => Math.max(regions[a].min[k], regions[b].min[k]));
      const high = [0, 1, 2].map((k) => Math.min(regions[a].max[k], regions[b].max[k]));
      const axis = [0, 1, 2].find((k) => low[k] === high[k]);
      if (axis === undefined) continue;
      const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
      const l = low.map((x, k) => k === axis ? x : Math.max(x, bounds.min[k])), h = high.map((x, k) => k === axis ? x : Math.min(x, bounds.max[k]));
      if (l[u] >= h[u] || l[v] >= h[v]) continue;
      const heat = Math.min(1, (off.get(`${a},${b}`) ?? 0) / 0.5), tint = calm.map((c, k) => c + heat * ([0.9, 0.2, 0.15][k] - c));
      const corner = (i, j) => { const at = [...l]; at[u] = i ? h[u] : l[u]; at[v] = j ? h[v] : l[v]; return at; };
      const [p, q, r, s] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
      planes.push(...[p, q, r, p, r, s].map((at) => [at, [...tint, 0.10 + 0.2 * heat]]));
      edges.push(...[p, q, q, r, r, s, s, p].map((at) => [at, [...tint, 0.75]]));
    }
  scene.setFlat("planes", planes);
  scene.setFlat("edges", edges);
}

function drawContacts({ contacts }) {
  const vertices = [], colour = theme === THEMES.dark ? [1, 0.75, 0.3, 0.9] : [0.8, 0.25, 0.05, 0.9];
  let top = 1e-9;
  for (let i = 0; i < contacts.length; i += 6) top = Math.max(top, Math.hypot(contacts[i + 3], contacts[i + 4], contacts[i + 5]));
  for (let i = 0; i < contacts.length; i += 6) {
    const at = [...contacts.subarray(i, i + 3)], force = [...contacts.subarray(i + 3, i + 6)], size = Math.hypot(...force);
    if (!(size > 0)) continue;
    const long = (0.15 + 1.2 * Math.sqrt(size / top)) / size;
    for (const sign of [1, -1]) vertices.push([at.map((v, k) => v + sign * 0.5 * long * force[k]), colour]);
  }
  scene.setFlat("contacts", vertices);
}

const options = {};
for (const name of ["borders", "ghosts", "contacts", "joints"]) {
  const box = get(name);
  if (settings.has("show")) box.checked = settings.get("show").split(",").includes(name);
  options[name] = box.checked;
  box.addEventListener("change", () => {
    options[name] = box.checked;
    painting = true;
    if (name === "contacts") { send(ASK.contacts, box.checked ? 1n : 0n); scene.setFlat("contacts", []); }
  });
}
if (settings.has("colour")) get("colour").value = settings.get("colour");
get("colour").addEventListener("change", () => { painting = true; });

// Time.
function pause() {
  const on = !state?.paused;
  // A recording goes on from the tick that is shown.
  if (past !== null && hello?.recorded) resume();
  send(ASK.pause, on ? 1n : 0n);
}
const step = () => past !== null && hello?.recorded ? goTo(past + 1) : send(ASK.step, 1n);
get("play").addEventListener("click", pause);
get("step").addEventListener("click", step);
get("speed").addEventListener("change", (event) => send(ASK.speed, Number(event.target.value)));
// Shows a kept picture of the past. A recording goes to any tick: without a kept picture the tick is computed again.
let dragging = false;
function goTo(tick) {
  const { oldest, newest } = state ?? { oldest: 0, newest: 0 };
  if (hello?.recorded && Number.isFinite(tick) && (tick < oldest || tick > newest)) return send(ASK.go, BigInt(Math.round(tick)));
  past = tick >= newest ? null : Math.max(oldest, tick);
  get("now").hidden = past === null;
  get("scrub").value = past ?? newest;
}
function resume() {
  send(ASK.go, BigInt(Math.round(past)));
  goTo(Infinity);
}
get("scrub").addEventListener("input", (event) => {
  const tick = Number(event.target.value), isKept = tick >= state?.oldest && tick <= state?.newest;
  dragging = true;
  if (!hello?.recorded || isKept) goTo(tick);
});
get("scrub").addEventListener("change", (event) => {
  dragging = false;
  if (hello?.recorded) send(ASK.go, BigInt(event.target.value));
  if (hello?.recorded) goTo(Infinity);
});
get("now").addEventListener("click", () => goTo(Infinity));

// The chosen body.
function choose(slot) {
  const body = slot === null ? null : scene.bodies.get(slot);
  [chosen, chosenId, details] = body ? [slot, body.id, null] : [null, 0n, null];
  following &&= chosen !== null;
  get("chosen").hidden = !body;
  send(body ? ASK.choose : ASK.leave, chosenId);
  painting = true;
  tellChosen();
}
// Whether the chosen body is in a slot now.
function isChosen(slot) {
  return scene.bodies.get(slot)?.id === chosenId && (slot >= FIXED || scene.place(slot, 1) !== null);
}
// A body that changes its shape gets another slot; in pictures of the past it is in its former one.
function findChosen() {
  if (chosen === null || isChosen(chosen)) return;
  for (const slot of scene.bodies.keys()) if (isChosen(slot)) chosen = slot;
}
function follow(on) {
  following = on && chosen !== null && chosen < FIXED;
  get("follow").setAttribute("aria-pressed", String(following));
  painting = true;
}
get("follow").addEventListener("click", () => follow(!following));
get("leave").addEventListener("click", () => choose(null));
function tellChosen() {
  const frame = scene.frame;
  if (chosen === null || !frame) return;
  get("chosen-id").textContent = details ? `body ${details.id}` : "body";
  if (!isChosen(chosen)) return tellFacts([["place", "not in this picture"]]);
  const body = scene.bodies.get(chosen), place = scene.place(chosen, 1);
  const facts = [["kind", ["dynamic", "fixed", "kinematic"][body.sort] + (body.own ? ", own avatar" : "")]];
  if (place) {
    const [owner, mark, , speed] = frame.marks.subarray(4 * chosen, 4 * chosen + 4), region = regions[owner];
    if (region) facts.push(["owner", `r${region.id}` + (region.node === null ? "" : ` on n${region.node}`)]);
    facts.push(["speed", `${(speed / 8).toFixed(1)}${speed === 255 ? " or more" : ""} m/s${mark & SLEEPING ? ", asleep" : ""}`]);
    facts.push(["place", place.map((v, k) => (v + hello.origin[k]).toFixed(2)).join("  ")]);
  }
  if (details) {
    if (details.holders) facts.push(["held by", `${details.holders} region${details.holders > 1 ? "s" : ""}`]);
    facts.push(["epoch", details.epoch]);
    if (details.mass_kg !== null) facts.push(["mass", `${Number(details.mass_kg.toPrecision(4))} kg`]);
    if (details.user_data !== "0") facts.push(["user data", details.user_data]);
    for (const [tick, from, to] of details.owners.slice(0, 6)) facts.push([`tick ${tick}`, `${from} → ${to}`]);
  }
  tellFacts(facts);
}
function tellFacts(facts) {
  get("chosen-facts").replaceChildren(...facts.flatMap(([name, value]) => {
    const [term, fact] = [document.createElement("dt"), document.createElement("dd")];
    term.textContent = name;
    fact.textContent = value;
    return [term, fact];
  }));
}

let told = 0;
function tellRegions() {
  const now = performance.now();
  if (now - told < 250) return;
  told = now;
  const rows = regions.slice(0, 24).map((region, place) => {
    const row = document.createElement("tr"), cells = [null, region.owned, region.awake, region.ghosts, region.ms.toFixed(1)];
    row.append(...cells.map((value) => { const cell = document.createElement("td"); cell.textContent = value; return cell; }));
    const swatch = document.createElement("span");
    swatch.className = "swatch";
    swatch.style.background = `#${PALETTE[place % PALETTE.length]}`;
    row.firstChild.replaceChildren(swatch, `r${region.id}${region.node === null ? "" : ` n${region.node}`}`);
    return row;
  });
  get("regions").replaceChildren(...rows);
  tellChosen();
}

function tellStatus() {
  if (!hello || !scene.frame || !counters.connected) return;
  const tick = scene.frame.tick, words = [`tick ${tick}`, `${(tick * hello.dt).toFixed(1)} s`, `${counters.bodies} bodies`];
  if (counters.asleep) words.push(`${counters.asleep} asleep`);
  const sample = timeline.last();
  if (sample?.ms) words.push(`step ${sample.ms.toFixed(1)} ms`);
  if (hello.recorded) words[0] += ` of ${hello.recorded[1]}`;
  if (state?.going) words.push(`on its way to tick ${state.going[1]}: at ${state.going[0]}`);
  else if (past !== null) words.push("in the past"); else if (state?.paused) words.push("paused");
  get("status").textContent = words.join(" · ");
}

function look() {
  const aspect = canvas.width / canvas.height;
  const marked = chosen === null ? 0xffffffff : chosen >= FIXED ? (chosen & 0x7fffff | 0x800000) : chosen;
  return {
    matrix: camera.matrix(aspect), eye: camera.eye(), far: camera.distance * 25 + 250, between, palette, chosen: marked,
    back: theme.back, ground: theme.ground, quiet: theme.quiet, light: theme.light,
    outside: hello && !hello.controls, colouring: Number(get("colour").value), topSpeed: 8, topOff: 0.25, ...options,
  };
}

// Keys of the whole page; those of the camera are in camera.js.
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select, input[type=range]")) return;
  const toggle = (name) => () => get(name).click();
  const onButton = event.target.matches("button");
  const keys = {
    " ": onButton || !hello?.controls ? null : pause, ".": hello?.controls ? step : null, f: () => follow(!following), h: () => { fitted = false; }, Escape: () => choose(null), End: () => goTo(Infinity),
    b: toggle("borders"), g: toggle("ghosts"), c: toggle("contacts"), j: toggle("joints"),
    "[": () => goTo((past ?? state?.newest ?? 0) - 1), "]": () => goTo((past ?? state?.newest ?? 0) + 1),
  };
  const key = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (!key) return;
  event.preventDefault();
  key();
});

const CALM = 20;
// `coarse` lowers the resolution of moving pictures where the CPU takes too long to draw them.
let last = performance.now(), drawnAt = [], calm = 0, coarse = 1, wide = 0, high = 0;
function paint(now) {
  requestAnimationFrame(paint);
  if (!pending && socket?.readyState === WebSocket.OPEN) {
    pending = true;
    send(past === null ? ASK.see : ASK.past, past === null ? 0n : BigInt(Math.round(past)));
  }
  const spent = now - last;
  last = now;
  if (between < 1) { between = Math.min(1, between + spent / interval); painting = true; }
  if (following) {
    const place = isChosen(chosen) && scene.place(chosen, between);
    if (place) camera.target = place;
  }
  if (canvas.clientWidth !== wide || canvas.clientHeight !== high) {
    [wide, high] = [canvas.clientWidth, canvas.clientHeight];
    painting = timeline.changed = true;
  }
  timeline.draw({ bar: theme.bar, mark: theme.mark, line: theme.line, soft: theme.soft, back: theme.panel }, hello?.dt ?? 0);
  const still = !painting && !camera.moved;
  // Where the CPU draws, a picture at rest is drawn once more, in full resolution and with smooth edges.
  if (still && !(scene.slow && ++calm === CALM)) return;
  if (!still && scene.slow && calm === 0) coarse = Math.min(1, Math.max(0.6, coarse * (spent > 80 ? 0.9 : spent < 40 ? 1.05 : 1)));
  if (!still) calm = 0;
  painting = camera.moved = false;
  const scale = (Number(settings.get("scale")) || Math.min(2, devicePixelRatio || 1)) * (still || !scene.slow ? 1 : coarse);
  const size = { width: Math.round(wide * scale), height: Math.round(high * scale) };
  if (canvas.width !== size.width || canvas.height !== size.height) Object.assign(canvas, size);
  scene.draw({ ...look(), smooth: still || !scene.slow });
  tellStatus();
  if (!scene.frame) return;
  counters.drawn++;
  counters.smooth = still || !scene.slow;
  counters.instances = scene.instances ?? 0;
  drawnAt.push(now);
  drawnAt = drawnAt.filter((at) => at > now - 1000);
  counters.drawnPerSecond = drawnAt.length;
  counters.firstPictureMs ??= performance.now();
}

try {
  scene = new Scene(canvas);
  window.dcd.scene = scene;
  window.dcd.camera = camera;
  window.dcd.choose = choose;
  if (settings.has("bare")) document.body.classList.add("bare");
  dress();
  night.addEventListener("change", dress);
  camera.listen(canvas, (x, y) => {
    const box = canvas.getBoundingClientRect(), scale = canvas.width / box.width;
    choose(scene.at(Math.floor((x - box.left) * scale), Math.floor((y - box.top) * scale), look()));
  }, () => follow(false));
  connect();
  requestAnimationFrame(paint);
} catch (error) {
  get("status").textContent = error.message;
}
