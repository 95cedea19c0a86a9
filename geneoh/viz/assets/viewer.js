/* The viewer of a geneoh page: reads the packed scene, draws its takes, plays and scrubs. */
(async () => {
"use strict";
const $ = (id) => document.getElementById(id);
const told = JSON.parse($("scene").textContent);

// ---- data -------------------------------------------------------------------------------------
async function unpacked(text) {
  const raw = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  const stream = new Blob([raw]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}
const bytes = await unpacked($("data").textContent.trim());
const KINDS = { uint8: Uint8Array, uint16: Uint16Array, uint32: Uint32Array };

function array(place) {
  const Kind = KINDS[place.type], width = Kind.BYTES_PER_ELEMENT;
  const count = place.shape.reduce((a, b) => a * b, 1), values = new Kind(count);
  for (let i = 0; i < count; i++) {
    let value = 0;
    for (let b = width - 1; b >= 0; b--) value = value * 256 + bytes[place.at + b * count + i];
    values[i] = value;
  }
  if (place.delta) {
    const row = count / place.shape[0];
    for (let i = row; i < count; i++) values[i] += values[i - row];
  }
  return values;
}
const T = told.frames;
for (const part of told.parts) {
  part.points = Float32Array.from(array(part.verts), (v, i) => v * part.step + part.low[i % 3]);
  part.index = array(part.faces);
}
for (const take of told.takes)
  for (const hand of take.hands) {
    hand.steps = array(hand.verts);
    hand.index = array(hand.faces);
    for (const name in hand.ramps) hand.ramps[name] = array(hand.ramps[name]);
  }
for (const side in told.samples) {
  const place = told.samples[side];
  told.samples[side] = { count: place.shape[1], steps: array(place) };
}
const colourings = ["plain", ...Object.keys(told.scales)].filter(
  (name) => name === "plain" || told.takes.some((t) => t.hands.some((h) => name in h.ramps)));
const sampleCount = Math.max(0, ...Object.values(told.samples).map((s) => s.count));
const kinds = told.takes.length > 1 ? ["before", "after"] : ["after"];

// ---- state ------------------------------------------------------------------------------------
const layouts = told.takes.length > 1 ? ["side by side", "overlaid", "before", "after"] : ["after"];
const small = () => innerWidth < 641;
const state = {
  frame: 0, playing: false, layout: layouts[0], colouring: "penetration", sample: -1,
  veil: true, follow: true, dark: matchMedia("(prefers-color-scheme: dark)").matches, speed: 1,
};
let stale = true;

// ---- scene ------------------------------------------------------------------------------------
const canvas = $("view");
const renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
let sharpness = Math.min(devicePixelRatio, 2);
renderer.setPixelRatio(sharpness);
renderer.autoClear = false;
const camera = new THREE.PerspectiveCamera(28, 1, 0.01, 20);
const controls = new THREE.OrbitControls(camera, canvas);
controls.addEventListener("change", () => { stale = true; });
const [right, up, back] = told.axes.map((axis) => new THREE.Vector3(...axis));
camera.up.copy(up);
const target = (frame) => new THREE.Vector3(...told.targets[frame].map((x) => x ?? 0));

const DISTANCE = told.radius / Math.sin((14 * Math.PI) / 180);
function firstView() {
  controls.target.copy(target(state.frame));
  camera.position.copy(controls.target).addScaledVector(back, DISTANCE * narrow());
  controls.update();
  stale = true;
}
/** How much farther away a panel that is narrower than high must be seen from. */
function narrow() {
  const box = canvas.getBoundingClientRect(), panels = state.layout === "side by side" ? 2 : 1;
  const wide = small() && panels === 2 ? [box.width, box.height / 2] : [box.width / panels, box.height];
  return Math.max(1, wide[1] / Math.max(1, wide[0]));
}

const skin = new THREE.Color().setRGB(...told.skin, "srgb");
function ramp(name) {
  const stops = told.scales[name].ramp.map((c) => new THREE.Color().setRGB(...c, "srgb"));
  const table = new Float32Array(256 * 3), mixed = new THREE.Color();
  for (let i = 0; i < 256; i++) {
    const at = (i / 255) * (stops.length - 1), low = Math.min(stops.length - 2, Math.floor(at));
    mixed.copy(stops[low]).lerp(stops[low + 1], at - low).toArray(table, 3 * i);
  }
  return table;
}
const ramps = Object.fromEntries(Object.keys(told.scales).map((name) => [name, ramp(name)]));

// Looking through the object: it is drawn solid, then the hands over it, then its nearest faces as a
// veil over the hands that lie behind them. Its inner and far faces never confuse the eye.
const VEIL = 0.34;
const objects = told.parts.map((part) => {
  const shape = new THREE.BufferGeometry();
  shape.setAttribute("position", new THREE.BufferAttribute(part.points, 3));
  shape.setIndex(new THREE.BufferAttribute(part.index, 1));
  shape.computeVertexNormals();
  const colour = new THREE.Color().setRGB(...told.objectColour, "srgb");
  const paint = new THREE.MeshLambertMaterial({ color: colour, side: THREE.DoubleSide });
  const solid = new THREE.Mesh(shape, paint);
  const front = new THREE.Mesh(shape, paint.clone()), veil = new THREE.Mesh(shape, paint.clone());
  front.material.colorWrite = false;
  front.renderOrder = 1;
  Object.assign(veil.material, { transparent: true, opacity: VEIL, depthFunc: THREE.EqualDepth });
  veil.renderOrder = 2;
  for (const thing of [solid, front, veil]) thing.matrixAutoUpdate = false;
  return { solid, front, veil, all: [solid, front, veil] };
});

function handMesh(hand) {
  const count = hand.steps.length / T;
  const shape = new THREE.BufferGeometry();
  shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(count), 3));
  shape.setAttribute("normal", new THREE.BufferAttribute(new Float32Array(count), 3));
  shape.setAttribute("color", new THREE.BufferAttribute(new Float32Array(count), 3));
  shape.setIndex(new THREE.BufferAttribute(hand.index, 1));
  const mesh = new THREE.Mesh(shape, new THREE.MeshLambertMaterial({ vertexColors: true }));
  mesh.frustumCulled = false;
  return mesh;
}
function skeleton() {
  const shape = new THREE.BufferGeometry();
  shape.setAttribute("position", new THREE.BufferAttribute(new Float32Array(21 * 3), 3));
  shape.setIndex(told.bones.flatMap((parent, i) => (parent < 0 ? [] : [parent, i])));
  const group = new THREE.Group();
  // drawn over the hand that it runs through
  const over = { depthTest: false, transparent: true };
  group.add(new THREE.LineSegments(shape, new THREE.LineBasicMaterial({ color: 0x1c2026, ...over })));
  group.add(new THREE.Points(shape, new THREE.PointsMaterial(
    { color: 0x8e24aa, size: 6, sizeAttenuation: false, ...over })));
  group.traverse((o) => { o.frustumCulled = false; o.renderOrder = 3; });
  group.userData.shape = shape;
  return group;
}
const world = new THREE.Scene();
world.add(new THREE.HemisphereLight(0xffffff, 0x8c8c94, 1.7));
const lamp = new THREE.DirectionalLight(0xffffff, 1.9);
world.add(lamp, lamp.target, ...objects.flatMap((thing) => thing.all));
for (const take of told.takes) {
  take.meshes = take.hands.map(handMesh);
  world.add(...take.meshes);
}
const skeletons = Object.entries(told.samples).map(([side, drawn]) => {
  const bones = skeleton();
  world.add(bones);
  return { bones, drawn, side };
});

// ---- one frame --------------------------------------------------------------------------------
function poseHand(hand, mesh) {
  const shown = hand.valid[state.frame] === 1;
  mesh.userData.there = shown;
  if (!shown) return;
  const place = mesh.geometry.attributes.position, row = place.array.length;
  const steps = hand.steps, start = state.frame * row, [x, y, z] = told.low;
  for (let i = 0; i < row; i += 3) {
    place.array[i] = steps[start + i] * told.step + x;
    place.array[i + 1] = steps[start + i + 1] * told.step + y;
    place.array[i + 2] = steps[start + i + 2] * told.step + z;
  }
  place.needsUpdate = true;
  mesh.geometry.computeVertexNormals();
}
function paintHand(hand, mesh) {
  const colour = mesh.geometry.attributes.color, values = hand.ramps[state.colouring];
  if (!values) {
    for (let i = 0; i < colour.array.length; i += 3) skin.toArray(colour.array, i);
  } else {
    const table = ramps[state.colouring], start = (state.frame * colour.array.length) / 3;
    for (let i = 0; i < colour.array.length; i += 3) {
      const at = 3 * values[start + i / 3];
      colour.array[i] = table[at];
      colour.array[i + 1] = table[at + 1];
      colour.array[i + 2] = table[at + 2];
    }
  }
  colour.needsUpdate = true;
}
function poseAll() {
  told.parts.forEach((part, i) => {
    const [w, qx, qy, qz] = part.quat[state.frame], t = part.translation[state.frame];
    const m = objects[i].solid.matrix;
    m.set(
      1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - w * qz), 2 * (qx * qz + w * qy), t[0],
      2 * (qx * qy + w * qz), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - w * qx), t[1],
      2 * (qx * qz - w * qy), 2 * (qy * qz + w * qx), 1 - 2 * (qx * qx + qy * qy), t[2],
      0, 0, 0, 1);
    for (const thing of objects[i].all) {
      thing.matrix.copy(m);
      thing.matrixWorldNeedsUpdate = true;
    }
  });
  for (const take of told.takes)
    take.hands.forEach((hand, i) => { poseHand(hand, take.meshes[i]); paintHand(hand, take.meshes[i]); });
  for (const { bones, drawn } of skeletons) {
    if (state.sample < 0 || state.sample >= drawn.count) continue;
    const place = bones.userData.shape.attributes.position;
    const start = (state.frame * drawn.count + state.sample) * 63;
    for (let i = 0; i < 63; i++) place.array[i] = drawn.steps[start + i] * told.step + told.low[i % 3];
    place.needsUpdate = true;
  }
}
let followed = null;
function goTo(frame) {
  state.frame = Math.max(0, Math.min(T - 1, frame));
  const now = target(state.frame);
  if (state.follow && followed) {
    const step = now.clone().sub(followed);
    camera.position.add(step);
    controls.target.add(step);
  }
  followed = now;
  poseAll();
  $("frame").value = state.frame;
  const seconds = (state.frame / told.fps).toFixed(2);
  $("time").textContent = `${state.frame} / ${T - 1}  ·  ${seconds} s`;
  stale = true;
  drawCurves();
}

