// Reads a pack (.ntc) by HTTP range requests: first what libntc opens it with, then the codes of mips, coarse ones first.
// docs/reference/pack-format.md says what lies where.

/**
 * Bytes of the first request; texels a side of levels that are read before the pack is opened, at most; bytes between two wanted parts
 * that are read too, rather than asked around.
 */
const SIZES = { first: 1 << 16, coarse: 128, gap: 1 << 13 };
const RUN = 16;
const MOST_LEVELS = 16;

/** A server, or a file, that ranges do not go with: the whole file is read instead. */
class NoRanges extends Error {}

/** The levels of a texture that have codes of their own, finest first: {mip, last, side, cells}, for mips `mip` to `last`. */
function levels({ width, height, code_mips: codeMips }, codec) {
    const isGrid = (codec.kind ?? "grid") === "grid";
    const side = isGrid ? codec.downscale : codec.block_side;
    const most = isGrid ? 1 : (codeMips ?? codec.mips);
    const found = [];
    for (let mip = 0; mip < Math.min(codec.levels ?? MOST_LEVELS, MOST_LEVELS); ++mip) {
        const [w, h] = [Math.max(1, width >> mip), Math.max(1, height >> mip)];
        const [across, down] = [Math.ceil(w / side), Math.ceil(h / side)];
        const before = found[found.length - 1];
        const isHalf = 2 * w === Math.max(1, width >> (mip - 1)) && 2 * h === Math.max(1, height >> (mip - 1));
        if (before && mip - before.mip < most && isHalf) before.last = mip;
        else found.push({ mip, last: mip, side: Math.max(w, h), cells: across * down });
        if (Math.max(across, down) <= (isGrid ? 4 : 1)) break;
    }
    return found;
}

/** A pack whose file is read in parts, or whole. */
export class PackFile {
    /** The file's bytes as libntc opens them: zeros where finer mips have not arrived. */
    bytes;
    #ask;
    #sizes;
    /** By texture, finest first: {mip, last, begin, end}: the bytes of codes that have not been asked for; null for a whole file. */
    #missing = null;

    static whole(bytes) {
        const made = new PackFile();
        made.bytes = bytes;
        return made;
    }

    /**
     * Reads the pack at `url`: whole where the server knows no ranges, else so much that it can be opened and coarse mips decoded.
     * @param {RequestInit} request
     */
    static async read(url, request, sizes = SIZES) {
        const ask = (range) => fetch(url, range ? { ...request, headers: { ...request.headers, Range: range } } : request);
        const made = new PackFile();
        made.#ask = ask;
        made.#sizes = sizes;
        const response = await ask(`bytes=0-${sizes.first - 1}`);
        const isPart = response.status === 206;
        if (!response.ok && response.status !== 416) throw new Error("the file is not there");
        try {
            if (response.ok) made.bytes = new Uint8Array(await response.arrayBuffer());
            if (isPart) await made.#readCoarse(response.headers.get("Content-Range"));
            if (response.ok) return made;
        } catch {
            // Damaged files are libntc's to judge, servers without ranges give the whole one.
        }
        const whole = await ask();
        if (!whole.ok) throw new Error("the file is not there");
        return PackFile.whole(new Uint8Array(await whole.arrayBuffer()));
    }

    /** Whether a mip of a texture has codes of its own, so that no finer mip's are read for it. */
    hasOwnCodes(texture, mip) {
        return this.#missing === null || this.#missing[texture].some((level) => level.mip === mip);
    }

