// The page's only script: tables sort at a click on a column's head, and folded parts open for the
// printer. Without it all figures are there as well.
#include "report/page.h"

namespace raydix::report {

// The page's Content-Security-Policy names this script by its SHA-256: after a change here,
// tests/report/page_test.py tells the new value for page.cpp.
std::string_view page_script() {
    return R"js("use strict";
function valueOf(row, column) {
  const cell = row.cells[column];
  if (cell.dataset.v !== undefined) return Number(cell.dataset.v);
  const text = cell.textContent.trim();
  return text === "\u2013" ? null : text;
}
function compare(a, b) {
  if (typeof a === "number" && typeof b === "number") return a - b;
  return String(a).localeCompare(String(b), "en", { numeric: true });
}
function sortBy(head, column, table) {
  const rising = head.getAttribute("aria-sort") !== "ascending";
  for (const other of table.tHead.rows[0].cells) other.removeAttribute("aria-sort");
  head.setAttribute("aria-sort", rising ? "ascending" : "descending");
  const body = table.tBodies[0];
  const rows = [...body.rows].map((row) => ({ row, key: valueOf(row, column) }));
  const full = rows.filter((r) => r.key !== null), empty = rows.filter((r) => r.key === null);
  full.sort((a, b) => (rising ? 1 : -1) * compare(a.key, b.key));
  for (const { row } of full.concat(empty)) body.append(row);
}
for (const table of document.querySelectorAll("div.table table")) {
  if (table.tBodies[0].rows.length < 2) continue;
  [...table.tHead.rows[0].cells].forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => sortBy(head, column, table));
  });
}
let opened = [];
addEventListener("beforeprint", () => {
  opened = [...document.querySelectorAll("details:not([open])")];
  for (const part of opened) part.open = true;
});
addEventListener("afterprint", () => {
  for (const part of opened) part.open = false;
});
)js";
}

}  // namespace raydix::report
