// Loads a GLB into three.js, plays it to some times, prints where each mesh's vertices are then.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [, , modules, file, ...times] = process.argv;
const from = (path) => import(pathToFileURL(`${modules}/three/${path}`));
const { AnimationMixer, LoopOnce, Vector3 } = await from("build/three.module.js");
const { GLTFLoader } = await from("examples/jsm/loaders/GLTFLoader.js");

const bytes = readFileSync(file);
const whole = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
const { scene, animations } = await new GLTFLoader().parseAsync(whole, "");
const mixer = new AnimationMixer(scene);
const action = mixer.clipAction(animations[0]).setLoop(LoopOnce);
action.clampWhenFinished = true; // else the last frame may be the first one again
action.play();

const played = times.map((time) => {
  mixer.setTime(Number(time));
  scene.updateMatrixWorld(true);
  const found = {};
  scene.traverse((thing) => {
    if (!thing.isMesh) return;
    const count = thing.geometry.attributes.position.count, point = new Vector3();
    found[thing.name] = Array.from({ length: count }, (_, i) =>
      thing.getVertexPosition(i, point).applyMatrix4(thing.matrixWorld).toArray());
  });
  return found;
});
console.log(JSON.stringify(played));
