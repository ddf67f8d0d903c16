// Figures open in a dialog, where they are enlarged by wheel, keys and buttons, and moved by pointer and arrow keys.
function zoom() {
  const title = element("strong", { id: "zoom-title" });
  const place = element("div");
  const control = (text, label, act) => {
    const button = element("button", { type: "button", "aria-label": label, title: label }, text);
    button.addEventListener("click", act);
    return button;
  };
  const dialog = element("dialog", { "aria-labelledby": "zoom-title" },
    element("div", { class: "bar" }, title,
      control("+", "Enlarge (+)", () => scale(1.4)), control("−", "Reduce (-)", () => scale(1 / 1.4)),
      control("Fit", "Whole figure (0)", () => whole()), control("Close", "Close (Escape)", () => dialog.close())),
    place);
  document.body.append(dialog);
  let drawing = null, full = null, box = null;

  function show() {
    drawing.setAttribute("viewBox", [box.x, box.y, box.width, box.height].join(" "));
  }
  function whole() {
    box = { ...full };
    show();
  }
  // Enlarges about a point given in the drawing's own units; the middle of what is seen if there is none.
  function scale(factor, point) {
    const at = point ?? { x: box.x + box.width / 2, y: box.y + box.height / 2 };
    const width = Math.min(full.width * 2, Math.max(full.width / 40, box.width / factor));
    const share = width / box.width;
    box = { x: at.x - (at.x - box.x) * share, y: at.y - (at.y - box.y) * share, width, height: box.height * share };
    show();
  }
  function move(dx, dy) {
    box.x += dx;
    box.y += dy;
    show();
  }
  function inside(event) {
    return new DOMPoint(event.clientX, event.clientY).matrixTransform(drawing.getScreenCTM().inverse());
  }
  function open(figure, svg) {
    drawing = svg.cloneNode(true);
    drawing.setAttribute("class", "large");
    drawing.removeAttribute("aria-hidden");
    for (const name of ["width", "height"]) drawing.removeAttribute(name);
    dialog.classList.toggle("plot", figure.classList.contains("plot"));
    const { x, y, width, height } = svg.viewBox.baseVal;
    full = { x, y, width, height };
    title.textContent = figure.querySelector("h3")?.textContent ?? svg.getAttribute("aria-label");
    dialog.lastElementChild.replaceWith(drawing);
    whole();
    dialog.showModal();
  }

  dialog.addEventListener("wheel", (event) => {
    if (event.target.closest("svg") !== drawing) return;
    event.preventDefault();
    scale(Math.exp(-event.deltaY / 400), inside(event));
  }, { passive: false });
  dialog.addEventListener("pointermove", (event) => {
    if (event.buttons !== 1 || event.target.closest("svg") !== drawing) return;
    const { a, d } = drawing.getScreenCTM();
    move(-event.movementX / a, -event.movementY / d);
  });
  dialog.addEventListener("click", (event) => { if (event.target === dialog) dialog.close(); });
  dialog.addEventListener("keydown", (event) => {
    const step = 0.1;
    const act = {
      "+": () => scale(1.4), "=": () => scale(1.4), "-": () => scale(1 / 1.4), 0: whole,
      ArrowLeft: () => move(-step * box.width, 0), ArrowRight: () => move(step * box.width, 0),
      ArrowUp: () => move(0, -step * box.height), ArrowDown: () => move(0, step * box.height),
    }[event.key];
    if (!act || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    act();
  });

  for (const figure of document.querySelectorAll("figure.zoomable")) {
    const svg = figure.querySelector("svg");
    const label = figure.querySelector("h3")?.textContent ?? svg.getAttribute("aria-label");
    const button = element("button", { type: "button", class: "enlarge", "aria-label": `Enlarge: ${label}` });
    // the button says what it shows
    svg.setAttribute("aria-hidden", "true");
    svg.replaceWith(button);
    button.append(svg);
    button.addEventListener("click", () => open(figure, svg));
  }
}

zoom();

