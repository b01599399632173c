"use strict";
/* Files beside what a page shows: pictures as such, the rest by name; more are dropped in. */
const bytesOf = (bytes) =>
  bytes < 1e6 ? `${Math.ceil(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
for (const box of document.querySelectorAll("[data-attached]")) {
  const path = `${box.dataset.attached}/attachments`;
  const list = box.querySelector("ul");
  const input = box.querySelector("[type=file]");
  const show = async () => {
    const { items } = await call("GET", path);
    list.replaceChildren(
      ...items.map((one) => {
        const href = rest(`attachments/${one.id}/file`);
        const { id, name, caption, size } = one;
        const image = one.media_type.startsWith("image/");
        const seen = image
          ? made("img", { src: href, alt: caption || name, loading: "lazy" })
          : name;
        const words = [!input && (caption || (image && name)), bytesOf(size)];
        const row = made(
          "li",
          {},
          made("a", { href, target: "_blank", rel: "noopener" }, seen),
          made("small", {}, words.filter(Boolean).join(", ")),
        );
        if (!input) return row;
        const change = (sent) => sent.catch((problem) => say(problem.detail)).then(show);
        const own = { value: caption, placeholder: "Caption", maxLength: 500 };
        own.ariaLabel = `Caption of ${name}`;
        own.onchange = ({ target: { value } }) =>
          change(send("PATCH", `attachments/${id}`, { caption: value }));
        const onclick = async () => {
          if (await agreed(`Remove ${name} for good?`, "Remove"))
            change(call("DELETE", `attachments/${id}`));
        };
        const look = { type: "button", className: "plain", ariaLabel: `Remove ${name}`, onclick };
        row.append(made("input", own), made("button", look, "Remove"));
        return row;
      }),
    );
  };
  show().catch((problem) => say(problem.detail));
  input?.addEventListener("change", async () => {
    for (const one of [...input.files]) {
      try {
        await sendFile(path, one, one.name, []);
      } catch (problem) {
        say(`${one.name}: ${problem.detail}`);
      }
    }
    input.value = box.querySelector("output").textContent = "";
    show();
  });
}
for (const input of document.querySelectorAll("[data-put]"))
  input.addEventListener("change", async () => {
    const headers = { "Content-Type": "application/octet-stream" };
    try {
      await call("PUT", input.dataset.put, input.files[0], headers);
      leave();
    } catch (problem) {
      say(problem.detail);
    }
  });
