// Pictures and numbers of the page.

import { $ } from "./controls.js";
import { RegimeMap } from "./map.js";
import { LOOP, ROW } from "./module.js";
import { Plot, colour, extent } from "./plots.js";
import { Rig } from "./rig.js";
import { Strip } from "./strip.js";

// The time over which the record is shown and can be scrubbed, s, and the points that a curve over it has at least.
export const MINUTE = 60;
const POINTS = 1500;
// Part of the past that is drawn as the trail of the present point, s.
const TRAIL = 3;
// Settings that the motion has and the curves leave out.
const EFFECTS = ["gap_difference", "friction", "tilt"];
// Pixels within which a click on the backbone means a point of it.
const NEAR = 24;

const digits = (value, count, unit = "") => (Number.isNaN(value) ? "not measured" : value.toFixed(count) + unit);

const energy = (joules) => (joules < 1 ? `${(joules * 1e3).toPrecision(4)} mJ` : `${joules.toPrecision(4)} J`);

// The end of an axis: `least`, or the next of its multiples by 1.25, so that it rarely changes.
const end = (least, value) => { while (least < value && Number.isFinite(value)) least *= 1.25; return least; };

// The largest of numbers of which some may not be measured (NaN).
const largest = (values, least) => values.reduce((most, value) => (value > most ? value : most), least);

// Whether a motion has a frequency: with a drive, or along a free decay until synchrony is lost.
const onBackbone = (one) => one.G > 0 || one.decays;

export class Pictures {
  // `calm`: whether motion is to be reduced.
  constructor(page, calm) {
    Object.assign(this, { page, calm, past: [], ghost: [], reach: { mass: 1, base: 1 } });
    this.rig = new Rig($("rig"), colour);
    this.strip = new Strip(colour);
    if (page.bench.regime) this.map = new RegimeMap(page, colour);
    const plot = (id, axes) => new Plot($(id), colour, axes);
    this.plots = {
      scope: plot("scope", { xLabel: "time, s", yLabel: "displacement over b" }),
      phase: plot("history", { yLabel: "error, °", area: [0, 0.5] }),
      detuning: plot("history", { xLabel: "time, s", yLabel: "σ", area: [0.5, 1] }),
      manifold: plot("manifold", { xLabel: "speed of the particle B", yLabel: "amplitude C" }),
      backbone: plot("backbone", { xLabel: "detuning σ", yLabel: "amplitude C" }),
      dropOut: plot("drop-out", { xLabel: "frequency, Hz", yLabel: `${page.bench.host?.drop_out?.unit} per V` }),
    };
    this.#pointers();
  }

  // ---- pointers ----

