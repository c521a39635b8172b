"use strict";
/* Light or dark theme: the system setting until the user switches; light in print. Runs before the first paint. */
const Theme = (() => {
  const system = matchMedia("(prefers-color-scheme: dark)");
  const listeners = [];
  let selected = null;
  let printing = false;

  const dark = () => !printing && (selected === null ? system.matches : selected);

  function apply() {
    document.documentElement.dataset.theme = dark() ? "dark" : "light";
    for (const listener of listeners) listener();
  }

  system.addEventListener("change", apply);
  apply();
  return {
    dark,
    toggle() { selected = !dark(); apply(); },
    print(active) {
      const before = dark();
      printing = active;
      if (dark() !== before) apply();
    },
    onChange(listener) { listeners.push(listener); },
    colour: (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim(),
  };
})();