// ---- drawing ----------------------------------------------------------------------------------
function panels() {
  const box = canvas.getBoundingClientRect(), w = box.width, h = box.height;
  const all = told.takes.map((_, i) => i);
  if (state.layout === "overlaid") return [{ x: 0, y: 0, w, h, takes: all }];
  if (state.layout !== "side by side") {
    return [{ x: 0, y: 0, w, h, takes: [kinds.indexOf(state.layout)] }];
  }
  if (small()) return all.map((i) => ({ x: 0, y: (1 - i) * (h / 2), w, h: h / 2, takes: [i] }));
  return all.map((i) => ({ x: (i * w) / 2, y: 0, w: w / 2, h, takes: [i] }));
}
function render() {
  const overlaid = state.layout === "overlaid";
  lamp.position.copy(camera.position).addScaledVector(right, -0.5 * DISTANCE).addScaledVector(up, 0.6 * DISTANCE);
  lamp.target.position.copy(controls.target);
  renderer.setScissorTest(true);
  for (const panel of panels()) {
    told.takes.forEach((take, i) => take.meshes.forEach((mesh) => {
      // overlaid, the hand as it came is a ghost around the clean one
      const ghost = overlaid && kinds[i] === "before";
      mesh.material.transparent = ghost;
      mesh.material.opacity = ghost ? 0.45 : 1;
      mesh.renderOrder = ghost ? 1 : 0;
    }));
    renderer.setViewport(panel.x, panel.y, panel.w, panel.h);
    renderer.setScissor(panel.x, panel.y, panel.w, panel.h);
    renderer.clear();
    camera.aspect = panel.w / panel.h;
    camera.updateProjectionMatrix();
    if (state.veil) {
      visible(panel, { solid: true, rest: false });
      renderer.render(world, camera);
      renderer.clearDepth();
    }
    visible(panel, { solid: !state.veil, rest: true });
    renderer.render(world, camera);
  }
}
/** What the next pass draws: the solid object, and the rest: hands, skeletons, the object's veil. */
function visible(panel, { solid, rest }) {
  for (const thing of objects) {
    thing.solid.visible = solid;
    thing.front.visible = thing.veil.visible = rest && state.veil;
  }
  told.takes.forEach((take, i) => take.meshes.forEach((mesh) => {
    mesh.visible = rest && panel.takes.includes(i) && mesh.userData.there;
  }));
  const last = panel.takes.includes(told.takes.length - 1);
  for (const { bones } of skeletons) bones.visible = rest && last && state.sample >= 0;
}
function resize() {
  const box = canvas.getBoundingClientRect();
  renderer.setSize(box.width, box.height, false);
  stale = true;
  drawCurves();
}

