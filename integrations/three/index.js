// Textures of ntc-viewer's packs (.ntc) in three.js: a plug-in of GLTFLoader. README.md shows its use.

import {
    ClampToEdgeWrapping,
    LinearFilter,
    LinearMipmapLinearFilter,
    LinearMipmapNearestFilter,
    LoaderUtils,
    MirroredRepeatWrapping,
    NearestFilter,
    NearestMipmapLinearFilter,
    NearestMipmapNearestFilter,
    RED_GREEN_RGTC2_Format,
    RGBAFormat,
    RGBA_BPTC_Format,
    RepeatWrapping,
    SRGBColorSpace,
    ShaderChunk,
} from "three";

import { PackFile } from "./pack.js";
import { MippedTexture, TextureMemory, TextureSet } from "./textures.js";

export { TextureMemory };

const EXTENSION = "NV_texture_swizzle";
const PACK_TYPE = "image/vnd.ntc-viewer.pack";
const FILLED = -1;
const NORMAL_Z = -2;
/** Numbers of formats in ntc_web.c. */
const RGBA8 = -1;
const BC5 = 4;
const BC7 = 5;
const THREE_FORMATS = { [RGBA8]: RGBAFormat, [BC5]: RED_GREEN_RGTC2_Format, [BC7]: RGBA_BPTC_Format };
/** Largest sides of the mips of each decoding step: all textures at the first size, then all at the next. */
const STAGES = [128, 1024, Infinity];
const STAGES_ON_DEMAND = [32, 256, Infinity];
const FILTERS = {
    9728: NearestFilter,
    9729: LinearFilter,
    9984: NearestMipmapNearestFilter,
    9985: LinearMipmapNearestFilter,
    9986: NearestMipmapLinearFilter,
    9987: LinearMipmapLinearFilter,
};
const WRAPS = { 10497: RepeatWrapping, 33071: ClampToEdgeWrapping, 33648: MirroredRepeatWrapping };

/** Decoding workers of one pack, and their queue. */
class Workers {
    #idle = [];
    #queue = [];
    #all = [];

    /** Starts `count` workers with the pack of `job`; returns facts about its textures. Rejects if it is no pack. */
    async open(count, job) {
        const facts = await this.#add({ task: "open", ...job });
        for (let number = 1; number < count; ++number) this.#add({ task: "open", ...job }).catch(() => {});
        return facts;
    }

    /** Starts a worker without a pack, which computes mips of images. */
    start() {
        this.#add({ task: "start" });
        return this;
    }

    #add(message) {
        const worker = new Worker(new URL("./worker.js", import.meta.url), { type: "module" });
        this.#all.push(worker);
        return this.#ask(worker, message);
    }

    #ask(worker, message) {
        return new Promise((resolve, reject) => {
            worker.onmessage = ({ data }) => {
                if (data.error === undefined) resolve(data.result);
                else reject(new Error(data.error));
                if (data.error === undefined || message.task !== "open") this.#next(worker);
            };
            worker.onerror = (event) => {
                event.preventDefault();
                reject(new Error(event.message || "the worker cannot start"));
            };
            worker.postMessage(message);
        });
    }

    #next(worker) {
        const job = this.#queue.shift();
        if (job === undefined) this.#idle.push(worker);
        else this.#ask(worker, job.message).then(job.resolve, job.reject);
    }

    /** Sends new bytes of the pack to all workers. Later jobs decode with them. */
    fill(parts) {
        if (parts.length > 0) this.#all.forEach((worker) => worker.postMessage({ task: "fill", parts }));
    }

    /** Queues `message`; resolves with a worker's answer. */
    ask(message) {
        return new Promise((resolve, reject) => {
            this.#queue.push({ message, resolve, reject });
            if (this.#idle.length > 0) this.#next(this.#idle.pop());
        });
    }

    end() {
        this.#all.forEach((worker) => worker.terminate());
    }
}

/**
 * Returns how materials read each texture entry: components as bits (red 1, alpha 8), and whether all of them read a normal.
 * @returns {Map<number, {read: number, normal: boolean}>}
 */
