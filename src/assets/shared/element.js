// Text is only ever set as text, so nothing that a run says can become markup.
function element(name, attributes, ...children) {
  return furnished(document.createElement(name), attributes, children);
}

// The same for a part of a drawing.
function shape(name, attributes, ...children) {
  return furnished(document.createElementNS("http://www.w3.org/2000/svg", name), attributes, children);
}

function furnished(made, attributes, children) {
  for (const [key, value] of Object.entries(attributes || {})) made.setAttribute(key, value);
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

function duration(seconds) {
  if (seconds > 0 && seconds < 9.95) return `${seconds < 1 ? seconds.toFixed(2) : seconds.toFixed(1)} s`;
  const s = Math.max(0, Math.round(seconds));
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${String(s % 60).padStart(2, "0")} s`;
  return `${Math.floor(s / 3600)} h ${String(Math.floor((s % 3600) / 60)).padStart(2, "0")} min`;
}

function value(x) {
  return x === null || x === undefined ? "–" : x.toFixed(Math.abs(x) >= 100 ? 2 : 5);
}

function state(word) {
  return element("span", { class: `state ${word}` }, word);
}

