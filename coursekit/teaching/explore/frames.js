(data, root) => {
  // The pictures of the static book: all are files of the page.  Those beside the one shown are fetched and decoded
  // ahead, once the reader comes near.
  const number = (at) => at.reduce((k, p, i) => k * data.sizes[i] + p, 0);
  const ahead = new Map();
  let near = false;
  const fetch = (k) => {
    if (ahead.has(k)) return;
    const image = new Image();
    image.src = data.frames[k];
    image.decode().catch(() => ahead.delete(k));
    ahead.set(k, image);
  };
  const fetchAround = (at) => at.forEach((p, i) => [p - 1, p + 1].forEach((q) => {
    if (q >= 0 && q < data.sizes[i]) fetch(number(at.map((v, j) => (j === i ? q : v))));
  }));
  let last = null;
  new IntersectionObserver((seen, observer) => {
    if (!seen.some((s) => s.isIntersecting)) return;
    observer.disconnect();
    near = true;
    if (last) fetchAround(last);
  }, { rootMargin: "200px" }).observe(root);
  return (at) => {
    const k = number(last = at);
    if (near) setTimeout(() => fetchAround(at));
    return { src: data.frames[k], alt: data.alts[k], facts: data.facts[k] };
  };
}
