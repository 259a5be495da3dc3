// A session of sessions.js as a timeline of jsPsych 8: one trial of jsPsych for each film, pause, question and page.
// The participant is named in the address: index.html?participant=p001.

const asked = new URLSearchParams(location.search).get("participant") ?? "";
const texts = SEGUE.texts;
document.title = SEGUE.title;
document.documentElement.lang = SEGUE.language;

const jsPsych = initJsPsych();

// In the laboratory the answers are a download. On a server, send `data.json()` there instead.
const store = (data) => data.localSave("json", `segue_${asked}.json`);

const safe = (text) => text.replace(/[&<>"]/g, (sign) => `&#${sign.charCodeAt(0)};`);
const paragraphs = (text) => text.split(/\n\s*\n/).map((part) => `<p>${safe(part)}</p>`).join("");
const page = (text, choices, more = {}) => ({ type: jsPsychHtmlButtonResponse, stimulus: paragraphs(text), choices: choices.map(safe), ...more });
const film = (step) => ({ type: jsPsychVideoKeyboardResponse, stimulus: [step.film], choices: "NO_KEYS", trial_ends_after_video: true });
const wait = (step) => ({ type: jsPsychHtmlKeyboardResponse, stimulus: "", choices: "NO_KEYS", trial_duration: step.ms });

const PAGES = {
  consent: (step) => page(step.text, [texts.agree, texts.decline], {
    on_finish: (data) => {
      if (data.response === 1) jsPsych.abortExperiment(paragraphs(texts.declined));
    },
  }),
  instructions: (step) => [...(step.film ? [page(texts.example, [texts.go_on]), film(step)] : []), page(step.text, [texts.go_on])],
  break: (step) => page(step.text, [texts.go_on]),
  debrief: (step) => page(step.text, [texts.go_on]),
  stimulus: film,
  gap: wait,
  pause: wait,
  form,
  answer: (step) => [step.answered_by === "slider" ? slider(step) : buttons(step), ...feedback(step)],
};

function ends(step) {
  const words = [step.low, step.middle, step.high].filter(Boolean).map((word) => `<span>${safe(word)}</span>`);
  return words.length ? `<p style="display: flex; justify-content: space-between; gap: 2em">${words.join("")}</p>` : null;
}

const note = (step) => (step.role === "practice" ? `<p><small>${safe(texts.practice)}</small></p>` : "");

// What Segue reads: the answer by its name, and its time in seconds.
const recorded = (step, answer) => (data) => {
  Object.assign(data, step.key, { answer: answer(data), response_s: data.rt === null ? null : data.rt / 1000 });
  given = data.answer;
};
let given = null;

function buttons(step) {
  const hint = ({ key, label }) => (key && key !== label ? `<br><small>${safe(texts.press.replace("{key}", key.toUpperCase()))}</small>` : "");
  const press = (event) => {
    const at = step.options.findIndex(({ key }) => key && key === event.key.toLowerCase());
    if (at >= 0 && !event.repeat) document.querySelector(`#jspsych-html-button-response-btngroup [data-choice="${at}"]`)?.click();
  };
  return {
    type: jsPsychHtmlButtonResponse,
    stimulus: note(step) + paragraphs(step.text),
    choices: step.options.map((option) => safe(option.label) + hint(option)),
    prompt: ends(step),
    trial_duration: step.ms ?? null,
    on_load: () => document.addEventListener("keydown", press),
    on_finish: (data) => {
      document.removeEventListener("keydown", press);
      recorded(step, ({ response }) => (response === null ? null : step.options[response].value))(data);
    },
  };
}

function slider(step) {
  return {
    type: jsPsychHtmlSliderResponse,
    stimulus: note(step) + paragraphs(step.text),
    labels: [step.low, step.middle, step.high].filter(Boolean).map(safe),
    slider_width: 500,
    require_movement: true,
    button_label: safe(texts.go_on),
    on_finish: recorded(step, ({ response }) => String(response)),
  };
}

function feedback(step) {
  if (!step.feedback) return [];
  return [{ ...page("", [texts.go_on]), stimulus: () => paragraphs(given === null ? texts.missed : step.feedback[given]) }];
}

function form(step) {
  const input = ({ name, kind, choices, required, least, most }) => {
    const same = `name="${safe(name)}" ${required ? "required" : ""}`;
    if (kind === "choice") return `<select ${same}>${["", ...choices].map((one) => `<option>${safe(one)}</option>`).join("")}</select>`;
    if (kind === "free-text") return `<textarea ${same} maxlength="1000"></textarea>`;
    return `<input ${same} ${kind === "number" ? `type="number" step="any" min="${least ?? ""}" max="${most ?? ""}"` : `maxlength="1000"`}>`;
  };
  return {
    type: jsPsychSurveyHtmlForm,
    preamble: paragraphs(step.text),
    html: step.fields.map((one) => `<p><label>${safe(one.label)}<br>${input(one)}</label></p>`).join(""),
    button_label: safe(texts.go_on),
    on_finish: (data) => Object.assign(data, step.key, { segue_form: JSON.stringify(data.response) }),
  };
}

const steps = SEGUE.sessions[asked];
if (steps === undefined) {
  document.body.textContent = `Expected a participant in the address, such as index.html?participant=${Object.keys(SEGUE.sessions)[0]}, found ${asked || "none"}.`;
} else {
  const films = [...new Set(steps.filter((step) => step.film).map((step) => step.film))];
  const preload = { type: jsPsychPreload, video: films, message: paragraphs(texts.wait), continue_after_error: false };
  const end = page(texts.finished, [texts.close], { on_load: () => store(jsPsych.data.get()) });
  // Browsers play films on pages that were touched, so the first is one to touch.
  jsPsych.run([page(SEGUE.title, [texts.go_on]), preload, ...steps.flatMap((step) => PAGES[step.kind](step)), end]);
}
