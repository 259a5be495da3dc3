// Talking to the server: one message at a time, kept until it is acknowledged.
// What must not get lost waits in localStorage, under its session's name, so that it survives a reload and a closed tab; it
// is sent again until the server has it.

import { sleep, status } from "./dom.js";

const KEPT = "segue-kept-"; // and the session's name: on a shared computer nobody's answer is sent as another's
const FIRST_WAIT_MS = 400;
const LONGEST_WAIT_MS = 4000;
const TIMEOUT_MS = 15000;

export const page = Array.from(crypto.getRandomValues(new Uint8Array(16)), (n) => n.toString(16).padStart(2, "0")).join("");

export class Refused extends Error {
  constructor(code, message) {
    super(message);
    this.code = code;
  }
}

let session = "";

function storage(action, where = "localStorage") {
  try {
    return action(window[where]);
  } catch {
    return null; // switched off: the message is kept in memory alone
  }
}

async function post(path, body) {
  const response = await fetch(path, {
    method: "POST",
    headers: { "content-type": "application/json", "x-segue-page": page },
    body: JSON.stringify(body),
    signal: AbortSignal.timeout(TIMEOUT_MS),
  });
  const content = await response.json();
  if (response.ok) return content;
  throw new Refused(response.status, content.error ?? "");
}

// Sends until the server has it: through restarts, lost networks and closed lids.
async function insist(path, body, waitingText) {
  let waited = 0;
  for (let wait = FIRST_WAIT_MS; ; wait = Math.min(wait * 1.6, LONGEST_WAIT_MS)) {
    try {
      const content = await post(path, body);
      if (waited > 0) status("");
      return { content, waited };
    } catch (error) {
      if (error instanceof Refused && error.code < 500) throw error;
    }
    waited += 1;
    if (waited >= 2) status(waitingText, true);
    await Promise.race([sleep(wait), new Promise((resolve) => window.addEventListener("online", resolve, { once: true }))]);
  }
}

export async function send(path, body, waitingText) {
  storage((kept) => kept.setItem(KEPT + session, JSON.stringify({ path, body })));
  const { content, waited } = await insist(path, body, waitingText);
  storage((kept) => kept.removeItem(KEPT + session));
  if (waited > 0) tell("waited", { times: waited });
  return content;
}

export async function begin(body, waitingText) {
  const previous = storage((tab) => tab.getItem("segue-page"), "sessionStorage") ?? "";
  const { content } = await insist("api/begin", { ...body, page, previous }, waitingText);
  if (content.kind !== "elsewhere") storage((tab) => tab.setItem("segue-page", page), "sessionStorage");
  session = content.session ?? "";
  return content;
}

// What an earlier page of this session could not send any more; null where there is nothing.
export async function sendKept(waitingText) {
  const kept = storage((store) => JSON.parse(store.getItem(KEPT + session)));
  if (!kept) return null;
  let content = null;
  try {
    ({ content } = await insist(kept.path, kept.body, waitingText));
  } catch (error) {
    if (!(error instanceof Refused)) throw error; // the session went on without it
  }
  storage((store) => store.removeItem(KEPT + session));
  return content;
}

export const hasKept = () => storage((kept) => kept.getItem(KEPT + session)) !== null;

// Tells of something that happened; lost where the server can't be reached, and nothing waits for it.
export function tell(kind, detail = {}) {
  post("api/happened", { kind, detail }).catch(() => {});
}

// Until the function that it returns is called.
export function keepAlive(whenTaken) {
  const every = setInterval(async () => {
    try {
      await post("api/alive", {});
    } catch (error) {
      if (error instanceof Refused && error.code === 409) {
        clearInterval(every);
        whenTaken();
      }
    }
  }, 10000);
  window.addEventListener("pagehide", () => navigator.sendBeacon("api/leave", page));
  return () => clearInterval(every);
}

export async function study() {
  for (;;) {
    try {
      const response = await fetch("api/study", { signal: AbortSignal.timeout(TIMEOUT_MS) });
      if (response.ok) return await response.json();
    } catch {
      // not there yet
    }
    status("…"); // words come with the study
    await sleep(1000);
  }
}
