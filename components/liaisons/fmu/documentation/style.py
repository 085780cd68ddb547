"""How the page looks: quiet, on light and on dark."""

STYLE = """
:root { color-scheme: light dark; --rule: color-mix(in srgb, CanvasText 18%, Canvas);
  --soft: color-mix(in srgb, CanvasText 5%, Canvas); --quiet: color-mix(in srgb, CanvasText 65%, Canvas); }
body { font: 16px/1.55 system-ui, sans-serif; max-width: 62rem; margin: 3rem auto; padding: 0 1.2rem; }
h1 { font-size: 2.1rem; font-weight: 600; margin: 0; }
h2 { font-size: 1.35rem; font-weight: 600; margin: 3rem 0 .6rem; padding-bottom: .3rem;
  border-bottom: 1px solid var(--rule); }
h3 { font-size: 1rem; font-weight: 600; margin: 1.8rem 0 .3rem; }
header p { font-size: 1.1rem; margin: .4rem 0 1rem; color: var(--quiet); }
a { color: inherit; text-decoration-color: var(--rule); text-underline-offset: .2em; }
nav, small, footer, .note { color: var(--quiet); font-size: .9rem; }
footer { margin-top: 4rem; }
pre { background: var(--soft); padding: .9rem 1.1rem; border-radius: .4rem; overflow-x: auto; line-height: 1.7; }
code, pre { font-family: ui-monospace, "DejaVu Sans Mono", monospace; font-size: .88em; }
.wide, .equations { overflow-x: auto; }
.equations { margin: .6rem 0; padding: .1rem 1.2rem; border-left: 2px solid var(--rule); }
.equations p { margin: .5rem 0 0; color: var(--quiet); font-size: .9rem; }
.equations .formula { margin: .6rem 0 .6rem 2.4rem; text-indent: -2.4rem; line-height: 2.2; color: inherit;
  font-size: inherit; }
.formula math { text-indent: 0; }
mover > mo { math-depth: 0; } /* dots in full size; accents fall into the letter without a mathematics font */
.field { margin: .2rem 0 .2rem 1.2rem; }
math { font-family: "STIX Two Math", "Latin Modern Math", "Libertinus Math", "Cambria Math", math; }
math[display=block] { width: max-content; margin: .6rem 0; font-size: 1.08em; }
table { border-collapse: collapse; font-size: .92rem; }
th, td { text-align: left; padding: .3rem 1rem .3rem 0; border-bottom: 1px solid var(--rule); vertical-align: top; }
th { font-weight: 500; color: var(--quiet); }
td:first-child, td code { white-space: nowrap; }
@media print { body { margin: 0 auto; } }
"""
