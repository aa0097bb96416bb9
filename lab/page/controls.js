// Controls of the page: settings, buttons and keys.

import { csv, link } from "./link.js";
import { sound } from "./sound.js";

export const SPEEDS = [0.01, 0.03, 0.1, 0.3, 1, 3, 10, 30];

export const $ = (id) => document.getElementById(id);

export function say(text) {
  $("message").textContent = text;
  $("message").hidden = !text;
}

// The control of one setting of `page`.
export function control(page, { key, symbol, name, unit, min, max, step, help }) {
  const box = document.createElement("div");
  const label = document.createElement("label");
  const input = document.createElement("input");
  box.title = help;
  input.id = key;
  input.setAttribute("aria-description", help);
  label.htmlFor = key;
  if (unit === "bool") {
    box.className = "check";
    input.type = "checkbox";
    input.onchange = () => page.change(key, input.checked ? 1 : 0);
    label.textContent = name;
    box.append(input, label);
    return box;
  }
  box.className = "setting";
  label.innerHTML = symbol ? `${name} <i>${symbol}</i>` : name;
  if (unit) label.append(Object.assign(document.createElement("span"), { className: "unit", textContent: ` (${unit})` }));
  Object.assign(input, { type: "number", min, max, step });
  const slider = Object.assign(document.createElement("input"), { type: "range", min, max, step });
  slider.setAttribute("aria-label", name);
  const set = (value) => {
    if (!Number.isFinite(value) || value < min || value > max) {
      say(`${name} = ${value} is refused: allowed are ${min} to ${max}${unit ? ` ${unit}` : ""}.`);
      return page.showControls();
    }
    return page.change(key, value);
  };
  slider.oninput = () => set(Number(slider.value));
  input.onchange = () => set(input.value === "" ? NaN : Number(input.value));
  box.append(label, input, slider);
  return box;
}

// Buttons and keys.
export function bind(page) {
  const actions = {
    play: () => page.play(!page.playing),
    impact: () => { page.play(false); page.toNextImpact(); },
    drive: () => page.change("drive", page.driving ? 0 : 1),
    track: () => page.change("track", 1),
    defaults: () => { say(""); $("scene").selectedIndex = 0; $("story").hidden = true; page.challenge = undefined; page.start({}); },
    restart: () => { say(""); page.start(page.values); },
    link: async () => {
      const { address, omitted } = link(page);
      history.replaceState(null, "", address);
      say(omitted);
      const what = omitted ? "Settings only: " : "";
      try { await navigator.clipboard.writeText(address); $("link").textContent = `${what}Copied`; }
      catch { $("link").textContent = `${what}In the address bar`; }
      setTimeout(() => ($("link").textContent = "Copy link"), 1500);
    },
    csv: () => {
      const file = Object.assign(document.createElement("a"), { href: URL.createObjectURL(new Blob([csv(page.rows)], { type: "text/csv" })), download: "vines.csv" });
      file.click();
      setTimeout(() => URL.revokeObjectURL(file.href), 1000);
    },
    sound: () => {
      page.sound = page.sound ? undefined : sound();
      $("sound").setAttribute("aria-pressed", String(!!page.sound));
      $("sound").textContent = page.sound ? "Sound on" : "Sound off";
    },
    // What the status strip recommends.
    act: () => actions[page.advised](),
    help: () => {
      $("about").hidden = !$("about").hidden;
      $("help").setAttribute("aria-expanded", String(!$("about").hidden));
    },
  };
  for (const [id, action] of Object.entries(actions)) $(id).onclick = action;
  Object.assign(actions, {
    now: () => page.toEnd(),
    faster: () => page.setSpeed(10),
    closed: () => page.change("closed", 1),
    // What dragging does: the mass to b, the particle to a wall.
    mass: () => page.change("mass", 1),
    particle: () => page.change("particle", 1),
  });
  const keys = { " ": "play", ".": "impact", d: "drive", t: "track", r: "restart", m: "mass", p: "particle", "?": "help" };
  document.addEventListener("keydown", (event) => {
    // Fields take letters, buttons and check boxes the space; sliders take neither.
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select, input[type=number]")) return;
    if (event.key === " " && event.target.matches("button, input[type=checkbox]")) return;
    const change = { "[": -1, "]": 1 }[event.key];
    if (change) {
      const next = SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, SPEEDS.indexOf(page.speed) + change))];
      page.setSpeed(next);
    } else if (keys[event.key] && !$(keys[event.key])?.disabled) actions[keys[event.key]]();
    else return;
    event.preventDefault();
  });
}
