// Every setting of the controls: its key in an address, its value, and the message that sets it.
const settings = ({ rate, topology, holds, gains }) => [
  ...(rate?.value ? [{ key: "graphics.rate", value: rate.value, message: { type: "rate", value: rate.value } }] : []),
  ...(rate ? [{ key: "jitter", value: rate.jitter, message: { type: "jitter", value: rate.jitter } }] : []),
  ...(topology === null ? [] : [{ key: "controller.topology", value: topology, message: { type: "topology", on: topology } }]),
  ...holds.map(({ connection, hold }) => ({ key: `holds.${connection}`, value: hold, message: { type: "hold", connection, hold } })),
  ...holds.map(({ connection, delay }) => ({ key: `delays.${connection}`, value: delay, message: { type: "delay", connection, value: delay } })),
  ...gains.map(({ name, factor }) => ({ key: `gains.${name}`, value: factor, message: { type: "gain", name, factor } })),
];

// The settings of controls that differ from those of others.
export function changes(controls, others) {
  const values = Object.fromEntries(settings(others).map(({ key, value }) => [key, value]));
  return settings(controls).filter(({ key, value }) => value !== values[key]);
}
