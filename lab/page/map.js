// The map of regimes over sigma and G: where a constant drive leads from the start of the scene, with all effects of the cavity. Computed
// cell by cell, a few at every frame.

import { $ } from "./controls.js";
import { Plot } from "./plots.js";

const SIGMA = [-3, 3], G = [0, 4], COLUMNS = 60, ROWS = 20;
// The next cell lies this far on, a number without a common divisor with their count: the whole map is seen early.
const STRIDE = 457;
// Settings that a cell depends on.
const MOTION = ["restitution", "damping", "mass_ratio", "gap", "gap_difference", "friction", "tilt", "start_speed"];
// Time for cells at every frame, ms.
const TIME = 4;

// Regimes by their number in the module, which does not tell irregular motions apart; `vines map` does.
export const REGIMES = ["no impacts", "symmetric 1:1", "asymmetric 1:1", "irregular"];

export class RegimeMap {
  constructor(page, colour) {
    Object.assign(this, { page, cells: [], known: 0 });
    this.plot = new Plot($("map"), colour, { xLabel: "detuning σ of a constant drive", yLabel: "excitation G" });
    const { canvas } = this.plot;
    const under = (event, action) => {
      const [sigma, g] = [this.plot.xAt(event), this.plot.yAt(event)];
      if (sigma !== undefined && g !== undefined) action(sigma, g);
    };
    canvas.onclick = (event) => under(event, (sigma, g) => page.goToDrive(sigma, g));
    canvas.onpointermove = (event) => under(event, (sigma, g) => (canvas.title = `${this.at(sigma, g) ?? "not yet known"}: σ = ${sigma.toFixed(2)}, G = ${g.toFixed(2)}`));
  }

  // The cells of other settings are of no use.
  reset() {
    const scene = MOTION.map((key) => this.page.values[key]).join();
    if (this.scene !== scene) Object.assign(this, { scene, cells: [], known: 0 });
  }

  // The regime at a point, if it is known.
  at(sigma, g) {
    const share = (value, [low, high], count) => Math.floor(((value - low) / (high - low)) * count);
    return this.cells[share(g, G, ROWS) * COLUMNS + share(sigma, SIGMA, COLUMNS)];
  }

  // A point of a cell, by shares of its width and height.
  #point(cell, x, y) {
    const along = ([low, high], share) => low + share * (high - low);
    return [along(SIGMA, ((cell % COLUMNS) + x) / COLUMNS), along(G, (Math.floor(cell / COLUMNS) + y) / ROWS)];
  }

  get done() { return this.known === COLUMNS * ROWS; }

  draw(point) {
    const { page, plot, cells } = this;
    for (const end = performance.now() + TIME; !this.done && performance.now() < end;) {
      const cell = (this.known++ * STRIDE) % (COLUMNS * ROWS);
      cells[cell] = REGIMES[page.bench.regime(...this.#point(cell, 0.5, 0.5))];
      if (this.done || this.known % 100 === 0) this.#legend();
    }
    plot.begin(SIGMA, G);
    cells.forEach((regime, cell) => plot.cell(this.#point(cell, 0, 0), this.#point(cell, 1, 1), name(regime)));
    if (point.G > 0) plot.points([[point.sigma, point.G]], "particle", { label: "now", radius: 5 });
    plot.end();
  }

  #legend() {
    const seen = REGIMES.filter((regime) => this.cells.includes(regime));
    $("regimes").replaceChildren(...seen.map((regime) => {
      const entry = Object.assign(document.createElement("li"), { textContent: regime });
      entry.style.setProperty("--colour", `var(--${name(regime)})`);
      return entry;
    }));
  }
}

// The name of a regime's colour.
const name = (regime) => regime.replace(/[^a-z0-9]+/g, "-");
