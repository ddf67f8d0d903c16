function key(cell) {
  if (!cell || cell.dataset.missing !== undefined) return null;
  if (cell.dataset.value !== undefined) return Number(cell.dataset.value);
  const number = /^[-−]?[\d,]*\.?\d+(?= |$)/.exec(cell.textContent);
  return number ? Number(number[0].replace("−", "-").replaceAll(",", "")) : cell.textContent;
}

function sortable(table) {
  const body = table.tBodies[0];
  const before = [...body.rows];
  [...table.tHead.rows[0].cells].forEach((head, column) => sorter(head, (direction) => {
    const rows = [...before];
    if (direction !== 0) rows.sort((a, b) => compare(key(a.cells[column]), key(b.cells[column]), direction));
    body.append(...rows);
  }));
}

// What scrolls sideways is reached by keyboard, what does not is passed over.
function reachable() {
  for (const part of document.querySelectorAll(".wide")) {
    if (part.scrollWidth > part.clientWidth) part.setAttribute("tabindex", "0");
    else part.removeAttribute("tabindex");
  }
}

document.querySelectorAll("table.sortable").forEach(sortable);
addEventListener("resize", reachable);
reachable();

