// Text that sets an explorer, and text that shows a fact of the frame that is seen (book/_ext/talking.py).
const setExplorer = (phrase) => {
  const explorer = document.querySelector(`.explorer[data-explorer="${phrase.dataset.sets}"]`);
  explorer.set(JSON.parse(phrase.dataset.positions));
  const { top, bottom } = explorer.getBoundingClientRect();
  if (bottom < 80 || top > innerHeight - 80) explorer.scrollIntoView({ block: "nearest" });
};
document.addEventListener("click", ({ target }) => {
  const phrase = target.closest?.(".explorer-set");
  if (phrase) setExplorer(phrase);
});
document.addEventListener("keydown", (event) => {
  if (!event.target.matches?.(".explorer-set") || ![" ", "Enter"].includes(event.key)) return;
  event.preventDefault(); // the space bar would scroll
  setExplorer(event.target);
});
document.addEventListener("explorer", ({ target }) => {
  document.querySelectorAll(`.explorer-read[data-reads="${target.dataset.explorer}"]`).forEach((word) => {
    word.textContent = target.facts[word.dataset.fact];
  });
});
