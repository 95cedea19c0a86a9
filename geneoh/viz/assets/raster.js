/* Triangles to pixels without WebGL, which a browser without a GPU lacks or runs at a few frames a
   second. A layer holds the nearest surface in each pixel; `compose` lays layers over one another.
   The same method as geneoh/viz/raster.py. */
"use strict";
const LIGHTS = [[-0.45, 0.65, 0.62, 0.62], [0.75, 0.1, 0.4, 0.22], [0.1, -0.8, 0.3, 0.1]].map(
  ([x, y, z, strength]) => {
    const length = strength / Math.hypot(x, y, z);
    return [x * length, y * length, z * length];
  });
const AMBIENT = 0.42, BRIGHTEST = 1.32;
const TONES = 64;

/** 1 / depth, brightness and position on the colour ramp of the nearest surface in each pixel. */
class Layer {
  constructor(width, height) {
    Object.assign(this, { width, height });
    this.near = new Float32Array(width * height);
    this.tone = new Uint16Array(width * height);
  }
  clear() { this.near.fill(0); }
}

/** A mesh whose points can be moved, with arrays for what is computed in each frame. */
class DrawnMesh {
  constructor(points, index) {
    const count = points.length / 3;
    Object.assign(this, { points, index, count });
    this.normals = new Float32Array(3 * count);
    this.screen = new Float32Array(3 * count);
    this.front = new Float32Array(count);
    this.back = new Float32Array(count);
    this.ramp = new Uint8Array(count);
    this.shade();
  }
  /** Normals of its points as they are now, weighted by the faces' areas. */
  shade() {
    const { points: p, index, normals } = this;
    normals.fill(0);
    for (let f = 0; f < index.length; f += 3) {
      const i = 3 * index[f], j = 3 * index[f + 1], k = 3 * index[f + 2];
      const ax = p[j] - p[i], ay = p[j + 1] - p[i + 1], az = p[j + 2] - p[i + 2];
      const bx = p[k] - p[i], by = p[k + 1] - p[i + 1], bz = p[k + 2] - p[i + 2];
      const x = ay * bz - az * by, y = az * bx - ax * bz, z = ax * by - ay * bx;
      normals[i] += x; normals[i + 1] += y; normals[i + 2] += z;
      normals[j] += x; normals[j + 1] += y; normals[j + 2] += z;
      normals[k] += x; normals[k + 1] += y; normals[k + 2] += z;
    }
    for (let i = 0; i < normals.length; i += 3) {
      const length = Math.hypot(normals[i], normals[i + 1], normals[i + 2]) || 1;
      normals[i] /= length; normals[i + 1] /= length; normals[i + 2] /= length;
    }
  }
}

/** Where the points of a mesh are in a picture, and how bright both of its sides are there.

    `pose` takes its points to the world: rotation row by row, then translation. */
function project(mesh, pose, view, width, height) {
  const { axes, eye, focal } = view, { points, normals, screen, front, back } = mesh;
  // rows of the camera's axes after the pose's rotation, so that points are turned once
  const m = new Float64Array(9), t = [0, 0, 0];
  for (let r = 0; r < 3; r++) {
    for (let c = 0; c < 3; c++)
      m[3 * r + c] = axes[r][0] * pose[c] + axes[r][1] * pose[3 + c] + axes[r][2] * pose[6 + c];
    for (let c = 0; c < 3; c++) t[r] += axes[r][c] * (pose[9 + c] - eye[c]);
  }
  const [m0, m1, m2, m3, m4, m5, m6, m7, m8] = m, [tx, ty, tz] = t;
  const [[l0, l1, l2], [l3, l4, l5], [l6, l7, l8]] = LIGHTS;
  for (let v = 0, i = 0; v < mesh.count; v++, i += 3) {
    const px = points[i], py = points[i + 1], pz = points[i + 2];
    const depth = -(m6 * px + m7 * py + m8 * pz + tz), near = depth > 1e-4 ? 1 / depth : 0;
    screen[i] = width / 2 + focal * (m0 * px + m1 * py + m2 * pz + tx) * near;
    screen[i + 1] = height / 2 - focal * (m3 * px + m4 * py + m5 * pz + ty) * near;
    screen[i + 2] = near;
    const a = normals[i], b = normals[i + 1], c = normals[i + 2];
    const nx = m0 * a + m1 * b + m2 * c, ny = m3 * a + m4 * b + m5 * c, nz = m6 * a + m7 * b + m8 * c;
    const key = l0 * nx + l1 * ny + l2 * nz, fill = l3 * nx + l4 * ny + l5 * nz;
    const rim = l6 * nx + l7 * ny + l8 * nz;
    front[v] = AMBIENT + Math.max(0, key) + Math.max(0, fill) + Math.max(0, rim);
    back[v] = AMBIENT + Math.max(0, -key) + Math.max(0, -fill) + Math.max(0, -rim);
  }
}

