// Files of the page's own folder, checked before they are used.

/** What goes wrong in a way that one line can tell. */
export class PageError extends Error {}

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, n) => {
  let c = n;
  for (let bit = 0; bit < 8; ++bit) c = c & 1 ? (c >>> 1) ^ 0xedb88320 : c >>> 1;
  return c;
});

export function crc32(bytes) {
  let c = 0xffffffff;
  for (let i = 0; i < bytes.length; ++i) c = CRC_TABLE[(c ^ bytes[i]) & 255] ^ (c >>> 8);
  return (c ^ 0xffffffff) >>> 0;
}

async function get(name) {
  let response;
  try {
    response = await fetch(name);
  } catch {
    throw new PageError(`${name}: cannot be read; is the server still there?`);
  }
  if (!response.ok) throw new PageError(`${name}: the server answers ${response.status}; copy the whole folder`);
  return response;
}

export async function readJson(name) {
  const response = await get(name);
  try {
    return await response.json();
  } catch {
    throw new PageError(`${name}: is damaged; export the page again`);
  }
}

/** The bytes of a file as page.json describes it: {file, bytes, crc32}. */
export async function readFile(entry) {
  const bytes = new Uint8Array(await (await get(entry.file)).arrayBuffer());
  if (bytes.length !== entry.bytes || crc32(bytes) !== entry.crc32) {
    throw new PageError(`${entry.file}: is damaged (${bytes.length} of ${entry.bytes} bytes); export the page again`);
  }
  return bytes;
}

export async function readText(entry) {
  return new TextDecoder().decode(await readFile(entry));
}

/** A picture whose numbers are taken as they are: no colour profile, nothing multiplied by alpha. */
export async function readPicture(entry) {
  const blob = new Blob([await readFile(entry)], { type: "image/webp" });
  try {
    return await createImageBitmap(blob, { colorSpaceConversion: "none", premultiplyAlpha: "none" });
  } catch {
    throw new PageError(`${entry.file}: this browser cannot read WebP pictures; use a newer one`);
  }
}
