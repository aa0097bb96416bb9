// The page in real browsers: VINES_PAGE is its folder, VINES_LOCK the sample and the bits of the native lock, and the
// native program's least time for a sample, ns.

import assert from "node:assert/strict";
import { createServer } from "node:http";
import { mkdir, readFile, stat } from "node:fs/promises";
import { extname, join } from "node:path";
import { after, before, describe, test } from "node:test";
import puppeteer from "puppeteer-core";

const FOLDER = process.env.VINES_PAGE;
const SCREENS = process.env.VINES_SCREENS;
const [SAMPLE, BITS, NATIVE] = process.env.VINES_LOCK.split(" ");
const TYPES = { ".html": "text/html", ".js": "text/javascript", ".css": "text/css", ".json": "application/json", ".wasm": "application/wasm" };
// An isolated page has a finer clock: otherwise that of Firefox shows whole milliseconds.
const ISOLATED = { "cross-origin-opener-policy": "same-origin", "cross-origin-embedder-policy": "require-corp" };
const BROWSERS = [
  { name: "chromium", options: { executablePath: "/usr/bin/chromium", args: ["--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync"] } },
  { name: "firefox", options: { browser: "firefox", executablePath: "/usr/bin/firefox-esr" } },
];

let server, address;
before(async () => {
  server = createServer(async (request, response) => {
    const path = request.url.split("?")[0];
    try {
      const file = join(FOLDER, path === "/" ? "index.html" : path);
      const content = await readFile(file);
      response.writeHead(200, { "content-type": TYPES[extname(file)] ?? "application/octet-stream", ...ISOLATED }).end(content);
    } catch {
      response.writeHead(404).end();
    }
  });
  await new Promise((ready) => server.listen(0, "127.0.0.1", ready));
  address = `http://127.0.0.1:${server.address().port}/`;
});
after(() => server.close());

test("the module has at most 150 KB", async () => {
  const { size } = await stat(join(FOLDER, "vines_live.wasm"));
  console.log(`the module has ${size} bytes`);
  assert.ok(size <= 150 * 1024, `${size} bytes`);
});

