"use strict";
/* Theme button of the report of a study; light in print. */
document.getElementById("theme").addEventListener("click", () => Theme.toggle());
addEventListener("beforeprint", () => Theme.print(true));
addEventListener("afterprint", () => Theme.print(false));
