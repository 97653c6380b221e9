// Draws the diagrams of a page. Served from the site: the theme would fetch Mermaid from another host.
import { mermaid } from "./mermaid/index.js";

const isDark = document.body.dataset.mdColorScheme === "slate";
mermaid.initialize({ startOnLoad: false, theme: isDark ? "dark" : "default" });
await mermaid.run({ querySelector: ".diagram" });
