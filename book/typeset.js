// Typeset formulas with MathJax: node typeset.js FOLDER_OF_MATHJAX < pages.json > drawings.json (book/finish.py).
const { readFileSync, writeSync } = require("fs");
const folder = process.argv[2];
console.warn = () => {}; // MathJax remarks on components without a version
require(`${folder}/node-main.js`).init({
  loader: {
    paths: { mathjax: folder },
    load: ["input/tex-full", "output/svg", "adaptors/liteDOM", "a11y/assistive-mml"],
  },
  options: { enableAssistiveMml: true },
  tex: { packages: { "[-]": ["noerrors", "noundefined", "require", "autoload"] } }, // a mistake is to be seen
  svg: { fontCache: "global" },
}).then((MathJax) => {
  const { adaptor, output, document } = MathJax.startup;
  // What only MathJax's own menu would read.
  const light = (drawn) => drawn
    .replace(/ (data-mml-node|data-c|data-mjx-texclass|data-variant)="[^"]*"/g, "")
    .replace(/ xmlns:xlink="[^"]*"/g, "").replace(/xlink:href/g, "href");
  const style = adaptor.textContent(output.styleSheet(document));
  const pages = JSON.parse(readFileSync(0, "utf8")).map((formulas) => {
    output.fontCache.clearCache();
    return {
      formulas: formulas.map(({ tex, display }) => {
        const drawn = adaptor.outerHTML(MathJax.tex2svg(tex, { display }));
        if (/data-mjx-error|mjx-merror|<merror/.test(drawn)) throw new Error(`MathJax does not understand ${tex}`);
        return light(drawn);
      }),
      shapes: `<svg id="MJX-SVG-global-cache" aria-hidden="true" style="display:none">` +
        `${adaptor.outerHTML(output.fontCache.getCache())}</svg>`,
    };
  });
  const answer = Buffer.from(JSON.stringify({ style, pages }));
  for (let at = 0; at < answer.length;) at += writeSync(1, answer, at);
}).catch((error) => {
  console.error(error.message ?? error);
  process.exitCode = 1;
});
