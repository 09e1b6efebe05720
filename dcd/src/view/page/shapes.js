// The geometries of which bodies are made. A vertex has a place, a side (of capsules: which end) and a normal, which is 0, 0, 0 where it is
// that of the face.

export const BOX = 0, BALL = 1, CAPSULE = 2, CYLINDER = 3, CONE = 4, PLANE = 5, FIRST_MESH = 8;

const mesh = () => ({ vertices: [], indices: [] });

function put(to, at, normal, side = 0) {
  to.vertices.push(...at, side, ...normal);
  return to.vertices.length / 7 - 1;
}

// The three visible faces of a box: the shader mirrors them towards the eye, and computes their normals.
function box() {
  const to = mesh();
  for (let i = 0; i < 8; i++) put(to, [0, 1, 2].map((k) => (i >> k & 1 ? 1 : -1)), [0, 0, 0]);
  for (const [a, b, c, d] of [[1, 3, 7, 5], [2, 6, 7, 3], [4, 5, 7, 6]]) to.indices.push(a, b, c, a, c, d);
  return to;
}

// A sphere of rings; a capsule's halves are pulled apart at the equator.
function ball(rings, split) {
  const to = mesh(), around = 2 * rings, rows = [];
  const row = (angle, side) => {
    const indices = [];
    for (let i = 0; i <= around; i++) {
      const turn = 2 * Math.PI * i / around, r = Math.cos(angle);
      const n = [r * Math.sin(turn), Math.sin(angle), r * Math.cos(turn)];
      indices.push(put(to, n, n, side));
    }
    rows.push(indices);
  };
  for (let i = 0; i <= rings; i++) {
    const angle = Math.PI * (i / rings - 0.5);
    if (split && 2 * i === rings) { row(0, -1); row(0, 1); } else row(angle, split ? Math.sign(2 * i - rings) : 0);
  }
  for (let r = 1; r < rows.length; r++)
    for (let i = 0; i < around; i++) {
      const [a, b, c, d] = [rows[r - 1][i], rows[r - 1][i + 1], rows[r][i + 1], rows[r][i]];
      if (r > 1) to.indices.push(a, b, c);
      if (r < rows.length - 1) to.indices.push(a, c, d);
    }
  return to;
}

function cylinder(sides, top) {
  const to = mesh();
  const slope = top ? [0, 1] : [1 / Math.hypot(1, 2), 2 / Math.hypot(1, 2)];
  for (let i = 0; i < sides; i++) {
    const ring = (k) => { const t = 2 * Math.PI * k / sides; return [Math.sin(t), Math.cos(t)]; };
    const [x, z] = ring(i), [u, w] = ring(i + 1);
    const normal = (p) => [p[0] * slope[1], slope[0], p[1] * slope[1]];
    const a = put(to, [x, -1, z], normal([x, z])), b = put(to, [u, -1, w], normal([u, w]));
    if (top) {
      const c = put(to, [u, 1, w], normal([u, w])), d = put(to, [x, 1, z], normal([x, z]));
      to.indices.push(a, b, c, a, c, d);
      to.indices.push(put(to, [0, 1, 0], [0, 1, 0]), put(to, [x, 1, z], [0, 1, 0]), put(to, [u, 1, w], [0, 1, 0]));
    } else {
      to.indices.push(a, b, put(to, [0, 1, 0], normal(ring(i + 0.5))));
    }
    to.indices.push(put(to, [0, -1, 0], [0, -1, 0]), put(to, [u, -1, w], [0, -1, 0]), put(to, [x, -1, z], [0, -1, 0]));
  }
  return to;
}

function plane() {
  const to = mesh(), n = [0, 1, 0], far = 2000;
  const corners = [[-far, 0, far], [far, 0, far], [far, 0, -far], [-far, 0, -far]].map((at) => put(to, at, n));
  to.indices.push(corners[0], corners[1], corners[2], corners[0], corners[2], corners[3]);
  return to;
}

// Returns a primitive, finer where few are drawn.
export function primitive(number, count) {
  const fine = count > 6000 ? 0 : count > 1000 ? 1 : 2;
  switch (number) {
    case BOX: return box();
    case BALL: return ball([6, 10, 20][fine], false);
    case CAPSULE: return ball([6, 8, 16][fine], true);
    case CYLINDER: return cylinder([10, 16, 40][fine], true);
    case CONE: return cylinder([10, 16, 40][fine], false);
    default: return plane();
  }
}

// Returns a mesh of the stream. Triangles whose last two corners are the same are lines.
export function custom({ vertices, triangles }) {
  const to = { vertices: new Float32Array(vertices.length / 3 * 7), indices: triangles, lines: false };
  for (let i = 0; 3 * i < vertices.length; i++) to.vertices.set(vertices.subarray(3 * i, 3 * i + 3), 7 * i);
  if (triangles.length > 0 && triangles[1] === triangles[2]) {
    to.lines = true;
    to.indices = new Uint32Array(triangles.length / 3 * 2).map((_, i) => triangles[Math.floor(i / 2) * 3 + i % 2]);
  }
  return to;
}
