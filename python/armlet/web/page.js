"use strict";
// The page: the picture, curves of the last seconds, buttons, and sliders for numbers and for the target.

const WINDOW = 10; // the length of the curves, s
const ROWS = 600; // the number of points of a curve
const BUDGET = 12; // the longest computation between two pictures, ms
const EVERY = Math.max(1, Math.round(WINDOW / ROWS / data.dt)); // the number of steps between two points

const rounded = (x) => String(Number(x.toPrecision(4)));

// The panels: a title, a unit, and curves with a name, a colour and a function of a row.
function panels() {
  const units = [...new Set(data.joints.map((j) => j.unit))];
  const of = (unit) => data.joints.map((j, i) => [j, i]).filter(([j]) => j.unit === unit);
  const force = (unit) => (data.input === "velocity" ? `${unit}/s` : unit === "m" ? "N" : "N m");
  const all = [];
  for (const unit of units) {
    const curves = of(unit).map(([j, i]) => ({ name: j.name, colour: COLOURS[i % 8], of: (row) => row.q[i] }));
    if (data.desired)
      curves.push(...of(unit).map(([, i], k) => ({ name: k ? "" : "desired", colour: COLOURS[i % 8], of: (row) => row.d[i], dashed: true })));
    all.push({ title: "Position", unit, curves });
  }
  for (const unit of units) {
    const curves = of(unit).map(([j, i]) => ({ name: j.name, colour: COLOURS[i % 8], of: (row) => row.r[i] }));
    all.push({ title: data.input === "velocity" ? "Commanded velocity" : "Input", unit: force(unit), curves });
  }
  const named = data.monitors.map((m, k) => [m, JOINTS + k]).filter(([m]) => m);
  const kind = (name) => (name.endsWith("balance") ? "Balance, zero in theory" : name.startsWith("error") ? "Error of each task" : "");
  for (const title of ["Error of each task", "", "Balance, zero in theory"]) {
    const chosen = named.filter(([[name]]) => kind(name) === title && name !== "passivity");
    const curves = chosen.map(([[name], k], i) => ({ name, colour: COLOURS[i], of: (row) => row.r[k] }));
    if (!curves.length) continue;
    const own = title || curves.map((c) => c.name).join(" and ");
    all.push({ title: own[0].toUpperCase() + own.slice(1), unit: chosen[0][0][1], curves });
  }
  return all;
}

class Curves {
  constructor(panel) {
    this.panel = panel;
    this.canvas = make("canvas", { className: "curve" });
    this.canvas.setAttribute("role", "img");
    const names = panel.curves.map((c) => c.name).filter(Boolean);
    this.canvas.setAttribute("aria-label", `${panel.title} in ${panel.unit} over time: ${names.join(", ")}`);
    const legend = make("div", { className: "legend" });
    for (const curve of panel.curves.filter((c) => c.name)) {
      const entry = make("span", { textContent: curve.name, className: curve.dashed ? "dashed" : "" });
      entry.style.setProperty("--colour", curve.dashed ? "currentColor" : curve.colour);
      legend.append(entry);
    }
    this.element = make("section", {}, make("h2", { textContent: `${panel.title} (${panel.unit})` }), this.canvas, legend);
  }

  draw(rows) {
    const [context, width, height] = sheet(this.canvas);
    const [left, right, top, bottom] = [58, width - 8, 10, height - 22];
    const [text, line] = [colour("--text"), colour("--line")];
    let [low, high] = [Infinity, -Infinity];
    for (const row of rows) {
      for (const curve of this.panel.curves) {
        low = Math.min(low, curve.of(row));
        high = Math.max(high, curve.of(row));
      }
    }
    if (!(low <= high)) return;
    const margin = 0.08 * (high - low) || Math.abs(high) * 0.1 || 1e-12;
    [low, high] = [low - margin, high + margin];
    const end = Math.max(WINDOW, rows[rows.length - 1].t);
    const x = (t) => left + ((t - end + WINDOW) / WINDOW) * (right - left);
    const y = (value) => bottom - ((value - low) / (high - low)) * (bottom - top);
    Object.assign(context, { font: "11px system-ui, sans-serif", fillStyle: text, strokeStyle: line, lineWidth: 1, textBaseline: "middle" });
    context.textAlign = "right";
    const step = tick((high - low) / 5);
    for (let value = Math.ceil(low / step) * step; value <= high; value += step) {
      context.strokeRect(left, y(value), right - left, 0);
      context.fillText(label(value, step), left - 5, y(value));
    }
    Object.assign(context, { textAlign: "center", textBaseline: "alphabetic" });
    for (let t = Math.ceil((end - WINDOW) / 2) * 2; t <= end - 0.4; t += 2) {
      context.strokeRect(x(t), top, 0, bottom - top);
      context.fillText(String(t), x(t), height - 7);
    }
    context.textAlign = "right";
    context.fillText("t (s)", right, height - 7);
    for (const curve of this.panel.curves) {
      Object.assign(context, { strokeStyle: curve.colour, lineWidth: 1.6 });
      context.setLineDash(curve.dashed ? [4, 3] : []);
      context.beginPath();
      for (const row of rows) context.lineTo(x(row.t), y(curve.of(row)));
      context.stroke();
    }
    context.setLineDash([]);
  }
}