// ---- curves -----------------------------------------------------------------------------------
const ROWS = [
  { name: "penetration", title: "penetration, mm" },
  { name: "contact", title: "fingertips touching" },
  { name: "acceleration", title: "acceleration, mm/frame²" },
];
/** Over the hands of a take: the deepest, the sum of fingertips, the mean acceleration. */
function curve(take, name) {
  return Array.from({ length: T }, (_, t) => {
    const found = take.hands.filter((h) => h.valid[t]).map((h) => h.curves[name][t]).filter((v) => v !== null);
    if (!found.length) return null;
    if (name === "penetration") return Math.max(...found);
    const sum = found.reduce((a, b) => a + b, 0);
    return name === "contact" ? sum : sum / found.length;
  });
}
for (const row of ROWS) {
  row.lines = told.takes.map((take) => curve(take, row.name));
  const all = row.lines.flat().filter((v) => v !== null).sort((a, b) => a - b);
  // one wild frame must not flatten all others
  row.top = Math.max(1e-6, row.name === "acceleration" ? 1.15 * (all[Math.floor(0.98 * (all.length - 1))] ?? 1) : all.at(-1) ?? 1);
}
const LEFT = 4, RIGHT = 4;
function drawCurves() {
  const plot = $("curves"), box = plot.getBoundingClientRect(), scale = devicePixelRatio || 1;
  plot.width = Math.round(box.width * scale);
  plot.height = Math.round(box.height * scale);
  const pen = plot.getContext("2d"), style = getComputedStyle(document.documentElement);
  const ink = (name) => style.getPropertyValue(name).trim();
  pen.scale(scale, scale);
  pen.font = "12px system-ui, sans-serif";
  const high = box.height / ROWS.length, wide = box.width - LEFT - RIGHT;
  const x = (t) => LEFT + (T > 1 ? (t / (T - 1)) * wide : wide / 2);
  ROWS.forEach((row, r) => {
    const base = (r + 1) * high - 3, room = high - 18;
    pen.strokeStyle = ink("--line");
    pen.beginPath(); pen.moveTo(LEFT, base + 0.5); pen.lineTo(LEFT + wide, base + 0.5); pen.stroke();
    row.lines.forEach((line, i) => {
      pen.strokeStyle = ink(`--${kinds[i]}`);
      pen.lineWidth = 1.6;
      pen.beginPath();
      let down = false;
      line.forEach((v, t) => {
        if (v === null) { down = false; return; }
        const y = base - room * Math.min(1, v / row.top);
        if (down) pen.lineTo(x(t), y); else pen.moveTo(x(t), y);
        down = true;
      });
      pen.stroke();
    });
    let at = LEFT;
    const say = (words, colour) => {
      pen.fillStyle = colour;
      pen.fillText(words, at, r * high + 12);
      at += pen.measureText(words).width + 10;
    };
    say(row.title, ink("--faint"));
    row.lines.forEach((line, i) => {
      const v = line[state.frame];
      const digits = row.name === "contact" ? 0 : 1;
      say(`${kinds[i]} ${v === null ? "–" : v.toFixed(digits)}`, ink(`--${kinds[i]}`));
    });
  });
  pen.strokeStyle = ink("--ink");
  pen.lineWidth = 1;
  pen.beginPath(); pen.moveTo(x(state.frame), 0); pen.lineTo(x(state.frame), box.height); pen.stroke();
}

