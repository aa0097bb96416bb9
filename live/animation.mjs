// Draws the animated picture of the README, lock and free decay, with the module of the live bench.
//
// node live/animation.mjs FOLDER    writes docs/lock-and-decay.svg; FOLDER is that of the page, which `scripts/live --out FOLDER` makes

import { readFile, writeFile } from "node:fs/promises";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

// Frames of the two parts, and their duration, s.
const LOCK = { frames: 210, seconds: 7 }, DECAY = { frames: 260, seconds: 5 };
// Time to the release, which is after the lock, and of the decay, s.
const RELEASE = 45, AFTER = 1.9;
// The lock is shown by a stroboscope: so many frames make a period of the motion.
const PERIOD = 22;
const WIDTH = 760, HEIGHT = 290;

// Rows of the record with the phase of the drive in periods, and the number of the row at which the loop has locked.
function record(bench, row) {
  bench.restart(bench.defaults);
  const rows = [];
  let turns = 0, locked;
  const run = (seconds, step) => {
    for (let left = Math.round(seconds / step); left > 0; left -= 100) {
      const values = bench.run(100);
      for (let i = 0; i < values.length; i += bench.width) {
        rows.push({ turns, ...Object.fromEntries(Object.entries(row).map(([name, at]) => [name, values[i + at]])) });
        turns += (values[i + row.omega] * step) / (2 * Math.PI);
      }
      locked ??= bench.status().locked ? rows.length : undefined;
    }
  };
  const { sampleTime } = (bench.run(1), bench.status());
  run(RELEASE, sampleTime);
  bench.drive(false);
  const release = rows.length;
  run(AFTER, sampleTime);
  return { rows, locked, release };
}

// The row of every frame.
function frames({ rows, release }) {
  const lock = Array.from({ length: LOCK.frames }, (_, frame) => {
    const time = release * (frame / LOCK.frames) ** 2;
    const turns = Math.floor(rows[Math.floor(time)].turns) + frame / PERIOD - Math.floor(frame / PERIOD);
    return Math.max(0, rows.findIndex((row) => row.turns >= turns));
  });
  const decay = Array.from({ length: DECAY.frames }, (_, frame) => release + Math.floor(((rows.length - 1 - release) * frame) / (DECAY.frames - 1)));
  return [...lock, ...decay];
}

