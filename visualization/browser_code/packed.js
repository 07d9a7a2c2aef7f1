// What a page in one file has in its elements, compressed and as text (visualization/standalone/page.py).
export const unpacked = async (id) => {
  const packed = Uint8Array.from(atob(document.getElementById(id).textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
};

export const unpackedText = async (id) => new TextDecoder().decode(await unpacked(id));
