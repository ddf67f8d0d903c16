// Values in order: numbers as numbers, then texts; what is missing comes last, whichever way it is sorted.
function compare(a, b, direction) {
  const missing = (x) => x === null || x === undefined || x === "";
  if (missing(a) || missing(b)) return missing(a) - missing(b);
  const [first, second] = [typeof a === "number", typeof b === "number"];
  if (first !== second) return (second - first) * direction;
  return direction * (first ? a - b : String(a).localeCompare(String(b), "en", { numeric: true }));
}

// Makes the heading of a column a button; `sort` is given 1, -1 or 0 for the order that there was before.
function sorter(head, sort) {
  const button = element("button", { type: "button", class: "sort" }, ...head.childNodes);
  if (!button.textContent.trim()) button.setAttribute("aria-label", "Sort by this column");
  head.append(button);
  button.addEventListener("click", () => {
    const next = { ascending: "descending", descending: "none" }[head.getAttribute("aria-sort")] ?? "ascending";
    for (const other of head.parentElement.cells) other.removeAttribute("aria-sort");
    if (next !== "none") head.setAttribute("aria-sort", next);
    sort({ ascending: 1, descending: -1, none: 0 }[next]);
  });
}

