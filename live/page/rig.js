// The rig, drawn to scale: base, spring and damper, mass with its cavity, particle. Displacements are over b.

// Lengths in the drawing, over b: half of the mass, the spring at rest, the radius of the particle, the base's displacement over epsilon b.
const HALF = 1.5, SPRING = 1.5, RADIUS = 0.28, BASE = 0.35;
// Smallest margins, pixels.
const SIDE = 16, LABELS = 40;

export class Rig {
  constructor(canvas, colour) {
    Object.assign(this, { canvas, colour, flash: { wall: 0, at: -1 } });
  }

  // `look`: displacements over b; base over b epsilon, since it is too small to be seen to scale. `reach`: largest displacements of late
  // of mass and base, which fit into the canvas.
  draw(look, reach, now, calm) {
    const { context: c, width, height } = surface(this.canvas);
    const { colour } = this;
    c.clearRect(0, 0, width, height);
    const lengths = 2 * BASE * reach.base + SPRING + 2 * HALF + 2 * reach.mass;
    // Before the page has its layout, the canvas has no size.
    const b = Math.max(0, Math.min((width - 2 * SIDE) / lengths, (height - LABELS) / 2));
    const floor = 0.5 * (height - LABELS) + 0.875 * b + 16;
    const slack = width - 2 * SIDE - lengths * b;
    const wall = SIDE + 0.2 * slack + BASE * (reach.base + look.base) * b;
    const rest = SIDE + 0.6 * slack + (2 * BASE * reach.base + SPRING + reach.mass + HALF) * b;
    const centre = rest + look.q1 * b;
    const radius = RADIUS * b;
    const inside = b + radius;
    const outside = HALF * b;
    const particle = centre + (look.q2 - look.q1) * b;
    c.lineWidth = 2;
    c.strokeStyle = c.fillStyle = colour("faint");
    c.beginPath(); c.moveTo(0, floor + 1); c.lineTo(width, floor + 1); c.stroke();
    // Base
    c.fillStyle = colour("blue");
    c.fillRect(wall - 10, floor - 1.75 * b, 10, 1.75 * b);
    // Spring and damper
    c.strokeStyle = colour("ink");
    spring(c, wall, centre - outside, floor - 1.25 * b, b * 0.16);
    damper(c, wall, centre - outside, floor - 0.5 * b, b * 0.14);
    // Mass with its cavity: the particle's centre moves from -b to b
    const top = floor - 1.6 * b;
    c.fillStyle = colour("line");
    c.fillRect(centre - outside, top, 2 * outside, floor - top);
    c.fillStyle = colour("panel");
    c.fillRect(centre - inside, floor - 1.12 * b, 2 * inside, 0.66 * b);
    const age = now - this.flash.at;
    for (const side of [-1, 1]) {
      const lit = look.wall === -side ? 1 : side === -this.flash.wall && !calm ? Math.max(0, 1 - age / 180) : 0;
      if (lit > 0) {
        c.globalAlpha = lit;
        c.fillStyle = colour("red");
        c.fillRect(side < 0 ? centre - inside - 0.12 * b : centre + inside, floor - 1.12 * b, 0.12 * b, 0.66 * b);
        c.globalAlpha = 1;
      }
    }
    c.fillStyle = colour("red");
    const seen = !Number.isNaN(particle);
    if (seen) { c.beginPath(); c.arc(particle, floor - 0.79 * b, radius, 0, 7); c.fill(); }
    c.fillStyle = colour("faint");
    c.font = "12px system-ui, sans-serif";
    c.textAlign = "left";
    c.fillText("base (not to scale)", 6, floor + 17);
    c.textAlign = "center";
    c.fillText(look.wall ? "the particle rests on a wall" : seen ? "mass with particle" : "mass (the particle is not measured)", centre, floor + 17);
    Object.assign(this, { b, rest, centre, particle, outside, top, floor, left: wall - 10, right: centre + outside });
  }

  // What a pointer is on: "particle", "mass" or undefined.
  under({ offsetX: x, offsetY: y }) {
    if (Math.hypot(x - this.particle, y - (this.floor - 0.79 * this.b)) < 1.3 * RADIUS * this.b) return "particle";
    return Math.abs(x - this.centre) < this.outside && y > this.top && y < this.floor ? "mass" : undefined;
  }

  // Where a pointer drags it: the displacement over b of the mass, or of the particle from the middle of its cavity.
  dragged(part, x) {
    return part === "mass" ? (x - this.rest) / this.b : Math.max(-1, Math.min(1, (x - this.centre) / this.b));
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

function damper(c, from, to, y, size) {
  const middle = 0.5 * (from + to), box = 0.18 * (to - from);
  c.beginPath();
  c.moveTo(from, y); c.lineTo(middle, y);
  c.moveTo(middle, y - 0.7 * size); c.lineTo(middle, y + 0.7 * size);
  c.moveTo(middle - box, y - size); c.lineTo(middle + box, y - size); c.lineTo(middle + box, y + size); c.lineTo(middle - box, y + size);
  c.moveTo(middle + box, y); c.lineTo(to, y);
  c.stroke();
}