for (const { name, options } of BROWSERS) {
  describe(name, () => {
    let browser;
    before(async () => (browser = await puppeteer.launch({ headless: true, ...options })));
    after(() => browser?.close());

    // A page that is ready, and the errors it reported.
    async function open(hash = "", prepare = async () => {}) {
      const page = await browser.newPage();
      const errors = [];
      page.on("pageerror", (error) => errors.push(String(error)));
      page.on("console", (line) => line.type() === "error" && errors.push(line.text()));
      await page.setViewport({ width: 1600, height: 1000 });
      await prepare(page);
      await page.goto(`${address}${hash}`);
      return { page, errors };
    }
    const ready = (page) => page.waitForFunction(() => window.live?.frames > 2, { timeout: 30000 });

    test("the default scene locks with the bits of the native program", async () => {
      const { page, errors } = await open();
      await ready(page);
      const found = await page.evaluate((sample) => {
        const one = window.live.page;
        one.play(false);
        one.start({});
        one.goTo((sample - 1) * one.step, sample);
        const omega = one.rows[sample - 1][5];
        const view = new DataView(new ArrayBuffer(8));
        view.setFloat64(0, omega);
        return { bits: view.getBigUint64(0).toString(16).padStart(16, "0"), settled: one.bench.status().settled, samples: one.samples };
      }, Number(SAMPLE));
      assert.deepEqual(found, { bits: BITS, settled: 1, samples: Number(SAMPLE) });
      assert.deepEqual(errors, []);
      await page.close();
    });

    test("the time for a sample is reported beside the native one", async () => {
      const { page, errors } = await open();
      await ready(page);
      const least = await page.evaluate((samples) => {
        const one = window.live.page;
        one.play(false);
        one.start({});
        // Browsers compile again what is called often, in the background.
        const begun = performance.now();
        while (performance.now() - begun < 2000) one.bench.run(samples);
        return Math.min(...Array.from({ length: 40 }, () => {
          const start = performance.now();
          for (let block = 0; block < 100; block++) one.bench.run(samples);
          return ((performance.now() - start) * 1e6) / (100 * samples);
        }));
      }, 1000);
      assert.ok(least > 0);
      console.log(`${name}: ${least.toFixed(0)} ns for a sample, ${(least / Number(NATIVE)).toFixed(2)} times the native ${NATIVE} ns`);
      assert.deepEqual(errors, []);
      await page.close();
    });

    test("the backbone is tracked within 1e-3 of the exact orbits", async () => {
      const { page, errors } = await open();
      await ready(page);
      const worst = await page.evaluate(() => {
        const one = window.live.page;
        one.play(false);
        one.start({});
        one.goTo(12000 * one.step, 12001);
        one.change("track", 1);
        one.goTo(one.points.at(-1)[0], 1e6);
        const exact = one.bench.exact(4000).sort((p, q) => p[1] - q[1]);
        const distances = one.points.map(([, sigma, c]) => {
          const above = exact.findIndex((point) => point[1] >= c);
          const [p, q] = [exact[above - 1], exact[above]];
          return Math.abs(sigma - (p[0] + ((c - p[1]) / (q[1] - p[1])) * (q[0] - p[0])));
        });
        return { points: distances.length, worst: Math.max(...distances) };
      });
      console.log(`${name}: ${worst.points} points, largest difference in sigma at equal C ${worst.worst.toExponential(1)}`);
      assert.ok(worst.points > 20 && worst.worst < 1e-3, JSON.stringify(worst));
      assert.deepEqual(errors, []);
      await page.close();
    });

    test("every scene shows what its name says", async () => {
      const { page, errors } = await open();
      await ready(page);
      const found = await page.evaluate(() => {
        const one = window.live.page;
        one.play(false);
        return one.table.scenes.map((scene) => {
          one.start(scene.values);
          one.goTo(40000 * one.step, 40001);
          const regimes = {};
          let stuck = 0;
          for (let look = 0; look < 2000; look++) {
            one.goTo(one.shown + 10.3 * one.step, 11);
            stuck += one.bench.look(one.shown - (one.samples - 1) * one.step).wall !== 0;
            const [regime] = one.bench.words();
            regimes[regime] = (regimes[regime] ?? 0) + 1;
          }
          return { name: scene.name, stuck, regimes };
        });
      });
      const scene = (name) => found.find((one) => one.name === name);
      for (const name of ["Default lock", "From rest"]) assert.deepEqual(scene(name).regimes, { "symmetric 1:1": 2000 }, name);
      const captures = scene("Capture and loss").regimes;
      const captured = (captures["symmetric 1:1"] ?? 0) + (captures["asymmetric 1:1"] ?? 0);
      assert.ok(captured > 100 && captured < 1900, JSON.stringify(captures));
      assert.ok(scene("Chatter").stuck > 100, JSON.stringify(scene("Chatter")));
      assert.deepEqual(scene("Chaos").regimes, { irregular: 2000 });
      assert.deepEqual(errors, []);
      await page.close();
    });

    test("a link repeats the motion bit by bit", async () => {
      const { page } = await open("#excitation=1.3&changes=500:restitution:0.7,1500:drive:0&samples=3000");
      await ready(page);
      const state = async () => [(await import("/link.js")).link(window.live.page), window.live.page.rows.at(-1)];
      const first = await page.evaluate(state);
      const { page: other } = await open(first[0].slice(first[0].indexOf("#")));
      await ready(other);
      assert.deepEqual(await other.evaluate(state), first);
      assert.equal(first[1].length, 8);
      await page.close();
      await other.close();
    });

    test("an invalid link gets a clear sentence", async () => {
      for (const [hash, words] of [["#excitation=many", /Excitation = "many".*0 to 4/], ["#colour=1", /no setting "colour"/], ["#samples=1e9", /samples/], ["#changes=5", /invalid/]]) {
        const { page } = await open(hash);
        await ready(page);
        assert.match(await page.$eval("#message", (element) => element.textContent), words, hash);
        await page.close();
      }
    });

    test("a browser without WebAssembly is told so", async () => {
      const { page } = await open("", (page) => page.evaluateOnNewDocument(() => delete window.WebAssembly));
      await page.waitForFunction(() => !document.getElementById("message").hidden);
      assert.match(await page.$eval("#message", (element) => element.textContent), /cannot run WebAssembly/);
      await page.close();
    });

    test("every control works by keyboard", async () => {
      const { page, errors } = await open();
      await ready(page);
      const seen = new Set();
      for (let i = 0; i < 60; i++) {
        await page.keyboard.press("Tab");
        const element = await page.evaluate(() => {
          const one = document.activeElement;
          return one.id || (one.type === "range" ? `${one.previousElementSibling.id} slider` : one.tagName);
        });
        if (seen.has(element) && element === "play") break;
        seen.add(element);
        if (element.endsWith(" slider") || element === "closed") {
          const key = element.replace(" slider", "");
          const value = () => page.evaluate((key) => window.live.page.values[key], key);
          const was = await value();
          await page.keyboard.press(element === "closed" ? " " : "ArrowRight");
          if ((await value()) === was) await page.keyboard.press("ArrowLeft");
          assert.notEqual(await value(), was, element);
        }
      }
      const all = await page.evaluate(() => [...document.querySelectorAll("button:not(:disabled), select, input")].map((one) => one.id || `${one.previousElementSibling.id} slider`));
      assert.deepEqual(all.filter((id) => !seen.has(id)), []);
      await page.evaluate(() => document.activeElement.blur());
      const state = () => page.evaluate(() => ({ playing: window.live.page.playing, driving: window.live.page.driving, speed: window.live.page.speed, help: !document.getElementById("about").hidden }));
      const was = await state();
      for (const key of ["d", "]", "?", " "]) await page.keyboard.press(key);
      const now = await state();
      for (const key of Object.keys(was)) assert.notEqual(now[key], was[key], key);
      const before = await page.evaluate(() => window.live.page.shown);
      await page.keyboard.press("r");
      assert.ok((await page.evaluate(() => window.live.page.shown)) < before);
      await page.keyboard.press(".");
      assert.ok((await page.evaluate(() => window.live.page.bench.status().impacts)) >= 1);
      assert.deepEqual(errors, []);
      await page.close();
    });

    test("screenshots and frames per second", async () => {
      await mkdir(SCREENS, { recursive: true });
      for (const scheme of name === "chromium" ? ["light", "dark"] : ["light"]) {
        for (const width of [390, 1024, 1600]) {
          const { page, errors } = await open("#samples=31000", async (page) => {
            await page.setViewport({ width, height: width === 390 ? 844 : 1000 });
            if (name === "chromium") await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
          });
          await ready(page);
          await page.screenshot({ path: join(SCREENS, `${name}-${scheme}-${width}.png`), fullPage: true });
          const wide = await page.evaluate(() => document.documentElement.scrollWidth);
          assert.ok(wide <= width, `${wide} pixels wide in a window of ${width}`);
          assert.deepEqual(errors, []);
          await page.close();
        }
      }
      const { page } = await open();
      await ready(page);
      const counts = [];
      for (let second = 0; second < 10; second++) {
        const start = await page.evaluate(() => [window.live.frames, performance.now()]);
        await new Promise((done) => setTimeout(done, 1000));
        const end = await page.evaluate(() => [window.live.frames, performance.now()]);
        counts.push((1000 * (end[0] - start[0])) / (end[1] - start[1]));
      }
      console.log(`${name}: at real time at least ${Math.min(...counts).toFixed(0)} frames per second in ten seconds`);
      await page.close();
    });
  });
}