// A round number near `x`.
function tick(x) {
  const power = 10 ** Math.floor(Math.log10(x));
  return [1, 2, 5, 10].find((k) => k * power >= x) * power;
}

function label(value, step) {
  if (Math.abs(value) < step / 2) return "0";
  const small = step < 1e-3 || step >= 1e5;
  return small ? value.toExponential(Math.max(0, Math.floor(Math.log10(Math.abs(value) / step) + 0.01))) : value.toFixed(Math.max(0, -Math.floor(Math.log10(step) + 0.01)));
}

// A slider with a label and an output. `value(position)` returns the number at a position, and `set` receives the position. The name in
// Python is shown when the pointer rests on the label.
function slider(text, name, unit, [min, max, step, position], value, set) {
  const id = `slider-${slider.count++}`;
  const output = make("output", { htmlFor: id });
  const input = make("input", { id, type: "range", min, max, step, value: position });
  const show = () => {
    output.textContent = `${rounded(value(Number(input.value)))} ${unit}`.trim();
    input.setAttribute("aria-valuetext", output.textContent);
  };
  input.oninput = () => {
    set(Number(input.value));
    show();
  };
  show();
  const element = make("div", { className: "control" }, make("label", { htmlFor: id, textContent: text, title: name }), output, input);
  // Show a number that was changed in another way.
  const refresh = (x) => {
    if (document.activeElement !== input || Math.abs(Number(input.value) - x) > step) input.value = x;
    show();
  };
  return { element, refresh };
}
slider.count = 0;

function controls(loop) {
  return data.controls.map((control) => {
    const columns = numbers(control.numbers);
    const set = (position) => control.slots.forEach((slot, j) => loop.set(slot, columns[position * control.slots.length + j]));
    const range = [0, control.values.length - 1, 1, control.position];
    return slider(control.label || control.name, control.name, control.unit, range, (position) => control.values[position], set).element;
  });
}

// One slider for each coordinate of the constant targets, and for each number of the force.
function targets(loop) {
  const all = [];
  const add = (name, unit, i, reach) => {
    const now = loop.target(i);
    const range = [now - reach, now + reach, reach / 100, now];
    all.push({ i, ...slider(name, "", unit, range, () => loop.target(i), (x) => loop.setTarget(i, x)) });
  };
  for (const target of data.targets) {
    const coordinates = target.axes?.map((axis) => [axis, axis.startsWith("r") ? "rad" : "m"]) ?? data.joints.map((j) => [j.name, j.unit]);
    const of = data.targets.length > 1 ? `target of ${target.name ?? "joints"}` : "target";
    const link = target.axes ? "" : data.targets.length > 1 ? ":" : " of";
    coordinates.forEach(([name, unit], i) => add(`${of}${link} ${name}`, unit, target.first + i, unit === "rad" ? Math.PI : data.picture.reach));
  }
  const [first, count] = data.groups.force;
  const names = ["force x", "force y", "force z", "moment x", "moment y", "moment z"].slice(0, count);
  const largest = Math.max(10, ...[...names.keys()].map((i) => 2 * Math.abs(loop.x[first + i])));
  const inPlane = (i) => !data.picture.flat || (i < 3 ? data.picture.flat.includes(i) : !data.picture.flat.includes(i - 3));
  names.forEach((name, i) => {
    if (inPlane(i)) add(name, i < 3 ? "N" : "N m", first - data.groups.exogenous[0] + i, largest);
  });
  return all;
}

