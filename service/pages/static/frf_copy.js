"use strict";
/* What is seen in a viewer, as text or picture for another program. */
const quoted = (text) => `"${text.replaceAll('"', '""')}"`;

/* Put into the clipboard, or saved where the browser lends none: a page without TLS has no
   clipboard, and a reader may refuse it. */
async function handOver(name, kind, content, say) {
  const blob = content instanceof Blob ? content : new Blob([content], { type: kind });
  const own = kind === "image/png" ? kind : "text/plain";
  try {
    await navigator.clipboard.write([
      new ClipboardItem({ [own]: own === kind ? blob : new Blob([content], { type: own }) }),
    ]);
    say(`${name.toUpperCase()} copied.`);
  } catch {
    save(blob, `frfs.${name}`);
    say(`frfs.${name} saved: this browser lends no clipboard here.`);
  }
}
/* The curves in a band, a row a line. */
function tableOfCurves(curves, quantity, [low, high]) {
  const rows = ["frf,quantity,unit,frequency_hz,real,imag,coherence"];
  for (const c of curves)
    c.hz.forEach((hz, i) => {
      if (hz >= low && hz <= high)
        rows.push(
          [
            quoted(c.name),
            quantity,
            FrfData.UNIT[quantity],
            hz,
            c.pair.re[i],
            c.pair.im[i],
            c.coherence?.[i] ?? "",
          ].join(","),
        );
    });
  return rows.join("\n") + "\n";
}
/* The CMIF in a band, a column a singular value. */
function tableOfIndicator(lines, [low, high]) {
  const rows = [["frequency_hz", ...lines.map((_, k) => `singular_value_${k + 1}`)].join(",")];
  (lines[0]?.x ?? []).forEach((hz, i) => {
    if (hz >= low && hz <= high) rows.push([hz, ...lines.map((line) => 10 ** line.y[i])].join(","));
  });
  return rows.join("\n");
}