// ---- what the person does ---------------------------------------------------------------------
function choices(id, names, chosen, onChoice) {
  const select = $(id);
  names.forEach(([value, text]) => select.add(new Option(text, value)));
  select.value = chosen;
  select.addEventListener("change", () => onChoice(select.value));
}
function setLayout(name) {
  state.layout = name;
  $("layout").value = name;
  titles();
  stale = true;
}
function setColouring(name) {
  state.colouring = name;
  $("colouring").value = name;
  const legend = $("legend"), scale = told.scales[name];
  legend.hidden = !scale;
  if (scale) {
    const rgb = (c) => `rgb(${c.map((v) => Math.round(255 * v)).join(" ")})`;
    legend.innerHTML = `<div>${scale.title}</div><div class="bar"><span>${scale.ends[0]}</span>` +
      `<i style="background:linear-gradient(90deg,${scale.ramp.map(rgb).join()})"></i>` +
      `<span>${scale.ends[1]}</span></div>`;
  }
  goTo(state.frame);
}
function setSample(index) {
  state.sample = index;
  $("sample").value = index;
  goTo(state.frame);
}
function titles() {
  const words = { before: "Before", after: told.takes.length > 1 ? "After" : "" };
  const shown = state.layout === "overlaid" || state.layout === "side by side" ? kinds : [state.layout];
  const box = $("titles");
  box.replaceChildren(...shown.map((kind) => {
    const one = document.createElement("div"), name = document.createElement("small");
    one.className = kind;
    one.textContent = words[kind];
    name.textContent = told.takes[kinds.indexOf(kind)].title;
    one.append(name);
    return one;
  }));
  const stacked = small() && state.layout === "side by side";
  box.style.cssText = stacked ? "flex-direction:column;bottom:0" : "";
}
function setPlaying(on) {
  state.playing = on;
  $("play").textContent = on ? "Pause" : "Play";
}
function toggle(name, button) {
  state[name] = !state[name];
  $(button).setAttribute("aria-pressed", state[name]);
  followed = target(state.frame);
  stale = true;
}
function setDark(on) {
  state.dark = on;
  document.documentElement.classList.toggle("dark", on);
  $("theme").textContent = on ? "Light" : "Dark";
  renderer.setClearColor(on ? 0x1d2126 : 0xf1f2f3);
  stale = true;
  drawCurves();
}
const next = (names, now, step = 1) => names[(names.indexOf(now) + step + names.length) % names.length];

