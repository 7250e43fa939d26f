// Tables that are sorted by a click, or by the Enter key, on the heading of a column; a second one turns the order round.
"use strict";
(() => {
  // The number at the start of a cell, such as that of "92.1 ± 0.25" or of "−3.2 %"; null where there is none.
  const number = (text) => {
    const match = text.replaceAll("−", "-").match(/^[<>=≈±\s]*([+-]?(?:\d[\d,]*\.?\d*|\.\d+)(?:e[+-]?\d+)?)/i);
    return match ? Number(match[1].replaceAll(",", "")) : null;
  };
  const value = (cell) => cell.dataset.value ?? cell.textContent.trim();
  const empty = (text) => text === "" || text === "–";

  // Numbers in front of texts, empty cells at the end in both orders.
  function compare(first, second, sign) {
    if (empty(first) || empty(second)) return empty(first) - empty(second);
    const numbers = [number(first), number(second)];
    if (numbers[0] !== null && numbers[1] !== null) return sign * (numbers[0] - numbers[1]) || sign * first.localeCompare(second);
    if (numbers[0] !== null || numbers[1] !== null) return numbers[0] !== null ? -1 : 1;
    return sign * first.localeCompare(second);
  }

  function sort(table, column, heading) {
    const order = heading.getAttribute("aria-sort") === "ascending" ? "descending" : "ascending";
    for (const other of table.tHead.querySelectorAll("th")) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", order);
    const sign = order === "ascending" ? 1 : -1;
    const rows = [...table.tBodies[0].rows];
    rows.sort((a, b) => compare(value(a.cells[column]), value(b.cells[column]), sign));
    table.tBodies[0].append(...rows);
  }

  for (const table of document.querySelectorAll("table.sortable")) {
    const width = table.tHead.rows[0].cells.length;
    if ([...table.tBodies[0].rows].some((row) => row.cells.length !== width)) continue;
    [...table.tHead.rows[0].cells].forEach((heading, column) => {
      heading.tabIndex = 0;
      heading.title = "sort";
      heading.addEventListener("click", () => sort(table, column, heading));
      heading.addEventListener("keydown", (event) => event.key === "Enter" && sort(table, column, heading));
    });
  }

  // Fields that leave those rows of the next table in which a text occurs.
  for (const field of document.querySelectorAll("input.filter")) {
    const rows = () => [...document.getElementById(field.dataset.table).tBodies[0].rows];
    field.hidden = false;
    field.addEventListener("input", () => {
      const words = field.value.toLowerCase().split(/\s+/);
      for (const row of rows()) row.hidden = !words.every((word) => row.textContent.toLowerCase().includes(word));
    });
  }
})();
