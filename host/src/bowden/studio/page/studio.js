// The page of `bowden studio`: draws what the server sends, sends what the user asks for.
// While it draws it says "alive"; when it does not, the server stops the motor.
"use strict";

const ALIVE_EVERY_MS = 200;
const KEPT_S = 5, LOOP_S = 2.5;
const PLACES = [...Array(11).keys()]; // along a cable
const MOST_POINTS = 400; // drawn of a curve; the sample rate is 1 kHz
const [NUMBER, TIME, , LOAD_ANGLE, , LOAD_TORQUE] = [0, 1, 2, 3, 4, 5];

const at = (id) => document.getElementById(id);
const style = getComputedStyle(document.documentElement);
const colour = (name) => style.getPropertyValue(name).trim();

let rows = [];
let curve = [[], []];
let now = null;
let isNew = false;
let socket = null;
// What was refused, shown until the next order or until the drive's session has something new to say.
let refusal = "";
let said = "";

function refuse(text) {
  refusal = text;
  at("message").textContent = text;
}

function order(message) {
  if (message.do !== "alive") refusal = "";
  if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
}

function connect() {
  socket = new WebSocket(`ws://${location.host}/live`);
  socket.onmessage = (event) => take(JSON.parse(event.data));
  socket.onclose = () => {
    at("state").textContent = "no connection: the drive is stopped";
    at("state").className = "bad";
    setTimeout(connect, 1000);
  };
}

function take(message) {
  if (message.refused) { refuse(message.refused); return; }
  if (message.experiments) offerExperiments(message.experiments);
  if (message.curve) curve = message.curve;
  if (message.rows && message.rows.length) {
    if (rows.length && message.rows[0][NUMBER] <= rows[rows.length - 1][NUMBER]) rows = [];
    rows.push(...message.rows);
    const oldest = rows[rows.length - 1][NUMBER] - KEPT_S * 1000;
    const first = rows.findIndex((row) => row[NUMBER] > oldest);
    if (first > 0) rows = rows.slice(first);
    isNew = true;
  }
  if (message.now) { now = message.now; showState(); }
}

// The prescribed torque at an angle: a straight line between two points of the server's curve.
function wanted(angle) {
  const [x, y] = curve;
  if (!x.length) return null;
  const place = (angle - x[0]) / (x[1] - x[0]);
  const left = Math.min(Math.max(Math.floor(place), 0), x.length - 2);
  const share = Math.min(Math.max(place - left, 0), 1);
  return y[left] + share * (y[left + 1] - y[left]);
}

function thinned(list) {
  const step = Math.max(Math.ceil(list.length / MOST_POINTS), 1);
  return list.filter((_, place) => (list.length - 1 - place) % step === 0);
}

const colours = () => ({ ink: colour("--ink"), soft: colour("--soft"), line: colour("--line"), marker: colour("--red") });
const loop = new Plot(at("loop"), "load angle, rad", "torque by the cables on the load, N m");
const time = new Plot(at("time"), "time, s", "torque at the load, N m");
const tensions = new Plot(at("tensions"), "place: 0 at the motor, 1 at the load", "tension, N");

let drawn = 0, countedSince = performance.now();

function draw() {
  requestAnimationFrame(draw);
  if (!isNew || document.hidden) return;
  isNew = false;
  const newest = rows[rows.length - 1];
  const recent = thinned(rows.filter((row) => row[NUMBER] > newest[NUMBER] - LOOP_S * 1000));
  const used = colours();
  const prescribed = (name, x, y) => ({ name, x, y, colour: used.soft, width: 2.5, dash: true });
  const felt = (x, y) => ({ name: "felt", x, y, colour: colour("--blue"), width: 1.5 });
  loop.draw([
    prescribed("prescribed", ...curve),
    felt(recent.map((row) => row[LOAD_ANGLE]), recent.map((row) => row[LOAD_TORQUE])),
  ], [newest[LOAD_ANGLE], newest[LOAD_TORQUE]], used);
  const shown = thinned(rows);
  const times = shown.map((row) => row[TIME] - newest[TIME]);
  time.draw([
    prescribed("wanted", times, shown.map((row) => wanted(row[LOAD_ANGLE]))),
    felt(times, shown.map((row) => row[LOAD_TORQUE])),
  ], null, used);
  drawn += 1;
  const span = performance.now() - countedSince;
  if (span >= 1000) {
    document.documentElement.dataset.picturesPerS = (1000 * drawn / span).toFixed(1);
    drawn = 0; countedSince = performance.now();
  }
}

