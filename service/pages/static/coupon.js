"use strict";
/* A raw curve of a testing machine: the columns of the chosen file are offered, and those whose
   names say what they are chosen. */
const SERIES = {
  force: /load|force|kraft|last/i,
  transverse_strain: /trans|lateral|quer|width|eps.?y/i,
  strain: /strain|dehnung|extens|axial|eps/i,
  time: /time|zeit/i,
};
const READ = 1 << 16; // bytes of the file's beginning

/* The cells of the line above the first line of numbers, as the file's own separator parts them. */
function headersOf(text) {
  const lines = text.split(/\r?\n/).filter((line) => line.trim());
  const numbers = lines.findIndex(
    (line) =>
      line.split(/[\t;,]/).filter((cell) => /\d/.test(cell)).length > 1 && !/[a-z]{2}/i.test(line),
  );
  const separator = ["\t", ";", ","].find((each) => lines[numbers]?.includes(each));
  const above = lines
    .slice(0, Math.max(numbers, 0))
    .reverse()
    .map((line) => line.split(separator).map((cell) => cell.trim().replace(/^"|"$/g, "")));
  return (
    above.find((cells) =>
      Object.values(SERIES).some((like) => cells.some((cell) => like.test(cell))),
    ) ??
    above[0] ??
    []
  );
}
/* Its beginning as text, in the encodings that machines write; the last character may be cut. */
function beginningOf(bytes) {
  const as = (encoding) =>
    new TextDecoder(encoding, { fatal: encoding === "utf-8" }).decode(bytes, { stream: true });
  if (bytes[0] >= 0xfe) return as(bytes[0] === 0xff ? "utf-16le" : "utf-16be");
  try {
    return as("utf-8");
  } catch {
    return as("windows-1252");
  }
}
for (const form of document.querySelectorAll("form[data-raw-curve]")) {
  form.elements.file.addEventListener("change", async ({ target }) => {
    const [file] = target.files;
    const bytes = new Uint8Array(await file.slice(0, READ).arrayBuffer());
    const headers = headersOf(beginningOf(bytes)),
      left = new Set(headers);
    form
      .querySelector("datalist")
      .replaceChildren(...headers.map((name) => new Option(name, name)));
    for (const [series, like] of Object.entries(SERIES)) {
      const input = form.elements[`columns/${series}/header`],
        found = [...left].find((name) => like.test(name));
      if (found) left.delete(found);
      if (headers.length && !headers.includes(input.value)) input.value = found ?? "";
    }
    form.elements.specimen.value ||= file.name.replace(/\.[^.]*$/, "");
  });
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    submitted(form, async () => {
      const sent = new FormData();
      sent.append("coupon", JSON.stringify(bodyOf(form)));
      sent.append("file", form.elements.file.files[0]);
      await meant(form.dataset.rawCurve, (path) => call("POST", path, sent));
      leave();
    });
  });
}
