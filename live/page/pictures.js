// Pictures and numbers of the page.

import { $ } from "./controls.js";
import { LOOP } from "./module.js";
import { Plot, extent } from "./plots.js";
import { Rig } from "./rig.js";

const colours = new Map();
const colour = (name) => {
  if (!colours.has(name)) colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return colours.get(name);
};
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => colours.clear());

export class Pictures {
  // `calm`: whether motion is to be reduced.
  constructor(page, calm) {
    Object.assign(this, { page, calm });
    this.rig = new Rig($("rig"), colour);
    const plot = (id, xLabel, yLabel) => new Plot($(id), colour, { xLabel, yLabel });
    this.plots = {
      scope: plot("scope", "time, s", "displacement over b"),
      history: plot("history", "time, s", "phase error, °; σ"),
      manifold: plot("manifold", "speed of the particle B", "amplitude C"),
      backbone: plot("backbone", "detuning σ", "amplitude C"),
    };
  }

  restart() {
    this.impacts = 0;
    this.trail = [];
    this.curves();
  }

  curves() {
    const { bench } = this.page;
    this.lines = { manifold: bench.manifold(2.2, 160), theory: bench.theory(160), exact: bench.exact(120) };
  }

  draw(now) {
    const { page } = this;
    const look = page.bench.look(page.shown - (page.samples - 1) * page.step);
    const status = (page.status = page.bench.status());
    // Displacements over b; that of the base over epsilon b.
    this.b = page.values.gap * 1e-3;
    this.baseUnit = this.b * page.values.mass_ratio;
    const scale = { q1: look.q1 / this.b, q2: look.q2 / this.b, base: look.base / this.baseUnit, wall: look.wall };
    if (look.impacts > this.impacts) this.rig.hit(Math.sign(look.relative), now);
    this.impacts = look.impacts;
    this.rig.draw(scale, now, this.calm.matches);

    const last = this.trail.at(-1);
    if (!last || status.time - last[3] > 0.02) this.trail.push([status.sigma, status.C, status.B, status.time]);
    if (this.trail.length > 600) this.trail.splice(0, this.trail.length - 400);

    const period = 2 * Math.PI / status.omega0;
    this.#motion(period);
    this.#history(period, status);
    const top = Math.max(1.05, 1.05 * status.C, this.lines.manifold[0][1]);
    this.#manifold(top, status);
    const done = page.points.filter((point) => point[0] <= page.shown + page.step);
    this.#backbone(top, status, done);
    this.#numbers(status, done.length);
  }

  // The last four periods of the record.
  #motion(period) {
    const { page, b, plots: { scope } } = this;
    const count = Math.min(page.rows.length, Math.ceil(4 * period / page.step) + 1);
    const rows = Array.from({ length: count }, (_, i) => page.rows.row(i - count));
    const begin = rows[0][0], end = rows.at(-1)[0];
    const motion = rows.map((row) => [row[0], row[1] / this.baseUnit, row[2] / b, row[3] / b]);
    const top = 1.05 * motion.reduce((most, row) => Math.max(most, Math.abs(row[1]), Math.abs(row[2]), Math.abs(row[3])), 1.1);
    const column = (n) => motion.map((row) => [row[0], row[n]]);
    scope.begin([begin, Math.max(end, begin + period)], [-top, top]);
    scope.line(column(1), "blue", { label: "base/(ε b)" });
    scope.line(column(2), "ink", { label: "response v" });
    scope.line(column(3), "red", { label: "relative w" });
    scope.end();
  }

  // Phase error and detuning since the start.
  #history(period, status) {
    const { page, plots: { history } } = this;
    const stride = Math.max(1, Math.floor(page.rows.length / 700));
    const past = [];
    for (let i = (page.rows.length - 1) % stride; i < page.rows.length; i += stride) past.push(page.rows.row(i));
    const sigma = (omega) => (omega / status.omega0 - 1) / page.values.mass_ratio;
    const late = past.slice(Math.floor(past.length * 0.05));
    const range = extent(late.flatMap((row) => [Math.max(-30, Math.min(30, row[4])), sigma(row[5])]).concat([-2, 2]), 2);
    history.begin([past[0][0], Math.max(past.at(-1)[0], past[0][0] + period)], range);
    history.line(past.map((row) => [row[0], row[4]]), "violet", { label: "phase error, °" });
    history.line(past.map((row) => [row[0], sigma(row[5])]), "green", { label: "detuning σ" });
    history.end();
  }

  #manifold(top, status) {
    const { lines, trail, plots: { manifold } } = this;
    manifold.begin([0, 2.2], [0, top]);
    manifold.line(lines.manifold, "ink", { label: "manifold, first order", dash: [6, 4] });
    manifold.line(trail.slice(-200).map((point) => [point[2], point[1]]), "blue", { width: 1 });
    manifold.points([[status.B, status.C]], "red", { label: "now", radius: 5 });
    manifold.end();
  }

  #backbone(top, status, tracked) {
    const { lines, trail, plots: { backbone } } = this;
    const sigmas = [...lines.exact, ...lines.theory].map((point) => point[0]).filter((x) => x > -8 && x < 8);
    backbone.begin(extent(sigmas.concat([Math.max(-8, Math.min(8, status.sigma))]), 0.5), [0, top]);
    backbone.line(lines.theory, "ink", { label: "theory", dash: [6, 4] });
    backbone.line(lines.exact.map((point) => (point[2] ? point : null)), "green", { label: "exact" });
    backbone.line(lines.exact.map((point) => (point[2] ? null : point)), "green", { dash: [1, 3] });
    backbone.line(trail.slice(-200), "blue", { width: 1 });
    backbone.points(tracked.map((point) => [point[1], point[2]]), "violet", { label: "tracked", open: true });
    backbone.points([[status.sigma, status.C]], "red", { label: "now", radius: 5 });
    backbone.end();
  }

  #numbers(status, tracked) {
    const { page } = this;
    const [regime, fault] = page.bench.words();
    const periods = (page.shown * status.omega0) / (2 * Math.PI);
    const state = page.values.closed ? LOOP[status.state] + (status.settled ? ", settled" : "") + (fault ? `: ${fault}` : "") : "open";
    const entries = [
      ["Time", `${page.shown.toFixed(3)} s, ${periods.toFixed(1)} natural periods`],
      ["Loop", state],
      ["Regime", regime.startsWith("unknown") ? "too few impacts yet" : regime],
      ["Detuning σ", status.sigma.toFixed(6)],
      ["Amplitude C", status.C.toFixed(6)],
      ["Particle speed B", status.B.toFixed(6)],
      ["Phase error", `${(Math.round(status.phaseError * 1e4) / 1e4 + 0).toFixed(4)}°`],
      ["Excitation G", status.G.toFixed(4)],
      ["Impacts", `${status.impacts}, ${status.perPeriod.toFixed(3)} per period`],
      ["Dissipated by impacts", `${(status.dissipated * 1e3).toPrecision(4)} mJ`],
    ];
    if (page.points.length) entries.push(["Tracked points", tracked < page.points.length ? `${tracked} of ${page.points.length}` : `${tracked}`]);
    const list = $("numbers");
    if (list.childElementCount !== 2 * entries.length) {
      list.replaceChildren(...entries.flatMap(() => [document.createElement("dt"), document.createElement("dd")]));
    }
    entries.flat().forEach((text, i) => {
      text = text.replace(/^-/, "−");
      if (list.children[i].textContent !== text) list.children[i].textContent = text;
    });
  }
}
