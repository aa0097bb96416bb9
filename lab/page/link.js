// The link, which contains the settings and, if it fits, the motion; the record as CSV.

// The scene of a link.
export const slug = ({ name }) => name.toLowerCase().replace(/[^a-z0-9]+/g, "-");

// Changes that a link repeats; more would make it too long.
const MOST_CHANGES = 150;
// Samples that a link repeats; more would take seconds.
const MOST_SAMPLES = 3e6;

// Largest displacement over b that a mass is put to: the limit of the default scene.
const MOST_PLACE = 4;

// The address that repeats the motion of `page`. A motion with too many changes or samples is left out, and a sentence says so: the link
// then has the present settings, from the start.
export function link(page) {
  const count = page.changes.length;
  const omitted =
    count > MOST_CHANGES ? `${count} changes since the start are more than the ${MOST_CHANGES} that fit`
    : page.samples > MOST_SAMPLES ? `${page.samples} samples since the start are more than the ${MOST_SAMPLES} that a link repeats`
    : "";
  const [values, changes] = omitted ? [page.values, page.driving ? [] : [[0, "drive", 0]]] : [page.first, page.changes];
  const parts = Object.entries(values).filter(([key, value]) => value !== page.bench.defaults[key]);
  const query = new URLSearchParams(parts.map(([key, value]) => [key, String(value)]));
  if (changes.length) query.set("changes", changes.map((change) => change.join(":")).join(","));
  if (!omitted) query.set("samples", String(page.samples));
  const address = new URL(location.href);
  address.hash = query.toString();
  return { address: address.href, omitted: omitted && `The link has the settings, not the motion: ${omitted}. Restart to begin a new history.` };
}

export function csv(record) {
  const header = "time [s],base [m],response [m],relative displacement [m],phase error [deg],frequency of the drive [rad/s],base amplitude [m],response amplitude [m],frequency of the motion [rad/s],particle speed [m/s],free decay along the backbone";
  const rows = Array.from({ length: record.length }, (_, i) => record.row(i).join(","));
  return `${header}\n${rows.join("\n")}\n`;
}

// Settings, changes and samples of a link; throws a sentence if it is invalid.
export function read(hash, table) {
  const query = new URLSearchParams(hash.replace(/^#/, ""));
  const limits = Object.fromEntries(table.settings.map((setting) => [setting.key, setting]));
  const number = (text, name, low, high) => {
    const value = Number(text);
    if (text.trim() === "" || !(value >= low && value <= high)) throw new Error(`The link is invalid: ${name} = "${text}"; allowed are ${low} to ${high}. The default scene is shown.`);
    return value;
  };
  const setting = (key, text) => {
    if (key === "drive" || key === "track") return number(text, key, 0, 1);
    if (key === "mass" || key === "particle") return number(text, key, -MOST_PLACE, MOST_PLACE);
    if (!limits[key]) throw new Error(`The link is invalid: there is no setting "${key}". The default scene is shown.`);
    return number(text, limits[key].name, limits[key].min, limits[key].max);
  };
  const values = {};
  let changes = [], samples = 0, scene;
  for (const [key, text] of query) {
    if (key === "scene") {
      scene = table.scenes.find((one) => slug(one) === text);
      if (!scene) throw new Error(`The link is invalid: there is no scene "${text}"; there are ${table.scenes.map(slug).join(", ")}. The default scene is shown.`);
      continue;
    }
    if (key === "samples") samples = number(text, "samples", 0, MOST_SAMPLES);
    else if (key === "changes") {
      changes = text.split(",").map((one) => {
        const [at, name, value] = one.split(":");
        return [number(at ?? "", "the time of a change", 0, MOST_SAMPLES), name, setting(name, value ?? "")];
      });
    } else values[key] = setting(key, text);
  }
  return { values, changes, samples, scene };
}
