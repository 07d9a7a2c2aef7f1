// Sound and vibration of a signal, off until asked for.
import { unpackedText } from "./packed.js";

const GAINS = { force: 0.5, error: 0.5 }; // to a newton, and to a millimetre
const STRONGEST = { force: 2, error: 2 }; // N, mm: a full vibration
const can_vibrate = () => matchMedia("(pointer: coarse)").matches && "vibrate" in navigator;
const gamepads = () => [...(navigator.getGamepads?.() ?? [])].filter((pad) => pad?.vibrationActuator);

export class Sound {
  // listen: has the samples of a signal sent to a port.
  constructor(listen, rate) {
    this.listen = listen;
    this.rate = rate;
    this.signal = null;
  }

  // A signal is "force" or "error", null for silence.
  async hear(signal) {
    this.signal = signal;
    this.mean = null;
    await this.context?.close();
    this.context = null;
    if (!signal) { this.listen(null, null); return; }
    const context = this.context = new AudioContext();
    const source = encodeURIComponent(await unpackedText("sound"));
    await context.audioWorklet.addModule(`data:text/javascript,${source}`); // of a file, no blob is taken
    const node = this.node = new AudioWorkletNode(context, "heard", {
      numberOfInputs: 0, outputChannelCount: [2], processorOptions: { rate: this.rate, gain: GAINS[signal] },
    });
    node.connect(context.destination);
    const { port1, port2 } = new MessageChannel();
    node.port.postMessage(port1, [port1]);
    this.listen(signal, port2);
  }

  // Vibrates a phone or gamepad by how far the signal of a frame is from its mean.
  feel(value) {
    if (!this.signal) return;
    this.mean = this.mean === null ? value : 0.9 * this.mean + 0.1 * value;
    const strength = Math.min(Math.abs(value - this.mean) / STRONGEST[this.signal], 1);
    if (strength < 0.05) return;
    if (can_vibrate()) navigator.vibrate(Math.round(20 * strength));
    for (const pad of gamepads()) pad.vibrationActuator.playEffect("dual-rumble", { duration: 40, strongMagnitude: strength, weakMagnitude: strength });
  }
}
