// Bundled into three.min.js (three 0.187) by:
//   esbuild three.entry.js --bundle --minify --format=iife --global-name=THREE \
//     --legal-comments=none --outfile=three.min.js
export {
  AmbientLight, BufferAttribute, BufferGeometry, Color, DirectionalLight, DoubleSide, EqualDepth,
  Group, HemisphereLight, LineBasicMaterial, LineSegments, Matrix4, Mesh, MeshLambertMaterial,
  PerspectiveCamera, Points, PointsMaterial, Scene, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
