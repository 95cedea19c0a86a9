/* A camera that turns around a target, moved by mouse, fingers and keys. */
"use strict";
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const unit = (a) => { const length = Math.hypot(...a); return a.map((x) => x / length); };
const plus = (a, b, times = 1) => a.map((x, i) => x + times * b[i]);

class Orbit {
  /** Of the camera in the scene: `up` of the world, `back` from the target to the eye, `radius` of the
      ball that fills the shorter side of a picture, `fieldOfView` over that side. */
  constructor({ up, back, radius, fieldOfView }) {
    this.halfView = fieldOfView / 2;
    this.up = unit(up);
    this.first = { pitch: Math.asin(Math.max(-1, Math.min(1, dot(unit(back), this.up)))), back };
    this.level = unit(plus(back, this.up, -dot(back, this.up)));
    this.across = cross(this.up, this.level);
    this.radius = radius;
    this.reset();
  }
  reset() {
    this.yaw = 0;
    this.pitch = this.first.pitch;
    this.zoom = 1;
    this.shift = [0, 0, 0];
  }
  turn(yaw, pitch) {
    this.yaw += yaw;
    this.pitch = Math.max(-1.5, Math.min(1.5, this.pitch + pitch));
  }
  nearer(times) { this.zoom = Math.max(0.15, Math.min(8, this.zoom * times)); }
  /** Move the target by shares of the picture's shorter side. */
  slide(x, y) {
    const { axes } = this.view([0, 0, 0], 1, 1), size = (2 * this.radius) / this.zoom;
    this.shift = plus(plus(this.shift, axes[0], -x * size), axes[1], y * size);
  }
  /** Axes, eye and focal length in pixels, for a picture of this size that looks at a point. */
  view(target, width, height) {
    const level = plus(this.level.map((x) => x * Math.cos(this.yaw)), this.across, Math.sin(this.yaw));
    const back = plus(level.map((x) => x * Math.cos(this.pitch)), this.up, Math.sin(this.pitch));
    const right = unit(cross(this.up, back));
    const distance = this.radius / Math.sin(this.halfView) / this.zoom;
    const eye = plus(plus(target, this.shift), back, distance);
    const focal = Math.min(width, height) / 2 / Math.tan(this.halfView);
    return { axes: [right, cross(back, right), back], eye, focal };
  }
  /** Let an element's pointers and wheel move the camera; `size` is that of one picture. */
  follow(element, size, onChange) {
    const down = new Map();
    const spread = () => {
      const [a, b] = [...down.values()];
      return { far: Math.hypot(a.x - b.x, a.y - b.y), x: (a.x + b.x) / 2, y: (a.y + b.y) / 2 };
    };
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      down.set(event.pointerId, { x: event.clientX, y: event.clientY });
    });
    for (const end of ["pointerup", "pointercancel"])
      element.addEventListener(end, (event) => down.delete(event.pointerId));
    element.addEventListener("pointermove", (event) => {
      const last = down.get(event.pointerId);
      if (!last) return;
      const x = event.clientX - last.x, y = event.clientY - last.y;
      if (down.size === 2) {
        const was = spread();
        Object.assign(last, { x: event.clientX, y: event.clientY });
        const now = spread();
        this.nearer(now.far / Math.max(1, was.far));
        this.slide((now.x - was.x) / size(), (now.y - was.y) / size());
      } else {
        Object.assign(last, { x: event.clientX, y: event.clientY });
        if (event.buttons === 2 || event.shiftKey) this.slide(x / size(), y / size());
        else this.turn((-5 * x) / size(), (5 * y) / size());
      }
      onChange();
    });
    element.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.nearer(Math.exp(-event.deltaY * (event.deltaMode ? 0.03 : 0.0012)));
      onChange();
    }, { passive: false });
    element.addEventListener("contextmenu", (event) => event.preventDefault());
  }
}
