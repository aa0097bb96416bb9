// The start of the page: on the module, or on an experiment that `vines ... --watch` serves.

import { $, bind, say } from "./controls.js";
import { read, slug } from "./link.js";
import { load } from "./module.js";
import { Page, calm } from "./page.js";
import { begin, judge, story } from "./story.js";
import { Watching } from "./watch.js";

// Starts what the address asks for.
function follow(page) {
  let wanted = { values: {}, changes: [], samples: 0 };
  say("");
  try {
    wanted = read(location.hash, page.table);
  } catch (error) {
    say(error.message);
  }
  if (wanted.scene) {
    $("scene").value = slug(wanted.scene);
    begin(page, wanted.scene);
    return page.play(!calm.matches);
  }
  page.start(wanted.values, wanted.changes);
  if (wanted.samples > 0) page.goTo((wanted.samples - 1) * page.step, wanted.samples);
  page.play(wanted.samples === 0 && !calm.matches);
}

async function main() {
  const table = await (await fetch("settings.json")).json();
  const page = table.watch ? new Watching(table) : new Page(table, await load("vines_live.wasm", table.settings));
  if (!table.watch) {
    follow(page);
    page.setSpeed(1);
    // Back, forward, or a link that was pasted.
    addEventListener("hashchange", () => follow(page));
    story(page);
  }
  bind(page);
  window.live = { page, frames: 0 };
  let before = performance.now();
  const frame = (now) => {
    const passed = Math.min(0.1, (now - before) / 1000);
    before = now;
    try {
      page.advance(passed);
      // An experiment may not have begun yet.
      if (page.rows.length) {
        page.pictures.draw(now);
        page.showTime();
        judge(page);
      }
    } catch (error) {
      page.play(false);
      say(error.message);
    }
    window.live.frames++;
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

$("fallback").remove();
main().catch((error) => say(error.message));
