
const SHOWN = 200;
let runs = [];
const filter = element("input", { id: "filter", type: "search", autocomplete: "off", spellcheck: "false" });
const rows = element("tbody");
const more = element("p", { class: "muted", role: "status" });

function row(run) {
  const link = element("a", { href: `/runs/${path(run.run)}/` }, run.run);
  const problem = run.problem ? element("p", { class: "problem" }, run.problem) : null;
  const number = (text, kind) => element("td", { class: kind || "number" }, text);
  return element("tr", null,
    element("td", { class: "name" }, link, problem),
    element("td", null, state(run.state)),
    number(run.seed === null ? "–" : String(run.seed), "number minor"),
    number(value(run.best && run.best.value)),
    number(done(run.trials)),
    number(run.changed > 0 ? age(run.changed) : "–"),
    number(size(run.bytes), "number minor"));
}

function draw() {
  const words = filter.value.toLowerCase().split(/\s+/).filter(Boolean);
  const fits = (run) => words.every((word) => `${run.run} ${run.state}`.toLowerCase().includes(word));
  const chosen = runs.filter(fits);
  const focused = document.activeElement && document.activeElement.getAttribute("href");
  rows.replaceChildren(...chosen.slice(0, SHOWN).map(row));
  const hidden = chosen.length - SHOWN;
  more.textContent = runs.length === 0 ? "There are no runs yet."
    : chosen.length === 0 ? "No run fits."
    : hidden > 0 ? `… and ${hidden} more; the filter finds them.` : "";
  if (focused) for (const link of rows.querySelectorAll("a")) if (link.getAttribute("href") === focused) link.focus();
}

filter.addEventListener("input", draw);
document.getElementById("content").replaceChildren(
  element("h1", null, "Runs"),
  element("label", { for: "filter" }, "Filter"), filter,
  wide("Runs", element("table", null,
    head([["run", ""], ["state", ""], ["seed", "number minor"], ["best", "number"], ["trials", "number"], ["age", "number"], ["size", "number minor"]]),
    rows)),
  more);
follow("/api/runs", (known) => { runs = known; draw(); }, () => 3000);
