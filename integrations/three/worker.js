// Worker that decodes textures of one pack by libntc in WebAssembly. index.js sends jobs and receives mips.

const RGBA8 = -1;
const BLOCK_BYTES = [8, 16, 16, 8, 16, 16];
const OUTPUT_WORDS = 7;

let ntc;
/** Promise of facts about the textures, which resolves when the pack is open. */
let opened = Promise.reject(new Error("no pack is open"));
opened.catch(() => {});
/** Addresses and sizes of the pack and of its tables. */
let places = [];
/** Whether bytes of the pack have arrived since libntc checked it. */
let isStale = false;
const decoder = new TextDecoder();

/** Copies bytes into the module's memory, and returns their address. Memory may move, so each call makes a new view. */
function put(bytes) {
    const at = ntc.allocate(bytes.byteLength || 1);
    if (at === 0) throw new Error("there is no memory");
    new Uint8Array(ntc.memory.buffer, at, bytes.byteLength).set(bytes);
    return at;
}

function text(at) {
    const bytes = new Uint8Array(ntc.memory.buffer, at);
    return decoder.decode(bytes.slice(0, bytes.indexOf(0)));
}

/** Opens a pack. Returns width, height, mips, channels and pixel hash of its textures. */
async function open({ module, pack, tables }) {
    ntc = (await WebAssembly.instantiate(module, {})).exports;
    ntc._initialize();
    const tableBytes = tables ? new Uint8Array(tables) : new Uint8Array();
    places = [put(pack), pack.length, put(tableBytes), tableBytes.length];
    check();
    const facts = ntc.allocate(20);
    return Array.from({ length: ntc.textures() }, (_, number) => {
        ntc.texture(number, facts);
        const [width, height, mips, channels, hash] = new Int32Array(ntc.memory.buffer, facts, 5);
        return { width, height, mips, channels, hash: text(hash) };
    });
}

/** Opens the pack again, with all bytes that have arrived. Throws libntc's error. */
function check() {
    if (ntc.open(...places) !== 0) throw new Error(text(ntc.error()));
    isStale = false;
}

/** Copies new bytes of the pack into the module's memory. */
function fill({ parts }) {
    const [start, size] = places;
    for (const { at, data } of parts) new Uint8Array(ntc.memory.buffer, start, size).set(data, at);
    isStale = true;
}

/** Linear light of the 256 values of sRGB. */
const LIGHT = Float32Array.from({ length: 256 }, (_, value) =>
    value <= 10 ? value / 3294.6 : ((value / 255 + 0.055) / 1.055) ** 2.4,
);
/** sRGB values for 4096 steps of linear light. */
const VALUES = Uint8Array.from({ length: 4097 }, (_, step) => {
    const light = step / 4096;
    return 255 * (light <= 0.0031308 ? 12.92 * light : 1.055 * light ** (1 / 2.4) - 0.055) + 0.5;
});

/** Returns the next mip of an RGBA8 image: each texel is the mean of four, in linear light for colours. */
function halved({ data, width, height }, isColor) {
    const [w, h] = [Math.max(1, width >> 1), Math.max(1, height >> 1)];
    const half = new Uint8Array(4 * w * h);
    for (let y = 0; y < h; ++y) {
        for (let x = 0; x < w; ++x) {
            for (let k = 0; k < 4; ++k) {
                const rows = [2 * y, Math.min(2 * y + 1, height - 1)];
                const columns = [2 * x, Math.min(2 * x + 1, width - 1)];
                const isLight = isColor && k < 3;
                let sum = isLight ? 0 : 2;
                for (const row of rows) {
                    for (const column of columns) {
                        const value = data[4 * (row * width + column) + k];
                        sum += isLight ? LIGHT[value] : value;
                    }
                }
                half[4 * (y * w + x) + k] = isLight ? VALUES[Math.round(1024 * sum)] : sum >> 2;
            }
        }
    }
    return { data: half, width: w, height: h };
}