export async function animation(folder) {
  const { load, ROW, COLUMNS } = await import(`data:text/javascript;base64,${(await readFile(join(folder, "module.js"))).toString("base64")}`);
  const { settings } = JSON.parse(await readFile(join(folder, "settings.json")));
  const wasm = (await readFile(join(folder, "vines_live.wasm"))).toString("base64");
  const bench = await load(`data:application/wasm;base64,${wasm}`, settings);
  bench.width = COLUMNS.length;
  const told = record(bench, ROW), { rows, locked, release } = told;
  const { omega0 } = bench.status(), { gap, mass_ratio: epsilon } = bench.defaults, b = gap * 1e-3;
  const shown = frames(told);
  const seconds = LOCK.seconds + DECAY.seconds;
  const time = (frame) => (frame < LOCK.frames ? (LOCK.seconds * frame) / LOCK.frames : LOCK.seconds + (DECAY.seconds * (frame - LOCK.frames)) / (DECAY.frames - 1)) / seconds;
  const keyTimes = shown.map((_, frame) => time(frame).toFixed(4)).join(";");
  const animate = (attribute, values) => `<animate attributeName="${attribute}" dur="${seconds}s" repeatCount="indefinite" keyTimes="${keyTimes}" values="${values.join(";")}"/>`;
  const move = (values) => `<animateTransform attributeName="transform" type="translate" dur="${seconds}s" repeatCount="indefinite" keyTimes="${keyTimes}" values="${values.map((x) => x.toFixed(1)).join(";")}"/>`;

  // The rig: w = q1 - q2 and v = q1 + epsilon q2. The base is not to scale.
  const scale = 52, q1 = ({ response, relative }) => (response + epsilon * relative) / (1 + epsilon) / b;
  const mass = shown.map((at) => scale * q1(rows[at]));
  const particle = shown.map((at) => scale * (q1(rows[at]) - rows[at].relative / b));
  const base = shown.map((at) => (rows[at].base / (b * epsilon)) * 9);

  // The plane of the backbone.
  const [left, top, wide, high] = [440, 34, 300, 200], X = [-2, 0.5], Y = [0, 0.6];
  const x = (sigma) => left + wide * Math.max(0, Math.min(1, (sigma - X[0]) / (X[1] - X[0]))), y = (c) => top + high * (1 - Math.max(0, Math.min(1, (c - Y[0]) / (Y[1] - Y[0]))));
  const place = (at) => [x(((rows[at].motion || rows[at].omega) / omega0 - 1) / epsilon), y(rows[at].responseAmplitude / b)];
  const line = (points) => points.map((point) => point.map((value) => value.toFixed(1)).join(",")).join(" ");
  const exact = bench.exact(200).filter(([sigma, c]) => sigma > X[0] && sigma < X[1] && c < Y[1]);
  const places = shown.map(place);
  // The curves up to the present frame, by their lengths. The decay ends where the impacts lose synchrony.
  const synchronous = shown.findIndex((at, frame) => frame > LOCK.frames + 20 && !rows[at].decays);
  const drawn = (first, last, colour) => {
    const part = places.slice(first, last), lengths = [0];
    for (let i = 1; i < part.length; i++) lengths.push(lengths[i - 1] + Math.hypot(part[i][0] - part[i - 1][0], part[i][1] - part[i - 1][1]));
    const left = shown.map((_, frame) => (1 - lengths[Math.max(0, Math.min(part.length - 1, frame - first))] / lengths.at(-1)).toFixed(3));
    return `<polyline points="${line(part)}" fill="none" stroke="${colour}" stroke-width="2.5" pathLength="1" stroke-dasharray="1 1">${animate("stroke-dashoffset", left)}</polyline>`;
  };
  // The decay begins where its fit does.
  const begin = shown.findIndex((at, frame) => frame >= LOCK.frames && rows[at].decays);
  const now = places.map((point, frame) => (frame >= LOCK.frames && frame < begin ? places[LOCK.frames - 1] : frame >= synchronous ? places[synchronous - 1] : point));
  const lockedAt = shown.findIndex((at) => at >= locked);
  const words = [["searching", 0, lockedAt, "#4D4D4D"], ["locked at phase resonance", lockedAt, LOCK.frames, "#17754A"], ["free decay along the backbone", LOCK.frames, synchronous, "#D55E00"], ["the impacts lose synchrony", synchronous, shown.length, "#4D4D4D"]];
  const lamps = words.map(([text, from, to, colour]) => {
    const visible = shown.map((_, frame) => Number(frame >= from && frame < to));
    return `<text x="30" y="30" font-size="19" fill="${colour}" opacity="${from === lockedAt ? 1 : 0}">${text}${animate("opacity", visible).replace("<animate ", '<animate calcMode="discrete" ')}</text>`;
  });
  // From 44 at the base to the edge of the mass.
  const edge = 270 - 1.9 * scale, coil = Array.from({ length: 15 }, (_, i) => `${0.16 + i * 0.05},${i % 2 ? 9 : -9}`).join(" ");
  const stretch = shown.map((_, frame) => `${(edge - 44 + mass[frame] - base[frame]).toFixed(1)} 1`).join(";");
  return `<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 ${WIDTH} ${HEIGHT}" width="${WIDTH}" height="${HEIGHT}" font-family="Helvetica, Arial, sans-serif" role="img">
<title>Lock at phase resonance, and the free decay along the backbone</title>
<rect width="${WIDTH}" height="${HEIGHT}" fill="#FFFFFF"/>
${lamps.join("\n")}
<line x1="20" y1="216" x2="400" y2="216" stroke="#4D4D4D"/>
<rect x="30" y="100" width="14" height="115" fill="#0072B2">${move(base)}</rect>
<g transform="translate(44 150)"><g>${move(base)}<polyline points="0,0 ${coil} 1,0" fill="none" stroke="#000000" stroke-width="1.5" vector-effect="non-scaling-stroke" transform="scale(${edge - 44} 1)">${move([]).replace(/translate/, "scale").replace('values=""', `values="${stretch}"`)}</polyline></g></g>
<g><rect x="${edge}" y="96" width="${3.8 * scale}" height="119" fill="#D5DADE"/><rect x="${270 - 1.3 * scale}" y="126" width="${2.6 * scale}" height="60" fill="#FFFFFF"/>${move(mass)}</g>
<circle cx="270" cy="156" r="${0.3 * scale}" fill="#B3341F">${move(particle)}</circle>
<text x="30" y="240" font-size="13" fill="#4D4D4D">base (not to scale), mass, and particle: until the release</text>
<text x="30" y="257" font-size="13" fill="#4D4D4D">by stroboscope, then ${Math.round(DECAY.seconds / AFTER * 10) / 10} times slower than real</text>
<path d="M${left} ${top}V${top + high}H${left + wide}" fill="none" stroke="#000000"/>
<text x="${left + wide / 2}" y="${top + high + 36}" font-size="15" text-anchor="middle">detuning σ, from −2 to 0.5</text>
<text transform="translate(${left - 14} ${top + high / 2}) rotate(-90)" font-size="15" text-anchor="middle">amplitude C, to 0.6</text>
<polyline points="${line(exact.map(([sigma, c]) => [x(sigma), y(c)]))}" fill="none" stroke="#0072B2" stroke-width="1.5"/>
<text x="${left + wide - 4}" y="${top + 14}" font-size="13" fill="#0072B2" text-anchor="end">exact backbone</text>
${drawn(1, LOCK.frames, "#868686")}
${drawn(begin, synchronous, "#D55E00")}
<circle cx="${now[LOCK.frames - 1][0].toFixed(1)}" cy="${now[LOCK.frames - 1][1].toFixed(1)}" r="5" fill="#B3341F">${animate("cx", now.map(([x]) => x.toFixed(1)))}${animate("cy", now.map(([, y]) => y.toFixed(1)))}</circle>
</svg>
`;
}

if (process.argv[1] === fileURLToPath(import.meta.url)) {
  if (process.argv.length !== 3) throw new Error("one argument is needed: the folder of the page, which `scripts/live --out FOLDER` makes");
  await writeFile(new URL("../docs/lock-and-decay.svg", import.meta.url), await animation(process.argv[2]));
}
