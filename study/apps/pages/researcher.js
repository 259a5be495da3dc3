// The researcher's page. The token comes in the address after #, which browsers don't send, or by hand.
// Everything is set as text: nothing that a participant typed is ever run.

import { element, heading, show, status } from "./dom.js";

const KEPT = "segue-researcher";
const EVERY_MS = 5000;
let shownRows = "";

async function get(path, token) {
  return fetch(path, { headers: { authorization: `Bearer ${token}` } });
}

async function download(name, token) {
  const response = await get(`api/researcher/${name}.csv`, token);
  const link = element("a", { href: URL.createObjectURL(await response.blob()), download: `${name}.csv` });
  link.click();
  URL.revokeObjectURL(link.href);
}

function table(columns, rows) {
  const head = element("tr", {}, ...columns.map((column) => element("th", { scope: "col" }, column)));
  const body = rows.map((row) => element("tr", {}, ...row.map((cell) => element("td", {}, String(cell)))));
  return element("div", { class: "table" }, element("table", {}, element("thead", {}, head), element("tbody", {}, ...body)));
}

const time = (iso) => new Date(iso).toLocaleString();

function sessions(data) {
  const rows = data.sessions.map((one) => [
    one.participant,
    one.group + 1,
    one.state,
    one.state === "in progress" ? one.step : "",
    `${one.answers} of ${one.questions}`,
    time(one.began_at),
    time(one.seen_at),
    one.faults,
    one.focus_losses,
    Object.entries(one.parameters).map(([name, value]) => `${name}=${value}`).join(" "),
  ]);
  return table(["participant", "group", "state", "step", "answers", "began", "last active", "faults", "focus lost", "link"], rows);
}

// What went wrong first, then where: "32768 of 315300 bytes · trial 1 · place first".
function fault(detail) {
  const { what, ...where } = JSON.parse(detail ?? "{}");
  return [what, ...Object.entries(where).map(([name, value]) => `${name} ${value}`)].filter(Boolean).join(" · ");
}

function draw(data, token) {
  const counts = Object.entries(data.counts).map(([state, count]) => `${count} ${state}`);
  if (data.withdrawn) counts.push(`${data.withdrawn} withdrawn or declined`);
  if (data.most_participants) counts.push(`at most ${data.most_participants}`);
  if (data.groups.length > 1) counts.push(`groups: ${data.groups.join(", ")}`);
  const buttons = data.tables.map((name) =>
    element("button", { type: "button", class: "quiet", onclick: () => download(name, token) }, `${name}.csv`),
  );
  const parts = [heading(data.title), element("p", {}, counts.join(" · ")), element("div", { class: "buttons" }, ...buttons)];
  parts.push(element("h2", {}, "Sessions"), data.sessions.length ? sessions(data) : element("p", {}, "None yet."));
  if (data.faults.length) {
    parts.push(element("h2", {}, "Latest faults"));
    parts.push(table(["when", "participant", "what"], data.faults.map((one) => [time(one.at), one.participant, fault(one.detail)])));
  }
  show(parts, { focus: false });
}

function askForToken() {
  const token = element("input", { id: "token", type: "password", autocomplete: "off", required: true });
  const form = element(
    "form",
    {
      onsubmit: (event) => {
        event.preventDefault();
        watch(token.value.trim());
      },
    },
    heading("Researcher"),
    element("div", { class: "fields" }, element("label", { for: "token" }, "Token"), token),
    element("div", { class: "buttons" }, element("button", { type: "submit" }, "Open")),
  );
  show([form]);
}

async function watch(token) {
  for (;;) {
    try {
      const response = await get("api/researcher/overview", token);
      if (response.status === 401) {
        sessionStorage.removeItem(KEPT);
        askForToken();
        status("That is not the token.", true);
        return;
      }
      sessionStorage.setItem(KEPT, token);
      const text = await response.text();
      if (text !== shownRows) draw(JSON.parse(text), token);
      shownRows = text;
      status("");
    } catch {
      status("The server can't be reached.", true);
    }
    await new Promise((resolve) => setTimeout(resolve, EVERY_MS));
  }
}

const given = window.location.hash.slice(1);
if (given) history.replaceState(null, "", window.location.pathname);
const token = given || sessionStorage.getItem(KEPT);
if (token) watch(token);
else askForToken();
