// The list of trials: only rows that are seen exist, so that ten thousand scroll like ten.
function trialList(known, choose) {
  const body = element("tbody");
  const heads = ["Trial", "State", "Objective", "Epochs", "Time"].map((text, i) => element("th", { scope: "col", class: i === 1 ? "" : "number" }, text));
  const extra = element("th", { scope: "col", class: "number", hidden: "" }, "Parameter");
  const table = element("table", { role: "grid", tabindex: "0", id: "trial-list", "aria-label": "Trials; arrow keys choose one" },
    element("thead", null, element("tr", null, ...heads, extra)), body);
  const scroller = element("div", { class: "list" }, table);
  const keys = [(t) => t.number, (t) => t.state, (t) => t.value, (t) => t.epochs, (t) => t.seconds, (t) => param(t, column)];
  let column = -1, shown = known.trials, sorted = { key: null, direction: 0 }, chosen = null, height = 0, drawn = "";

  [...heads, extra].forEach((head, i) => sorter(head, (direction) => {
    sorted = { key: keys[i], direction };
    arrange(shown);
    reveal();
  }));

  function arrange(trials) {
    const { key: by, direction } = sorted;
    shown = [...trials].sort((a, b) => (direction === 0 ? 0 : compare(by(a), by(b), direction)) || a.number - b.number);
    table.setAttribute("aria-rowcount", shown.length + 1);
    draw(true);
  }
  function row(trial, i) {
    const cell = (text, kind) => element("td", { class: kind ?? "number" }, text);
    const made = element("tr", { id: `row-${trial.number}`, "aria-rowindex": i + 2, "aria-selected": String(trial === chosen) },
      cell(String(trial.number)), element("td", null, state(trial.state)), cell(trial.value === null ? "–" : value(trial.value)),
      cell(String(trial.epochs)), cell(trial.seconds === null ? "–" : duration(trial.seconds)),
      column < 0 ? null : cell(brief(param(trial, column))));
    made.addEventListener("click", () => choose(trial));
    return made;
  }
  function gap(rows) {
    const made = element("tr", { class: "gap", role: "presentation" }, element("td", { colspan: 6 }));
    made.style.height = `${rows * height}px`;
    return made;
  }
  function draw(anew) {
    height ||= measured();
    const first = Math.max(0, Math.floor(scroller.scrollTop / height) - 10);
    const last = Math.min(shown.length, first + Math.ceil(scroller.clientHeight / height) + 20);
    if (!anew && drawn === `${first} ${last}`) return;
    drawn = `${first} ${last}`;
    body.replaceChildren(gap(first), ...shown.slice(first, last).map((trial, i) => row(trial, first + i)), gap(shown.length - last));
  }
  function measured() {
    body.replaceChildren(row(known.trials[0], 0));
    return body.rows[0].getBoundingClientRect().height || 32;
  }
  // Scrolls the list, not the page, until the chosen trial is seen.
  function reveal() {
    const at = shown.indexOf(chosen);
    if (at >= 0) {
      const head = table.tHead.offsetHeight, top = at * height;
      if (top < scroller.scrollTop) scroller.scrollTop = top;
      else if (top + height + head > scroller.scrollTop + scroller.clientHeight) scroller.scrollTop = top + height + head - scroller.clientHeight;
    }
    draw(true);
  }
  table.addEventListener("keydown", (event) => {
    const page = Math.max(1, Math.floor(scroller.clientHeight / height) - 2), at = shown.indexOf(chosen);
    const to = { ArrowDown: at + 1, ArrowUp: at - 1, PageDown: at + page, PageUp: at - page, Home: 0, End: shown.length - 1 }[event.key];
    if (to === undefined || event.target !== table || shown.length === 0) return;
    event.preventDefault();
    choose(shown[Math.min(shown.length - 1, Math.max(0, to))]);
  });
  scroller.addEventListener("scroll", () => draw(false));

  return {
    part: scroller,
    arrange,
    select(trial) {
      chosen = trial;
      table.setAttribute("aria-activedescendant", `row-${trial.number}`);
      reveal();
    },
    showParam(index) {
      column = index;
      extra.hidden = index < 0;
      extra.querySelector("button").textContent = known.names[index] ?? "Parameter";
      draw(true);
    },
  };
}

// Signs of the states, as SVG path data.
const MARKS = { complete: "h0", pruned: "m-3-3l6 6m-6 0l6-6", failed: "m-4 0h8m-4-4v8" };

function legend() {
  const sign = (kind, d, words) => element("span", null, shape("svg", { class: "chart", viewBox: "0 0 22 16", "aria-hidden": "true" }, shape("path", { class: kind, d })), words);
  return element("p", { class: "legend" },
    sign("dots complete", `M11 8${MARKS.complete}`, "complete"), sign("dots pruned", `M11 8${MARKS.pruned}`, "pruned, last value"),
    sign("dots failed", `M11 8${MARKS.failed}`, "failed, last value"), sign("line best-so-far", "M1 8h20", "best so far"), element("span", null, "A click chooses a trial."));
}