/** Returns all mips of an image at a URL or in a Blob, as RGBA8. */
async function imageMips({ image, isColor }) {
    const answer = typeof image === "string" ? await fetch(image) : null;
    if (answer && !answer.ok) throw new Error(`${answer.status}`);
    const blob = answer ? await answer.blob() : image;
    const bitmap = await createImageBitmap(blob, { premultiplyAlpha: "none", colorSpaceConversion: "none" });
    const { width, height } = bitmap;
    const mips = 1 + Math.floor(Math.log2(Math.max(width, height)));
    return fillMips(bitmap, Array.from({ length: mips }, () => ({ width, height })), isColor);
}

/** Returns an image as RGBA8 at each of `sizes`, which are those of mips from 0 on. `isColor`: mips are means in linear light. */
function fillMips(image, sizes, isColor = false) {
    const { width, height } = sizes[0];
    const context = new OffscreenCanvas(width, height).getContext("2d", { willReadFrequently: true });
    context.drawImage(image, 0, 0, width, height);
    const mips = [{ data: context.getImageData(0, 0, width, height).data, width, height }];
    while (mips.length < sizes.length) mips.push(halved(mips[mips.length - 1], isColor));
    return mips;
}

/** Decodes mips `first` to `last` of a texture. Returns [{data, width, height}] for each output. */
function decode({ texture, width, height, first, last, outputs }) {
    // New bytes are not checked yet, and may be damaged.
    if (isStale) check();
    const sizes = Array.from({ length: last + 1 }, (_, mip) => ({
        width: Math.max(1, width >> mip),
        height: Math.max(1, height >> mip),
    }));
    const fills = outputs.map((output) => output.fill && fillMips(output.fill, sizes));
    const decoded = outputs.map(() => []);
    for (let mip = first; mip <= last; ++mip) {
        const size = sizes[mip];
        const taken = [];
        const take = (at) => (taken.push(at), at);
        const bytes = outputs.map(({ format }) =>
            format === RGBA8
                ? 4 * size.width * size.height
                : BLOCK_BYTES[format] * Math.ceil(size.width / 4) * Math.ceil(size.height / 4),
        );
        const places = bytes.map((count) => take(ntc.allocate(count)));
        const words = outputs.flatMap(({ channels, format }, number) => {
            const fill = fills[number] ? take(put(fills[number][mip].data)) : 0;
            return [...channels, format, fill, places[number]];
        });
        const table = take(put(new Uint8Array(Int32Array.from(words).buffer)));
        if (taken.includes(0)) throw new Error("there is no memory");
        const status = ntc.decode(texture, mip, table, words.length / OUTPUT_WORDS);
        if (status !== 0) throw new Error(`texture ${texture}, mip ${mip}: cannot be decoded (${status})`);
        places.forEach((at, number) => {
            const data = new Uint8Array(ntc.memory.buffer, at, bytes[number]).slice();
            decoded[number].push({ data, ...size });
        });
        taken.forEach((at) => ntc.release(at));
    }
    return decoded;
}

/** Tasks of index.js. Each returns its result, and the mips whose buffers are transferred with it. */
const TASKS = {
    start: () => [null, []],
    open: async (job) => [await (opened = open(job)), []],
    fill: async (job) => (await opened, fill(job), [null, []]),
    image: async (job) => {
        const mips = await imageMips(job);
        return [mips, mips];
    },
    decode: async (job) => {
        await opened;
        const outputs = decode(job);
        return [outputs, outputs.flat()];
    },
};

self.onmessage = async ({ data: { task, ...job } }) => {
    try {
        const [result, mips] = await TASKS[task](job);
        if (task !== "fill") self.postMessage({ result }, mips.map(({ data }) => data.buffer));
    } catch (error) {
        if (task !== "fill") self.postMessage({ error: error.message });
    }
};
