// The rig, drawn to scale: base, spring and damper, mass with its cavity, particle. Displacements are over b.

export class Rig {
  constructor(canvas, colour) {
    Object.assign(this, { canvas, colour, flash: { wall: 0, at: -1 } });
  }

  // `look`: displacements over b; base over b epsilon, since it is too small to be seen to scale.
  draw(look, now, calm) {
    const { context: c, width, height } = surface(this.canvas);
    const { colour } = this;
    c.clearRect(0, 0, width, height);
    const b = Math.min(width / 9, height / 3.2);
    const floor = Math.min(height - 24, height / 2 + 0.875 * b);
    const centre = width * 0.6 + look.q1 * b;
    const half = 1.28 * b;
    const wall = width * 0.09 + look.base * b * 0.35;
    c.lineWidth = 2;
    c.strokeStyle = c.fillStyle = colour("faint");
    c.beginPath(); c.moveTo(0, floor + 1); c.lineTo(width, floor + 1); c.stroke();
    // Base
    c.fillStyle = colour("blue");
    c.fillRect(wall - 10, floor - 1.75 * b, 10, 1.75 * b);
    // Spring and damper
    c.strokeStyle = colour("ink");
    spring(c, wall, centre - half - 0.22 * b, floor - 1.25 * b, b * 0.16);
    damper(c, wall, centre - half - 0.22 * b, floor - 0.5 * b, b * 0.14);
    // Mass with its cavity: the particle's centre moves from -b to b
    const radius = 0.28 * b;
    const inside = b + radius;
    const top = floor - 1.6 * b;
    c.fillStyle = colour("line");
    c.fillRect(centre - inside - 0.22 * b, top, 2 * inside + 0.44 * b, floor - top);
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
    c.beginPath(); c.arc(centre + (look.q2 - look.q1) * b, floor - 0.79 * b, radius, 0, 7); c.fill();
    c.fillStyle = colour("faint");
    c.font = "12px system-ui, sans-serif";
    c.fillText("base (not to scale)", 6, floor + 17);
    c.fillText(look.wall ? "the particle rests on a wall" : "", centre - 60, top - 8);
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
