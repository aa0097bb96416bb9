// The page: clock and pictures.

import { $, SPEEDS, bind, bindScenes, control, say } from "./controls.js";
import { read } from "./link.js";
import { load } from "./module.js";
import { Rig } from "./rig.js";
import { Plot, extent } from "./plots.js";

// Rows of the record that are kept for the pictures and for CSV: 34 minutes of the default scene.
const MOST_ROWS = 1 << 20;
// Most samples in one frame: a slower machine falls behind the clock instead of freezing the page.
const MOST_SAMPLES = 6000;
const calm = matchMedia("(prefers-reduced-motion: reduce)");
const colours = new Map();
const colour = (name) => {
  if (!colours.has(name)) colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return colours.get(name);
};
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => colours.clear());

class Page {
  playing = true;
  speed = 1;
  driving = true;

  constructor(table, bench) {
    this.table = table;
    this.bench = bench;
    this.rig = new Rig($("rig"), colour);
    const plot = (id, xLabel, yLabel) => new Plot($(id), colour, { xLabel, yLabel });
    this.plots = {
      scope: plot("scope", "time, s", "displacement over b"),
      history: plot("history", "time, s", "error, °;  σ"),
      manifold: plot("manifold", "speed of the particle B", "amplitude C"),
      backbone: plot("backbone", "detuning σ", "amplitude C"),
    };
    this.#controls();
    bindScenes(this);
  }

  // ---- the motion ----

  start(values, changes = []) {
    this.values = { ...this.bench.defaults, ...values };
    this.first = { ...this.values };
    this.bench.restart(this.values);
    this.changes = [];
    this.pending = changes;
    this.samples = 0;
    this.shown = 0;
    this.impacts = 0;
    this.driving = true;
    this.points = [];
    this.rows = [];
    this.trail = [];
    this.#curves();
    this.showControls();
    this.#run(1);
    this.status = this.bench.status();
    this.step = this.status.sampleTime;
  }

  // Notes a change, so that a link repeats it, and makes it.
  change(key, value) {
    const last = this.changes.at(-1);
    if (last && last[0] === this.samples && last[1] === key) last[2] = value;
    else this.changes.push([this.samples, key, value]);
    this.#make(key, value);
  }

