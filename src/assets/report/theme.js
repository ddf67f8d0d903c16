// Light or dark: as the system is until a reader chooses.
function theme() {
  const root = document.documentElement;
  const system = matchMedia("(prefers-color-scheme: dark)");
  const button = element("button", { type: "button", id: "theme" });
  // where a browser keeps nothing for pages from files, the choice lasts as long as the page
  const kept = { get: () => { try { return localStorage.getItem("theme"); } catch { return null; } },
    set: (name) => { try { localStorage.setItem("theme", name); } catch { /* nothing to keep it in */ } } };
  function apply(name) {
    root.dataset.theme = name;
    root.style.colorScheme = name;
    const other = name === "dark" ? "light" : "dark";
    button.textContent = other === "dark" ? "Dark" : "Light";
    button.setAttribute("aria-label", `Show the page ${other}`);
  }
  const current = () => kept.get() ?? (system.matches ? "dark" : "light");
  button.addEventListener("click", () => {
    const next = root.dataset.theme === "dark" ? "light" : "dark";
    kept.set(next);
    apply(next);
  });
  system.addEventListener("change", () => apply(current()));
  apply(current());
  document.querySelector(".brand").after(button);
}

// Marks in the contents what is being read.
function contents() {
  const links = new Map([...document.querySelectorAll("#contents a")].map((link) => [link.hash.slice(1), link]));
  const seen = new Set();
  const observer = new IntersectionObserver((changes) => {
    for (const { target, isIntersecting } of changes) seen[isIntersecting ? "add" : "delete"](target.id);
    const first = [...links.keys()].find((id) => seen.has(id));
    for (const [id, link] of links) {
      if (id === first) link.setAttribute("aria-current", "true");
      else link.removeAttribute("aria-current");
    }
  }, { rootMargin: "0px 0px -60% 0px" });
  for (const id of links.keys()) {
    const part = document.getElementById(id);
    if (part) observer.observe(part);
  }
}

theme();
contents();

