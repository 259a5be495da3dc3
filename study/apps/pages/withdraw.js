// Withdrawing: a code comes in, the participant's data is deleted.

import { fromHex, surround } from "./colours.js";
import { element, heading, show, status } from "./dom.js";
import { page, study as getStudy } from "./server.js";

async function withdraw(code) {
  const response = await fetch("api/withdraw", {
    method: "POST",
    headers: { "content-type": "application/json", "x-segue-page": page },
    body: JSON.stringify({ code }),
  });
  return response.ok && (await response.json()).withdrawn;
}

const study = await getStudy();
surround(fromHex(study.background));
document.title = `${study.texts.withdraw} · ${study.title}`;
const code = element("input", { id: "code", type: "text", autocomplete: "off", spellcheck: "false", maxlength: "60", required: true });
const form = element(
  "form",
  {
    onsubmit: async (event) => {
      event.preventDefault();
      status("");
      try {
        if (await withdraw(code.value)) show([heading(study.texts.withdrawn)]);
        else status(study.texts.no_code, true);
      } catch {
        status(study.texts.waiting, true);
      }
    },
  },
  heading(study.title),
  element("div", { class: "fields" }, element("label", { for: "code" }, study.texts.withdraw_code), code),
  element("div", { class: "buttons" }, element("button", { type: "submit" }, study.texts.withdraw)),
);
show([form]);