  #make(key, value) {
    const before = this.values;
    try {
      if (key === "drive") {
        this.driving = value !== 0;
        this.bench.drive(this.driving);
      } else if (key === "track") {
        this.bench.track();
        this.driving = true;
        this.points = this.bench.tracked();
      } else {
        this.values = { ...before, [key]: value };
        this.bench.apply(this.values);
        if (key === "gap" || key === "mass_ratio") {
          this.start(this.values);
        } else {
          this.#curves();
        }
      }
      say("");
    } catch (error) {
      this.values = before;
      this.changes.pop();
      say(error.message);
    }
    this.showControls();
  }

  #run(count) {
    while (count > 0) {
      const next = this.pending[0];
      if (next && next[0] <= this.samples) {
        this.pending.shift();
        this.change(next[1], next[2]);
        continue;
      }
      const now = Math.min(count, 4000, next ? next[0] - this.samples : Infinity);
      const values = this.bench.run(now);
      const width = this.bench.columns.length;
      for (let i = 0; i < values.length; i += width) this.rows.push(Array.from(values.subarray(i, i + width)));
      this.samples += now;
      count -= now;
    }
    if (this.rows.length > MOST_ROWS) this.rows.splice(0, this.rows.length - MOST_ROWS / 2);
  }

  // Runs until `time`, s, and shows the plant at that instant.
  goTo(time, most = MOST_SAMPLES) {
    const need = Math.max(0, Math.floor(time / this.step) + 1 - this.samples);
    const count = Math.min(most, need);
    this.#run(count);
    this.shown = Math.min(time, this.samples * this.step);
    return count === need;
  }

  toNextImpact() {
    let after = this.shown - (this.samples - 1) * this.step;
    for (let i = 0; i < 20000; i++) {
      const ahead = this.bench.nextImpact(after + 1e-12);
      if (ahead !== undefined) {
        this.shown = (this.samples - 1) * this.step + ahead;
        return true;
      }
      this.#run(1);
      after = -1;
    }
    say("No impact follows within 20,000 samples: raise G, or start with a moving particle.");
    return false;
  }

  // ---- pictures ----

  #curves() {
    this.curves = { manifold: this.bench.manifold(2.2, 160), theory: this.bench.theory(160), exact: this.bench.exact(120) };
  }

  draw(now) {
    const { bench, plots, curves } = this;
    const look = bench.look(this.shown - (this.samples - 1) * this.step);
    const status = (this.status = bench.status());
    const b = this.values.gap * 1e-3;
    const scale = { q1: look.q1 / b, q2: look.q2 / b, base: look.base / (b * this.values.mass_ratio), wall: look.wall };
    if (status.impacts > this.impacts) this.rig.hit(Math.sign(look.relative), now);
    this.impacts = status.impacts;
    this.rig.draw(scale, now, calm.matches);

    const trailEnd = this.trail.at(-1);
    if (!trailEnd || status.time - trailEnd[3] > 0.02) this.trail.push([status.sigma, status.C, status.B, status.time]);
    if (this.trail.length > 600) this.trail.splice(0, this.trail.length - 400);

    const period = 2 * Math.PI / status.omega0;
    const recent = this.rows.slice(-Math.ceil(4 * period / this.step) - 1);
    const t0 = recent[0][0], t1 = recent.at(-1)[0];
    const motion = recent.map((row) => [row[0], row[1] / (b * this.values.mass_ratio), row[2] / b, row[3] / b]);
    const top = Math.max(1.1, ...motion.map((row) => Math.max(Math.abs(row[1]), Math.abs(row[2]), Math.abs(row[3])))) * 1.05;
    plots.scope.begin([t0, Math.max(t1, t0 + period)], [-top, top]);
    plots.scope.line(motion.map((row) => [row[0], row[1]]), "blue", { label: "base/(ε b)" });
    plots.scope.line(motion.map((row) => [row[0], row[2]]), "ink", { label: "response v" });
    plots.scope.line(motion.map((row) => [row[0], row[3]]), "red", { label: "relative w" });
    plots.scope.end();

    const stride = Math.max(1, Math.floor(this.rows.length / 700));
    const past = [];
    for (let i = (this.rows.length - 1) % stride; i < this.rows.length; i += stride) past.push(this.rows[i]);
    const sigma = (omega) => (omega / status.omega0 - 1) / this.values.mass_ratio;
    const errors = past.map((row) => [row[0], row[4]]), detunings = past.map((row) => [row[0], sigma(row[5])]);
    const late = past.slice(Math.floor(past.length * 0.05));
    const range = extent(late.flatMap((row) => [Math.max(-30, Math.min(30, row[4])), sigma(row[5])]).concat([-2, 2]), 2);
    plots.history.begin([past[0][0], Math.max(past.at(-1)[0], past[0][0] + period)], range);
    plots.history.line(errors, "violet", { label: "phase error, °" });
    plots.history.line(detunings, "green", { label: "detuning σ" });
    plots.history.end();

    const cs = curves.manifold.map((point) => point[1]);
    const cTop = Math.max(1.05, 1.05 * status.C, ...cs.slice(0, 1));
    plots.manifold.begin([0, 2.2], [0, cTop]);
    plots.manifold.line(curves.manifold, "ink", { label: "manifold, first order", dash: [6, 4] });
    plots.manifold.line(this.trail.slice(-200).map((point) => [point[2], point[1]]), "blue", { width: 1 });
    plots.manifold.points([[status.B, status.C]], "red", { label: "now", radius: 5 });
    plots.manifold.end();

    const done = this.points.filter((point) => point[0] <= this.shown + this.step);
    const all = [...curves.exact, ...curves.theory];
    const xs = extent(all.map((point) => point[0]).filter((x) => x > -8 && x < 8).concat([Math.max(-8, Math.min(8, status.sigma))]), 0.5);
    plots.backbone.begin(xs, [0, cTop]);
    plots.backbone.line(curves.theory, "ink", { label: "theory", dash: [6, 4] });
    plots.backbone.line(curves.exact.map((point) => (point[2] ? point : null)), "green", { label: "exact" });
    plots.backbone.line(curves.exact.map((point) => (point[2] ? null : point)), "green", { dash: [1, 3] });
    plots.backbone.line(this.trail.slice(-200), "blue", { width: 1 });
    plots.backbone.points(done.map((point) => [point[1], point[2]]), "violet", { label: "tracked", open: true });
    plots.backbone.points([[status.sigma, status.C]], "red", { label: "now", radius: 5 });
    plots.backbone.end();
    this.#numbers(status, done.length);
  }

  #numbers(status, tracked) {
    const [regime, loop, fault] = this.bench.words();
    const periods = (this.shown * status.omega0) / (2 * Math.PI);
    const state = this.values.closed ? loop + (status.settled ? ", settled" : "") + (fault ? `: ${fault}` : "") : "open";
    const entries = [
      ["Time", `${this.shown.toFixed(3)} s, ${periods.toFixed(1)} natural periods`],
      ["Loop", state],
      ["Regime", regime],
      ["Detuning σ", status.sigma.toFixed(6)],
      ["Amplitude C", status.C.toFixed(6)],
      ["Particle speed B", status.B.toFixed(6)],
      ["Phase error", `${(Math.round(status.phaseError * 1e4) / 1e4 + 0).toFixed(4)}°`],
      ["Excitation G", status.G.toFixed(4)],
      ["Impacts", `${status.impacts}, ${status.perPeriod.toFixed(3)} per period`],
      ["Dissipated by impacts", `${(status.dissipated * 1e3).toPrecision(4)} mJ`],
    ];
    if (this.points.length) entries.push(["Tracked points", `${tracked} of ${this.points.length}`]);
    const list = $("numbers");
    if (list.childElementCount !== 2 * entries.length) {
      list.replaceChildren(...entries.flatMap(() => [document.createElement("dt"), document.createElement("dd")]));
    }
    entries.flat().forEach((text, i) => {
      if (list.children[i].textContent !== text) list.children[i].textContent = text;
    });
  }

  // ---- controls ----

  #controls() {
    $("speed").replaceChildren(...SPEEDS.map((speed) => new Option(speed < 1 ? `1/${Math.round(1 / speed)}` : `${speed}×`, speed)));
    $("speed").onchange = () => (this.speed = Number($("speed").value));
    $("settings").onsubmit = (event) => event.preventDefault();
    $("settings").replaceChildren(...this.table.settings.map((setting) => control(this, setting)));
  }

  showControls() {
    for (const { key, unit } of this.table.settings) {
      const input = $(key), value = this.values[key];
      if (unit === "bool") input.checked = value !== 0;
      else {
        input.value = Number(value.toPrecision(6));
        input.parentElement.lastElementChild.value = value;
      }
    }
    $("drive").textContent = this.driving ? "Drive on" : "Drive off";
    $("drive").setAttribute("aria-pressed", String(this.driving));
    $("play").textContent = this.playing ? "Pause" : "Run";
    $("track").disabled = this.values.closed === 0;
  }

  play(on) {
    this.playing = on;
    this.showControls();
  }

  setSpeed(speed) {
    this.speed = speed;
    $("speed").value = speed;
  }
}

async function main() {
  const table = await (await fetch("settings.json")).json();
  const bench = await load("vines_live.wasm", table.settings);
  const page = new Page(table, bench);
  let wanted = { values: {}, changes: [], samples: 0 };
  try {
    wanted = read(location.hash, table);
  } catch (error) {
    say(error.message);
  }
  page.start(wanted.values, wanted.changes);
  page.setSpeed(1);
  if (wanted.samples > 0) {
    page.goTo((wanted.samples - 1) * page.step, wanted.samples);
    page.play(false);
  } else if (calm.matches) page.play(false);
  bind(page);
  window.live = { page, frames: 0 };
  let before = performance.now();
  const frame = (now) => {
    const passed = Math.min(0.1, (now - before) / 1000);
    before = now;
    try {
      if (page.playing) page.goTo(page.shown + passed * page.speed);
      page.draw(now);
    } catch (error) {
      page.play(false);
      say(error.message);
    }
    window.live.frames++;
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

main().catch((error) => say(error.message));