// Objectives of the trials over their number or a parameter; a click chooses the nearest.
function historyPlot(known, trials, column, chosen, width, choose) {
  const across = (trial) => (column < 0 ? trial.number : param(trial, column));
  const up = (trial) => trial.value ?? trial.last;
  const placed = trials.filter((trial) => across(trial) !== undefined && up(trial) !== null);
  const name = column < 0 ? "trial" : known.names[column];
  const complete = placed.filter((trial) => trial.state === "complete");
  const { drawing, x, y, add } = chart({ width, height: 260, title: "Objective on validation", xs: placed.map(across), ys: placed.map(up), xLabel: name,
    label: `Objective of ${placed.length} trials over ${name}; the list below has the same trials` });
  const at = (trial) => [x.at(across(trial)), y.at(up(trial))];
  for (const [kind, mark] of Object.entries(MARKS)) {
    const d = placed.filter((trial) => trial.state === kind).map((trial) => `M${place(...at(trial))}${mark}`);
    if (d.length) add("path", { class: `dots ${kind}`, d: d.join("") });
  }
  if (column < 0) {
    let least = Infinity, path = "";
    for (const trial of complete) {
      if (trial.value >= least) continue;
      least = trial.value;
      path += path ? `H${at(trial)[0].toFixed(1)}V${at(trial)[1].toFixed(1)}` : `M${place(...at(trial))}`;
    }
    if (path) add("path", { class: "line best-so-far", d: `${path}H${width - RIGHT}` });
  }
  if (placed.includes(chosen)) add("circle", { class: "chosen", cx: at(chosen)[0].toFixed(1), cy: at(chosen)[1].toFixed(1), r: 7 });
  drawing.addEventListener("click", (event) => {
    const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(drawing.getScreenCTM().inverse());
    const away = (trial) => Math.hypot(at(trial)[0] - point.x, at(trial)[1] - point.y);
    const nearest = placed.reduce((near, trial) => (near && near.away <= away(trial) ? near : { trial, away: away(trial) }), null);
    if (nearest) choose(nearest.trial);
  });
  return drawing;
}

function explorer() {
  const known = readTrials();
  if (!known) return;
  const section = document.getElementById("trials");
  const place = document.getElementById("explorer");
  const filter = element("input", { id: "trial-filter", type: "search", autocomplete: "off", spellcheck: "false", placeholder: "pruned epochs>20" });
  const column = element("select", { id: "trial-param" }, element("option", { value: -1 }, "trial number"),
    ...known.names.map((name, i) => element("option", { value: i }, name)));
  const count = element("p", { class: "muted", role: "status" });
  const plot = element("div", { class: "history" });
  const detail = element("article", { id: "trial", "aria-live": "polite" });
  const list = trialList(known, choose);
  let shown = known.trials, chosen = known.best ?? known.trials[0];

  function drawPlot() {
    plot.replaceChildren(historyPlot(known, shown, Number(column.value), chosen, Math.max(280, plot.clientWidth), choose));
  }
  function drawDetail() {
    detail.replaceChildren(...trialDetail(known, chosen, Math.max(260, Math.min(620, detail.clientWidth))).filter(Boolean));
  }
  function show(trial) {
    chosen = trial;
    list.select(trial);
    drawPlot();
    drawDetail();
  }
  function choose(trial) {
    history.replaceState(null, "", `#trial-${trial.number}`);
    show(trial);
  }
  function filtered() {
    shown = known.trials.filter(fits(known, filter.value));
    count.textContent = shown.length === known.trials.length ? `${shown.length} trials` : `${shown.length} of ${known.trials.length} trials`;
    list.arrange(shown);
    drawPlot();
  }
  // `#trial-7` in the address chooses trial 7.
  function linked() {
    const number = /^#trial-(\d+)$/.exec(location.hash);
    const trial = number && known.trials.find((t) => t.number === Number(number[1]));
    if (!trial) return;
    show(trial);
    section.scrollIntoView();
  }

  place.replaceChildren(
    element("div", { class: "controls" },
      element("label", null, "Filter: words, or conditions such as name<0.01", filter),
      element("label", null, "Across and in the list", column)),
    plot, legend(), count, element("div", { class: "panes" }, list.part, detail));
  filter.addEventListener("input", filtered);
  column.addEventListener("change", () => { list.showParam(Number(column.value)); drawPlot(); });
  addEventListener("hashchange", linked);
  let width = 0;
  new ResizeObserver(() => {
    if (place.clientWidth === width) return;
    width = place.clientWidth;
    drawPlot();
    drawDetail();
  }).observe(place);
  filtered();
  show(chosen);
  linked();
}

explorer();
