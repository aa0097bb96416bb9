// The page on a running experiment, which `vines ... --watch` serves: read-only, without the module.

import { $, say } from "./controls.js";
import { COLUMNS } from "./module.js";
import { Page } from "./page.js";

// Largest lag of the picture behind the last row, s: rows arrive in groups.
const LAG = 0.2;

// What the page asks of the module, answered from what the server sends.
class Experiment {
  columns = COLUMNS;
  state = {};

  constructor(watch) {
    const { host, values, particle_in_response: share } = watch;
    // Gaps between curves are null: JSON has no NaN.
    const curve = watch.exact.map((point) => point.map((value) => value ?? NaN));
    Object.assign(this, { watch, host, curve, share, defaults: { ...values, closed: 1 } });
  }

  status() {
    const { watch, state, driven } = this;
    const status = {
      sampleTime: watch.sample_time, omega0: watch.omega0, tolerance: watch.tolerance, unlock: watch.unlock,
      state: state.state ?? undefined, settled: state.settled, locked: state.state === 3, fault: state.fault ?? 0,
      impacts: state.impacts ?? undefined, perPeriod: state.per_period,
      advice: this.outcome ?? `${watch.title} is running, and this page only shows it. The slider below the rig goes back.`,
    };
    if (this.outcome) status.lamp = this.failed ? ["FAILED", "bad"] : ["ENDED", "off"];
    // A rig does not know the state of its controller.
    else if (state.state == null) status.lamp = driven ? ["DRIVEN", "wait"] : ["NO DRIVE", "off"];
    return status;
  }

  words() { return [this.state.regime ?? "", this.state.fault_text ?? ""]; }
  manifold(end) { return this.watch.manifold.filter(([b]) => b <= end); }
  theory() { return this.watch.theory; }
  exact() { return this.curve; }
  tracked() { return []; }
  look() {}
  restart() {}
  run() { return []; }
}

export class Watching extends Page {
  constructor(table) {
    const { watch } = table;
    super({ settings: table.settings.filter(({ key }) => key in watch.values), scenes: [] }, new Experiment(watch));
    document.title = `${watch.title}: live`;
    document.querySelector("h1 small").textContent = `watching ${watch.title}`;
    for (const id of ["impact", "speed", "drive", "track", "restart", "defaults", "scene", "link"]) {
      $(id).disabled = true;
      ($(id).closest("label") ?? $(id)).hidden = true;
    }
    document.body.classList.add("watching");
    $("tour").hidden = true;
    for (const element of document.querySelectorAll(".sim")) element.hidden = true;
    if (watch.host?.drop_out) {
      document.querySelector(".drop-out").hidden = false;
      document.querySelector(".drop-out h2").textContent = watch.host.drop_out.title;
    }
    this.start();
    const source = new EventSource("rows");
    source.onmessage = ({ data }) => this.#take(JSON.parse(data), source);
    // The server tells the end; without it, the program was killed.
    source.onerror = () => {
      source.close();
      say("The connection to the experiment is lost. Reload the page when it runs again.");
    };
  }

  #take({ begins, rows, state, outcome }, source) {
    if (begins) this.start();
    this.bench.state = state ?? {};
    this.rows.push(Float64Array.from(rows.flat(), (value) => value ?? NaN));
    this.samples += rows.length;
    this.bench.driven = this.driving = this.rows.length > 0 && this.rows.row(-1)[6] > 0;
    if (outcome) {
      source.close();
      const { title } = this.bench.watch, { error } = outcome;
      const text = error ? `${title} has failed: ${error}.` : `${title} has ended; its results are in the terminal.`;
      Object.assign(this.bench, { outcome: text, failed: !!error });
      if (!this.samples) say(text);
    }
  }

  start() {
    super.start(this.bench.defaults);
    this.samples = 0;
  }

  get end() { return this.rows.length ? this.rows.row(-1)[0] : 0; }

  advance(passed) {
    const { end } = this;
    if (this.playing) this.shown = Math.min(end, Math.max(this.shown + passed, end - LAG));
  }

  rowAt(time) { return this.rows.at(time); }
  replays() { return !this.playing; }
  toEnd() { this.play(true); }

  showControls() {
    for (const { key } of this.table.settings) {
      $(key).value = Number(this.values[key].toPrecision(6));
      for (const input of $(key).parentElement.querySelectorAll("input")) input.disabled = true;
    }
    $("play").textContent = this.playing ? "Pause" : "Run";
  }

  // Nothing here changes the experiment.
  change() {}
  goToPoint() {}
}
