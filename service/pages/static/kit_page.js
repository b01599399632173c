"use strict";
/* The page of the kit asks and says, so that both can be looked at. */
document.addEventListener("click", async ({ target: { dataset } }) => {
  if (dataset?.ask) say((await agreed(dataset.ask, "Delete")) ? "Deleted." : "Kept.");
  if (dataset?.say) say(dataset.say, () => say("Taken back."));
});
