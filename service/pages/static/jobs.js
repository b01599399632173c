"use strict";
/* Jobs are shown as they are now, whatever their kind: one stream says how all those of a page
   change. What has ended is shown with what came of it, by the page loaded anew; but what somebody
   has begun to type is not taken away. */
const MOST_WATCHED = 200;
const liveOnes = () => [...document.querySelectorAll("[data-job]")];
let stream = null,
  typing = false;
document.addEventListener("input", ({ target }) => {
  typing ||= Boolean(target.form) && !target.form.matches("[data-filter], [data-choose]");
});

function watch() {
  const ids = [...new Set(liveOnes().map((shown) => shown.dataset.job))]
    .sort()
    .slice(0, MOST_WATCHED)
    .join("&job=");
  if (stream?.ids === ids && stream.readyState !== EventSource.CLOSED) return;
  stream?.close();
  if (!ids || document.hidden) {
    stream = null;
    return;
  } // a browser has six connections for all its tabs
  stream = Object.assign(new EventSource(at("ui/events?job=" + ids)), { ids });
  stream.addEventListener("job", ({ data }) => update(JSON.parse(data)));
  stream.addEventListener("error", () => {
    if (stream?.readyState === EventSource.CLOSED) setTimeout(watch, 5000);
  });
}
function update(job) {
  const shown = liveOnes().filter((one) => one.dataset.job === job.id),
    ended = !["queued", "running"].includes(job.status);
  for (const one of shown) {
    if (one.dataset.version && one.dataset.version !== String(job.version)) return renew(); // of a monitor, another run has ended
    const state = one.matches(".state") ? one : one.querySelector(".state"),
      bar = one.querySelector("progress");
    if (job.progress !== undefined && state)
      Object.assign(state, { className: `state ${job.status}`, textContent: job.status });
    const write = (selector, text) => {
      const place = one.querySelector(selector);
      if (place) place.textContent = text;
    };
    write("[data-stage]", job.stage ?? "");
    if (bar) bar.value = job.progress;
    write("[data-percent]", `${Math.round(100 * job.progress)} %`);
    if (ended) delete one.dataset.job;
  }
  if (!ended) return undefined;
  const reports = shown.filter((one) => "awaited" in one.dataset);
  for (const one of reports) report(job.id, one); // htmx may not have settled it yet
  if (shown.length && !reports.length) renew();
  return watch();
}
function renew() {
  if (leaving || sending) return;
  if (typing) say("A computation has ended: load the page anew to see what came of it.");
  else leave();
}
document.addEventListener("htmx:afterSettle", watch);
document.addEventListener("visibilitychange", watch);
addEventListener("pagehide", () => stream?.close());
addEventListener("pageshow", watch);
document.addEventListener("DOMContentLoaded", watch); // when htmx listens too
