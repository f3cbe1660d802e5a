"use strict";
// Sorts a table of the leaderboard: best first, then reversed; rows without a value stay at the end.
for (const button of document.querySelectorAll(".board th button")) {
  button.addEventListener("click", () => {
    const heading = button.closest("th");
    const body = heading.closest("table").tBodies[0];
    const column = heading.cellIndex;
    const first = button.dataset.first;
    const other = first === "ascending" ? "descending" : "ascending";
    const order = heading.getAttribute("aria-sort") === first ? other : first;
    const key = (row) => {
      const cell = row.cells[column];
      if (button.dataset.kind === "text") return cell.textContent;
      return cell.dataset.value === "" ? null : Number(cell.dataset.value);
    };
    const sign = order === "ascending" ? 1 : -1;
    const rows = [...body.rows].sort((a, b) => {
      const x = key(a), y = key(b);
      if (x === null || y === null) return (x === null) - (y === null);
      return sign * (typeof x === "string" ? x.localeCompare(y) : x - y);
    });
    body.append(...rows);
    for (const th of heading.parentElement.cells) th.setAttribute("aria-sort", th === heading ? order : "none");
    document.getElementById("sorted").textContent = `Sorted by ${button.dataset.words}, ${order}.`;
  });
}
// Unfolds what a link leads to, and for paper what is to be printed.
const unfold = () => {
  const target = document.getElementById(decodeURIComponent(location.hash.slice(1)));
  for (let e = target; e; e = e.parentElement) if (e.tagName === "DETAILS") e.open = true;
  if (target && target.tagName === "DETAILS") target.scrollIntoView();
};
addEventListener("hashchange", unfold);
unfold();
let unfolded = [];
addEventListener("beforeprint", () => {
  unfolded = [...document.querySelectorAll("details.print:not([open])")];
  for (const e of unfolded) e.open = true;
});
addEventListener("afterprint", () => {
  for (const e of unfolded) e.open = false;
});
