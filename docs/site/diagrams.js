// Draws the diagrams of a page. Served from the site: the theme would fetch Mermaid from another host.
import { mermaid } from "./mermaid/index.js";

const isDark = document.body.dataset.mdColorScheme === "slate";
// Narrow: what is wider than the column is drawn smaller.
const state = { nodeSpacing: 10, rankSpacing: 25 };
mermaid.initialize({ startOnLoad: false, theme: isDark ? "dark" : "default", state });
await mermaid.run({ querySelector: ".diagram" });
