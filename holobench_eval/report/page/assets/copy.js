// The table as it is shown, as LaTeX, Markdown or CSV.

function setUpCopies() {
  byId("copy-latex").addEventListener("click", () => offer("Table as LaTeX (needs booktabs)", latex()));
  byId("copy-markdown").addEventListener("click", () => offer("Table as Markdown", markdown()));
  byId("copy-csv").addEventListener("click", () => offer("Table as CSV", csv()));
  byId("copy-link").addEventListener("click", () => offer("Link to this view", `${location.href.split("#")[0]}#${link()}`));
}

/** Put a text on the clipboard, and show it, since a browser may refuse the former. */
async function offer(title, text) {
  byId("copied-title").textContent = title;
  byId("copied-text").value = text;
  byId("copied").showModal();
  byId("copied-text").select();
  try {
    await navigator.clipboard.writeText(text);
    byId("copied-title").textContent = `${title}: copied`;
  } catch {
    byId("copied-title").textContent = `${title}: copy it from here`;
  }
}

const headings = () => ["method", ...columns().map((column) => column.heading)];
const texts = () => shownRows().map((row) => [row.marked, ...columns().map((column) => row.cells[column.key]?.text ?? "–")]);

const LATEX = { "\\": "\\textbackslash{}", "~": "\\textasciitilde{}", "^": "\\textasciicircum{}", "–": "--", "<": "\\textless{}", ">": "\\textgreater{}" };
const latexText = (text) => text.replace(/[\\~^–<>&%$#_{}]/g, (char) => LATEX[char] ?? `\\${char}`);

function latex() {
  const line = (cells) => `${cells.map((cell) => (/^[[(]/.test(cell) ? `{}${latexText(cell)}` : latexText(cell))).join(" & ")} \\\\`;
  const body = texts().map(line).join("\n");
  const rule = `l${"r".repeat(columns().length)}`;
  return `% ${state.display.replace(/\s+/g, " ")}\n\\begin{tabular}{${rule}}\n\\toprule\n${line(headings())}\n\\midrule\n${body}\n\\bottomrule\n\\end{tabular}\n`;
}

const markdownText = (text) => text.replace(/&(?=[#A-Za-z])/g, "&amp;").replace(/</g, "&lt;").replace(/[\\`*|~$_\]]/g, "\\$&").replace(/\s+/g, " ");

function markdown() {
  const line = (cells) => `| ${cells.map(markdownText).join(" | ")} |`;
  const rule = `| --- |${" ---: |".repeat(columns().length)}`;
  return `${[line(headings()), rule, ...texts().map(line)].join("\n")}\n`;
}

/** Numbers with their ends in columns of their own; text that a spreadsheet would read as a formula gets a quote. */
function csv() {
  const safe = (text) => (/^'*\s*[=+\-@＝＋－＠]/.test(text) ? `'${text}` : text);
  const quoted = (text) => (/[",\r\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text);
  const line = (cells) => cells.map(quoted).join(",");
  const parts = (column) => (shownRows().some((row) => "low" in (row.cells[column.key] ?? {})) ? ["value", "low", "high"] : ["value"]);
  const names = columns().flatMap((column) => parts(column).map((part) => (part === "value" ? column.key : `${column.key}_${part === "low" ? "lo" : "hi"}`)));
  const rows = shownRows().map((row) => [
    safe(row.method),
    safe(state.display),
    ...columns().flatMap((column) => parts(column).map((part) => String(row.cells[column.key]?.[part] ?? ""))),
  ]);
  return `${[["method", "condition", ...names], ...rows].map(line).join("\n")}\n`;
}
