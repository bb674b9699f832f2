"use strict";
// The loop of this page: its memory, its steps in WebAssembly, and the lines of its arm.

const data = JSON.parse(document.getElementById("data").textContent);
const LARGEST_ANGLE = 1e6; // beyond it, rad, sines are not valid
const JOINTS = data.joints.length;

const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
const numbers = (text) => new Float64Array(bytes(text).buffer);

function below(x) {
  // The largest number below a positive number.
  const bits = new BigInt64Array(new Float64Array([x]).buffer);
  bits[0] -= 1n;
  return new Float64Array(bits.buffer)[0];
}

// Round to a multiple of `step`, and halves away from zero.
function toResolution(x, step) {
  if (!step) return x;
  const [steps, whole] = [x / step, Math.trunc(x / step)];
  return (Math.abs(steps - whole) >= 0.5 ? whole + Math.sign(steps) : whole) * step;
}

class Loop {
  constructor(exports) {
    this.f = exports;
    this.x = new Float64Array(exports.memory.buffer);
    this.start = numbers(data.frame);
    this.breaks = [...new Set(data.motions.flatMap((m) => m.breaks ?? []))].filter((t) => t > 0).sort((a, b) => a - b);
    this.reset();
  }

  group(name) {
    const [first, count] = data.groups[name];
    return this.x.subarray(first, first + count);
  }

  reset() {
    this.x.set(this.start);
    Object.assign(this, { k: 0, passed: 0, referenced: false, fault: "", samples: [] });
  }

  get t() {
    return this.k * data.dt;
  }

  afterJump(t) {
    return this.passed ? Math.max(t, this.breaks[this.passed - 1]) : t;
  }

  // Write the desired motions at the instants of a step of size `h` from `t`. The last instant reads the motion at `end`.
  sample(t, h, end) {
    const [first, width] = data.groups.exogenous;
    data.instants.forEach((part, i) => {
      let at = first + i * width;
      for (const m of data.motions) {
        if (m.breaks) {
          const time = part === 1 ? end : t + part * h;
          this.x[data.groups.time[0]] = time;
          this.f[m.functions[m.breaks.filter((b) => time >= b).length]]();
          this.x.copyWithin(at, m.first, m.first + 3 * m.dof);
        }
        at += 3 * m.dof;
      }
    });
  }

  get isSampled() {
    return data.period > 0 && this.k % data.period === 0;
  }

  // Prepare the sampled controller for step `k`: the output that acts, and what the law reads. The list `samples` has the measurement and
  // the output of each of the last samples.
  prepare() {
    const sampling = data.sampling;
    if (!sampling) return;
    const [last, acting] = [this.k, this.k - sampling.delay].map((k) => Math.floor(k / data.period));
    if (sampling.delay) this.recall(acting, this.group("tau"));
    if (!this.isSampled) return;
    if (sampling.rate_limit !== null) {
      this.recall(last - 1, this.group("output"));
      const since = last ? last * sampling.period - (last - 1) * sampling.period : sampling.period;
      this.group("change")[0] = sampling.rate_limit * since;
    }
    const measured = this.group("measured");
    const state = this.group("state").slice(0, measured.length);
    this.samples[last] = { state: state.map((x, i) => toResolution(x, sampling.resolution[Math.floor(i / JOINTS)])) };
    measured.set(this.samples[Math.max(0, last - sampling.sensor_delay)].state);
    delete this.samples[last - 2 - sampling.sensor_delay - Math.ceil(sampling.delay / data.period)];
  }

  // Write the output of sample `i` to the group `to`. Before the first sample, the output is zero.
  recall(i, to) {
    if (i < 0) to.fill(0);
    else to.set(this.samples[i].output);
  }

