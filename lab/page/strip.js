// The status strip: lamp, frequency, amplitude, phase gauge, and what to do next.

import { $ } from "./controls.js";
import { surface } from "./rig.js";

// Lamps, by the number of the loop's state: text and kind.
const LAMPS = [["IDLE", "off"], ["STARTING", "wait"], ["SEARCHING", "wait"], ["LOCKED", "good"], ["FAULT", "bad"], ["FAULT", "bad"], ["FREE DECAY", "decay"]];

// What to do about a fault, by its number.
const REMEDIES = {
  1: "A sensor reading is not usable. Lower the sensor noise, then restart.",
  2: "The response exceeded its limit. Lower G, then restart.",
  3: "No lock was found in time. Change G or the phase target, or lower the noise, then restart.",
  4: "The lock was lost. Raise G, lower the noise or widen the bandwidth, then restart.",
  5: "The motion is too small for its noise. Raise G or lower the noise, then restart.",
  6: "The readings contradict the drive, as with a hand on the mass. Restart, or lower the noise first.",
};

// The sentence, and the button that it recommends.
function advice(page, status, point, regime, replay) {
  if (replay) return ["A replay of the record. Run goes on from here; Now returns to the present.", "now", "Now"];
  if (status.advice) return [status.advice, "", ""];
  if (page.values.closed && status.fault) return [REMEDIES[status.fault], "restart", "Restart"];
  if (!page.driving) {
    const where = point.decays ? "The drive is off: the motion slides down the backbone." : "The particle no longer meets both walls in turn: the backbone ends, and the mass rings down alone.";
    return [where, "drive", "Drive on"];
  }
  const done = page.points.filter((one) => one[0] <= page.shown).length;
  if (done < page.points.length) return [`The backbone is tracked level by level: ${done} of ${page.points.length} points are measured.`, page.speed < 10 ? "faster" : "", "Faster"];
  if (regime === "no impacts") return ["The particle does not meet the walls: drag it to one, or raise G.", "particle", "Move it"];
  if (!page.values.closed) return ["The loop is open: the drive keeps its frequency. Close it to find resonance.", "closed", "Close the loop"];
  if (status.locked) return ["Resonance is found. Let go to see the free decay, or track the backbone.", "drive", "Let go"];
  return ["The loop changes the frequency until the phase error is zero.", page.speed < 3 ? "faster" : "", "Faster"];
}

const set = (id, text) => { if ($(id).textContent !== text) $(id).textContent = text; };

export class Strip {
  constructor(colour) { this.colour = colour; }

  draw(page, status, point, [regime], replay) {
    const closed = page.values.closed !== 0;
    const [text, kind] = replay ? ["REPLAY", "off"]
      : status.lamp ? status.lamp
      : !closed ? [page.driving ? "OPEN LOOP" : "FREE DECAY", page.driving ? "off" : "decay"]
      : LAMPS[status.state];
    set("lamp", text);
    $("lamp").dataset.kind = kind;
    set("hertz", `${(point.omega / (2 * Math.PI)).toFixed(3)} Hz`);
    set("sigma", `σ = ${point.sigma.toFixed(3)}`.replace("-", "−"));
    // Of a structure at its sensor.
    set("millimetres", `${(point.C * (page.bench.host?.gap ?? page.values.gap)).toFixed(2)} mm`);
    set("amplitude", `C = ${point.C.toFixed(3)}`);
    const [sentence, action, label] = advice(page, status, point, regime, replay);
    set("advice", sentence);
    set("act", label);
    $("act").style.visibility = action ? "" : "hidden";
    page.advised = action;
    // Without a drive there is no phase to speak of.
    this.#gauge(closed && point.G > 0 && !Number.isNaN(point.error) ? point.error : undefined, status);
  }

  // The phase error between the limits beyond which the lock is lost; in the green band it counts as locked.
  #gauge(error, { tolerance, unlock }) {
    const { context: c, width, height } = surface($("gauge"));
    const range = 1.35 * unlock, y = 0.36 * height, thick = 8;
    const x = (degrees) => 8 + (0.5 + Math.max(-0.5, Math.min(0.5, degrees / (2 * range)))) * (width - 16);
    c.clearRect(0, 0, width, height);
    const bar = (low, high, shade) => { c.fillStyle = this.colour(shade); c.fillRect(x(low), y - thick / 2, Math.max(2, x(high) - x(low)), thick); };
    bar(-range, -unlock, "bad");
    bar(-unlock, unlock, "line");
    bar(unlock, range, "bad");
    bar(-tolerance, tolerance, "green");
    c.font = "12px system-ui, sans-serif";
    c.textAlign = "center";
    c.fillStyle = this.colour("faint");
    for (const mark of [-unlock, 0, unlock]) c.fillText(`${mark.toFixed(0)}°`.replace("-", "−"), x(mark), height - 3);
    if (error === undefined) return;
    const at = x(error);
    c.fillStyle = this.colour("ink");
    c.beginPath(); c.moveTo(at, y + 3); c.lineTo(at - 6, y - 12); c.lineTo(at + 6, y - 12); c.fill();
  }
}
