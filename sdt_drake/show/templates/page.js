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
const filter = document.querySelector(".filter");
if (filter) {
  const claims = [...document.querySelectorAll(".claim")];
  const buttons = [...filter.querySelectorAll("button")];
  filter.hidden = false;
  for (const button of buttons) {
    button.addEventListener("click", () => {
      const verdict = button.dataset.verdict;
      for (const other of buttons) other.setAttribute("aria-pressed", String(other === button));
      for (const claim of claims) claim.hidden = Boolean(verdict) && claim.dataset.verdict !== verdict;
      const shown = claims.filter((claim) => !claim.hidden).length;
      document.querySelector(".shown").textContent = `${shown} of ${claims.length} claims shown`;
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
