"use strict";
// Sorts the leaderboard: best first, then reversed; rows without a value stay at the end.
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
    document.getElementById("sorted").textContent = `Sorted by ${button.dataset.name}, ${order}.`;
  });
}
