// The sky follows the theme: in the dark, that of the recording is replaced as it is set.
const darkSky = matchMedia("(prefers-color-scheme: dark)"), sky = {};
const setProperty = viewer.set_property.bind(viewer);
function paintSky() {
  const own = darkSky.matches ? {top_color: [0.07, 0.09, 0.12], bottom_color: [0.2, 0.24, 0.28]} : sky;
  for (const [name, colour] of Object.entries(own)) setProperty(["Background", "<object>"], name, colour);
  viewer.set_dirty();
}
viewer.set_property = (path, name, value) => {
  setProperty(path, name, value);
  if (!/^(top|bottom)_color$/.test(name)) return;
  sky[name] = value;
  paintSky();
};
darkSky.addEventListener("change", paintSky);