  #pointers() {
    const { page, plots: { scope, phase, backbone } } = this;
    // The time axes: hovering links the cursors, a click goes back there.
    for (const plot of [scope, phase]) {
      plot.canvas.onpointermove = (event) => (this.hover = { plot, event });
      plot.canvas.onpointerleave = () => (this.hover = undefined);
      plot.canvas.onclick = (event) => { const time = plot.xAt(event); if (time !== undefined) page.scrub(time); };
    }
    backbone.canvas.onclick = (event) => {
      const [point, distance] = backbone.nearest(this.lines.exact, event);
      if (distance < NEAR) page.goToPoint(point);
    };
    const { canvas } = this.rig;
    let resume;
    canvas.onpointerdown = (event) => {
      const part = this.rig.under(event);
      // An experiment that is only watched has no place to drag to.
      if (!part || !page.bench.place) return;
      canvas.setPointerCapture(event.pointerId);
      resume = page.playing;
      page.play(false);
      page.toEnd();
      this.drag = { part };
    };
    canvas.onpointermove = (event) => {
      canvas.style.cursor = page.bench.place && (this.drag || this.rig.under(event)) ? "grab" : "";
      if (this.drag) this.drag.to = this.rig.dragged(this.drag.part, event, this.reach.mass);
    };
    canvas.onpointerup = canvas.onpointercancel = ({ type }) => {
      if (!this.drag) return;
      const { part: [part], to } = this.drag;
      this.drag = undefined;
      if (type === "pointerup" && to !== undefined) page.change(part, to);
      page.play(resume);
    };
  }

  // ---- the run ----

  // The run that ends stays as a ghost, unless it has just begun.
  keepGhost() {
    if (this.units && this.page.samples > 1000) this.ghost = this.#thinned(Infinity);
  }

  restart() {
    this.impacts = 0;
    this.reach = { mass: 1, base: 1 };
    this.curves();
  }

  curves() {
    const { bench } = this.page;
    this.lines = { theory: bench.theory(160), exact: bench.exact(120) };
    this.manifoldEnd = 0;
    this.map?.reset();
    // The curves leave the effects of a real cavity out.
    const real = EFFECTS.some((key) => this.page.values[key]);
    this.ideal = real ? " (ideal)" : bench.host ? " (driven mode)" : "";
    this.all = real ? " (ideal)" : bench.host ? " (all modes)" : "";
    for (const note of document.querySelectorAll(".ideal")) note.hidden = !real;
  }

  // A row of the record, dimensionless.
  #point(row) {
    const { b, epsilon, omega0 } = this.units;
    return {
      time: row[ROW.time], base: row[ROW.base] / (b * epsilon), v: row[ROW.response] / b, w: row[ROW.relative] / b,
      error: row[ROW.phaseError], omega: row[ROW.motion], sigma: (row[ROW.motion] / omega0 - 1) / epsilon,
      C: row[ROW.responseAmplitude] / b, B: row[ROW.speed] / (b * omega0), G: row[ROW.amplitude] / (b * epsilon), decays: row[ROW.decays] !== 0,
    };
  }

  // Points of the last `seconds`, thinned: every sample whose number is a multiple of a power of two.
  #thinned(seconds) {
    const { rows, samples, end } = this.page;
    const count = rows.length - this.page.rowAt(end - seconds);
    const stride = 2 ** Math.max(0, Math.floor(Math.log2(count / POINTS)));
    const first = samples - count;
    const points = [];
    for (let sample = Math.ceil(first / stride) * stride; sample < samples - 1; sample += stride) points.push(this.#point(rows.row(sample - samples)));
    points.push(this.#point(rows.row(-1)));
    return points;
  }

  draw(now) {
    const { page, plots } = this;
    const status = (page.status = page.bench.status());
    this.units = { b: page.values.gap * 1e-3, epsilon: page.values.mass_ratio, omega0: status.omega0 };
    const index = page.rowAt(page.shown);
    const point = (this.now = this.#point(page.rows.row(index)));
    const replay = page.replays();
    this.past = this.#thinned(MINUTE);

    // The last four periods before the time that is shown.
    const count = index + 1 - page.rowAt(point.time - (8 * Math.PI) / status.omega0);
    const motion = Array.from({ length: count }, (_, i) => this.#point(page.rows.row(index - count + 1 + i)));
    this.#rig(point, motion, replay, status, now);

    const { hover } = this;
    const time = hover?.plot.xAt(hover.event);
    const cursor = time ?? (replay ? page.shown : undefined);
    const linked = time === undefined ? undefined : this.#point(page.rows.row(page.rowAt(time)));
    this.#motion(motion, status, cursor);
    this.#history(cursor);
    const seen = this.past.filter((one) => one.time <= page.shown + page.step);
    const top = end(1.05, 1.03 * largest(seen.slice(-POINTS).map((one) => one.C), 0));
    this.#manifold(top, seen, point, linked);
    const done = page.points.filter((one) => one[0] <= page.shown + page.step);
    this.#backbone(top, seen, point, linked, done);
    this.map?.draw(point);
    if (page.bench.host?.drop_out) this.#dropOut(page.bench.host.drop_out.points, point);
    const words = page.bench.words();
    this.strip.draw(page, status, point, words, replay);
    this.#numbers(status, point, words, replay, done.length);
  }

  #rig(point, motion, replay, status, now) {
    const { page, drag, reach, units: { b, epsilon } } = this;
    // The primary mass, from v = q1 + epsilon q2 and w = q1 - q2; of a structure, the response is the displacement at the cavity.
    const share = page.bench.share ?? epsilon;
    let look = { q1: Number.isNaN(point.w) ? point.v : (point.v + share * point.w) / (1 + share), base: point.base || 0, wall: 0 };
    look.q2 = look.q1 - point.w;
    if (!replay) {
      const plant = page.bench.look(page.shown - (page.samples - 1) * page.step);
      if (plant) look = { q1: plant.q1 / b, q2: plant.q2 / b, base: plant.base / (b * epsilon), wall: plant.wall };
      const impacts = plant?.impacts ?? status.impacts;
      if (impacts > this.impacts) {
        this.rig.hit(Math.sign(look.q1 - look.q2), now);
        page.sound?.(point.B);
      }
      this.impacts = impacts;
    }
    if (drag?.to !== undefined) look = drag.part[0] === "mass" ? { ...look, q1: drag.to, q2: drag.to + look.q2 - look.q1 } : { ...look, q2: look.q1 + drag.to };
    // The scale grows at once and shrinks slowly.
    const most = (key, present) => largest([...motion.map((one) => Math.abs(one[key])), Math.abs(present)], 1);
    const need = { mass: most("v", look.q1), base: most("base", look.base) };
    for (const key of ["mass", "base"]) reach[key] = Math.max(need[key], reach[key] + 0.02 * (need[key] - reach[key]));
    const difference = (page.values.gap_difference ?? 0) / 100;
    this.rig.draw(look, reach, [1 + difference, 1 - difference], page.values.tilt ?? 0, now, this.calm.matches, page.bench.host);
  }

  #motion(motion, status, cursor) {
    const { page, plots: { scope } } = this;
    const top = 1.05 * largest(motion.flatMap((one) => [one.base, one.v, one.w].map(Math.abs)), 1.1);
    const begin = motion[0].time;
    const column = (key) => motion.map((one) => [one.time, one[key]]);
    scope.begin([begin, Math.max(motion.at(-1).time, begin + (2 * Math.PI) / status.omega0)], [-top, top]);
    scope.line(column("base"), "base", { label: page.bench.host?.drive === "force" ? "force (as base/(ε b))" : "base/(ε b)" });
    scope.line(column("v"), "ink", { label: "response v" });
    scope.line(column("w"), "particle", { label: "relative w" });
    scope.cursor(cursor);
    scope.end();
  }

  // The last minute, with the run before at the same times.
  #history(cursor) {
    const { past, ghost, plots: { phase, detuning } } = this;
    const x = [past[0].time, Math.max(past.at(-1).time, past[0].time + 1)];
    const old = ghost.filter((one) => one.time >= x[0] && one.time <= x[1]);
    for (const [plot, key, name, shade] of [[phase, "error", "phase error", "predicted"], [detuning, "sigma", "detuning", "green"]]) {
      const shows = (one) => (key === "error" ? one.G > 0 : onBackbone(one));
      plot.begin(x, extent([...past, ...old].filter(shows).map((one) => one[key]), key === "error" ? 1 : 0.5));
      const values = (run) => run.map((one) => (shows(one) ? [one.time, one[key]] : null));
      if (old.length) plot.line(values(old), "ghost", { label: "run before" });
      plot.line(values(past), shade, { label: name });
      plot.cursor(cursor);
      plot.end();
    }
  }

  // The past as curves [x, y] of a plane: the trail of the present point, the free decay, and the run before.
  #tracks(plot, seen, place) {
    const from = (seen.at(-1)?.time ?? 0) - TRAIL;
    const some = (kind) => (one) => (kind(one) ? place(one) : null);
    const decays = (one) => one.decays;
    if (this.ghost.length) {
      plot.line(this.ghost.map(some(decays)), "ghost", { width: 2 });
      plot.points([place(this.ghost.findLast(onBackbone) ?? this.ghost[0])], "ghost", { label: "run before", radius: 5, open: true });
    }
    plot.line(seen.filter((one) => one.time > from).map(some((one) => one.G > 0)), "trail", { width: 1 });
    plot.line(seen.map(some(decays)), "measured", { width: 3, label: seen.some(decays) ? "free decay" : "" });
  }

  #manifold(top, seen, point, linked) {
    const { page, plots: { manifold } } = this;
    const right = end(2.2, largest(seen.map((one) => one.B), point.B));
    if (this.manifoldEnd !== right) this.lines.manifold = page.bench.manifold((this.manifoldEnd = right), 240);
    manifold.begin([0, right], [0, top]);
    manifold.curve(this.lines.manifold, "theory", { label: `first-order theory${this.ideal}` });
    this.#tracks(manifold, seen, (one) => [one.B, one.C]);
    manifold.points([[point.B, point.C]], "particle", { label: "now", radius: 5 });
    if (linked) manifold.points([[linked.B, linked.C]], "ink", { radius: 7, open: true });
    manifold.end();
  }

  #backbone(top, seen, point, linked, tracked) {
    const { lines, plots: { backbone } } = this;
    const curves = [...lines.exact, ...lines.theory].filter((one) => one[1] <= top).map((one) => one[0]);
    const sigmas = [...curves, ...[...seen.filter((one) => one.time > point.time - TRAIL || one.decays), ...this.ghost.filter((one) => one.decays), point].filter(onBackbone).map((one) => one.sigma)];
    backbone.begin(extent(sigmas, 0.5), [0, top]);
    backbone.curve(lines.theory, "theory", { label: `theory${this.ideal}`, width: 1.2 });
    backbone.curve(lines.exact, "exact", { label: `exact${this.all}`, width: 2.4 });
    this.#tracks(backbone, seen, (one) => [one.sigma, one.C]);
    backbone.points(tracked.map((one) => [one[1], one[2]]), "measured", { label: "tracked", open: true });
    if (onBackbone(point)) backbone.points([[point.sigma, point.C]], "particle", { label: "now", radius: 5 });
    if (linked && onBackbone(linked)) backbone.points([[linked.sigma, linked.C]], "ink", { radius: 7, open: true });
    backbone.end();
  }

  // What the shaker makes of a constant command, and where the loop is on it.
  #dropOut(points, point) {
    const { plots: { dropOut } } = this;
    dropOut.begin([points[0][0], points.at(-1)[0]], [0, 1.05 * largest(points.map(([, value]) => value), 0)]);
    dropOut.line(points, "exact", { label: "structure and shaker", width: 2.4 });
    if (onBackbone(point)) dropOut.cursor(point.omega / (2 * Math.PI));
    dropOut.end();
  }

  #numbers(status, point, [regime, fault], replay, tracked) {
    const { page } = this;
    const periods = (page.shown * status.omega0) / (2 * Math.PI);
    const state = page.values.closed ? LOOP[status.state] + (status.settled ? ", settled" : "") + (fault ? `: ${fault}` : "") : "open";
    // Only the present has these.
    const present = (text) => (replay ? "– (replay)" : text);
    const entries = [
      ["Time", `${page.shown.toFixed(3)} s, ${periods.toFixed(1)} natural periods`],
      ["Loop", status.state === undefined ? undefined : present(state)],
      ["Regime", present(regime.startsWith("unknown") ? "too few impacts yet" : regime || "no impacts are measured")],
      ["Detuning σ", digits(point.sigma, 6)],
      ["Amplitude C", digits(point.C, 6)],
      ["Particle speed B", digits(point.B, 6)],
      ["Phase error", point.G > 0 ? digits(Math.round(point.error * 1e4) / 1e4 + 0, 4, "°") : "– (no drive)"],
      ["Excitation G", point.G.toFixed(4)],
      ["Impacts", status.impacts === undefined ? undefined : present(`${status.impacts}, ${status.perPeriod.toFixed(3)} per period`)],
      ["Dissipated by impacts", status.dissipated === undefined ? undefined : present(energy(status.dissipated))],
      // An experiment that is watched does not know all of these.
    ].filter(([, text]) => text !== undefined);
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
