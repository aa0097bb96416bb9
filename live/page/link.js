// The link, which contains the whole state, and the record as CSV.

// Changes that a link repeats; more would make it too long.
const MOST_CHANGES = 150;

// The address that repeats the motion of `page`.
export function link(page) {
  const parts = Object.entries(page.first).filter(([key, value]) => value !== page.bench.defaults[key]);
  const address = new URL(location.href);
  const query = new URLSearchParams(parts.map(([key, value]) => [key, String(value)]));
  if (page.changes.length <= MOST_CHANGES) {
    if (page.changes.length) query.set("changes", page.changes.map((change) => change.join(":")).join(","));
    query.set("samples", String(page.samples));
  }
  address.hash = query.toString();
  return address.href;
}

export function csv(rows) {
  const header = "time [s],base [m],response [m],relative displacement [m],phase error [deg],omega [rad/s],base amplitude [m],response amplitude [m]";
  return `${header}\n${rows.map((row) => row.join(",")).join("\n")}\n`;
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
    if (!limits[key]) throw new Error(`The link is invalid: there is no setting "${key}". The default scene is shown.`);
    return number(text, limits[key].name, limits[key].min, limits[key].max);
  };
  const values = {};
  let changes = [], samples = 0;
  for (const [key, text] of query) {
    if (key === "samples") samples = number(text, "samples", 0, 3e6);
    else if (key === "changes") {
      changes = text.split(",").map((one) => {
        const [at, name, value] = one.split(":");
        return [number(at ?? "", "the time of a change", 0, 3e6), name, setting(name, value ?? "")];
      });
    } else values[key] = setting(key, text);
  }
  return { values, changes, samples };
}
