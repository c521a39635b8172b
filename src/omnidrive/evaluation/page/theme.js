"use strict";
/* Light or dark: as the system says until the reader says otherwise. Runs before the first paint. */
const Theme = (() => {
  const system = matchMedia("(prefers-color-scheme: dark)");
  const listeners = [];
  let chosen = null;

  const dark = () => (chosen === null ? system.matches : chosen);

  function apply() {
    document.documentElement.dataset.theme = dark() ? "dark" : "light";
    for (const listener of listeners) listener();
  }

  system.addEventListener("change", apply);
  apply();
  return {
    dark,
    toggle() { chosen = !dark(); apply(); },
    onChange(listener) { listeners.push(listener); },
    colour: (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim(),
  };
})();
