// Textures of ntc-viewer's packs (.ntc) in three.js: a plug-in of GLTFLoader. README.md shows its use.

import {
    ClampToEdgeWrapping,
    CompressedTexture,
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
    ShaderChunk,
} from "three";

import { PackFile } from "./pack.js";

const EXTENSION = "NV_texture_swizzle";
const PACK_TYPE = "image/vnd.ntc-viewer.pack";
const FILLED = -1;
const NORMAL_Z = -2;
/** Numbers of formats in ntc_web.c. */
const RGBA8 = -1;
const BC5 = 4;
const BC7 = 5;
const THREE_FORMATS = { [RGBA8]: RGBAFormat, [BC5]: RED_GREEN_RGTC2_Format, [BC7]: RGBA_BPTC_Format };
/** Largest sides of the mips that are decoded first, and next: all textures at one size, then all at the other. */
const STAGES = [128, 1024, Infinity];
const FILTERS = {
    9728: NearestFilter,
    9729: LinearFilter,
    9984: NearestMipmapNearestFilter,
    9985: LinearMipmapNearestFilter,
    9986: NearestMipmapLinearFilter,
    9987: LinearMipmapLinearFilter,
};
const WRAPS = { 10497: RepeatWrapping, 33071: ClampToEdgeWrapping, 33648: MirroredRepeatWrapping };

/** A texture whose mips arrive from the coarsest. Clones, as GLTFLoader makes them, get them too. */
class PackedTexture extends CompressedTexture {
    /** All textures that show the same mips, this one and its clones. */
    family = new Set([this]);

    copy(source) {
        super.copy(source);
        this.family = source.family.add(this);
        return this;
    }

    /** Shows `mips` in front of those that are there. */
    prepend(mips) {
        const [{ width, height }] = mips;
        const all = [...mips, ...this.mipmaps];
        for (const texture of this.family) {
            // A texture of another size is another texture on the GPU.
            texture.dispose();
            texture.mipmaps = all;
            texture.image = { width, height };
            texture.needsUpdate = true;
        }
    }
}

/** Workers that decode one pack, and their queue: the lowest stage first. */
class Workers {
    #idle = [];
    #queue = [];
    #all = [];

    /** Opens the pack in a worker; returns facts about its textures. Rejects for what is no pack. */
    async open(count, job) {
        const found = await this.#add(job);
        for (let number = 1; number < count; ++number) this.#add(job).catch(() => {});
        return found;
    }

    #add(job) {
        const worker = new Worker(new URL("./worker.js", import.meta.url), { type: "module" });
        this.#all.push(worker);
        return this.#ask(worker, { task: "open", ...job });
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

    /** Gives all workers bytes of the pack that have arrived. What is asked of them later is decoded with these. */
    fill(parts) {
        if (parts.length > 0) this.#all.forEach((worker) => worker.postMessage({ task: "fill", parts }));
    }

    /** Mips of a texture: for each output [{data, width, height}]. */
    decode(stage, message) {
        return new Promise((resolve, reject) => {
            const place = this.#queue.findIndex((job) => job.stage > stage);
            const job = { stage, message: { task: "decode", ...message }, resolve, reject };
            this.#queue.splice(place < 0 ? this.#queue.length : place, 0, job);
            if (this.#idle.length > 0) this.#next(this.#idle.pop());
        });
    }

    end() {
        this.#all.forEach((worker) => worker.terminate());
    }
}

/**
 * What materials read of each texture entry: components as bits (red 1, alpha 8), and whether all of them read a normal.
 * @returns {Map<number, {read: number, normal: boolean}>}
 */
function uses(json) {
    const found = new Map();
    const add = (info, read, normal = false) => {
        if (info === undefined) return;
        const before = found.get(info.index) ?? { read: 0, normal: true };
        found.set(info.index, { read: before.read | read, normal: before.normal && normal });
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
    return found;
}

/** Which tables of grouping `universal` a pack names; null for others. */
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
    compiled ??= fetched(new URL("./ntc.wasm", import.meta.url)).then((bytes) => WebAssembly.compile(bytes));
    return compiled;
}

/**
 * The plug-in: `loader.register((parser) => new NTCTextures(parser, { renderer }))`.
 *
 * @typedef {object} NTCOptions
 * @property {import("three").WebGLRenderer} [renderer] Asked for BC7 and BC5. Without it textures are RGBA8.
 * @property {"auto"|"rgba8"} [format] "auto", the default: BC7, and BC5 for normals, where the device has them, else RGBA8.
 * @property {number} [workers] Default: one less than the processor's threads, 1 to 4.
 * @property {(texture: import("three").Texture) => void} [onUpdate] Called when finer mips of a texture are there: draw again.
 * @property {(error: Error) => void} [onError] Called once for a pack that cannot be read. Default: console.error.
 */
export class NTCTextures {
    name = EXTENSION;
    #parser;
    #options;
    #blocks;
    #uses;
    /** By texture entry that names a pack: {option, others}, the extensions that name other images. */
    #entries = new Map();
    /** By image entry: {workers, facts}. */
    #packs = new Map();
    /** By image entry and texture of the pack: the textures of three.js, by entry. */
    #sets = new Map();
    #pending = [];
    #begin;
    /** Resolves when finer mips may be decoded: the first picture comes before. */
    #begun = new Promise((resolve) => (this.#begin = resolve));

