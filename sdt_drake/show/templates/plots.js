// Interactive plots by uPlot. Plots with the same ends of x are zoomed together.
{
  const dashes = { "-": [], "--": [8, 4], "-.": [8, 3, 2, 3], ":": [2, 3] };
  const short = (value) => (value == null ? "–" : String(Number(value.toPrecision(5))));
  const numbers = (text) => Array.from(
    new Float32Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer),
    (value) => (Number.isNaN(value) ? null : value));
  const together = new Map(); // charts by the ends of x
  const all = [];

  const follow = (chart, scale) => {
    if (scale !== "x") return;
    const { min, max } = chart.scales.x;
    for (const other of together.get(chart.ends)) {
      const { min: low, max: high } = other.scales.x;
      if (low !== min || high !== max) other.setScale("x", { min, max });
    }
  };
  const zoom = (chart, factor, shift) => {
    const { min, max } = chart.scales.x;
    const [first, last] = chart.ends.split(" ").map(Number);
    const width = Math.min(last - first, (max - min) * factor);
    const middle = (min + max) / 2 + shift * (max - min);
    const from = Math.max(first, Math.min(last - width, middle - width / 2));
    chart.setScale("x", { min: from, max: from + width });
  };
  const mark = (spans) => ({ ctx, bbox, valToPos }) => {
    ctx.fillStyle = dark() ? "rgb(255 255 255 / 0.15)" : "rgb(0 0 0 / 0.12)";
    for (const span of spans) {
      const [from, to] = span.map((x) => Math.max(bbox.left, Math.min(bbox.left + bbox.width, valToPos(x, "x", true))));
      if (to > from) ctx.fillRect(from, bbox.top, Math.max(to - from, 1), bbox.height);
    }
  };
  const range = (_, low, high) => (low === high ? [low - 1, high + 1] : uPlot.rangeNum(low, high, 0.1, true));
  // Colours follow the theme: on a dark ground lines are lighter, and axes light. Print is light.
  let printing = false;
  const dark = () => !printing && isDark();
  const mixed = (colour, share) => `#${[1, 3, 5].map((k) =>
    Math.round(parseInt(colour.slice(k, k + 2), 16) * (1 - share) + 255 * share).toString(16).padStart(2, "0")).join("")}`;
  const toned = (colour) => {
    const whole = colour.length === 4 ? colour.replace(/[^#]/g, "$&$&") : colour;
    const light = [1, 3, 5].some((k) => parseInt(whole.slice(k, k + 2), 16) > 100);
    return dark() && /^#[0-9a-f]{6}/i.test(whole) ? mixed(whole, light ? 0.4 : 0.75) : colour;
  };
  const ink = () => (dark() ? "#e6eaee" : "#1b2229");
  const lines = () => (dark() ? "#38424e" : "#e3e7eb");
  const font = `12px ${getComputedStyle(root).getPropertyValue("--font")}`;
  const width = (place) => Math.floor(place.clientWidth);

  const draw = (place, panel, arrays) => {
    const title = place.appendChild(document.createElement("h4"));
    title.textContent = panel.title;
    if (panel.note) title.insertAdjacentElement("afterend", document.createElement("small")).textContent = panel.note;
    const x = arrays[panel.x];
    const ends = `${x[0]} ${x[x.length - 1]}`;
    const value = (_, number) => short(number);
    const axis = { stroke: ink, grid: { stroke: lines, width: 1 }, ticks: { stroke: lines, width: 1 }, font, labelFont: font, labelSize: 18, values: (_, ticks) => ticks.map(short) };
    const room = (_, ticks) => Math.max(62, 20 + 7 * Math.max(0, ...(ticks ?? []).map((text) => text.length)));
    const chart = new uPlot({
      width: width(place),
      height: 230,
      pxAlign: 0, // lines of slow signals have no steps of a pixel
      scales: { x: { time: false }, y: { range } },
      axes: [{ ...axis, label: panel.x_label, size: 32, space: 80 }, { ...axis, label: panel.y_label, size: room }],
      series: [
        { label: panel.x_label, value },
        ...panel.lines.map(({ label, colour, dash, dots }) => ({
          label,
          value,
          stroke: () => toned(colour),
          width: 1.5,
          dash: dashes[dash],
          paths: dots ? () => null : undefined,
          points: { show: dots, size: 3, fill: () => toned(colour) },
        })),
      ],
      cursor: {
        y: false,
        drag: { x: true, y: false },
        sync: { key: ends, scales: ["x", null], filters: { pub: (type) => type.startsWith("mousem") || type === "mouseleave" } },
      },
      hooks: { setScale: [follow], drawClear: [mark(panel.marked)] },
    }, [x, ...panel.lines.map((line) => arrays[line.values])], place);
    const canvas = chart.root.querySelector("canvas");
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", `${panel.title || panel.y_label}: ${panel.lines.map(({ label }) => label).join(", ")}`);
    const tint = () => chart.root.querySelectorAll(".u-legend .u-series").forEach((row, k) => {
      const marker = row.querySelector(".u-marker");
      if (k && marker) marker.style.borderColor = toned(panel.lines[k - 1].colour);
    });
    chart.ends = ends;
    together.set(ends, [...(together.get(ends) ?? []), chart]);
    // In print a plot is too low for its label beside it.
    const label = () => {
      title.textContent = [panel.title, ...(printing ? [panel.y_label] : [])].filter(Boolean).join(": ");
      chart.axes[1].label = printing ? null : panel.y_label;
    };
    all.push([place, chart, () => { tint(); label(); }]);
    place.setAttribute("role", "group");
    place.setAttribute("aria-label", `${panel.y_label} over ${panel.x_label}`);
    return chart;
  };

  for (const figure of document.querySelectorAll(".plots")) {
    const { arrays: texts, panels, columns } = JSON.parse(figure.querySelector("script").textContent);
    const arrays = texts.map(numbers);
    const bar = figure.appendChild(document.createElement("div"));
    const grid = figure.appendChild(document.createElement("div"));
    bar.className = "bar";
    bar.appendChild(document.createElement("span")).textContent = "drag across a plot to zoom, double-click for everything";
    grid.className = columns > 1 ? "grid beside" : "grid";
    grid.style.setProperty("--columns", columns);
    const charts = panels.map((panel) => draw(grid.appendChild(document.createElement("div")), panel, arrays));
    for (const [text, factor, shift] of [["+", 0.5, 0], ["−", 2, 0], ["◀", 1, -0.25], ["▶", 1, 0.25], ["all", Infinity, 0]]) {
      const button = bar.appendChild(document.createElement("button"));
      button.type = "button";
      button.textContent = text;
      button.title = { "+": "zoom in", "−": "zoom out", "◀": "to the left", "▶": "to the right", all: "show all" }[text];
      button.setAttribute("aria-label", button.title);
      button.addEventListener("click", () => {
        for (const ends of new Set(charts.map((chart) => chart.ends))) zoom(charts.find((chart) => chart.ends === ends), factor, shift);
      });
    }
  }
  const paint = () => { for (const [, chart, adapt] of all) { adapt(); chart.redraw(false); } };
  const fit = () => { for (const [place, chart] of all) chart.setSize({ width: width(place), height: 230 }); };
  fit(); // the first plot of a grid had the whole width
  addEventListener("resize", fit);
  addEventListener("beforeprint", () => {
    printing = true;
    for (const [place, chart] of all) { // the width of the page, two joints on each, or all columns
      const columns = Number(place.parentElement.style.getPropertyValue("--columns"));
      const whole = columns === 1 && place.matches(".grid > :only-child, .grid > :last-child:nth-child(odd)");
      chart.setSize({ width: whole ? 690 : Math.floor(690 / Math.max(columns, 2)) - 5, height: whole ? 210 : columns > 2 ? 140 : 180 });
    }
    paint();
  });
  addEventListener("afterprint", () => { printing = false; fit(); paint(); });
  systemDark.addEventListener("change", paint);
  theme.addEventListener("click", paint);
  paint();
}
