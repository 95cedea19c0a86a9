/* The viewer of a geneoh page: reads the packed scene, draws its versions, plays and scrubs. */
"use strict";
(async () => {
const $ = (id) => document.getElementById(id);
const scene = JSON.parse($("scene").textContent);
const T = scene.frames;

// ---- data -------------------------------------------------------------------------------------
async function unpacked(text) {
  const letters = atob(text), raw = new Uint8Array(letters.length);
  for (let i = 0; i < raw.length; i++) raw[i] = letters.charCodeAt(i);
  const stream = new Blob([raw]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}
const bytes = await unpacked($("data").textContent.trim());
const ARRAY_TYPES = { uint8: Uint8Array, uint16: Uint16Array, uint32: Uint32Array };

/** An array as it was packed: its lowest bytes first, differences from frame to frame. */
function array(place) {
  const Type = ARRAY_TYPES[place.type], width = Type.BYTES_PER_ELEMENT;
  const count = place.shape.reduce((a, b) => a * b, 1), values = new Type(count);
  for (let b = 0; b < width; b++) {
    const start = place.at + b * count, shift = 8 * b;
    for (let i = 0; i < count; i++) values[i] |= bytes[start + i] << shift;
  }
  if (place.delta) {
    const row = count / place.shape[0];
    for (let i = row; i < count; i++) values[i] += values[i - row];
  }
  return values;
}
for (const part of scene.parts) {
  const points = Float32Array.from(array(part.verts), (v, i) => v * part.step + part.low[i % 3]);
  part.mesh = new DrawnMesh(points, array(part.faces));
  part.mesh.ramp.fill(part.limb ? 255 : 0);
}
for (const version of scene.versions)
  for (const hand of version.hands) {
    hand.steps = array(hand.verts);
    hand.mesh = new DrawnMesh(new Float32Array(hand.steps.length / T), array(hand.faces));
    for (const name in hand.ramps) hand.ramps[name] = array(hand.ramps[name]);
  }
for (const side in scene.samples) {
  const place = scene.samples[side];
  scene.samples[side] = { count: place.shape[1], steps: array(place) };
}
const sampleCount = Math.max(0, ...Object.values(scene.samples).map((s) => s.count));
const names = scene.versions.length > 1 ? ["before", "after"] : ["after"];

// means leave out what the input lacks, so that before and after compare the same frames
const counted = scene.filled.some(Boolean) ? ", without those filled in" : "";
// reports measure acceleration at 30 frames a second, whatever the rate of the clip
const rate = Math.abs(scene.fps - 30) < 0.05 ? "" : ` at ${+scene.fps.toFixed(2)} fps`;
const ROWS = [
  { name: "penetration", title: "Deepest penetration, mm", digits: 1, mean: `Mean over the frames with a hand${counted}` },
  { name: "contact", title: "Fingertips in contact", digits: 0, mean: `Mean over the frames with contact${counted}` },
  { name: "acceleration", title: `Acceleration, mm/frame²${rate}`, digits: 1, mean: `Mean over the frames with a hand${counted}` },
  { name: "confidence", title: "Confidence in the object’s poses, %", digits: 0, mean: "Mean over all frames" },
].filter((row) => scene.versions[0].curves[row.name]);
for (const row of ROWS) {
  row.lines = scene.versions.map((version) => version.curves[row.name]);
  const all = row.lines.flat().filter((v) => v !== null).sort((a, b) => a - b);
  // one wild frame must not flatten all others
  const top = row.name === "acceleration" ? 1.15 * (all[Math.floor(0.98 * (all.length - 1))] ?? 1) : all.at(-1) ?? 1;
  row.top = Math.max(1e-6, top);
}
/** Depth in the object; undefined where there is none. */
const depthAt = (version, frame) => scene.versions[version].curves.penetration?.[frame];
/** The frame in which penetration was reduced most. */
function mostImprovedFrame() {
  let best = 0, most = -Infinity;
  for (let t = 0; t < T; t++) {
    const gain = (depthAt(0, t) ?? 0) - (names.length > 1 ? depthAt(1, t) ?? 0 : 0);
    if (gain > most + 1e-9) { most = gain; best = t; }
  }
  return most > 0 ? best : 0;
}

// ---- state ------------------------------------------------------------------------------------
const LAYOUTS = { "side by side": "Side by side", overlaid: "Overlaid", before: "Before", after: "After" };
const layouts = names.length > 1 ? Object.keys(LAYOUTS) : names;
const COLOURINGS = { plain: "Plain skin", penetration: "Penetration", contact: "Contact", spread: "Expected error" };
const colourings = Object.keys(COLOURINGS).filter(
  (name) => name === "plain" || scene.versions.some((version) => version.hands.some((h) => name in h.ramps)));
const state = {
  frame: 0, playing: false, layout: layouts[0], colouring: colourings.find((name) => name !== "plain") ?? "plain", sample: -1,
  seeThrough: true, follow: true, dark: matchMedia("(prefers-color-scheme: dark)").matches, speed: 1,
};
const canvas = $("view"), pen = canvas.getContext("2d", { alpha: false, willReadFrequently: true });
const orbit = new Orbit(scene.camera);
const objectColours = palette(scene.partColours);
const palettes = Object.fromEntries(Object.entries(scene.scales).map(([name, s]) => [name, palette(s.ramp)]));
palettes.plain = palette([scene.skinColour]);

// ---- one frame --------------------------------------------------------------------------------
const STILL = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0];
function poseHand(hand) {
  const { points, ramp } = hand.mesh, start = state.frame * points.length, [x, y, z] = scene.low;
  for (let i = 0; i < points.length; i += 3) {
    points[i] = hand.steps[start + i] * scene.step + x;
    points[i + 1] = hand.steps[start + i + 1] * scene.step + y;
    points[i + 2] = hand.steps[start + i + 2] * scene.step + z;
  }
  hand.mesh.shade();
  const values = hand.ramps[state.colouring], count = ramp.length;
  if (values) ramp.set(values.subarray(state.frame * count, (state.frame + 1) * count));
  else ramp.fill(0);
}
function partPose(part) {
  const [w, x, y, z] = part.quat[state.frame];
  return [
    1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
    2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
    2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y),
    ...part.translation[state.frame]];
}
let held = null;
/** What the camera looks at: the hands in this frame, or where they were when following ended. */
const target = () => held ?? scene.camera.targets[state.frame];
const timeText = (frame) => `${frame} / ${T - 1} · ${(frame / scene.fps).toFixed(2)} s`;
function goTo(frame) {
  state.frame = Math.max(0, Math.min(T - 1, frame));
  for (const version of scene.versions)
    for (const hand of version.hands) if (hand.valid[state.frame]) poseHand(hand);
  $("frame").value = state.frame;
  $("time").textContent = timeText(state.frame);
  showNumbers();
  changed();
}

// ---- drawing ----------------------------------------------------------------------------------
/** Largest number of pixels of a picture at rest, and of one that moves. */
const MOST_STILL = 3e6, MOST_MOVING = 1.2e6;
/** Milliseconds that a moving picture may take, so that 30 of them fit into a second. */
const BUDGET = 14;
const small = () => innerWidth <= 700 && innerWidth < innerHeight;
let resolution = 1, sharp = false, changedAt = 0, stale = true;
function changed() {
  stale = true;
  sharp = false;
  changedAt = performance.now();
}
/** Pixels drawn per CSS pixel. */
function scale(box, moving) {
  const full = Math.min(devicePixelRatio || 1, 2) * (moving ? 1 : 2), most = moving ? MOST_MOVING : MOST_STILL;
  return Math.min(moving ? full * resolution : full, Math.sqrt(most / (box.width * box.height)));
}
const layers = new Map();
/** A cleared layer of this name, kept from picture to picture. */
function layer(name, width, height) {
  let found = layers.get(name);
  if (found?.width !== width || found?.height !== height) layers.set(name, (found = new Layer(width, height)));
  else found.clear();
  return found;
}
function drawHands(version, view, width, height) {
  const drawn = layer(version, width, height);
  for (const { mesh, valid } of scene.versions[version].hands)
    if (valid[state.frame]) {
      project(mesh, STILL, view, width, height);
      draw(mesh, drawn);
    }
  return drawn;
}
/** The versions in each panel, from left to right or from top to bottom. */
function panels() {
  if (state.layout === "overlaid") return [[1, 0]];
  if (state.layout === "side by side") return [[0], [1]];
  return [[names.indexOf(state.layout)]];
}
function render(moving) {
  const box = canvas.getBoundingClientRect(), shown = panels(), stacked = small();
  if (!box.width || !box.height) return;
  const s = scale(box, moving), across = stacked ? 1 : shown.length, along = stacked ? shown.length : 1;
  const width = Math.max(1, Math.round((box.width * s) / across));
  const height = Math.max(1, Math.round((box.height * s) / along));
  if (canvas.width !== width * across || canvas.height !== height * along) {
    canvas.width = width * across;
    canvas.height = height * along;
  }
  // the same camera in all panels: the object is drawn once
  const view = orbit.view(target(), width, height), object = layer("object", width, height);
  for (const part of scene.parts) {
    project(part.mesh, partPose(part), view, width, height);
    draw(part.mesh, object);
  }
  const image = pen.createImageData(width, height), pixels = new Uint32Array(image.data.buffer);
  shown.forEach(([version, other], panel) => {
    compose(pixels, state.dark ? 0xff25201c : 0xfff2f0ee, {
      object, objectColours, seeThrough: state.seeThrough, handColours: palettes[state.colouring],
      hand: drawHands(version, view, width, height), line: Math.max(1, Math.round(s)),
      other: other === undefined ? null : drawHands(other, view, width, height),
    });
    const left = stacked ? 0 : panel * width, top = stacked ? panel * height : 0;
    pen.putImageData(image, left, top);
    if (state.sample >= 0 && version === scene.versions.length - 1) drawSample(view, left, top, width, height, s);
  });
}
/** The bones of the chosen sample, drawn over the picture of the result. */
function drawSample({ axes, eye, focal }, left, top, width, height, s) {
  pen.save();
  pen.beginPath(); pen.rect(left, top, width, height); pen.clip();
  for (const { count, steps } of Object.values(scene.samples)) {
    if (state.sample >= count) continue;
    const start = (state.frame * count + state.sample) * 63;
    const at = scene.bones.map((_, j) => {
      const point = [0, 1, 2].map((c) => steps[start + 3 * j + c] * scene.step + scene.low[c] - eye[c]);
      const [x, y, z] = axes.map((axis) => dot(axis, point));
      return [left + width / 2 - (focal * x) / z, top + height / 2 + (focal * y) / z];
    });
    pen.strokeStyle = pen.fillStyle = state.dark ? "#f3e9ff" : "#3b1a5c";
    pen.lineWidth = 1.6 * s;
    pen.beginPath();
    scene.bones.forEach((parent, j) => { if (parent >= 0) { pen.moveTo(...at[parent]); pen.lineTo(...at[j]); } });
    pen.stroke();
    for (const [x, y] of at) { pen.beginPath(); pen.arc(x, y, 2.6 * s, 0, 7); pen.fill(); }
  }
  pen.restore();
}

// ---- text and curves --------------------------------------------------------------------------
/** A new element with a class and text; `inside` are its children. */
function made(tag, name = "", text = "", ...inside) {
  const one = document.createElement(tag);
  one.className = name;
  one.textContent = text;
  one.append(...inside);
  return one;
}
const shown = (value, digits) => (value === null || value === undefined ? "–" : value.toFixed(digits));
const values = [], depths = [];
function addMeasures() {
  const table = $("measures"), room = $("curves");
  for (const row of ROWS) {
    const box = made("div", "measure", "", made("span", "title", row.title));
    row.lines.forEach((line, i) => {
      const value = made("span", `value ${names[i]}`), name = names.length > 1 ? LAYOUTS[names[i]] : "now";
      const mean = made("span", "mean", `mean ${shown(scene.versions[i].means[row.name], 1)}`);
      mean.title = row.mean;
      box.append(made("span", names[i], "", made("span", "name", name)), value, mean);
      values.push({ value, line, digits: row.digits });
    });
    table.append(box);
    row.plot = document.createElement("canvas");
    room.insertBefore(row.plot, $("now"));
  }
}
function titles() {
  const overlaid = state.layout === "overlaid";
  depths.length = 0;
  $("titles").replaceChildren(...panels().map((versions) => {
    const left = made("div"), depth = made("div", "depth");
    for (const version of [...versions].sort()) {
      const name = names[version], note = overlaid && name === "before" ? ", transparent" : "";
      const head = names.length > 1 ? LAYOUTS[name] + note : "";
      left.append(made("div", name, "", made("b", "", head), made("span", "", scene.versions[version].title)));
      if (depthAt(version, 0) === undefined) continue;
      const dot = made("i"), number = made("strong");
      depth.append(number);
      depths.push({ version, dot, number });
    }
    return made("div", "", "", left, depth);
  }));
  $("titles").className = small() ? "stacked" : "";
  showNumbers();
}
const rgb = (c) => `rgb(${c.map((v) => Math.round(255 * v)).join(" ")})`;
function showNumbers() {
  for (const { value, line, digits } of values) value.textContent = shown(line[state.frame], digits);
  for (const { version, dot, number } of depths) {
    const words = state.layout === "overlaid" ? `inside ${names[version]}` : "inside";
    const depth = depthAt(version, state.frame), { ramp, limits } = scene.scales.penetration;
    dot.style.background = rgb(onRamp(ramp, Math.min(1, (depth ?? 0) / limits[1])));
    number.replaceChildren(dot, ...(depth === null ? ["no hand"] : [`${depth.toFixed(1)} mm `, made("small", "", words)]));
  }
  const width = $("curves").clientWidth - 2 * EDGE;
  $("now").style.transform = `translateX(${EDGE + (T > 1 ? (state.frame / (T - 1)) * width : width / 2)}px)`;
}
/** First and last frame of each run of frames that the input lacked. */
const filledRuns = [];
scene.filled.forEach((on, t) => {
  if (!on) return;
  if (scene.filled[t - 1]) filledRuns.at(-1)[1] = t;
  else filledRuns.push([t, t]);
});
/** Half of the slider's thumb: where the curves begin, so that both are aligned. */
const EDGE = 8;
function drawCurves() {
  const style = getComputedStyle(document.documentElement), ratio = devicePixelRatio || 1;
  const ink = (name) => style.getPropertyValue(name).trim(), phone = innerWidth <= 700;
  for (const { plot, lines, top } of ROWS) {
    const wide = plot.clientWidth, high = plot.clientHeight, pen = plot.getContext("2d");
    plot.width = Math.round(wide * ratio);
    plot.height = Math.round(high * ratio);
    pen.scale(ratio, ratio);
    const base = high - 3.5, room = base - (phone ? 19 : 5);
    const x = (t) => EDGE + (T > 1 ? (t / (T - 1)) * (wide - 2 * EDGE) : wide / 2 - EDGE);
    pen.fillStyle = ink("--filled");
    for (const [first, end] of filledRuns) pen.fillRect(x(first - 0.5), 0, x(end + 0.5) - x(first - 0.5), base);
    pen.strokeStyle = ink("--line");
    pen.beginPath(); pen.moveTo(EDGE, base + 0.5); pen.lineTo(wide - EDGE, base + 0.5); pen.stroke();
    lines.forEach((line, i) => {
      const path = new Path2D(), area = new Path2D();
      let last = null;
      line.forEach((v, t) => {
        if (v === null) { if (last !== null) area.lineTo(x(last), base); last = null; return; }
        const y = base - room * Math.min(1, v / top);
        // begun by a dot, so that a frame without neighbours is seen
        if (last === null) { path.moveTo(x(t) - 0.5, y); area.moveTo(x(t), base); }
        path.lineTo(last === null ? x(t) + 0.5 : x(t), y);
        area.lineTo(x(t), y);
        last = t;
      });
      if (last !== null) area.lineTo(x(last), base);
      pen.strokeStyle = pen.fillStyle = ink(`--${names[i]}`);
      pen.globalAlpha = 0.14;
      pen.fill(area);
      pen.globalAlpha = 1;
      pen.lineWidth = 1.5;
      pen.lineJoin = pen.lineCap = "round";
      pen.stroke(path);
    });
  }
}

// ---- controls ---------------------------------------------------------------------------------
function choices(id, names, chosen, onChoice) {
  const select = $(id);
  names.forEach(([value, text]) => select.add(new Option(text, value)));
  select.value = chosen;
  select.hidden = names.length < 2;
  select.addEventListener("change", () => onChoice(select.value));
}
function setLayout(name) {
  state.layout = name;
  $("layout").value = name;
  titles();
  changed();
}
function setColouring(name) {
  state.colouring = name;
  $("colouring").value = name;
  const legend = $("legend"), scale = scene.scales[name];
  legend.hidden = !scale;
  if (scale) {
    const bar = made("i");
    bar.style.background = `linear-gradient(90deg,${scale.ramp.map(rgb).join()})`;
    legend.replaceChildren(`${scale.title}  ${scale.labels[0]}`, bar, scale.labels[1]);
  }
  goTo(state.frame);
}
function setSample(index) {
  state.sample = index;
  $("sample").value = index;
  changed();
}
function setPlaying(on) {
  state.playing = on;
  $("play").textContent = on ? "Pause" : "Play";
}
/** Switch what a button of this name stands for. */
function toggle(name) {
  if (name === "follow") held = state.follow ? target() : null;
  state[name] = !state[name];
  $(name).setAttribute("aria-pressed", state[name]);
  changed();
}
function setDark(on) {
  state.dark = on;
  document.documentElement.classList.toggle("dark", on);
  $("theme").textContent = on ? "Light" : "Dark";
  drawCurves();
  changed();
}
function showKeys(on) {
  $("keys").hidden = !on;
  $("help").setAttribute("aria-expanded", on);
}
/** Turn and zoom the camera from its place now. */
function moveCamera(yaw, pitch, nearer = 1) {
  orbit.turn(yaw, pitch);
  orbit.nearer(nearer);
  changed();
}
const next = (names, now) => names[(names.indexOf(now) + 1) % names.length];
const step = (by) => { setPlaying(false); goTo(state.frame + by); };

const sides = scene.versions.at(-1).hands.map((hand) => hand.side).join(" and ");
$("about").textContent = `${T} frame${T === 1 ? "" : "s"} · ${(T / scene.fps).toFixed(1)} s · ${sides} hand`;
choices("layout", layouts.map((n) => [n, LAYOUTS[n]]), state.layout, setLayout);
choices("colouring", colourings.map((n) => [n, COLOURINGS[n]]), state.colouring, setColouring);
const numbers = Array.from({ length: sampleCount }, (_, i) => [i, `Sample ${i + 1}`]);
choices("sample", sampleCount > 1 ? [[-1, "Kept result"], ...numbers] : [], -1, (value) => setSample(Number(value)));
$("frame").max = T - 1;
// room for the longest text from the beginning on, so that the curves keep their width
$("time").textContent = timeText(T - 1);
$("time").style.minWidth = `${$("time").getBoundingClientRect().width}px`;
$("frame").addEventListener("input", (event) => { setPlaying(false); goTo(Number(event.target.value)); });
$("play").addEventListener("click", () => setPlaying(!state.playing));
$("speed").addEventListener("change", (event) => { state.speed = Number(event.target.value); });
$("seeThrough").addEventListener("click", () => toggle("seeThrough"));
$("follow").addEventListener("click", () => toggle("follow"));
$("theme").addEventListener("click", () => setDark(!state.dark));
$("help").addEventListener("click", () => showKeys($("keys").hidden));
const scrub = (event) => {
  const box = $("curves").getBoundingClientRect();
  setPlaying(false);
  goTo(Math.round(((event.clientX - box.left - EDGE) / (box.width - 2 * EDGE)) * (T - 1)));
};
$("curves").addEventListener("pointerdown", (event) => { $("curves").setPointerCapture(event.pointerId); scrub(event); });
$("curves").addEventListener("pointermove", (event) => { if (event.buttons) scrub(event); });
orbit.follow(canvas, () => Math.min(canvas.clientWidth, canvas.clientHeight), changed);

/** Radians by which a key turns the camera, and the factor by which it zooms. */
const TURN = 0.1, ZOOM = 1.15;
const keys = {
  " ": () => setPlaying(!state.playing),
  ArrowLeft: (event) => step(event.shiftKey ? -10 : -1),
  ArrowRight: (event) => step(event.shiftKey ? 10 : 1),
  Home: () => goTo(0),
  End: () => goTo(T - 1),
  v: () => setLayout(next(layouts, state.layout)),
  c: () => setColouring(next(colourings, state.colouring)),
  s: () => { if (sampleCount > 1) setSample(state.sample + 1 < sampleCount ? state.sample + 1 : -1); },
  x: () => toggle("seeThrough"),
  f: () => toggle("follow"),
  r: () => { orbit.reset(); changed(); },
  d: () => setDark(!state.dark),
  "+": () => moveCamera(0, 0, ZOOM),
  "=": () => moveCamera(0, 0, ZOOM),
  "-": () => moveCamera(0, 0, 1 / ZOOM),
  "?": () => $("help").click(),
  Escape: () => { showKeys(false); $("notes")?.removeAttribute("open"); },
};
/** With Shift on the picture: as a drag in the arrow's direction. */
const turns = {
  ArrowLeft: () => moveCamera(TURN, 0),
  ArrowRight: () => moveCamera(-TURN, 0),
  ArrowUp: () => moveCamera(0, -TURN),
  ArrowDown: () => moveCamera(0, TURN),
};
let pointed = false;
addEventListener("pointerdown", () => { pointed = true; }, true);
addEventListener("keydown", (event) => {
  pointed = false;
  const { key, target: on } = event;
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  // a list uses all keys itself, and Space presses what has the focus
  if (on.matches("select") || (key === " " && on.matches("button, summary"))) return;
  const act = (event.shiftKey && on === canvas && turns[key]) || keys[key.length > 1 ? key : key.toLowerCase()];
  if (!act) return;
  event.preventDefault();
  act(event);
});
// after a choice by mouse the next key is meant for the viewer, not for the list
addEventListener("change", ({ target }) => { if (pointed && target.matches("select")) target.blur(); });
addEventListener("resize", () => { titles(); drawCurves(); changed(); });

// ---- loop -------------------------------------------------------------------------------------
/** Pause after which a picture counts as being at rest, milliseconds. */
const REST = 160;
let before = performance.now(), ahead = 0;
function loop(now) {
  const spent = now - before;
  before = now;
  if (state.playing) {
    ahead += (Math.min(spent, 250) / 1000) * scene.fps * state.speed;
    const steps = Math.floor(ahead);
    ahead -= steps;
    if (steps) goTo((state.frame + steps) % T);
  }
  // a slow machine draws fewer pixels rather than fewer frames, and all of them at rest
  const moving = state.playing || performance.now() - changedAt < REST;
  if (stale || (!moving && !sharp)) {
    const start = performance.now();
    render(moving);
    const took = performance.now() - start;
    if (moving) resolution = Math.max(0.4, Math.min(1, resolution * Math.min(1.05, Math.max(0.8, BUDGET / took) ** 0.5)));
    stale = false;
    sharp = !moving;
  }
  requestAnimationFrame(loop);
}
addMeasures();
titles();
setDark(state.dark);
state.frame = mostImprovedFrame();
setColouring(state.colouring);
changedAt = -REST;
render(true);
window.geneoh = { state, scene, orbit, goTo, sharp: () => sharp };
document.body.dataset.ready = "yes";
requestAnimationFrame(loop);
})();
