// What a page in one file has in its elements, compressed and as text (visualization/browser_code/one_file.py).
const DIGITS = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz!#$%&()*+-;,=>?@^_`{|}~";
const VALUES = new Map([...DIGITS].map((digit, value) => [digit, value]));

// Five digits of base 85 are four bytes, the highest first; at the end n + 1 digits are n bytes.
function bytes(text) {
  const length = Math.floor((text.length * 4) / 5), words = new DataView(new ArrayBuffer(length + 3));
  const whole = `${text}~~~~`;
  for (let i = 0; 5 * i < text.length; i++) {
    let word = 0;
    for (let k = 0; k < 5; k++) word = 85 * word + VALUES.get(whole[5 * i + k]);
    words.setUint32(4 * i, word);
  }
  return new Uint8Array(words.buffer, 0, length);
}

export const unpacked = async (id) => {
  const stream = new Blob([bytes(document.getElementById(id).textContent)]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
};

export const unpackedText = async (id) => new TextDecoder().decode(await unpacked(id));
