"use strict";
/* Files beside what a page shows: pictures as such, the rest by name; more are dropped in. */
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
        const [link, row] = [element("a", { href, target: "_blank", rel: "noopener" }), element("li")];
        if (one.media_type.startsWith("image/"))
          link.append(element("img", { src: href, alt: one.caption || one.name, loading: "lazy" }));
        else link.textContent = one.name;
        const size = one.size < 1e6 ? `${Math.ceil(one.size / 1e3)} kB` : `${(one.size / 1e6).toFixed(1)} MB`;
        row.append(link, element("small", { textContent: [one.caption || (link.textContent ? "" : one.name), size].filter(Boolean).join(", ") }));
        if (input) {
          const remove = element("button", { type: "button", className: "plain", textContent: "Remove" });
          remove.ariaLabel = `Remove ${one.name}`;
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
  input.addEventListener("change", () =>
    call("PUT", input.dataset.put, input.files[0], { "Content-Type": "application/octet-stream" }).then(
      () => leave(),
      (problem) => say(problem.detail),
    ),
  );
