// The rig, drawn to scale: base or shaker, spring and damper, mass with its cavity, particle. Displacements are over b.

// Lengths in the drawing, over b: the mass beyond where the particle's centre meets a wall, the spring at rest, the radius of the particle,
// the base's displacement over epsilon b.
const BODY = 0.5, SPRING = 1.5, RADIUS = 0.28, BASE = 0.35;
// Place of a shaker with its stinger, or of the arrow of a force, and width of the shaker.
const SHAKER = 1.6, COIL = 0.9;
// Smallest margins, pixels.
const SIDE = 16, LABELS = 40;
// Height of the line of words below a tilted rig, pixels.
const WORDS = 18;

export class Rig {
  constructor(canvas, colour) {
    Object.assign(this, { canvas, colour, flash: { wall: 0, at: -1 } });
  }

  // `look`: displacements over b; base over b epsilon, since it is too small to be seen to scale. `reach`: largest displacements of late
  // of mass and base, which fit into the canvas. `gaps`: left and right of the particle, over b. `tilt`, degrees: gravity pulls the particle to
  // the right if it is positive, so that the right end is the lower one. `host`: what drives a structure, drawn as its driven mode.
  draw(look, reach, gaps, tilt, now, calm, host) {
    const { context: c, width: wide, height } = surface(this.canvas);
    const high = tilt ? height - WORDS : height;
    const { colour } = this;
    c.clearRect(0, 0, wide, height);
    const force = host?.drive === "force", before = host?.drop_out && !force ? SHAKER : 0;
    const lengths = 2 * BASE * reach.base + SPRING + gaps[0] + gaps[1] + 2 * BODY + 2 * reach.mass + before + (force ? SHAKER : 0);
    // The tilted rectangle of the rig fits into the canvas. Before the page has its layout, the canvas has no size.
    const angle = (tilt * Math.PI) / 180, cos = Math.cos(angle), sin = Math.abs(Math.sin(angle));
    const b = Math.max(0, Math.min(
      (wide - 2 * SIDE * cos - LABELS * sin) / (lengths * cos + 2 * sin),
      (high - 2 * SIDE * sin - LABELS * cos) / (lengths * sin + 2 * cos),
    ));
    const [along, across] = tilt ? [lengths * b + 2 * SIDE, 2 * b + LABELS] : [wide, high];
    c.translate(wide / 2, high / 2);
    c.rotate(angle);
    c.translate(-along / 2, -across / 2);
    const floor = 0.5 * (across - LABELS) + 0.875 * b + 16;
    const slack = along - 2 * SIDE - lengths * b;
    const wall = SIDE + 0.2 * slack + (before + BASE * (reach.base + (force ? 0 : look.base))) * b;
    const rest = SIDE + 0.6 * slack + (before + 2 * BASE * reach.base + SPRING + reach.mass + gaps[0] + BODY) * b;
    const centre = rest + look.q1 * b;
    const radius = RADIUS * b;
    const inside = [centre - gaps[0] * b - radius, centre + gaps[1] * b + radius];
    const outside = [centre - (gaps[0] + BODY) * b, centre + (gaps[1] + BODY) * b];
    const particle = centre + (look.q2 - look.q1) * b;
    c.lineWidth = 2;
    c.strokeStyle = c.fillStyle = colour("faint");
    c.beginPath(); c.moveTo(0, floor + 1); c.lineTo(along, floor + 1); c.stroke();
    // Base
    c.fillStyle = c.strokeStyle = colour(force ? "faint" : "base");
    c.fillRect(wall - 10, floor - 1.75 * b, 10, 1.75 * b);
    if (before) shaker(c, SIDE, wall - 10, floor - 0.8 * b, COIL * b);
    // Spring and damper
    c.strokeStyle = colour("ink");
    spring(c, wall, outside[0], floor - 1.25 * b, b * 0.16);
    damper(c, wall, outside[0], floor - 0.5 * b, b * 0.14);
    c.strokeStyle = colour("base");
    if (force && host.drop_out) shaker(c, along - SIDE, outside[1], floor - 0.8 * b, -COIL * b);
    else if (force) arrow(c, outside[1], outside[1] + (look.base / reach.base) * (SHAKER - 0.2) * b, floor - 0.8 * b, 0.1 * b);
    // Mass with its cavity
    const top = floor - 1.6 * b;
    c.fillStyle = colour("line");
    c.fillRect(outside[0], top, outside[1] - outside[0], floor - top);
    c.fillStyle = colour("panel");
    c.fillRect(inside[0], floor - 1.12 * b, inside[1] - inside[0], 0.66 * b);
    if (gaps[0] !== gaps[1]) {
      // The line from which both gaps are measured.
      c.strokeStyle = colour("faint");
      c.setLineDash([3, 3]);
      c.beginPath(); c.moveTo(centre, top); c.lineTo(centre, floor); c.stroke();
      c.setLineDash([]);
    }
    const age = now - this.flash.at;
    for (const side of [-1, 1]) {
      const lit = look.wall === -side ? 1 : side === -this.flash.wall && !calm ? Math.max(0, 1 - age / 180) : 0;
      if (lit > 0) {
        c.globalAlpha = lit;
        c.fillStyle = colour("particle");
        c.fillRect(side < 0 ? inside[0] - 0.12 * b : inside[1], floor - 1.12 * b, 0.12 * b, 0.66 * b);
        c.globalAlpha = 1;
      }
    }
    c.fillStyle = colour("particle");
    const seen = !Number.isNaN(particle);
    if (seen) { c.beginPath(); c.arc(particle, floor - 0.79 * b, radius, 0, 7); c.fill(); }
    c.fillStyle = colour("faint");
    c.font = "12px system-ui, sans-serif";
    const words = look.wall ? "the particle rests on a wall" : seen ? "mass with particle" : "mass (the particle is not measured)";
    this.transform = c.getTransform();
    if (tilt) {
      // Words stay horizontal.
      surface(this.canvas);
      c.textAlign = tilt > 0 ? "left" : "right";
      c.fillText(`${words}; base not to scale`, tilt > 0 ? 4 : wide - 4, height - 4);
      c.textAlign = tilt > 0 ? "right" : "left";
      c.fillText("gravity ↓", tilt > 0 ? wide - 4 : 4, 14);
    } else {
      c.textAlign = "left";
      c.fillText(force ? "ground" : before ? "shaker and its table" : "base (not to scale)", 6, floor + 17);
      c.textAlign = "right";
      if (force) c.fillText(host.drop_out ? "shaker" : "force", along - 6, floor + 17);
      c.textAlign = "center";
      c.fillText(words, centre, floor + 17);
    }
    Object.assign(this, { b, rest, centre, particle, gaps, outside, top, floor, left: wall - 10, right: outside[1] });
  }

