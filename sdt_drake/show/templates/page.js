"use strict";

// Theme: that of the system, until the button is used.
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

// A filter of the claims by verdict, if there are claims. All of them are open in print.
const claims = [...document.querySelectorAll(".rows details")];
let opened = [];
addEventListener("beforeprint", () => { opened = claims.filter((claim) => !claim.open); for (const claim of opened) claim.open = true; });
addEventListener("afterprint", () => { for (const claim of opened) claim.open = false; });
if (claims.length) {
  const filter = document.createElement("div");
  const shown = document.createElement("p");
  filter.className = "filter";
  filter.setAttribute("role", "group");
  filter.setAttribute("aria-label", "Claims shown");
  shown.className = "shown";
  shown.setAttribute("role", "status");
  claims[0].parentElement.before(filter, shown);
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
      shown.textContent = `${chosen.length} of ${claims.length} claims shown`;
    });
  }
}

// The 3D recording is a page of its own, loaded by a click, as drawing it takes a while.
const load = document.querySelector(".recording button");
if (load) {
  load.hidden = false;
  load.addEventListener("click", () => {
    const frame = document.createElement("iframe");
    frame.title = "The device in motion, 3D";
    frame.srcdoc = JSON.parse(document.getElementById("recording-page").textContent);
    load.parentElement.replaceChildren(frame);
  });
}