async function main() {
  const { instance } = await WebAssembly.instantiate(bytes(data.wasm), {});
  const loop = new Loop(instance.exports);
  const picture = new Picture(loop);
  const curves = panels().map((panel) => new Curves(panel));
  const moved = targets(loop);
  const play = make("button", { type: "button", textContent: "Pause" });
  const reset = make("button", { type: "button", textContent: "Reset" });
  const speed = make("select", {}, ...[0.1, 0.25, 0.5, 1, 2, 5].map((x) => make("option", { value: x, textContent: `${x} ×`, selected: x === 1 })));
  speed.setAttribute("aria-label", "speed as a multiple of real time");
  const status = make("p", { className: "status" });
  const alert = make("p", { className: "alert" });
  alert.setAttribute("role", "alert");
  const buttons = make("div", { className: "buttons" }, play, reset, speed);
  const sliders = [...controls(loop), ...moved.map((m) => m.element)];
  document.querySelector("main").append(
    make("h1", { textContent: data.title }),
    make("p", { className: "about", textContent: data.about }),
    make(
      "div",
      { className: "columns" },
      make("div", {}, picture.canvas, make("p", { className: "hint", textContent: picture.hint }), buttons, status, alert, ...sliders),
      make("div", {}, ...curves.map((c) => c.element)),
    ),
  );
  const state = { loop, picture, rows: [], running: true, capacity: 0 };
  window.armlet = state;
  let [due, last, since, sinceTime, computed, computing] = [0, performance.now(), performance.now(), 0, 0, 0];
  const point = () => {
    const r = loop.record().slice();
    const d = data.desired ? loop.x.slice(data.groups.exogenous[0], data.groups.exogenous[0] + JOINTS) : [];
    state.rows.push({ t: loop.t, q: loop.group("state").slice(0, JOINTS), d, r });
    if (state.rows.length > ROWS + 1) state.rows.shift();
  };
  const restart = () => {
    loop.reset();
    [state.rows, due, sinceTime] = [[], 0, 0];
    alert.textContent = "";
    point();
  };
  const run = (running) => {
    state.running = running;
    play.textContent = running ? "Pause" : "Play";
  };
  play.onclick = () => {
    if (loop.fault) restart();
    run(!state.running);
  };
  reset.onclick = restart;
  // Compute the steps that are due. A slow computer computes fewer steps, and the loop is then slower than real time.
  const advance = (elapsed) => {
    due += Math.min(elapsed, 0.1) * Number(speed.value);
    const begin = performance.now();
    const from = loop.k;
    while (due >= data.dt) {
      loop.step();
      due -= data.dt;
      if (loop.k % EVERY === 0) {
        if (!loop.isValid()) break;
        point();
      }
      if (performance.now() - begin > BUDGET) due = 0;
    }
    computed += (loop.k - from) * data.dt;
    computing += (performance.now() - begin) / 1000;
    if (!loop.isValid()) {
      run(false);
      alert.textContent = `Stopped at t = ${rounded(loop.t)} s: ${loop.fault}. Change a control, then press Play.`;
    }
  };
  const frame = (now) => {
    if (state.running) advance((now - last) / 1000);
    last = now;
    if (now - since > 500) {
      const factor = (loop.t - sinceTime) / ((now - since) / 1000);
      if (computing > 0) state.capacity = computed / computing;
      status.textContent = state.running
        ? `t = ${loop.t.toFixed(1)} s, ${factor.toFixed(2)} × real time, at most ${Math.round(state.capacity)} ×`
        : `t = ${loop.t.toFixed(1)} s, paused`;
      [since, sinceTime, computed, computing] = [now, loop.t, 0, 0];
    }
    moved.forEach(({ i, refresh }) => refresh(loop.target(i)));
    if (!loop.fault) picture.draw();
    curves.forEach((c) => c.draw(state.rows));
    requestAnimationFrame(frame);
  };
  restart();
  requestAnimationFrame(frame);
}

main().catch((error) => {
  document.querySelector("main").append(make("p", { className: "alert", textContent: `This page cannot run its loop: ${error.message}` }));
});
