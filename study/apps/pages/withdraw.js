// Withdrawing: a code comes in, the participant's data is deleted.

import { fromHex, surround } from "./colours.js";
import { element, heading, show, status } from "./dom.js";
import { page, study as getStudy } from "./server.js";

// Why it could not be done; nothing where it was.
async function withdraw(code) {
  const response = await fetch("api/withdraw", {
    method: "POST",
    headers: { "content-type": "application/json", "x-segue-page": page },
    body: JSON.stringify({ code }),
  });
  if (response.ok && (await response.json()).withdrawn) return "";
  return response.status === 429 ? study.texts.slow_down : study.texts.no_code;
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
        const why = await withdraw(code.value);
        if (why) status(why, true);
        else show([heading(study.texts.withdrawn)]);
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
