// Figures that zoom: Bokeh draws them from the numbers beside them. Where it fails the static figure stays.
"use strict";
for (const element of document.querySelectorAll("figure.interactive")) {
  element.hidden = false;
  Bokeh.embed.embed_item(JSON.parse(element.querySelector("script").textContent), element.querySelector("div")).then(
    () => document.body.classList.add("interactive"),
    (error) => {
      element.hidden = true;
      throw error;
    },
  );
}
