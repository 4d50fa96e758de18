// The map in the browser: tiles as they came, figures about all of them kept as they change. Every update costs
// what the tile costs, whatever the size of the map.

export const TILE_SIDE = 16;
export const TILE_AREA = TILE_SIDE * TILE_SIDE;
const COARSE_STEP = 4; // cells along a coarse cell
const COARSE_AT = 2 * TILE_AREA; // of a tile as kept
export const TILE_WORDS = COARSE_AT + (TILE_SIDE / COARSE_STEP) ** 2;
const BIN_Q8 = 16; // a sixteenth of a cell
const UNKNOWN_DEEP = 0xffffffff; // deeper than any cell

/** The coarse cell of a tile that stands in for its cell k; 0: none does. */
export function coarseOver(tile, k) {
  return tile[COARSE_AT + Math.floor(k / TILE_SIDE / COARSE_STEP) * (TILE_SIDE / COARSE_STEP) + Math.floor((k % TILE_SIDE) / COARSE_STEP)];
}

export class MapStore {
  /** @param map the state message's "map" */
  constructor(map) {
    this.cellM = map.cell_mm / 1000;
    this.size = map.size_cells; // north, east, down
    this.originM = map.origin_mm.map((mm) => mm / 1000);
    this.tilesEast = Math.ceil(this.size[1] / TILE_SIDE);
    this.tiles = new Map(); // number -> Uint32Array: 256 cells, 256 times, 16 coarse cells
    this.known = 0;
    this.coarse = 0; // coarse cells: what they stand in for is not known
    this.depthBins = new Int32Array((Math.min(this.size[2] * 2, 2048) * 256) / BIN_Q8 + 1);
    this.sigmaBins = new Int32Array(31);
    this.firstTimeDs = Infinity;
    this.obstacleM = -Infinity;
    this.obstacleTiles = new Map(); // number -> what obstaclesOf() found, where it found some
    this.obstacleCount = 0;
    // Known cells' bounds, in cells.
    this.bounds = null;
  }

  /** Whether anything is to be seen. */
  get shown() { return this.known + this.coarse > 0; }

  /** Takes a tile (its own number, 256 cells, 256 times; 16 coarse cells where some stand in for cells) and returns it as kept. */
  setTile(message) {
    const id = message[0];
    const rows = Math.ceil(this.size[0] / TILE_SIDE);
    if (id >= rows * this.tilesEast) return null;
    const before = this.tiles.get(id);
    const now = new Uint32Array(TILE_WORDS);
    now.set(message.subarray(1));
    if (before) this.#countAll(before, -1);
    this.#countAll(now, 1);
    for (let k = 0; k < TILE_AREA; k++) {
      if (now[k] & 31) this.firstTimeDs = Math.min(this.firstTimeDs, now[TILE_AREA + k]);
    }
    this.tiles.set(id, now);
    this.#noteObstacles(id, now);
    const north = Math.floor(id / this.tilesEast) * TILE_SIDE;
    const east = (id % this.tilesEast) * TILE_SIDE;
    const b = this.bounds ?? (this.bounds = { north0: north, north1: north, east0: east, east1: east });
    b.north0 = Math.min(b.north0, north);
    b.north1 = Math.max(b.north1, Math.min(north + TILE_SIDE, this.size[0]));
    b.east0 = Math.min(b.east0, east);
    b.east1 = Math.max(b.east1, Math.min(east + TILE_SIDE, this.size[1]));
    return now;
  }

  removeTile(id) {
    const tile = this.tiles.get(id);
    if (!tile) return;
    this.#countAll(tile, -1);
    this.tiles.delete(id);
    this.#noteObstacles(id, null);
  }

