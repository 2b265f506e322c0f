// The other editions of this page, where the site has several, and the links for a hub (book/_ext/launch.py).
// A page on disk may not read its neighbours, so a search there lists titles without excerpts.
if (location.protocol === "file:") DOCUMENTATION_OPTIONS.SHOW_SEARCH_SUMMARY = false;
document.addEventListener("DOMContentLoaded", async () => {
  const form = document.querySelector("form.hub");
  form?.addEventListener("submit", (event) => {
    event.preventDefault();
    const hub = form.elements.hub.value.replace(/\/+$/, "");
    const list = document.querySelector(".hub-links"), paths = JSON.parse(list.dataset.paths);
    list.querySelectorAll("a").forEach((link, i) => { link.href = hub + paths[i]; });
    list.hidden = false;
  });

  const place = document.querySelector(".edition");
  if (!place || !location.protocol.startsWith("http")) return;
  const root = new URL(document.documentElement.dataset.content_root, location.href);
  const answer = await fetch(new URL("versions.json", root));
  const { here, root: up, versions } = await answer.json();
  if (versions.length < 2) return;
  const site = new URL(up, root);
  const link = ({ name, folder }) => Object.assign(document.createElement("a"), { href: new URL(folder, site), textContent: name });
  const others = versions.filter(({ name }) => name !== here);
  place.append(" Other editions: ", ...others.flatMap((edition, i) => (i ? [", ", link(edition)] : [link(edition)])), ".");
  if (here !== versions[0].name) {
    const note = document.createElement("p");
    note.className = "old-edition";
    note.append(`This is edition ${here}. The newest is `, link(versions[0]), ".");
    document.querySelector("article.bd-article")?.prepend(note);
  }
});