choices("layout", layouts.map((n) => [n, n]), state.layout, setLayout);
$("layout-choice").hidden = layouts.length < 2;
choices("colouring", colourings.map((n) => [n, n]), state.colouring, setColouring);
const sampleNames = [[-1, "kept result"], ...Array.from({ length: sampleCount }, (_, i) => [i, `${i + 1}`])];
choices("sample", sampleNames, -1, (value) => setSample(Number(value)));
$("sample-choice").hidden = sampleCount < 2;
$("frame").max = T - 1;
$("frame").addEventListener("input", (event) => { setPlaying(false); goTo(Number(event.target.value)); });
$("play").addEventListener("click", () => setPlaying(!state.playing));
$("speed").addEventListener("change", (event) => { state.speed = Number(event.target.value); });
$("veil").addEventListener("click", () => toggle("veil", "veil"));
$("follow").addEventListener("click", () => toggle("follow", "follow"));
$("theme").addEventListener("click", () => setDark(!state.dark));
$("help").addEventListener("click", () => { $("keys").hidden = !$("keys").hidden; });
const plot = $("curves");
const scrub = (event) => {
  const box = plot.getBoundingClientRect();
  setPlaying(false);
  goTo(Math.round(((event.clientX - box.left - LEFT) / (box.width - LEFT - RIGHT)) * (T - 1)));
};
plot.addEventListener("pointerdown", (event) => { plot.setPointerCapture(event.pointerId); scrub(event); });
plot.addEventListener("pointermove", (event) => { if (event.buttons) scrub(event); });

const keys = {
  " ": () => setPlaying(!state.playing),
  ArrowLeft: (event) => { setPlaying(false); goTo(state.frame - (event.shiftKey ? 10 : 1)); },
  ArrowRight: (event) => { setPlaying(false); goTo(state.frame + (event.shiftKey ? 10 : 1)); },
  Home: () => goTo(0),
  End: () => goTo(T - 1),
  v: () => setLayout(next(layouts, state.layout)),
  c: () => setColouring(next(colourings, state.colouring)),
  s: () => { if (sampleCount > 1) setSample(state.sample + 1 < sampleCount ? state.sample + 1 : -1); },
  x: () => toggle("veil", "veil"),
  f: () => toggle("follow", "follow"),
  r: firstView,
  d: () => setDark(!state.dark),
  "?": () => $("help").click(),
};
addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const act = keys[event.key.length > 1 ? event.key : event.key.toLowerCase()];
  if (!act) return;
  event.preventDefault();
  act(event);
});
addEventListener("resize", () => { titles(); resize(); });

// ---- loop -------------------------------------------------------------------------------------
let before = performance.now(), ahead = 0, slow = 0;
function loop(now) {
  const spent = (now - before) / 1000;
  before = now;
  if (state.playing) {
    ahead += Math.min(spent, 0.25) * told.fps * state.speed;
    const steps = Math.floor(ahead);
    ahead -= steps;
    if (steps) goTo((state.frame + steps) % T);
    // a machine without a GPU draws fewer pixels rather than fewer frames
    slow = spent > 1 / 25 ? slow + 1 : Math.max(0, slow - 1);
    if (slow > 15 && sharpness > 0.6) {
      sharpness = Math.max(0.6, sharpness * 0.75);
      renderer.setPixelRatio(sharpness);
      resize();
      slow = 0;
    }
  }
  if (stale) {
    stale = false;
    render();
  }
  requestAnimationFrame(loop);
}
setDark(state.dark);
resize();
titles();
setColouring(state.colouring);
followed = target(0);
firstView();
window.geneoh = { state, told, goTo };
document.body.dataset.ready = "yes";
requestAnimationFrame(loop);
})();
