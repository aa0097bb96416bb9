// The introduction in three steps, shown once.

import { $ } from "./controls.js";

const KEY = "vines-story";
const STEPS = [
  { text: "The particle meets the walls. Ten times slower than real: the base (blue) shakes the mass, and each impact, where a wall lights up, takes energy away.", next: "Next", begin: (page) => page.setSpeed(0.1) },
  { text: "The loop finds resonance, now ten times faster than real: it changes the frequency until the phase error is zero, and the lamp turns to LOCKED.", next: "Let go", begin: (page) => page.setSpeed(10) },
  { text: "Let go: without the drive, the decay draws the backbone, which is what the experiment is for. Everything on this page is yours to try.", next: "Done", begin: (page) => { page.setSpeed(0.3); page.change("drive", 0); $("backbone").scrollIntoView({ block: "nearest" }); } },
];

const remembered = () => { try { return localStorage.getItem(KEY) !== null; } catch { return false; } };

function end(page) {
  try { localStorage.setItem(KEY, "seen"); } catch { /* It is shown again next time. */ }
  $("story").hidden = true;
  page.setSpeed(1);
}

function show(page, step) {
  if (step === STEPS.length) return end(page);
  $("story").hidden = false;
  $("story-step").textContent = `${step + 1} of ${STEPS.length}`;
  $("story-text").textContent = STEPS[step].text;
  $("story-next").textContent = STEPS[step].next;
  $("story-next").onclick = () => { show(page, step + 1); page.play(true); };
  STEPS[step].begin(page);
}

// Shows it to who has not seen it, unless a link asks for something else.
export function story(page) {
  $("story-skip").onclick = () => end(page);
  $("tour").onclick = () => { page.start({}); show(page, 0); page.play(true); };
  if (!remembered() && !location.hash) show(page, 0);
}
