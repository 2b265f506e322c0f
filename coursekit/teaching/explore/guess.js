(root, { key, truth, unit, sigma }) => {
  // Guess first: the number is locked, then the truth is shown and the guess is scored.  Kept in this browser only.
  const part = (name) => root.querySelector(`.guess-${name}`);
  const form = part("form"), verdict = part("verdict"), again = part("again"), why = part("why");
  const memory = { // a page from disk, or a careful browser, may have none
    get: () => { try { return JSON.parse(localStorage.getItem(key)); } catch { return null; } },
    set: (value) => { try { localStorage.setItem(key, JSON.stringify(value)); } catch { /* it lasts until reload */ } },
    clear: () => { try { localStorage.removeItem(key); } catch { /* nothing was kept */ } },
  };
  const plain = (x) => `${x}`.replace("-", "−") + (unit ? ` ${unit}` : "");
  // The guess stands as it was typed; the truth gets as many decimals as it takes to see two digits of the difference.
  const judge = ({ guess, spread }) => {
    const off = Math.abs(guess - truth), ratio = off / spread, whose = sigma ? "" : "your ", nees = ratio * ratio;
    const typed = (`${guess}`.split(".")[1] ?? "").length, digits = Math.min(Math.max(typed, off > 0 ? 1 - Math.floor(Math.log10(off)) : 3), 6);
    const shown = Number(truth.toFixed(digits)), apart = Number(Math.abs(guess - shown).toFixed(digits));
    const vague = !sigma && nees < 0.25 && spread > Math.abs(truth);
    const word = nees > 3.841 ? "surer than you had reason to be" : vague ? "far less sure than you could be, for your σ is wider than the number itself"
      : sigma && nees < 0.004 ? "nearer than this σ leads one to expect" : "an honest guess";
    return `You said ${plain(guess)} ± ${plain(spread)}. The truth is ${plain(shown)}: ${plain(apart)} off, ${ratio.toFixed(1)} ${whose}σ, ` +
      `a NEES of ${nees < 10 ? nees.toFixed(2) : nees.toFixed(0)}. On average an honest guess has 1, and 95 in 100 stay below 3.84: ${word}.`;
  };
  const show = () => {
    const kept = memory.get() ?? locked;
    form.hidden = Boolean(kept);
    again.hidden = why.hidden = !kept;
    verdict.textContent = kept ? judge(kept) : "";
  };
  let locked = null;
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    const number = (name) => Number(form.elements[name].value);
    locked = { guess: number("guess"), spread: sigma ?? number("spread") };
    memory.set(locked);
    show();
    again.focus();
  });
  again.addEventListener("click", () => {
    locked = null;
    memory.clear();
    form.reset();
    show();
    form.elements.guess.focus();
  });
  show();
}
