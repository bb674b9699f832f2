"use strict";
// The arm and its targets on a canvas. The view can be turned, and the targets dragged.

const COLOURS = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b07d00", "#56b4e9", "#999933", "#aa4499"];

function make(tag, properties, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

// Fit the pixels of a canvas to the screen. Returns the context, width and height.
function sheet(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const { clientWidth: width, clientHeight: height } = canvas;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  return [context, width, height];
}

const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name);

class Picture {
  constructor(loop) {
    this.loop = loop;
    this.view = [-0.98, 0.38]; // azimuth and elevation of the eye, rad
    const hints = [];
    if (data.targets.length) hints.push(`drag the dashed target${data.targets.length > 1 ? "s" : ""}`);
    if (!data.picture.flat) hints.push("drag the background or press arrow keys to turn the view");
    this.canvas = make("canvas", { className: "arm", tabIndex: data.picture.flat ? -1 : 0 });
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `Drawing of the arm${hints.length ? "; " + hints.join("; ") : ""}`);
    this.hint = hints.join("; ");
    if (hints.length) this.canvas.style.touchAction = "none";
    this.canvas.onpointerdown = (event) => this.begin(event);
    this.canvas.onpointermove = (event) => this.drag?.(event);
    this.canvas.onpointerup = this.canvas.onpointercancel = () => (this.drag = null);
    this.canvas.onkeydown = (event) => {
      const turn = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1] }[event.key];
      if (turn && !data.picture.flat) {
        this.turn(...turn);
        event.preventDefault();
      }
    };
  }

  turn(azimuth, elevation) {
    this.view = [this.view[0] + azimuth, Math.max(-1.5, Math.min(1.5, this.view[1] + elevation))];
  }

  // The coordinates of a vector on the picture, m.
  project(p) {
    if (data.picture.flat) return data.picture.flat.map((i) => p[i]);
    const [[sa, ca], [se, ce]] = this.view.map((a) => [Math.sin(a), Math.cos(a)]);
    return [-sa * p[0] + ca * p[1], -se * (ca * p[0] + sa * p[1]) + ce * p[2]];
  }

  get scale() {
    return (0.46 * this.canvas.clientWidth) / data.picture.reach;
  }

  // The pixel of a point.
  pixel(p) {
    const [u, v] = this.project(p.map((x, i) => x - data.picture.centre[i]));
    return [this.canvas.clientWidth / 2 + this.scale * u, this.canvas.clientHeight / 2 - this.scale * v];
  }

  // The point at a frame's target. Coordinates without a target are those of the frame.
  targetPoint(lines, target) {
    const point = [...lines.find((line) => line.frame === target.frame).ends[1]];
    target.axes.forEach((axis, i) => {
      if ("xyz".includes(axis)) point["xyz".indexOf(axis)] = this.loop.target(target.first + i);
    });
    return point;
  }

  targetJoints(target) {
    return data.joints.map((_, i) => this.loop.target(target.first + i));
  }

  begin(event) {
    const at = [event.offsetX, event.offsetY];
    const distance = (p) => Math.hypot(p[0] - at[0], p[1] - at[1]);
    const grip = data.targets.map((target) => this.grip(target, distance)).find(Boolean);
    if (!grip && data.picture.flat) return;
    this.canvas.setPointerCapture(event.pointerId);
    let last = at;
    this.drag = (move) => {
      const by = [move.offsetX - last[0], move.offsetY - last[1]];
      last = [move.offsetX, move.offsetY];
      if (grip) grip([by[0] / this.scale, -by[1] / this.scale]);
      else this.turn(-0.008 * by[0], 0.008 * by[1]);
    };
  }

  // The function that moves a target by a displacement on the picture, m; nothing if the target is not near the pointer.
  grip(target, distance) {
    const move = (i, by) => this.loop.setTarget(target.first + i, this.loop.target(target.first + i) + by);
    if (target.kind === "frame") {
      if (distance(this.pixel(this.targetPoint(this.loop.lines(), target))) > 30) return null;
      const columns = target.axes.map((a) => ("xyz".includes(a) ? this.project([..."xyz"].map((b) => (a === b ? 1 : 0))) : [0, 0]));
      return (by) => {
        // The smallest change of the coordinates with this displacement.
        const sum = (i, j) => columns.reduce((s, c) => s + c[i] * c[j], i === j ? 1e-9 : 0);
        const [a, b, d] = [sum(0, 0), sum(0, 1), sum(1, 1)];
        const det = a * d - b * b;
        const w = [(d * by[0] - b * by[1]) / det, (a * by[1] - b * by[0]) / det];
        columns.forEach((c, i) => move(i, c[0] * w[0] + c[1] * w[1]));
      };
    }
    const lines = this.loop.lines(this.targetJoints(target));
    const near = lines.map((line, k) => [distance(this.pixel(line.ends[1])), k]).filter(([, k]) => lines[k].mover >= 0);
    const [pixels, k] = near.sort((a, b) => a[0] - b[0])[0] ?? [Infinity];
    const i = lines[k]?.mover;
    if (pixels > 30 || (data.picture.parents && data.picture.parents.length !== JOINTS)) return null;
    return (by) => {
      // The change of the joint whose motion on the picture is closest to the displacement.
      const q = this.targetJoints(target);
      const end = () => this.project(this.loop.lines(q)[k].ends[1]);
      const from = end();
      q[i] += 1e-4;
      const slope = end().map((x, axis) => (x - from[axis]) / 1e-4);
      const square = slope[0] ** 2 + slope[1] ** 2;
      if (square > 1e-6) move(i, (slope[0] * by[0] + slope[1] * by[1]) / square);
    };
  }

  draw() {
    const [context, width] = sheet(this.canvas);
    const stroke = (lines, style, thickness, dashes = []) => {
      context.setLineDash(dashes);
      Object.assign(context, { strokeStyle: style, lineWidth: thickness, lineCap: "round" });
      for (const { ends, slides } of lines) {
        context.lineWidth = slides ? Math.max(1.5, thickness / 2) : thickness;
        context.beginPath();
        context.moveTo(...this.pixel(ends[0]));
        context.lineTo(...this.pixel(ends[1]));
        context.stroke();
      }
    };
    const dot = (p, radius, style) => {
      context.fillStyle = style;
      context.beginPath();
      context.arc(...this.pixel(p), radius, 0, 2 * Math.PI);
      context.fill();
    };
    const [text, accent, lines] = [colour("--text"), colour("--accent"), this.loop.lines()];
    const length = 0.25 * data.picture.reach;
    const axes = [0, 1, 2].filter((i) => data.picture.flat?.includes(i) ?? true).map((i) => [0, 1, 2].map((j) => (i === j ? length : 0)));
    stroke(axes.map((end) => ({ ends: [[0, 0, 0], end] })), colour("--line"), 1);
    Object.assign(context, { font: "12px system-ui, sans-serif", fillStyle: text, textAlign: "center", textBaseline: "middle" });
    axes.forEach((end) => context.fillText("xyz"[end.findIndex((x) => x > 0)], ...this.pixel(end.map((x) => 1.15 * x))));
    for (const target of data.targets.filter((t) => t.kind === "joints")) stroke(this.loop.lines(this.targetJoints(target)), accent, 2, [5, 5]);
    stroke(lines, text, Math.max(3, width / 90));
    lines.forEach(({ ends }) => dot(ends[0], Math.max(3, width / 110), COLOURS[0]));
    dot(lines[lines.length - 1].ends[1], Math.max(3, width / 130), COLOURS[1]);
    for (const target of data.targets.filter((t) => t.kind === "frame")) {
      const [x, y] = this.pixel(this.targetPoint(lines, target));
      context.setLineDash([4, 3]);
      Object.assign(context, { strokeStyle: accent, lineWidth: 2 });
      context.beginPath();
      context.arc(x, y, 11, 0, 2 * Math.PI);
      for (const [dx, dy] of [[16, 0], [0, 16]]) {
        context.moveTo(x - dx, y - dy);
        context.lineTo(x + dx, y + dy);
      }
      context.stroke();
      context.fillStyle = accent;
      if (data.targets.length > 1) context.fillText(target.name, x, y - 24);
    }
  }
}