function showState() {
  at("node").textContent = `node ${now.node_id}`;
  const who = now.is_ours ? "" : now.is_on ? " (by another program)" : "";
  at("state").textContent = now.power_state + who + (now.recording ? `  · recording ${now.recorded_s.toFixed(1)} s` + (now.runs_until_s ? ` of ${now.runs_until_s.toFixed(1)} s` : "") : "");
  at("state").className = now.fault ? "bad" : now.is_on ? "on" : "";
  at("rates").textContent = `${now.rate_hz.toFixed(0)} samples/s, ${now.lost} frames lost, bus ${(100 * now.bus_share).toFixed(0)} %`;
  at("fault").hidden = !now.fault;
  at("fault").textContent = now.fault || "";
  if (now.message !== said) refusal = "";
  said = now.message;
  at("message").textContent = refusal || (now.has_drive ? now.message : `another page has the drive; stop works here, too. ${now.message}`);
  at("recording").textContent = now.recording ? "end the recording" : "record";
  at("name").disabled = Boolean(now.recording);
  showTensions();
  showRecordings();
  showJob();
  for (const input of at("configure").querySelectorAll("input"))
    if (!input.value && input.name in now.tunnel && input !== document.activeElement) input.value = Number(now.tunnel[input.name].toPrecision(6));
  at("changes").replaceChildren(...now.changes.map((change) => {
    const line = document.createElement("tr");
    for (const text of [change.name, `${+change.before.toPrecision(6)} → ${+change.after.toPrecision(6)} ${change.unit}`]) {
      const cell = document.createElement("td");
      cell.textContent = text;
      line.append(cell);
    }
    return line;
  }));
}

// Eleven places of each cable, evenly spaced; the drive's dictionary: model_tension_along_a.1 is at the motor.
function showTensions() {
  const along = (cable) => PLACES.map((place) => now.values[`model_tension_along_${cable}.${place + 1}`] ?? null);
  const x = PLACES.map((place) => place / (PLACES.length - 1));
  const cables = [["a", "--blue"], ["b", "--red"]];
  tensions.draw([
    ...cables.map(([cable, name]) => ({ name: `cable ${cable}`, x, y: along(cable), colour: colour(name), width: 2 })),
    { name: "", x: [0, 1], y: [0, 0], colour: colour("--soft"), width: 1 },
  ], null, colours());
}

let listed = null;
function showRecordings() {
  if (now.recordings.join() === listed) return;
  listed = now.recordings.join();
  if (!now.recording) { suggestName("name", "run"); suggestName("runname", "experiment"); }
  at("recordings").replaceChildren(...now.recordings.map((name) => {
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox"; box.value = name;
    label.append(box, ` ${name}`);
    return label;
  }));
}

// The next free name: run_2 after run_1.
function suggestName(field, otherwise) {
  const stem = at(field).value.replace(/_\d+$/, "") || otherwise;
  let number = 1;
  while (now.recordings.some((name) => name.startsWith(`${stem}_${number}.`))) number += 1;
  at(field).value = `${stem}_${number}`;
}

let shownReport = "";
function showJob() {
  const job = now.job;
  if (job.state === "none") return;
  const verdict = job.result && job.result.verdict ? `: ${job.result.verdict} ${(job.result.effects || []).map((one) => one.name).join(", ")}` : "";
  at("job").textContent = `${job.do} ${job.state}${verdict}${job.why ? `: ${job.why}` : ""}`;
  const diagnosed = job.do === "diagnose" && job.state === "done";
  at("apply").hidden = at("applydiff").hidden = !(diagnosed && job.result.model);
  at("advice").textContent = (diagnosed && job.result.next_experiment) || "";
  const next = diagnosed ? nextRun(job.result.next_command || "") : null;
  at("next").hidden = next === null;
  if (next) at("next").textContent = `next: run and record ${next.name}, ${next.seconds} s, ${next.mode}`;
  if (job.state === "done" && job.report !== shownReport) {
    shownReport = job.report;
    at("report").hidden = false;
    at("report").querySelector("iframe").src = `/report/${job.report}?${Date.now()}`;
  }
  if (job.state === "running") shownReport = "";
}

