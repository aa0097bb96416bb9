// The page: clock, motion and changes.

import { $, SPEEDS, control, say } from "./controls.js";
import { MINUTE, Pictures } from "./pictures.js";
import { Record } from "./record.js";
import { bindScenes } from "./story.js";

// Most samples in one frame: a slower machine falls behind the clock instead of freezing the page.
const MOST_SAMPLES = 6000;
export const calm = matchMedia("(prefers-reduced-motion: reduce)");

export class Page {
  playing = true;
  speed = 1;
  driving = true;

  constructor(table, bench) {
    this.table = table;
    this.bench = bench;
    this.rows = new Record(bench.columns.length);
    this.pictures = new Pictures(this, calm);
    this.#controls();
    bindScenes(this);
  }

  // ---- the motion ----

  start(values, changes = []) {
    this.pictures.keepGhost();
    this.values = { ...this.bench.defaults, ...values };
    this.first = { ...this.values };
    this.bench.restart(this.values);
    this.pictures.restart();
    this.changes = [];
    this.pending = changes;
    this.samples = 0;
    this.shown = 0;
    this.driving = true;
    this.points = [];
    this.rows.clear();
    this.showControls();
    this.#run(1);
    this.status = this.bench.status();
    this.step = this.status.sampleTime;
  }

  // Notes a change, so that a link repeats it, and makes it.
  change(key, value) {
    this.toEnd();
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
      } else if (key === "mass" || key === "particle") {
        this.bench.place(key, value);
      } else {
        this.values = { ...before, [key]: value };
        this.bench.apply(this.values);
        if (["gap", "gap_difference", "mass_ratio"].includes(key)) {
          this.start(this.values);
        } else {
          this.pictures.curves();
        }
      }
      say("");
    } catch (error) {
      this.values = before;
      this.changes.pop();
      say(error.message);
    }
    this.points = this.bench.tracked();
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
      this.rows.push(this.bench.run(now));
      this.samples += now;
      count -= now;
    }
  }

  // Goes on by `passed` seconds of the clock on the wall.
  advance(passed) { if (this.playing) this.goTo(this.shown + passed * this.speed); }

  // Runs until `time`, s, and shows the plant at that instant.
  goTo(time, most = MOST_SAMPLES) {
    const need = Math.max(0, Math.floor(time / this.step) + 1 - this.samples);
    const count = Math.min(most, need);
    this.#run(count);
    this.shown = Math.min(time, this.samples * this.step);
    return count === need;
  }

  // ---- the past ----

  // The present, s.
  get end() { return this.samples * this.step; }

  // Whether a time before the present is shown.
  replays() { return this.shown < (this.samples - 1.5) * this.step; }

  // Shows a time of the record; running goes on from there, from the record up to the present.
  scrub(time) {
    this.play(false);
    this.shown = Math.max(this.rows.row(0)[0], Math.min(this.end, time));
  }

  toEnd() { if (this.replays()) this.shown = this.end; }

  // The row of the record at a time.
  rowAt(time) {
    return Math.max(0, Math.min(this.rows.length - 1, this.rows.length - this.samples + Math.floor(time / this.step + 1e-6)));
  }

  showTime() {
    const { end } = this;
    $("time").min = -Math.min(MINUTE, end - this.rows.row(0)[0]);
    $("time").value = this.replays() ? this.shown - end : 0;
    $("ago").textContent = this.replays() ? `${(end - this.shown).toFixed(1)} s ago` : "now";
  }

  // ---- going somewhere ----

  // Drives to a point [sigma, C, 1 if stable, G] of the backbone.
  goToPoint([sigma, c, stable, g]) {
    const where = `σ = ${sigma.toFixed(2)}, C = ${c.toFixed(2)}`;
    if (!stable) return say(`The point ${where} is unstable under a constant drive: Track backbone reaches and holds it.`);
    if (!this.values.closed) this.change("detuning", Number(sigma.toFixed(4)));
    this.change("excitation", Number(g.toFixed(4)));
  }

  // Starts again under a constant drive, as the cells of the map do.
  goToDrive(sigma, g) {
    say("");
    this.start({ ...this.values, closed: 0, detuning: Number(sigma.toFixed(2)), excitation: Number(g.toFixed(2)) });
    this.play(true);
  }

  toNextImpact() {
    this.toEnd();
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

  // ---- controls ----

  #controls() {
    $("speed").replaceChildren(...SPEEDS.map((speed) => new Option(speed < 1 ? `1/${Math.round(1 / speed)}` : `${speed}×`, speed)));
    $("speed").onchange = () => this.setSpeed(Number($("speed").value));
    $("time").oninput = () => this.scrub(this.end + Number($("time").value));
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
    // Settings without an effect in the present loop.
    for (const [key, inert] of [["detuning", this.values.closed !== 0], ["phase_target", this.values.closed === 0], ["bandwidth", this.values.closed === 0]]) {
      const box = $(key).parentElement;
      box.classList.toggle("inert", inert);
      for (const input of box.querySelectorAll("input")) input.disabled = inert;
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