  // Advance by one step. It is divided at the jumps of the motion, as in `armlet.simulate`.
  step() {
    this.prepare();
    const end = (this.k + 1) * data.dt;
    let [t, h, name] = [this.t, data.dt, this.isSampled ? "sampled_step" : "step"];
    for (;;) {
      let [piece, inputEnd, jumps] = [h, end, false];
      if (this.passed < this.breaks.length) {
        const jump = this.breaks[this.passed];
        const last = Math.abs(jump - end) <= 1e-9 * data.dt;
        if (jump <= end || last) [jumps, inputEnd, piece] = [true, below(Math.min(jump, end)), last ? end - t : jump - t];
      }
      if (this.breaks.length || data.motions.some((m) => m.breaks)) this.sample(this.afterJump(t), piece, inputEnd);
      this.x[data.groups.h[0]] = piece;
      this.f[name]();
      name = "step";
      if (!jumps) break;
      this.passed += 1;
      t += piece;
      h = end - t;
      if (Math.abs(t - end) <= 1e-9 * data.dt) break;
    }
    if (data.sampling && this.isSampled) this.samples[this.k / data.period].output = this.group("output").slice();
    this.k += 1;
  }

  // The input and the monitors at the present state.
  record() {
    this.prepare();
    this.sample(this.afterJump(this.t), data.dt, (this.k + 1) * data.dt);
    if (this.isSampled || !data.period) this.f.law();
    this.f.notes();
    if (!this.referenced) {
      this.group("reference").set(this.group("own_reference"));
      this.referenced = true;
      this.f.notes();
    }
    return this.group("record");
  }

  isValid() {
    const singular = data.priority ? ", or the tasks are too close to a singularity for this page" : "";
    if (!this.group("state").every(Number.isFinite)) this.fault = `the state is not a number${singular}`;
    else if (!(this.group("angle")[0] < LARGEST_ANGLE)) this.fault = "an angle exceeds 10⁶ rad";
    return !this.fault;
  }

  // Set a slot now and at the start. A slot of the desired motion is set at all instants of a step. A state changes at the next start.
  set(slot, value) {
    const [[first, width], [state, count]] = [data.groups.exogenous, data.groups.state];
    const instants = slot >= first && slot < first + width ? data.instants.map((_, i) => slot + i * width) : [slot];
    for (const at of instants) {
      this.start[at] = value;
      if (!(at >= state && at < state + count)) this.x[at] = value;
    }
    // The balances begin again, because the functions are now different ones.
    this.referenced = false;
  }

  target(i) {
    return this.x[data.groups.exogenous[0] + i];
  }

  setTarget(i, value) {
    this.set(data.groups.exogenous[0] + i, value);
  }

  // The lines of the arm as pairs of points, m, each with the joint that moves its end. `q`: other positions than those of the state.
  lines(q) {
    const state = this.group("state").subarray(0, JOINTS);
    const now = state.slice();
    if (q) state.set(q);
    const all = data.picture.kind === "PR" ? linesOfPR(state) : this.linesOfTree();
    state.set(now);
    return all;
  }

  linesOfTree() {
    const { parents, places, carriers } = data.picture;
    this.f.joints();
    this.f.frames();
    const [poses, frames] = [this.group("joints"), this.group("frames")];
    const origin = (j) => (j < 0 ? [0, 0, 0] : [3, 7, 11].map((k) => poses[16 * j + k]));
    const place = (j, p) =>
      j < 0 ? p : [0, 1, 2].map((r) => poses[16 * j + 4 * r + 3] + p.reduce((sum, x, c) => sum + x * poses[16 * j + 4 * r + c], 0));
    const lines = [];
    parents.forEach((parent, j) => {
      const before = place(parent, places[j]);
      lines.push({ ends: [origin(parent), before], mover: parent });
      lines.push({ ends: [before, origin(j)], mover: j, slides: true });
    });
    carriers.forEach((carrier, k) => {
      const end = [...frames.subarray(3 * k, 3 * k + 3)];
      lines.push({ ends: [origin(carrier), end], mover: carrier, frame: k });
    });
    return lines;
  }
}

function linesOfPR([slide, angle]) {
  const tip = [slide + Math.sin(angle), Math.cos(angle), 0];
  return [
    { ends: [[0, 0, 0], [slide, 0, 0]], mover: 0, slides: true },
    { ends: [[slide, 0, 0], tip], mover: 1 },
  ];
}