// What a verdict's `bowden record NAME.blf --duration S --enable MODE [--torque NM]` asks for; null for any other.
function nextRun(command) {
  const words = /^bowden record (\w[\w.-]*)\.blf --duration ([\d.]+) --enable (tunnel|torque)(?: --torque (-?[\d.e-]+))?$/.exec(command);
  if (!words) return null;
  return { name: words[1], seconds: Number(words[2]), mode: words[3], torque_nm: words[4] === undefined ? null : Number(words[4]) };
}

// Its end is the server's, by the drive's clock.
function beginNext() {
  const next = nextRun(now.job.result.next_command);
  const values = { duration_s: next.seconds };
  if (next.mode === "torque") values.torque_nm = next.torque_nm;
  order({ do: "run", experiment: next.mode === "tunnel" ? "2" : "torque", values, name: next.name });
}

let experiments = [];
function offerExperiments(offered) {
  if (experiments.length) return;
  experiments = offered;
  const choice = at("experiment").elements.experiment;
  choice.replaceChildren(...offered.map((one) => new Option(one.title, one.name)));
  choice.onchange = showParameters;
  showParameters();
}
const chosenExperiment = () => experiments.find((one) => one.name === at("experiment").elements.experiment.value);
function showParameters() {
  const chosen = chosenExperiment();
  at("before").textContent = `Before: ${chosen.before}.`;
  at("parameters").replaceChildren(...chosen.parameters.map((one) => {
    const label = document.createElement("label"), input = document.createElement("input");
    input.type = "number"; input.step = "any"; input.required = true;
    input.name = one.name; input.min = one.low; input.max = one.high; input.value = one.default;
    label.append(`${one.label} `, input, ` ${one.unit}`);
    return label;
  }));
}
function runExperiment() {
  const inputs = [...at("parameters").querySelectorAll("input")];
  const values = Object.fromEntries(inputs.map((input) => [input.name, Number(input.value)]));
  order({ do: "run", experiment: chosenExperiment().name, values, name: at("runname").value });
}

function wire() {
  at("stop").onclick = () => order({ do: "stop" });
  // In every place, also in a field: nobody looks for the focus before pressing stop.
  document.addEventListener("keydown", (event) => {
    if (event.code !== "Space") return;
    order({ do: "stop" });
    if (!(event.target instanceof HTMLInputElement && event.target.type !== "radio" && event.target.type !== "checkbox")) event.preventDefault();
  }, true);
  at("start").onsubmit = (event) => {
    event.preventDefault();
    const mode = at("start").elements.mode.value;
    const torque = at("torque").value; // an empty field is not 0 N m
    order({ do: "start", mode, torque_nm: mode === "torque" && torque !== "" ? Number(torque) : null });
  };
  at("record").onsubmit = (event) => {
    event.preventDefault();
    order(now && now.recording ? { do: "end_recording" } : { do: "record", name: at("name").value, notes: at("notes").value });
  };
  at("mark").onclick = () => order({ do: "mark", text: at("marktext").value || "mark" });
  at("experiment").onsubmit = (event) => { event.preventDefault(); runExperiment(); };
  at("configure").onsubmit = (event) => {
    event.preventDefault();
    const filled = [...new FormData(at("configure"))].filter(([, text]) => text !== "");
    const values = Object.fromEntries(filled.map(([name, text]) => [name, Number(text)]));
    const [name, value] = at("entry").value.split("=").map((part) => part.trim());
    if (name) values[name] = value === undefined || value === "" || Number.isNaN(Number(value)) ? value || "" : Number(value);
    order({ do: "configure", values, dry_run: event.submitter.value === "diff" });
  };
  at("examine").onsubmit = (event) => {
    event.preventDefault();
    const recordings = [...at("recordings").querySelectorAll(":checked")].map((box) => box.value);
    const paper = chosenExperiment().name;
    const experiment = ["1a", "2", "3"].includes(paper) ? paper : "2";
    if (recordings.length) order({ do: event.submitter.value, recordings, experiment });
    else refuse("choose a recording first");
  };
  at("next").onclick = beginNext;
  at("applydiff").onclick = () => order({ do: "apply_model", dry_run: true });
  at("apply").onclick = () => order({ do: "apply_model", dry_run: false });
  setInterval(() => { if (!document.hidden) order({ do: "alive" }); }, ALIVE_EVERY_MS);
}

wire();
connect();
requestAnimationFrame(draw);
