(root, { key, truth, unit, sigma }) => {
  // Guess first: the number is locked, then the truth is shown and the guess is scored.  Kept in this browser only.
  const part = (name) => root.querySelector(`.guess-${name}`);
  const form = part("form"), verdict = part("verdict"), again = part("again"), why = part("why");
  const memory = { // a page from disk, or a careful browser, may have none
    get: () => { try { return JSON.parse(localStorage.getItem(key)); } catch { return null; } },
    set: (value) => { try { localStorage.setItem(key, JSON.stringify(value)); } catch { /* it lasts until reload */ } },
    clear: () => { try { localStorage.removeItem(key); } catch { /* nothing was kept */ } },
  };
  const say = (x) => `${Number(x.toPrecision(3))}`.replace("-", "−") + (unit ? ` ${unit}` : "");
  const judge = ({ guess, spread }) => {
    const off = Math.abs(guess - truth), ratio = off / spread, whose = sigma ? "" : "your ";
    const nees = ratio * ratio, figures = `${ratio.toFixed(1)} ${whose}σ, a NEES of ${nees.toFixed(nees < 10 ? 1 : 0)}`;
    const word = ratio > 2.24 ? "surer than you had reason to be" : ratio < 0.03 ? "almost too good" : "an honest guess";
    return `You said ${say(guess)} ± ${say(spread)}. The truth is ${say(truth)}: ${say(off)} off, ${figures}. ` +
      `On average an honest guess has 1, and 95 in 100 stay below 5.0: ${word}.`;
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
