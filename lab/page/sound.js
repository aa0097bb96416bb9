// The sound of an impact: a short click, louder the faster the particle is.

let context;

// A function that plays it; called from a button, since browsers allow sound only then.
export function sound() {
  context ??= new AudioContext();
  context.resume();
  return (speed) => {
    const tone = new OscillatorNode(context, { type: "triangle", frequency: 1400 });
    const volume = new GainNode(context);
    const now = context.currentTime;
    volume.gain.setValueAtTime(0.15 * Math.min(1, speed), now);
    volume.gain.exponentialRampToValueAtTime(1e-3, now + 0.05);
    tone.connect(volume).connect(context.destination);
    tone.start(now);
    tone.stop(now + 0.05);
  };
}