  // Where a pointer is, in the axes of the rig.
  #at({ offsetX, offsetY }) {
    const ratio = window.devicePixelRatio || 1;
    return new DOMPoint(offsetX * ratio, offsetY * ratio).matrixTransform(this.transform.inverse());
  }

  // What a pointer is on, "particle", "mass" or undefined, and how far from its middle.
  under(event) {
    const { x, y } = this.#at(event);
    if (Math.hypot(x - this.particle, y - (this.floor - 0.79 * this.b)) < 1.3 * RADIUS * this.b) return ["particle", x - this.particle];
    const onMass = x > this.outside[0] && x < this.outside[1] && y > this.top && y < this.floor;
    return onMass ? ["mass", x - this.centre] : undefined;
  }

  // Where a pointer drags `part`, taken `offset` from its middle: the displacement over b of the mass, at most `most`, or of the particle from
  // the mass.
  dragged([part, offset], event, most) {
    const x = this.#at(event).x - offset;
    const [to, low, high] = part === "mass" ? [x - this.rest, -most, most] : [x - this.centre, -this.gaps[0], this.gaps[1]];
    return Math.max(low, Math.min(high, to / this.b));
  }

  hit(wall, now) { this.flash = { wall, at: now }; }
}

export function surface(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
  }
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { context, width, height };
}

function spring(c, from, to, y, size) {
  const turns = 7, lead = 0.1 * (to - from);
  c.beginPath(); c.moveTo(from, y); c.lineTo(from + lead, y);
  for (let i = 0; i < 2 * turns; i++) c.lineTo(from + lead + ((i + 0.5) / (2 * turns)) * (to - from - 2 * lead), y + (i % 2 ? size : -size));
  c.lineTo(to - lead, y); c.lineTo(to, y); c.stroke();
}

// A shaker whose housing begins at `from` and is `wide` (towards `to` if positive), with its stinger to `to`.
function shaker(c, from, to, y, wide) {
  const half = 0.5 * Math.abs(wide), inner = from + wide;
  c.strokeRect(Math.min(from, inner), y - half, Math.abs(wide), 2 * half);
  for (const share of [0.3, 0.5, 0.7]) { c.beginPath(); c.moveTo(from + share * wide, y - 0.6 * half); c.lineTo(from + share * wide, y + 0.6 * half); c.stroke(); }
  c.beginPath(); c.moveTo(from + 0.7 * wide, y); c.lineTo(to, y); c.stroke();
}

function arrow(c, from, to, y, size) {
  const back = Math.sign(from - to) * Math.min(size, Math.abs(to - from));
  c.beginPath(); c.moveTo(from, y); c.lineTo(to, y);
  c.moveTo(to + back, y - size); c.lineTo(to, y); c.lineTo(to + back, y + size); c.stroke();
}

function damper(c, from, to, y, size) {
  const middle = 0.5 * (from + to), box = 0.18 * (to - from);
  c.beginPath();
  c.moveTo(from, y); c.lineTo(middle, y);
  c.moveTo(middle, y - 0.7 * size); c.lineTo(middle, y + 0.7 * size);
  c.moveTo(middle - box, y - size); c.lineTo(middle + box, y - size); c.lineTo(middle + box, y + size); c.lineTo(middle - box, y + size);
  c.moveTo(middle + box, y); c.lineTo(to, y);
  c.stroke();
}
