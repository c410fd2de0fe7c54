// What clocks and meters said, filled into the table; everything else is in the page already.

"use strict";

window.ciberratoMeasured = (runs) => {
  for (const row of document.querySelectorAll("tr[data-run]")) {
    const [wall, memory] = runs[row.dataset.run] ?? [];
    const fill = (name, text) => { row.querySelector(`[data-measured=${name}]`).textContent = text; };
    if (typeof wall === "number") fill("wall", wall.toFixed(1));
    if (typeof memory === "number") fill("memory", (memory / 1048576).toFixed(0));
  }
};

// A link to an agent opens its runs.
function openNamed() {
  const named = document.getElementById(location.hash.slice(1))?.querySelector("details");
  if (named) named.open = true;
}
window.addEventListener("hashchange", openNamed);
openNamed();
