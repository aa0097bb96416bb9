// The WebAssembly module: plant, controller and theory. Its exports are described in live/module/src/exports.rs.

export const COLUMNS = ["time", "base", "response", "relative", "phaseError", "omega", "amplitude", "responseAmplitude", "motion", "speed", "decays"];
// Places of the columns in a row.
export const ROW = Object.fromEntries(COLUMNS.map((name, i) => [name, i]));
const STATUS = ["time", "sampleTime", "omega0", "sigma", "C", "B", "phaseError", "G", "locked", "settled", "state", "fault", "impacts", "perPeriod", "dissipated", "tolerance", "unlock"];
const LOOK = ["time", "base", "q1", "q2", "relative", "speed", "wall", "impacts"];

// States of the loop, by number.
export const LOOP = ["idle", "the drive rises", "searching", "locked", "switched off", "switched off", "off"];

const named = (names, values) => Object.fromEntries(names.map((name, i) => [name, values[i]]));

export async function load(url, settings) {
  if (typeof WebAssembly !== "object") throw new Error("This browser cannot run WebAssembly, which the simulation needs. Try a current Firefox, Chromium, Edge or Safari.");
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`The simulation ${url} could not be loaded (HTTP ${answer.status}). Build the page with scripts/live.`);
  const { instance } = await WebAssembly.instantiate(await answer.arrayBuffer(), {});
  return new Bench(instance.exports, settings);
}

class Bench {
  columns = COLUMNS;

  constructor(exports, settings) {
    this.exports = exports;
    this.keys = settings.map((setting) => setting.key);
    this.defaults = Object.fromEntries(this.keys.map((key, i) => [key, this.#settings()[i]]));
  }

  // The memory may grow, and its views become invalid: every access makes a new one.
  #settings() {
    return new Float64Array(this.exports.memory.buffer, this.exports.settings_address(), this.keys.length);
  }

  #write(values) {
    this.#settings().set(this.keys.map((key) => values[key]));
  }

  message() {
    const bytes = new Uint8Array(this.exports.memory.buffer, this.exports.message_address(), this.exports.message_length());
    const text = new TextDecoder().decode(bytes);
    const numbers = new Float64Array(this.exports.memory.buffer, this.exports.output_address(), text.split("{}").length - 1);
    let n = 0;
    return text.replace(/\{\}/g, () => Number(numbers[n++].toPrecision(6)));
  }

  #check(count) {
    if (count < 0) throw new Error(this.message());
    return count;
  }

  #values(count) {
    this.#check(count);
    return new Float64Array(this.exports.memory.buffer, this.exports.output_address(), count);
  }

  restart(values) { this.#write(values); this.#check(this.exports.restart()); }
  apply(values) { this.#write(values); this.#check(this.exports.apply()); }
  drive(on) { this.#check(this.exports.drive(on ? 1 : 0)); }
  place(part, to) { this.#check(this.exports.place(part === "mass" ? 1 : 0, to)); }
  track() { this.#check(this.exports.track()); }
  // Rows of the record, COLUMNS values each; valid until the next call.
  run(samples) { return this.#values(this.exports.run(samples)); }
  look(ahead) { return named(LOOK, this.#values(this.exports.look(ahead))); }
  nextImpact(after) { return this.#values(this.exports.next_impact(after))[0]; }
  status() { return named(STATUS, this.#values(this.exports.status())); }
  // [regime, fault of the loop]
  words() { this.exports.words(); return this.message().split("|"); }
  #rows(count, width) {
    const values = this.#values(count);
    return Array.from({ length: count / width }, (_, i) => Array.from(values.subarray(i * width, (i + 1) * width)));
  }
  manifold(bMax, points) { return this.#rows(this.exports.manifold(bMax, points), 3); }
  theory(points) { return this.#rows(this.exports.theory_backbone(points), 3); }
  // The number of the regime under a constant drive.
  regime(sigma, g) { return this.#values(this.exports.regime(sigma, g))[0]; }
  exact(points) { return this.#rows(this.exports.exact_backbone(points), 4); }
  tracked() { return this.#rows(this.exports.tracked(), 5); }
}
