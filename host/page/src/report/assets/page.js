// The page: the open trial, the colour scheme, printing, and the order of the table.
"use strict";

{
  const trials = new Map();
  const main = document.querySelector("main");
  // `page.html?embed` shows the moving robot alone, as for a frame of a website.
  if (new URLSearchParams(location.search).has("embed")) {
    document.documentElement.classList.add("embed");
    document.body.classList.add("opens-first");
    main.prepend(Object.assign(document.createElement("h1"), { className: "unseen", textContent: document.title }));
  }
  const isSession = document.body.classList.contains("session");
  const names = [...document.querySelectorAll(isSession ? "script[data-trial]" : "section.trial[data-data]")].map((one) => one.dataset.trial ?? one.id);
  /** The section of a trial. In a session it becomes elements when it is asked for: those of all trials take long to build. */
  const sectionOf = (name) => {
    if (!names.includes(name)) return undefined;
    const there = document.getElementById(name);
    if (there) return there;
    main.insertAdjacentHTML("beforeend", JSON.parse(document.getElementById(`${name}-data`).textContent).section);
    const section = main.lastElementChild;
    const bench = section.querySelector(".bench");
    bench.innerHTML = JSON.parse(document.getElementById("benches").textContent)[bench.dataset.bench];
    for (const [step, selector] of [[-1, ".previous"], [1, ".next"]]) {
      const [button, other] = [section.querySelector(selector), names[names.indexOf(name) + step]];
      button.disabled = !other;
      button.addEventListener("click", () => (location.hash = other));
    }
    return section;
  };
  const sections = () => [...main.querySelectorAll("section.trial[data-data]")];

  const open = (section) => {
    if (!section) return;
    for (const other of sections()) other.hidden = isSession && other !== section;
    for (const [other, trial] of trials) if (other !== section && trial.playing) trial.toggle();
    if (trials.has(section)) trials.get(section).resize();
    else trials.set(section, new biflag.Trial(section));
    for (const row of document.querySelectorAll("tr[data-trial]")) row.classList.toggle("open", row.dataset.trial === section.id);
  };

  const follow = () => {
    const section = sectionOf(biflag.Address.section());
    open(section ?? (document.body.classList.contains("opens-first") ? sectionOf(names[0]) : undefined));
    section?.scrollIntoView();
  };
  if (isSession) {
    addEventListener("hashchange", follow);
    follow();
  } else {
    open(sectionOf(names[0]));
  }

  const repaint = () => trials.forEach((trial) => trial.repaint());
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", repaint);
  const printsAll = document.body.classList.contains("print-all");
  /** What to restore after printing: hidden sections, and the place of what is about all trials. */
  let restore = [];
  const paper = (on) => {
    document.documentElement.classList.toggle("paper", on);
    restore.forEach((undo) => undo());
    restore = [];
    if (on) {
      // Printed, what is about all trials comes before the first trial.
      const rest = names.length > 1 ? document.querySelectorAll("body > aside, body > footer") : [];
      main.before(...rest);
      restore.push(() => main.after(...rest));
      for (const trial of trials.values()) if (trial.playing) trial.toggle();
      const opened = sections().find((section) => !section.hidden);
      for (const section of printsAll ? names.map(sectionOf) : []) {
        main.append(section);
        section.hidden = false;
        if (section !== opened) restore.push(() => (section.hidden = true));
        if (!trials.has(section)) trials.set(section, new biflag.Trial(section));
      }
    }
    repaint();
  };
  addEventListener("beforeprint", () => paper(true));
  addEventListener("afterprint", () => paper(false));

  for (const maps of document.querySelectorAll(".maps")) biflag.addSaveButtons(maps);
  for (const part of document.querySelectorAll("body > header, body > aside")) biflag.roveIn(part);

  for (const button of document.querySelectorAll("th button")) {
    button.addEventListener("click", () => {
      const cell = button.closest("th");
      const rows = cell.closest("table").tBodies[0];
      const sign = cell.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      const key = (row) => row.cells[cell.cellIndex].dataset.key ?? "";
      const compare = (a, b) => (a === "" || b === "" ? (a === "") - (b === "") : sign * (Number(a) - Number(b)));
      for (const other of cell.parentElement.cells) other.removeAttribute("aria-sort");
      cell.setAttribute("aria-sort", sign > 0 ? "ascending" : "descending");
      rows.append(...[...rows.rows].sort((a, b) => compare(key(a), key(b))));
    });
  }
  // The robot moves, unless the address names a moment or the reader wants no motion.
  const shown = trials.get(sections().find((section) => !section.hidden));
  if (shown && !location.hash && !matchMedia("(prefers-reduced-motion: reduce)").matches) shown.begin();
  document.documentElement.dataset.ready = "yes";
}
