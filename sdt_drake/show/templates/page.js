"use strict";

// Theme: as the system has it, until the button says otherwise.
const root = document.documentElement;
const theme = document.getElementById("theme");
const systemDark = matchMedia("(prefers-color-scheme: dark)");
const isDark = () => (root.dataset.theme ?? (systemDark.matches ? "dark" : "light")) === "dark";
const nameTheme = () => { theme.textContent = isDark() ? "Light" : "Dark"; };
theme.hidden = false;
theme.addEventListener("click", () => {
  root.dataset.theme = isDark() ? "light" : "dark";
  nameTheme();
});
systemDark.addEventListener("change", nameTheme);
nameTheme();

// Claims by verdict, where there are any.
const claims = [...document.querySelectorAll(".claim")];
if (claims.length) {
  const filter = document.createElement("div");
  const told = document.createElement("p");
  filter.className = "filter";
  filter.setAttribute("role", "group");
  filter.setAttribute("aria-label", "Claims shown");
  told.className = "shown";
  told.setAttribute("role", "status");
  claims[0].before(filter, told);
  for (const verdict of ["", ...new Set(claims.map((claim) => claim.dataset.verdict))]) {
    const chosen = claims.filter((claim) => !verdict || claim.dataset.verdict === verdict);
    const button = filter.appendChild(document.createElement("button"));
    button.type = "button";
    button.textContent = `${verdict || "all"} ${chosen.length}`;
    button.dataset.verdict = verdict;
    button.setAttribute("aria-pressed", String(!verdict));
    button.addEventListener("click", () => {
      for (const other of filter.children) other.setAttribute("aria-pressed", String(other === button));
      for (const claim of claims) claim.hidden = !chosen.includes(claim);
      told.textContent = `${chosen.length} of ${claims.length} claims shown`;
    });
  }
}

// The 3D recording, a page of its own: only when it is wanted, as it takes a while to draw.
const load = document.querySelector(".recording button");
if (load) {
  load.hidden = false;
  load.addEventListener("click", () => {
    const frame = document.createElement("iframe");
    frame.title = "The device in motion, 3D";
    frame.srcdoc = JSON.parse(document.getElementById("recording-page").textContent);
    load.replaceWith(frame);
  });
}