function uses(json) {
    const usage = new Map();
    const add = (info, read, normal = false) => {
        if (info === undefined) return;
        const before = usage.get(info.index) ?? { read: 0, normal: true };
        usage.set(info.index, { read: before.read | read, normal: before.normal && normal });
    };
    for (const material of json.materials ?? []) {
        const metallic = material.pbrMetallicRoughness ?? {};
        const color = (material.alphaMode ?? "OPAQUE") === "OPAQUE" ? 0b0111 : 0b1111;
        add(metallic.baseColorTexture, color);
        // A map whose factor is 0 shows nothing.
        const metalness = metallic.metallicFactor === 0 ? 0 : 0b0100;
        add(metallic.metallicRoughnessTexture, metallic.roughnessFactor === 0 ? metalness : metalness | 0b0010);
        add(material.normalTexture, 0b0111, true);
        add(material.occlusionTexture, 0b0001);
        add(material.emissiveTexture, 0b0111);
        for (const extension of Object.values(material.extensions ?? {})) {
            for (const value of Object.values(extension ?? {})) {
                if (typeof value?.index === "number") add(value, 0b1111);
            }
        }
    }
    return usage;
}

/** Returns the file name of the shipped tables that a pack needs; null if it needs none. */
function tablesName(pack) {
    const length = Number(new DataView(pack.buffer).getBigUint64(0, true));
    const header = JSON.parse(new TextDecoder().decode(pack.subarray(8, 8 + length)));
    const { codec, grouping } = JSON.parse(header.__metadata__.ntc);
    if (codec.tables) return `universal_sets_${codec.tables}.safetensors`;
    return grouping.name === "universal" ? `universal_${grouping.parameters.version}_${codec.output_channels}.safetensors` : null;
}

async function fetched(url) {
    const response = await fetch(url);
    if (!response.ok) throw new Error(`${url}: ${response.status}`);
    return response.arrayBuffer();
}

let compiled = null;

function wasmModule() {
    compiled ??= fetched(new URL("./generated/ntc.wasm", import.meta.url)).then((bytes) => WebAssembly.compile(bytes));
    return compiled;
}

/**
 * The plug-in: `loader.register((parser) => new NTCTextures(parser, { renderer }))`.
 *
 * @typedef {object} NTCOptions
 * @property {import("three").WebGLRenderer} [renderer] Asked for BC7 and BC5. Without it textures are RGBA8.
 * @property {"auto"|"rgba8"} [format] "auto", the default: BC7, and BC5 for normals, where the device has them, else RGBA8.
 * @property {number} [workers] Default: one less than the processor's threads, 1 to 4.
 * @property {string|null} [pack] The pack to show, by its `uri`, where the file names several. null: none, the images of the file.
 * @property {boolean} [onDemand] Decodes finer mips only as `want` asks for them. Images of the file are then read on demand too.
 * @property {TextureMemory} [memory] Limits what textures take on the GPU. Default: no limit.
 * @property {(texture: import("three").Texture) => void} [onUpdate] Called when finer mips of a texture are there: draw again.
 * @property {(error: Error) => void} [onError] Called once for a pack that cannot be read. Default: console.error.
 */
export class NTCTextures {
    name = EXTENSION;
    #parser;
    #options;
    #workers;
    #memory;
    #blocks;
    #uses;
    /** By texture entry: {option, others}, the texture of a pack to show, and extensions that name other images. */
    #entries = new Map();
    /** By image entry: {workers, facts, file, name}. */
    #packs = new Map();
    /** By image entry and texture of its pack: the textures of three.js by texture entry. */
    #decoded = new Map();
    /** All TextureSets that show something. */
    #sets = new Set();
    /** Mips to decode: {set, mip}. */
    #queue = [];
    #running = 0;
    /** Whether finer mips may be decoded: true once the first picture is complete. */
    #isBegun = false;
    #listeners = [];
    #imageWorkers = null;
    #sizes;

