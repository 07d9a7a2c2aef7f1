// Settings in the address of a page: #graphics.rate=10&hold=passive. Those of a second run begin with "b.".
import { changes } from "./changes.js";

const number = (text) => {
  const value = Number(text);
  if (text.trim() === "" || !Number.isFinite(value)) throw new Error(`${text} is no number`);
  return value;
};
const truth = (text) => {
  if (text !== "true" && text !== "false") throw new Error(`${text} is neither true nor false`);
  return text === "true";
};

// The messages that set what an address asks for, by prefix of its run; `why` of what the scene does not have.
export function asked(hash, controls) {
  const found = { "": [], "b.": [], why: [] };
  for (const [whole, text] of new URLSearchParams(hash.replace(/^#/, ""))) {
    const run = whole.startsWith("b.") ? "b." : "", key = whole.slice(run.length);
    try {
      const messages = messagesOf(key, text, controls);
      if (!messages.length) throw new Error("this scene has no such control");
      found[run].push(...messages);
    } catch (error) {
      found.why.push(`${whole}=${text}: ${error.message}`);
    }
  }
  return found;
}

function messagesOf(key, text, { rate, holds, gains, topology }) {
  const [kind, ...rest] = key.split("."), name = rest.join(".");
  if (key === "graphics.rate") return rate ? [{ type: "rate", value: number(text) }] : [];
  if (key === "jitter") return rate ? [{ type: "jitter", value: number(text) }] : [];
  if (key === "controller.topology") return topology === null ? [] : [{ type: "topology", on: truth(text) }];
  if (kind === "gains") return gains.some((gain) => gain.name === name) ? [{ type: "gain", name, factor: number(text) }] : [];
  const of = holds.filter(({ connection }) => !name || connection === name);
  if (kind === "hold" || kind === "holds") {
    const able = of.filter(({ choices }) => choices.includes(text));
    if (of.length && !able.length) throw new Error(`there are ${[...new Set(of.flatMap(({ choices }) => choices))].join(", ")}`);
    return able.map(({ connection }) => ({ type: "hold", connection, hold: text }));
  }
  if (kind === "delay" || kind === "delays") return of.map(({ connection }) => ({ type: "delay", connection, value: number(text) }));
  return [];
}

// What an address says of controls that are not as at the `start`; one key where all connections have the same.
export function differing(controls, start) {
  const every = changes(controls, start), count = controls.holds.length;
  const pairs = (type) => every.filter(({ message }) => message.type === type).map(({ key, value }) => [key, value]);
  const merged = (type) => {
    const found = pairs(type), [first] = found;
    return found.length === count && found.every(([, value]) => value === first[1]) ? found.slice(0, 1).map(([, value]) => [type, value]) : found;
  };
  const gains = pairs("gain").map(([key, factor]) => [key, +factor.toPrecision(3)]);
  return [...pairs("rate"), ...pairs("jitter"), ...pairs("topology"), ...merged("hold"), ...merged("delay"), ...gains];
}

// As the part of an address behind "#".
export const written = (pairs) => pairs.map((pair) => pair.map(encodeURIComponent).join("=")).join("&");
