// What the page says of one trial.
function trialDetail(known, trial, width) {
  const fact = (name, text) => element("div", null, element("dt", null, name), element("dd", null, text));
  const isBest = trial === known.best;
  const [epochs, train, validation, objective] = trial.curve();
  const folder = `trials/${String(trial.number).padStart(4, "0")}`;
  const link = (file) => element("a", { href: `${folder}/${file}` }, file);
  return [
    element("h3", null, `Trial ${trial.number} `, state(trial.state), isBest ? " " : null, isBest ? element("span", { class: "badge" }, "best") : null),
    trial.reason ? element("p", { class: "problem" }, trial.reason) : null,
    trial.state === "pruned" ? element("p", { class: "muted" }, `Ended by the pruner after epoch ${epochs.at(-1)}.`) : null,
    element("dl", null,
      trial.value === null ? fact("Last objective", brief(trial.last)) : fact("Objective", value(trial.value)),
      fact("Best epoch", brief(trial.bestEpoch)),
      fact("Epochs", String(trial.epochs)),
      fact("Duration", trial.seconds === null ? "not recorded" : duration(trial.seconds))),
    ...(epochs.length === 0 ? [element("p", { class: "muted" }, "There is no curve.")] : [
      curves({ width, title: "Loss: training (dashed), validation", epochs, best: trial.bestEpoch,
        series: [{ name: "training", kind: "train", values: train }, { name: "validation", kind: "validation", values: validation }] }),
      curves({ width, title: "Objective on validation", epochs, best: trial.bestEpoch,
        series: [{ name: "objective", kind: "validation", values: objective }] })]),
    known.stride > 1 ? element("p", { class: "note" }, `To keep the page small, curves show every ${known.stride}th epoch, the best and the last.`) : null,
    params(known, trial),
    element("p", { class: "files" }, link("params.json"), " · ", link("curve.parquet")),
  ];
}

// Parameters, beside those of the best trial where that is another one.
function params(known, trial) {
  const other = known.best && known.best !== trial ? known.best : null;
  const cell = (v) => element("td", null, v === undefined ? "–" : brief(v));
  const rows = known.names.map((name, index) => [name, param(trial, index), other && param(other, index)])
    .filter(([, own, best]) => own !== undefined || (other && best !== undefined));
  const head = ["Parameter", `Trial ${trial.number}`, other ? `best (${other.number})` : null].filter(Boolean);
  return element("div", { class: "wide" }, element("table", null,
    element("thead", null, element("tr", null, ...head.map((text) => element("th", { scope: "col" }, text)))),
    element("tbody", null, ...rows.map(([name, own, best]) => element("tr", { class: other && own !== best ? "other" : "" },
      element("th", { scope: "row" }, name), cell(own), other ? cell(best) : null)))));
}