    /**
     * @param {import("three/addons/loaders/GLTFLoader.js").GLTFParser} parser
     * @param {NTCOptions} [options]
     */
    constructor(parser, options = {}) {
        this.#parser = parser;
        this.#options = options;
        this.#sizes = options.onDemand ? STAGES_ON_DEMAND : STAGES;
        this.#memory = options.memory ?? new TextureMemory();
        this.#workers = options.workers ?? Math.min(4, Math.max(1, (navigator.hardwareConcurrency ?? 2) - 1));
        const has = (name) => options.renderer?.extensions?.has(name) ?? false;
        const wanted = options.format ?? "auto";
        this.#blocks = {
            bc7: wanted !== "rgba8" && has("EXT_texture_compression_bptc"),
            // Older versions of three.js read z of normals from the texture.
            bc5:
                wanted !== "rgba8" &&
                has("EXT_texture_compression_rgtc") &&
                ShaderChunk.normal_fragment_maps.includes("USE_PACKED_NORMALMAP"),
        };
        this.#uses = uses(parser.json);
        const { images = [], textures = [] } = parser.json;
        const isShown = ({ mimeType, uri }) => mimeType === PACK_TYPE && (options.pack === undefined || options.pack === uri);
        textures.forEach((texture, index) => {
            const { [EXTENSION]: swizzle, ...others } = texture.extensions ?? {};
            const option = swizzle?.options?.find(({ source }) => images[source] && isShown(images[source]));
            if (option === undefined && !options.onDemand) return;
            this.#entries.set(index, { option, others });
            // Otherwise GLTFLoader's plug-ins for WebP, AVIF and KTX2 would come first.
            texture.extensions = { [EXTENSION]: swizzle };
        });
    }

    /**
     * Resolves when all requested mips are loaded: `await gltf.parser.plugins.NV_texture_swizzle.complete()`. These are the
     * finest mips of all textures, or with `onDemand` those of the last call of `want`.
     */
    complete() {
        return new Promise((resolve) => {
            this.#listeners.push(resolve);
            this.#pump();
        });
    }

    /** Whether all requested mips are loaded. */
    get isComplete() {
        return this.#running === 0 && this.#queue.length === 0;
    }

    /** Whether each texture in sight has a mip. */
    get hasCoarse() {
        return [...this.#sets].every(({ isSeen, level }) => !isSeen || level < Infinity);
    }

    /**
     * Sets which textures are in sight, with `onDemand`. All others may lose their finer mips.
     * @param {Map<import("three").Texture, number>} footprints By texture, the smallest distance of neighbouring pixels in texture
     * coordinates.
     */
    want(footprints) {
        for (const set of this.#sets) set.isSeen = false;
        for (const [texture, footprint] of footprints) {
            const { set } = texture;
            if (!this.#sets.has(set)) continue;
            set.footprint = set.isSeen ? Math.min(set.footprint, footprint) : footprint;
            Object.assign(set, { isSeen: true, seenAt: performance.now() });
        }
        this.#plan();
    }

    /** GLTFLoader calls this when the scene is loaded, with coarse mips. */
    async afterRoot() {
        this.#isBegun = true;
        this.#plan();
        if (this.#options.onDemand) return;
        this.complete().then(async () => {
            const packs = await Promise.all(this.#packs.values());
            packs.forEach((pack) => pack?.workers.end());
            this.#packs.clear();
            this.#decoded.clear();
        });
    }

    /** Queues missing mips: all textures at one size, then all at the next. */
    #plan() {
        const stages = STAGES.map(() => []);
        for (const set of this.#sets) {
            if (!this.#options.onDemand) Object.assign(set, { isSeen: true, footprint: 0 });
            if (!set.isSeen) continue;
            // The size of an image is unknown until it is loaded.
            if (set.mips === 0) stages[0].push({ set });
            const wanted = set.fit(set.mipOf(set.footprint));
            let last = set.level;
            set.steps.forEach((step, stage) => {
                const mip = Math.max(step, wanted);
                if (mip < last) stages[stage].push({ set, mip });
                last = Math.min(last, mip);
            });
        }
        this.#queue = stages.flat();
        this.#pump();
    }

    #pump() {
        while (this.#isBegun && this.#running < this.#workers) {
            const place = this.#queue.findIndex(({ set }) => !set.isBusy);
            if (place < 0) break;
            this.#refine(...this.#queue.splice(place, 1));
        }
        if (this.isComplete) this.#listeners.splice(0).forEach((listener) => listener());
    }

    async #refine({ set, mip }) {
        this.#running += 1;
        set.isBusy = true;
        try {
            if (set.mips === 0) await set.open();
            await set.refine(mip ?? set.mipOf(set.footprint));
        } catch (error) {
            const { source } = set;
            if (!source.isBroken) this.#report(`${source.name}: ${source.finer ?? ""}cannot be read (${error.message})`);
            source.isBroken = true;
            this.#sets.delete(set);
            this.#queue = this.#queue.filter((job) => job.set !== set);
        }
        set.isBusy = false;
        this.#running -= 1;
        if (this.#sets.has(set)) set.textures.forEach((texture) => this.#options.onUpdate?.(texture));
        this.#pump();
    }

    /** GLTFLoader calls this for each texture entry. */
    loadTexture(index) {
        return this.#entries.has(index) ? this.#load(index) : null;
    }

    async #load(index) {
        const { option } = this.#entries.get(index);
        if (option === undefined) return this.#fallback(index);
        const { source, arrayLayer, extras } = option;
        const pack = await this.#pack(source);
        if (pack === null) return this.#fallback(index);
        const hash = extras?.pixelHash;
        const layer = hash ? pack.facts.findIndex((fact) => fact.hash === hash) : arrayLayer;
        if (!pack.facts[layer]) {
            this.#report(`textures[${index}]: is not in the pack; its other image is shown`);
            return this.#fallback(index);
        }
        const key = `${source}:${layer}`;
        if (!this.#decoded.has(key)) this.#decoded.set(key, this.#decode(pack, layer, option));
        return (await this.#decoded.get(key)).get(index) ?? this.#fallback(index);
    }

    /** Returns the texture to show instead of a pack; null without an image. */
    #fallback(index) {
        return this.#options.onDemand ? this.#lazyImage(index) : this.#plainImage(index);
    }

    /** Returns the texture that other plug-ins or GLTFLoader load; null without an image. */
    #plainImage(index) {
        const parser = this.#parser;
        const texture = parser.json.textures[index];
        texture.extensions = this.#entries.get(index).others;
        for (const plugin of Object.values(parser.plugins)) {
            const loaded = plugin === this ? null : plugin.loadTexture?.(index);
            if (loaded) return loaded;
        }
        return texture.source === undefined ? null : parser.loadTexture(index);
    }

    /** Returns a texture that loads an image of the file once it is in sight; null without an image. */
    #lazyImage(index) {
        const { json } = this.#parser;
        const { others } = this.#entries.get(index);
        const source = Object.values(others).find((extension) => typeof extension?.source === "number")?.source ?? json.textures[index].source;
        const entry = json.images?.[source];
        if (entry === undefined) return null;
        const texture = this.#texture(index, RGBAFormat);
        texture.show([{ data: new Uint8Array(this.#uses.get(index)?.normal ? [128, 128, 255, 255] : [128, 128, 128, 255]), width: 1, height: 1 }]);
        let image = null;
        const read = async () => {
            this.#imageWorkers ??= new Workers().start();
            const isColor = [...texture.family].some(({ colorSpace }) => colorSpace === SRGBColorSpace);
            return this.#imageWorkers.ask({ task: "image", isColor, image: await this.#imageFile(entry) });
        };
        const set = new TextureSet([texture], this.#memory, async (first, last) => {
            const mips = (image ?? (await read())).slice(first, last + 1);
            image = null;
            return [mips];
        });
        set.source = { name: entry.name ?? entry.uri ?? `images[${source}]` };
        set.open = async () => {
            image = await read();
            const [{ width, height }] = image;
            set.resize(width, height, image.length, stages(this.#sizes, width, height, image.length, true, () => true));
        };
        this.#sets.add(set);
        return texture;
    }

    /** Returns the file of an image: its URL, or a Blob. */
    async #imageFile({ uri, bufferView, mimeType }) {
        const parser = this.#parser;
        if (bufferView !== undefined) return new Blob([await parser.getDependency("bufferView", bufferView)], { type: mimeType });
        const { manager } = parser.fileLoader;
        return new URL(manager.resolveURL(LoaderUtils.resolveURL(uri, parser.options.path)), globalThis.location?.href).href;
    }

    #report(message) {
        if (this.#options.onError) this.#options.onError(new Error(message));
        else console.error(message);
    }

    #pack(image) {
        if (!this.#packs.has(image)) this.#packs.set(image, this.#opened(image));
        return this.#packs.get(image);
    }

    async #opened(image) {
        const workers = new Workers();
        const name = this.#parser.json.images[image].uri ?? `images[${image}]`;
        try {
            const [module, file] = await Promise.all([wasmModule(), this.#file(image)]);
            const pack = file.bytes;
            file.bytes = null;
            let tables = null;
            try {
                tables = tablesName(pack);
            } catch {
                // libntc will report what is wrong with the pack.
            }
            if (tables !== null) tables = await fetched(new URL(`./${tables}`, import.meta.url));
            const facts = await workers.open(this.#workers, { module, pack, tables });
            return { workers, facts, file, name, finer: "finer mips " };
        } catch (error) {
            workers.end();
            this.#report(`${name}: the pack cannot be read (${error.message}); the other images are shown`);
            return null;
        }
    }

    /** Returns the file of a pack, from a buffer view or a URL. Over HTTP it is read in parts. */
    async #file(image) {
        const parser = this.#parser;
        const { uri, bufferView } = parser.json.images[image];
        if (bufferView !== undefined) return PackFile.whole(new Uint8Array(await parser.getDependency("bufferView", bufferView)));
        const url = LoaderUtils.resolveURL(uri, parser.options.path);
        const { manager, requestHeader, withCredentials } = parser.fileLoader;
        const resolved = manager.resolveURL(url);
        if (/^https?:/.test(new URL(resolved, globalThis.location?.href).protocol)) {
            return PackFile.read(resolved, { headers: requestHeader, credentials: withCredentials ? "include" : "same-origin" });
        }
        return new Promise((resolve, reject) => {
            const whole = (data) => resolve(PackFile.whole(new Uint8Array(data)));
            parser.fileLoader.load(url, whole, undefined, () => reject(new Error("the file is not there")));
        });
    }

    /** Starts decoding a texture of a pack for all texture entries that show it. Resolves with textures by entry when coarse mips are loaded. */
    async #decode(pack, layer, { source, arrayLayer, extras }) {
        const entries = [...this.#entries.keys()].filter((index) => {
            const other = this.#entries.get(index).option;
            return other?.source === source && other.arrayLayer === arrayLayer && other.extras?.pixelHash === extras?.pixelHash;
        });
        const { width, height, mips } = pack.facts[layer];
        const made = await Promise.all(entries.map((index) => this.#output(index, width, height)));
        const outputs = made.map(({ output }) => output);
        const textures = made.map(({ texture }) => texture);
        const isPlain = outputs.every(({ format }) => format === RGBA8);
        const set = new TextureSet(textures, this.#memory, async (first, last) => {
            pack.workers.fill(await pack.file.need(layer, first));
            return pack.workers.ask({ task: "decode", texture: layer, width, height, first, last, outputs });
        });
        set.source = pack;
        set.resize(width, height, mips, stages(this.#sizes, width, height, mips, isPlain, (mip) => pack.file.beginsLevel(layer, mip)));
        try {
            await set.refine(set.coarsest);
        } catch (error) {
            this.#report(`${error.message}; the other images are shown`);
            return new Map();
        }
        this.#sets.add(set);
        if (this.#isBegun) this.#plan();
        return new Map(entries.map((index, place) => [index, textures[place]]));
    }

    /** Returns the output that worker.js makes for a texture entry, and the texture that shows it. */
    async #output(index, width, height) {
        const { read, normal } = this.#uses.get(index) ?? { read: 0b1111, normal: false };
        const channels = [...(this.#entries.get(index).option.channels ?? [0, 1, 2, 3])];
        if (normal && channels[2] === FILLED) channels[2] = NORMAL_Z;
        const whole = width % 4 === 0 && height % 4 === 0;
        let format = whole && this.#blocks.bc7 ? BC7 : RGBA8;
        if (whole && this.#blocks.bc5 && normal) format = BC5;
        const missing = channels.some((channel, component) => channel === FILLED && (read >> component) & 1);
        const fill = missing ? await this.#image(index) : null;
        return { output: { channels, format, fill }, texture: this.#texture(index, THREE_FORMATS[format]) };
    }

    /** Returns a texture without mips, with the name and the sampler of a texture entry. */
    #texture(index, format) {
        const { json, associations } = this.#parser;
        const entry = json.textures[index];
        const texture = new MippedTexture([], 1, 1, format);
        texture.name = entry.name ?? "";
        const sampler = json.samplers?.[entry.sampler] ?? {};
        texture.magFilter = FILTERS[sampler.magFilter] ?? LinearFilter;
        texture.minFilter = FILTERS[sampler.minFilter] ?? LinearMipmapLinearFilter;
        texture.wrapS = WRAPS[sampler.wrapS] ?? RepeatWrapping;
        texture.wrapT = WRAPS[sampler.wrapT] ?? RepeatWrapping;
        associations.set(texture, { textures: index });
        return texture;
    }

    /** Returns the image of a texture entry, for components that the pack does not hold; null without one. */
    async #image(index) {
        const texture = await this.#plainImage(index);
        if (!texture?.image || texture.isCompressedTexture || texture.isDataTexture) return null;
        return createImageBitmap(texture.image, { premultiplyAlpha: "none", colorSpaceConversion: "none" });
    }
}

/**
 * Returns the finest mip of each decoding step, the coarsest step first: the largest whose sides are at most those in `sizes`. Sides
 * are multiples of 4 unless `any`. The first one must satisfy `beginsLevel`.
 */
function stages(sizes, width, height, mips, any, beginsLevel) {
    const firsts = [];
    for (const largest of sizes) {
        for (let mip = 0; mip < mips; ++mip) {
            const [w, h] = [Math.max(1, width >> mip), Math.max(1, height >> mip)];
            if (Math.max(w, h) > largest || (!any && (w % 4 || h % 4))) continue;
            if (largest === sizes[0] && !beginsLevel(mip)) continue;
            if (mip !== firsts[firsts.length - 1]) firsts.push(mip);
            break;
        }
    }
    return firsts;
}