    /**
     * @param {import("three/addons/loaders/GLTFLoader.js").GLTFParser} parser
     * @param {NTCOptions} [options]
     */
    constructor(parser, options = {}) {
        this.#parser = parser;
        this.#options = options;
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
        textures.forEach((texture, index) => {
            const { [EXTENSION]: own, ...others } = texture.extensions ?? {};
            const option = own?.options?.find(({ source }) => images[source]?.mimeType === PACK_TYPE);
            if (option === undefined) return;
            this.#entries.set(index, { option, others });
            // GLTFLoader asks its own plug-ins for WebP, AVIF and KTX2 first.
            texture.extensions = { [EXTENSION]: own };
        });
    }

    /** Resolves when the finest mips of all textures are there: `await gltf.parser.plugins.NV_texture_swizzle.complete()`. */
    async complete() {
        await Promise.all(this.#pending);
    }

    /** GLTFLoader calls this when the scene is there, with its coarse mips. */
    async afterRoot() {
        this.#begin();
        this.complete().then(async () => {
            const packs = await Promise.all(this.#packs.values());
            packs.forEach((pack) => pack?.workers.end());
            this.#packs.clear();
            this.#sets.clear();
        });
    }

    /** GLTFLoader calls this for each texture entry. */
    loadTexture(index) {
        return this.#entries.has(index) ? this.#load(index) : null;
    }

    async #load(index) {
        const { source, arrayLayer, extras } = this.#entries.get(index).option;
        const pack = await this.#pack(source);
        if (pack === null) return this.#fallback(index);
        const hash = extras?.pixelHash;
        const layer = hash ? pack.facts.findIndex((own) => own.hash === hash) : arrayLayer;
        if (!pack.facts[layer]) {
            this.#report(`textures[${index}]: is not in the pack; its other image is shown`);
            return this.#fallback(index);
        }
        const key = `${source}:${layer}`;
        if (!this.#sets.has(key)) this.#sets.set(key, this.#decode(pack, layer, this.#entries.get(index).option));
        return (await this.#sets.get(key)).get(index) ?? this.#fallback(index);
    }

    /** What other plug-ins or GLTFLoader show; null without an image. */
    #fallback(index) {
        const parser = this.#parser;
        const texture = parser.json.textures[index];
        texture.extensions = this.#entries.get(index).others;
        for (const plugin of Object.values(parser.plugins)) {
            const found = plugin === this ? null : plugin.loadTexture?.(index);
            if (found) return found;
        }
        return texture.source === undefined ? null : parser.loadTexture(index);
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
                // libntc says what is wrong with the pack.
            }
            if (tables !== null) tables = await fetched(new URL(`./${tables}`, import.meta.url));
            const count = this.#options.workers ?? Math.min(4, Math.max(1, (navigator.hardwareConcurrency ?? 2) - 1));
            const facts = await workers.open(count, { module, pack, tables });
            return { workers, facts, file, name };
        } catch (error) {
            workers.end();
            this.#report(`${name}: the pack cannot be read (${error.message}); the other images are shown`);
            return null;
        }
    }

    /** The pack as it lies in the file, or beside it: read in parts where it comes by HTTP. */
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

