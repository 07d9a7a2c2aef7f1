// The controls with other values than `others`, of those that both have; what a scene varies by itself has the value null.
export function changes(controls, others) {
  const values = new Map(others.map(({ key, value }) => [key, value]));
  return controls.filter(({ key, value }) => value !== null && values.has(key) && value !== values.get(key));
}

// The message that gives a control a value.
export const set = (key, value) => ({ type: "set", key, value });
