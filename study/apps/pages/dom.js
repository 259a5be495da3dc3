// Building pages: elements from data, never from markup, so nothing that anybody typed is ever run.

export function element(tag, attributes = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) made.addEventListener(name.slice(2), value);
    else made.setAttribute(name, value === true ? "" : value);
  }
  made.append(...children.filter((child) => child !== null && child !== undefined));
  return made;
}

const main = () => document.getElementById("main");

// A text that does not fit is set smaller; see .dense in style.css.
function fit() {
  const page = document.documentElement;
  main().classList.remove("dense");
  main().classList.toggle("dense", page.scrollHeight > window.innerHeight);
}
window.addEventListener("resize", fit);

let shownAt = 0;
const DOUBLE_CLICK_MS = 500;

// The second click of a double click was meant for the page before, whose button stood at the same place.
export const secondClick = (event) => event.detail > 1 && event.timeStamp - shownAt < DOUBLE_CLICK_MS;

// Puts a page on the screen and moves the focus to its heading, so that a screen reader reads it.
export function show(children, { trial = false, focus = true } = {}) {
  const place = main();
  place.className = trial ? "trial" : "";
  place.replaceChildren(...children);
  shownAt = performance.now();
  fit();
  if (focus) (place.querySelector("[data-focus]") ?? place).focus({ preventScroll: true });
}

export function status(text, warn = false) {
  const place = document.getElementById("status");
  if (place.textContent !== text) place.textContent = text;
  place.className = warn ? "warn" : "";
}

export function top(label, progress) {
  document.getElementById("label").textContent = label;
  document.getElementById("progress").textContent = progress;
}

export const heading = (text, more = {}) => element("h1", { tabindex: "-1", "data-focus": true, ...more }, text);
export const paragraph = (text) => element("p", { class: "text" }, text);

// A page with text and one or more buttons; resolves with the value of the button that was pressed.
export function ask(children, buttons, { enter = true } = {}) {
  return new Promise((resolve) => {
    const controller = new AbortController();
    const finish = (value) => {
      controller.abort();
      resolve(value);
    };
    const row = element("div", { class: "buttons" });
    for (const { label, value, quiet } of buttons) {
      row.append(element("button", { type: "button", class: quiet ? "quiet" : null, onclick: (event) => secondClick(event) || finish(value) }, label));
    }
    show([...children, row]);
    // Enter and space go on from anywhere on the page, as one expects; a focused button takes them itself.
    const pressed = (event) => {
      if (!enter || event.repeat || event.target instanceof HTMLButtonElement) return;
      if (event.key === "Enter" || event.key === " ") {
        event.preventDefault();
        finish(buttons[0].value);
      }
    };
    document.addEventListener("keydown", pressed, { signal: controller.signal });
  });
}

export const sleep = (milliseconds) => new Promise((resolve) => setTimeout(resolve, milliseconds));

// Until what was put on the page is on the screen.
export const drawn = () => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
