// The page's script, gzipped and in base64, becomes a script; the page's policy knows it by its hash.

const packed = document.getElementById("packed").textContent;
if (typeof DecompressionStream === "function") {
  const bytes = Uint8Array.from(atob(packed), (letter) => letter.charCodeAt(0));
  const text = await new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
  document.body.append(Object.assign(document.createElement("script"), { type: "module", textContent: text }));
} else document.body.prepend("This browser is too old for this page: take a newer one.");
