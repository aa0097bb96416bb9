// Manifold and backbone side by side, with numbers to drag: r, lambda, and the speed B of the particle. Equation numbers: docs/theory.md.

import { $, say } from "./controls.js";
import { load } from "./module.js";
import { Plot, colour, extent } from "./plots.js";

// Pixels that a pointer moves for a step of a number.
const PIXELS = 4;
// Ends of the axes of B and C.
const RIGHT = 1.6, TOP = 1.2;
// Symmetric impacts are stable from the fold to here (10).
const BREAKING = (2 * Math.PI) / (Math.PI ** 2 - 4);

// The first-order motion at phase resonance with the speed B.
export function motion({ restitution: r, damping }, B) {
  const R = (1 - r) / (1 + r), sine = 1 - (Math.PI * B) / 2, C = Math.hypot(R * B, sine);
  const drive = (speed) => { const c = Math.hypot(R * speed, 1 - (Math.PI * speed) / 2); return damping * c + ((4 / Math.PI) * R * speed ** 2) / c; };
  const fold = Math.PI / 2 / (R ** 2 + Math.PI ** 2 / 4), step = 1e-6;
  // On the right branch C rises with B (4), so that G rises with C where it rises with B (18).
  const rises = drive(B + step) > drive(B - step);
  const impacts = B > fold && B < BREAKING;
  return { B, C, sigma: ((2 / Math.PI) * B * sine) / C ** 2, G: drive(B), alpha: Math.atan2(sine, R * B), fold, foldC: Math.hypot(R * fold, 1 - (Math.PI * fold) / 2), impacts, stable: impacts && rises };
}

function verdict({ B, fold, impacts, stable }) {
  if (stable) return "Its impacts are stable, and a constant drive holds it.";
  if (impacts) return "Its impacts are stable, but G falls as C rises: a constant drive loses it, and only control of the response holds it.";
  return B < fold ? "It is left of the fold: its impacts are unstable." : "B is above 1.07: the two flights of a period become unequal.";
}

// The triangle wave of slope 1 and height pi/2 (3).
const triangle = (angle) => Math.asin(Math.sin(angle));

async function main() {
  const { settings } = await (await fetch("settings.json")).json();
  const bench = await load("vines_live.wasm", settings);
  const values = { ...bench.defaults, speed: 0.88 };
  const plots = {
    manifold: new Plot($("manifold"), colour, { xLabel: "speed of the particle B", yLabel: "amplitude C" }),
    backbone: new Plot($("backbone"), colour, { xLabel: "detuning σ", yLabel: "amplitude C" }),
    scope: new Plot($("scope"), colour, { xLabel: "time, periods", yLabel: "displacement over b" }),
  };
  let lines = {};
  const curves = () => {
    const { speed: _, ...of } = values;
    bench.restart(of);
    const points = Array.from({ length: 150 }, (_, i) => motion(values, (i + 1) * 0.01));
    lines = { manifold: bench.manifold(RIGHT, 240), theory: bench.theory(160), exact: bench.exact(120), points };
  };
  const draw = () => {
    const at = motion(values, values.speed), { manifold, backbone, scope } = plots;
    manifold.begin([0, RIGHT], [0, TOP]);
    manifold.curve(lines.manifold, "theory", { label: "manifold" });
    manifold.points([[at.B, at.C]], "particle", { label: "the motion", radius: 6 });
    manifold.end();
    const seen = [...lines.theory, ...lines.exact].filter((one) => one[1] < TOP).map((one) => one[0]);
    backbone.begin(extent([...seen, at.sigma], 0.5), [0, TOP]);
    backbone.curve(lines.theory, "theory", { label: "first-order theory", width: 1.2 });
    backbone.curve(lines.exact, "exact", { label: "exact", width: 2.4 });
    backbone.points([[at.sigma, at.C]], "particle", { radius: 6 });
    backbone.end();
    // v = C sin(theta + gamma) with gamma = -90 degrees; the wall is met where theta + psi is 90 degrees, psi = 90 degrees - alpha + gamma.
    const wave = Array.from({ length: 401 }, (_, i) => { const theta = (i / 100) * Math.PI; return { t: i / 200, base: Math.sin(theta), v: -at.C * Math.cos(theta), angle: theta - at.alpha }; });
    const motions = wave.map(({ t, base, v, angle }) => ({ t, base: at.G * base, v, w: v + at.B * triangle(angle) }));
    const top = 1.1 * Math.max(1, at.G, at.C);
    scope.begin([0, 2], [-top, top]);
    for (const [key, name, label] of [["base", "base", "base/(ε b)"], ["v", "ink", "response v"], ["w", "particle", "relative w"]]) scope.line(motions.map((one) => [one.t, one[key]]), name, { label });
    scope.end();
    const shown = (id, value, digits = 3) => ($(id).textContent = value.toFixed(digits).replace("-", "−"));
    shown("fold-b", at.fold); shown("fold-c", at.foldC); shown("amplitude", at.C); shown("sigma", at.sigma); shown("drive", at.G);
    $("verdict").textContent = verdict(at);
    for (const number of document.querySelectorAll("[data-key]")) {
      number.textContent = values[number.dataset.key].toFixed(2);
      number.setAttribute("aria-valuenow", values[number.dataset.key].toFixed(2));
    }
  };
  const set = (key, value, { min, max }) => {
    values[key] = Math.max(Number(min), Math.min(Number(max), value));
    try {
      if (key !== "speed") curves();
      draw();
    } catch (error) {
      say(error.message);
    }
  };
  for (const number of document.querySelectorAll("[data-key]")) {
    const { key, min, max, step } = number.dataset;
    Object.assign(number, { tabIndex: 0, title: "Drag, or use the arrow keys" });
    for (const [name, value] of Object.entries({ role: "slider", "aria-valuemin": min, "aria-valuemax": max })) number.setAttribute(name, value);
    number.onpointerdown = (event) => { number.setPointerCapture(event.pointerId); number.from = [event.clientX, values[key]]; };
    number.onpointermove = (event) => { if (number.from) set(key, number.from[1] + Math.round((event.clientX - number.from[0]) / PIXELS) * step, number.dataset); };
    number.onpointerup = number.onpointercancel = () => (number.from = undefined);
    number.onkeydown = (event) => {
      const way = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
      if (way) { event.preventDefault(); set(key, values[key] + way * step, number.dataset); }
    };
  }
  const { dataset } = document.querySelector("[data-key=speed]");
  const drags = (canvas, speed) => {
    const move = (event) => { const to = speed(event); if (to !== undefined) set("speed", to, dataset); };
    canvas.onpointerdown = (event) => { canvas.setPointerCapture(event.pointerId); move(event); };
    canvas.onpointermove = (event) => { if (event.buttons) move(event); };
  };
  drags($("manifold"), (event) => plots.manifold.xAt(event));
  drags($("backbone"), (event) => plots.backbone.nearest(lines.points.map(({ sigma, C, B }) => [sigma, C, B]), event)[0]?.[2]);
  curves();
  draw();
  addEventListener("resize", draw);
  window.live = { bench, values };
}

main().catch((error) => say(error.message));