/** Draw a projected mesh into a layer, row by row of each triangle; both sides are drawn. */
function draw(mesh, layer) {
  const { index, screen, front, back, ramp } = mesh, { width, height, near, tone } = layer;
  const bright = (TONES - 0.01) / BRIGHTEST, along = (TONES - 0.01) / 255;
  for (let f = 0; f < index.length; f += 3) {
    let i = index[f], j = index[f + 1], k = index[f + 2];
    const z0 = screen[3 * i + 2], z1 = screen[3 * j + 2], z2 = screen[3 * k + 2];
    if (z0 === 0 || z1 === 0 || z2 === 0) continue;
    const x0 = screen[3 * i], y0 = screen[3 * i + 1];
    const ux = screen[3 * j] - x0, uy = screen[3 * j + 1] - y0;
    const vx = screen[3 * k] - x0, vy = screen[3 * k + 1] - y0;
    const area = ux * vy - vx * uy;
    if (!(Math.abs(area) > 1e-9)) continue;
    const shrink = 1 / area, light = area < 0 ? front : back;
    const dz1 = z1 - z0, dz2 = z2 - z0;
    const zx = (dz1 * vy - dz2 * uy) * shrink, zy = (dz2 * ux - dz1 * vx) * shrink;
    const b0 = light[i], db1 = light[j] - b0, db2 = light[k] - b0;
    const bx = bright * (db1 * vy - db2 * uy) * shrink, by = bright * (db2 * ux - db1 * vx) * shrink;
    const r0 = ramp[i], dr1 = ramp[j] - r0, dr2 = ramp[k] - r0;
    const rx = along * (dr1 * vy - dr2 * uy) * shrink, ry = along * (dr2 * ux - dr1 * vx) * shrink;
    // corners from top to bottom: the long edge on one side, two short ones on the other
    let swap;
    if (screen[3 * j + 1] < screen[3 * i + 1]) { swap = i; i = j; j = swap; }
    if (screen[3 * k + 1] < screen[3 * j + 1]) { swap = j; j = k; k = swap; }
    if (screen[3 * j + 1] < screen[3 * i + 1]) { swap = i; i = j; j = swap; }
    const ax = screen[3 * i], ay = screen[3 * i + 1], mx = screen[3 * j], my = screen[3 * j + 1];
    const cx = screen[3 * k], cy = screen[3 * k + 1];
    const long = (cx - ax) / (cy - ay), upper = (mx - ax) / (my - ay), lower = (cx - mx) / (cy - my);
    const bottom = Math.min(height, Math.ceil(cy - 0.5));
    for (let row = Math.max(0, Math.ceil(ay - 0.5)); row < bottom; row++) {
      const y = row + 0.5;
      const p = ax + (y - ay) * long, q = y < my ? ax + (y - ay) * upper : mx + (y - my) * lower;
      const first = Math.max(0, Math.ceil((p < q ? p : q) - 0.5));
      const end = Math.min(width, Math.ceil((p < q ? q : p) - 0.5));
      if (end <= first) continue;
      const right = first + 0.5 - x0, down = y - y0;
      let z = z0 + zx * right + zy * down, b = bright * b0 + bx * right + by * down;
      let r = along * r0 + rx * right + ry * down;
      for (let at = row * width + first, stop = row * width + end; at < stop; at++) {
        if (z > near[at]) {
          near[at] = z;
          const shade = b < 0 ? 0 : b > TONES - 1 ? TONES - 1 : b | 0;
          tone[at] = ((r < 0 ? 0 : r > TONES - 1 ? TONES - 1 : r | 0) << 6) | shade;
        }
        z += zx; b += bx; r += rx;
      }
    }
  }
}

