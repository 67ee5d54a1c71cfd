// Reads a pack (.ntc) by HTTP range requests: first the parts that libntc needs to open it, then codes of mips, coarse ones first.
// docs/reference/pack-format.md specifies the file.

/**
 * `first`: bytes of the first request. `coarse`: largest side in texels of the levels that are read before the pack is opened.
 * `gap`: bytes between two wanted parts up to which one request reads both.
 */
const SIZES = { first: 1 << 16, coarse: 128, gap: 1 << 13 };
/** Codes of an entry of a level's directory. */
const RUN = 16;
const MOST_LEVELS = 16;

/** Error: the server or the file does not allow ranges. The whole file is read instead. */
class NoRanges extends Error {}

/** Returns the stored levels of a texture, finest first: {mip, last, side, cells}. Mips `mip` to `last` are decoded from one level. */
function levels({ width, height, code_mips: codeMips }, codec) {
    const isGrid = (codec.kind ?? "grid") === "grid";
    const side = isGrid ? codec.downscale : codec.block_side;
    const most = isGrid ? 1 : (codeMips ?? codec.mips);
    const stored = [];
    for (let mip = 0; mip < Math.min(codec.levels ?? MOST_LEVELS, MOST_LEVELS); ++mip) {
        const [w, h] = [Math.max(1, width >> mip), Math.max(1, height >> mip)];
        const [across, down] = [Math.ceil(w / side), Math.ceil(h / side)];
        const before = stored[stored.length - 1];
        const isHalf = 2 * w === Math.max(1, width >> (mip - 1)) && 2 * h === Math.max(1, height >> (mip - 1));
        if (before && mip - before.mip < most && isHalf) before.last = mip;
        else stored.push({ mip, last: mip, side: Math.max(w, h), cells: across * down });
        if (Math.max(across, down) <= (isGrid ? 4 : 1)) break;
    }
    return stored;
}

/** The file of a pack, read in parts or whole. */
export class PackFile {
    /** The bytes that libntc opens: zeros in place of finer mips that have not arrived. */
    bytes;
    #ask;
    #sizes;
    /** Levels of each texture, finest first: {mip, last, begin, end}, the range of bytes that was not read. null for a whole file. */
    #missing = null;

    static whole(bytes) {
        const made = new PackFile();
        made.bytes = bytes;
        return made;
    }

    /**
     * Reads enough of the pack at `url` to open it and to decode coarse mips; the whole file if the server does not support ranges.
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
            // Read the whole file: the server may not support ranges, or the file is damaged, which libntc reports.
        }
        const whole = await ask();
        if (!whole.ok) throw new Error("the file is not there");
        return PackFile.whole(new Uint8Array(await whole.arrayBuffer()));
    }

    /** Returns whether a level begins at this mip of a texture. Otherwise it is decoded from the codes of a finer mip. */
    beginsLevel(texture, mip) {
        return this.#missing === null || this.#missing[texture].some((level) => level.mip === mip);
    }

    /** Reads the parts that mips from `mip` on need and that were not read before: [{at, data}], `at` in the pack's bytes. */
    async need(texture, mip) {
        const wanted = (this.#missing?.[texture] ?? []).filter((level) => level.last >= mip && level.begin < level.end);
        const parts = wanted.map(({ begin, end }) => [begin, end]);
        const read = await this.#parts(parts);
        wanted.forEach((level) => (level.begin = level.end));
        return read;
    }

    async #readCoarse(contentRange) {
        const first = this.bytes;
        const headerBytes = Number(new DataView(first.buffer).getBigUint64(0, true));
        const size = Number(contentRange?.split("/")[1]);
        const data = 8 + headerBytes;
        // A server of another origin must expose Content-Range.
        if (!(size > 0) || !(data <= size)) throw new NoRanges();
        this.bytes = new Uint8Array(size);
        this.bytes.set(first);
        const rest = async (wanted) => {
            const unread = wanted.map(([begin, end]) => [Math.max(begin, Math.min(end, first.length)), end]);
            for (const { at, data } of await this.#parts(unread)) this.bytes.set(data, at);
        };
        await rest([[0, data]]);
        const header = JSON.parse(new TextDecoder().decode(this.bytes.subarray(8, data)));
        const { codec, textures } = JSON.parse(header.__metadata__.ntc);
        delete header.__metadata__;
        const places = Object.entries(header).map(([name, { data_offsets: [begin, end] }]) => [name, data + begin, data + end]);
        if (places.some(([, begin, end]) => !(begin >= data && begin <= end && end <= size))) throw new NoRanges();
        if (Math.max(data, ...places.map(([, , end]) => end)) !== size) throw new NoRanges();
        const words = new Map(places.filter(([name]) => /^latents\.\d+$/.test(name)).map(([name, ...range]) => [name, range]));
        let wanted = places.filter(([name]) => !words.has(name)).map(([, ...range]) => range);
        const searches = textures.map((texture, number) => new Levels(texture, codec, this.#sizes.coarse, words.get(`latents.${number}`)));
        // The end of a level, and so the begin of the next one, follows from its directory.
        do {
            await rest([...wanted, ...searches.flatMap((search) => search.next(this.bytes))]);
            wanted = [];
        } while (searches.some((search) => !search.isDone));
        this.#missing = searches.map((search) => search.stored);
    }

    /** Reads all `wanted` ranges: [{at, data}]. One request reads ranges that are close to each other. */
    async #parts(wanted) {
        const sorted = wanted.filter(([begin, end]) => begin < end).sort((a, b) => a[0] - b[0]);
        const runs = [];
        for (const range of sorted) {
            const run = runs[runs.length - 1];
            if (run && range[0] <= run.end + this.#sizes.gap) {
                run.end = Math.max(run.end, range[1]);
                run.parts.push(range);
            } else runs.push({ begin: range[0], end: range[1], parts: [range] });
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

/** Search for the levels of one texture in its latents, from the finest on. */
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

    /** Returns the ranges to read next: a directory, or all coarse levels. `bytes` must hold the ranges of the last call. */
    next(bytes) {
        while (!this.isDone) {
            const level = this.#levels[this.stored.length];
            if (level === undefined || level.side <= this.#coarse) {
                this.isDone = true;
                const coarse = this.#levels.slice(this.stored.length);
                this.stored.push(...coarse.map((level) => ({ ...level, begin: this.#end, end: this.#end })));
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

    /** Returns {begin, size}: where the codes of a level begin, and the bytes of the level, or null if its directory must be read for that. */
    #codes(cells) {
        const { kind, latent_channels: channels, latent_bits: bits, block_words: sizes } = this.#codec;
        if ((kind ?? "grid") === "grid") return { begin: this.#at, size: (cells * channels * bits) / 8 };
        if (sizes.length === 1) return { begin: this.#at, size: 4 * cells * sizes[0] };
        return { begin: this.#at + 8 * Math.ceil(cells / RUN), size: null };
    }

    /** Returns the bytes of a level from its directory: the place of its last run, plus the codes of that run. */
    #directorySize(bytes, cells) {
        const last = Math.ceil(cells / RUN) - 1;
        const view = new DataView(bytes.buffer, this.#at + 8 * last, 8);
        const classes = view.getUint32(4, true);
        let words = view.getUint32(0, true);
        for (let code = 0; code < cells - RUN * last; ++code) words += this.#codec.block_words[(classes >>> (2 * code)) & 3] ?? NaN;
        return 4 * words;
    }
}
