
const run = location.pathname.split("/").filter(Boolean).slice(1, 3).map(decodeURIComponent).join("/");
const content = document.getElementById("content");
document.title = `panotune: ${run}`;

function fact(name, text) {
  return text === null ? null : element("div", null, element("dt", null, name), element("dd", null, text));
}

function curve(values) {
  const label = values.length ? `from ${value(values[0])} to ${value(values.at(-1))}` : "no values yet";
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const y = (v) => (high > low ? 19 - 18 * (v - low) / (high - low) : 10);
  const x = (i) => (values.length > 1 ? 100 * i / (values.length - 1) : 0);
  const points = values.map((v, i) => `${x(i).toFixed(1)},${y(v).toFixed(1)}`).join(" ");
  return shape("svg", { class: "curve", viewBox: "0 0 100 20", preserveAspectRatio: "none", role: "img", "aria-label": label },
    shape("polyline", { points }));
}

function params(trial) {
  const short = (v) => (typeof v === "number" && !Number.isInteger(v) ? v.toPrecision(4) : String(v));
  const all = Object.entries(trial.params);
  const text = all.map(([name, v]) => `${name} ${short(v)}`).join(", ");
  return element("details", { id: `trial-${trial.number}` }, element("summary", null, String(all.length)), text);
}

function trialRow(trial, best) {
  const number = (text) => element("td", { class: "number" }, text);
  return element("tr", { class: best && best.trial === trial.number ? "best" : "" },
    number(String(trial.number)),
    element("td", null, state(trial.state)),
    number(String(trial.epochs)),
    number(value(trial.value)),
    element("td", null, trial.reason ? element("span", { class: "problem" }, trial.reason) : curve(trial.curve)),
    element("td", null, params(trial)));
}

function trials(live) {
  if (live.trials.length === 0) return [];
  const order = (trial) => (trial.state === "running" ? 0 : 1);
  const rows = live.trials.filter((trial) => trial.state !== "waiting")
    .sort((a, b) => order(a) - order(b) || b.number - a.number);
  return [element("h2", null, "Trials"), wide("Trials", element("table", null,
    head([["trial", "number"], ["state", ""], ["epochs", "number"], ["value", "number"], ["curve", ""], ["parameters", ""]]),
    element("tbody", null, ...rows.map((trial) => trialRow(trial, live.summary.best)))))];
}

function work(live) {
  const stage = live.stages.at(-1);
  if (live.summary.state !== "running" || !stage || stage.seconds !== null) return [];
  const left = live.seconds_left === null ? "" : `, about ${duration(live.seconds_left)} left`;
  const bars = live.work.flatMap((w) => [
    element("span", null, w.work),
    element("progress", { max: Math.max(1, w.total), value: w.done, "aria-label": w.work }),
    element("span", { class: "number" }, `${w.done}/${w.total}`)]);
  return [element("h2", null, `Stage ${stage.stage}${left}`), element("div", { class: "work" }, ...bars),
    live.note ? element("p", { class: "muted" }, live.note) : null];
}

function stages(live) {
  const ended = live.stages.filter((stage) => stage.seconds !== null);
  if (ended.length === 0) return [];
  return [element("h2", null, "Stages done"),
    element("p", null, ended.map((stage) => `${stage.stage} ${duration(stage.seconds)}`).join(", "))];
}

function files(names) {
  if (names.length === 0) return [];
  const link = (name) => element("a", { href: `/files/${path(run)}/${path(name)}` }, name);
  const list = (some) => element("ul", { class: "files" }, ...some.map((name) => element("li", null, link(name))));
  const top = names.filter((name) => !name.includes("/"));
  const parts = [element("h2", null, "Files"), list(top)];
  for (const folder of ["tables", "figures"]) {
    const inside = names.filter((name) => name.startsWith(`${folder}/`));
    if (inside.length) parts.push(element("details", { id: folder }, element("summary", null, `${folder} (${inside.length})`), list(inside)));
  }
  return parts;
}

function show(known) {
  const { live } = known;
  const summary = live.summary;
  const opened = [...content.querySelectorAll("details[open]")].map((part) => part.id);
  const focused = document.activeElement && document.activeElement.getAttribute("href");
  const t = summary.trials;
  const counts = ["complete", "pruned", "failed", "running"].filter((word) => t[word] > 0).map((word) => `${t[word]} ${word}`);
  const parts = [element("h1", null, run),
    element("p", null, state(summary.state), live.seconds === null ? "" : ` for ${duration(live.seconds)}`),
    summary.problem ? element("p", { class: "problem" }, summary.problem) : null,
    element("dl", null,
      fact("Best value", summary.best ? `${value(summary.best.value)} (trial ${summary.best.trial})` : "none yet"),
      fact("Trials", counts.length ? `${done(t)}: ${counts.join(", ")}` : done(t)),
      fact("Seed", summary.seed === null ? null : String(summary.seed)),
      fact("Changed", summary.changed > 0 ? `${age(summary.changed)} ago` : null),
      fact("Size", size(summary.bytes))),
    ...work(live), ...trials(live), ...stages(live), ...files(known.files)];
  content.replaceChildren(...parts.filter((part) => part !== null));
  for (const part of content.querySelectorAll("details")) part.open = opened.includes(part.id);
  if (focused) for (const link of content.querySelectorAll("a")) if (link.getAttribute("href") === focused) link.focus();
}

follow(`/api/runs/${path(run)}`, show, (known) => (known.live.summary.state === "running" ? 1000 : 5000));
