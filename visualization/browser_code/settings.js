// Settings of controls: how they differ, as messages, and in the address of a page, #graphics.rate=10&hold=passive, where
// those of a second run begin with "b.".

// The controls with other values than `others`, of those that both have; what a scene varies by itself has the value null.
export function changes(controls, others) {
  const values = new Map(others.map(({ key, value }) => [key, value]));
  return controls.filter(({ key, value }) => value !== null && values.has(key) && value !== values.get(key));
}

// The message that gives a control a value.
export const set = (key, value) => ({ type: "set", key, value });

// The value that a text stands for, of a control.
function valueOf(text, { value, choices, min, max }) {
  if (choices) return text;
  if (typeof value !== "boolean") {
    if (text.trim() === "" || !Number.isFinite(Number(text))) throw new Error(`${text} is no number`);
    if (Number(text) < min || Number(text) > max) throw new Error(`give a number from ${min} to ${max}`);
    return Number(text);
  }
  if (text !== "true" && text !== "false") throw new Error(`${text} is neither true nor false`);
  return text === "true";
}

// The messages that set what an address asks for, by prefix of its run; `why` of what the scene does not have.
export function messagesOf(hash, controls) {
  const found = { "": [], "b.": [], why: [] };
  for (const [whole, text] of new URLSearchParams(hash.replace(/^#/, ""))) {
    const run = whole.startsWith("b.") ? "b." : "", key = whole.slice(run.length);
    try {
      found[run].push(...messagesOfKey(key, text, controls));
    } catch (error) {
      found.why.push(`${whole}=${text}: ${error.message}`);
    }
  }
  return found;
}

// Of one control, or with the key "hold" or "delay" of all connections that can have it.
function messagesOfKey(key, text, controls) {
  const every = /^(hold|delay)s?$/.test(key) ? `${key.replace(/s$/, "")}s.` : null;
  const of = controls.filter((each) => (every ? each.key.startsWith(every) : each.key === key));
  if (!of.length) throw new Error("this scene has no such control");
  const able = of.filter(({ choices }) => !choices || choices.includes(text));
  if (!able.length) throw new Error(`there are ${[...new Set(of.flatMap(({ choices }) => choices))].join(", ")}`);
  return able.map((control) => set(control.key, valueOf(text, control)));
}

// What an address says of controls that are not as at the `start`; one key where all connections have the same. Holds that
// a run has by the control of the hold model alone come with it.
export function differing(controls, start) {
  const able = new Map(start.map(({ key, choices }) => [key, choices]));
  const own = changes(controls, start).filter(({ key, value }) => able.get(key)?.includes(value) ?? true);
  const found = own.map(({ key, value }) => [key, key.startsWith("gains.") ? +value.toPrecision(3) : value]);
  for (const kind of ["hold", "delay"]) {
    const own = found.filter(([key]) => key.startsWith(`${kind}s.`)), [first] = own;
    const every = controls.filter(({ key }) => key.startsWith(`${kind}s.`)).length;
    if (first && own.length === every && own.every(([, value]) => value === first[1])) {
      found.splice(found.indexOf(first), 1, [kind, first[1]]);
      own.slice(1).forEach((pair) => found.splice(found.indexOf(pair), 1));
    }
  }
  return found;
}

// As the part of an address behind "#".
export const addressOf = (pairs) => pairs.map((pair) => pair.map(encodeURIComponent).join("=")).join("&");