/** The colour at a position from 0 to 1 on a ramp, a list of colours. */
function onRamp(ramp, position) {
  if (ramp.length === 1) return ramp[0];
  const at = position * (ramp.length - 1), low = Math.min(ramp.length - 2, Math.floor(at));
  return ramp[low].map((c, i) => c + (at - low) * (ramp[low + 1][i] - c));
}

/** Packed colours for each position on a ramp and each brightness. */
function palette(ramp) {
  const table = new Uint32Array(TONES * TONES);
  for (let r = 0; r < TONES; r++) {
    const base = onRamp(ramp, r / (TONES - 1));
    for (let b = 0; b < TONES; b++) {
      const light = (b * BRIGHTEST) / (TONES - 1), shine = 0.35 * Math.max(0, light - 1);
      const [red, green, blue] = base.map((c) => Math.round(255 * Math.min(1, c * Math.min(light, 1) + shine)));
      table[(r << 6) | b] = (255 << 24) | (blue << 16) | (green << 8) | red;
    }
  }
  return table;
}

/** Two packed colours mixed; `share` of the second one, a whole number to 256. */
function mixed(a, b, share) {
  const rest = 256 - share;
  const even = (((a & 0xff00ff) * rest + (b & 0xff00ff) * share) / 256) & 0xff00ff;
  const odd = (((a & 0xff00) * rest + (b & 0xff00) * share) / 256) & 0xff00;
  return (0xff000000 | even | odd) >>> 0;
}

/** Opacity of the object over skin behind its surface, of 256. */
const OVERLAY = 88;
/** The same over skin with a colour of its own, such as that of penetration, which must be seen. */
const OVERLAY_COLOURED = 14;
/** Opacity of the other version, of 256. */
const OTHER = 120;
/** Step in depth, metres, from which edge shading is darkest, and its opacity of 256. */
const EDGE_DEPTH = 0.03, EDGE_SHADING = 110;

/** Lay the object, the hands and those of the other version over the background, as packed pixels. */
function compose(pixels, background, { object, hand, other, objectColours, handColours, seeThrough, line }) {
  const { width, height } = object, skin = hand.near, solid = object.near;
  pixels.fill(background);
  for (let row = 0, at = 0; row < height; row++) {
    const inside = row >= line && row < height - line;
    for (let column = 0; column < width; column++, at++) {
      const h = skin[at], o = solid[at];
      if (h === 0 && o === 0) continue;
      const under = o === 0 ? 0 : objectColours[object.tone[at]];
      let colour = under;
      if (h > 0 && (seeThrough || h >= o)) {
        const tone = hand.tone[at];
        colour = handColours[tone];
        if (inside && column >= line && column < width - line) {
          const a = skin[at - line], b = skin[at + line];
          const c = skin[at - line * width], d = skin[at + line * width];
          const nearest = Math.max(a, b, c, d);
          if (nearest > h) {
            // metres between the two surfaces
            const step = (nearest - h) / (h * nearest);
            if (step > EDGE_DEPTH / 8)
              colour = mixed(colour, 0, (Math.min(1, step / EDGE_DEPTH) * EDGE_SHADING) | 0);
          }
        }
        if (h < o) colour = mixed(colour, under, tone >> 6 > 4 ? OVERLAY_COLOURED : OVERLAY);
      }
      pixels[at] = colour;
    }
  }
  if (!other) return;
  for (let at = 0; at < pixels.length; at++) {
    const n = other.near[at];
    if (n > 0 && n >= skin[at] && (seeThrough || n >= solid[at]))
      pixels[at] = mixed(pixels[at], handColours[other.tone[at]], OTHER);
  }
}
