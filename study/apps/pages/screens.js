// Pages that are read or filled in. Each resolves with the message that goes back to the server.

import { ask, element, heading, paragraph, show, status, top } from "./dom.js";
import { load, release } from "./film.js";
import { play } from "./playing.js";
import { stage } from "./sizes.js";
import { matchBackground } from "./trial.js";

function texts(view, study) {
  // As in most plain text: an empty line parts paragraphs, a single line break is only where a line was full.
  const [first, ...rest] = view.text.split(/\n\s*\n/).map((part) => part.replace(/\s+/g, " ").trim());
  return first.length > 90 ? [heading(study.title), ...[first, ...rest].map(paragraph)] : [heading(first), ...rest.map(paragraph)];
}

export async function consent(view, study) {
  const parts = texts(view, study);
  if (window.matchMedia("(prefers-reduced-motion: reduce)").matches) {
    parts.push(element("p", { class: "note" }, study.texts.reduced_motion));
  }
  const agreed = await ask(parts, [
    { label: view.agree, value: true },
    { label: view.decline, value: false, quiet: true },
  ], { enter: false });
  return { declined: !agreed };
}

function field(spec) {
  const id = `field-${spec.name}`;
  const shared = { id, name: spec.name, required: spec.required, autocomplete: "off" };
  if (spec.kind === "choice") {
    const chosen = element("select", shared, element("option", { value: "" }, "–"));
    chosen.append(...spec.choices.map((choice) => element("option", { value: choice }, choice)));
    return chosen;
  }
  if (spec.kind === "number") {
    return element("input", { ...shared, type: "number", step: "any", min: spec.least, max: spec.most, inputmode: "numeric" });
  }
  if (spec.kind === "free-text") return element("textarea", { ...shared, maxlength: "1000" });
  return element("input", { ...shared, type: "text", maxlength: "1000" });
}

// What a number may be, as the window says it too.
function range({ least, most }) {
  return least === null && most === null ? "" : `${least ?? ""} – ${most ?? ""}`.trim();
}

export function form(view, study) {
  return new Promise((resolve) => {
    const inputs = view.fields.map((spec) => [spec, field(spec)]);
    const grid = element("div", { class: "fields" });
    for (const [spec, input] of inputs) {
      const wrong = element("p", { class: "wrong", id: `wrong-${spec.name}`, hidden: true });
      input.setAttribute("aria-describedby", wrong.id);
      grid.append(element("label", { for: input.id }, spec.label), input, wrong);
    }
    const check = () => {
      let first = null;
      for (const [spec, input] of inputs) {
        const wrong = grid.querySelector(`#${CSS.escape(input.getAttribute("aria-describedby"))}`);
        wrong.hidden = input.validity.valid;
        // In the words of the protocol: the browser's own are in the browser's language.
        wrong.textContent = input.validity.valid ? "" : [study.texts.not_taken, range(spec)].filter(Boolean).join(" ");
        input.setAttribute("aria-invalid", String(!input.validity.valid));
        if (!input.validity.valid) first ??= input;
      }
      first?.focus();
      return first === null;
    };
    const made = element("form", {
      novalidate: true,
      onsubmit: (event) => {
        event.preventDefault();
        if (check()) resolve({ values: Object.fromEntries(inputs.map(([spec, input]) => [spec.name, input.value.trim()])) });
      },
    });
    made.append(heading(view.text), grid, element("div", { class: "buttons" }, element("button", { type: "submit" }, study.texts.go_on)));
    show([made]);
  });
}

export async function instructions(view, study) {
  for (;;) {
    const parts = view.text ? texts(view, study) : [heading(study.title)];
    const buttons = [{ label: study.texts.go_on, value: "on" }];
    if (view.example) buttons.push({ label: study.texts.example, value: "example", quiet: true });
    if (view.keys?.length) {
      const hints = view.keys.map(({ label, key }) =>
        element("li", {}, element("b", {}, label), `  ${study.texts.press.replace("{key}", key.toUpperCase())}`),
      );
      parts.push(element("ul", { class: "keys" }, ...hints));
    }
    if ((await ask(parts, buttons)) === "on") return {};
    await example(view, study);
  }
}

async function example(view, study) {
  const place = stage(study);
  show([place], { trial: true });
  status(study.texts.wait);
  let video = null;
  try {
    video = await load(view.example, view.fps);
    status("");
    place.append(video);
    matchBackground(video, study);
    video.classList.add("now");
    await play(video, view.example, view.fps);
  } catch {
    await ask([heading(study.texts.film_fault)], [{ label: study.texts.go_on, value: true }]);
  } finally {
    status("");
    if (video) release(video);
  }
}

export async function read(view, study) {
  const parts = view.kind === "feedback" ? [heading(view.text, { class: "question" })] : texts(view, study);
  if (view.kind === "break") parts.push(element("p", { class: "note" }, progress(view, study)));
  await ask(parts, [{ label: study.texts.go_on, value: true }]);
  return {};
}

export function progress(view, study) {
  if (!view.progress || view.progress[1] === 0) return "";
  const [done, total] = view.progress;
  return study.texts.progress.replace("{done}", done).replace("{total}", total);
}

const codes = (words, code, link = null) => element("p", { class: "note" }, words, element("br"), element("code", {}, code), link ? "   " : null, link);

export function done(view, study) {
  const parts = [heading(study.texts.finished)];
  if (view.completion_code) parts.push(codes(study.texts.completion, view.completion_code));
  if (view.withdrawal_code) {
    parts.push(codes(study.texts.withdrawal, view.withdrawal_code, element("a", { href: "withdraw" }, study.texts.withdraw)));
  }
  if (view.completion_url) {
    parts.push(element("div", { class: "buttons" }, element("a", { class: "button", href: view.completion_url, rel: "noreferrer" }, study.texts.back)));
  }
  top("", "");
  show(parts);
}

export function notice(text) {
  top("", "");
  show([heading(text)]);
}
