// Plots on canvas: axes with ticks, lines, points, a cursor.

import { surface } from "./rig.js";

// The colour of a name in the style sheet.
const colours = new Map();
export const colour = (name) => {
  if (!colours.has(name)) colours.set(name, getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim());
  return colours.get(name);
};
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => colours.clear());

const MARGIN = { left: 56, right: 12, top: 24, bottom: 34 };

export class Plot {
  // `area`: top and bottom of the plot as shares of its canvas, which plots of one time axis share.
  constructor(canvas, colour, { xLabel = "", yLabel, area = [0, 1] }) {
    Object.assign(this, { canvas, colour, xLabel, yLabel, area });
  }

  // Begins a picture with the ranges x and y, [low, high] each.
  begin(x, y) {
    const { context: c, width, height } = surface(this.canvas);
    const [above, below] = this.area.map((share) => share * height);
    const bottom = this.xLabel ? MARGIN.bottom : 4;
    Object.assign(this, { c, x, y, box: [MARGIN.left, above + MARGIN.top, width - MARGIN.left - MARGIN.right, below - above - MARGIN.top - bottom] });
    c.clearRect(0, above, width, below - above);
    const [left, top, wide, high] = this.box;
    c.font = "12px system-ui, sans-serif";
    c.lineWidth = 1;
    c.strokeStyle = this.colour("line");
    c.fillStyle = this.colour("faint");
    c.textAlign = "center";
    for (const tick of ticks(x, wide / 70)) {
      this.#line([[tick, y[0]], [tick, y[1]]]);
      if (this.xLabel) c.fillText(shown(tick), this.#at([tick, 0])[0], top + high + 14);
    }
    c.textAlign = "right";
    for (const tick of ticks(y, high / 34)) {
      this.#line([[x[0], tick], [x[1], tick]]);
      c.fillText(shown(tick), left - 5, this.#at([0, tick])[1] + 4);
    }
    c.textAlign = "center";
    c.fillText(this.xLabel, left + wide / 2, top + high + 29);
    c.save(); c.translate(11, top + high / 2); c.rotate(-Math.PI / 2); c.fillText(this.yLabel, 0, 0); c.restore();
    c.textAlign = "left";
    this.legend = left;
    this.#clip();
  }

  #at([x, y]) {
    const [left, top, wide, high] = this.box;
    return [left + ((x - this.x[0]) / (this.x[1] - this.x[0])) * wide, top + (1 - (y - this.y[0]) / (this.y[1] - this.y[0])) * high];
  }

  // x under a pointer, or undefined outside the axes.
  xAt(event) {
    const [left, , wide] = this.box ?? [0, 0, 0];
    const share = (event.offsetX - left) / wide;
    return share >= 0 && share <= 1 ? this.x[0] + share * (this.x[1] - this.x[0]) : undefined;
  }

  // y likewise.
  yAt(event) {
    const [, top, , high] = this.box ?? [0, 0, 0, 0];
    const share = 1 - (event.offsetY - top) / high;
    return share >= 0 && share <= 1 ? this.y[0] + share * (this.y[1] - this.y[0]) : undefined;
  }

  // The point of `points` nearest to a pointer, and its distance in pixels.
  nearest(points, event) {
    const distance = (point) => { const [x, y] = this.#at(point); return Math.hypot(x - event.offsetX, y - event.offsetY); };
    return points.map((point) => [point, distance(point)]).reduce((best, next) => (next[1] < best[1] ? next : best), [undefined, Infinity]);
  }

  #line(points) {
    const { c } = this;
    c.beginPath();
    let pen = false;
    for (const point of points) {
      if (!point || !Number.isFinite(point[0] + point[1])) { pen = false; continue; }
      const [x, y] = this.#at(point);
      if (pen) c.lineTo(x, y); else c.moveTo(x, y);
      pen = true;
    }
    c.stroke();
  }

  line(points, colour, { label, dash = [], width = 1.7 } = {}) {
    const { c } = this;
    c.strokeStyle = this.colour(colour);
    c.lineWidth = width;
    c.setLineDash(dash);
    this.#line(points);
    c.setLineDash([]);
    if (label) this.#legend(label, colour, dash);
  }

  // A curve of points [x, y, 1 if stable], dashed where it is unstable.
  curve(points, colour, { label, width = 2 }) {
    // Unstable pieces begin and end at the stable neighbour.
    const unstable = points.map((point, i) => ([points[i - 1], point, points[i + 1]].some((near) => near && !near[2]) ? point : null));
    this.line(unstable, `${colour}-unstable`, { dash: [4, 4], width: 0.7 * width });
    this.line(points.map((point) => (point[2] ? point : null)), colour, { label, width });
  }

  // A rectangle between two points, lower left and upper right.
  cell(from, to, colour) {
    const [left, bottom] = this.#at(from), [right, top] = this.#at(to);
    this.c.fillStyle = this.colour(colour);
    // Neighbours leave no gap.
    this.c.fillRect(left, top, right - left + 0.5, bottom - top + 0.5);
  }

  points(points, colour, { label, radius = 3, open = false } = {}) {
    const { c } = this;
    // Whole discs, also on the edge of the axes; none beyond.
    c.restore();
    c.lineWidth = 1.5;
    c.fillStyle = c.strokeStyle = this.colour(colour);
    const inside = ([x, y]) => x >= this.x[0] && x <= this.x[1] && y >= this.y[0] && y <= this.y[1];
    for (const point of points.filter(inside)) {
      c.beginPath(); c.arc(...this.#at(point), radius, 0, 7);
      if (open) c.stroke(); else c.fill();
    }
    this.#clip();
    if (label && points.length) this.#legend(label, colour, null, open);
  }

  // A vertical line at x.
  cursor(x) { if (x !== undefined) this.line([[x, this.y[0]], [x, this.y[1]]], "ink", { width: 1 }); }

  // One row above the axes, outside the clipped area.
  #legend(label, colour, dash, open) {
    const { c } = this;
    const x = this.legend, y = this.box[1] - 9;
    c.restore();
    c.strokeStyle = c.fillStyle = this.colour(colour);
    c.setLineDash(dash ?? []);
    c.lineWidth = 2;
    c.beginPath();
    if (dash) { c.moveTo(x, y - 4); c.lineTo(x + 18, y - 4); c.stroke(); } else { c.arc(x + 9, y - 4, 3.5, 0, 7); if (open) c.stroke(); else c.fill(); }
    c.setLineDash([]);
    c.fillStyle = this.colour("ink");
    c.fillText(label, x + 23, y);
    this.legend += 35 + c.measureText(label).width;
    this.#clip();
  }

  #clip() {
    const { c, box } = this;
    c.save();
    c.beginPath(); c.rect(...box); c.clip();
  }

  end() { this.c.restore(); }
}

function ticks([low, high], count) {
  const rough = (high - low) / Math.max(2, count);
  const power = 10 ** Math.floor(Math.log10(rough));
  const steps = [0.2, 0.5, 1, 2, 5, 10].map((factor) => factor * power);
  const multiples = (step) => Array.from({ length: Math.max(0, Math.floor(high / step) - Math.ceil(low / step) + 1) }, (_, i) => (Math.ceil(low / step) + i) * step);
  // The finest that is coarse enough, but at least two ticks.
  let at = steps.findIndex((step) => step >= rough);
  while (at > 0 && multiples(steps[at]).length < 2) at--;
  return multiples(steps[at]);
}

const shown = (value) => String(Number(value.toPrecision(5))).replace("-", "−");

// The range of values with a margin, at least `least` to either side of its middle.
export const extent = (values, least) => {
  let low = Infinity, high = -Infinity;
  // Comparisons leave out what is not measured (NaN).
  for (const value of values) { if (value < low) low = value; if (value > high) high = value; }
  if (!(high >= low)) return [-least, least];
  const middle = 0.5 * (low + high), half = Math.max(least, 0.55 * (high - low));
  return [middle - half, middle + half];
};
