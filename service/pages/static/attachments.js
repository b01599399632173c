"use strict";
/* Files beside what a page shows: pictures as such, the rest by name; more are dropped in. */
const bytesOf = (bytes) =>
  bytes < 1e6 ? `${Math.ceil(bytes / 1e3)} kB` : `${(bytes / 1e6).toFixed(1)} MB`;
for (const box of document.querySelectorAll("[data-attached]")) {
  const path = `${box.dataset.attached}/attachments`;
  const list = box.querySelector("ul");
  const input = box.querySelector("[type=file]");
  const element = (name, more) => Object.assign(document.createElement(name), more);
  const show = async () => {
    const { items } = await call("GET", path);
    list.replaceChildren(
      ...items.map((one) => {
        const href = rest(`attachments/${one.id}/file`);
        const link = element("a", { href, target: "_blank", rel: "noopener" });
        const row = element("li");
        if (one.media_type.startsWith("image/"))
          link.append(element("img", { src: href, alt: one.caption || one.name, loading: "lazy" }));
        else link.textContent = one.name;
        const words = [one.caption || (link.textContent ? "" : one.name), bytesOf(one.size)];
        row.append(link, element("small", { textContent: words.filter(Boolean).join(", ") }));
        if (input) {
          const look = { type: "button", className: "plain", ariaLabel: `Remove ${one.name}` };
          const remove = element("button", { ...look, textContent: "Remove" });
          remove.addEventListener("click", async () => {
            if (!(await agreed(`Remove ${one.name} for good?`, "Remove"))) return;
            await call("DELETE", `attachments/${one.id}`).catch((problem) => say(problem.detail));
            show();
          });
          row.append(remove);
        }
        return row;
      }),
    );
  };
  show().catch((problem) => say(problem.detail));
  input?.addEventListener("change", async () => {
    const caption = box.querySelector("[name=caption]");
    for (const one of [...input.files]) {
      try {
        await sendFile(path, one, one.name, [["caption", caption.value]]);
      } catch (problem) {
        say(`${one.name}: ${problem.detail}`);
      }
    }
    caption.value = input.value = box.querySelector("output").textContent = "";
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
