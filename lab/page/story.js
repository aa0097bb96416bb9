// The panel above the bench: the introduction in three steps, shown once, and what to try in a scene.

import { $, SPEEDS, say } from "./controls.js";
import { slug } from "./link.js";

const KEY = "vines-story";
const INTRODUCTION = [
  { text: "The particle meets the walls. Ten times slower than real: the base (blue) shakes the mass, and each impact, where a wall lights up, takes energy away.", next: "Next", begin: (page) => page.setSpeed(0.1) },
  { text: "The loop finds resonance, now ten times faster than real: it changes the frequency until the phase error is zero, and the lamp turns to LOCKED.", next: "Let go", begin: (page) => page.setSpeed(10) },
  { text: "Let go: without the drive, the decay draws the backbone, which is what the experiment is for. Everything on this page is yours to try.", next: "Done", begin: (page) => { page.setSpeed(0.3); page.change("drive", 0); $("backbone").scrollIntoView({ block: "nearest" }); } },
];

const remembered = () => { try { return localStorage.getItem(KEY) !== null; } catch { return false; } };

function panel(title, text, next, action, skip, close) {
  $("story").hidden = false;
  $("story").classList.remove("solved");
  $("story-step").textContent = title;
  $("story-text").textContent = text;
  $("story-next").textContent = next;
  $("story-next").hidden = !next;
  $("story-next").onclick = action;
  $("story-skip").textContent = skip;
  $("story-skip").onclick = close;
}

function end(page) {
  try { localStorage.setItem(KEY, "seen"); } catch { /* It is shown again next time. */ }
  $("story").hidden = true;
  page.setSpeed(1);
}

function introduce(page, step) {
  if (step === INTRODUCTION.length) return end(page);
  const { text, next, begin } = INTRODUCTION[step];
  panel(`${step + 1} of ${INTRODUCTION.length}`, text, next, () => { introduce(page, step + 1); page.play(true); }, "Skip", () => end(page));
  begin(page);
}

// Starts a scene `scene.from` seconds after its start, and says what to try. The button does it, or shows how a challenge is solved: by
// the changes `scene.tries`, [seconds from now, setting, value]. `scene.after` seconds later the motion is the last of `scene.shows`.
export function begin(page, scene) {
  page.start(scene.values, []);
  page.goTo(scene.from ?? 0, Infinity);
  const { tries, goal } = scene;
  page.challenge = goal && scene;
  const act = () => {
    // From the same start each time, so that the same happens.
    page.challenge = goal && { ...scene, shown: true };
    page.start(scene.values, []);
    page.goTo(scene.from ?? 0, Infinity);
    page.pending = tries.map(([from, key, value]) => [page.samples + Math.round(from / page.step), key, value]);
    // What follows takes some seconds.
    page.setSpeed(SPEEDS.findLast((speed) => speed <= scene.after / 4));
    page.play(true);
  };
  panel(scene.name, scene.help, tries ? (goal ? "Show how" : "Do it") : "", act, "Close", () => { $("story").hidden = true; page.challenge = undefined; });
}

// The list of scenes, in groups.
export function bindScenes(page) {
  const { scenes } = page.table;
  $("scene").replaceChildren(...[...new Set(scenes.map((scene) => scene.group))].map((label) => {
    const group = Object.assign(document.createElement("optgroup"), { label });
    group.append(...scenes.filter((scene) => scene.group === label).map((scene) => new Option(scene.name, slug(scene))));
    return group;
  }));
  $("scene").onchange = () => { say(""); begin(page, scenes.find((scene) => slug(scene) === $("scene").value)); };
}

// Whether the challenge is solved: its regime, and the ranges of its settings and numbers.
export function judge(page) {
  if (!page.challenge) return;
  const { goal: { regime, ...ranges }, name, shown } = page.challenge;
  const numbers = { ...page.status, ...page.values };
  if (page.bench.words()[0] !== regime || !Object.entries(ranges).every(([key, [low, high]]) => numbers[key] >= low && numbers[key] <= high)) return;
  page.challenge = undefined;
  $("story").classList.add("solved");
  $("story-step").textContent = `${shown ? "Shown" : "Solved"}: ${name}`;
}

// Shows the introduction to who has not seen it, unless a link asks for something else.
export function story(page) {
  $("tour").onclick = () => { page.start({}); introduce(page, 0); page.play(true); };
  if (!remembered() && !location.hash) introduce(page, 0);
}
