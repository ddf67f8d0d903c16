// The trials of the page, or none.
function readTrials() {
  const block = document.getElementById("trial-data");
  if (!block) return null;
  const columns = JSON.parse(block.textContent);
  let curves = null;
  const trials = columns.number.map((number, i) => ({
    number, state: columns.state[i], value: columns.value[i], last: columns.last[i], bestEpoch: columns.best_epoch[i],
    epochs: columns.epochs[i], seconds: columns.seconds[i], reason: columns.reason[number] ?? null, pairs: columns.params[i],
    // [epochs, training losses, validation losses, objectives]
    curve: () => {
      curves ??= document.getElementById("trial-curves").textContent.split("\n");
      const numbers = JSON.parse(curves[i]);
      return [0, 1, 2, 3].map((place) => numbers.filter((_, k) => k % 4 === place));
    },
  }));
  const complete = trials.filter((trial) => trial.state === "complete" && trial.value !== null);
  const best = complete.reduce((least, trial) => (least === null || trial.value < least.value ? trial : least), null);
  return { trials, best, names: columns.names, stride: columns.stride };
}

// The value of a parameter, `undefined` if the trial has none of that name.
function param(trial, index) {
  for (let i = 0; i < trial.pairs.length; i += 2) if (trial.pairs[i] === index) return trial.pairs[i + 1];
  return undefined;
}

// Whether a trial fits what was typed: words that occur in it, and conditions such as `learning_rate<0.001`, `state=pruned`.
function fits(known, text) {
  const conditions = text.split(/\s+/).filter(Boolean).map((word) => {
    const parts = /^([^<>=]+)(<=|>=|<|>|=)(.+)$/.exec(word);
    return parts ? condition(known, parts.slice(1)) : contains(known, word.toLowerCase());
  });
  return (trial) => conditions.every((holds) => holds(trial));
}

function condition(known, [name, sign, wanted]) {
  const own = { trial: "number", number: "number", state: "state", objective: "value", value: "value", epochs: "epochs", seconds: "seconds" }[name];
  const index = known.names.indexOf(name);
  const number = Number(wanted);
  return (trial) => {
    const found = own ? trial[own] : param(trial, index);
    if (found === undefined || found === null) return false;
    if (sign === "=") return String(found) === wanted || (typeof found === "number" && found === number);
    if (typeof found !== "number" || Number.isNaN(number)) return false;
    return sign === "<" ? found < number : sign === ">" ? found > number : sign === "<=" ? found <= number : found >= number;
  };
}

function contains(known, word) {
  return (trial) => {
    if (`trial ${trial.number} ${trial.state} ${trial.reason ?? ""}`.toLowerCase().includes(word)) return true;
    return trial.pairs.some((part, i) => String(i % 2 ? part : known.names[part]).toLowerCase().includes(word));
  };
}