    /** Reads what decoding needs from `mip` on, and was not read before: [{at, data}], for the pack's bytes. */
    async need(texture, mip) {
        const wanted = (this.#missing?.[texture] ?? []).filter((level) => level.last >= mip && level.begin < level.end);
        const parts = wanted.map(({ begin, end }) => [begin, end]);
        const found = await this.#parts(parts);
        wanted.forEach((level) => (level.begin = level.end));
        return found;
    }

    async #readCoarse(contentRange) {
        const first = this.bytes;
        const headerBytes = Number(new DataView(first.buffer).getBigUint64(0, true));
        const size = Number(contentRange?.split("/")[1]);
        const data = 8 + headerBytes;
        // Other origins show the size only if they are asked to.
        if (!(size > 0) || !(data <= size)) throw new NoRanges();
        this.bytes = new Uint8Array(size);
        this.bytes.set(first);
        const rest = async (wanted) => {
            const news = wanted.map(([begin, end]) => [Math.max(begin, Math.min(end, first.length)), end]);
            for (const { at, data } of await this.#parts(news)) this.bytes.set(data, at);
        };
        await rest([[0, data]]);
        const header = JSON.parse(new TextDecoder().decode(this.bytes.subarray(8, data)));
        const { codec, textures } = JSON.parse(header.__metadata__.ntc);
        delete header.__metadata__;
        const places = Object.entries(header).map(([name, { data_offsets: [begin, end] }]) => [name, data + begin, data + end]);
        if (places.some(([, begin, end]) => !(begin >= data && begin <= end && end <= size))) throw new NoRanges();
        if (Math.max(data, ...places.map(([, , end]) => end)) !== size) throw new NoRanges();
        const words = new Map(places.filter(([name]) => /^latents\.\d+$/.test(name)).map(([name, ...own]) => [name, own]));
        let wanted = places.filter(([name]) => !words.has(name)).map(([, ...own]) => own);
        const found = textures.map((texture, number) => new Levels(texture, codec, this.#sizes.coarse, words.get(`latents.${number}`)));
        // A directory says where the next level begins.
        do {
            await rest([...wanted, ...found.flatMap((own) => own.next(this.bytes))]);
            wanted = [];
        } while (found.some((own) => !own.isDone));
        this.#missing = found.map((own) => own.stored);
    }

    /** The bytes of all `wanted` ranges: [{at, data}]. Near ones come in one answer. */
    async #parts(wanted) {
        const sorted = wanted.filter(([begin, end]) => begin < end).sort((a, b) => a[0] - b[0]);
        const runs = [];
        for (const own of sorted) {
            const run = runs[runs.length - 1];
            if (run && own[0] <= run.end + this.#sizes.gap) {
                run.end = Math.max(run.end, own[1]);
                run.parts.push(own);
            } else runs.push({ begin: own[0], end: own[1], parts: [own] });
        }
        const answers = runs.map(async ({ begin, end, parts }) => {
            const response = await this.#ask(`bytes=${begin}-${end - 1}`);
            const data = new Uint8Array(response.status === 206 ? await response.arrayBuffer() : 0);
            if (data.length !== end - begin) throw new NoRanges("a part of the pack cannot be read");
            return parts.map(([from, to]) => ({ at: from, data: data.slice(from - begin, to - begin) }));
        });
        return (await Promise.all(answers)).flat();
    }
}

/** Finds the levels of one texture in its words, from the finest on. */
class Levels {
    isDone = false;
    stored = [];
    #levels;
    #codec;
    #coarse;
    #at;
    #end;
    #directory = null;

    constructor(texture, codec, coarse, [begin, end]) {
        this.#levels = levels(texture, codec);
        this.#codec = codec;
        this.#coarse = coarse;
        [this.#at, this.#end] = [begin, end];
    }

    /** The ranges that are needed next, when those of the last call are in `bytes`: a directory, or all coarse levels. */
    next(bytes) {
        while (!this.isDone) {
            const level = this.#levels[this.stored.length];
            if (level === undefined || level.side <= this.#coarse) {
                this.isDone = true;
                const coarse = this.#levels.slice(this.stored.length);
                this.stored.push(...coarse.map((own) => ({ ...own, begin: this.#end, end: this.#end })));
                return [[this.#at, this.#end]];
            }
            const { begin, size } = this.#codes(level.cells);
            if (size === null && this.#directory === null) {
                this.#directory = [this.#at, begin];
                return [this.#directory];
            }
            const end = this.#at + (size ?? this.#directorySize(bytes, level.cells));
            if (!(end >= begin && end <= this.#end)) throw new NoRanges();
            this.stored.push({ ...level, begin, end });
            [this.#at, this.#directory] = [end, null];
        }
        return [];
    }

    /** Where the codes of a level begin, and the bytes of the whole level if the directory need not say them. */
    #codes(cells) {
        const { kind, latent_channels: channels, latent_bits: bits, block_words: sizes } = this.#codec;
        if ((kind ?? "grid") === "grid") return { begin: this.#at, size: (cells * channels * bits) / 8 };
        if (sizes.length === 1) return { begin: this.#at, size: 4 * cells * sizes[0] };
        return { begin: this.#at + 8 * Math.ceil(cells / RUN), size: null };
    }

    /** Bytes of the level whose directory has arrived: its last run's place, and the codes of that run. */
    #directorySize(bytes, cells) {
        const last = Math.ceil(cells / RUN) - 1;
        const view = new DataView(bytes.buffer, this.#at + 8 * last, 8);
        const classes = view.getUint32(4, true);
        let words = view.getUint32(0, true);
        for (let code = 0; code < cells - RUN * last; ++code) words += this.#codec.block_words[(classes >>> (2 * code)) & 3] ?? NaN;
        return 4 * words;
    }
}