  #countAll(tile, by) {
    for (let k = 0; k < TILE_AREA; k++) this.known += this.#count(tile[k], by);
    for (let k = COARSE_AT; k < TILE_WORDS; k++) this.coarse += this.#count(tile[k], by, COARSE_STEP * COARSE_STEP);
  }

  /** `cells`: how many this one stands for. */
  #count(cell, by, cells = 1) {
    const code = (cell & 31) - 1;
    if (code < 0) return 0;
    this.sigmaBins[code] += by * cells;
    const bin = Math.floor((cell >>> 8) / BIN_Q8);
    this.depthBins[Math.min(bin, this.depthBins.length - 1)] += by * cells;
    return by;
  }

  depthOf(cell) {
    return this.originM[2] + ((cell >>> 8) * this.cellM) / 256;
  }
  /** Sigma of a code: 2^(k/2) / 64 cells (proto/SPEC.md, "Cells"). */
  sigmaOf(code) {
    return (Math.pow(2, code / 2) / 64) * this.cellM;
  }

  /** What is known of a cell, or null. */
  cell(north, east) {
    const found = this.#find(north, east);
    if (!found) return null;
    const { tile, k } = found;
    const code = (tile[k] & 31) - 1;
    if (code < 0) return null;
    return {
      depthM: this.depthOf(tile[k]),
      sigmaM: this.sigmaOf(code),
      timeS: tile[TILE_AREA + k] / 10,
      secondSurface: (tile[k] & 32) !== 0,
      disputed: (tile[k] & 64) !== 0,
    };
  }
  /** What stands in for a cell that is not known: { depthM, sigmaM, coarse: true }; of a known one, that; or null. */
  shownCell(north, east) {
    const known = this.cell(north, east);
    const found = known ? null : this.#find(north, east);
    const over = found ? coarseOver(found.tile, found.k) : 0;
    return over & 31 ? { depthM: this.depthOf(over), sigmaM: this.sigmaOf((over & 31) - 1), coarse: true } : known;
  }
  #find(north, east) {
    if (north < 0 || east < 0 || north >= this.size[0] || east >= this.size[1]) return null;
    const tile = this.tiles.get(
      Math.floor(north / TILE_SIDE) * this.tilesEast + Math.floor(east / TILE_SIDE));
    return tile ? { tile, k: (north % TILE_SIDE) * TILE_SIDE + (east % TILE_SIDE) } : null;
  }
  /** Depth (1/256 cell) that is drawn for a cell, coarse ones too; -1: none. */
  drawnQ8(north, east) {
    const found = this.#find(north, east);
    if (!found) return -1;
    const word = found.tile[found.k] & 31 ? found.tile[found.k] : coarseOver(found.tile, found.k);
    return word & 31 ? word >>> 8 : -1;
  }
  /** The drawn surface over a cell that is drawn: depths (1/256 cell) of its corners, each the mean of the cells around
      it: south-west, south-east, north-west, north-east. */
  corners(north, east) {
    return [[0, 0], [0, 1], [1, 0], [1, 1]].map(([dn, de]) => {
      let sum = 0, count = 0;
      for (const n of [north + dn - 1, north + dn]) {
        for (const e of [east + de - 1, east + de]) {
          const depth = this.drawnQ8(n, e);
          if (depth < 0) continue;
          sum += depth;
          count++;
        }
      }
      return sum / count;
    });
  }
  /** Depth (metres) of the drawn surface at a place; null: nothing is drawn there. */
  surfaceAt(northM, eastM) {
    const n = (northM - this.originM[0]) / this.cellM, e = (eastM - this.originM[1]) / this.cellM;
    const cell = [Math.floor(n), Math.floor(e)];
    if (this.drawnQ8(...cell) < 0) return null;
    return this.originM[2] + (facet(this.corners(...cell), n - cell[0], e - cell[1]) * this.cellM) / 256;
  }

  /** The same by place, metres of the survey's frame. */
  at(northM, eastM) { return this.cell(...this.#index(northM, eastM)); }
  shownAt(northM, eastM) { return this.shownCell(...this.#index(northM, eastM)); }
  #index(northM, eastM) {
    return [Math.floor((northM - this.originM[0]) / this.cellM), Math.floor((eastM - this.originM[1]) / this.cellM)];
  }

  /** Cells that the bins count: known ones, and those that coarse ones stand in for. */
  get #counted() { return this.known + this.coarse * COARSE_STEP * COARSE_STEP; }

  /** Depth that `share` of the cells that are shown do not exceed. */
  depthQuantile(share) {
    let left = this.#counted * share;
    for (let bin = 0; bin < this.depthBins.length; bin++) {
      left -= this.depthBins[bin];
      if (left < 0 || (left <= 0 && share >= 1)) {
        return this.originM[2] + ((bin + 0.5) * BIN_Q8 * this.cellM) / 256;
      }
    }
    return this.originM[2];
  }
  sigmaQuantile(share) {
    let left = this.#counted * share;
    for (let code = 0; code < 31; code++) {
      left -= this.sigmaBins[code];
      if (left < 0) return this.sigmaOf(code);
    }
    return this.sigmaOf(30);
  }

  /** Known cells shallower than a depth: how many, the shallowest, and its place. Another depth than the last time goes
      through the whole map; the same one through the tiles that have any. */
  obstacles(depthM) {
    if (depthM !== this.obstacleM) {
      this.obstacleM = depthM;
      this.obstacleTiles.clear();
      this.obstacleCount = 0;
      for (const [id, tile] of this.tiles) this.#noteObstacles(id, tile);
    }
    let id = -1, best = { k: 0, cell: UNKNOWN_DEEP };
    for (const [tile, found] of this.obstacleTiles) {
      if (found.cell < best.cell) [id, best] = [tile, found];
    }
    return {
      count: this.obstacleCount, depthM: this.depthOf(best.cell),
      northM: this.originM[0] + (Math.floor(id / this.tilesEast) * TILE_SIDE + Math.floor(best.k / TILE_SIDE) + 0.5) * this.cellM,
      eastM: this.originM[1] + ((id % this.tilesEast) * TILE_SIDE + (best.k % TILE_SIDE) + 0.5) * this.cellM,
    };
  }
  #noteObstacles(id, tile) {
    this.obstacleCount -= this.obstacleTiles.get(id)?.count ?? 0;
    this.obstacleTiles.delete(id);
    if (this.obstacleM === -Infinity) return; // nobody has asked
    const found = { count: 0, k: 0, cell: UNKNOWN_DEEP };
    for (let k = 0; tile && k < TILE_AREA; k++) {
      if (!(tile[k] & 31) || this.depthOf(tile[k]) >= this.obstacleM) continue;
      found.count++;
      if (tile[k] >>> 8 < found.cell >>> 8) [found.k, found.cell] = [k, tile[k]];
    }
    if (!found.count) return;
    this.obstacleCount += found.count;
    this.obstacleTiles.set(id, found);
  }

  /** Slope (degrees) that `share` of some thousand cells, from all over the map, do not exceed. */
  slopeQuantile(share) {
    const slopes = [];
    const every = Math.max(Math.floor(this.tiles.size / 256), 1);
    let i = 0;
    for (const [id, tile] of this.tiles) {
      if (i++ % every) continue;
      for (let k = id % 7; k < TILE_AREA - TILE_SIDE - 1; k += 11) {
        const [here, east, north] = [tile[k], tile[k + 1], tile[k + TILE_SIDE]];
        if (!(here & 31 && east & 31 && north & 31) || k % TILE_SIDE === TILE_SIDE - 1) continue;
        slopes.push(Math.hypot((east >>> 8) - (here >>> 8), (north >>> 8) - (here >>> 8)) / 256);
      }
    }
    slopes.sort((a, b) => a - b);
    return slopes.length ? (Math.atan(slopes[Math.floor(share * (slopes.length - 1))]) * 180) / Math.PI : 0;
  }

  /** Depths along a line between two places (metres), one sample per cell that it crosses or finer. */
  profile(from, to) {
    const length = Math.hypot(to.northM - from.northM, to.eastM - from.eastM);
    const steps = Math.min(Math.max(Math.ceil((2 * length) / this.cellM), 1), 4000);
    const samples = [];
    for (let i = 0; i <= steps; i++) {
      const t = i / steps;
      const northM = from.northM + (to.northM - from.northM) * t;
      const eastM = from.eastM + (to.eastM - from.eastM) * t;
      samples.push({ alongM: length * t, northM, eastM, cell: this.at(northM, eastM) });
    }
    return samples;
  }

  /** Area of a polygon (square metres, horizontal) and how much of it is known (0 .. 1). */
  area(points) {
    let twice = 0;
    for (let i = 0; i < points.length; i++) {
      const a = points[i], b = points[(i + 1) % points.length];
      twice += a.eastM * b.northM - b.eastM * a.northM;
    }
    const norths = points.map((p) => p.northM), easts = points.map((p) => p.eastM);
    // At most about 200 x 200 samples.
    const step = Math.max(this.cellM,
      (Math.max(...norths) - Math.min(...norths)) / 200, (Math.max(...easts) - Math.min(...easts)) / 200);
    let inside = 0, known = 0;
    for (let n = Math.min(...norths) + step / 2; n < Math.max(...norths); n += step) {
      for (let e = Math.min(...easts) + step / 2; e < Math.max(...easts); e += step) {
        if (!contains(points, n, e)) continue;
        inside++;
        if (this.at(n, e)) known++;
      }
    }
    return { squareM: Math.abs(twice) / 2, known: inside ? known / inside : 0 };
  }
}

/** Of the two triangles between a cell's corners, which meet from south-east to north-west: depth at north, east (0 .. 1). */
export function facet([southWest, southEast, northWest, northEast], north, east) {
  return north + east <= 1 ? southWest + east * (southEast - southWest) + north * (northWest - southWest)
    : northEast + (1 - east) * (northWest - northEast) + (1 - north) * (southEast - northEast);
}

function contains(points, northM, eastM) {
  let inside = false;
  for (let i = 0, j = points.length - 1; i < points.length; j = i++) {
    const a = points[i], b = points[j];
    if (a.northM > northM !== b.northM > northM &&
        eastM < ((b.eastM - a.eastM) * (northM - a.northM)) / (b.northM - a.northM) + a.eastM) {
      inside = !inside;
    }
  }
  return inside;
}

/** A step of 1, 2 or 5 times a power of ten that is near `wanted`. */
export function roundStep(wanted) {
  const power = Math.pow(10, Math.floor(Math.log10(wanted)));
  const x = wanted / power;
  return power * (x < 1.5 ? 1 : x < 3.5 ? 2 : x < 7.5 ? 5 : 10);
}
