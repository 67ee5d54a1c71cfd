// Textures of three.js whose mips are loaded and dropped, and the memory limit that they share.

import { CompressedTexture, RGBAFormat } from "three";

/** A texture whose mips arrive from the coarsest on. Its clones, which GLTFLoader makes, get the same mips. */
export class MippedTexture extends CompressedTexture {
    /** All textures that show the same mips, this one and its clones. */
    family = new Set([this]);
    /** The TextureSet that loads its mips. */
    set = null;

    copy(source) {
        super.copy(source);
        this.family = source.family.add(this);
        this.set = source.set;
        return this;
    }

    /** Shows `mips`, the finest first, and no others. */
    show(mips) {
        const [{ width, height }] = mips;
        for (const texture of this.family) {
            // The GPU texture has a fixed size, so it is made again.
            texture.dispose();
            texture.mipmaps = mips;
            texture.image = { width, height };
            texture.needsUpdate = true;
        }
    }
}

/** Limit of the bytes that textures take on the GPU. Plug-ins with the same object share it. */
export class TextureMemory {
    used = 0;
    sets = new Set();

    /** @param {number} limit Bytes. Coarse mips are loaded even beyond it. */
    constructor(limit = Infinity) {
        this.limit = limit;
    }

    /**
     * Reserves the bytes of `set` for mips from `mip` on, or from a coarser one if they do not fit. Textures out of sight lose their
     * finer mips for it, the longest unseen first. Returns the finest mip that fits, at least `set.level`.
     */
    take(set, mip) {
        if (mip >= set.coarsest) {
            this.count(set, mip);
            return mip;
        }
        const isFull = (level) => this.used + set.bytes(level) - set.counted > this.limit;
        const unseen = [...this.sets].filter((other) => other !== set && !other.isSeen && other.level < other.coarsest);
        unseen.sort((a, b) => a.seenAt - b.seenAt);
        while (isFull(mip) && unseen.length > 0) unseen.shift().shrink();
        let level = mip;
        while (level < set.level && isFull(level)) level = set.fit(level + 1);
        this.count(set, Math.min(level, set.level));
        return Math.min(level, set.level);
    }

    /** Counts the bytes of `set` as if its finest mip were `level`. */
    count(set, level) {
        this.sets.add(set);
        this.used += set.bytes(level) - set.counted;
        set.counted = set.bytes(level);
    }
}

/** The textures that show one texture of a pack, or one image. All have the same mips. */
export class TextureSet {
    width = 0;
    height = 0;
    mips = 0;
    /** The finest mip that is loaded. */
    level = Infinity;
    /** The finest mip that stays loaded while the set is out of sight. */
    coarsest = Infinity;
    /** Bytes that TextureMemory has counted for this set. */
    counted = 0;
    /** Whether the set is in sight. */
    isSeen = false;
    /** Whether the set is being decoded. */
    isBusy = false;
    seenAt = -Infinity;
    /** The finest mip of each decoding step, the coarsest step first. */
    steps = [];
    /** Smallest distance in sight of neighbouring pixels, in texture coordinates. */
    footprint = 0;

    /**
     * @param {MippedTexture[]} textures
     * @param {TextureMemory} memory
     * @param {(first: number, last: number) => Promise<{data: Uint8Array, width: number, height: number}[][]>} decode Mips `first` to
     * `last` of each texture.
     */
    constructor(textures, memory, decode) {
        Object.assign(this, { textures, memory, decode });
        textures.forEach((texture) => (texture.set = this));
    }

    /** Sets the size of mip 0, the number of mips and `steps`. */
    resize(width, height, mips, steps) {
        Object.assign(this, { width, height, mips, steps, coarsest: steps[0] });
    }

    /** Returns the bytes of all textures on the GPU, for mips from `level` on. */
    bytes(level) {
        let texels = 0;
        for (let mip = level; mip < this.mips; ++mip) texels += Math.max(1, this.width >> mip) * Math.max(1, this.height >> mip);
        return this.textures.reduce((sum, { format }) => sum + texels * (format === RGBAFormat ? 4 : 1), 0);
    }

    /** Returns the mip `level`, or the next coarser one whose size the formats of all textures allow. */
    fit(level) {
        const isPlain = this.textures.every(({ format }) => format === RGBAFormat);
        const isWhole = (mip) => isPlain || (((this.width >> mip) % 4 || (this.height >> mip) % 4) === 0);
        while (level < this.level && !isWhole(level)) ++level;
        return level;
    }

    /** Returns the finest mip that is read where neighbouring pixels are `footprint` apart in texture coordinates. */
    mipOf(footprint) {
        const mip = Math.floor(Math.log2(Math.max(footprint * Math.max(this.width, this.height), 1)));
        return Math.min(mip, this.mips - 1);
    }

    /** Decodes and shows mips from `mip` on, as memory allows. Returns whether anything changed. */
    async refine(mip) {
        const level = this.memory.take(this, mip);
        if (level >= this.level) return false;
        const isFirst = this.level === Infinity;
        try {
            const mips = await this.decode(level, (isFirst ? this.mips : this.level) - 1);
            this.textures.forEach((texture, number) => texture.show(isFirst ? mips[number] : [...mips[number], ...texture.mipmaps]));
            this.level = level;
        } finally {
            this.memory.count(this, this.level);
        }
        return true;
    }

    /** Drops mips that are finer than `coarsest`. */
    shrink() {
        if (this.isBusy) return;
        for (const texture of this.textures) texture.show(texture.mipmaps.slice(this.coarsest - this.level));
        this.level = this.coarsest;
        this.memory.count(this, this.level);
    }
}