    /** Begins to decode all entries that a texture of the pack stands for. Resolves with them when their coarse mips are there. */
    async #decode(pack, layer, { source, arrayLayer, extras }) {
        const entries = [...this.#entries.keys()].filter((index) => {
            const own = this.#entries.get(index).option;
            return own.source === source && own.arrayLayer === arrayLayer && own.extras?.pixelHash === extras?.pixelHash;
        });
        const { width, height, mips } = pack.facts[layer];
        const made = await Promise.all(entries.map((index) => this.#output(index, width, height)));
        const outputs = made.map(({ output }) => output);
        const shown = made.map(({ texture }) => texture);
        let last = mips - 1;
        const isPlain = outputs.every(({ format }) => format === RGBA8);
        const jobs = stages(width, height, mips, isPlain, (mip) => pack.file.hasOwnCodes(layer, mip)).map((first) => {
            const job = { texture: layer, width, height, first, last, outputs };
            last = first - 1;
            return job;
        });
        const show = async (stage) => {
            pack.workers.fill(await pack.file.need(layer, jobs[stage].first));
            const found = await pack.workers.decode(stage, jobs[stage]);
            shown.forEach((texture, place) => texture.prepend(found[place]));
        };
        const finish = async () => {
            await this.#begun;
            for (let stage = 1; stage < jobs.length; ++stage) {
                await show(stage);
                shown.forEach((texture) => this.#options.onUpdate?.(texture));
            }
        };
        try {
            await show(0);
        } catch (error) {
            this.#report(`${error.message}; the other images are shown`);
            return new Map();
        }
        const fail = (error) => {
            if (!pack.isBroken) this.#report(`${pack.name}: finer mips cannot be read (${error.message})`);
            pack.isBroken = true;
        };
        this.#pending.push(finish().catch(fail));
        return new Map(entries.map((index, place) => [index, shown[place]]));
    }

    /** What worker.js makes for a texture entry, and the texture that shows it. */
    async #output(index, width, height) {
        const { json, associations } = this.#parser;
        const entry = json.textures[index];
        const { read, normal } = this.#uses.get(index) ?? { read: 0b1111, normal: false };
        const channels = [...(this.#entries.get(index).option.channels ?? [0, 1, 2, 3])];
        if (normal && channels[2] === FILLED) channels[2] = NORMAL_Z;
        const whole = width % 4 === 0 && height % 4 === 0;
        let format = whole && this.#blocks.bc7 ? BC7 : RGBA8;
        if (whole && this.#blocks.bc5 && normal) format = BC5;
        const missing = channels.some((channel, component) => channel === FILLED && (read >> component) & 1);
        const fill = missing ? await this.#image(index) : null;
        const texture = new PackedTexture([], width, height, THREE_FORMATS[format]);
        texture.name = entry.name ?? "";
        const sampler = json.samplers?.[entry.sampler] ?? {};
        texture.magFilter = FILTERS[sampler.magFilter] ?? LinearFilter;
        texture.minFilter = FILTERS[sampler.minFilter] ?? LinearMipmapLinearFilter;
        texture.wrapS = WRAPS[sampler.wrapS] ?? RepeatWrapping;
        texture.wrapT = WRAPS[sampler.wrapT] ?? RepeatWrapping;
        associations.set(texture, { textures: index });
        return { output: { channels, format, fill }, texture };
    }

    /** The image of a texture entry, for components that the pack does not hold; null without one. */
    async #image(index) {
        const texture = await this.#fallback(index);
        if (!texture?.image || texture.isCompressedTexture || texture.isDataTexture) return null;
        return createImageBitmap(texture.image, { premultiplyAlpha: "none", colorSpaceConversion: "none" });
    }
}

/**
 * First mips of what is decoded at a time, the coarsest first. Unless `any` will do, their sides are multiples of 4. The first one is
 * one that `hasOwnCodes`.
 */
function stages(width, height, mips, any, hasOwnCodes) {
    const found = [];
    for (const largest of STAGES) {
        for (let mip = 0; mip < mips; ++mip) {
            const [w, h] = [Math.max(1, width >> mip), Math.max(1, height >> mip)];
            if (Math.max(w, h) > largest || (!any && (w % 4 || h % 4))) continue;
            if (largest === STAGES[0] && !hasOwnCodes(mip)) continue;
            if (mip !== found[found.length - 1]) found.push(mip);
            break;
        }
    }
    return found;
}
