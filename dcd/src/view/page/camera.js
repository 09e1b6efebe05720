// A camera that turns round a point, and the mouse, fingers and keys that move it.

const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a) => { const l = Math.hypot(...a) || 1; return [a[0] / l, a[1] / l, a[2] / l]; };

export function times(a, b) {
  const out = new Float32Array(16);
  for (let c = 0; c < 4; c++)
    for (let r = 0; r < 4; r++) {
      let sum = 0;
      for (let k = 0; k < 4; k++) sum += a[k * 4 + r] * b[c * 4 + k];
      out[c * 4 + r] = sum;
    }
  return out;
}

export class Camera {
  constructor() {
    this.target = [0, 0, 0];
    this.yaw = 0.7;
    this.pitch = 0.5;
    this.distance = 30;
    this.field = 0.7;
    this.moved = true;
  }

  eye() {
    const { yaw, pitch, distance, target } = this;
    return [
      target[0] + distance * Math.cos(pitch) * Math.sin(yaw),
      target[1] + distance * Math.sin(pitch),
      target[2] + distance * Math.cos(pitch) * Math.cos(yaw),
    ];
  }

  axes() {
    const forward = unit(sub(this.target, this.eye()));
    const right = unit(cross(forward, [0, 1, 0]));
    return { forward, right, up: cross(right, forward) };
  }

  matrix(aspect) {
    const eye = this.eye(), { forward: f, right: r, up: u } = this.axes();
    const look = new Float32Array([r[0], u[0], -f[0], 0, r[1], u[1], -f[1], 0, r[2], u[2], -f[2], 0, -dot(r, eye), -dot(u, eye), dot(f, eye), 1]);
    const near = Math.max(0.02, this.distance * 0.01), far = this.distance * 60 + 400, t = 1 / Math.tan(this.field / 2);
    // On narrow screens the horizontal field of view does not shrink.
    const scale = aspect < 1.2 ? t * aspect / 1.2 : t;
    const view = new Float32Array([scale / aspect, 0, 0, 0, 0, scale, 0, 0, 0, 0, (near + far) / (near - far), -1, 0, 0, 2 * near * far / (near - far), 0]);
    return times(view, look);
  }

  turn(dx, dy) {
    this.yaw -= dx;
    this.pitch = Math.min(1.55, Math.max(-1.4, this.pitch + dy));
    this.moved = true;
  }

  shift(dx, dy) {
    const { right, up } = this.axes(), k = this.distance * this.field;
    for (let i = 0; i < 3; i++) this.target[i] += k * (dy * up[i] - dx * right[i]);
    this.moved = true;
  }

  walk(ahead, aside) {
    const k = this.distance * 0.05, s = Math.sin(this.yaw), c = Math.cos(this.yaw);
    this.target[0] += k * (-ahead * s + aside * c);
    this.target[2] += k * (-ahead * c - aside * s);
    this.moved = true;
  }

  zoom(factor) {
    this.distance = Math.min(1e5, Math.max(0.2, this.distance * factor));
    this.moved = true;
  }

  fit(min, max) {
    this.target = [0, 1, 2].map((i) => (min[i] + max[i]) / 2);
    this.distance = Math.max(3, 0.75 * Math.hypot(...sub(max, min)) / Math.tan(this.field / 2) / 1.35);
    this.moved = true;
  }

  // Listens to mouse, fingers and keys. Calls `tap` with the place of a click, and `shifted` when the target was moved.
  listen(canvas, tap, shifted) {
    const fingers = new Map();
    let travelled = 0;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      canvas.focus({ preventScroll: true });
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      travelled = fingers.size > 1 ? 1e9 : 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      const now = [event.clientX, event.clientY], dx = now[0] - before[0], dy = now[1] - before[1];
      travelled += Math.abs(dx) + Math.abs(dy);
      const height = canvas.clientHeight;
      if (fingers.size === 2) {
        const other = [...fingers].find(([id]) => id !== event.pointerId)[1];
        const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
        this.zoom(apart(before) / apart(now));
        this.shift(dx / height / 2, dy / height / 2);
        shifted();
      } else if (event.shiftKey || event.buttons & 6) {
        this.shift(dx / height, dy / height);
        shifted();
      } else {
        this.turn(dx * 0.006, dy * 0.006);
      }
      fingers.set(event.pointerId, now);
    });
    const up = (event) => {
      if (fingers.delete(event.pointerId) && event.type === "pointerup" && travelled < 6) tap(event.clientX, event.clientY);
    };
    canvas.addEventListener("pointerup", up);
    canvas.addEventListener("pointercancel", up);
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(Math.max(-60, Math.min(60, event.deltaY)) * 0.003));
    }, { passive: false });
    const keys = {
      ArrowLeft: () => this.turn(0.06, 0), ArrowRight: () => this.turn(-0.06, 0),
      ArrowUp: () => this.turn(0, 0.05), ArrowDown: () => this.turn(0, -0.05),
      w: () => this.walk(1, 0), s: () => this.walk(-1, 0), a: () => this.walk(0, -1), d: () => this.walk(0, 1),
      "+": () => this.zoom(0.9), "=": () => this.zoom(0.9), "-": () => this.zoom(1.1),
    };
    canvas.addEventListener("keydown", (event) => {
      const key = keys[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      if (!key || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      key();
      if ("wasd".includes(event.key.toLowerCase())) shifted();
    });
  }
}
