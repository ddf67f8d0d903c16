function size(bytes) {
  const units = ["B", "kB", "MB", "GB", "TB"];
  let unit = 0;
  while (bytes >= 999.5 && unit < units.length - 1) { bytes /= 1000; unit += 1; }
  return `${unit === 0 || bytes >= 9.95 ? bytes.toFixed(0) : bytes.toFixed(1)} ${units[unit]}`;
}

function age(changed) {
  const s = Math.max(0, Math.floor(Date.now() / 1000 - changed));
  if (s < 60) return `${s} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min`;
  if (s < 86400) return `${Math.floor(s / 3600)} h`;
  return `${Math.floor(s / 86400)} d`;
}

function done(trials) {
  const ended = trials.complete + trials.pruned + trials.failed;
  if (trials.wanted === 0 && ended === 0) return "–";
  return trials.wanted === 0 ? String(ended) : `${ended}/${trials.wanted}`;
}

// A part that scrolls sideways by itself where it does not fit; reachable by keyboard.
function wide(label, part) {
  return element("div", { class: "wide", tabindex: "0", role: "region", "aria-label": label }, part);
}

function path(run) {
  return run.split("/").map(encodeURIComponent).join("/");
}

function head(titles) {
  const cells = titles.map(([title, kind]) => element("th", { scope: "col", class: kind }, title));
  return element("thead", null, element("tr", null, ...cells));
}

// Asks for `address` again and again and shows what comes; `pause` says how many milliseconds to wait after an answer.
function follow(address, show, pause) {
  const connection = document.getElementById("connection");
  let shown = null;
  async function ask() {
    let wait = 3000;
    if (!document.hidden) {
      try {
        const answer = await fetch(address, { signal: AbortSignal.timeout(60000) });
        if (!answer.ok) throw new Error((await answer.text()).trim());
        const text = await answer.text();
        const known = JSON.parse(text);
        if (text !== shown) show(known);
        shown = text;
        wait = pause(known);
        connection.textContent = "";
      } catch (error) {
        connection.textContent = `not up to date: ${error.message}`;
      }
    }
    setTimeout(ask, wait);
  }
  ask();
}
